"""Trimming of a card's resonator: sites of rim or teeth, and a plan that is solved (shell.groove) and made again until depths stay."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import hypot, pi
from typing import Literal, TypeAlias

import numpy as np

from compensation.arrays import Array
from compensation.constants import NINETY
from shell.elastic import Elastic
from shell.errors import ShellError
from shell.groove import Groove, GrooveSplit, solve_groove
from shell.imperfection import Pair
from shell.modes import solve_modes
from shell.resonator import Resonator
from shell.trimming import Sites, SplitWave, TrimPlan, plan_trim
from studies.errors import InputError

CutKind: TypeAlias = Literal["mass", "edge", "inner", "outer"]
"""Mass alone (teeth, lumps: hardly strained), or material with its strain energy off the edge of the rim or off a face."""


@dataclass(frozen=True)
class Tool:
    """What cuts: width along the circle and length along the meridian (m), and the share of the wall that it may take."""

    width: float = 0.5e-3
    length: float = 0.5e-3
    depth_limit: float = 0.3


@dataclass(frozen=True)
class Teeth:
    """Teeth at the rim: number, azimuth of the first (rad), most that may be taken off each (kg)."""

    count: int
    azimuth: float
    limit: float


@dataclass(frozen=True)
class PlannedCut:
    """A groove as it is planned at one position, and what it does."""

    groove: Groove  # of the mean mass
    splits: Mapping[int, GrooveSplit]  # by harmonic n
    first: Mapping[int, float]  # relative split per kg by the shape derivative, by n
    scatter: float  # relative, of the masses of the cuts there
    touching: float = 1.0  # cuts side by side, which are one groove

    @property
    def mass(self) -> float:
        """What one cut removes, kg."""
        return next(iter(self.splits.values())).mass / self.touching

    @property
    def error(self) -> float:
        """Relative standard error of what the cut does: of its relieved stress, and that it changes with the depth."""
        return max(hypot(x.error, x.relief * self.scatter) / abs(x.wave) for x in self.splits.values())

    def gain(self, harmonic: int, deeper: float = 1.0) -> float:
        """The change of the split over that by the shape derivative; of a cut some times as deep, by `GROWTH`."""
        split = self.splits[harmonic]
        return float((split.layer + split.relief * deeper**GROWTH) / (split.mass * self.first[harmonic]))

    def depth(self, mass: float) -> float:
        """Depth of a cut of some mass, m."""
        return self.groove.depth * mass / self.mass

    def check(self) -> None:
        """Refuse a cut of which too little is known."""
        if NINETY * self.error > LEAST_KNOWN:
            raise ShellError(
                f"a cut {1e3 * self.groove.width:.3g} mm wide and {1e6 * self.groove.depth:.3g} µm deep at this place changes the split by "
                f"{self.gain(next(iter(self.splits))):.2f} ± {100 * NINETY * self.error:.0f} % of the change by a shallow cut: mass removal and stress relief nearly cancel. {WIDER}"
            )


@dataclass(frozen=True)
class CardPlan:
    """A plan and the grooves that it makes, by position (none for teeth and masses)."""

    plan: TrimPlan
    cuts: Mapping[float, PlannedCut]


LEAST_KNOWN = 0.5  # half-width of that of the gain, relative, with which a cut is still planned
SAME_DEPTH = 0.03
GROWTH = 0.8  # of the relief of a cut over its mass, a power of its depth: 0.8 off an edge, 1 off a face
MOST_PLANS = 60
WIDER = "Make wider, shallower cuts (--width-mm), or use teeth."
TOOL = Tool()
MOST_TEETH = 1000
NARROWEST = 1e-6  # m: no tool cuts a groove that is narrower


def rim_sites(
    resonator: Resonator, pairs: Mapping[int, Pair], density: float, axis: float, *,
    heights: Sequence[float] = (1.0,), tool: Tool = TOOL, kind: CutKind = "mass",
) -> Sites:  # fmt: skip
    """Grooves around the shell, a multiple of 4n for every n, one on the antinode at `axis` (rad), at positions of the meridian."""
    if not (tool.width >= NARROWEST and NARROWEST <= tool.length < np.inf and 0 < tool.depth_limit < 1):
        raise InputError(f"a cut is at least {1e6 * NARROWEST:g} µm wide and long, and takes a share of the wall between 0 and 1.")  # fmt: skip
    step = int(np.lcm.reduce([4 * n for n in pairs]))
    azimuth, position, capacity = [], [], []
    for x in heights:
        place = resonator.at([x * resonator.length])
        circle = 2 * pi * float(place.r[0])
        if not tool.width <= circle:
            raise InputError(f"a cut of {1e3 * tool.width:g} mm is wider than its circle ({1e3 * circle:.3g} mm).")
        room = int(circle / tool.width)
        count = max(step, room // step * step)
        azimuth.append(axis + 2 * pi * np.arange(count) / count)
        position.append(np.full(count, x))
        # through the wall off the edge, as long as the share of the wall is thick; else that share deep
        across = float(place.thickness[0]) if kind == "edge" else tool.length
        most = density * tool.width * across * tool.depth_limit * float(place.thickness[0])
        capacity.append(np.full(count, most * min(1.0, room / count)))
    around, along = np.concatenate(azimuth) % (2 * pi), np.concatenate(position)
    return Sites(around, along, np.concatenate(capacity), _gains(pairs, along, kind))


def tooth_sites(pairs: Mapping[int, Pair], teeth: Teeth) -> Sites:
    """One site on every tooth."""
    if not (4 <= teeth.count <= MOST_TEETH and 0 < teeth.limit < np.inf and np.isfinite(teeth.azimuth)):
        raise InputError(
            f"--teeth {teeth.count}, --tooth-limit-ug {1e9 * teeth.limit:g}: there must be 4 to {MOST_TEETH} teeth, and the largest mass to remove from each must be positive."
        )
    around = (teeth.azimuth + 2 * pi * np.arange(teeth.count) / teeth.count) % (2 * pi)
    along = np.ones(teeth.count)
    return Sites(around, along, np.full(teeth.count, teeth.limit), _gains(pairs, along))


def _effect(pair: Pair, position: float, kind: CutKind) -> float:
    """Z per kilogram at the azimuth 0."""
    if kind == "mass":
        return pair.mass(position)[1]
    if kind == "edge":
        if position != 1.0:
            raise InputError("an edge cut lies at position 1; use inner or outer for cuts into a face.")
        return pair.edging()[1]
    return pair.shaving(position, kind)[1]


def _gains(pairs: Mapping[int, Pair], position: Array, kind: CutKind = "mass") -> dict[int, Array]:
    found = {}
    for n, pair in pairs.items():
        gain = {float(x): -_effect(pair, float(x), kind) for x in np.unique(position)}
        found[n] = np.array([gain[float(x)] for x in position])
    return found


def plan_for_card(
    resonator: Resonator, elastic: Elastic, measured: Sequence[tuple[int, float, float, float]], *, goal: float,
    heights: Sequence[float] = (1.0,), tool: Tool = TOOL, kind: CutKind = "mass", teeth: Teeth | None = None,
    removal_error: float = 0.02, gain_error: float = 0.03, gain: float = 1.0,
    unbalance: Mapping[int, complex] | None = None,
) -> CardPlan:  # fmt: skip
    """A plan for splits (harmonic, Hz, slow axis in rad, reading error in Hz) by cuts at `heights`; `gain` of the last round; `plan_trim`."""
    if not 0 < goal < np.inf:
        raise InputError(f"--goal {goal:g}: must be a positive split in Hz.")
    if gain == 0 or not np.isfinite(gain):
        raise InputError(f"--gain {gain:g}: measured over predicted change of the split, of either sign, not 0.")
    if not (0 <= removal_error < 1 and 0 <= gain_error < 1):
        raise InputError("the relative standard errors of the cuts must lie between 0 and 1 (0.02 is 2 %).")
    if not all(np.isfinite((split, axis)).all() and 0 <= error < np.inf for _, split, axis, error in measured):
        raise InputError("splits and axes must be finite, and the reading error must not be negative.")
    for x in heights:
        if not 0 <= x <= 1:
            raise InputError(f"--position {x:g}: must lie between 0 and 1 (rim).")
    pairs = {}
    for n, *_ in measured:
        if n in pairs:
            raise InputError(f"the split of n = {n} is given twice.")
        pairs[n] = Pair(solve_modes(resonator, elastic, n)[0])
    readings = [SplitWave.of(n, pairs[n].mode.frequency, split, axis, error) for n, split, axis, error in measured]
    largest = max(readings, key=lambda reading: reading.hertz)
    if teeth is not None:
        sites = tooth_sites(pairs, teeth)
    else:
        sites = rim_sites(resonator, pairs, elastic.rho, largest.slow_axis, heights=heights, tool=tool, kind=kind)

    def plan_with(gains: Mapping[int, Array], error: float) -> TrimPlan:
        scaled = replace(sites, gain={n: gain * w for n, w in gains.items()})
        errors = {"removal_error": removal_error, "gain_error": error}
        return plan_trim(readings, scaled, goal=goal, unbalance=unbalance, **errors)

    if teeth is not None or kind == "mass":
        return CardPlan(plan_with(sites.gain, gain_error), {})
    cuts: dict[float, PlannedCut] = {}
    planned: dict[float, tuple[float, float, float]] = {}
    for _ in range(MOST_PLANS):
        deeper = {x: planned[x][0] / cut.mass if x in planned else 1.0 for x, cut in cuts.items()}
        gains = {
            n: w * np.array([cuts[x].gain(n, deeper[x]) if x in cuts else 1.0 for x in sites.position])
            for n, w in sites.gain.items()
        }
        try:
            plan, before = plan_with(gains, error_of_gain(cuts, gain_error)), planned
        except ShellError:
            if cuts:  # what they relieve leaves too little of their effect
                break
            raise
        planned = {x: _typical(plan, sites, x) for x in sorted({cut.position for cut in plan.cuts})}
        if not all(x in before and _same(planned[x], before[x]) for x in planned):
            continue
        if all(x in cuts and _same(one, (cuts[x].mass, 0.0, cuts[x].touching)) for x, one in planned.items()):
            used = {x: cuts[x] for x in planned}
            for cut in used.values():
                cut.check()
            return CardPlan(plan, used)
        for x, (mass, spread, touching) in planned.items():
            wall = float(resonator.at([x * resonator.length]).thickness[0])
            across = wall if kind == "edge" else tool.length
            depth = cuts[x].depth(mass) if x in cuts else mass / (elastic.rho * tool.width * across)
            groove = Groove(kind, x, tool.width * touching, tool.length, depth)
            first = {n: float(w[sites.position == x][0]) for n, w in sites.gain.items()}
            cuts[x] = PlannedCut(
                groove, {n: solve_groove(pair, groove) for n, pair in pairs.items()}, first, spread, touching
            )
    raise ShellError(f"no depth of these cuts achieves the plan: the stress that narrow grooves relieve cancels the effect of the mass they remove. {WIDER}")  # fmt: skip


def _same(one: tuple[float, float, float], other: tuple[float, float, float]) -> bool:
    """Whether cuts of a typical mass, with so many side by side, are as deep and wide as others."""
    return all(abs(one[k] / other[k] - 1) < SAME_DEPTH for k in (0, 2))


def error_of_gain(cuts: Mapping[float, PlannedCut], common: float) -> float:
    """Return the relative standard error of what cuts do to the split: what is common to all, and that of the least known groove."""
    return hypot(common, max((cut.error for cut in cuts.values()), default=0.0))


def _typical(plan: TrimPlan, sites: Sites, position: float) -> tuple[float, float, float]:
    """Mean mass of the cuts at a position, weighted by itself, its relative scatter, and how many touch: (Σ m)²/Σ m² of a run."""
    there = [cut for cut in plan.cuts if cut.position == position]
    masses, around = np.array([cut.mass for cut in there]), np.sort([cut.azimuth % (2 * pi) for cut in there])
    step = 2 * pi / np.count_nonzero(sites.position == position)
    apart = np.diff(around, append=around[0] + 2 * pi) > 1.5 * step
    mean = float(masses @ masses / masses.sum())
    scatter = float(np.sqrt(masses @ (masses - mean) ** 2 / masses.sum()) / mean)
    return mean, scatter, max(float(masses.sum()) / mean / max(int(apart.sum()), 1), 1.0)


def other_cuts(resonator: Resonator, elastic: Elastic, harmonic: int, kind: CutKind) -> dict[str, float]:
    """What a kilogram at the rim does to the split as each kind of cut, over what it does as `kind`."""
    pair = Pair(solve_modes(resonator, elastic, harmonic)[0])
    kinds: tuple[CutKind, ...] = ("mass", "edge", "inner", "outer")
    own = _effect(pair, 1.0, kind)
    return {other: _effect(pair, 1.0, other) / own for other in kinds}
