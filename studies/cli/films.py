"""What the card's films do to frequencies, for `hrg modes`."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shell.modes import Mode
    from studies.instrument.card import Instrument


def describe_films(found: "list[Mode]", instrument: "Instrument") -> "dict[int, list[dict[str, Any]]]":
    """Every film and its shift in ppm, null where its numbers are not known, by the identity of the mode."""
    from studies.films import film_shifts

    shifts = {id(m): film_shifts(instrument, m) for m in found}
    return {
        mode: [
            {
                "film": one.material,
                "shift_ppm": None if one.relative is None else 1e6 * one.relative,
                "missing": one.missing,
            }
            for one in films
        ]
        for mode, films in shifts.items()
        if films
    }


def print_films(found: "list[Mode]", films: "dict[int, list[dict[str, Any]]]") -> None:
    """Print a table of it."""
    from studies.cli.output import print_table

    rows = [
        [
            str(m.harmonic),
            str(m.index),
            one["film"],
            f"no {' or '.join(one['missing'])}" if one["shift_ppm"] is None else f"{one['shift_ppm']:+.4g}",
        ]
        for m in found
        for one in films[id(m)]
    ]
    note = "By stiffness and mass, to first order in the thickness; the frequencies above are those of the bare wall."
    print_table("Films", ["n", "index", "film", "shift (ppm)"], rows, note)
