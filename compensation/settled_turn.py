"""Whole-angle wave over hours with settled loops, without simulating their samples.

The measured azimuth θ obeys

    θ̇ = g(θ) k Ω + c(θ) p + k B(θ),

g, c and B what settled loops make of an applied rate, of the commanded turn p, and of damping and splits (`rebalance`, linear in each,
exact in the electronics' errors). What the loops make of their own lag, about the turn of 2 n θ within their response, is left out; `whole_angle` has it.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compensation.applied_rate import AppliedRate
from compensation.arrays import Array, Complex
from compensation.electronics import Electronics
from compensation.errors import CompensationError
from compensation.rebalance import LoopRun, settle_rebalance
from compensation.wave import StandingWave

TURN, STILL = 0.3, 1e-3  # largest turn of 2 n θ (rad) in one step; one in which a mean is the value in the middle
GAUSS = 3**-0.5 / 2  # from the middle of a step, over its length
AZIMUTHS = 64  # at which B, g and c are taken
SMALL = 1e-12  # terms of e^{2 i n θ} that are not kept of them
WINDOW = 0.25  # how far, over the steps that are solved at once, a change of the azimuth can come back to itself
SETTLED, MOST = 1e-14, 60  # rad, of the azimuth from one round to the next; rounds


def turn_settled(
    wave: StandingWave, electronics: Electronics, time: ArrayLike, *, rate: ArrayLike | AppliedRate = 0.0,
    precession: ArrayLike = 0.0, angle: float = 0.0, wander: ArrayLike = 0.0, means: bool = True,
) -> LoopRun:  # fmt: skip
    """Return the output of settled loops for a wave that `rate` and `precession` (rad/s, linear) turn from `angle`, and `wander`, noise of the rate, each row's mean.

    The run's `angle` is that at rows, all else means to the next; of the last, and without `means` of every row, its value.
    """
    t = np.asarray(time, dtype=float)
    if t.ndim != 1 or not (np.diff(t) > 0).all():
        raise CompensationError("the times of a run must increase.")
    rows = wave.over_rows(len(t))
    commanded, shaken = (np.broadcast_to(np.asarray(x, dtype=float), t.shape) for x in (precession, wander))
    applied, start = AppliedRate.of(rate, t), electronics.shown(wave.harmonic, angle)
    theta, nodes = _integrate(rows, electronics, t, applied, commanded, start, rows.bryan_factor * shaken)
    if not means:
        return settle_rebalance(wave, electronics, applied.at(t), theta, precession=precession)
    given = np.interp(nodes.row + nodes.part, np.arange(len(t)), commanded)
    found = settle_rebalance(nodes.wave(rows), electronics, nodes.rate, nodes.angle, precession=given)
    return replace(nodes.means(found, len(t)), time=t, angle=theta)


def read_turned(
    wave: StandingWave, electronics: Electronics, time: Array, angle: Array, *, rate: ArrayLike | AppliedRate = 0.0
) -> LoopRun:
    """Return the same for a wave that something has turned from measured azimuth to azimuth (rad), evenly over each row."""
    rows, span = wave.over_rows(len(time)), np.diff(time)
    moved = np.diff(angle)
    size = 2 * wave.harmonic * np.abs(moved)
    pieces = np.maximum(np.ceil(size / TURN), 1.0).astype(int)
    row, done = _cut(pieces)
    k, c, weight = _nodes((size / pieces)[row])
    row, part = row[k], (done[k] + c) / pieces[row[k]]
    applied = AppliedRate.of(rate, time).means(time)
    nodes = _Nodes(
        np.append(row, len(time) - 1), np.append(part, 0.0), np.append(angle[row] + part * moved[row], angle[-1]),
        np.append(applied[row], applied[-1]), weight / pieces[row],
    )  # fmt: skip
    turn = moved / span
    turn = np.append(turn[row], turn[-1])
    found = settle_rebalance(nodes.wave(rows), electronics, nodes.rate, nodes.angle, turn)
    return replace(nodes.means(found, len(time)), time=time, angle=angle)


@dataclass(frozen=True)
class _Nodes:
    """Where in its rows a wave is read for their means, and at last in the last row: two Gauss nodes of each step, one where it hardly turns."""

    row: NDArray[np.intp]
    part: Array  # of the way to the next row
    angle: Array  # rad
    rate: Array  # rad/s
    weight: Array  # of all but the last in the mean of its row

    def wave(self, rows: StandingWave) -> StandingWave:
        return rows.between(self.row, self.part)

    def means(self, found: LoopRun, rows: int) -> LoopRun:
        """Return the means over rows, and the last value."""

        def mean(values: Array) -> Array:
            return np.append(np.bincount(self.row[:-1], self.weight * values[:-1], rows - 1), values[-1])

        return replace(
            found, rate=mean(found.rate), quadrature=mean(found.quadrature), decay=mean(found.decay), omega=mean(found.omega)
        )  # fmt: skip


def _nodes(turned: Array) -> tuple[NDArray[np.intp], Array, Array]:
    """Return the step, the place in it and the weight of each node, of steps that turn 2 n θ by so much (rad)."""
    still, moving = np.flatnonzero(turned < STILL), np.flatnonzero(turned >= STILL)
    place = np.repeat([0.5, 0.5 - GAUSS, 0.5 + GAUSS], [len(still), len(moving), len(moving)])
    return np.concatenate([still, moving, moving]), place, np.repeat([1.0, 0.5], [len(still), 2 * len(moving)])


def _cut(pieces: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return to which of the lengths each of their pieces belongs, and how many of it are before."""
    whole = np.repeat(np.arange(len(pieces)), pieces)
    return whole, np.arange(len(whole)) - np.repeat(np.cumsum(pieces) - pieces, pieces)


def _terms(rows: StandingWave, electronics: Electronics) -> tuple[Complex, Complex, Complex]:
    """Of g − 1, of c − 1 and, at the rows, of k B: terms c_0 ... of Re Σ c_j e^{2 i n j θ}, through values at even azimuths.

    θ̇ − p is linear in 1/τ, in both parts of ½Δ(1/τ) and of ½Δω, in k Ω and in p.
    """
    n, k, quarter = rows.harmonic, rows.bryan_factor, np.pi / (4 * rows.harmonic)
    one, axis = np.repeat(np.eye(7), AZIMUTHS, axis=0)[:, 1:].T, np.tile(np.pi * np.arange(AZIMUTHS) / AZIMUTHS / n, 7)
    unit = StandingWave(1.0, 1.0, one[0] + one[1], quarter * one[1], one[2] + one[3], quarter * one[3], n, k)
    values = k * settle_rebalance(unit, electronics, one[4] / k, axis, precession=one[5]).rate.reshape(7, AZIMUTHS)
    values[1:] -= values[0]
    values[1:5] *= 2
    values[5] -= 1
    found = np.fft.rfft(values)[:, :-1] * (2 / AZIMUTHS)
    found[:, 0] /= 2
    found = found[:, : 1 + np.flatnonzero(np.abs(found).max(axis=0) > SMALL).max(initial=0)]
    damped, detuned = rows.damped(), rows.detuned()
    wave = np.stack([1 / np.asarray(rows.tau), damped.real, damped.imag, detuned.real, detuned.imag], axis=1)
    return found[5], found[6], wave @ found[:5]


def _integrate(
    rows: StandingWave, electronics: Electronics, t: Array, applied: AppliedRate, command: Array, start: float,
    shaken: Array,
) -> tuple[Array, _Nodes]:  # fmt: skip
    """The azimuth at the rows, and where it is read: what departs from the turn that rate, command and noise (rad/s, of rows) would make alone.

    Command and B are straight lines between rows, the rate between its corners; the steps, one or more between two of either, are those of Simpson
    collocation,  x_m = x + h/24 (5 ẋ + 8 ẋ_m − ẋ'),  x' = x + h/6 (ẋ + 4 ẋ_m + ẋ'),  many of them solved at once in rounds.
    """
    k, n, last = rows.bryan_factor, rows.harmonic, len(t) - 1
    shown, arriving, drift = _terms(rows, electronics)
    order = np.arange(len(shown))
    edges, first, begin, end = applied.pieces(t)
    of = np.repeat(np.arange(last), np.diff(first))  # the row of each piece
    known = k * np.maximum(np.abs(begin), np.abs(end)) + _either(np.abs(command))[of]
    speed = 2 * n * (known + _either(np.abs(drift).sum(axis=1))[of])
    pieces = np.maximum(np.ceil(speed * np.diff(edges) / TURN), 1.0).astype(int)
    piece, done = _cut(pieces)
    row, h = of[piece], (np.diff(edges) / pieces)[piece]
    passed = np.array([done, done + 0.5, done + 1])  # steps of the piece before begin, middle and end of each
    at = (edges[piece] - t[row] + passed * h) / np.diff(t)[row]
    turning = k * (begin[piece] + (end - begin)[piece] * passed / pieces[piece])
    commanded = command[row] + at * np.diff(command)[row]

    def swept(c: Array, s: Any) -> Array:
        """What is known of the turn at parts c of steps s."""
        speeds = turning[:, s] + commanded[:, s]
        return np.asarray(c * h[s] * (speeds[0] + c / 2 * (speeds[2] - speeds[0]) + shaken[row[s]]))

    everything = slice(None)
    begun = start + np.concatenate([[0.0], np.cumsum(swept(np.array(1.0), everything))])
    nodes = np.append(np.stack([begun[:-1], begun[:-1] + swept(np.array(0.5), everything)], axis=1).ravel(), begun[-1])
    answers = 2 * n * (_either(np.abs(drift) @ order)[of] + known * float((np.abs(shown) + np.abs(arriving)) @ order))
    window = np.cumsum(h * answers[piece]) // WINDOW
    joints = np.concatenate([[0], np.flatnonzero(np.diff(window)) + 1, [len(h)]])
    departed, slopes = np.zeros(len(h) + 1), np.empty((3, len(h)))
    for low, high in pairwise(joints):
        here, steps = slice(low, high), h[low:high]
        place = np.append(at[:2, here].T.ravel(), at[2, high - 1])
        home = np.append(np.repeat(row[here], 2), row[high - 1])
        b = (drift[home] + place[:, None] * (drift[home + 1] - drift[home])).T
        x = np.full(len(place), departed[low])
        for _ in range(MOST):
            e = np.exp(2j * n * (nodes[2 * low : 2 * high + 1] + x))
            own, g, arrives = _series(b, e), _series(shown, e), _series(arriving, e)
            sides = (slice(0, -2, 2), slice(1, None, 2), slice(2, None, 2))
            f = np.stack([
                own[s] + g[s] * turn + arrives[s] * push
                for s, turn, push in zip(sides, turning[:, here], commanded[:, here], strict=True)
            ])  # fmt: skip
            before, x = x, np.empty_like(x)
            x[::2] = departed[low] + np.concatenate([[0.0], np.cumsum(steps / 6 * ([1, 4, 1] @ f))])
            x[1::2] = x[:-2:2] + steps / 24 * ([5, 8, -1] @ f)
            if np.abs(x - before).max() < SETTLED:
                break
        departed[low : high + 1], slopes[:, here] = x[::2], f
    theta = begun + departed
    s, c, weight = _nodes((speed * np.diff(edges) / pieces)[piece])
    bend = slopes[:, s] * [c - 1.5 * c**2 + 2 / 3 * c**3, 2 * c**2 - 4 / 3 * c**3, -(c**2) / 2 + 2 / 3 * c**3]
    there = theta[:-1][s] + swept(c, s) + h[s] * bend.sum(axis=0)
    rate = turning[0, s] + c * (turning[2, s] - turning[0, s])
    return theta[np.append(np.cumsum(pieces) - pieces, len(h))[first]], _Nodes(
        np.append(row[s], last), np.append(at[0, s] + c * (at[2, s] - at[0, s]), 0.0), np.append(there, theta[-1]),
        np.append(rate, k * applied.at(t[-1:])) / k, weight * (h / np.diff(t)[row])[s],
    )  # fmt: skip


def _either(values: Array) -> Array:
    """The larger of each row's value and the next's."""
    return np.maximum(values[1:], values[:-1])


def _series(terms: Complex, e: Complex) -> Array:
    """Re Σ c_j e^j by Horner's rule."""
    found = np.zeros_like(e)
    for c in terms[::-1]:
        found = found * e + c
    return np.asarray(found.real)
