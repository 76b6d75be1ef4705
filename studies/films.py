"""The films of a card ([[loss.film]]): their numbers, and what each does to a frequency by its stiffness and mass."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from shell.modes import Mode
    from shell.quadrature import Array
    from studies.instrument.card import Instrument
    from studies.instrument.tables.loss_parts import FilmKeys

ELASTIC = ("youngs_modulus_GPa", "poisson_ratio", "density_kg_m3")


@dataclass(frozen=True)
class FilmShift:
    """What one film does to a mode: δf/f, or None with the keys that no source states of it."""

    material: str
    relative: float | None
    missing: tuple[str, ...] = ()


def film_numbers(keys: "FilmKeys", names: Iterable[str]) -> dict[str, Any]:
    """Return the named numbers of a film, from the card or else from the table of films; None where neither has them."""
    from shell.damping.sources import known_film

    known = known_film(keys.material)
    given = {name: getattr(keys, name) for name in names}
    return {name: known.get(name) if value is None else value for name, value in given.items()}


def film_shifts(instrument: "Instrument", mode: "Mode") -> tuple[FilmShift, ...]:
    """Return what every film of the card does to a mode, to first order in its thickness.

    Raises
    ------
    ShellError
        A film is too thick for that.
    """
    films = instrument.part("loss", "loss_parts").film
    if not films:
        return ()
    from shell.elastic import Elastic
    from shell.film import Film, film_shift

    found = []
    for keys in films:
        numbers = film_numbers(keys, ELASTIC)
        missing = tuple(name for name, value in numbers.items() if value is None)
        relative = None
        if not missing:
            E, nu, rho = numbers.values()
            film = Film(Elastic(1e9 * E, nu, rho), partial(_thickness, keys), keys.face)
            relative = film_shift(mode, film)
        found.append(FilmShift(keys.material, relative, missing))
    return tuple(found)


def _thickness(keys: "FilmKeys", position: "Array") -> "Array":
    """Mean thickness, m, where a pattern covers a share of the film's part of the meridian."""
    covered = (position >= keys.from_position) & (position <= keys.to_position)
    return np.asarray(1e-9 * keys.thickness_nm * keys.coverage * covered)
