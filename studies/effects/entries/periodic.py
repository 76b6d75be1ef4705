"""Periodic disturbance: a line at one period, with harmonics."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray

from compensation.arrays import Array
from studies.effects.effect import Coefficient, Effect, Parameter, Shape, Span
from studies.effects.states import States


def columns(states: States, shape: Shape, response: str) -> Array:
    """Σ A_h sin(2πht/P) + B_h cos(2πht/P), h = 1 … 3; t of the campaign or, after a restart, of the run.

    A line that nothing ties to the start of a run, or to runs whose starts are not known, has its own sines and cosines in each.
    """
    period, restarts = shape
    turn = np.exp(2j * np.pi * (states.time if restarts else states.campaign_time) / period)
    waves = np.stack([turn, turn * turn, turn * turn * turn])
    out = np.zeros((6 * (1 + MOST_RUNS), states.time.size))
    place = 1 + states.run if restarts == OWN else 0
    if place <= MOST_RUNS:
        out[6 * place : 6 * (place + 1)] = np.concatenate([waves.imag, waves.real])
    return out.T


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """Periods from hardly more than two steps of the grid to a third of a run, spaced finer than a phase slip of 1/4 turn."""
    slowest, fastest = CYCLES / span.longest_run, 1.0 / (FASTEST * span.step)
    forms: list[tuple[float, ...]] = [(float(1 / f), 1.0) for f in np.arange(slowest, fastest, 0.35 / span.longest_run)]
    own = [(period, OWN) for period, _ in forms] if 1 < span.runs <= MOST_RUNS else []
    if span.runs > 1 and span.timed:
        apart = max(0.4 / span.campaign_length, (fastest - slowest) / MOST)
        forms += [(float(1.0 / f), 0.0) for f in np.arange(slowest, fastest, apart)]
    return forms + own


def strongest(span: Span, times: Sequence[Array], weighed: Sequence[Array]) -> tuple[float, ...]:
    """The period of which most is left over what its neighbours have, of a grid too fine to be weighed whole."""
    periods = np.array([period for period, restarts in grid(span, "") if restarts == 1.0])
    power = sum(np.abs(_turns(periods.tobytes(), t.tobytes()) @ v) ** 2 for t, v in zip(times, weighed, strict=True))
    usual = scipy.ndimage.median_filter(power, BESIDE, mode="nearest")
    best = int(np.argmax(power / np.maximum(usual, np.finfo(float).tiny)))
    return (float(periods[best]), OWN if 1 < span.runs <= MOST_RUNS else 1.0)


@lru_cache(maxsize=16)
def _turns(periods: bytes, times: bytes) -> NDArray[np.complex64]:
    """A line of each period in rows, which a search asks for again and again."""
    turns = np.outer(1.0 / np.frombuffer(periods), np.frombuffer(times))
    return np.asarray(np.exp(2j * np.pi * turns), dtype=np.complex64)


def near(span: Span, response: str, shape: Shape) -> list[tuple[float, ...]]:
    """Periods that one run hardly tells from this one, spaced finer than the lines that runs days apart tell: a tenth of a turn."""
    middle, reach = 1.0 / shape[0], LOBE / span.longest_run
    forms: list[tuple[float, ...]] = []
    lines = [(1.0, span.longest_run), (OWN, span.longest_run), (0.0, span.campaign_length)]
    for restarts, length in lines[: 1 if span.runs == 1 else 3 if span.timed else 2]:
        apart = max(0.1 / length, 2.0 * reach / MOST)
        steps = int(reach / apart)
        forms += [(float(1.0 / f), restarts) for f in middle + apart * np.arange(-steps, steps + 1) if f > 0.0]
    return forms


CYCLES = 3.0  # periods in the longest run that make a line: with fewer, a wandering response looks the same
MOST = 1500
FASTEST = 2.05  # steps of the grid to a period: one of two steps or fewer is folded back to a slower one
LOBE = 0.6  # turns over a run by which two periods may differ and still look alike in it
BESIDE = 41  # periods whose median tells what noise has at the middle one
OWN, MOST_RUNS = 2.0, 12
HARMONICS = (1.0, 0.3, 0.1)


EFFECT = Effect(
    name="periodic",
    dated=True,
    summary="a disturbance of one period: an air conditioner, a table, a beat of two clocks",
    source="harmonic regression",
    isolate="change the period of the chamber's control, or let the table turn at a known rate",
    sensor="the chamber's air temperature, or the table's angle",
    coefficients=(
        Coefficient("sine_{unit}", HARMONICS),
        Coefficient("cosine_{unit}", HARMONICS),
        Coefficient("own_{unit}", 2 * MOST_RUNS * HARMONICS),
    ),
    columns=columns,
    grid=grid,
    near=near,
    strongest=strongest,
    sizes={"bias_deg_per_h": 10.0, "frequency_Hz": 5e-5, "inverse_q": 0.3},
    alike=True,
    shape=(
        Parameter("period_s", 1.0, 1e7, "period", of_run=1.0 / CYCLES),
        Parameter(
            "restarts_each_run", 0.0, OWN, "1 when each run starts with the same phase, 2 with its own", False, True
        ),
    ),
    by_clock=True,
)
