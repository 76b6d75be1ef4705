"""From a task to its answer: the best design verified, the price of every limit, the front, the tolerances."""

from dataclasses import dataclass
from itertools import product

import numpy as np
import scipy

from compensation.arrays import Array
from studies.design.goals import EXACT, Scalar
from studies.design.search import FINE, WIDE, Search
from studies.design.task import Task, is_magnitude, shown
from studies.errors import InputError
from studies.sweeps.evaluate import WorkPlan, evaluate_case
from studies.sweeps.search import Explorer

ACTIVE = 2e-3  # of a column's spread: a limit nearer than this holds the design back
ALIKE = 5e-3  # of the objectives' ranges: designs of the front nearer than this are one


@dataclass(frozen=True, eq=False)
class Spread:
    """What tolerances do to one wanted column; `first_order` worst case to one side, `passed` the probability that its limits hold, or None."""

    column: str
    value: float
    first_order: float
    sd: float
    low: float
    high: float
    passed: float | None


@dataclass(frozen=True, eq=False)
class Limit:
    """One limit at the best design: `price` of one unit (None: it holds nothing back), `margin` in hand for the tolerances."""

    column: str
    sign: float
    limit: float
    value: float
    margin: float
    price: float | None

    @property
    def room(self) -> float:
        """What is left to the limit."""
        return self.sign * (self.limit - self.value)


@dataclass(frozen=True, eq=False)
class Answer:
    """What a task was answered."""

    task: Task
    # best: (parameters,) values; before, after: columns of the start and of the best design; foretold: the
    # interpolant's numbers for the best one.
    before: Array
    best: Array
    after: Array
    foretold: Array
    # verified, errors: the columns of the best design, solved once more from its card, and their own errors (NaN: not known)
    verified: Array
    errors: Array
    limits: tuple[Limit, ...]
    spreads: tuple[Spread, ...]
    # (designs, parameters) and front_values, from the best in the first objective on; single rows where one is asked.
    front: Array
    front_values: Array
    history: Array  # (designs, 2) largest excess and objective of every design in the order in which it was computed
    designs: Array
    values: Array
    # evaluations, failures: how many designs were computed; the reasons of those that could not be.
    evaluations: int
    failures: tuple[tuple[Array, str], ...]


def answer(task: Task, explorer: Explorer, plan: WorkPlan) -> Answer:
    """Search, verify, and say what it costs."""
    search = Search(task, explorer)
    count = len(task.keys.objective)
    ends = [search.best(search.single(i)) for i in range(count)]
    _refuse_infeasible(search, ends[0])
    scalar = search.single(0)
    best = ends[0]
    if count > 1:
        scalar = _walk_front(search, ends)
        best = search.descend(scalar, search.rank(scalar)[0])
    smooth = best
    best = search.settle(scalar, best)
    _refuse_infeasible(search, best)
    centre = search.x[best]
    front = _unbeaten(search, scalar, [*ends, best]) if count > 1 else [best]
    # what the interpolant through all the other designs says of the best one
    others = search.local(centre, WIDE, without=best)(centre[: search.task.free])[0]
    foretold = search.goals.uncount(others)
    prices = _prices(search, scalar, smooth)
    values, place = search.values[best], task.place
    limits = tuple(
        Limit(column, sign, limit, shown(column, values[place(column)]), _margin(search, column, values), price)
        for (column, sign, limit, _), price in zip(search.goals.limits, prices, strict=True)
    )
    spreads = spread_about(search, best) if task.keys.tolerance else ()
    design = np.round(search.low + centre * search.width, 12)
    row = evaluate_case(plan, task.named(design))
    merits = [search.merit(k, scalar) for k in range(len(search.values))]
    return Answer(
        task,
        search.values[0],
        design,
        values,
        foretold,
        row.values,
        row.errors,
        limits,
        spreads,
        search.low + search.x[front] * search.width,
        search.values[front],
        np.array(merits),
        search.low + search.x * search.width,
        search.values,
        len(search.seen),
        tuple(search.failures),
    )


def _walk_front(search: Search, ends: list[int]) -> Scalar:
    """Look for the designs between those that are best in one objective, and return the scalarisation of the compromise."""
    keys, goals = search.task.keys, search.goals
    corners = np.array([goals.objectives(search.values[k]) for k in ends])
    ideal = corners.min(axis=0)
    spread = np.array([goals.objectives(v) for v in search.values]).std(axis=0)
    span = np.maximum(corners.max(axis=0) - ideal, ALIKE * spread)  # where one design is best in all, there is no front
    found: list[int] = []
    for weights in _lattice(len(ends), keys.search.front):
        between = Scalar(1 / weights, ideal, span)
        found.append(search.descend(between, search.rank(between)[0]))
    own = np.array([one.weight for one in keys.objective])
    ends += found
    return Scalar(own / own.sum(), ideal, span)


def _unbeaten(search: Search, scalar: Scalar, ends: list[int]) -> list[int]:
    """Return, of where the search ended, the designs that keep all limits and that no other beats in every objective, each sort once."""
    goals = search.goals
    held = [k for k in dict.fromkeys(ends) if goals.violation(search.values[k], search.margins) == 0]
    found = {k: (goals.objectives(search.values[k]) - scalar.ideal) / scalar.span for k in held}
    front: list[int] = []
    for k in sorted(held, key=lambda k: tuple(found[k])):
        beaten = any(
            (one <= found[k] + ALIKE).all() and (one < found[k]).any() for j, one in found.items() if j in front
        )
        if not beaten and not any((found[j] <= found[k]).all() for j in front):
            front.append(k)
    return front


def _lattice(objectives: int, count: int) -> list[Array]:
    """Return directions between the corners of the front, `count` along each edge."""
    parts = range(count + 2)
    shares = (np.array(one) / (count + 1) for one in product(parts, repeat=objectives) if sum(one) == count + 1)
    return [np.maximum(one, 1e-3) for one in shares if (one < 1).all()]


def _refuse_infeasible(search: Search, best: int) -> None:
    goals, values = search.goals, search.values[best]
    if goals.violation(values, search.margins) == 0:
        return
    words = []
    for (column, sign, limit, _), over in zip(goals.limits, goals.excess(values, search.margins), strict=True):
        if over > EXACT * abs(limit):
            unit, side = search.task.unit(column), "above" if sign > 0 else "below"
            value = shown(column, values[search.task.place(column)])
            kept = ", its margin for tolerances included," if sign * (value - limit) < over - EXACT * abs(limit) else ""
            words.append(f"{column} = {value:.6g} {unit} is{kept} {over:.4g} {side} its limit {limit:.6g}")
    at = ", ".join(
        f"{name} = {value:.6g}"
        for name, value in zip(search.task.study.names, search.low + search.x[best] * search.width, strict=True)
    )
    ends = [
        f"{p.name} is at its {'low' if x < 0.5 else 'high'} end"
        for p, x in zip(search.task.study.parameters, search.x[best], strict=True)
        if min(x, 1 - x) < FINE / 10
    ]
    bound = f" There, {' and '.join(ends)}: wider bounds may help." if ends else ""
    raise InputError(
        f"no design found meets all constraints. In the nearest one, {at}, {'; '.join(words)}.{bound} Relax one of these"
        " constraints or widen the bounds; the designs computed are kept."
    )


def _prices(search: Search, scalar: Scalar, best: int) -> list[float | None]:
    """Return the multiplier of every limit: ∇t + Σ λ ∇g + Σ μ ∇bound = 0 with λ, μ ≥ 0, by least squares."""
    goals, task = search.goals, search.task
    free = slice(0, task.free)
    z, slopes = goals.count(search.values[best]), search.slopes(best, FINE, both=True)[:, free]
    pieces = goals.pieces(scalar, z, search.margins)
    value = np.array([one.slope * z[one.column] + one.offset for one in pieces])
    slope = np.array([one.slope * slopes[one.column] for one in pieces])
    aims = np.array([one.of >= 0 for one in pieces])
    top = aims & (value > value[aims].max() - ACTIVE)
    held = ~aims & (value > -ACTIVE)
    x = search.x[best][free]
    ends = np.vstack([-np.eye(len(x))[x < ACTIVE], np.eye(len(x))[x > 1 - ACTIVE]])
    # the weights of the objectives that are largest add up to 1
    heavy = 1e3
    rows = np.vstack([slope[top], slope[held], ends]).T
    ones = np.concatenate([np.ones(top.sum()), np.zeros(held.sum() + len(ends))])
    found = scipy.optimize.nnls(np.vstack([rows, heavy * ones]), np.append(np.zeros(len(x)), heavy))[0]
    prices: list[float | None] = [None] * len(goals.limits)
    for k, multiplier in zip(np.flatnonzero(held), found[top.sum() : top.sum() + held.sum()], strict=True):
        if multiplier < 1e-6:
            continue
        piece = pieces[k]
        column, _, limit, _ = goals.limits[piece.number]
        per_unit = abs(piece.slope) / (
            abs(limit) if goals.logarithmic[piece.column] and not is_magnitude(column) else 1
        )
        prices[piece.number] = (prices[piece.number] or 0.0) + float(
            multiplier * per_unit * _unit(search, scalar, best)
        )
    return prices


def _unit(search: Search, scalar: Scalar, best: int) -> float:
    """Return what one of t is in units of the objective; 1 where several make t."""
    objectives = search.task.keys.objective
    if len(objectives) > 1:
        return 1.0
    c = search.task.place(objectives[0].column)
    by_log = search.goals.logarithmic[c] and not is_magnitude(objectives[0].column)
    return float(scalar.span[0] * (abs(search.values[best][c]) if by_log else 1.0))


def _margin(search: Search, column: str, values: Array) -> float:
    """Return what the limits of a column keep in hand; for the nearest mode, what that mode does."""
    parts = search.goals.smooth(column)
    return float(search.margins[min(parts, key=lambda c: abs(values[c]) - search.margins[c])])


DRAWN = 16  # designs drawn from the tolerances and solved in full, besides the worst corners
MANY = 2**16  # and drawn for the share that keeps the limits, to first order


def spread_about(search: Search, best: int) -> tuple[Spread, ...]:
    """Return what tolerances do to each wanted column, to first order, and check it by full solves."""
    task, goals = search.task, search.goals
    x, values = search.x[best], search.values[best]
    most = np.array([t.most if (t := task.tolerance(n)) else 0.0 for n in task.study.names]) / search.width
    sd = np.array([t.sd if (t := task.tolerance(n)) else 0.0 for n in task.study.names]) / search.width
    slopes = search.slopes(best, FINE, both=True)
    moves = {c: goals.moves(values, slopes, c) for name in task.wanted for c in goals.smooth(name)}
    nearest = {name: moves[min(goals.smooth(name), key=lambda c: abs(values[c]))] for name in task.wanted}
    corners = [x + side * np.sign(move) * most for move in nearest.values() for side in (1.0, -1.0)]
    rng = np.random.default_rng(task.keys.search.seed)
    ends = np.array([t.tolerance is not None if (t := task.tolerance(n)) else False for n in task.study.names])
    off = np.where(ends, most * rng.uniform(-1, 1, (MANY, len(x))), sd * rng.standard_normal((MANY, len(x))))
    known = len(search.values)
    search.look([*corners, *(x + off[:DRAWN])])
    around = np.vstack([search.values[known:], values])
    found = []
    for name in task.wanted:
        c, move = task.place(name), nearest[name]
        column = np.abs(around[:, c]) if is_magnitude(name) else around[:, c]
        one = float(np.sum(np.abs(move) * most)), float(np.linalg.norm(move * sd))
        value = shown(name, values[c])
        kept = [
            sign * (value + off @ move - limit) <= EXACT * abs(limit) for n, sign, limit, _ in goals.limits if n == name
        ]
        share = float(np.all(kept, axis=0).mean()) if kept else None
        found.append(Spread(name, value, *one, float(column.min()), float(column.max()), share))
    return tuple(found)
