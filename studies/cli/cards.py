"""`hrg cards` and `hrg materials`: what ships with the package."""

from typing import TYPE_CHECKING, Any

from studies.cli.arguments import Card, Harmonic
from studies.cli.output import answers
from studies.results import Column, Facts, Result, Table

if TYPE_CHECKING:
    from shell.materials import Material, Prior

WIDE = 0.3
"""Standard deviation of a logarithm from which on a factor is shown."""
LEAD = "The instrument cards that ship with the package."


@answers("hrg.cards/1; hrg.card-values/1 for one card")
def cards(card: str = "") -> Result:
    """List the instrument cards that ship with the package, or show the mass properties and uncertain values of one.

    A number of a card may carry its uncertainty: { value = 0.0118, relative_sd = 0.3 }, { value = ..., sd = ... }, or
    { value = ..., low = ..., high = ... } with hard bounds; sd = 0 makes it exact. Other numbers have the uncertainty
    documented for their key.

    Parameters
    ----------
    card : str
        Path of a card, or the name of one that ships: show its mass, moments of inertia and uncertain values.
    """
    from studies.instrument.card import load_card, shipped_cards

    if card:
        return _show_values(card)
    entries = [
        {
            "name": one.name,
            "shape": one.keys("resonator").shape,
            "material": one.material.name,
            "note": one.note,
            "path": one.path,
        }
        for one in map(load_card, shipped_cards().values())
    ]
    columns = [
        Column("name", "name"),
        Column("shape", "shape"),
        Column("material", "material"),
        Column("note", "what is published, what is illustrative"),
    ]
    return Result({"schema": "hrg.cards/1", "cards": entries}, "Cards", LEAD, [Table("Cards", entries, columns)])


def _spread(row: dict[str, Any]) -> str:
    """One standard deviation; a factor where the logarithm is normal and wide."""
    from math import exp

    from studies.reports.digits import plain

    share = row["sd"] / row["value"] if row["logarithmic"] else 0.0
    return f"×/÷ {exp(share):.2g}" if share >= WIDE else plain(row["sd"], 2)


def _show_values(card: str) -> Result:
    from dataclasses import asdict

    from shell.inertia import weigh
    from studies.calibration.priors import idle_values
    from studies.instrument.card import load_card
    from studies.instrument.display import display_name

    instrument = load_card(card)
    values, stated = instrument.uncertain, instrument.stated
    # A value that was changed since the calibration is not described by its interval any more.
    saved, held = instrument.part("posterior").intervals, {one.name: one.value for one in values}
    intervals = {name: (low, high) for name, (low, high) in saved.items() if low <= held.get(name, low) <= high}
    mass = weigh(instrument.resonator, instrument.material.elastic(instrument.reference_temperature).rho)
    entries = [
        {**asdict(one), "stated": one.name in stated}
        | ({"interval": intervals[one.name]} if one.name in intervals else {})
        for one in values
    ]
    payload = {
        "schema": "hrg.card-values/1",
        "card": instrument.name,
        "values": entries,
        "correlations": [[*pair, correlation] for pair, correlation in instrument.correlation.items()],
        "mass_properties": asdict(mass),
    }
    idle = idle_values(instrument)
    rows = [
        row | {"from": "card" if row["stated"] else "default", "spread": _spread(row)}
        for row in entries
        if row["name"] not in idle
    ]
    columns = [
        Column("name", "quantity", spell=display_name, where="page"),
        Column("key", "key"),
        Column("value", "value", form=".4g"),
        Column("spread", "±"),
        Column("from", "from"),
        Column("interval", "90 % interval", interval=("interval.0", "interval.1")),
    ]
    tables = {
        table: [row | {"key": row["name"].partition(".")[2]} for row in rows if row["name"].partition(".")[0] == table]
        for table in dict.fromkeys(row["name"].partition(".")[0] for row in rows)
    }
    return Result(
        payload,
        f"Card {instrument.name}",
        "Mass properties, and every value that is uncertain (± one standard deviation); all others are exact.",
        [
            Facts([
                ("Mass", f"{1e3 * mass.mass:.5g} g", f"{1e9 * mass.volume:.5g} mm³"),
                ("Centre of mass", f"z = {1e3 * mass.center:.5g} mm", ""),
                ("Moments of inertia", f"{1e9 * mass.axial:.5g} g mm² about the axis", f"{1e9 * mass.transverse:.5g} g mm² about a diameter"),
            ]),
            *(Table(f"[{table}]", found, columns) for table, found in tables.items()),
        ],
    )  # fmt: skip


@answers("hrg.materials-list/1; hrg.materials-compared/1 with --compare")
def materials(name: str = "", *, compare: bool = False, card: Card = "", harmonic: Harmonic = 2) -> Result:
    """List the materials and their published laws, or compare them in one geometry.

    Parameters
    ----------
    name : str
        Show one material's laws with their properties, sources and ranges.
    compare : bool
        Compare all laws in the geometry of --card (free-dome unless given): frequency, its slope, thermoelastic Q and what the surface must be.
    """
    from shell.materials import read_materials, spell
    from studies.errors import InputError, nearest

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
    columns = [
        Column("name", "name"),
        Column("law", "law"),
        Column("range_degC", "range", "°C", "g", interval=("range_degC.0", "range_degC.1")),
        Column("lacks", "not stated"),
        Column("unchecked", "not checked"),
        Column("source", "source"),
    ]
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
    Column("material", "material"),
    Column("law", "law"),
    Column("frequency_Hz", "f", "Hz", error="frequency_sd_Hz"),
    Column("slope_ppm_per_degC", "TCF", "ppm/°C", error="slope_sd_ppm_per_degC"),
    Column("thermoelastic_q", "thermoelastic Q", digits=3),
    Column("surface_q", "Q of the surface", digits=3),
    Column("surface_layer_pm", "surface worth", "pm", ".3g"),
)
WORTH = (
    "Thermoelastic Q: of the heat flow alone. Q of the surface: where a source states a surface layer's depth times loss. Surface worth: the"
    " depth times loss of a surface layer that loses as much as the heat flow; a better surface gains little. Empty: no source states what it"
    " needs (below)."
)


def _compare(card: str, harmonic: int) -> Result:
    from shell.constants import zero_Celsius
    from studies.errors import naming
    from studies.instrument.card import load_card
    from studies.material_choice import compare_materials

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
            Table("Not stated, or taken as", remarks, [Column("material", "material"), Column("law", "law"), Column("remark", "remark")]),
        ],
    )  # fmt: skip


def _law_tables(law: "Material") -> list[Table]:
    from shell.property import PROPERTIES

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
    columns = [Column(key, key) for key in ("property", "unit", "form", "numbers", "source")]
    prior = law.prior
    coefficients = [
        {
            "name": prior.names[k],
            "sd": float(prior.sd[k]),
            "correlation": ", ".join(
                f"{prior.correlation[k, j]:+.2f} with {prior.names[j]}" for j in _correlated(prior, k)
            ),
        }
        for k in range(len(prior.names))
    ]
    note = "p(T) = law(T) exp(a + b x + ½ c x²), x = T − 20 °C: log_value, log_slope, log_curvature; without log, + instead of exp."
    open_ones = [
        Column("name", "coefficient"),
        Column("sd", "standard deviation", form=".2g"),
        Column("correlation", "correlation"),
    ]
    return [
        Table(f"{law.name}, law '{law.law}'", properties, columns, " ".join([*law.caveats, law.note])),
        Table(f"Uncertainty of law '{law.law}'", coefficients, open_ones, note),
    ]


def _with_error(name: str, value: Any, error: float, unit: str) -> str:
    """A number of a law with its standard deviation; moduli in GPa."""
    from studies.reports.digits import plain, to_error

    if not isinstance(value, float | int):
        return f"{name} = {value}"
    scale, words = (1e-9, " GPa") if unit == "Pa" and abs(value) > 1e6 else (1.0, "")
    number, spread = to_error(scale * value, scale * error)
    return f"{name} = " + (f"{number} ± {spread}" if error > 0 else plain(value * scale, 6)) + words


def _correlated(prior: "Prior", k: int) -> list[int]:
    return [j for j in range(len(prior.names)) if j != k and abs(prior.correlation[k, j]) >= 0.005]


def _describe(law: "Material") -> "dict[str, Any]":
    from shell.constants import zero_Celsius

    return {
        "name": law.name,
        "law": law.law,
        "range_degC": [law.lowest - zero_Celsius, law.highest - zero_Celsius],
        "source": law.source,
        "note": law.note,
        "caveats": list(law.caveats),
        "lacks": law.lacks,
        "unchecked": list(law.unchecked),
        "prior": {
            "coefficients": list(law.prior.names),
            "sd": law.prior.sd.tolist(),
            "correlation": law.prior.correlation.tolist(),
        },
        "properties": {
            key: {"form": p.form, **p.numbers, "uncertainty": dict(p.uncertainty), "source": p.source}
            for key, p in law.properties.items()
        },
    }
