"""Trimming of a card's resonator: the sites that its rim or teeth offer, and a plan for measured splits."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import pi
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from shell.errors import ShellError
from shell.imperfection import Pair
from shell.modes import solve_modes
from shell.trimming import Sites, SplitReading, TrimPlan, plan_trim
from studies.errors import InputError

if TYPE_CHECKING:
    from shell.elastic import Elastic
    from shell.resonator import Resonator

Array: TypeAlias = NDArray[np.float64]
CutKind: TypeAlias = Literal["mass", "edge", "inner", "outer"]
"""Mass alone (teeth, lumps: hardly strained), or material with its strain energy off the edge of the rim or off a face."""


@dataclass(frozen=True)
class Groove:
    """A cut: width along the circle and length along the meridian (m), and the share of the wall that it may take."""

    width: float = 0.5e-3
    length: float = 0.5e-3
    depth_limit: float = 0.3

    def depth(self, mass: float, density: float) -> float:
        """Depth of a cut that takes off a mass, m."""
        return mass / (density * self.width * self.length)


@dataclass(frozen=True)
class Teeth:
    """Teeth at the rim: number, azimuth of the first (rad), most that may be taken off each (kg)."""

    count: int
    azimuth: float
    limit: float


GROOVE = Groove()
MOST_TEETH = 1000
NARROWEST = 1e-6  # m: no tool cuts a groove that is narrower


def rim_sites(
    resonator: "Resonator",
    pairs: Mapping[int, Pair],
    density: float,
    axis: float,
    *,
    heights: Sequence[float] = (1.0,),
    groove: Groove = GROOVE,
    kind: CutKind = "mass",
) -> Sites:
    """Grooves side by side around the shell, one of them on the antinode at `axis` (rad), at positions of the meridian.

    Their number is a multiple of 4n for every harmonic, so that the antinodes of each are among them and balance each other.
    """
    if not (groove.width >= NARROWEST and NARROWEST <= groove.length < np.inf and 0 < groove.depth_limit < 1):
        raise InputError(
            f"a cut is at least {1e6 * NARROWEST:g} µm wide and long, and takes a share of the wall between 0 and 1."
        )
    step = int(np.lcm.reduce([4 * n for n in pairs]))
    azimuth, position, capacity = [], [], []
    for x in heights:
        place = resonator.at([x * resonator.length])
        circle = 2 * pi * float(place.r[0])
        if not groove.width <= circle:
            raise InputError(
                f"a cut of {1e3 * groove.width:g} mm is wider than the circle it lies on ({1e3 * circle:.3g} mm)."
            )
        room = int(circle / groove.width)
        count = max(step, room // step * step)
        azimuth.append(axis + 2 * pi * np.arange(count) / count)
        position.append(np.full(count, x))
        most = density * groove.width * groove.length * groove.depth_limit * float(place.thickness[0])
        capacity.append(np.full(count, most * min(1.0, room / count)))
    around, along = np.concatenate(azimuth) % (2 * pi), np.concatenate(position)
    return Sites(around, along, np.concatenate(capacity), _gains(pairs, along, kind))


def tooth_sites(pairs: Mapping[int, Pair], teeth: Teeth) -> Sites:
    """One site on every tooth."""
    if not (4 <= teeth.count <= MOST_TEETH and 0 < teeth.limit < np.inf and np.isfinite(teeth.azimuth)):
        raise InputError(f"teeth are 4 to {MOST_TEETH}, and what may be taken off each is a positive mass.")
    around = (teeth.azimuth + 2 * pi * np.arange(teeth.count) / teeth.count) % (2 * pi)
    along = np.ones(teeth.count)
    return Sites(around, along, np.full(teeth.count, teeth.limit), _gains(pairs, along))


def _effect(pair: Pair, position: float, kind: CutKind) -> float:
    """Z per kilogram at the azimuth 0."""
    if kind == "mass":
        return pair.mass(position)[1]
    if kind == "edge":
        if position != 1.0:
            raise InputError("a cut off the edge lies at position 1; take inner or outer for cuts off a face.")
        return pair.edging()[1]
    return pair.shaving(position, 1 if kind == "outer" else -1)[1]


def _gains(pairs: Mapping[int, Pair], position: Array, kind: CutKind = "mass") -> dict[int, Array]:
    found = {}
    for n, pair in pairs.items():
        gain = {float(x): -_effect(pair, float(x), kind) for x in np.unique(position)}
        weak = [x for x, value in gain.items() if not value > 0]
        if weak:
            raise ShellError(
                f"material at position {weak[0]:.3g} does not lower the mode n = {n} with its antinode there: choose a place nearer the rim."
            )
        found[n] = np.array([gain[float(x)] for x in position])
    return found


def plan_for_card(
    resonator: "Resonator",
    elastic: "Elastic",
    measured: Sequence[tuple[int, float, float, float]],
    *,
    goal: float,
    heights: Sequence[float] = (1.0,),
    groove: Groove = GROOVE,
    kind: CutKind = "mass",
    teeth: Teeth | None = None,
    removal_error: float = 0.02,
    gain_error: float = 0.03,
    gain: float = 1.0,
    unbalance: Mapping[int, complex] | None = None,
) -> tuple[TrimPlan, Sites]:
    """A plan for splits measured on a card's resonator.

    Parameters
    ----------
    resonator, elastic : of the card at the temperature.
    measured : (harmonic, split in Hz, azimuth of the slow axis in rad, reading error in Hz), one for each harmonic.
    goal : Hz. heights : positions of the cuts. groove, teeth : what is cut. removal_error, gain_error, unbalance : see `plan_trim`.
    gain : effect of the last round over its prediction, which scales what a mass is taken to do.
    """
    if not 0 < goal < np.inf:
        raise InputError("the goal is a positive split in Hz.")
    if not 0 < gain < np.inf:
        raise InputError("the gain is the measured change of the split over the predicted one, a positive number.")
    if not (0 <= removal_error < 1 and 0 <= gain_error < 1):
        raise InputError("the relative standard errors of the cuts lie in 0 ... 1 (0.02 is 2 %).")
    if not all(np.isfinite((split, axis)).all() and 0 <= error < np.inf for _, split, axis, error in measured):
        raise InputError("the splits and axes are finite numbers, and the reading error is one from 0 up.")
    if not all(0 <= x <= 1 for x in heights):
        raise InputError("a position along the meridian lies in 0 ... 1 (rim).")
    pairs = {}
    for n, *_ in measured:
        if n in pairs:
            raise InputError(f"the split of n = {n} is given twice.")
        pairs[n] = Pair(solve_modes(resonator, elastic, n)[0])
    readings = [SplitReading.of(n, pairs[n].mode.frequency, split, axis, error) for n, split, axis, error in measured]
    largest = max(readings, key=lambda reading: reading.hertz)
    sites = (
        tooth_sites(pairs, teeth)
        if teeth is not None
        else rim_sites(resonator, pairs, elastic.rho, largest.slow_axis, heights=heights, groove=groove, kind=kind)
    )
    sites = Sites(sites.azimuth, sites.position, sites.capacity, {n: gain * w for n, w in sites.gain.items()})
    plan = plan_trim(
        readings, sites, goal=goal, removal_error=removal_error, gain_error=gain_error, unbalance=unbalance
    )
    return plan, sites


def other_cuts(resonator: "Resonator", elastic: "Elastic", harmonic: int, kind: CutKind) -> dict[str, float]:
    """What a kilogram at the rim does to the split as each kind of cut, over what it does as `kind`."""
    pair = Pair(solve_modes(resonator, elastic, harmonic)[0])
    kinds: tuple[CutKind, ...] = ("mass", "edge", "inner", "outer")
    own = _effect(pair, 1.0, kind)
    return {other: _effect(pair, 1.0, other) / own for other in kinds}
