"""`hrg materials`: the published laws of the materials, and how they compare in one geometry."""

from typing import Any

from shell.constants import zero_Celsius
from shell.materials import Material, Prior, read_materials, spell
from shell.property import PROPERTIES
from studies.cli.arguments import Card, Harmonic
from studies.cli.output import answers
from studies.errors import InputError, naming, nearest
from studies.instrument.card import load_card
from studies.material_choice import compare_materials
from studies.reports.digits import plain, to_error
from studies.results import Column, Result, Table, row_of, rows_of


@answers("hrg.materials-list/1; hrg.materials-compared/1 with --compare")
def materials(name: str = "", *, compare: bool = False, card: Card = "", harmonic: Harmonic = 2) -> Result:
    """List the materials and their published laws, or compare them in one geometry.

    Parameters
    ----------
    name : str
        Show one material's laws with their properties, sources and ranges.
    compare : bool
        Compare all laws in the geometry of --card (free-dome unless given): frequency, TCF, thermoelastic Q, and the surface loss worth reaching.
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
    entries = [_describe(law) for law in laws]
    rows = [row | {key: spell(row[key]) or "—" for key in ("lacks", "unchecked")} for row in entries]
    span = Column("range_degC", "range", "°C", "g", interval=("range_degC.0", "range_degC.1"))
    columns = ("name", "law", span, Column("lacks", "not stated"), Column("unchecked", "not checked"), "source")
    return Result(
        {"schema": "hrg.materials-list/1", "materials": entries},
        "Materials",
        "Materials and their published laws over temperature.",
        [
            Table("Materials", rows, columns, "The first law of a material is its default."),
            *(part for law in laws if name for part in _law_tables(law)),
        ],
    )


COMPARED = (
    "material",
    "law",
    Column("frequency_Hz", "f", "Hz", error="frequency_sd_Hz"),
    Column("slope_ppm_per_degC", "TCF", "ppm/°C", error="slope_sd_ppm_per_degC"),
    Column("thermoelastic_q", "thermoelastic Q", digits=3),
    Column("surface_q", "surface Q", digits=3),
    Column("surface_layer_pm", "break-even surface", "pm", ".3g"),
)
WORTH = (
    "Thermoelastic Q: from heat conduction alone. Surface Q: where a source gives the depth times loss of a surface layer. Break-even surface:"
    " the depth times loss at which the surface loses as much as heat conduction; a better surface gains little. Empty: no source (see below)."
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


def _law_tables(law: "Material") -> list[Table]:
    properties = [
        {
            "property": key,
            "unit": PROPERTIES[key],
            "form": prop.form,
            "numbers": ", ".join(
                _with_error(k, v, prop.uncertainty.get(k, 0.0), PROPERTIES[key]) for k, v in prop.numbers.items()
            ),
            "source": "not checked against a source" if key in law.unchecked else prop.source or "source of the law",
        }
        for key, prop in law.properties.items()
    ]
    prior = law.prior
    correlated = [_correlated(prior, k) for k in range(len(prior.names))]
    coefficients = rows_of({"coefficient": prior.names, "sd": prior.sd, "correlation": correlated})
    note = "p(T) = law(T) exp(a + b x + ½ c x²), x = T − 20 °C: log_value, log_slope, log_curvature; without log, + instead of exp."
    open_ones = ("coefficient", Column("sd", "standard deviation", form=".2g"), "correlation")
    columns = ("property", "unit", "form", "numbers", "source")
    return [
        Table(f"{law.name}, law '{law.law}'", properties, columns, " ".join([*law.caveats, law.note])),
        Table(f"Uncertainty of law '{law.law}'", coefficients, open_ones, note),
    ]


def _with_error(name: str, value: Any, error: float, unit: str) -> str:
    """A number of a law with its standard deviation; moduli in GPa."""
    if not isinstance(value, float | int):
        return f"{name} = {value}"
    scale, words = (1e-9, " GPa") if unit == "Pa" and abs(value) > 1e6 else (1.0, "")
    number, spread = to_error(scale * value, scale * error)
    return f"{name} = " + (f"{number} ± {spread}" if error > 0 else plain(value * scale, 6)) + words


def _correlated(prior: "Prior", k: int) -> str:
    others = [j for j in range(len(prior.names)) if j != k and abs(prior.correlation[k, j]) >= 0.005]
    return ", ".join(f"{prior.correlation[k, j]:+.2f} with {prior.names[j]}" for j in others)


def _describe(law: "Material") -> "dict[str, Any]":
    return row_of(law, "name", "law", "source", "note", "caveats", "lacks", "unchecked") | {
        "range_degC": [law.lowest - zero_Celsius, law.highest - zero_Celsius],
        "prior": row_of(law.prior, "sd", "correlation", coefficients="names"),
        "properties": {
            key: {"form": p.form, **p.numbers, "uncertainty": dict(p.uncertainty), "source": p.source}
            for key, p in law.properties.items()
        },
    }
