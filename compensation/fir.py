"""Low-pass FIR filter of an even output, as a gyro's firmware computes it."""

import numpy as np
from numpy.typing import ArrayLike

from compensation.arrays import Array
from compensation.errors import CompensationError


def design_smoother(sampling: float, cutoff: float, order: int = 50) -> Array:
    """Return the taps of a low-pass FIR filter (Hamming window) with unit gain at rest and half of it at the `cutoff` (Hz)."""
    from scipy.signal import firwin

    if order < 1 or sampling <= 0:
        raise CompensationError("a FIR filter needs an order of 1 or more and a positive sampling step.")
    if not 0 < cutoff < 0.5 / sampling:
        raise CompensationError(
            f"a cut-off of {cutoff:g} Hz is impossible at an output every {sampling:g} s: it must lie below {0.5 / sampling:g} Hz."
        )
    return np.asarray(firwin(order + 1, cutoff, fs=1 / sampling), dtype=float)


def smooth(values: ArrayLike, taps: Array) -> Array:
    """Return the causal FIR output, settled on the first value at the start, as firmware computes it."""
    x = np.asarray(values, dtype=float)
    if not len(taps):
        return x
    return np.convolve(np.r_[np.full(len(taps) - 1, x[0]), x], taps, mode="valid")
