"""Shapes of an effect: which of a grid are scanned (every second, third, … of a large one), and where between them one is likeliest."""

from collections.abc import Callable, Sequence

import numpy as np
import scipy

from compensation.arrays import Array
from studies.effects import Effect, Parameter, Span
from studies.inference.background import Background
from studies.inference.linear import Term

Moved = Callable[[Term, tuple[float, ...]], Term]
"""A term with another shape."""
MOST_SHAPES = 400
"""Of an effect; of a larger grid every second, third, … of the shapes that differ only in what a fit moves, of each such series as many."""
FEW, LEADING, WIDTH = 40, 0.4, 4
"""Of effects with more shapes than FEW only the leading columns are scanned: those with a prior of at least this part of the widest."""
FINITE = 1e3
"""Fall of the evidence beyond which a shape is as good as impossible."""
MOVES, EDGE = 3, 0.05
"""Most moves of a shape parameter to the next shapes of its grid, and the part of a move from whose end it goes on."""


def polish(moved: Moved, span: Span, beside: Background, term: Term, anew: bool = True) -> Term:
    """Move a shape to where the evidence is largest, among those that it stands for (if `anew`), then between the next ones."""
    effect = term.effect
    grid = [tuple(shape) for shape in effect.grid(span, term.response)]
    around = _passed(effect, grid, term.shape) if len(grid) > MOST_SHAPES else []
    if effect.near is not None:
        grid = [tuple(shape) for shape in effect.near(span, term.response, term.shape)]
        around = grid[:: -(-len(grid) // MOST_SHAPES)]
    best: dict[tuple[float, ...], tuple[float, Term]] = {}
    for one in [term, *(moved(term, shape) for shape in around if anew)]:
        series, gain = _steady(effect, one.shape), beside.with_term(one)[1]
        if series not in best or gain > best[series][0]:
            best[series] = (gain, one)
    tried = [_between_shapes(moved, span, beside, one, gain, grid) for gain, one in best.values()]
    return max(tried, key=lambda found: found[0])[1]


def _between_shapes(
    moved: Moved, span: Span, beside: Background, term: Term, best: float, grid: Sequence[tuple[float, ...]]
) -> tuple[float, Term]:
    """Move the free parameters of a shape, one after another, between the next shapes of its series."""
    effect = term.effect
    series = np.array([shape for shape in grid if _steady(effect, shape) == _steady(effect, term.shape)] or grid)
    for k, parameter in enumerate(effect.shape):
        for _ in range(MOVES):
            if not parameter.moves(term.shape[k]) or not np.isfinite(best):
                break
            low, high = _between(span, series[:, k], term.shape[k], parameter)
            if high <= low:
                break
            found, shape, at_edge = _move(moved, beside, term, k, (low, high), best)
            if found <= best:
                break
            best, term = found, moved(term, shape)
            if not at_edge:
                break
    return best, term


def _move(
    moved: Moved, beside: Background, term: Term, k: int, bounds: tuple[float, float], best: float
) -> tuple[float, tuple[float, ...], bool]:
    """Return the largest evidence with one parameter between bounds, the shape there, and whether it is at one of them."""
    logarithmic = term.effect.shape[k].logarithmic and bounds[0] > 0
    low, high = np.log(bounds) if logarithmic else bounds

    def at(x: float) -> tuple[float, ...]:
        value = float(np.exp(x)) if logarithmic else float(x)
        return (*term.shape[:k], value, *term.shape[k + 1 :])

    lowest = scipy.optimize.minimize_scalar(
        lambda x: -max(beside.with_term(moved(term, at(x)))[1], best - FINITE),
        bounds=(low, high),
        method="bounded",
        options={"maxiter": 10},
    )
    inside = low + EDGE * (high - low) < lowest.x < high - EDGE * (high - low)
    return float(-lowest.fun), at(lowest.x), not inside


def _between(span: Span, grid: Array, at: float, parameter: Parameter) -> tuple[float, float]:
    """Return the neighbours of a value in a grid, within the bounds of its parameter."""
    near = 1e-9 * max(abs(at), 1.0)
    values = np.unique(grid)
    below, above = values[values < at - near], values[values > at + near]
    if below.size and above.size:  # one that it nearly is is no neighbour
        apart = 2.0 * EDGE * (above[0] - below[-1])
        below, above = below[below < at - apart], above[above > at + apart]
    step = 1.6 if parameter.logarithmic else 1.0
    low = below[-1] if below.size else (at / step if parameter.logarithmic else at - step)
    high = above[0] if above.size else (at * step if parameter.logarithmic else at + step)
    ends = parameter.high, parameter.of_run * span.longest_run, parameter.of_range * span.temperature_range
    return float(max(low, parameter.low)), float(min(high, *ends))


def _series(effect: Effect, grid: Sequence[tuple[float, ...]]) -> list[list[tuple[float, ...]]]:
    """Return the shapes of a grid in series of equal steady parameters, each in its order."""
    found: dict[tuple[float, ...], list[tuple[float, ...]]] = {}
    for shape in grid:
        found.setdefault(_steady(effect, shape), []).append(shape)
    return list(found.values())


def _steady(effect: Effect, shape: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(value for value, parameter in zip(shape, effect.shape, strict=True) if parameter.steady)


def chosen(effect: Effect, grid: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
    """Return the shapes of a grid that are scanned."""
    every = _series(effect, grid)
    apart = [_apart(series, len(every)) for series in every]
    return [shape for series, step in zip(every, apart, strict=True) for shape in series[step // 2 :: step]]


def _apart(series: Sequence[tuple[float, ...]], count: int) -> int:
    """Which of a series are scanned, every first, second, … where each of so many has the same part of `MOST_SHAPES`."""
    return -(-len(series) * count // MOST_SHAPES)


def _passed(effect: Effect, grid: list[tuple[float, ...]], at: tuple[float, ...]) -> list[tuple[float, ...]]:
    """Return the shapes about a chosen one that were passed over."""
    every = _series(effect, grid)
    series = next(own for own in every if _steady(effect, own[0]) == _steady(effect, at))
    step = _apart(series, len(every))
    shapes = np.array(series)
    place = int(np.argmin((np.abs(shapes - at) / np.maximum(np.ptp(shapes, axis=0), 1e-300)).sum(axis=1)))
    return series[max(place - step, 0) : place + step + 1]


def leading(effect: Effect, shapes: int) -> list[int]:
    """Return the columns of an effect that are scanned, those of the widest prior first."""
    spread = effect.spread
    least = 0.0 if shapes <= FEW else LEADING * float(spread.max())
    first = [int(k) for k in np.argsort(-spread, kind="stable") if spread[k] > 0 and spread[k] >= least]
    return first if shapes <= FEW else first[: max(WIDTH, int(np.sum(spread == spread.max())))]
