"""Temperatures of a network in time, and their exact propagation where the network is linear."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from thermal.errors import ThermalError
from thermal.lag import scan
from thermal.network import Array, Network
from thermal.profile import Profile
from thermal.relaxation import Relaxation, find_relaxation
from thermal.steady import boundary_forcing, find_corners, initial_state

BLOCK = 1 << 16  # rows evaluated at a time; bounds the memory of long outputs


@dataclass(frozen=True)
class Transient:
    """Temperatures (K) of the nodes as functions of time, from `start` to `end` (s)."""

    nodes: tuple[str, ...]  # names of the nodes
    knots: Array  # array, times (s) between which the temperatures are smooth
    evaluate: Callable[[Array], Array]  # callable from an array of times (N,) to the array of temperatures (N, nodes)

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
        """Sums of node temperatures, shape (N, rows of weights), in blocks, so that only the sums are stored."""
        time = np.asarray(time, dtype=float)
        if time.size and not (time.min() >= self.start and time.max() <= self.end):
            raise ThermalError(f"the transient covers only {self.start:g} to {self.end:g} s.")
        sums = np.empty((time.size, len(weights)))
        for k in range(0, time.size, BLOCK):
            sums[k : k + BLOCK] = self.evaluate(time[k : k + BLOCK]) @ weights.T
        return sums


def propagate(
    network: Network,
    boundaries: Mapping[str, Profile],
    initial: ArrayLike | None = None,
    modes: Relaxation | None = None,
) -> Transient:
    """Propagate a linear network exactly through piecewise linear boundaries and powers, from `initial` or the first steady state; `modes` are its own, where they are known.

    Modes x = shapesᵀ C T obey dx/dt = −λ x + u₀ + u₁ s: x = u₀/λ − u₁/λ² + (u₁/λ) s + c e^(−λ s) after a corner.
    """
    if not network.is_linear:
        raise ThermalError("exact only without radiation and with constant capacities; linearise the network or integrate it.")  # fmt: skip
    knots = find_corners(network, boundaries)
    modes = modes or find_relaxation(network, 1.0)  # a linear network has the same modes at every temperature
    rate, shapes = 1 / modes.time_constants, modes.shapes
    value, slope = boundary_forcing(network, boundaries, knots[:-1])
    trend = (slope @ modes.coupling.T + network.power(knots[:-1], 1)) @ shapes
    level = (value @ modes.coupling.T + network.power(knots[:-1])) @ shapes
    trend /= rate  # in place: a record has many rows and a shell many nodes
    level -= trend
    level /= rate
    length = np.diff(knots)[:, None]
    decay = np.exp(-rate * length)
    forced = trend * length
    forced += level
    forced -= decay * level
    T0 = initial_state(network, boundaries, initial)
    departure = scan(decay, forced, (T0 * modes.capacity) @ shapes)[:-1]
    departure -= level

    def evaluate(time: Array) -> Array:
        k = np.minimum(np.searchsorted(knots, time, side="right") - 1, len(length) - 1)
        s = (time - knots[k])[:, None]
        x = level[k] + trend[k] * s + departure[k] * np.exp(-rate * s)
        return np.asarray(x @ shapes.T)

    return Transient(modes.nodes, knots, evaluate)


POINTS = 8  # Gauss points per piece
ROUNDING = 1e-12  # of the heat that the nodes hold: less has not flowed
PIECES = 12  # pieces per smooth stretch of a transient, shorter towards its start


@dataclass(frozen=True)
class EnergyBalance:
    """Heat stored in the nodes and heat received from boundaries and sources (J)."""

    stored: float
    received: float
    turnover: float

    @property
    def error(self) -> float:
        """Difference over the turnover, the sum of the sizes of all heats that flowed."""
        return abs(self.stored - self.received) / self.turnover if self.turnover else 0.0  # none flowed


def check_energy(network: Network, boundaries: Mapping[str, Profile], transient: Transient) -> EnergyBalance:
    """Compare Σ ∫ C dT with ∫ (heat from the boundaries + sources) dt along a transient."""
    n = network.count
    received = turnover = 0.0
    x, w = np.polynomial.legendre.leggauss(POINTS)
    shares = np.concatenate([[0.0], 2.0 ** np.arange(1 - PIECES, 1)])  # of a stretch, finer after its start
    for start, end in zip(transient.knots[:-1], transient.knots[1:], strict=True):
        edges = start + (end - start) * shares
        half = np.diff(edges)[:, None] / 2
        time, weight = (edges[:-1, None] + half * (x + 1)).ravel(), (half * w).ravel()
        held = np.column_stack([boundaries[boundary.name].at(time) for boundary in network.boundaries])
        outflow = network.outflow(np.hstack([transient.at(time), held]))
        inflow = np.hstack([outflow[:, n:], network.power(time)])
        received += float((weight @ inflow).sum())
        turnover += float((weight @ np.abs(inflow)).sum())
    first, last = transient.at(transient.knots[[0, -1]])
    T = first + np.outer((x + 1) / 2, last - first)
    capacity = np.array([[node.capacity_at(float(t)) for node, t in zip(network.nodes, row, strict=True)] for row in T])
    stored = (last - first) / 2 * (w @ capacity)
    turnover += float(np.abs(stored).sum())
    turnover *= turnover > ROUNDING * float((capacity[0] * first).sum())
    return EnergyBalance(float(np.sum(stored)), received, turnover)
