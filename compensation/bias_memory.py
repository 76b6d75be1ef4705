"""The lag and the hysteresis through which a temperature acts on the bias, found beside the terms of its model."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import scipy

from compensation.arrays import Array
from compensation.bias import MEMORY, POWERS, BiasDesign, BiasFit, BiasRun, fit_terms
from compensation.bias_selection import cautious_theta, follow_columns, select_guarded
from compensation.errors import CompensationError
from compensation.memory import NO_MEMORY, Memory
from compensation.noise_regression import whiten

LAGS = (20.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0)  # s, of a temperature, from which a search starts
FINE = np.geomspace(20.0, 5000.0, 25)  # s, the same without a play: more terms behind a wrong lag may leave as little
PLAYS = (0.02, 0.05, 0.1, 0.2)  # the same of half-widths over the span of the temperature
REACH, ROUNDS = 2.5, 8  # times by which one search may change a number; searches, each with terms selected anew
# Deviance that each number of a memory must gain: a chance of 0.001 by noise alone (χ² of one degree of freedom).
WORTH = 10.8

Prepare = Callable[[Memory], Sequence[BiasRun]]


def choose_memory(prepare: Prepare) -> Memory:
    """Return the lag and the play behind which the fewest terms leave least, each minimised beside the terms that it selects.

    m ln(SSE/m) + p ln m of whitened rows, and `WORTH` for each number of the memory. Searches start at what leaves least
    without a lag and with one, of loops with a play, which starts in its middle or where an end of the range has left it,
    and at every lag without a play that leaves less than its neighbours.
    """
    plain = prepare(NO_MEMORY)
    reference, rows = float(plain[0].state[0]), sum(run.time.size for run in plain)
    span = float(np.ptp(np.concatenate([run.state for run in plain])))

    def design_of(memory: Memory) -> BiasDesign:
        return BiasDesign(plain if memory == NO_MEMORY else prepare(memory), reference)

    def select(memory: Memory) -> tuple[float, tuple[str, ...]]:
        found = select_guarded(design_of(memory), theta)
        price = WORTH * ((memory.lag > 0) + (memory.play > 0))
        return (found.start, *found.steps)[-1].criterion + price, found.terms

    def refine(memory: Memory, terms: tuple[str, ...]) -> Memory:
        def left(other: Memory) -> float:
            design = design_of(other)
            X, bias = (whiten(part, theta, design.rows) for part in (design.columns(terms), design.bias))
            return float(np.linalg.norm(bias - follow_columns(X, bias)))

        def along(logarithm: float, name: str, others: Memory) -> float:
            return left(_moved(others, name, np.exp(logarithm)))

        for k in range(len(plain) * (memory.play > 0)):
            trials = ((*memory.starts[:k], start, *memory.starts[k + 1 :]) for start in (0.0, -1.0, 1.0))
            memory = min((replace(memory, starts=starts) for starts in trials), key=left)
        for name in MEMORY:
            if value := getattr(memory, name):
                ends = float(np.log(value / REACH)), float(np.log(value * REACH))
                found = scipy.optimize.minimize_scalar(
                    along, bounds=ends, args=(name, memory), method="bounded", options={"xatol": 1e-4}
                )
                memory = _moved(memory, name, np.exp(found.x))
        return memory

    def search(memory: Memory) -> Memory:
        still = tuple(name for name in select(memory)[1] if not POWERS[name][1])  # else rates stand for a lag
        memory = refine(memory, still)
        for _ in range(ROUNDS):
            before, memory = memory, refine(memory, select(memory)[1])
            if np.allclose(
                [memory.lag, memory.play, *memory.starts], [before.lag, before.play, *before.starts], 1e-3, 0.0
            ):
                break
        return memory

    theta = cautious_theta(design_of(NO_MEMORY))
    plays = PLAYS if rows > 2 * (len(plain) + len(POWERS)) else ()
    side = np.sign([run.state[0] - np.mean([one.state.mean() for one in plain]) for run in plain])
    loops = [Memory(0.0, part * span, tuple(side * way)) for part in plays for way in (0.0, -1.0, 1.0)]
    grids = [loops, [replace(one, lag=lag) for one in loops for lag in LAGS]]
    kinds = [NO_MEMORY, *_least([Memory(lag, 0.0) for lag in FINE], lambda one: select(one)[0])]
    kinds += [min(grid, key=lambda one: select(one)[0]) for grid in grids if grid]
    for _ in range(2):  # noise is what the better memory leaves
        kinds = [search(memory) for memory in kinds]
        theta = cautious_theta(design_of(min(kinds, key=lambda one: select(one)[0])))
    return min(kinds, key=lambda one: select(one)[0])


def _least(grid: Sequence[Memory], left: Callable[[Memory], float]) -> list[Memory]:
    """Return the members of a grid that leave less than their neighbours."""
    heights = np.array([np.inf, *map(left, grid), np.inf])
    return [one for k, one in enumerate(grid) if heights[k + 1] < min(heights[k], heights[k + 2])]


def _moved(memory: Memory, name: str, value: float) -> Memory:
    return replace(memory, lag=float(value)) if name == "lag" else replace(memory, play=float(value))


def free_memory(fit: BiasFit, prepare: Prepare) -> BiasFit:
    """Return a fit with the errors that it has beside a lag and a play that are not known exactly."""

    def slope(name: str) -> Array:
        value = getattr(fit.memory, name)
        ends = [prepare(_moved(fit.memory, name, value * part)) for part in (0.99, 1.01)]
        low, high = (np.concatenate([fit.predict(run.state, run.rate, run.play) for run in runs]) for runs in ends)
        return np.asarray((high - low) / (0.02 * value))

    slopes = {name: slope(name) for name in MEMORY if getattr(fit.memory, name)}
    slopes = {name: own for name, own in slopes.items() if own.any()}  # a play without a term of its own has none
    design = BiasDesign(prepare(fit.memory), fit.reference)
    try:
        return (
            fit_terms(design, fit.terms, selection=fit.selection, scores=fit.held_out, beside=slopes) if slopes else fit
        )
    except CompensationError:  # the terms make up what the memory does: its interval has no end
        return fit
