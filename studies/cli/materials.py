"""`hrg materials`: the published laws of the materials, and how they compare in one geometry."""

from math import inf, isnan, nan, pi
from typing import Any

import numpy as np

from shell.constants import zero_Celsius
from shell.errors import ShellError
from shell.material import Material, Prior, spell
from shell.materials import read_materials
from shell.property import PROPERTIES, Property
from shell.resonator import Resonator
from studies.cli.arguments import Card, Harmonic
from studies.cli.output import answers
from studies.errors import InputError, naming, nearest
from studies.instrument.card import load_card
from studies.reports.digits import plain, to_error
from studies.results import Result, Table, row_of, rows_of


@answers("hrg.materials-list/1; hrg.materials-compared/1 with --compare")
def materials(name: str = "", *, compare: bool = False, card: Card = "", harmonic: Harmonic = 2) -> Result:
    """List the materials and their published laws, or compare them in one geometry.

    Args:
        name: Show one material's laws with their properties, sources and ranges.
        compare: Compare all laws in the geometry of --card: frequency, TCF, thermoelastic Q, worthwhile surface loss, decay time.
    """
    if card and not compare:
        raise InputError(f"--card {card}: it belongs to --compare; add that.")
    if compare:
        if name:
            raise InputError(f"--compare compares all materials; leave out '{name}'.")
        return _compare(card or "free-dome", harmonic)
    table = read_materials()
    if name and name not in table:
        raise InputError(f"unknown material '{name}'{nearest(name, table)}")
    laws = [law for key, laws in table.items() if name in ("", key) for law in laws.values()]
    entries, surfaces = [_describe(law) for law in laws], _surfaces(name)
    rows = [row | {key: spell(row[key]) or "—" for key in ("lacks", "unchecked")} for row in entries]
    columns = "name | law | range_degC.0 … range_degC.1: range (°C) g | lacks: not stated | unchecked: not checked | source"  # fmt: skip
    return Result(
        {"materials": entries, "surfaces": surfaces},
        "Materials",
        "Materials and their published laws over temperature.",
        [
            Table("Materials", rows, columns, "The first law of a material is its default."),
            *(part for law in laws if name for part in _law_tables(law)),
            Table("Surface loss", surfaces, SURFACES, DAMAGED),
        ],
    )


SURFACES = "treatment | depth_pm ± sd_pm: surface layer (pm) | source"
DAMAGED = "Depth times loss of the damaged layer; a card chooses with [loss] surface_treatment."


def _surfaces(name: str) -> list[dict[str, Any]]:
    from shell.damping.sources import known_losses

    known = known_losses(name)
    stated = {"best": known["surface"], **known.get("treatment", {})} if "surface" in known else {}
    return [
        {"treatment": key, "depth_pm": 1e12 * one["depth_m"], "sd_pm": 1e12 * one["depth_m"] * one["relative_sd"], "source": one["source"]}
        for key, one in stated.items()
    ]  # fmt: skip


COMPARED = (
    "material | law | frequency_Hz ± frequency_sd_Hz: f (Hz) | slope_ppm_per_degC ± slope_sd_ppm_per_degC: TCF (ppm/°C) | thermoelastic_q: thermoelastic Q .3"
    " | surface_q: surface Q .3 | surface_layer_pm: break-even surface (pm) .3g | decay_s: decay time (s) .3"
)
WORTH = (
    "Thermoelastic Q: from heat conduction alone. Surface Q: where a source gives the depth times loss of a surface layer. Break-even surface:"
    " the depth times loss at which the surface loses as much as heat conduction; a better surface gains little."
    " Decay time, the figure of merit of a gyro's drift: Q/(π f) of both, without the bulk: what is possible at most. Empty: no source (see below)."
)


def _compare(card: str, harmonic: int) -> Result:
    instrument = load_card(card)
    T = instrument.reference_temperature
    with naming(instrument.path):
        rows = compare_materials(instrument.resonator, T, harmonic)
    remarks = [{**row, "remark": text} for row in rows for text in row["remarks"]]
    head = {"card": instrument.name, "harmonic": harmonic, "temperature_degC": T - zero_Celsius}
    return Result(
        {"schema": "hrg.materials-compared/1", **head, "materials": rows},
        f"Materials in the geometry of {instrument.name}",
        f"Mode n = {harmonic} at {head['temperature_degC']:g} °C in one geometry, by thermoelastic Q; ± one standard deviation.",
        [
            Table(f"Geometry of {instrument.name}, n = {harmonic}", rows, COMPARED, WORTH),
            Table("Remarks", remarks, ("material", "law", "remark")),
        ],
    )  # fmt: skip


def _law_tables(law: Material) -> list[Table]:
    properties = [
        {
            "property": key,
            "unit": PROPERTIES[key],
            "form": prop.form,
            "numbers": ", ".join(_with_error(k, prop, PROPERTIES[key]) for k in prop.numbers),
            "source": "not checked against a source" if key in law.unchecked else prop.source or "source of the law",
        }
        for key, prop in law.properties.items()
    ]
    prior = law.prior
    correlated = [_correlated(prior, k) for k in range(len(prior.names))]
    coefficients = rows_of({"coefficient": prior.names, "sd": prior.sd, "correlation": correlated})
    note = "p(T) = law(T) exp(a + b x + ½ c x²), x = T − 20 °C: log_value, log_slope, log_curvature; without log, + instead of exp."
    open_ones = "coefficient | sd: standard deviation .2g | correlation"
    columns = ("property", "unit", "form", "numbers", "source")
    return [
        Table(f"{law.name}, law '{law.law}'", properties, columns, " ".join([*law.caveats, law.note])),
        Table(f"Uncertainty of law '{law.law}'", coefficients, open_ones, note),
    ]


def _with_error(name: str, of: Property, unit: str) -> str:
    """A number of a law with its standard deviation; moduli in GPa."""
    value, error = of.numbers[name], of.uncertainty.get(name, 0.0)
    if not isinstance(value, float | int):
        return f"{name} = {value}"
    scale, words = (1e-9, " GPa") if unit == "Pa" and abs(value) > 1e6 else (1.0, "")
    number, spread = to_error(scale * value, scale * error)
    return f"{name} = " + (f"{number} ± {spread}" if error > 0 else plain(value * scale, 6)) + words


def _correlated(prior: Prior, k: int) -> str:
    others = [j for j in range(len(prior.names)) if j != k and abs(prior.correlation[k, j]) >= 0.005]
    return ", ".join(f"{prior.correlation[k, j]:+.2f} with {prior.names[j]}" for j in others)


def _describe(law: Material) -> dict[str, Any]:
    return row_of(law, "name", "law", "source", "note", "caveats", "lacks", "unchecked") | {
        "range_degC": [law.lowest - zero_Celsius, law.highest - zero_Celsius],
        "prior": row_of(law.prior, "sd", "correlation", coefficients="names"),
        "properties": {
            key: {"form": p.form, **p.numbers, "uncertainty": dict(p.uncertainty), "source": p.source}
            for key, p in law.properties.items()
        },
    }


HEAT = ("expansion", "conductivity", "heat_capacity")
FIGURES = (
    *("frequency_Hz", "frequency_sd_Hz", "slope_ppm_per_degC", "slope_sd_ppm_per_degC"),
    *("thermoelastic_q", "surface_q", "surface_layer_pm", "decay_s"),
)


def compare_materials(resonator: Resonator, temperature: float, harmonic: int = 2) -> list[dict[str, Any]]:
    """Return the `FIGURES` of every law of the table at a temperature (K), by thermoelastic Q, and `remarks`; NaN where not known.

    A surface layer of depth d and loss φ adds 1/Q = S d φ to the thermoelastic 1/Q_te, S the share of the mode's energy per depth. Where
    a source states d φ it gives Q_surface; d φ = 1/(Q_te S) is the layer whose loss equals the thermoelastic one: a worse surface
    spoils what the material could give, a better one gains nothing.
    """
    laws = [material for laws in read_materials().values() for material in laws.values()]
    rows = [
        {"material": material.name, "law": material.law, **dict.fromkeys(FIGURES, nan)}
        | _figures(resonator, material, temperature, harmonic)
        for material in laws
    ]
    return sorted(rows, key=lambda row: (-np.nan_to_num(row["thermoelastic_q"]), isnan(row["frequency_Hz"])))


def _figures(resonator: Resonator, material: Material, T: float, harmonic: int) -> dict[str, Any]:
    from shell.damping.budget import surface_cause, thermoelastic_cause
    from shell.damping.faces import Vibration
    from shell.damping.heat import Heat
    from shell.damping.sources import known_losses
    from shell.law import build_law
    from shell.modes import solve_modes

    remarks = list(material.caveats)
    if absent := material.lacks:
        remarks.append(f"{material.name}: no source states its {spell(absent)}.")
    found: dict[str, Any] = {"remarks": remarks}
    try:
        elastic = material.elastic(T)
    except ShellError as error:
        return found if absent else {"remarks": [*remarks, str(error)]}
    at = np.array([T])
    if "expansion" in absent:
        (mode,) = solve_modes(resonator, elastic, harmonic)
    else:
        law = build_law(resonator, material, T, T, T, harmonic=harmonic)
        mode = law.mode
        found["frequency_sd_Hz"] = float(law.uncertainty(at)[0]) * mode.frequency
        if not material.constant:
            found["slope_ppm_per_degC"] = 1e6 * float(law.slope(at)[0])
            found["slope_sd_ppm_per_degC"] = 1e6 * float(law.slope_uncertainty(at)[0])
    found["frequency_Hz"] = mode.frequency
    vibration = Vibration(mode.solution, mode.resonator, material, T)
    per_layer = float(surface_cause(1.0, 0.0, "").inverse_q(vibration, at)[0])
    if (surface := known_losses(material.name).get("surface")) is not None:
        found["surface_q"] = 1 / (surface["depth_m"] * per_layer)
    if not set(HEAT) & set(absent):
        alpha, k, c = (float(material.value(name, T)) for name in HEAT)
        sd = dict(zip(material.prior.names, material.prior.sd, strict=True)).get("expansion.value", 0.0)
        if abs(alpha) <= sd:
            remarks.append(f"{material.name}: its expansion is 0 within {1e9 * sd:.2g}e-9 1/K, so its thermoelastic Q is not known.")  # fmt: skip
            return found
        heat = Heat(alpha, float(material.value("density", T)) * c, k)
        cause = thermoelastic_cause(vibration, lambda _: heat, (0.0, 0.0, 0.0), "")
        inverse = float(cause.inverse_q(vibration, at)[0])
        decay = 1 / (pi * mode.frequency * (inverse + 1 / found.get("surface_q", inf)))
        found |= {"thermoelastic_q": 1 / inverse, "surface_layer_pm": 1e12 * inverse / per_layer, "decay_s": decay}
    return found
