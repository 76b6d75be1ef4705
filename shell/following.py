"""A mode followed from one design to another by its shape: through crossings, past repeated roots.

Two modes of one harmonic on two resonators are held against each other where their meridians correspond, on the middle
surface at equal parts of the arc length (modal assurance criterion, Allemang and Brown 1982):

    MAC = |Σ w a·b|² / (Σ w a·a  Σ w b·b),      w = √(r_a r_b), a and b the displacements (u_r, u_θ, u_z).

Modes of different harmonics never mix, so their crossings need nothing but the harmonic's number.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np

from shell.cross_section import cut
from shell.errors import ShellError
from shell.modes import Mode
from shell.quadrature import Array

POSITIONS = tuple(np.linspace(0.02, 1.0, 25))
SURE = 0.8  # of the MAC: what is left for all the others is 0.2
REPEATED = 1e-3  # relative distance of frequencies within which two modes are one root
SPARE = 4  # modes above that are looked at
DEEPEST = 6  # halvings of the way


@lru_cache(maxsize=16)  # a mode holds its solution
def _motion(mode: Mode) -> tuple[Array, Array]:
    """Displacement (3, positions) along r, θ and z of the middle surface, NaN in solid parts, and radius (positions,)."""
    moved, radius = np.full((3, len(POSITIONS)), np.nan), np.full(len(POSITIONS), np.nan)
    for k, position in enumerate(POSITIONS):
        try:
            here = cut(mode.resonator, mode.solution.system, position, np.zeros(1))
        except ShellError:
            continue
        u, v, w = here.displacements(mode.solution.unknowns)[:, 0]
        t_r, t_z = float(here.section.tangent_r[0, 0]), float(here.section.tangent_z[0, 0])
        moved[:, k], radius[k] = (t_r * u - t_z * w, v, t_z * u + t_r * w), float(here.section.r[0, 0])
    return moved, radius


def likeness(one: Mode, other: Mode) -> float:
    """MAC of two modes of one harmonic, 0 (different shapes) ... 1 (same shape)."""
    (a, r_a), (b, r_b) = _motion(one), _motion(other)
    known = np.isfinite(r_a) & np.isfinite(r_b)
    a, b, w = a[:, known], b[:, known], np.sqrt(r_a[known] * r_b[known])
    return float(np.sum(w * a * b) ** 2 / (np.sum(w * a * a) * np.sum(w * b * b)))


def follow(solve: Callable[[float, int], Sequence[Mode]], known: Mode) -> Mode:
    """Follow the mode `known` to another design by its shape, by solve(place 0 ... 1, count); the way is halved where none is like it."""
    return _step(solve, known, 0.0, 1.0, DEEPEST)


def _step(solve: Callable[[float, int], Sequence[Mode]], known: Mode, start: float, end: float, left: int) -> Mode:
    count = known.index + 1
    found = solve(end, count)
    if len(found) >= count and likeness(known, found[known.index]) >= SURE:
        return found[known.index]
    found = solve(end, count + SPARE)
    like = np.array([likeness(known, mode) for mode in found])
    f = np.array([mode.frequency for mode in found])
    # of a repeated root the solver gives any two shapes; together they hold the one that is sought
    together = np.array([like[abs(f - one) < REPEATED * one].sum() for one in f])
    if together.max() >= SURE:
        return found[int(np.argmax(np.where(together >= SURE, like, -1.0)))]
    if not left:
        raise ShellError(f"no mode n = {known.harmonic} like the one followed, {known.frequency:.6g} Hz, is among the lowest {len(found)}: it has vanished or changed its shape.")  # fmt: skip
    middle = (start + end) / 2
    return _step(solve, _step(solve, known, start, middle, left - 1), middle, end, left - 1)
