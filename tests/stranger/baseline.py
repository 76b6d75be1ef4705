"""The generic baseline of the contract, refitted, and what it leaves: the definition of SNR.

frequency: c₀ + c₁ θ + c₂ θ², θ = the reading of the housing behind one free lag, its start free in every run;
bias: a cubic in the change of frequency and an offset per run; 1/Q: a quadratic in θ.
Rows are a thinned set of the record's own rows.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares

from tests.stranger.network import lag

COLUMN = {"frequency": "frequency_Hz", "bias": "bias_deg_per_h", "inverse_q": "inverse_q"}


@dataclass
class Rows:
    """Thinned rows of all runs: their times, the uniform grid and all rows of each run."""

    time: list[np.ndarray]
    grid: list[np.ndarray]
    record: list[np.ndarray]

    def recorded(self, values: list[np.ndarray]) -> list[np.ndarray]:
        """What the record's rows keep of a quantity on the grid: linear between them."""
        both = zip(self.record, self.grid, values, strict=True)
        return [np.interp(g, t, np.interp(t, g, v)) for t, g, v in both]

    def at(self, values: list[np.ndarray]) -> np.ndarray:
        """Take quantities on the grid to the rows, all runs in one array."""
        return np.concatenate([np.interp(t, g, v) for t, g, v in zip(self.time, self.grid, values, strict=True)])

    @property
    def run(self) -> np.ndarray:
        return np.repeat(np.arange(len(self.time)), [len(t) for t in self.time])


@dataclass
class Fitted:
    """A fitted baseline of one response: what it leaves, and its derivatives with respect to all that is free.

    Columns: frequency c₂, c₁, c₀, log of the lag, start of each run; bias k₃, k₂, k₁, offset of each run; 1/Q three powers.
    """

    residual: np.ndarray
    columns: np.ndarray

    @cached_property
    def absorbs(self) -> np.ndarray:
        """Return an orthonormal basis of all that it can absorb."""
        return orthonormal(self.columns)

    def project(self, values: np.ndarray) -> np.ndarray:
        return values - self.absorbs @ (self.absorbs.T @ values)


def orthonormal(columns: np.ndarray) -> np.ndarray:
    u, s, _ = np.linalg.svd(columns / (np.linalg.norm(columns, axis=0) + 1e-300), full_matrices=False)
    return u[:, s > 1e-10 * s[0]]


def fit_frequency(
    rows: Rows, reading: list[np.ndarray], frequency: np.ndarray, tau: float
) -> tuple[Fitted, np.ndarray]:
    """Fit lag and starts by variable projection; return the fit and θ at the rows."""
    count = len(reading)
    middle = float(np.mean([r.mean() for r in reading]))

    def theta(p: np.ndarray) -> np.ndarray:
        lagged = [lag(r, float(np.exp(p[0])), r[0] + p[1 + i]) for i, r in enumerate(reading)]
        return (rows.at(lagged) - middle) / 30

    def powers(p: np.ndarray) -> np.ndarray:
        return np.vander(theta(p), 3)

    scale = float(np.std(frequency))

    def left(p: np.ndarray) -> np.ndarray:
        a = powers(p)
        return (frequency - a @ np.linalg.lstsq(a, frequency, rcond=None)[0]) / scale * 1e3

    box = ([np.log(60)] + [-30] * count, [np.log(4e4)] + [30] * count)
    best = least_squares(
        left,
        np.r_[np.log(tau), np.zeros(count)],
        bounds=box,
        x_scale="jac",
        xtol=1e-12,
        ftol=1e-12,
        gtol=1e-12,
        max_nfev=40,
    )
    a = powers(best.x)
    c = np.linalg.lstsq(a, frequency, rcond=None)[0]
    step = np.r_[1e-3, np.full(count, 1e-2)]
    moved = [
        (powers(best.x + s * e) - powers(best.x - s * e)) @ c for s, e in zip(step, np.eye(count + 1), strict=True)
    ]
    return Fitted(frequency - a @ c, np.column_stack([a, *moved])), theta(best.x)


def fit_linear(columns: np.ndarray, values: np.ndarray) -> Fitted:
    basis = orthonormal(columns)
    return Fitted(values - basis @ (basis.T @ values), columns)


def fit_all(rows: Rows, reading: list[np.ndarray], clean: dict[str, np.ndarray], tau: float) -> dict[str, Fitted]:
    """Fit every response present in `clean` (values at the rows, without noise)."""
    fits = {}
    fits["frequency"], theta = fit_frequency(rows, reading, clean["frequency"], tau)
    if "bias" in clean:
        x = clean["frequency"] - clean["frequency"].mean()
        offsets = (rows.run[:, None] == np.arange(len(rows.time))).astype(float)
        fits["bias"] = fit_linear(np.column_stack([np.vander(x / np.std(x), 4)[:, :3], offsets]), clean["bias"])
    if "inverse_q" in clean:
        fits["inverse_q"] = fit_linear(np.vander(theta, 3), clean["inverse_q"])
    return fits


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
