"""Smooth curves over a range: cosines whose size falls with their order, so that knees fit and wiggles do not."""

import numpy as np

from studies.effects.states import FloatArray

ORDERS = 12
"""A knee of a tenth of the range is followed, fringes of a sixth of it are not."""


def waves(x: FloatArray, low: float, high: float, orders: int = ORDERS) -> FloatArray:
    """Return cos(k π u), k = 2 … orders, of u = (x − low)/(high − low) held to the range: (N, orders − 1)."""
    u = np.clip((x - low) / max(high - low, 1e-9), 0.0, 1.0)
    return np.asarray(np.cos(np.pi * u[:, None] * np.arange(2, orders + 1)))


def smoothness(size: float, orders: int = ORDERS) -> tuple[float, ...]:
    """Return prior standard deviations of the waves, falling as k⁻²: the curve has a slope, and finite bends."""
    return tuple(float(size * (2.0 / k) ** 2) for k in range(2, orders + 1))
