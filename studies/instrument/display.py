"""Names that people read for a card's keys, beside them or in their place: "temperature slope of the shear modulus"."""

from studies.instrument.units import split_unit, unit_of

WHOLE = {
    "inverse_q": "1/Q",
    "bias.offset_deg_per_h": "bias offset",
    "bias.pattern_angle_deg": "azimuth of the standing wave",
    "law.f0_Hz": "frequency at the reference temperature",
    "law.a1_per_K": "relative temperature slope of the frequency",
    "law.a2_per_K2": "quadratic term of the frequency",
    "law.a3_per_K3": "cubic term of the frequency",
    "law.lag_s": "lag of the resonator behind its housing",
    "law.chamber_lag_s": "lag of the housing behind its chamber",
    "law.delay_s": "delay of the resonator beside its lag",
    "law.bias_bend": "part of the bend of the frequency that the bias follows",
    "loss.inverse_q": "1/Q at the reference temperature",
    "loss.slope_per_K": "relative temperature slope of 1/Q",
    "loss.curvature_per_K2": "relative temperature curvature of 1/Q",
    "loss.pressure_Pa": "gas pressure in the housing",
    "noise.housing_lag_s": "lag of the housing sensor",
    "noise.bias_turn_on_deg_per_h": "run-to-run offset of the bias",
    "thermal.film_emissivity": "emissivity of the film",
    "thermal.film_housing_share": "share of the film's radiation with the housing",
    "thermal.base_heat_capacity_J_per_K": "heat capacity of the base",
    "thermal.base_capacity_slope_per_K": "slope of the base's heat capacity",
    "thermal.housing_heat_capacity_J_per_K": "heat capacity of the housing",
    "thermal.chamber_conductance_W_per_K": "conductance chamber to housing",
    "thermal.mount_conductance_W_per_K": "conductance housing to base",
    "thermal.mount_exchange_cm2": "radiative exchange housing to base",
    "thermal.second_mass_J_per_K": "heat capacity of a part on the base",
    "thermal.second_mass_conductance_W_per_K": "conductance base to that part",
    "thermal.conductivity_W_per_m_K": "thermal conductivity of the shell",
    "thermal.heat_capacity_J_per_kg_K": "specific heat of the shell",
    "loop.frequency_split_mHz": "frequency split",
    "loop.frequency_axis_deg": "axis of the frequency split",
    "loop.misalignment_mrad": "misalignment of drives and pick-offs",
    "mount.expansion_per_K": "expansion of the mount",
}
"""By the dotted key, for names that the words of the key do not make."""

WORDS = {"pickoff": "pick-off", "youngs": "Young's", "poisson": "Poisson's", "q": "Q", "adc": "ADC", "dac": "DAC"}
POLYNOMIAL = {
    "k1": "f", "k2": "f²", "k3": "f³", "k4": "ḟ", "k5": "ḟ²", "k6": "ḟ³", "k7": "f ḟ", "k8": "f² ḟ", "k9": "f ḟ²",
}  # fmt: skip
ERRORS = {
    "gain_ratio": "gain mismatch",
    "phase": "phase error",
    "phase_difference": "phase difference",
    "skew": "axis skew",
}
ORDERS = {"slope": "temperature slope of {}", "curvature": "temperature curvature of {}", "value": "{}"}
PROPERTIES = {
    "youngs_modulus": "Young's modulus", "shear_modulus": "the shear modulus",
    "poisson_ratio": "Poisson's ratio", "density": "the density", "expansion": "the thermal expansion",
}  # fmt: skip
NODES = {"conductance": "conductance", "exchange": "radiative exchange", "capacity": "heat capacity"}


def display_name(key: str) -> str:
    """Return what people call a dotted key of a card; without a name of its own, the words of the key without its unit."""
    words = [word for word in key.split(".") if not word.isdigit()]
    plain = split_unit(words[-1])[0]
    if name := WHOLE.get(".".join(words)):
        return name
    if len(words) > 1 and words[-2] in PROPERTIES:
        order = plain.removeprefix("log_")
        return ORDERS.get(order, order + " of {}").format(PROPERTIES[words[-2]]).removeprefix("the ")
    if words[0] == "bias" and plain in POLYNOMIAL:
        return f"bias coefficient {plain} ({POLYNOMIAL[plain]})"
    side, _, error = plain.partition("_")
    if words[0] == "loop" and error in ERRORS:
        return f"{WORDS.get(side, side)} {ERRORS[error]}"
    parts = [WORDS.get(word, word) for word in plain.split("_")]
    places = [str(int(word) + 1) for word in key.split(".") if word.isdigit()]
    if places and words == ["resonator", "thickness_mm"]:
        return f"wall thickness at point {places[0]}"
    of = [" ".join([words[-2].replace("_", " "), *places])] if places else []
    return " ".join(of + parts)


def spell_parameter(name: str) -> tuple[str, float]:
    """Return a parameter's name with its unit in brackets, and what its value is multiplied by: rates are in K/min."""
    words, unit = (display_name(name), unit_of(name)) if "." in name else split_unit(name)
    factor = 1.0
    if unit.endswith(("/(K/s)", "/(K²/s)")):
        unit, factor = unit.replace("/(K/s)", " per K/min").replace("/(K²/s)", " per K²/min"), 1.0 / 60.0
    unit = unit.replace("1 per ", "per ")
    return (words if "." in name else words.replace("_", " ")) + (f" ({unit})" if unit != "1" else ""), factor


def name_constant(name: str) -> str:
    """Return what people call a constant of the heat path: "conductance housing-base" is "conductance housing to base"."""
    kind, _, where = name.partition(" ")
    return f"{NODES.get(kind, kind)} {where.replace('-', ' to ') if '-' in where else f'of the {where}'}"
