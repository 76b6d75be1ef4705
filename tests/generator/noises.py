"""Noise of five families, unit rms of the white part per row."""

import numpy as np

FAMILIES = ("white", "walk", "flicker", "correlated", "outliers")
TAUS = tuple(30.0 * 4.0 ** np.arange(7))
"""Correlation times of the flicker noise, s."""


def draw_level(family, rng):
    """How strong the coloured part is, over the white part: one number for a gyro."""
    low, high = {"walk": (0.2, 2.0), "flicker": (0.05, 0.3), "correlated": (0.1, 0.5)}.get(family, (1.0, 1.0))
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def draw(family, time, level, rng):
    """Noise of one run in units of its white part."""
    n = time.size
    white = rng.standard_normal(n)
    dt = np.diff(time, prepend=time[0])
    hours = (time[-1] - time[0]) / 3600.0
    if family == "white":
        return white
    if family == "walk":
        return white + level * np.cumsum(rng.standard_normal(n) * np.sqrt(dt / 3600.0 / hours))
    if family == "flicker":
        out = white
        for tau in TAUS:
            out = out + level * _ou(dt, tau, rng)
        return out
    if family == "correlated":
        return white + level * _ou(dt, 1500.0, rng)
    spikes = rng.random(n) < 0.004
    return white + spikes * rng.standard_normal(n) * 25.0


def _ou(dt, tau, rng):
    """Ornstein-Uhlenbeck of unit rms on uneven steps, started in its stationary state."""
    kicks = rng.standard_normal(dt.size)
    decay = np.exp(-dt / tau)
    out = np.empty(dt.size)
    state = kicks[0]
    spread = np.sqrt(1.0 - decay**2)
    for k in range(dt.size):
        state = decay[k] * state + spread[k] * kicks[k] if k else kicks[0]
        out[k] = state
    return out
