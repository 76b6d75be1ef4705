"""Temperatures of a network in time with their derivatives by any of its constants: the sensitivity equations.

With S = ∂T/∂p, L, R, C, q the network's conduction, radiation, capacities and powers (`thermal.network`),

    C dS/dt = −(L + 4σ R diag T³) S + ∂q/∂p − ∂L/∂p T − σ ∂R/∂p T⁴ − (∂ln C/∂p + C'/C S) C dT/dt,

linear in S, along the temperatures that `thermal.sweeping` has found: solved interval by interval, all constants at once.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from thermal.constants import Stefan_Boltzmann
from thermal.network import Array, Network
from thermal.profile import Profile
from thermal.steady import first_steady_state
from thermal.sweeping import Sweep, capacity_ratio, hermite, hold, run_sweeps
from thermal.transient import BLOCK, Transient, propagate

TWO = (293.15, 303.15)  # K, where a capacity that changes shows it
AROUND = 300.0  # K, a temperature at which all is at rest, about which changes are propagated: these are above 0 K
CAPACITY_STEP = 0.5  # K, half the central difference of a capacity over temperature


@dataclass(frozen=True)
class NetworkChange:
    """How a network changes with one value: derivatives of its matrices; all zero unless given."""

    conduction: Array  # conduction, radiation: arrays (N, N), ∂L/∂p and ∂R/∂p over nodes and boundaries
    radiation: Array
    capacity: Callable[[Array], Array]  # ∂ ln C/∂p of the nodes (n, ...) at their temperatures (n, ...)
    power: Array  # array (n,), ∂q/∂p
    # mapping of a boundary's name to the change of its profile, on rows as long as the run
    boundaries: Mapping[str, Profile] = field(default_factory=dict)
    initial: Array | None = None  # array (n,), ∂T(0)/∂p beyond what a settled start does (K)

    @property
    def capacity_at_two(self) -> Array:
        """∂ ln C/∂p at two temperatures, (n, 2)."""
        return self.capacity(np.full((len(self.power), 2), TWO))

    @property
    def moves(self) -> bool:
        """Whether it changes any temperature."""
        matrices = (self.conduction, self.radiation, self.capacity_at_two, self.power)
        return bool(self.boundaries) or self.initial is not None or any(part.any() for part in matrices)


def no_change(
    network: Network, boundaries: Mapping[str, Profile] | None = None, initial: Array | None = None
) -> NetworkChange:
    """Return a change that leaves the network as it is: of the boundaries or of the initial state alone."""
    n, N = network.count, len(network.names)
    zero = np.zeros((N, N))
    return NetworkChange(zero, zero, np.zeros_like, np.zeros(n), boundaries or {}, initial)


def difference(above: Network, below: Network, step: float) -> NetworkChange:
    """Change from two networks of the same nodes built half a `step` above and below a value."""

    def capacity(temperature: Array) -> Array:
        return np.asarray(np.log(above.capacities(temperature) / below.capacities(temperature)) / step)

    return NetworkChange(
        (above.conduction - below.conduction) / step,
        (above.radiation - below.radiation) / step,
        capacity,
        (above.power(0.0) - below.power(0.0)) / step,
    )


@dataclass(frozen=True)
class ObservedSums:
    """Sums of node temperatures at the rows, and their derivatives."""

    temperature: Array  # temperature, rate: arrays (M, sums), K and K/s
    rate: Array
    slope: Array  # slope, rate_slope: arrays (changes, M, sums), the derivatives of both
    rate_slope: Array


def respond(
    network: Network, boundaries: Mapping[str, Profile], time: ArrayLike, weights: Array,
    changes: Sequence[NetworkChange] = (), departure: Array | None = None, longest: float | None = None,
) -> ObservedSums:  # fmt: skip
    """Temperatures at the rows, weighed (sums, n), with derivatives by every change; departures (n,) are from the first steady state."""
    rows = np.asarray(time, dtype=float)
    steady = first_steady_state(network, boundaries)
    n = network.count
    swept = run_sweeps(network, boundaries, steady[:n] if departure is None else steady[:n] + departure, longest)
    # in blocks of rows, so that only the sums are stored
    blocks = [rows[k : k + BLOCK] for k in range(0, max(len(rows), 1), BLOCK)]
    observed = zip(*(_observe(swept, boundaries, block, weights) for block in blocks), strict=True)
    T, rate = (np.concatenate(one) for one in observed)
    if not changes:
        empty = np.zeros((0, *T.shape))
        return ObservedSums(T, rate, empty, empty)
    return ObservedSums(T, rate, *_Slopes(swept, steady, changes).at(rows, weights))


def _observe(swept: Sweep, boundaries: Mapping[str, Profile], rows: Array, weights: Array) -> tuple[Array, Array]:
    """Sums and rates: of T₁ from its equation, of δ from its cubics."""
    linear, grid = swept.linear, swept.grid
    T, rate = _observe_first(swept, swept.first, boundaries, rows, weights)
    varies = any(isinstance(source.power, Profile) for source in linear.sources)
    rate = rate + (linear.power(rows if varies else rows[:1]) / grid.modes.capacity) @ weights.T
    delta, delta_rate = hermite(grid, rows, swept.beyond @ weights.T, swept.beyond_rate @ weights.T)
    return T + delta, rate + delta_rate


def _observe_first(
    swept: Sweep, first: Transient, boundaries: Mapping[str, Profile], rows: Array, weights: Array
) -> tuple[Array, Array]:
    """Sums and rates of what the linear network answers to its boundaries alone."""
    n, count = swept.linear.count, len(weights)
    drain = swept.linear.conduction[:n] / swept.grid.modes.capacity[:, None]
    both = first.observe(rows, np.vstack([weights, -weights @ drain[:, :n]]))
    held = np.column_stack([boundaries[b.name].at(rows) for b in swept.linear.boundaries])
    return both[:, :count], both[:, count:] - held @ (weights @ drain[:, n:]).T


class _Slopes:
    """Derivatives at all moments of the grid, found by sweeping."""

    def __init__(self, swept: Sweep, steady: Array, changes: Sequence[NetworkChange]) -> None:
        self.swept = swept
        network, linear = swept.network, swept.linear
        n = self.count = network.count
        everything = swept.everything
        self.cube: Array = 4 * Stefan_Boltzmann * everything**3
        self.varies = any(callable(node.capacity) for node in network.nodes)
        self.ratio = capacity_ratio(network, linear, everything) if self.varies else np.ones(n)
        self.flow = self.ratio * (swept.power - network.outflow(everything)[..., :n])  # C₀ dT/dt
        if self.varies:
            warm, cold = (capacity_ratio(network, linear, everything + d) for d in (CAPACITY_STEP, -CAPACITY_STEP))
            self.log_slope = (np.log(cold) - np.log(warm)) / (2 * CAPACITY_STEP)  # d ln C/dT
        held = np.stack([self._hold(change) for change in changes], axis=2)
        forcing = np.stack([self._force(change) for change in changes], axis=2)
        start = np.stack([_initial_slope(network, steady, change) for change in changes])
        # what departs at the start, and what a boundary does, may be over within a part of an interval
        self.first = [self._answer_first(change, own) for change, own in zip(changes, start, strict=True)]
        answered = np.zeros_like(forcing)
        for k, first in enumerate(self.first):
            if first is not None:
                answered[:, :, k] = [first[0].evaluate(t) - AROUND for t in swept.grid.moments]
                start[k] = 0.0
        feedback = self._feedback()
        forcing += np.concatenate([answered, held], axis=3) @ feedback
        self.modes, self.mode_rates = swept.grid.answer_with(forcing, feedback[:, :, :n], start)

    def _answer_first(self, change: NetworkChange, start: Array) -> tuple[Transient, dict[str, Profile]] | None:
        """Return what the linear network answers to boundaries and a start that change, exactly, and these boundaries: about a temperature at rest."""
        if not change.boundaries and change.initial is None:
            return None
        grid, linear = self.swept.grid, self.swept.linear
        held = {b.name: Profile(grid.knots[[0, -1]], np.full(2, AROUND)) for b in linear.boundaries}
        held |= {name: Profile(own.time, AROUND + own.value) for name, own in change.boundaries.items()}
        start = AROUND + start + (0.0 if change.initial is None else change.initial)
        return propagate(replace(linear, sources=()), held, start, grid.modes), held

    def _hold(self, change: NetworkChange) -> Array:
        """Changes of the boundaries at all moments, (3, K, boundaries)."""
        grid, names = self.swept.grid, [b.name for b in self.swept.network.boundaries]
        held = np.zeros((*grid.moments.shape, len(names)))
        for name, profile in change.boundaries.items():
            held[..., names.index(name)] = hold({name: profile}, (name,), grid.knots, measured=True)[..., 0]
        return held

    def _force(self, change: NetworkChange) -> Array:
        """What one change does at fixed temperatures (W), (3, K, n)."""
        swept, n = self.swept, self.count
        push = np.zeros_like(self.flow)
        if change.conduction.any():
            push -= swept.everything @ change.conduction[:n].T
        if change.radiation.any():
            push -= Stefan_Boltzmann * (swept.everything**4 @ change.radiation[:n].T)
        return np.asarray(self.ratio * (push + change.power) - self._heavier(change) * self.flow)

    def _heavier(self, change: NetworkChange) -> Array:
        """∂ ln C/∂p at all moments, (3, K, n), or (n,) where it does not depend on temperature."""
        cold, warm = change.capacity_at_two.T
        if np.allclose(cold, warm, rtol=1e-6, atol=0.0):
            return np.asarray(cold)
        return np.moveaxis(change.capacity(np.moveaxis(self.swept.everything[..., : self.count], -1, 0)), 0, -1)

    def _feedback(self) -> Array:
        """∂b/∂T at all moments, (3, K, N, n): by rows what a kelvin of each node or boundary does to the powers of the nodes (W/K)."""
        network, linear, n = self.swept.network, self.swept.linear, self.count
        result = (linear.conduction - network.conduction)[:, :n] - self.cube[..., None] * network.radiation[:, :n]
        if self.varies:
            result += (self.ratio[:, :, None] - 1) * (result - linear.conduction[:, :n])
            result[..., np.arange(n), np.arange(n)] -= self.flow * self.log_slope
        return result

    def at(self, rows: Array, weights: Array) -> tuple[Array, Array]:
        """Sums over the nodes at the rows, (changes, M, sums), and their rates."""
        modes = self.swept.grid.modes
        sums = (weights @ modes.shapes).T
        both = hermite(self.swept.grid, rows, self.modes @ sums, self.mode_rates @ sums)
        slope, rate = (np.moveaxis(own, 1, 0) for own in both)
        for k, first in enumerate(self.first):
            if first is not None:
                at_rest = AROUND * weights.sum(axis=1)
                T, dT = _observe_first(self.swept, *first, rows, weights)
                slope[k] += T - at_rest
                rate[k] += dT
        return slope, rate


def _initial_slope(network: Network, steady: Array, change: NetworkChange) -> Array:
    """∂T(0)/∂p (n,), of the steady state before the profiles begin."""
    n = network.count
    held = np.zeros(len(network.names))
    for name, profile in change.boundaries.items():
        held[network.index(name)] = profile.value[0]
    slope: Array = network.outflow_slope(steady)
    push: Array = change.power - (change.conduction @ steady + Stefan_Boltzmann * (change.radiation @ steady**4))[:n]
    return np.asarray(np.linalg.solve(slope[:n, :n], push - (slope @ held)[:n]))
