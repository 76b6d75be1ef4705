"""Transients of a network with radiation, or with capacities that depend on temperature."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike

from thermal.errors import ThermalError
from thermal.network import Array, Network
from thermal.profile import Profile
from thermal.steady import boundary_forcing, find_corners, initial_state
from thermal.sweeping import SweepError, sweep
from thermal.transient import Transient, propagate

MOST_RESTARTS = 200  # with more corners in its profiles than this, the integrator restarts at jumps only


def simulate(network: Network, boundaries: Mapping[str, Profile], initial: ArrayLike | None = None) -> Transient:
    """Propagate exactly where the network is linear, else sweep; integrate where radiation is too strong for it."""
    if network.is_linear:
        return propagate(network, boundaries, initial)
    try:
        return sweep(network, boundaries, initial)
    except SweepError:
        return integrate(network, boundaries, initial)


def step_remaining(network: Network, before: float, after: float, weights: Array, time: ArrayLike) -> Array:
    """Share of a step of all boundaries from `before` to `after` (K) that a mean over nodes lacks, `time` (s) after it."""
    time = np.asarray(time, dtype=float)
    profile = Profile(np.array([0.0, 0.0, time.max()]), np.array([before, after, after]))
    transient = simulate(network, {boundary.name: profile for boundary in network.boundaries})
    return np.asarray((transient.observe(time, weights[None, :])[:, 0] - after) / (before - after))


def integrate(
    network: Network,
    boundaries: Mapping[str, Profile],
    initial: ArrayLike | None = None,
    relative_tolerance: float = 1e-8,
) -> Transient:
    """Integrate a network with radiation and C(T): Radau IIA of order 5, exact Jacobian, restarted at corners of the profiles."""
    knots = find_corners(network, boundaries)
    jumps = np.concatenate([boundaries[b.name].jumps for b in network.boundaries])
    restarts = knots
    if len(knots) > MOST_RESTARTS:
        restarts = np.unique(np.concatenate([knots[[0, -1]], jumps]))
    longest = float(np.diff(knots).max())
    n = network.count
    T = initial_state(network, boundaries, initial)
    times, pieces = [knots[:1]], []  # type: list[Array], list[Any]
    for start, end in pairwise(restarts):
        inside = float(np.nextafter(end, start))  # the last moment before a jump at `end`

        def held(time: float, last: float = inside) -> Array:
            return np.asarray(boundary_forcing(network, boundaries, np.array([min(time, last)]))[0][0])

        def rate(time: float, T: Array, last: float = inside) -> Array:
            outflow = network.outflow(np.concatenate([T, held(time, last)]))[:n]
            return np.asarray((network.power(min(time, last)) - outflow) / network.capacities(T))

        def jacobian(time: float, T: Array, last: float = inside) -> Array:
            slope = network.outflow_slope(np.concatenate([T, held(time, last)]))[:n, :n]
            return np.asarray(-slope / network.capacities(T)[:, None])

        solution = scipy.integrate.solve_ivp(
            rate, (start, end), T, method="Radau", jac=jacobian, dense_output=True, rtol=relative_tolerance,
            atol=1e-3 * relative_tolerance, max_step=longest,
        )  # fmt: skip
        if not solution.success:
            raise ThermalError(f"the integration stopped at {solution.t[-1]:g} s: {solution.message}")
        T = solution.y[:, -1]
        dense: Any = solution.sol
        times.append(dense.ts[1:])
        pieces.extend(dense.interpolants)
    whole = scipy.integrate.OdeSolution(np.concatenate(times), pieces)

    def evaluate(time: Array) -> Array:
        return np.asarray(whole(time).T)

    return Transient(tuple(node.name for node in network.nodes), np.concatenate(times), evaluate)
