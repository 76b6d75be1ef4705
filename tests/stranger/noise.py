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
