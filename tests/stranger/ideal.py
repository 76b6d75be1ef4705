"""What an ideal predictor leaves of rows that were held out: it knows the form of what is hidden and the noise's covariance.

The baseline's values and the size of the effect are to be found, by generalised least squares on the rows of the fit; of a record
that is left out, its own offset, level and initial state are refitted. Of rows that the rest cannot foretell (the error beyond
`KNOWN` noise, or no temperature near) nothing is asked. Nobody who must find form or noise too foretells better, but by chance.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular

from tests.stranger.baseline import COLUMN, Rows, fit_all, orthonormal, rms
from tests.stranger.network import STEP_S
from tests.stranger.noise import covariance_of
from tests.stranger.truth import Truth

CELLS = 150
"""Means of a run's rows that the fit sees."""
BLOCKS = 5
KNOWN = 1.5
NEAR = 0.1
FEWEST = 0.5
"""Part of the rows that must be foretold."""
KNOWN_START = 0.5
UNKNOWN = 10.0
"""Standard deviation of the size of the effect before any row, over its size."""


def ideal_ratios(truth: Truth) -> dict[str, float]:
    """Return the held-out rms over the floor, by column of the records, of responses most of which can be foretold."""
    times = [run["time_s"] for run in truth.clean]
    rows = Rows(times, [np.arange(0.0, t[-1] + STEP_S, STEP_S) for t in times], times)
    reading = [np.interp(g, t, run["reading"]) for g, t, run in zip(rows.grid, times, truth.bare, strict=True)]
    clean = {r: np.concatenate([run[r] for run in truth.bare]) for r in truth.noise_family}
    fits = fit_all(rows, reading, clean, truth.main_s)
    theta = 30.0 * fits["frequency"].columns[:, 1]
    found = {}
    for r in truth.noise_family:
        rest, part = _held_out(_runs_of(truth, r, fits[r].columns, theta), r, truth.main_s)
        if part >= FEWEST:
            found[COLUMN[r]] = rest / truth.own_floor[COLUMN[r]]
    return found


@dataclass
class _Run:
    """A run's rows, the first one of each cell; on rows: columns, the effect the last, noise, temperature; covariance of cells."""

    time: np.ndarray
    cells: np.ndarray
    columns: np.ndarray
    noise: np.ndarray
    warm: np.ndarray
    covariance: np.ndarray

    def means(self, values: np.ndarray) -> np.ndarray:
        return (np.add.reduceat(values, self.cells, axis=0).T / np.diff(np.r_[self.cells, len(self.time)])).T


def _runs_of(truth: Truth, r: str, columns: np.ndarray, theta: np.ndarray) -> list[_Run]:
    columns = columns / (np.linalg.norm(columns, axis=0) + 1e-300)
    hidden = float(any(h.response == r for h in truth.hidden))
    effect = [hidden * (clean[r] - bare[r]) for clean, bare in zip(truth.clean, truth.bare, strict=True)]
    columns = np.column_stack([columns, np.concatenate(effect)])
    out, begin = [], 0
    for clean, noise in zip(truth.clean, truth.noise, strict=True):
        time = clean["time_s"]
        own = slice(begin, begin + len(time))
        begin = own.stop
        cells = np.unique(np.linspace(0, len(time), CELLS + 1).astype(int)[:-1])
        covariance = covariance_of(truth.noise_family[r], time, cells, truth.memory_s)
        out.append(_Run(time, cells, columns[own], noise[r], theta[own], covariance))
    sigma = rms(np.concatenate([run.means(run.noise) for run in out]))
    sigma /= np.sqrt(np.mean(np.concatenate([np.diag(run.covariance) for run in out])))
    return [replace(run, covariance=sigma**2 * run.covariance) for run in out]


def _held_out(runs: list[_Run], r: str, tau: float) -> tuple[float, float]:
    """Return the rms of what is left of the held-out rows that can be foretold, and their part of all."""
    parts, asked = [], 0
    scale = rms(np.concatenate([run.noise for run in runs]))
    for keep, inside in _folds(runs, tau):
        white, y = [], []
        for run, kept in zip(runs, keep, strict=True):
            kept = kept[run.cells]
            if kept.any():
                ridge = 1e-10 * np.trace(run.covariance) / len(kept) * np.eye(len(kept))
                root = np.linalg.cholesky((run.covariance + ridge)[np.ix_(kept, kept)])
                both = np.column_stack([run.means(run.columns), run.means(run.noise)])[kept]
                both = solve_triangular(root, both, lower=True)
                white.append(both[:, :-1])
                y.append(both[:, -1])
        size = np.zeros((len(white[0].T), 1))
        size[-1] = 1.0 / UNKNOWN  # found as 0 where no row shows it, which is an error of 1
        table = np.concatenate([*white, size.T])
        spread = np.linalg.pinv(table.T @ table, rcond=1e-11, hermitian=True)
        error = spread @ table.T @ np.concatenate([*y, [-1.0 / UNKNOWN]])
        known = np.sort(np.concatenate([run.warm[k] for run, k in zip(runs, keep, strict=True)]))
        for i, (run, held) in enumerate(zip(runs, inside, strict=True)):
            own = _own(run, held, r, i, len(runs))
            x = run.columns[held] - own @ (own.T @ run.columns[held])
            rest = run.noise[held] - own @ (own.T @ run.noise[held]) - x @ error
            sd = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", x, spread, x), 0.0))
            near = _near(run.warm[held], known) & (sd <= KNOWN * scale)
            parts.append(rest[near])
            asked += int(near.sum())
    return (rms(np.concatenate(parts)) if asked else np.inf), asked / sum(len(run.time) for run in runs)


def _folds(runs: list[_Run], tau: float) -> Iterator[tuple[list[np.ndarray], list[np.ndarray]]]:
    """Yield which rows of each run the fit sees and which are held out: a record at a time, or blocks of the only one."""
    if len(runs) > 1:
        for out in range(len(runs)):
            held = [np.full(len(run.time), i == out) for i, run in enumerate(runs)]
            yield [~h for h in held], held
        return
    time, length = runs[0].time, np.ptp(runs[0].time)
    for block in range(BLOCKS):
        low, high = time[0] + block * length / BLOCKS, time[0] + (block + 1) * length / BLOCKS
        last = block == BLOCKS - 1
        yield [(time < low - tau) | (time > high + tau)], [(time >= low) & ((time < high) | last)]


def _own(run: _Run, held: np.ndarray, r: str, i: int, count: int) -> np.ndarray:
    """Return an orthonormal basis of what is refitted on rows that are held out."""
    free = [] if count == 1 else [np.ones(int(held.sum()))]
    if r == "frequency":
        start = run.columns[:, 4 + i]
        if np.linalg.norm(start[held]) >= KNOWN_START * np.linalg.norm(start):
            free.append(start[held])
    return orthonormal(np.column_stack(free)) if free and held.any() else np.empty((int(held.sum()), 0))


def _near(warm: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Which temperatures have a known one within a part of the range of both."""
    if not len(known) or not len(warm):
        return np.zeros(len(warm), bool)
    reach = NEAR * (max(known[-1], warm.max()) - min(known[0], warm.min()))
    after = np.clip(np.searchsorted(known, warm), 1, len(known) - 1)
    return np.minimum(abs(warm - known[after - 1]), abs(warm - known[after])) <= reach
