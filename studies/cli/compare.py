"""`hrg compare`: designs side by side."""

from math import isfinite

from studies.cli.output import answers
from studies.errors import InputError
from studies.files.given import shorten
from studies.instrument.card import load_card
from studies.instrument.settings import Setting
from studies.resonator.comparison import compare as compare_designs
from studies.results import Column, Result, Table, row_of

SETTINGS = (
    "What a simulation takes; ±: the standard deviation that the card states. —: the card does not state it and it has no"
    " default; it follows from geometry and material, or there is no such thing."
)


@answers("hrg.compare/1")
def compare(*card: str) -> Result:
    """Show designs side by side: where their cards differ, and the effects on modes, TCF and settling.

    Args:
        card: Two or more cards: paths, or names of those that ship (hrg cards).
    """
    if len(card) < 2:
        raise InputError("name two cards or more: hrg compare A.toml B.toml.")
    found = compare_designs([load_card(one) for one in card])
    figures = [
        row_of(row[0], "name", "unit")
        | {"values": [one.value for one in row], "uncertainties": [one.uncertainty for one in row]}
        for row in found.figures
    ]
    payload = {"cards": found.names, "figures": figures} | {
        name: {key: [getattr(one, what) for one in row] for key, row in found.differing.items()}
        for name, what in (("differing", "value"), ("stated", "stated"))
    }
    names = [f"{name} ({k})" if found.names.count(name) > 1 else name for k, name in enumerate(found.names, 1)]
    note = "±: one standard deviation from the published values of the material, common to designs of one material."
    known = [row | {"values": [v if isfinite(v) else "not known" for v in row["values"]]} for row in figures]
    keys = [{"key": key, "values": [_spell(one) for one in row]} for key, row in found.differing.items()]
    return Result(
        payload,
        "Comparison of designs",
        f"{', '.join(names)}: natural frequencies, slope, settling, and the keys in which the cards differ.",
        [
            Table("Designs", known, [
                "name: quantity | unit",
                *(Column(f"values.{k}", name, error=f"uncertainties.{k}") for k, name in enumerate(names)),
            ], note),
            *(f"{row[0].name.capitalize()}: {'; '.join(f'{name}: {one.of}' for name, one in zip(names, row, strict=True))}."
                for row in found.figures if row[0].of),
            Table("Where the cards differ", keys, ["key", *(Column(f"values.{k}", name) for k, name in enumerate(names))], SETTINGS),
            None if keys else "The cards are the same.",
        ],
    )  # fmt: skip


def _spell(one: Setting) -> str:
    """Write a setting: 0.1 ± 0.03, 0.05 … 0.2, or 0.0118 (default)."""
    if one.value is None:
        return "—"
    if one.stated is None:
        return f"{shorten(str(one.value), 40)} (default)"
    deviation = f" ± {one.stated['sd']:.4g}" if "sd" in one.stated else ""
    low, high = (one.stated.get(end, "") for end in ("low", "high"))
    return shorten(str(one.value), 40) + deviation + (f", {low} … {high}" if (low, high) != ("", "") else "")
