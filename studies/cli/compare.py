"""`hrg compare`: designs side by side.

With --json one object, schema `hrg.compare/1`: `cards`, `figures` (name, unit, values, uncertainties), `differing` (card key to
its values, null where a card has none).
"""

import math

from studies.cli.output import Answer, answers


@answers("hrg.compare/1")
def compare(*card: str) -> Answer:
    """Show designs side by side: where their cards differ, and what that does to modes, slope and settling.

    Parameters
    ----------
    card : str
        Two or more cards: paths, or names of those that ship (hrg cards).
    """
    from studies.cli.output import print_table
    from studies.comparison import compare as compare_designs
    from studies.errors import InputError
    from studies.instrument.card import load_card

    if len(card) < 2:
        raise InputError("name two cards or more: hrg compare A.toml B.toml.")
    found = compare_designs([load_card(one) for one in card])
    figures = [
        {
            "name": row[0].name,
            "unit": row[0].unit,
            "values": [one.value for one in row],
            "uncertainties": [one.uncertainty for one in row],
        }
        for row in found.figures
    ]
    yield {"schema": "hrg.compare/1", "cards": found.names, "figures": figures, "differing": found.differing}
    names = [f"{name} ({k})" if found.names.count(name) > 1 else name for k, name in enumerate(found.names, 1)]
    rows = []
    for row in found.figures:
        cells = [_with_uncertainty(one.value, one.uncertainty) for one in row]
        rows.append([row[0].name, row[0].unit, *cells])
    note = "± is one standard deviation from the material's published values, common to designs of one material."
    print_table("Designs", ["Quantity", "Unit", *names], rows, note)
    if found.differing:
        differing = [
            [key, *("—" if v is None else _short(v) for v in values)] for key, values in found.differing.items()
        ]
        print_table("Where the cards differ", ["Key", *names], differing)
    else:
        print("The cards are the same.")


def _with_uncertainty(value: float, uncertainty: float) -> str:
    """Write a value to the second digit of its uncertainty; "not known" for NaN."""
    if math.isnan(value):
        return "not known"
    if not uncertainty > 0:
        return f"{value:.4g}" if abs(value) < 1e4 else f"{value:.0f}"
    digits = max(1 - math.floor(math.log10(uncertainty)), 0)
    return f"{value:.{digits}f} ± {uncertainty:.{digits}f}"


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= 40 else text[:37] + "..."
