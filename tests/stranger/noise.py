"""Noise families, of unit rms per sample over the run."""

import numpy as np
from scipy.signal import lfilter

FAMILIES = ("white", "flicker", "random-walk", "ar1", "mixed", "student-t")


def draw_noise(family: str, time: np.ndarray, rng: np.random.Generator, correlation_s: float) -> np.ndarray:
    """Noise at `time` (s). `correlation_s` is the memory of the AR(1); its value there follows exp(−Δt/τ) exactly."""
    n = len(time)
    white = rng.standard_normal(n)
    if family == "white":
        return white
    if family == "student-t":
        return rng.standard_t(4.0, n) / np.sqrt(2.0)
    if family == "ar1":
        step = float(np.median(np.diff(time)))
        keep = np.exp(-step / correlation_s)
        grid = np.round((time - time[0]) / step).astype(int)
        kicks = np.sqrt(1 - keep**2) * rng.standard_normal(grid[-1] + 1)
        path, _ = lfilter([1.0], [1.0, -keep], kicks, zi=[keep * rng.standard_normal()])
        return path[grid]
    if family == "random-walk":  # 0.4: the share of its own rms that a walk keeps about its mean, √(1/6)
        return np.cumsum(white * np.sqrt(np.diff(time, prepend=time[0]))) / np.sqrt(np.ptp(time)) / 0.41
    if family == "flicker":
        spectrum = np.fft.rfft(rng.standard_normal(2 * n))
        spectrum[1:] /= np.sqrt(np.arange(1, len(spectrum)))
        spectrum[0] = 0
        out = np.fft.irfft(spectrum, 2 * n)[:n]
        return out / np.sqrt(np.sum(np.abs(spectrum[1:]) ** 2) * 2) * (2 * n)
    if family == "mixed":
        parts = [draw_noise(name, time, rng, correlation_s) for name in ("white", "flicker", "random-walk")]
        return 0.8 * parts[0] + 0.5 * parts[1] + 0.33 * parts[2]
    raise ValueError(family)


def covariance_of(family: str, time: np.ndarray, cells: np.ndarray, correlation_s: float) -> np.ndarray:
    """Covariance of the means of `draw_noise` over cells, given by the first row of each."""
    n, length = len(time), np.diff(np.r_[cells, len(time)])

    def of_cells(rows_by_cells: np.ndarray) -> np.ndarray:
        return np.add.reduceat(rows_by_cells, cells, axis=0) / length[:, None]

    means = np.zeros((n, len(cells)))
    means[np.arange(n), np.repeat(np.arange(len(cells)), length)] = np.repeat(1.0 / length, length)
    if family in ("white", "student-t"):
        return of_cells(means)
    if family == "ar1":
        keep = float(np.exp(-np.median(np.diff(time)) / correlation_s))
        grid = np.round((time - time[0]) / np.median(np.diff(time))).astype(int)
        return of_cells(_convolved(keep ** np.arange(grid[-1] + 1.0), means, grid))
    if family == "random-walk":  # Σ min(tᵢ, tⱼ) mⱼ: twice the sum from the end, once from the start
        step = np.diff(time, prepend=time[0])[:, None]
        return of_cells(np.cumsum(step * np.cumsum(means[::-1], axis=0)[::-1], axis=0)) / np.ptp(time) / 0.41**2
    if family == "flicker":
        power = np.r_[0.0, 1.0 / np.arange(1, n + 1)]
        own = np.fft.irfft(power, 2 * n)[:n]
        return of_cells(_convolved(own / own[0], means, np.arange(n)))
    if family == "mixed":
        parts = [covariance_of(f, time, cells, correlation_s) for f in ("white", "flicker", "random-walk")]
        return 0.64 * parts[0] + 0.25 * parts[1] + 0.33**2 * parts[2]
    raise ValueError(family)


def _convolved(own: np.ndarray, columns: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Multiply columns at `place` of a uniform grid by the Toeplitz matrix of an autocovariance."""
    n = len(own)
    full = np.zeros((n, columns.shape[1]))
    np.add.at(full, place, columns)  # stamps that jitter may share a place
    kernel = np.fft.rfft(np.r_[own, 0.0, own[:0:-1]])[:, None]
    return np.fft.irfft(kernel * np.fft.rfft(full, 2 * n, axis=0), 2 * n, axis=0)[place]
