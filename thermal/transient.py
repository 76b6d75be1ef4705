"""Temperatures of a network in time: exact for a linear network, by implicit integration with radiation."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import OdeSolution, solve_ivp
from scipy.signal import lfilter

from thermal.errors import ThermalError
from thermal.network import Array, Network, Source, linearise
from thermal.profile import Profile
from thermal.relaxation import find_relaxation
from thermal.steady import check_boundary_names, find_steady_state

BLOCK = 1 << 16  # rows evaluated at a time; bounds the memory of long outputs
MOST_ROWS = 200_000  # of a profile
MOST_SWEEPS = 60
SWEEP_TOLERANCE = 1e-7  # K
MOST_RESTARTS = 200  # with more corners in its profiles than this, the integrator restarts at jumps only


@dataclass(frozen=True)
class Transient:
    """Temperatures (K) of the nodes as functions of time, from `start` to `end` (s).

    Attributes
    ----------
    nodes : names of the nodes
    knots : array, times (s) between which the temperatures are smooth
    evaluate : callable from an array of times (N,) to the array of temperatures (N, nodes)
    """

    nodes: tuple[str, ...]
    knots: Array
    evaluate: Callable[[Array], Array]

    @property
    def start(self) -> float:
        """First time (s)."""
        return float(self.knots[0])

    @property
    def end(self) -> float:
        """Last time (s)."""
        return float(self.knots[-1])

    def at(self, time: ArrayLike) -> Array:
        """Temperatures (K), shape (N, nodes), at times (N,) in s."""
        return self.observe(time, np.eye(len(self.nodes)))

    def node(self, name: str, time: ArrayLike) -> Array:
        """Temperature (K) of one node at times (N,) in s."""
        if name not in self.nodes:
            raise ThermalError(f"the transient has no node '{name}'; it has {', '.join(self.nodes)}.")
        weights = np.array([[float(node == name) for node in self.nodes]])
        return self.observe(time, weights)[:, 0]

    def observe(self, time: ArrayLike, weights: Array) -> Array:
        """Sums of node temperatures, shape (N, rows of weights), in blocks, so that only the sums are stored.

        Parameters
        ----------
        time : array (N,), s
        weights : array (sums, nodes)
        """
        time = np.asarray(time, dtype=float)
        if time.size and not (time.min() >= self.start and time.max() <= self.end):
            raise ThermalError(f"the transient covers {self.start:g} to {self.end:g} s only.")
        sums = np.empty((time.size, len(weights)))
        for k in range(0, time.size, BLOCK):
            sums[k : k + BLOCK] = self.evaluate(time[k : k + BLOCK]) @ weights.T
        return sums


def propagate(
    network: Network, boundaries: Mapping[str, Profile], initial: ArrayLike | None = None
) -> Transient:
    """Propagate a linear network exactly through piecewise linear boundaries and powers.

    In modal coordinates x = shapesᵀ C T every mode obeys dx/dt = −λ x + u, u linear between the corners of the
    profiles, so that x = u₀/λ − u₁/λ² + (u₁/λ) s + c e^(−λ s) at the time s after a corner.

    Parameters
    ----------
    network : Network
        Without radiation and with constant capacities; see `thermal.network.linearise`.
    boundaries : mapping
        Profile (K) of every boundary; all cover the same time.
    initial : array (nodes,), K, optional
        Temperatures at the start; the steady state before the profiles begin when absent.
    """
    if not network.is_linear:
        raise ThermalError(
            "exact propagation needs constant capacities and no radiation; linearise the network or integrate it."
        )
    knots = _corners(network, boundaries)
    modes = find_relaxation(network, 1.0)  # a linear network has the same modes at every temperature
    rate, shapes = 1 / modes.time_constants, modes.shapes
    value, slope = _forcing(network, boundaries, knots[:-1])
    u0 = (value @ modes.coupling.T + _powers(network, knots[:-1], 0)) @ shapes
    u1 = (slope @ modes.coupling.T + _powers(network, knots[:-1], 1)) @ shapes
    trend = u1 / rate
    level = (u0 - trend) / rate
    length = np.diff(knots)[:, None]
    decay = np.exp(-rate * length)
    particular_end = level + trend * length
    T0 = _initial(network, boundaries, initial)
    state = scan(decay, particular_end - decay * level, (T0 * modes.capacity) @ shapes)
    departure = state[:-1] - level

    def evaluate(time: Array) -> Array:
        k = np.minimum(np.searchsorted(knots, time, side="right") - 1, len(length) - 1)
        s = (time - knots[k])[:, None]
        x = level[k] + trend[k] * s + departure[k] * np.exp(-rate * s)
        temperature: Array = x @ shapes.T
        return temperature

    return Transient(modes.nodes, knots, evaluate)


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
    knots = _corners(network, boundaries)
    jumps = np.concatenate([boundaries[b.name].jumps for b in network.boundaries])
    restarts = knots
    if len(knots) > MOST_RESTARTS:
        restarts = np.unique(np.concatenate([knots[[0, -1]], jumps]))
    longest = float(np.diff(knots).max())
    n = network.count
    T = _initial(network, boundaries, initial)
    times, pieces = [knots[:1]], []  # type: list[Array], list[Any]
    for start, end in pairwise(restarts):
        inside = float(np.nextafter(end, start))  # the last moment before a jump at `end`

        def held(time: float, last: float = inside) -> Array:
            row: Array = _forcing(network, boundaries, np.array([min(time, last)]))[0][0]
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
            rate, (start, end), T, method="Radau", jac=jacobian, dense_output=True,
            rtol=relative_tolerance, atol=1e-3 * relative_tolerance, max_step=longest,
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


def sweep(
    network: Network, boundaries: Mapping[str, Profile], initial: ArrayLike | None = None
) -> Transient:
    """Follow profiles of many rows through a network with radiation, by waveform relaxation.

    What departs from the linearised network, (q − L T − σ R T⁴) C₀/C(T) minus its linear part, is taken from the
    last sweep as a power that is linear between the rows, with its mean between them by Simpson's rule, and the
    linear network is propagated exactly; each sweep contracts the error by about the relative change of T³. The
    error is of fourth order in the distance of the rows: this is for measured profiles, while `integrate` keeps a
    tolerance with profiles of few corners.
    """
    knots = _corners(network, boundaries)
    if any(profile.jumps.size for profile in boundaries.values()):
        raise ThermalError("a profile with jumps is integrated, not swept; a measured one has no jumps.")
    half_rows = np.insert(knots, slice(1, None), (knots[1:] + knots[:-1]) / 2)
    held, _ = _forcing(network, boundaries, half_rows)
    T0 = _initial(network, boundaries, initial)
    n, linear = network.count, linearise(network, float(held.mean()))
    capacity = linear.capacities(T0)[:, None]
    q = _powers(network, half_rows, 0).T
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


def _with_simpson_mean(knots: Array, values: Array) -> Profile:
    """Lines between the knots, shifted to the mean of the values at knots and midpoints, (a + 4 m + b)/6."""
    start, middle, end = values[:-1:2], values[1::2], values[2::2]
    shift = (2 * middle - start - end) / 3
    return Profile(np.repeat(knots, 2)[1:-1], np.column_stack([start + shift, end + shift]).ravel())


def simulate(
    network: Network, boundaries: Mapping[str, Profile], initial: ArrayLike | None = None
) -> Transient:
    """Propagate exactly where the network is linear, else sweep measured profiles and integrate those of few corners."""
    if network.is_linear:
        return propagate(network, boundaries, initial)
    jumps = any(profile.jumps.size for profile in boundaries.values())
    if len(_corners(network, boundaries)) > MOST_RESTARTS and not jumps:
        return sweep(network, boundaries, initial)
    return integrate(network, boundaries, initial)


def lag(time: ArrayLike, temperature: ArrayLike, time_constant: float, initial: float | None = None) -> Array:
    """Follow a temperature, linear between its rows, with one lag: τ dT_r/dt = T − T_r, exactly.

    Parameters
    ----------
    time, temperature : arrays (N,), s and K
    time_constant : float, s
    initial : float, K, optional
        T_r at the first row; the first temperature when absent.

    Returns
    -------
    array (N,), K
    """
    time, temperature = np.asarray(time, dtype=float), np.asarray(temperature, dtype=float)
    if not time_constant > 0:
        raise ThermalError(f"a time constant must be positive, not {time_constant:g} s.")
    length = np.diff(time)
    if not (length > 0).all():
        raise ThermalError("the time of a record must increase from row to row.")
    decay = np.exp(-length / time_constant)
    trend = np.diff(temperature) / length * time_constant  # T_r follows a ramp, this far behind it
    forced = temperature[1:] - trend - decay * (temperature[:-1] - trend)
    start = temperature[0] if initial is None else initial
    return scan(decay[:, None], forced[:, None], np.array([start]))[:, 0]


def scan(decay: Array, forced: Array, start: Array) -> Array:
    """Run x_{k+1} = decay_k x_k + forced_k from `start`; shapes (N, m), (N, m), (m,) give (N + 1, m)."""
    states = np.empty((len(forced) + 1, len(start)))
    states[0] = start
    if len(decay) > 1 and np.ptp(decay, axis=0).max() <= 1e-12:
        for m, factor in enumerate(decay[0]):
            states[1:, m] = lfilter([1.0], [1.0, -factor], forced[:, m], zi=[factor * start[m]])[0]
        return states
    state = start
    for k in range(len(forced)):
        state = decay[k] * state + forced[k]
        states[k + 1] = state
    return states


def _corners(network: Network, boundaries: Mapping[str, Profile]) -> Array:
    check_boundary_names(network, boundaries)
    for node in network.nodes:
        if not callable(node.capacity):
            node.capacity_at(0.0)
    profiles = [*boundaries.values(), *(s.power for s in network.sources if isinstance(s.power, Profile))]
    if len({(profile.start, profile.end) for profile in profiles}) > 1:
        raise ThermalError("the profiles of boundaries and powers must all cover the same time.")
    for name, profile in boundaries.items():
        if not (profile.value > 0).all():
            raise ThermalError(f"the profile of '{name}' reaches 0 K; temperatures here are in kelvin.")
    knots = np.unique(np.concatenate([profile.time for profile in profiles]))
    if len(knots) > MOST_ROWS:
        raise ThermalError(f"the profile has {len(knots)} rows; average it to at most {MOST_ROWS} rows.")
    return knots


def _forcing(network: Network, boundaries: Mapping[str, Profile], time: Array) -> tuple[Array, Array]:
    """Temperatures of the boundaries and their slopes, each (times, boundaries)."""
    pieces = [boundaries[boundary.name].segments(time) for boundary in network.boundaries]
    value, slope = (np.column_stack(part) for part in zip(*pieces, strict=True))
    return value, slope


def _powers(network: Network, time: Array, derivative: int) -> Array:
    """Heat put into the nodes (W), or its slope (W/s), shape (times, nodes)."""
    q = np.zeros((time.size, network.count))
    for source in network.sources:
        if isinstance(source.power, Profile):
            q[:, network.index(source.node)] += source.power.segments(time)[derivative]
        elif derivative == 0:
            q[:, network.index(source.node)] += source.power
    return q


def _initial(network: Network, boundaries: Mapping[str, Profile], initial: ArrayLike | None) -> Array:
    if initial is None:
        first = {name: float(profile.value[0]) for name, profile in boundaries.items()}
        start = min(profile.start for profile in boundaries.values())
        return find_steady_state(network, first, start)[: network.count]
    T = np.asarray(initial, dtype=float)
    if T.shape != (network.count,) or not (np.isfinite(T).all() and (T > 0).all()):
        raise ThermalError(f"the initial state needs {network.count} temperatures above 0 K.")
    return T


