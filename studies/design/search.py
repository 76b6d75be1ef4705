"""The search for the best design: full solves, an interpolant through them, steps on it, and full solves again.

First designs cover the whole box; steps from several starts look for the best region; a star of designs about the best
one then renews the interpolant within a shrinking box (a trust region). All are kept: a search that is resumed takes the same path.
"""

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from compensation.arrays import Array
from studies.design.goals import HELD, Goals, Scalar, lay_goals, step
from studies.design.interpolant import Interpolant, interpolate
from studies.design.task import Task
from studies.design.whole_steps import WholeSteps
from studies.errors import InputError
from studies.sweeps.search import Explorer

TOGETHER = 4  # designs that are computed together
ROUNDS = 6  # over the whole box, at most
WIDE, FINE = 0.15, 0.01
"""Half widths of the box about a design: the first and largest, and where steps end, in parts of the ranges."""
STAR = 0.04  # half width of a star, at most
WIDER = 2.0  # half widths of a second step, computed beside the first; the box grows as much where it is the better
SHRINK = 1 / 3  # of a box without a gain
FEW, MOST = 5, 30  # steps from one design: rough ones, those to the end
SETTLING = 8  # steps from whole steps of the parameters to others
DRAWN = 100  # of which one is looked at because it is far off
ENOUGH = 3  # regions that lead to one place
STARTS = 24  # of every step on the interpolant over the whole box
NEAR = 6.0  # half widths within which designs make the interpolant of a trust region
PENALTY = 30.0  # of the excess over limits, in spreads, against the objective's
GAIN = 1e-5  # of an objective's spread: less is none
ASIDE = 0.05  # step of a parameter that is not free, in parts of its range


class Search:
    """The designs seen so far and what becomes of them."""

    def __init__(self, task: Task, explorer: Explorer) -> None:
        self.task, self.explorer = task, explorer
        self.low = np.array([p.low for p in task.study.parameters])
        self.width = np.array([p.high - p.low for p in task.study.parameters])
        self.start = (task.start - self.low) / self.width
        self.rng = np.random.default_rng(task.keys.search.seed)
        sizes = np.array([one.step or 0.0 for one in task.keys.parameter])
        self.steps = WholeSteps(self.low, self.width, sizes, task.free)
        self.x = np.empty((0, len(self.low)))  # designs that have values, in parts of the ranges
        self.values = np.empty((0, len(task.columns)))
        self.seen: dict[bytes, Array | None] = {}  # every design looked at, in order, with its values
        self.failures: list[tuple[Array, str]] = []
        self._draw_first()
        self.goals: Goals = lay_goals(task, self.values, self.values[0])
        self.margins = np.zeros(len(task.columns))

    @property
    def spent(self) -> bool:
        """Whether as many designs were computed as the task allows."""
        return len(self.seen) >= self.task.keys.search.evaluations

    def look(self, points: Sequence[Array]) -> None:
        """Compute designs at points, all together."""
        designs = [self._design(x) for x in points]
        new = {design.tobytes(): (design, x) for design, x in zip(designs, points, strict=True)}
        new = {key: one for key, one in new.items() if key not in self.seen}
        if not new:
            return
        cases = self.explorer.cases(np.array([design for design, _ in new.values()]))
        for (key, (_, x)), case in zip(new.items(), cases, strict=True):
            good = bool(np.isfinite(case.values).all())
            self.seen[key] = case.values if good else None
            if good:
                self.x, self.values = np.vstack([self.x, x]), np.vstack([self.values, case.values])
            else:
                self.failures.append((x, case.remark))

    def rank(self, scalar: Scalar, strict: bool = True) -> list[int]:
        """Return the designs from the best on: those that keep all limits first, or (not `strict`) by gain and excess together."""
        return sorted(np.flatnonzero(self._is_plain()).tolist(), key=lambda k: self._worth(k, scalar, strict))

    def single(self, i: int) -> Scalar:
        """Return objective i alone, over its spread."""
        spread = np.array([self.goals.objectives(v) for v in self.values]).std(axis=0)
        weights = np.zeros(len(self.task.keys.objective))
        weights[i] = 1.0
        return Scalar(weights, np.zeros_like(weights), np.maximum(spread, 1e-300))

    def explore(self, scalar: Scalar) -> list[int]:
        """Look for good regions of the whole box, and return the best design of each, the best first."""
        task, idle = self.task, 0
        low, high = self._box(self.start, 2.0)
        for _ in range(ROUNDS):
            order = self.rank(scalar, False)
            before = self._worth(order[0], scalar, False)
            surface = self._surface(np.flatnonzero(self._is_plain()))
            starts = [self.x[k] for k in order[: STARTS // 3]]
            while len(starts) < STARTS:
                starts.append(np.where(np.arange(len(low)) < task.free, self.rng.random(len(low)), self.start))
            found = [self._step(surface, scalar, x, low, high) for x in starts]
            chosen: list[Array] = []
            for _, x in sorted(found, key=lambda one: one[0]):
                other = all(np.abs(x - one).max() > WIDE for one in chosen)
                if other and np.abs(x - self.x).max(axis=1).min() > FINE:
                    chosen.append(x)
            self.look([*chosen[: TOGETHER - 1], self._far_off(surface, scalar)])
            idle = 0 if self._is_better(self._worth(self.rank(scalar, False)[0], scalar, False), before) else idle + 1
            if idle == 2 or self.spent or not chosen:
                break
        regions: list[int] = []
        for k in self.rank(scalar, False):
            if all(np.abs(self.x[k] - self.x[j]).max() > 2 * WIDE for j in regions):
                regions.append(k)
        return regions[: task.keys.search.starts]

    def _far_off(self, surface: Interpolant, scalar: Scalar) -> Array:
        """Return, of drawn designs of which the better quarter is expected, the one that is farthest from all known ones."""
        free = self.task.free
        drawn = [np.append(x, self.start[free:]) for x in self.rng.random((DRAWN, free))]
        hopeful = sorted(drawn, key=lambda x: self._judge(surface, scalar, x))[: DRAWN // 4]
        return max(hopeful, key=lambda x: float(np.linalg.norm(self.x - x, axis=1).min()))

    def descend(self, scalar: Scalar, best: int, rough: bool = False, known: Sequence[int] = ()) -> int:
        """Improve a design by steps within a box that grows with what they gain and shrinks without; return the place of the best one.

        Where nothing more is foretold, a star of designs renews the interpolant. The last steps keep all limits. Rough ones take no star, and end where they meet a design `known` before.
        """
        first, centre = best, np.full_like(self.start, np.inf)
        for strict in (False,) if rough else (False, True):
            half = FINE if strict else WIDE
            for _ in range(FEW if rough else MOST):
                surface = self.local(self.x[best], half)
                best = self._best_near(best, half, scalar, strict)
                before, here = self._worth(best, scalar, strict), self.x[best]
                steps = [self._step(surface, scalar, here, *self._box(here, far)) for far in (half, WIDER * half)]
                foretold = min(self._mix(over, t, strict) for (over, t), _ in steps)
                if not rough and (half < FINE or not self._is_better(foretold, before)):
                    if np.abs(here - centre).max() <= (FINE / 10 if self.task.keys.margin else WIDER * FINE):
                        break
                    centre, half = here, max(half, FINE)
                    robust = self.task.keys.margin is not None
                    slopes = self.slopes(best, FINE if robust else min(half, STAR), both=robust)
                    self.margins = self.goals.margins(self.values[best], slopes)
                    continue
                self.look([x for _, x in steps])
                best = self._best_near(best, WIDER * half, scalar, strict)
                gained = self._is_better(self._worth(best, scalar, strict), before)
                if np.abs(self.x[best] - here).max() > half or not gained:
                    half = min(WIDER * half, WIDE) if gained else SHRINK * half
                if self.spent or (rough and half < FINE):
                    break
                if any(np.abs(self.x[best] - self.x[k]).max() < half for k in known):
                    break
        return best if rough or self._is_as_good(best, first, scalar) else first

    def best(self, scalar: Scalar) -> int:
        """Return the best design of several regions, each descended into at first, the best to the end; three that meet are enough."""
        found: list[int] = []
        for k in self.explore(scalar):
            found.append(self.descend(scalar, k, True, found))
            apart = np.abs(self.x[found] - self.x[found[-1]]).max(axis=1)
            if (apart < WIDE).sum() == ENOUGH or self.spent:
                break
        best = self.descend(scalar, min(found, key=lambda k: self._worth(k, scalar, False)))
        first = self.rank(scalar)[0]
        return best if self._is_as_good(best, first, scalar) else self.descend(scalar, first)

    def _is_as_good(self, best: int, other: int, scalar: Scalar) -> bool:
        """Whether a design is as good as another; margins are those of the first one, and the other's are not known."""
        return self.task.keys.margin is not None or self.merit(best, scalar) <= self.merit(other, scalar)

    def _best_near(self, best: int, half: float, scalar: Scalar, strict: bool) -> int:
        near = np.flatnonzero(self._is_plain() & (np.abs(self.x - self.x[best]).max(axis=1) <= half + 1e-9))
        return int(min(near, key=lambda k: self._worth(int(k), scalar, strict)))

    def _worth(self, k: int, scalar: Scalar, strict: bool) -> tuple[float, float]:
        """Return what designs are compared by on the way: limits first where `strict`, else a little beyond a limit for a gain."""
        return self._mix(*self.merit(k, scalar), strict)

    @staticmethod
    def _mix(over: float, t: float, strict: bool) -> tuple[float, float]:
        return (over if over > HELD else 0.0, t) if strict else (0.0, t + PENALTY * over)

    @staticmethod
    def _is_better(now: tuple[float, float], before: tuple[float, float]) -> bool:
        return now[0] < 0.9 * before[0] or (now[0] == before[0] == 0 and now[1] < before[1] - GAIN)

    def settle(self, scalar: Scalar, best: int) -> int:
        """Return the best design whose parameters are whole steps, where the task asks for steps; the others are searched again."""
        if not self.steps.sizes.any():
            return best
        half = WIDE if self.steps.leaves_some else FINE
        for _ in range(SETTLING):
            surface = self.local(self.x[best], half)
            x = self.x[best]
            if not self.steps.are_met(x):
                _, x = self._step(surface, scalar, x, *self._box(x, FINE))
            about = [self._fit_rest(surface, scalar, one, half) for one in self.steps.about(x, self.rng)]
            judged = [(self._judge(surface, scalar, one), one) for one in about]
            self.look([one for _, one in sorted(judged, key=lambda pair: pair[0])[:TOGETHER]])
            found = next((k for k in self.rank(scalar) if self.steps.are_met(self.x[k])), best)
            if found == best and half == FINE:
                break
            best, half = found, half if found != best else FINE
        return best

    def _fit_rest(self, surface: Interpolant, scalar: Scalar, x: Array, half: float) -> Array:
        """Return a design of whole steps with its other parameters searched again."""
        if not self.steps.leaves_some:
            return x
        low, high = (np.where(self.steps.sizes > 0, x, end) for end in self._box(x, half))
        return self._step(surface, scalar, x, low, high)[1]

    def local(self, centre: Array, half: float, without: int = -1) -> Interpolant:
        """Return the interpolant through the designs about a centre; those that are next to it where these are too few."""
        plain = np.flatnonzero(self._is_plain() & (np.arange(len(self.x)) != without))
        apart = np.abs(self.x[plain] - centre).max(axis=1)
        count = max(int((apart <= NEAR * half).sum()), 2 * self.task.free + 2)
        return self._surface(plain[np.argsort(apart, kind="stable")[:count]])

    def slopes(self, best: int, half: float, both: bool = False) -> Array:
        """Return slopes of all columns as they count, (columns, parameters), from a star of solves, to both sides where `both`."""
        x, count = self.x[best], len(self.low)
        by = np.where(np.arange(count) < self.task.free, half, ASIDE) * np.where(x <= 0.5, 1.0, -1.0)
        sides = [x + side * move for move in np.diag(by) for side in ((1.0, -1.0) if both else (1.0,))]
        self.look([one for one in sides if (one >= 0).all() and (one <= 1).all()])
        found = np.zeros((len(self.task.columns), count))
        here = (0.0, self.goals.count(self.values[best]))
        for k, move in enumerate(np.diag(by)):
            if self._value(x + move) is None and (x - move <= 1).all() and (x - move >= 0).all():
                self.look([x - move])
            known = [(side * by[k], self._value(x + side * move)) for side in (1.0, -1.0)]
            ends = [(at, self.goals.count(value)) for at, value in known if value is not None]
            if ends:
                (one, f), (other, g) = (*ends, here)[:2]
                found[:, k] = (f - g) / (one - other)
        return found

    def _draw_first(self) -> None:
        """Compute the first design and some drawn over the box; InputError where the first one, or most of them, cannot be."""
        self.look([self.start])
        if self.failures:
            raise InputError(f"the first design cannot be computed: {self.failures[0][1]}")
        free = self.task.free
        drawn = scipy.stats.qmc.LatinHypercube(free, rng=self.rng).random(2 * free + 6)
        self.look([np.append(x, self.start[free:]) for x in drawn])
        if len(self.failures) > len(drawn) / 2:
            raise InputError(
                f"{len(self.failures)} of {len(drawn)} designs drawn between the bounds cannot be computed; narrow the bounds,"
                f" or tie lengths with [[derived]]. The first of them: {self.failures[0][1]}"
            )
        for one in self.task.keys.objective:
            column = self.values[:, self.task.place(one.column)]
            if np.ptp(column) <= 1e-12 * np.abs(column).max():
                why = "The card states nothing that makes one, such as a part of the loss or an imperfection." if column[0] == 0 else ""  # fmt: skip
                raise InputError(
                    f"the objective '{one.column}' is {column[0]:g} whatever the free parameters are; leave it out. {why}".strip()
                )
            if len(steps := np.unique(column)) <= len(column) / 2:
                raise InputError(
                    f"the objective '{one.column}' changes in steps ({', '.join(f'{step:g}' for step in steps)}), so that no gradient"
                    " leads to a better design; ask for a quantity that changes continuously."
                )

    def _surface(self, places: NDArray[np.intp]) -> Interpolant:
        return interpolate(self.x[places, : self.task.free], self.goals.count(self.values[places]))

    def _step(
        self, surface: Interpolant, scalar: Scalar, x: Array, low: Array, high: Array
    ) -> tuple[tuple[float, float], Array]:
        free = self.task.free
        pieces = self.goals.pieces(scalar, surface(x[:free])[0], self.margins)
        found, over, t = step(surface, pieces, np.clip(x, low, high)[:free], low[:free], high[:free])
        return (over, t), np.append(found, self.start[free:])

    def _judge(self, surface: Interpolant, scalar: Scalar, x: Array) -> tuple[float, float]:
        values = self.goals.uncount(surface(x[: self.task.free])[0])
        return self.goals.violation(values, self.margins), scalar(self.goals.objectives(values))

    def merit(self, k: int, scalar: Scalar) -> tuple[float, float]:
        """Return the excess of a design over its limits, and its objective."""
        return self.goals.violation(self.values[k], self.margins), scalar(self.goals.objectives(self.values[k]))

    def _box(self, centre: Array, half: float) -> tuple[Array, Array]:
        """Return a box about a design within the bounds; what is not free stays."""
        free = np.arange(len(centre)) < self.task.free
        low, high = np.maximum(centre - half, 0.0), np.minimum(centre + half, 1.0)
        return np.where(free, low, self.start), np.where(free, high, self.start)

    def _value(self, x: Array) -> Array | None:
        return self.seen.get(self._design(x).tobytes())

    def _design(self, x: Array) -> Array:
        return np.asarray(np.round(self.low + x * self.width, 12))

    def _is_plain(self) -> NDArray[np.bool_]:
        """Return which designs have everything that is not free where it belongs."""
        return np.asarray((self.x[:, self.task.free :] == self.start[self.task.free :]).all(axis=1))
