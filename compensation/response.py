r"""Frequency response from an input to an output of any course, swept or random.

    w y = Σ_k H_k w Dᵏ x + noise,   D = (d/dt)/2πj − f₀,   H(f) = Σ_k H_k (f − f₀)ᵏ,   k ≤ 2

w is 1 but for the ends of the record, where it rises from zero: what the output remembers of before counts for nothing. The
transform of w Dᵏ x takes those of w x, w′x and w″x alone, so that a frequency which is swept through where w rises has no other response
there. H_k are least squares over the bins of a narrow band; what they leave is the noise.
"""

import numpy as np

from compensation.arrays import Array, Complex

BINS = 12  # of a band: three for H, nine for the noise
ENDS = 1 / 32  # of the record, over which w rises and falls


def measure_response(x: Array, y: Array, rate: float) -> tuple[Array, Complex, Array, Array]:
    """Return the middles f₀ of bands (Hz), H there, the standard deviation of its real and of its imaginary part, and the mean power of w x."""
    x, y = x - np.mean(x), y - np.mean(y)
    length = ENDS * x.size / rate
    to_end = np.minimum(np.arange(x.size), np.arange(x.size)[::-1]) / rate
    turn = np.pi / length * np.minimum(to_end, length)
    side = np.where(np.arange(x.size) < x.size / 2, 1.0, -1.0)
    bend = np.where(to_end < length, np.cos(turn), 0.0)
    windows = (1 - np.cos(turn)) / 2, side * np.sin(turn) * np.pi / (2 * length), bend * np.pi**2 / (2 * length**2)
    bands = x.size // 2 // BINS
    Y, X, once, twice = (
        np.fft.rfft(one)[1 : 1 + bands * BINS].reshape(bands, BINS)
        for one in (windows[0] * y, *(w * x for w in windows))
    )
    away = (np.arange(BINS) - (BINS - 1) / 2) * rate / x.size
    once, twice = once / 2j / np.pi, twice / (2j * np.pi) ** 2
    design = np.stack([X, away * X - once, away**2 * X - 2 * away * once + twice], axis=2)
    size = np.maximum(np.linalg.norm(design, axis=1, keepdims=True), 1e-300)
    solving = np.linalg.pinv(design / size)
    found = solving @ Y[..., None]
    left = Y - (design / size @ found)[..., 0]
    noise = np.sum(np.abs(left) ** 2, axis=1) / (BINS - design.shape[2])
    error = np.sqrt(noise * np.sum(np.abs(solving[:, 0]) ** 2, axis=1) / 2) / size[:, 0, 0]
    middles = (1 + np.arange(bands) * BINS + (BINS - 1) / 2) * rate / x.size
    return middles, found[:, 0, 0] / size[:, 0, 0], error, np.mean(np.abs(X) ** 2, axis=1)
