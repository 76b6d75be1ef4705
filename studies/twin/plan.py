"""Tables of a card for the C twin: parameters by the card's names, heat path, law, effects; and what cannot be carried."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from compensation.arrays import Array
from shell.constants import zero_Celsius
from studies.effects import find_effect
from studies.effects.effect import AROUND, spell_out
from studies.effects.states import Lags
from studies.errors import InputError
from studies.instrument.registry import possible_keys
from studies.instrument.units import unit_of
from studies.resonator.splitting import mean_changes, reference_split
from studies.simulation.heat_path import SENSOR, behind_housing, build_network, with_sensor
from studies.simulation.response import lags_of, observed_rows
from thermal.network import assemble
from thermal.resonator import describe_resonator

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

    from shell.law import FrequencyLaw
    from shell.layout import Theory
    from studies.instrument.card import Instrument
    from studies.simulation.drive import Boundary
    from thermal.network import Network

TABLES = ("thermal", "loss", "bias", "noise", "loop")
FIXED = (
    "thermal.film_housing_share",
    "thermal.base_capacity_slope_per_K",
    "thermal.cells",
    "thermal.stem_radius_mm",
    "thermal.stem_length_mm",
)
"""Numbers of those tables that have become part of the network."""
SCALES = {
    "housing": "thermal.housing_heat_capacity_J_per_K",
    SENSOR: "thermal.housing_heat_capacity_J_per_K",
    "base": "thermal.base_heat_capacity_J_per_K",
    "mass": "thermal.second_mass_J_per_K",
    "base-mass": "thermal.second_mass_conductance_W_per_K",
    "chamber-housing": "thermal.chamber_conductance_W_per_K",
    "housing-base": "thermal.mount_conductance_W_per_K",
    "radiated housing-base": "thermal.mount_exchange_cm2",
    "radiated": "thermal.film_emissivity",
    "conducted": "thermal.conductivity_W_per_m_K",
    "shell": "thermal.heat_capacity_J_per_kg_K",
}
OF_LOOPS = ("gain", "phase_d", "phase_deg", "skew", "misalignment", "split", "axis", "per_Hz", "range", "headroom")
"""Parts of the names of those keys of [loop] that act on settled loops."""
PRECESSION = "loop.self_precession_deg_per_s"
ONE = ".one"
START = "start_s"
"""When a run begins, s since 1970 (UTC), from which effects with a date count on; before all dates, as 0 is, they begin with the run."""
REACH = 150.0  # K on both sides of its reference, within which a polynomial law is carried
MEMORY = 16, 15  # numbers that one effect may remember, and more for each lag of the resonator
PAST = 256  # moments at which the temperature of a resonator that is late is kept, over twice its delay
CAPACITY_STEP = 0.25  # K, of the knots of a heat capacity that varies


@dataclass(frozen=True)
class EffectRow:
    """One effect: its name, target ("temperature" or a response), the places of its shape and weights among the parameters, and its date (s)."""

    name: str
    target: str
    shape: int
    weights: int
    since: float | None


@dataclass(frozen=True)
class Plan:
    """Numbers of one card that the C code runs on."""

    instrument: "Instrument"
    boundary: "Boundary"  # "chamber" or "housing"
    # mapping from key of the card to number; keys that begin with "." are no keys of a card
    parameters: dict[str, float]
    network: "Network"  # of unit constants, so that its links and capacities are the factors of the parameters
    rows: Array  # array (5, nodes): Resonator's mean temperature and what is uneven in it
    uneven: Array
    constants: dict[str, float]  # mapping from macro to number
    splines: (
        "dict[str, CubicSpline]"  # over even knots (K) of "law", "heat_capacity", "loss" and the two parts of "wave"
    )
    effects: tuple[EffectRow, ...]
    lags: Lags  # of the resonator behind its housing

    @property
    def memory(self) -> int:
        """Numbers that one effect may remember."""
        own, by_lag = MEMORY
        return own + by_lag * len(self.lags.times)

    @property
    def turns_freely(self) -> bool:
        """Whether the azimuth of the wave is an output."""
        return self.instrument.loop is not None and self.instrument.loop.mode == "whole-angle"

    @property
    def limits(self) -> dict[str, tuple[float, float]]:
        """What a card allows of the parameters, by their names."""
        effects = enumerate(self.instrument.effects, 1)
        shapes = {f"effect.{k}.{p.name}": (p.low, p.high) for k, one in effects for p in find_effect(one.name).shape}
        return possible_keys(self.instrument.content) | shapes

    @property
    def key_of(self) -> dict[str, str]:
        """The parameter that scales a capacity, link or radiator, by its name; of shell and stem, by "shell"."""
        return SCALES if self.instrument.polynomial is None else dict.fromkeys(("radiated", "conducted", "shell"), ONE)


def plan_twin(instrument: "Instrument", boundary: "Boundary" = "chamber", theory: "Theory" = "solid") -> Plan:
    """Return what the C code needs of a card."""
    from studies.resonator.law import law_of

    _refuse(instrument)
    T0, reach = instrument.reference_temperature, math.inf if instrument.polynomial is None else REACH
    law = law_of(instrument, T0 - reach, T0 + reach, theory)
    parameters = dict(_card_numbers(instrument))
    if instrument.polynomial is not None:
        network, splines = _lumps(instrument, parameters), {"law": _curve_of(law)}
    else:
        network, splines = _shell_and_mount(instrument, parameters), {"law": law._spline}
    splines |= _splines(instrument, law)
    network = behind_housing(network) if boundary == "housing" else with_sensor(network, 1.0)
    effects = tuple(_place_effects(instrument, parameters))
    parameters[START] = 0.0
    rows = observed_rows(instrument, law, tuple(node.name for node in network.nodes))[1:6]
    uneven = law.uneven
    lags = lags_of(instrument, law, build_network(instrument, boundary=boundary)) if effects else Lags.one(1.0)
    return Plan(
        instrument, boundary, parameters, network, rows, uneven, _constants(instrument, law), splines, effects, lags
    )


def _lumps(instrument: "Instrument", parameters: dict[str, float]) -> "Network":
    """Return the lags of a polynomial card, fixed; [thermal] does not act on them."""
    parameters |= {key: math.nan for key in parameters if key.startswith("thermal.")}
    parameters["thermal.housing_heat_capacity_J_per_K"] = parameters[ONE] = 1.0
    return build_network(instrument)


def _curve_of(law: "FrequencyLaw") -> "CubicSpline":
    """Return ln f of a polynomial law, with knots every kelvin."""
    from scipy.interpolate import CubicSpline

    T = np.linspace(law.lowest, law.highest, int(2 * REACH) + 1)
    return CubicSpline(T, law.logarithm(T))


def _shell_and_mount(instrument: "Instrument", parameters: dict[str, float]) -> "Network":
    """Return the heat path of a geometry with unit constants, which its parameters scale."""
    path, stated = instrument.heat_path, instrument.thermal
    ones = {key: 1.0 for name, key in SCALES.items() if "mass" not in name or stated.second_mass_J_per_K}
    unit = instrument.with_values({**ones, "thermal.drive_power_mW": 1e3}).heat_path
    density = float(instrument.material.value("density", instrument.reference_temperature))
    parameters["thermal.conductivity_W_per_m_K"] = path.conductivity
    capacity = path.volumetric_capacity
    parameters["thermal.heat_capacity_J_per_kg_K"] = math.nan if callable(capacity) else capacity / density
    return assemble(describe_resonator(unit))


def _refuse(instrument: "Instrument") -> None:
    """Raise for what the C code does not hold."""
    for effect in instrument.effects:
        if effect.name.replace("-", "_") not in EFFECTS:
            raise InputError(
                f"{instrument.path} [[effect]]: '{effect.name}' is not available in a twin; leave this effect out of the card."
            )


EFFECTS = (
    "second_lag", "thermometer_scale", "thermometer_lag", "self_heating", "radiation", "clock_offset", "activity_dip", "ageing",
    "amplitude_frequency", "axis_rotation", "clock_drift", "cross_damping", "curvature", "electrostatic_softening", "hysteresis", "jump",
    "leak", "loss_peak", "mounting_stress", "periodic", "quadrature_leakage", "rate_bias", "rate_frequency",
)  # fmt: skip
"""Effects that effects.c has."""


def _card_numbers(instrument: "Instrument") -> Iterator[tuple[str, float]]:
    for table in TABLES:
        keys = getattr(instrument, table)
        if keys is None:
            continue
        for name in keys.__struct_fields__:
            value, key = getattr(keys, name), f"{table}.{name}"
            wanted = table != "loop" or any(part in name for part in OF_LOOPS) or key == PRECESSION
            if isinstance(value, bool | str) or key in FIXED or not wanted:
                continue
            yield key, math.nan if value is None else float(value)


def _splines(instrument: "Instrument", law: "FrequencyLaw") -> "dict[str, CubicSpline]":
    """Splines of a heat capacity that varies, and of the parts of a loss budget."""
    from scipy.interpolate import CubicSpline

    from studies.loss.damping_law import NODE_STEP, damping_law

    found: dict[str, CubicSpline] = {}
    if instrument.polynomial is None and callable(instrument.heat_path.volumetric_capacity):
        T = np.arange(law.lowest, law.highest + CAPACITY_STEP, CAPACITY_STEP)
        found["heat_capacity"] = CubicSpline(T, instrument.material.value("heat_capacity", T))
    damping = damping_law(instrument, law.lowest, law.highest)
    if damping is not None:
        T = np.linspace(law.lowest, law.highest, 4 * math.ceil((law.highest - law.lowest) / NODE_STEP))
        found["loss"] = CubicSpline(T, np.log(damping.inverse_q(T)))
        if damping.wave is not None:
            wave = damping.wave(T)
            found |= {"wave_0": CubicSpline(T, wave.real), "wave_1": CubicSpline(T, wave.imag)}
    return found


def _place_effects(instrument: "Instrument", parameters: dict[str, float]) -> Iterator[EffectRow]:
    for number, one in enumerate(instrument.effects, 1):
        effect = find_effect(one.name)
        shape, weights = spell_out(effect, one.parameters, one.response)
        names = [f"effect.{number}.{p.name}" for p in effect.shape]
        for name, c in zip(effect.coefficient_names(one.response), effect.coefficients, strict=True):
            more = range(len(c.spread))
            given = name in one.parameters
            names += [
                ("" if given else ".") + f"effect.{number}.{name}" + (f".{k + 1}" if len(more) > 1 else "")
                for k in more
            ]
        first = len(parameters)
        for name, value in zip(names, [*shape, *weights], strict=True):
            parameters[name] = float(value)
        target = "temperature" if effect.thermal else one.response
        yield EffectRow(one.name, target, first, first + len(shape), one.since)


def _constants(instrument: "Instrument", law: "FrequencyLaw") -> dict[str, float]:
    """Numbers that are no keys of the card: the solver's, and those of imperfection and electrodes."""
    T0, polynomial = instrument.reference_temperature, instrument.polynomial
    keys = instrument.part("electrodes").keys if instrument.part("electrodes").are_charged else None
    imperfection, softening, per_square_volt = mean_changes(instrument)
    split = 0j
    if instrument.is_imperfect:
        found = reference_split(instrument).split
        split = found.frequency * found.wave
    return {
        "REFERENCE": T0,
        "AROUND": AROUND,
        "REFERENCE_FREQUENCY": float(law.frequency(T0)),
        "LOWEST": law.lowest,
        "HIGHEST": law.highest,
        "BRYAN": law.bryan_factor,
        "DELAY": 0.0 if polynomial is None else polynomial.delay,
        "SPLIT_RE": split.real,
        "SPLIT_IM": split.imag,
        "IMPERFECTION": imperfection,
        "SOFTENING": softening,
        "PER_SQUARE_VOLT": per_square_volt,
        "VOLTAGE_SQUARED": 0.0 if keys is None else keys.voltage_V**2,
        "BIAS_SLOPE": 0.0 if polynomial is None else polynomial.f0 * polynomial.coefficients[0],
        "BIAS_BEND": 1.0 if polynomial is None else polynomial.bias_bend,
        "GAP_EXPANSION": 0.0 if keys is None else keys.gap_expansion_per_K,
    }


def symbol(name: str) -> str:
    """Return the unit of a parameter, an input or an output; rates stand without brackets where nothing else is beside them."""
    unit = unit_of(name)
    return unit[1:-1] if unit.startswith("(") and unit.endswith(")") else unit


def input_starts(plan: Plan) -> dict[str, float]:
    """Return the inputs of an FMU by name, with their values at the start; `idle_input` names one that is none."""
    card: Any = plan.instrument
    return {
        f"{plan.boundary}_temperature_degC": card.reference_temperature - zero_Celsius,
        f"{plan.boundary}_temperature_slope_K_per_s": 0.0,
        "rate_deg_per_s": 0.0,
        "commanded_drive_amplitude_V": 0.0,
        "commanded_electrode_bias_V": math.sqrt(plan.constants["VOLTAGE_SQUARED"]),
        "commanded_quadrature_V": 0.0,
        "commanded_pattern_angle_deg": card.bias.pattern_angle_deg,
        "commanded_precession_deg_per_s": 0.0 if card.loop is None else card.loop.self_precession_deg_per_s,
    }


def idle_input(plan: Plan) -> str:
    """Return the input that does not act: a held wave is not turned, a free one has the azimuth to which it has turned."""
    return "commanded_pattern_angle_deg" if plan.turns_freely else "commanded_precession_deg_per_s"
