"""What the card's films do to frequencies, for `hrg modes`."""

from typing import Any

from shell.modes import Mode
from studies.instrument.card import Instrument
from studies.loss.films import film_shifts
from studies.results import Column, Table


def describe_films(found: list[Mode], instrument: Instrument) -> dict[int, list[dict[str, Any]]]:
    """Every film and its shift in ppm, null where its numbers are not known, by the identity of the mode."""
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


def films_table(modes: list[dict[str, Any]]) -> Table:
    """The table of modes with `films`, a row for each film."""
    rows = [
        {
            **row,
            **film,
            "shift_ppm": f"unknown without {' and '.join(film['missing'])}"
            if film["shift_ppm"] is None
            else film["shift_ppm"],
        }
        for row in modes
        for film in row.get("films", ())
    ]
    columns = [
        Column("harmonic", "n"),
        Column("index", "index"),
        Column("film", "film"),
        Column("shift_ppm", "shift", "ppm", "+.4g"),
    ]
    note = "By stiffness and mass, to first order in the thickness. The frequencies above are those of the bare wall."
    return Table("Effect of the films", rows, columns, note)
