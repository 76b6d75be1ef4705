"""Bias of the gyro as a function of its own frequency and of its rate of change, HRG paper eqs. (19)–(22).

B = B₀ + k₁ f + k₂ f² + k₃ f³ + k₄ ḟ + k₅ ḟ² + k₆ ḟ³ + k₇ f ḟ + k₈ f² ḟ + k₉ f ḟ², f the *change* of frequency (Hz),
ḟ its rate (Hz/s), B in the unit of the bias column. Without a frequency f is the change of a temperature (°C) behind a
lag, and the `play` d = p − T of a backlash p (`compensation.memory`) brings d, f d and d²: a parabola of p has all three.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy
from numpy.typing import ArrayLike

from compensation.arrays import Array
from compensation.constants import NINETY, zero_Celsius
from compensation.decimation import Blocks, average_blocks
from compensation.derivative import SmoothDerivative, differentiate
from compensation.errors import CompensationError
from compensation.memory import NO_MEMORY, Memory, follow_lag, follow_play
from compensation.noise_regression import coloured_covariance, fit_coloured
from compensation.regression import fit_linear
from compensation.stepwise import StepwiseSelection

# Powers of f and ḟ in the terms of HRG paper eq. (21), in its order k₁ … k₉.
TERMS: dict[str, tuple[int, int]] = {
    "f": (1, 0), "f^2": (2, 0), "f^3": (3, 0), "fdot": (0, 1), "fdot^2": (0, 2), "fdot^3": (0, 3),
    "f*fdot": (1, 1), "f^2*fdot": (2, 1), "f*fdot^2": (1, 2),
}  # fmt: skip
# The same with the play's.
POWERS = {name: (a, b, 0) for name, (a, b) in TERMS.items()} | {
    "play": (0, 0, 1),
    "f*play": (1, 0, 1),
    "play^2": (0, 0, 2),
}
PARENTS = {
    name: [other for other, q in POWERS.items() if sum(p) - sum(q) == 1 and all(np.subtract(p, q) >= 0)]
    for name, p in POWERS.items()
}
MEMORY = ("lag", "play")
BLOCK = 10.0  # s over which a frequency or temperature is averaged before a lag is put behind it
SELECTED_BY_THE_PAPER = ("f", "f^2", "f^3", "fdot", "fdot^2", "f*fdot")


@dataclass(frozen=True)
class Variable:
    """What the bias is a function of: `name` in a sentence, unit, symbol, and the least value that it can have."""

    name: str
    unit: str
    symbol: str
    above: float


FREQUENCY = Variable("frequency", "Hz", "f", 0.0)
TEMPERATURE = Variable("temperature", "°C", "T", -zero_Celsius)


@dataclass(frozen=True)
class AveragedRun:
    """One run averaged over the `blocks` of a fit, and its state over the `fine` ones that a compensation has."""

    blocks: Blocks
    fine: Blocks
    variable: Variable
    _rated: dict[tuple[float, float, bool], tuple[Array, SmoothDerivative]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def behind(self, lag: float) -> Array:
        """Return the state behind a lag (s), which begins settled, averaged over the blocks: (1/w) ∫ x dt of straight lines."""
        name, blocks, time = self.variable.name, self.blocks, self.fine.time
        if not lag:
            return blocks.columns[name]
        state = follow_lag(self.fine.columns[name], np.diff(time), lag)
        if time.size == blocks.time.size:
            return state
        area = scipy.integrate.cumulative_trapezoid(state - state[0], time, initial=0)
        half = 0.5 * blocks.width
        ends = [np.clip(blocks.time + side, time[0], time[-1]) for side in (-half, half)]
        first, last = (np.interp(end, time, area) for end in ends)
        return np.asarray(state[0] + (last - first) / (ends[1] - ends[0]))

    def rated(self, lag: float, window: float, causal: bool) -> tuple[Array, SmoothDerivative]:
        """Return the state behind a lag with its rate over a window (s); each once, since a search among plays asks for the same."""
        if (key := (lag, window, causal)) not in self._rated:
            f = self.behind(lag)
            self._rated[key] = f, differentiate(self.blocks.time, f, window, causal=causal)
        return self._rated[key]


@dataclass(frozen=True)
class BiasRun:
    """One run, decimated to blocks (b,) of a `width` (s): `state` (Hz or °C, behind `memory`), its `rate` over a `window`, late by `lag` (s)."""

    time: Array
    state: Array
    rate: Array
    play: Array
    bias: Array
    width: float
    window: float
    lag: float
    missing: int
    spikes: int
    variable: Variable = FREQUENCY
    memory: Memory = field(default=NO_MEMORY)

    def part(self, rows: slice) -> BiasRun:
        """Return some consecutive rows as a run of its own."""
        cut = {name: getattr(self, name)[rows] for name in ("time", "state", "rate", "play", "bias")}
        return replace(self, **cut)


@dataclass(frozen=True)
class BiasFit:
    """A bias model fitted to runs: coefficients of ("constant", *terms), their covariance with autocorrelation,
    `naive_errors` without.

    `theta` of the noise: 1 white, 0 random walk; `held_out`: sd of each model on the path of the selection, constant alone first.
    """

    reference: float
    terms: tuple[str, ...]
    coefficients: Array
    covariance: Array
    naive_errors: Array
    theta: float
    selection: StepwiseSelection | None
    held_out: tuple[float, ...]
    state_range: tuple[float, float]
    rate_range: tuple[float, float]
    variable: Variable
    memory: Memory
    memory_errors: Memory = NO_MEMORY  # standard deviations of lag and play

    @property
    def standard_errors(self) -> Array:
        """Standard errors of ("constant", *terms) that respect the autocorrelation."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def memory_intervals(self) -> dict[str, tuple[float, float, float]]:
        """Value and ends of the 90 % interval of lag and play, whichever the records determine."""
        found = ((name, getattr(self.memory, name), getattr(self.memory_errors, name)) for name in MEMORY)
        return {name: (value, max(value - NINETY * sd, 0.0), value + NINETY * sd) for name, value, sd in found if sd}

    def predict(self, state: ArrayLike, rate: ArrayLike, play: ArrayLike = 0.0) -> Array:
        """Return the bias that the model expects at a frequency (Hz) or temperature (°C), its rate (1/s) and play."""
        columns = term_columns(state, rate, self.reference, self.terms, play)
        return np.asarray(self.coefficients[0] + columns @ self.coefficients[1:])

    def left(self, run: BiasRun) -> Array:
        """Return what the model leaves of a run's bias (b,)."""
        return np.asarray(run.bias - self.predict(run.state, run.rate, run.play))


def prepare_run(
    time: ArrayLike, state: ArrayLike, bias: ArrayLike, width: float = 100.0, window: float = 300.0, *,
    causal: bool = False, variable: Variable = FREQUENCY, memory: Memory = NO_MEMORY,
) -> BiasRun:  # fmt: skip
    """Decimate one run to blocks of a width (s), and add the rate over a window (s), `causal` (lag window/2) or not, behind `memory`."""
    run = average_run(time, state, bias, width, variable)
    return rate_run(run, window, causal=causal, memory=memory)


def average_run(time: ArrayLike, state: ArrayLike, bias: ArrayLike, width: float, variable: Variable) -> AveragedRun:
    """Return one run averaged over blocks of `width` (s), the part of `prepare_run` that no memory changes."""
    t = np.asarray(time, dtype=np.float64)
    if np.any(np.asarray(state, dtype=np.float64) <= variable.above):
        raise CompensationError(f"a {variable.name} must be above {variable.above:g} {variable.unit}; check its unit.")
    _check_seconds("averaging", width)
    step = float(np.median(np.diff(t))) if t.size > 1 else width
    width = max(width, step)
    columns = {variable.name: state, "bias": bias}
    blocks, fine = (average_blocks(t, columns, one) for one in (width, min(max(BLOCK, step), width)))
    rows = blocks.time.size
    if rows < 3:
        raise CompensationError(f"averaging over {width:g} s leaves {rows} rows, but at least three are needed; record longer or average less.")  # fmt: skip
    if np.ptp(blocks.columns["bias"]) <= 1e-13 * np.max(np.abs(blocks.columns["bias"])):
        raise CompensationError(f"the bias is constant ({blocks.columns['bias'][0]:g}): there is nothing to fit; check the column.")  # fmt: skip
    return AveragedRun(blocks, fine, variable)


def rate_run(run: AveragedRun, window: float, *, causal: bool, memory: Memory, start: float = 0.0) -> BiasRun:
    """Return an averaged run with its state f behind the lag of a memory, play from `start`, and the rate over `window` (s)."""
    _check_seconds("window of the rate", window)
    blocks = run.blocks
    window = max(window, 3 * blocks.width, 2.05 * float(np.median(np.diff(blocks.time))))  # three rows, in bursts too
    f, derivative = run.rated(memory.lag, window, causal)
    play = follow_play(f, memory.play, start) - f
    ok = derivative.complete
    if np.count_nonzero(ok) < 3:
        raise CompensationError(f"no stretch of the run fills the window of {window:g} s over which the rate is taken; shorten the window or record longer.")  # fmt: skip
    return BiasRun(
        time=blocks.time[ok], state=f[ok], rate=derivative.slope[ok], play=play[ok],
        bias=blocks.columns["bias"][ok], width=blocks.width, window=window, lag=derivative.lag,
        missing=blocks.missing, spikes=blocks.spikes, variable=run.variable, memory=memory,
    )  # fmt: skip


def _check_seconds(name: str, seconds: float) -> None:
    if not (np.isfinite(seconds) and seconds > 0):
        raise CompensationError(f"the {name} must be a positive number of seconds, not {seconds:g}.")


def term_columns(
    state: ArrayLike, rate: ArrayLike, reference: float, terms: Sequence[str], play: ArrayLike = 0.0
) -> Array:
    """Return one column per term of HRG paper eq. (21), or of the play, shape (m, len(terms))."""
    f = np.asarray(state, dtype=np.float64) - reference
    rate, play = np.asarray(rate, dtype=np.float64), np.asarray(play, dtype=np.float64)
    columns = [f**a * rate**b * play**c for a, b, c in map(POWERS.__getitem__, terms)]
    return np.column_stack(columns) if columns else np.empty((f.size, 0))


class BiasDesign:
    """Several runs below each other: constants (m, runs), candidates (m, names) of eq. (21) and the play, bias (m,), rows per run."""

    def __init__(self, runs: Sequence[BiasRun], reference: float) -> None:
        sizes = [run.time.size for run in runs]
        ends = np.cumsum(sizes)
        self.reference = reference
        self.rows = [slice(end - size, end) for end, size in zip(ends, sizes, strict=True)]
        self.variable, self.memory = runs[0].variable, runs[0].memory
        self.names = tuple(POWERS if self.memory.play else TERMS)
        self.state = np.concatenate([run.state for run in runs])
        self.rate = np.concatenate([run.rate for run in runs])
        self.bias = np.concatenate([run.bias for run in runs])
        self.constants = np.zeros((self.bias.size, len(runs)))
        for k, rows in enumerate(self.rows):
            self.constants[rows, k] = 1.0
        if np.ptp(self.state) <= 1e-12 * np.max(np.abs(self.state)):
            raise CompensationError(
                f"the {self.variable.name} is constant ({self.state[0]:g} {self.variable.unit}): there is nothing to fit; record a run in which the temperature changes."
            )
        if self.bias.size <= len(runs) + len(self.names):
            raise CompensationError(
                f"{len(self.names)} candidate terms and {len(runs)} constants need more than {len(runs) + len(self.names)}"
                f" averages, not {self.bias.size}; record longer or average over less than {runs[0].width:g} s."
            )
        play = np.concatenate([run.play for run in runs])
        self.candidates = term_columns(self.state, self.rate, reference, self.names, play)

    def columns(self, terms: Sequence[str]) -> Array:
        """Return the constants of the runs and the columns of the terms, (m, runs + terms)."""
        return np.column_stack([self.constants, self.candidates[:, [self.names.index(name) for name in terms]]])


def fit_terms(
    design: BiasDesign, terms: tuple[str, ...], theta: float | None = None,
    selection: StepwiseSelection | None = None, scores: tuple[float, ...] = (), beside: Mapping[str, Array] | None = None,
) -> BiasFit:  # fmt: skip
    """Fit the given terms by least squares, with errors for independent and for correlated rows, of noise `theta` or as estimated.

    `beside`: slopes (m,) of the bias over lag and play, whichever there are; the errors then are those beside a free memory.
    """
    X = design.columns(terms)
    count = design.constants.shape[1]
    names = [*(f"constant of run {k + 1}" for k in range(count)), *terms]
    fit = fit_linear(X, design.bias, names, constant=False)
    free = beside or {}
    every = np.column_stack([X, *free.values()])
    wide = fit_linear(every, design.bias, [*names, *free], constant=False) if free else fit
    noise = fit_coloured(wide.design, design.bias, wide.names, design.rows, theta)
    errors = np.sqrt(np.diag(noise.regression.covariance))[len(names) :]
    coloured = coloured_covariance(wide, noise, design.rows)[: len(names), : len(names)]
    # B₀ is the mean of the runs' constants.
    M = np.zeros((1 + len(terms), len(names)))
    M[0, :count] = 1.0 / count
    M[1:, count:] = np.eye(len(terms))
    return BiasFit(
        reference=design.reference,
        terms=terms,
        coefficients=M @ fit.coefficients,
        covariance=M @ coloured @ M.T,
        naive_errors=np.sqrt(np.diag(M @ fit.covariance @ M.T)),
        theta=noise.theta,
        selection=selection,
        held_out=scores,
        state_range=(float(design.state.min()), float(design.state.max())),
        rate_range=(float(design.rate.min()), float(design.rate.max())),
        variable=design.variable,
        memory=design.memory,
        memory_errors=Memory(**dict(zip(free, errors.tolist(), strict=True))),
    )
