"""Elements of a meridian: their levels of refinement, and their breaks at joints, knots of thickness and layers of edges and joints."""

from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from shell.errors import ShellError
from shell.kernel import Orders
from shell.resonator import Resonator

End = Literal["pole", "free", "clamped", "tied"]
Theory = Literal["solid", "shell", "rayleigh"]
Kind = Literal["along", "through", "solids"]
KINDS: tuple[Kind, ...] = ("along", "through", "solids")  # what an error may come from
LONGEST = 1.6  # element length over the radius
SMALL = 0.5  # length over radius of a small element
OTHERS = "the design has other elements than the one that they are laid like"


@dataclass(frozen=True)
class Level:
    """Orders (u, v, w) through the thickness, along the meridian, in blocks; rings at corners; `longest` times the radius, each `split`.

    Elements are laid `like` those of another design, in the same number and order: what is solved is then smooth in the dimensions.
    """

    through: Orders
    along: int
    block: int
    rings: int
    split: int = 1
    longest: float = LONGEST
    like: Resonator | None = field(default=None, repr=False)

    def raised(self, theory: Theory, kinds: set[Kind]) -> "Level":
        """The next level in what the error comes from; the same level where that is at its end."""
        ladder = LEVELS[theory]
        steps: dict[Kind, dict[str, object]] = {
            "along": next(
                ({"along": one.along} for one in ladder if one.along > self.along), {"split": ladder[-1].split}
            ),
            "through": next(({"through": one.through} for one in ladder if one.through > self.through), {}),
            "solids": next(({"block": one.block, "rings": one.rings} for one in ladder if one.block > self.block), {}),
        }
        return replace(self, **{name: value for kind in kinds for name, value in steps[kind].items()})  # type: ignore[arg-type]


_SOLID = ((5, 3), (6, 5), (8, 7), (10, 9), (12, 11))  # degree of blocks, rings around sharp corners
LEVELS: dict[str, tuple[Level, ...]] = {
    "solid": tuple(
        Level(through, along, *solid, split)
        for through, along, solid, split in zip(
            ((3, 3, 3), (5, 5, 4), (7, 7, 6), (9, 9, 8), (11, 11, 10)),
            (9, 12, 16, 20, 20),
            _SOLID,
            (1, 1, 1, 1, 2),
            strict=True,
        )
    ),
    "shell": tuple(
        Level((1, 1, 0), along, *solid, split)
        for along, solid, split in zip(
            (10, 12, 16, 20, 20), ((5, 3), (6, 3), (8, 5), *_SOLID[3:]), (1, 1, 1, 1, 2), strict=True
        )
    ),
}
FIRST = {theory: levels[0] for theory, levels in LEVELS.items()}
ROUGH = {theory: replace(level, along=6, block=4, rings=2) for theory, level in FIRST.items()}  # for 1e-3

SMOOTH_JOINT = 1e-6  # rad; a larger change of the tangent is a kink and gets a solid corner


@dataclass(frozen=True)
class Chain:
    """A run of shell elements without a kink: arc lengths of their ends (m), the curve each lies on, what holds the ends, which are small."""

    breaks: tuple[float, ...]
    segments: tuple[int, ...]
    ends: tuple[End, End]
    small: tuple[bool, ...]

    def element(self, k: int) -> "Chain":
        """One of its elements alone."""
        return Chain(self.breaks[k : k + 2], (self.segments[k],), self.ends, (self.small[k],))


def lay_chain(
    resonator: Resonator, start: float, stop: float, ends: tuple[End, End], n: int, level: Level,
    model: Chain | None = None,
) -> Chain:  # fmt: skip
    """Break the meridian between two arc lengths into elements, also for the layers of edges (2 h, 5 √(h R)) and of jumps of curvature.

    Like those of a `model`, between joints and knots at the same parts of the arc.
    """
    firm = _firm_ends(resonator, start, stop)
    if model and level.like:
        known = _firm_ends(level.like, model.breaks[0], model.breaks[-1])
        if len(known) != len(firm):
            raise ShellError(f"{OTHERS}: a joint or knot of its thickness lies elsewhere.")
        breaks = [float(s) for s in np.interp(model.breaks, known, firm)]
        small = model.small
    else:
        breaks = _break(resonator, firm, ends, n, level)
        small = tuple(bool(one) for one in np.diff(breaks) < SMALL * resonator.size)
    bounds = np.array(resonator._starts)
    middles = (np.array(breaks[1:]) + np.array(breaks[:-1])) / 2
    segments = np.clip(np.searchsorted(bounds, middles, side="right") - 1, 0, len(resonator.segments) - 1)
    return Chain(tuple(breaks), tuple(int(k) for k in segments), ends, small)


def _firm_ends(resonator: Resonator, start: float, stop: float) -> list[float]:
    """Arc lengths at which an element ends in any case: joints, and knots of the thickness."""
    margin = 1e-9 * (stop - start)
    knots = (position * resonator.length for position, _ in resonator.thickness[1:-1])
    return sorted({start, stop, *(s for s in (*resonator.joints, *knots) if start + margin < s < stop - margin)})


def _break(resonator: Resonator, firm: list[float], ends: tuple[End, End], n: int, level: Level) -> list[float]:
    start, stop = firm[0], firm[-1]
    wanted: list[tuple[float, float]] = []  # (distance from its edge, arc length)
    for edge, inward, end in ((start, 1, ends[0]), (stop, -1, ends[1])):
        if end != "pole":
            wanted += _layers(resonator, edge, inward, end)
    for joint in (s for s in resonator.joints if s in firm[1:-1]):
        wanted += [(w, joint + side * w) for side in (-1, 1) for w, _ in _layers(resonator, joint, side, "tied")]
    # of equal ones the outer first, whatever rounding says
    for width, s in sorted(wanted, key=lambda one: (float(f"{one[0]:.6g}"), -one[1])):
        if min(abs(s - other) for other in firm) > 0.4 * width and start < s < stop:
            firm = sorted([*firm, s])
    longest = level.longest * resonator.size * crowding(n)
    breaks: list[float] = [start]
    for one, two in pairwise(firm):
        pieces = level.split * int(np.ceil((two - one) / longest - 1e-9))
        breaks += np.linspace(one, two, pieces + 1)[1:].tolist()
    return breaks


def crowding(n: int) -> float:
    """By how much shorter elements are for a high harmonic, which decays like r^n towards a pole."""
    return min(1.0, 4 / max(n, 1))


def _layers(resonator: Resonator, edge: float, inward: int, end: End) -> list[tuple[float, float]]:
    just_inside = edge + inward * 1e-6 * resonator.length
    there = resonator.at([just_inside])
    h = float(there.thickness[0])
    bend = max(abs(float(there.curvature[0])), abs(float(there.normal_r[0] / there.r[0])))
    widths = [] if end == "tied" else [2 * h]
    if bend * resonator.size > 0.02:
        widths.append(5 * float(np.sqrt(h / bend)))
    return [(width, edge + inward * width) for width in widths]
