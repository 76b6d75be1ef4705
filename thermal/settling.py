"""Remaining share of a chamber step after a time, and the conductance that explains an observed settling."""

from collections.abc import Callable

import numpy as np
import scipy
from numpy.typing import ArrayLike

from thermal.errors import ThermalError
from thermal.network import Array, Network
from thermal.profile import Profile
from thermal.radiative import simulate

DECADES = (-6.0, 3.0)  # search range of a conductance, log10 of W/K


def step_remaining(network: Network, before: float, after: float, weights: Array, time: ArrayLike) -> Array:
    """Share of a step of all boundaries from `before` to `after` (K) that a mean over nodes lacks, `time` (s) after it."""
    time = np.asarray(time, dtype=float)
    profile = Profile(np.array([0.0, 0.0, time.max()]), np.array([before, after, after]))
    transient = simulate(network, {boundary.name: profile for boundary in network.boundaries})
    left: Array = (transient.observe(time, weights[None, :])[:, 0] - after) / (before - after)
    return left


def identify_conductance(remaining: Callable[[float], float], observed: float) -> float:
    """Find the conductance (W/K) with which `remaining(conductance)`, a share of a step, is the observed one."""

    def excess(decade: float) -> float:
        return float(remaining(10**decade)) - observed

    low, high = excess(DECADES[0]), excess(DECADES[1])
    if low * high > 0:
        raise ThermalError(
            f"no conductance leaves {observed:.3g} of the step at that time; "
            f"the rest of the network alone leaves {high + observed:.3g}."
        )
    return float(10 ** scipy.optimize.brentq(excess, *DECADES, xtol=1e-12, rtol=1e-12))
