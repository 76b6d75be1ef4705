"""Waveform relaxation: the nonlinear part of radiation is iterated over the whole run until it converges.

With L₀, C₀ of the network linearised at the mean temperature, C dT/dt = q − L T − σ R T⁴ is C₀ dT/dt = q − L₀ T + b(T),

    b(T) = (q − L T − σ R T⁴) C₀/C(T) − (q − L₀ T).

T = T₁ + δ: the linear network answers the boundaries exactly, at every row of theirs; δ answers b, which is smooth and
is a parabola between knots at most 60 s apart (its mean by Simpson's rule). Each sweep contracts the error by about
the relative change of T³; the error is of fourth order in the distance of the knots.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from thermal.constants import Stefan_Boltzmann
from thermal.errors import ThermalError
from thermal.lag import scan
from thermal.network import Array, Network, linearise
from thermal.profile import Profile
from thermal.relaxation import Relaxation, find_relaxation
from thermal.steady import MOST_ROWS, find_corners, initial_state
from thermal.transient import Transient, propagate

MOST_SWEEPS = 60
SWEEP_TOLERANCE = 1e-7  # K
LONGEST_ROW = 60.0  # s, between which what radiation adds is a parabola
MEAN_LINE = np.array([[2.0, 2.0, -1.0], [-1.0, 2.0, 2.0]])[:, :, None, None] / 3
"""Both ends of the straight line of a parabola's mean, from its values at start, middle and end."""
PROMPT = 0.1  # of an interval, within which a mode fades
INTERVALS = 32  # solved together: their matrices stay in the cache
FEW_CORNERS = 20  # of a profile after whose corners knots are closer, where they are closer than usual everywhere
SOON, CLOSER = 96, 4  # usual distances over which they are, and how much: a parabola is far from what begins there
MOST_CORNERS = 200  # of profiles whose every corner is a knot; a measured column of more rows is averaged for δ


class SweepError(ThermalError):
    """Radiation is too strong for the sweeps to converge."""


@dataclass(frozen=True)
class Grid:
    """Knots of a run with their midpoints, and the modes between; (3, K, …) are start, middle and end (before a jump) of intervals."""

    knots: Array
    modes: Relaxation

    @cached_property
    def length(self) -> Array:
        """Lengths (s) of the intervals."""
        return np.diff(self.knots)

    @cached_property
    def moments(self) -> Array:
        """Start, middle and end (s) of the intervals, (3, K)."""
        start, end = self.knots[:-1], self.knots[1:]
        return np.array([start, (start + end) / 2, end])

    @cached_property
    def _weights(self) -> tuple[Array, Array]:
        """Decay over a half and over a whole interval, (2, K, n), and weights there of the power at its three moments, (2, 3, K, n)."""
        rate = 1 / self.modes.time_constants
        h = np.multiply.outer([0.5, 1.0], self.length)[..., None]
        decay = np.exp(-rate * h)
        even = (1 - decay) / rate  # ∫ e^(−λ(h − s)) ds
        far = (h - even) / (rate * h)  # ∫ e^(−λ(h − s)) s/h ds
        near = even - far
        near[0], far[0] = near[0] + far[0] / 2, far[0] / 2  # over a half: to the middle of the straight line
        return decay, near[:, None] * MEAN_LINE[0] + far[:, None] * MEAN_LINE[1]

    def answer(self, power: Array, start: Array) -> tuple[Array, Array]:
        """Temperatures at all moments, (3, K, p, n), for power (W) at all moments, from `start` (p, n), and the amplitudes of the modes."""
        states = self._states(power @ self.modes.shapes, self._modal(start))
        return np.asarray(states @ self.modes.shapes.T), states

    def rates(self, power: Array, states: Array) -> Array:
        """Rates (K/s) of the same temperatures."""
        return np.asarray((power @ self.modes.shapes - states / self.modes.time_constants) @ self.modes.shapes.T)

    def _modal(self, temperature: Array) -> Array:
        """Amplitudes of the modes in temperatures, (p, n)."""
        return np.asarray((temperature * self.modes.capacity) @ self.modes.shapes)

    def _forced(self, u: Array, modes: slice = slice(None)) -> Array:
        """What power in some modes, (3, K, p, m), makes over a half and over a whole interval, (2, K, p, m)."""
        weights = self._weights[1][..., modes].swapaxes(0, 1)
        return np.asarray(sum(w[:, :, None] * own for w, own in zip(weights, u, strict=True)))

    def _states(self, u: Array, start: Array, modes: slice = slice(None)) -> Array:
        """Amplitudes of some modes at all moments, for the power in each of them."""
        (decay2, decay), (half, whole) = self._weights[0][..., modes], self._forced(u, modes)
        x = scan(decay, whole, start)
        return np.array([x[:-1], decay2[:, None] * x[:-1] + half, x[1:]])

    def answer_with(self, power: Array, feedback: Array, start: Array) -> tuple[Array, Array]:
        """Amplitudes of the modes and their rates where the power is itself `power` + T · `feedback`, (3, K, n, n): in every interval three moments at once.

        Modes that fade `PROMPT`ly are fed by the slow ones; what they feed back is of second order, 1e-6 of a slope.
        """
        shapes, (decay, weights) = self.modes.shapes, self._weights
        u, start = power @ shapes, self._modal(start)
        n = int(np.sum(self.modes.time_constants > PROMPT * self.length.max()))
        x, gain, now = np.empty_like(u), np.empty_like(u), start[:, :n]
        forced = self._forced(u[..., :n], slice(n))
        for first in range(0, u.shape[1], INTERVALS):
            at = slice(first, first + INTERVALS)
            F = shapes[:, :n].T @ feedback[:, at] @ shapes
            # x_h = decay_h x_0 + Σ_j w_hj (u_j + x_j F_j) of h = half, whole; x_1 and x_2 by x_0 and by what is forced
            own = weights[:, :, at, None, :n] * F[..., :n]
            matrix = np.eye(2 * n) - np.concatenate([np.concatenate([*own[:, j]], axis=-1) for j in (1, 2)], axis=-2)
            begin = np.concatenate([*(own[:, 0] + decay[:, at, None, :n] * np.eye(n))], axis=-1)
            right = np.concatenate([begin, np.concatenate([*forced[:, at]], axis=-1)], axis=-2)
            both = np.linalg.solve(matrix.swapaxes(-1, -2), right.swapaxes(-1, -2)).swapaxes(-1, -2)
            for k, step in enumerate(both, first):
                after = now @ step[:n] + step[n:]
                x[:, k, :, :n] = now, after[:, :n], after[:, n:]
                now = after[:, n:]
            gain[:, at] = u[:, at] + x[:, at, :, :n] @ F
        x[..., n:] = self._states(gain[..., n:], start[:, n:], slice(n, None))
        return x, gain - x / self.modes.time_constants


@dataclass(frozen=True)
class Sweep:
    """A network's temperatures at all moments of its grid, and what they were found with."""

    network: Network
    linear: Network
    grid: Grid
    held: Array  # array (3, K, boundaries), K
    power: Array  # array (3, K, n), W, of the sources
    temperature: Array  # array (3, K, n), K
    beyond: Array  # beyond, beyond_rate: arrays (3, K, n), δ and its rate (K, K/s)
    beyond_rate: Array
    first: Transient  # Transient, the linear network's answer T₁

    @cached_property
    def everything(self) -> Array:
        """Temperatures (K) of nodes and boundaries at all moments, (3, K, N)."""
        return np.concatenate([self.temperature, self.held], axis=2)

    def transient(self) -> Transient:
        """Return the temperatures as functions of time."""

        def evaluate(time: Array) -> Array:
            interpolated = hermite(self.grid, time, self.beyond, self.beyond_rate)[0]
            return np.asarray(self.first.evaluate(time) + interpolated)

        return Transient(self.first.nodes, self.first.knots, evaluate)


def sweep(network: Network, boundaries: Mapping[str, Profile], initial: ArrayLike | None = None) -> Transient:
    """Follow profiles through a network with radiation, or capacities that depend on temperature (see the module)."""
    return run_sweeps(network, boundaries, initial).transient()


def run_sweeps(
    network: Network, boundaries: Mapping[str, Profile], initial: ArrayLike | None = None, longest: float | None = None
) -> Sweep:
    """Sweep until no temperature changes by more than 1e-7 K, with knots at most `longest` (s) apart, `LONGEST_ROW` when absent."""
    corners = find_corners(network, boundaries)
    knots = _choose_knots(corners, boundaries, longest or LONGEST_ROW)
    T0 = initial_state(network, boundaries, initial)
    held = hold(boundaries, tuple(b.name for b in network.boundaries), knots, len(corners) > MOST_CORNERS)
    linear = linearise(network, float(held.mean()))
    modes = find_relaxation(linear, 1.0)
    grid = Grid(knots, modes)
    power = network.power(grid.moments)
    first = propagate(linear, boundaries, T0, modes)
    start = np.zeros((1, network.count))
    moments = grid.moments
    T1 = np.array([first.evaluate(t) for t in moments])
    T, delta, rate = T1, np.zeros_like(T1), np.zeros_like(T1)
    change = 0.0 if network.is_linear else np.inf
    for _ in range(MOST_SWEEPS if change else 0):
        beyond = _beyond(network, linear, T, held, power)[:, :, None]
        answer, states = grid.answer(beyond, start)
        delta = answer[:, :, 0]
        last, T = T, T1 + delta
        change = np.abs(T - last).max()
        if change < SWEEP_TOLERANCE:
            rate = grid.rates(beyond, states)[:, :, 0]
            break
        if not change < 1e4:
            break
    if not change < SWEEP_TOLERANCE:
        raise SweepError("the radiation is too strong to be swept; integrate the network instead.")
    return Sweep(network, linear, grid, held, power, T, delta, rate, first)


def _beyond(network: Network, linear: Network, T: Array, held: Array, power: Array) -> Array:
    """Return b(T) (W) at all moments, (3, K, n)."""
    n = network.count
    everything = np.concatenate([T, held], axis=2)
    if not any(callable(node.capacity) for node in network.nodes):
        stiffer = (linear.conduction - network.conduction)[:, :n]
        return np.asarray(everything @ stiffer - (everything**2) ** 2 @ (Stefan_Boltzmann * network.radiation[:, :n]))
    flow = (power - network.outflow(everything)[..., :n]) * capacity_ratio(network, linear, everything)
    return np.asarray(flow - (power - linear.outflow(everything)[..., :n]))


def capacity_ratio(network: Network, linear: Network, temperature: Array) -> Array:
    """C₀/C(T) of the nodes, (..., n), at temperatures (..., N)."""
    T = np.moveaxis(temperature, -1, 0)
    return np.moveaxis(linear.capacities(T) / network.capacities(T), 0, -1)


def hermite(grid: Grid, time: Array, value: Array, rate: Array) -> tuple[Array, Array]:
    """Interpolate values and their rates, (3, K, …), at times (M,) by cubics between the moments; (M, …)."""
    nodes = np.append(grid.moments[:2].T.ravel(), grid.knots[-1])
    k = np.clip(np.searchsorted(nodes, time, side="right") - 1, 0, len(nodes) - 2)
    interval, half = np.divmod(k, 2)
    behind = (slice(None), *[None] * (value.ndim - 2))
    h = (nodes[k + 1] - nodes[k])[behind]
    s = (time - nodes[k])[behind] / h
    y0, y1 = value[half, interval], value[half + 1, interval]
    return cubic(s, h, y0, y1, rate[half, interval], rate[half + 1, interval])


def cubic(s: Array, h: Array, y0: Array, y1: Array, rate0: Array, rate1: Array) -> tuple[Array, Array]:
    """Value and rate at a part s of an interval of length h, from values and rates at its ends (Hermite)."""
    d0, d1 = h * rate0, h * rate1
    c2, c3 = 3 * (y1 - y0) - 2 * d0 - d1, 2 * (y0 - y1) + d0 + d1
    return y0 + s * (d0 + s * (c2 + s * c3)), (d0 + s * (2 * c2 + 3 * s * c3)) / h


def hold(profiles: Mapping[str, Profile], names: tuple[str, ...], knots: Array, measured: bool) -> Array:
    """Values of profiles at all moments, (3, K, profiles); of a measured column, means that keep its area."""
    start, end = knots[:-1], knots[1:]
    moments = np.array([start, (start + end) / 2, end])
    columns = []
    for name in names:
        profile = profiles[name]
        if measured:
            middle = (start + end) / 2
            first, last = _mean_around(profile, np.array([start, end]), (end - start) / 4)
            mean = _mean_around(profile, middle, (end - start) / 2)
            columns.append(np.array([first, (6 * mean - first - last) / 4, last]))
        else:
            value, slope = profile.segments(start)
            columns.append(value + slope * (moments - start))
    return np.stack(columns, axis=-1)


def _mean_around(profile: Profile, time: Array, reach: Array) -> Array:
    integral = np.concatenate([[0.0], np.cumsum(np.diff(profile.time) * (profile.value[1:] + profile.value[:-1]) / 2)])

    def antiderivative(t: Array) -> Array:
        value, slope = profile.segments(t.ravel())
        k = np.minimum(np.searchsorted(profile.time, t.ravel(), side="right") - 1, len(profile.time) - 2)
        s = t.ravel() - profile.time[k]
        area: Array = integral[k] + s * (value - slope * s / 2)
        return area.reshape(t.shape)

    low = np.maximum(time - reach, profile.start)
    high = np.minimum(time + reach, profile.end)
    return np.asarray((antiderivative(high) - antiderivative(low)) / (high - low))


def _choose_knots(corners: Array, boundaries: Mapping[str, Profile], longest: float) -> Array:
    """Corners, or of very many only the jumps, divided until no interval is longer than `longest` (s), shorter after each of few corners."""
    if len(corners) > MOST_CORNERS:
        jumps = [profile.jumps for profile in boundaries.values()]
        corners = np.unique(np.concatenate([corners[[0, -1]], *jumps]))
    soon = SOON * longest if longest < LONGEST_ROW and len(corners) <= FEW_CORNERS else 0.0
    old, ends = corners, corners + soon
    corners = np.unique(np.concatenate([old, ends[ends < old[-1]]]))
    since = corners[:-1] - old[np.searchsorted(old, corners[:-1], side="right") - 1]
    parts = np.ceil(np.diff(corners) / np.where(since < soon, longest / CLOSER, longest))
    if parts.sum() > MOST_ROWS:
        raise ThermalError(f"the profile is too long to be swept ({np.ptp(corners):.3g} s); shorten it.")
    counts = parts.astype(np.intp)
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    finer: Array = np.repeat(corners[:-1], counts) + within * np.repeat(np.diff(corners) / counts, counts)
    return np.append(finer, corners[-1])
