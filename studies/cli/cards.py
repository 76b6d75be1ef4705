"""`hrg cards`: the instrument cards that ship with the package, and what is uncertain in one."""

from dataclasses import asdict
from math import exp
from typing import Any

from studies.cli.output import answers
from studies.instrument.card import SCHEMA, load_card, shipped_cards
from studies.instrument.display import display_name
from studies.reports.digits import plain, to_error
from studies.results import Column, Facts, Result, Table
from studies.schema.reader import read_toml

WIDE = 0.3  # standard deviation of a logarithm from which on a factor is shown
LEAD = "The instrument cards that ship with the package."


@answers("hrg.cards/1; hrg.card-values/1 for one card")
def cards(card: str = "") -> Result:
    """List the instrument cards that ship with the package, or show the mass properties and uncertain values of one.

    A number of a card may carry its uncertainty: { value = 0.0118, relative_sd = 0.3 }, { value = ..., sd = ... }, or
    { value = ..., low = ..., high = ... } with hard bounds; sd = 0 makes it exact. Other numbers have the uncertainty
    documented for their key.

    Args:
        card: Path of a card, or the name of a built-in one: show its mass, moments of inertia and uncertain values.
    """
    if card:
        return _show_values(card)
    found = ((path, read_toml(path, SCHEMA)) for path in shipped_cards().values())
    entries = [
        {"name": card["name"], "shape": card["resonator"]["shape"], "material": card["material"]["name"]}
        | {"note": card["note"], "path": str(path)}
        for path, card in found
    ]
    columns = "name | shape | material | note: what is published, what is illustrative"
    return Result({"cards": entries}, "Cards", LEAD, [Table("Cards", entries, columns)])


def _spread(row: dict[str, Any]) -> str:
    """One standard deviation; a factor where the logarithm is normal and wide."""
    share = row["sd"] / row["value"] if row["logarithmic"] else 0.0
    return f"×/÷ {exp(share):.2g}" if share >= WIDE else plain(row["sd"], 2)


def _show_values(card: str) -> Result:
    from shell.inertia import weigh
    from studies.calibration.priors import idle_values

    instrument = load_card(card)
    values, stated = instrument.uncertain, instrument.stated
    # A value that was changed since the calibration is not described by its interval any more.
    saved, held = instrument.part("posterior").intervals, {one.name: one.value for one in values}
    intervals = {name: (low, high) for name, (low, high) in saved.items() if low <= held.get(name, low) <= high}
    mass = None
    if instrument.polynomial is None:
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
        "mass_properties": mass,
    }
    idle = idle_values(instrument)
    rows = [
        row
        | {"from": "card" if row["stated"] else "default", "spread": _spread(row)}
        | {"shown": to_error(row["value"], row["sd"])[0]}
        for row in entries
        if row["name"] not in idle
    ]
    columns = (
        Column("name", "quantity", spell=display_name, where="page"),
        "key | shown: value | spread: ± | from | interval.0 … interval.1 ± sd: 90 % interval",
    )
    tables: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        table, _, key = row["name"].partition(".")
        tables.setdefault(table, []).append(row | {"key": key})
    return Result(
        payload,
        f"Card {instrument.name}",
        "Mass properties, and every value that is uncertain (± one standard deviation); all others are exact.",
        [
            None if mass is None else Facts([
                ("Mass", f"{1e3 * mass.mass:.5g} g", f"{1e9 * mass.volume:.5g} mm³"),
                ("Centre of mass", f"z = {1e3 * mass.center:.5g} mm", ""),
                ("Moments of inertia", f"{1e9 * mass.axial:.5g} g mm² about the axis", f"{1e9 * mass.transverse:.5g} g mm² about a diameter"),
            ]),
            *(Table(f"[{table}]", found, columns) for table, found in tables.items()),
        ],
    )  # fmt: skip
