"""Transients of a network with radiation, or with capacities that depend on temperature."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import OdeSolution, solve_ivp

from thermal.errors import ThermalError
from thermal.forcing import MOST_ROWS, boundary_forcing, find_corners, initial_state, source_powers
from thermal.network import Array, Network, Source, linearise
from thermal.profile import Profile
from thermal.transient import Transient, propagate

MOST_SWEEPS = 60
SWEEP_TOLERANCE = 1e-7  # K
LONGEST_ROW = 60.0  # s, between which what radiation adds is a parabola
MOST_RESTARTS = 200  # with more corners in its profiles than this, the integrator restarts at jumps only


def simulate(network: Network, boundaries: Mapping[str, Profile], initial: ArrayLike | None = None) -> Transient:
    """Propagate exactly where the network is linear, else sweep measured profiles and integrate those of few corners."""
    if network.is_linear:
        return propagate(network, boundaries, initial)
    jumps = any(profile.jumps.size for profile in boundaries.values())
    if len(find_corners(network, boundaries)) > MOST_RESTARTS and not jumps:
        return sweep(network, boundaries, initial)
    return integrate(network, boundaries, initial)


def integrate(
    network: Network,
    boundaries: Mapping[str, Profile],
    initial: ArrayLike | None = None,
    relative_tolerance: float = 1e-8,
) -> Transient:
    """Integrate a network with radiation and capacities that depend on temperature.

    Implicit Runge-Kutta of order 5 (Radau IIA) with the exact Jacobian, restarted at the corners of the profiles.

    Parameters
    ----------
    network, boundaries, initial : as for `propagate`
    relative_tolerance : float
        Error of one step over the temperature (K).
    """
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
            row: Array = boundary_forcing(network, boundaries, np.array([min(time, last)]))[0][0]
            return row

        def rate(time: float, T: Array, last: float = inside) -> Array:
            outflow = network.outflow(np.concatenate([T, held(time, last)]))[:n]
            flow: Array = (network.power(min(time, last)) - outflow) / network.capacities(T)
            return flow

        def jacobian(time: float, T: Array, last: float = inside) -> Array:
            slope = network.outflow_slope(np.concatenate([T, held(time, last)]))[:n, :n]
            matrix: Array = -slope / network.capacities(T)[:, None]
            return matrix

        solution = solve_ivp(
            rate,
            (start, end),
            T,
            method="Radau",
            jac=jacobian,
            dense_output=True,
            rtol=relative_tolerance,
            atol=1e-3 * relative_tolerance,
            max_step=longest,
        )
        if not solution.success:
            raise ThermalError(f"the integration stopped at {solution.t[-1]:g} s: {solution.message}")
        T = solution.y[:, -1]
        dense: Any = solution.sol
        times.append(dense.ts[1:])
        pieces.extend(dense.interpolants)
    whole = OdeSolution(np.concatenate(times), pieces)

    def evaluate(time: Array) -> Array:
        temperature: Array = np.asarray(whole(time)).T
        return temperature

    return Transient(tuple(node.name for node in network.nodes), np.concatenate(times), evaluate)


def sweep(network: Network, boundaries: Mapping[str, Profile], initial: ArrayLike | None = None) -> Transient:
    """Follow profiles of many rows through a network with radiation, by waveform relaxation.

    What departs from the linearised network, (q − L T − σ R T⁴) C₀/C(T) minus its linear part, is taken from the
    last sweep as a power that is linear between the rows, with its mean between them by Simpson's rule, and the
    linear network is propagated exactly; each sweep contracts the error by about the relative change of T³. The
    error is of fourth order in the distance of the rows, at most 60 s: this is for profiles of many rows, such as
    measured ones, while `integrate` keeps a tolerance with few corners.
    """
    knots = _subdivide(find_corners(network, boundaries))
    if any(profile.jumps.size for profile in boundaries.values()):
        raise ThermalError("a profile with jumps is integrated, not swept; a measured one has no jumps.")
    half_rows = np.insert(knots, slice(1, None), (knots[1:] + knots[:-1]) / 2)
    held, _ = boundary_forcing(network, boundaries, half_rows)
    T0 = initial_state(network, boundaries, initial)
    n, linear = network.count, linearise(network, float(held.mean()))
    capacity = linear.capacities(T0)[:, None]
    q = source_powers(network, half_rows, 0).T
    transient = propagate(linear, boundaries, T0)
    T = transient.at(half_rows).T
    for _ in range(MOST_SWEEPS):
        everything = np.vstack([T, held.T])
        flow = capacity / network.capacities(T) * (q - network.outflow(everything)[:n])
        beyond = flow - (q - linear.outflow(everything)[:n])
        extra = tuple(
            Source(node.name, _with_simpson_mean(knots, row)) for node, row in zip(network.nodes, beyond, strict=True)
        )
        transient = propagate(replace(linear, sources=linear.sources + extra), boundaries, T0)
        last, T = T, transient.at(half_rows).T
        if np.abs(T - last).max() < SWEEP_TOLERANCE:
            return transient
    raise ThermalError("the radiation is too strong to be swept; integrate the network instead.")


def _subdivide(knots: Array) -> Array:
    """Divide long rows evenly until none is longer than `LONGEST_ROW`."""
    parts = np.ceil(np.diff(knots) / LONGEST_ROW)
    if parts.sum() > MOST_ROWS:
        raise ThermalError(f"the profile is too long to be swept ({knots[-1] - knots[0]:.3g} s); shorten it.")
    counts = parts.astype(np.intp)
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    finer: Array = np.repeat(knots[:-1], counts) + within * np.repeat(np.diff(knots) / counts, counts)
    return np.append(finer, knots[-1])


def _with_simpson_mean(knots: Array, values: Array) -> Profile:
    """Lines between the knots, shifted to the mean of the values at knots and midpoints, (a + 4 m + b)/6."""
    start, middle, end = values[:-1:2], values[1::2], values[2::2]
    shift = (2 * middle - start - end) / 3
    return Profile(np.repeat(knots, 2)[1:-1], np.column_stack([start + shift, end + shift]).ravel())
