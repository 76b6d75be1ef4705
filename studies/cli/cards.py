"""`hrg cards` and `hrg materials`: what ships with the package."""

from typing import TYPE_CHECKING, Any

from studies.cli.output import Answer, answers

if TYPE_CHECKING:
    from shell.materials import Material, Prior


@answers("hrg.cards/1; hrg.card-values/1 for one card")
def cards(card: str = "") -> Answer:
    """List the instrument cards that ship with the package, or what one card weighs and its uncertain values.

    A number of a card may carry its uncertainty: { value = 0.0118, relative_sd = 0.3 }, { value = ..., sd = ... }, or
    { value = ..., low = ..., high = ... } with hard bounds; sd = 0 makes it exact. Other numbers have the uncertainty
    documented for their key.

    Parameters
    ----------
    card : str
        Path of a card, or the name of one that ships: show its mass, moments of inertia and uncertain values.
    """
    from studies.cli.output import print_table
    from studies.instrument.card import load_card, shipped_cards

    if card:
        return (yield from _show_values(card))
    found = [load_card(path) for path in shipped_cards().values()]
    entries = [
        {
            "name": card.name,
            "shape": card.keys("resonator").shape,
            "material": card.material.name,
            "note": card.note,
            "path": card.path,
        }
        for card in found
    ]
    yield {"schema": "hrg.cards/1", "cards": entries}
    rows = [[c.name, c.keys("resonator").shape, c.material.name, c.note] for c in found]
    print_table("Cards", ["Name", "Shape", "Material", "What is printed, what is illustrative"], rows)


def _show_values(card: str) -> Answer:
    from dataclasses import asdict

    from shell.inertia import weigh
    from studies.cli.output import print_table
    from studies.instrument.card import load_card

    instrument = load_card(card)
    values, stated = instrument.uncertain, instrument.stated
    # A value that was changed since the calibration is not described by its interval any more.
    saved, held = instrument.part("posterior").intervals, {one.name: one.value for one in values}
    intervals = {name: (low, high) for name, (low, high) in saved.items() if low <= held.get(name, low) <= high}
    mass = weigh(instrument.resonator, instrument.material.elastic(instrument.reference_temperature).rho)
    yield {
        "schema": "hrg.card-values/1",
        "card": instrument.name,
        "values": [
            {**asdict(one), "stated": one.name in stated}
            | ({"interval": intervals[one.name]} if one.name in intervals else {})
            for one in values
        ],
        "correlations": [[*pair, correlation] for pair, correlation in instrument.correlation.items()],
        "mass_properties": asdict(mass),
    }
    print(
        f"{instrument.name}: {1e3 * mass.mass:.5g} g, {1e9 * mass.volume:.5g} mm³, centre at z = {1e3 * mass.center:.5g} mm;"
    )
    print(f"moments of inertia {1e9 * mass.axial:.5g} (axis) and {1e9 * mass.transverse:.5g} g mm² (across)")
    print(f"{instrument.name}: what is uncertain (± one standard deviation; everything else is exact)")
    tables: dict[str, list[list[str]]] = {}
    for one in values:
        table, key = one.name.split(".", 1)
        origin = "card" if one.name in stated else "default"
        row = [key, f"{one.value:.4g}", f"{one.sd:.2g}", origin]
        if intervals:
            row.append("{:.4g} to {:.4g}".format(*intervals[one.name]) if one.name in intervals else "")
        tables.setdefault(table, []).append(row)
    for table, rows in tables.items():
        print_table(f"[{table}]", ["Key", "Value", "±", "From", *(["90 %"] if intervals else [])], rows)
    return 0


@answers("hrg.materials-list/1")
def materials(name: str = "") -> Answer:
    """List the materials and their published laws.

    Parameters
    ----------
    name : str
        Show one material's laws with their properties, sources and ranges.
    """
    from shell.constants import zero_Celsius
    from shell.materials import read_materials
    from studies.cli.output import print_table
    from studies.errors import InputError, nearest

    table = read_materials()
    if name and name not in table:
        raise InputError(f"unknown material '{name}'{nearest(name, table)}")
    chosen = {key: laws for key, laws in table.items() if name in ("", key)}
    yield {
        "schema": "hrg.materials-list/1",
        "materials": [_describe(law) for laws in chosen.values() for law in laws.values()],
    }
    rows = []
    for key, laws in chosen.items():
        for k, law in enumerate(laws.values()):
            low, high = law.lowest - zero_Celsius, law.highest - zero_Celsius
            lacking = ", ".join(_lacking(law)) or "nothing"
            rows.append([key if k == 0 else "", law.law, f"{low:g} to {high:g}", lacking, law.source])
    print_table(
        "Materials",
        ["Name", "Law", "Range (°C)", "Lacks", "Source"],
        rows,
        "The first law of a material is its default.",
    )
    if name:
        for law in chosen[name].values():
            _print_law(law)


def _print_law(law: "Material") -> None:
    from shell.property import PROPERTIES
    from studies.cli.output import print_table

    rows = []
    for key, prop in law.properties.items():
        numbers = ", ".join(f"{k} = {v}" for k, v in prop.numbers.items())
        spread = ", ".join(f"{k} ± {v:g}" for k, v in prop.uncertainty.items())
        rows.append([key, PROPERTIES[key], prop.form, numbers, spread, prop.source])
    columns = ["Property", "Unit", "Form", "Numbers", "Standard uncertainty", "Source"]
    print_table(f"{law.name}, law '{law.law}'", columns, rows, law.note)
    prior = law.prior
    if prior.names:
        beside = [
            ", ".join(f"{prior.correlation[k, j]:+.2f} with {prior.names[j]}" for j in _correlated(prior, k))
            for k in range(len(prior.names))
        ]
        open_ones = [[name, f"{sd:.2g}", c] for name, sd, c in zip(prior.names, prior.sd, beside, strict=True)]
        note = "p(T) = law(T) exp(a + b x + ½ c x²), x = T − 20 °C: log_value, log_slope, log_curvature; without log, + instead of exp."
        print_table(
            f"Uncertainty of law '{law.law}'", ["Coefficient", "Standard deviation", "Correlation"], open_ones, note
        )


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
        "lacks": _lacking(law),
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


def _lacking(law: "Material") -> "list[str]":
    from shell.materials import ELASTIC
    from shell.property import PROPERTIES

    stated = [p for p in ELASTIC if p in law.properties]
    elastic = [] if len(stated) > 1 else ["poisson_ratio" if "poisson_ratio" not in stated else "youngs_modulus"]
    return elastic + [p for p in PROPERTIES if p not in ELASTIC and p not in law.properties]
