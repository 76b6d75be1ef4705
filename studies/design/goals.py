"""What is wanted of the columns of a design, as numbers to compare and as smooth pieces to step on.

Everything is of the form: lower t until a piece stops it,

    minimise t    with    w_i (o_i(x) − ideal_i)/range_i ≤ t  for every objective i,    g_j(x) ≤ 0  for every constraint j

(Chebyshev's scalarisation, which reaches every point of a front). |v − target| gives two pieces, the nearest mode one for every
mode beside it, on the side where that mode is. Columns over decades count by their logarithm.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from compensation.arrays import Array
from studies.design.interpolant import Interpolant
from studies.design.task import Task, is_magnitude

DECADE = 10.0  # greatest over least, from which on a positive column counts by its logarithm
EXACT = 1e-6  # of a limit: what rounding and solver leave
SLSQP: Any = {"maxiter": 100, "ftol": 1e-9}
HELD = 1e-7  # of a column's spread: the optimiser's own


@dataclass(frozen=True)
class Piece:
    """`slope` z_column + `offset`, in spreads of the column; of objective `of`, or of a constraint where that is -1."""

    column: int
    slope: float
    offset: float
    of: int
    number: int


@dataclass(frozen=True, eq=False)
class Scalar:
    """How several objectives become one number: arrays (objectives,)."""

    weights: Array
    ideal: Array
    span: Array

    def __call__(self, objectives: Array) -> float:
        """Return the number."""
        return float(np.max(self.weights * (objectives - self.ideal) / self.span))


@dataclass(frozen=True, eq=False)
class Goals:
    """The objectives and constraints of a task over its columns."""

    task: Task
    # (columns,) of bool. spread, raw_spread : (columns,) of the columns as they count, and in their units.
    logarithmic: NDArray[np.bool_]
    spread: Array
    raw_spread: Array
    nominal: Array  # (columns,) values of the first design, from which a `within` without a target counts

    def count(self, values: Array) -> Array:
        """Return values (…, columns) as they count: some by their logarithm."""
        safe = np.where(self.logarithmic, values, 1.0)
        return np.where(self.logarithmic, np.log(np.maximum(safe, 1e-300)), values)

    def uncount(self, z: Array) -> Array:
        """Return values of columns from how they count."""
        return np.where(self.logarithmic, np.exp(np.where(self.logarithmic, z, 0.0)), z)

    def objectives(self, values: Array) -> Array:
        """Return the objectives of one design, (objectives,), each to be small."""
        z = self.count(values)
        found = []
        for one in self.task.keys.objective:
            c = self.task.place(one.column)
            if one.target is not None:
                found.append(abs(values[c] - one.target))
            else:
                found.append(-abs(z[c]) if is_magnitude(one.column) else z[c] if one.goal == "least" else -z[c])
        return np.array(found)

    def excess(self, values: Array, margins: Array) -> Array:
        """Return by how much each limit is passed with its margin, in units of its column; negative: what is left; (limits,)."""
        found = []
        for column, sign, limit, _ in self.limits:
            c, parts = self.task.place(column), self.smooth(column)
            if is_magnitude(column):
                found.append(limit - min(abs(values[c]), float(np.min(abs(values[parts]) - margins[parts]))))
            else:
                found.append(sign * (values[c] - limit) + margins[c])
        return np.array(found)

    def violation(self, values: Array, margins: Array) -> float:
        """Return the largest excess over limits with their margins, in spreads of its column; 0 where all is kept."""
        found = [0.0]
        for (column, sign, limit, _), over in zip(self.limits, self.excess(values, margins), strict=True):
            c = self.task.place(column)
            if self.logarithmic[c]:  # sign (v − limit) + margin = over
                value = values[c]
                found.append((sign * np.log(value / max(value - sign * over, 1e-300)) - EXACT) / self.spread[c])
            else:
                found.append((over - EXACT * abs(limit)) / self.raw_spread[c])
        return float(max(found))

    @cached_property
    def limits(self) -> list[tuple[str, float, float, int]]:
        """Column, +1 for an upper and -1 for a lower one, limit, and number of the constraint."""
        found = []
        for number, one in enumerate(self.task.keys.constraint):
            low, high = one.limits(float(self.nominal[self.task.place(one.column)]))
            found += [(one.column, sign, end, number) for sign, end in ((-1.0, low), (1.0, high)) if np.isfinite(end)]
        return found

    def margins(self, values: Array, slopes: Array) -> Array:
        """Return what the limits of each column keep in hand for the tolerances, in its unit, by the slopes (columns, parameters)."""
        found = np.zeros(len(self.task.columns))
        if self.task.keys.margin is not None:
            for c in {c for column, *_ in self.limits for c in self.smooth(column)}:
                found[c] = reach(self.task, self.moves(values, slopes, c))
        return found

    def moves(self, values: Array, slopes: Array, column: int) -> Array:
        """Return the change of a column, in its unit, by the width of every parameter."""
        return np.asarray(slopes[column] * (values[column] if self.logarithmic[column] else 1.0))

    def pieces(self, scalar: Scalar, z: Array, margins: Array) -> list[Piece]:
        """Return all pieces about a design of which z (columns,) counts."""
        return [*self._of_objectives(scalar, z), *self._of_limits(z, margins)]

    def _of_objectives(self, scalar: Scalar, z: Array) -> Iterator[Piece]:
        for i, one in enumerate(self.task.keys.objective):
            w = float(scalar.weights[i] / scalar.span[i])
            ideal = -w * float(scalar.ideal[i])
            for c in self.smooth(one.column):
                if one.target is not None:
                    yield from (Piece(c, s * w, ideal - s * w * one.target, i, i) for s in (1.0, -1.0))
                elif is_magnitude(one.column):
                    yield Piece(c, -w * (1.0 if z[c] >= 0 else -1.0), ideal, i, i)
                else:
                    yield Piece(c, w if one.goal == "least" else -w, ideal, i, i)

    def _of_limits(self, z: Array, margins: Array) -> Iterator[Piece]:
        for k, (column, sign, limit, _) in enumerate(self.limits):
            for c in self.smooth(column):
                bound = limit - sign * float(margins[c])
                side = (1.0 if z[c] >= 0 else -1.0) if is_magnitude(column) else 1.0
                by_log = self.logarithmic[c] and not is_magnitude(column)
                end = float(np.log(max(bound, 1e-300))) if by_log else bound
                yield Piece(c, sign * side / self.spread[c], -sign * end / self.spread[c], -1, k)

    def smooth(self, column: str) -> list[int]:
        """Return the places of the smooth columns that a column is made of."""
        if is_magnitude(column):
            stem = column.removesuffix("_Hz") + "_of_n"
            return [k for k, name in enumerate(self.task.columns) if name.startswith(stem)]
        return [self.task.place(column)]


def reach(task: Task, moves: Array) -> float:
    """Return what tolerances do to a column that moves so by the width of every parameter: at worst, or with a probability."""
    known = [
        (abs(move) / (p.high - p.low), tolerance)
        for p, move in zip(task.study.parameters, moves, strict=True)
        if (tolerance := task.tolerance(p.name)) is not None
    ]
    margin = task.keys.margin
    if margin is None or margin.kind == "worst-case":
        return float(sum(move * one.most for move, one in known))
    times = float(scipy.stats.norm.ppf(margin.share))
    each = np.linalg.norm([move * one.sd for move, one in known])
    normal = np.linalg.norm([move * one.sd for move, one in known if one.tolerance is None])
    ends = sum(move * one.most for move, one in known if one.tolerance is not None)  # an even one goes no farther
    return float(min(times * each, ends + times * normal))


def lay_goals(task: Task, values: Array, nominal: Array) -> Goals:
    """Return the goals of a task, scaled by the designs known so far, array (m, columns)."""
    signed = {task.place(one.column) for one in task.keys.objective if one.target is not None}
    signed |= {k for k, name in enumerate(task.columns) if "separation" in name}
    positive = (values > 0).all(axis=0)
    wide = values.max(axis=0) > DECADE * np.where(positive, values.min(axis=0), np.inf)
    logarithmic = np.array([bool(w) and k not in signed for k, w in enumerate(positive & wide)])
    ones = np.ones(len(task.columns))
    counted = Goals(task, logarithmic, ones, ones, nominal).count(values)
    spreads = [np.maximum(v.std(axis=0), 1e-9 * np.abs(v).max(axis=0) + 1e-300) for v in (counted, values)]
    return Goals(task, logarithmic, spreads[0], spreads[1], nominal)


def step(
    surface: Interpolant, pieces: Sequence[Piece], start: Array, low: Array, high: Array
) -> tuple[Array, float, float]:
    """Minimise t on the interpolant within a box, by SLSQP; return x, the largest excess over limits (in spreads), and t there."""
    columns = np.array([one.column for one in pieces])
    slope, offset = (np.array([getattr(one, name) for one in pieces]) for name in ("slope", "offset"))
    aims = np.array([one.of >= 0 for one in pieces])
    used_ones, places = np.unique(columns, return_inverse=True)
    wanted = surface.of(used_ones)
    last: list[Any] = [None, None]

    def at(x: Array) -> tuple[Array, Array]:
        if last[0] is None or not np.array_equal(last[0], x):
            values, slopes = wanted(x)
            last[:] = x.copy(), (slope * values[places] + offset, slope[:, None] * slopes[places])
        return last[1]  # type: ignore[no-any-return]

    def solve(begin: Array, lifted: NDArray[np.bool_], used: NDArray[np.bool_]) -> Array:
        """Minimise t with the pieces that `lifted` marks at most t, the others that are used at most 0."""
        first = at(begin)[0]
        y = np.append(begin, first[lifted].max())
        unit = np.append(np.zeros(len(begin)), 1.0)
        t = lifted[used].astype(float)
        held: Any = {
            "type": "ineq",
            "fun": lambda y: t * y[-1] - at(y[:-1])[0][used],
            "jac": lambda y: np.column_stack([-at(y[:-1])[1][used], t]),
        }
        box: Any = [*zip(low, high, strict=True), (None, None)]
        solver: Any = scipy.optimize.minimize  # its types know no array of any length
        found = solver(
            lambda y: y[-1], y, jac=lambda y: unit, method="SLSQP", bounds=box, constraints=held, options=SLSQP
        )
        return np.asarray(np.clip(found.x[:-1], low, high))

    def judge(x: Array) -> tuple[float, float]:
        values = at(x)[0]
        return max(0.0, float(values[~aims].max(initial=0.0))), float(values[aims].max())

    everything = np.ones(len(pieces), dtype=bool)
    x = solve(start, aims, everything)
    over, t = judge(x)
    if over > HELD:
        nearer = solve(start, ~aims, ~aims)
        if judge(nearer)[0] < over:
            x = solve(nearer, aims, everything) if judge(nearer)[0] <= HELD else nearer
            if judge(x)[0] > max(HELD, judge(nearer)[0]):
                x = nearer
        over, t = judge(x)
    return x, over, t
