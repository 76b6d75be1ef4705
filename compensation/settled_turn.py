"""Whole-angle wave over hours with settled loops, without simulating their samples.

The measured azimuth θ obeys

    θ̇ = g(θ) k Ω + c(θ) p + k B(θ),

g, c and B what settled loops make of an applied rate, of the commanded turn p, and of damping and splits (`rebalance`, linear in each,
exact in the electronics' errors). What the loops make of their own lag, about the turn of 2 n θ within their response, is left out; `whole_angle` has it.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from compensation.arrays import Array, Complex
from compensation.electronics import Electronics
from compensation.errors import CompensationError
from compensation.rebalance import LoopRun, settle_rebalance
from compensation.wave import StandingWave

TURN = 0.3  # largest turn of 2 n θ (rad) in one step
AZIMUTHS, SMALL = (
    64,
    1e-12,
)  # azimuths at which B, g and c are taken, and terms of e^{2 i n θ} that are not kept of them
WINDOW = 0.25  # how far, over the steps that are solved at once, a change of the azimuth can come back to itself
SETTLED, MOST = 1e-14, 60  # rad, of the azimuth from one round to the next; rounds


def turn_settled(
    wave: StandingWave, electronics: Electronics, time: ArrayLike, *, rate: ArrayLike = 0.0,
    precession: ArrayLike = 0.0, angle: float = 0.0, wander: ArrayLike = 0.0,
) -> LoopRun:  # fmt: skip
    """Return the output of settled loops for a wave that `rate` and `precession` (rad/s, linear) turn from `angle`, and `wander`, noise of the rate, each row's mean."""
    t = np.asarray(time, dtype=float)
    if t.ndim != 1 or not (np.diff(t) > 0).all():
        raise CompensationError("the times of a run must increase.")
    rows = wave.over_rows(len(t))
    turning, commanded = (np.broadcast_to(np.asarray(x, dtype=float), t.shape) for x in (rate, precession))
    steps = np.broadcast_to(np.asarray(wander, dtype=float), t.shape)[:-1] * np.diff(t)
    wandered = rows.bryan_factor * np.concatenate([[0.0], np.cumsum(steps)])
    theta = _integrate(rows, electronics, t, turning, commanded, electronics.shown(wave.harmonic, angle) + wandered)
    return read_turning(rows, electronics, theta, rate=turning, precession=commanded, time=t)


def read_turning(
    wave: StandingWave, electronics: Electronics, angle: Array, *, rate: ArrayLike = 0.0,
    precession: ArrayLike | None = None, time: Array | None = None,
) -> LoopRun:  # fmt: skip
    """Return the output of settled loops for a wave at measured azimuths (N,), rad, turned by `precession` or as the time shows."""
    turn: ArrayLike = 0.0
    if precession is None:
        if time is None:
            raise CompensationError("a wave that turns needs its commanded turn, or times.")
        turn = np.gradient(angle, time)
    found = settle_rebalance(wave, electronics, rate, angle, turn, precession)
    return found if time is None else replace(found, time=time)


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
    rows: StandingWave, electronics: Electronics, t: Array, rate: Array, command: Array, angle: Array
) -> Array:
    """The azimuth at the rows: what departs from `angle` and the turn that rate and command would make alone.

    Rates, commands and B are straight lines between rows; the steps, one or more between two rows, are those of Simpson
    collocation,  x_m = x + h/24 (5 ẋ + 8 ẋ_m − ẋ'),  x' = x + h/6 (ẋ + 4 ẋ_m + ẋ'),  many of them solved at once in rounds.
    """
    k, n = rows.bryan_factor, rows.harmonic
    shown, arriving, drift = _terms(rows, electronics)
    order = np.arange(len(shown))
    known = np.abs(k * rate) + np.abs(command)
    speed = 2 * n * (known + np.abs(drift).sum(axis=1))
    pieces = np.maximum(np.ceil(np.maximum(speed[1:], speed[:-1]) * np.diff(t) / TURN), 1.0).astype(int)
    first = np.concatenate([[0], np.cumsum(pieces)])
    # nodes and middles of the steps, in rows
    place = np.interp(np.arange(2 * first[-1] + 1), 2 * first, np.arange(len(t)))
    time, turning, commanded, begun = (np.interp(place, np.arange(len(t)), x) for x in (t, k * rate, command, angle))
    speeds = turning + commanded
    swept = begun + np.concatenate([[0.0], np.cumsum(np.diff(time) * ((speeds[1:] + speeds[:-1]) / 2))])
    answers = 2 * n * (np.abs(drift) @ order + known * float((np.abs(shown) + np.abs(arriving)) @ order))
    window = np.cumsum(np.diff(time)[::2] * np.interp(place[1::2], np.arange(len(t)), answers)) // WINDOW
    edges = 2 * np.concatenate([[0], np.flatnonzero(np.diff(window)) + 1, [first[-1]]])
    departed, h = np.zeros(len(time)), time[2::2] - time[:-2:2]
    for begin, end in pairwise(edges):
        here, steps = slice(begin, end + 1), h[begin // 2 : end // 2]
        row = place[here].astype(int)
        part, later = place[here] - row, np.minimum(row + 1, len(t) - 1)
        b = (drift[row] + part[:, None] * (drift[later] - drift[row])).T
        x = np.full(end + 1 - begin, departed[begin])
        for _ in range(MOST):
            e = np.exp(2j * n * (swept[here] + x))
            f = _series(b, e) + _series(shown, e) * turning[here] + _series(arriving, e) * commanded[here]
            f0, fm, f1 = f[:-2:2], f[1::2], f[2::2]
            before, x = x, np.empty_like(x)
            x[::2] = departed[begin] + np.concatenate([[0.0], np.cumsum(steps / 6 * (f0 + 4 * fm + f1))])
            x[1::2] = x[:-2:2] + steps / 24 * (5 * f0 + 8 * fm - f1)
            if np.abs(x - before).max() < SETTLED:
                break
        departed[here] = x
    return np.asarray((swept + departed)[2 * first])


def _series(terms: Complex, e: Complex) -> Array:
    """Re Σ c_j e^j by Horner's rule."""
    found = np.zeros_like(e)
    for c in terms[::-1]:
        found = found * e + c
    return np.asarray(found.real)
