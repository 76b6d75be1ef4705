"""Whole-angle wave over hours with settled loops, without simulating their samples.

The measured azimuth θ obeys

    θ̇ = g(θ) [k (Ω + B(θ)) + c(θ) p],

B the rate that settled loops would have to hold there (`rebalance`), p the commanded turn, c the share of a force across the
wave that arrives there through the drives (over the amplitude that the pick-offs make the loop hold), g how much of a turn the pick-offs show. What the loops make of their own lag,
about the turn of 2 n θ within their response, is left out; `whole_angle` has it.
"""

import math
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
AZIMUTHS, HARMONICS = 16, 5  # azimuths at which B, g and c are taken, and terms of e^{2 i n θ} that are kept of them
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
    n = wave.harmonic
    x, y = _pickoff(electronics, n) @ [math.cos(n * angle), math.sin(n * angle)]
    off = (math.atan2(y, x) - n * angle + math.pi) % (2 * math.pi) - math.pi  # of the measured azimuth, times n
    steps = np.broadcast_to(np.asarray(wander, dtype=float), t.shape)[:-1] * np.diff(t)
    wandered = rows.bryan_factor * np.concatenate([[0.0], np.cumsum(steps)])
    theta = _integrate(rows, electronics, t, turning, commanded, angle + off / n + wandered)
    return read_turning(rows, electronics, theta, rate=turning, precession=commanded, time=t)


def read_turning(
    wave: StandingWave, electronics: Electronics, angle: Array, *, rate: ArrayLike = 0.0,
    precession: ArrayLike | None = None, time: Array | None = None,
) -> LoopRun:  # fmt: skip
    """Return the output of settled loops for a wave at measured azimuths (N,), rad, turned by `precession` or as the time shows."""
    k = wave.bryan_factor
    if precession is None:
        if time is None:
            raise CompensationError("a wave that turns needs its commanded turn, or times.")
        turn = np.gradient(angle, time)
    else:  # the command is linear in the turn
        still, moved = (settle_rebalance(wave, electronics, rate, angle, one).rate for one in (0.0, 1.0))
        turn = (-np.asarray(precession) / k - still) / (moved - still)
    found = settle_rebalance(wave, electronics, rate, angle, turn)
    return replace(found, time=found.time if time is None else time, rate=turn / k + found.rate)


def _pickoff(electronics: Electronics, n: int) -> Array:
    """The pick-offs' plane as the phase loop sees it."""
    return np.asarray((electronics.pickoff.matrix(n) * np.exp(-1j * electronics.pickoff.phase)).real)


def _channels(electronics: Electronics, n: int) -> tuple[Complex, Complex]:
    """Of g − 1, and of g c − 1: the terms over e^{2 i n θ}, from those at even measured azimuths."""
    psi = np.pi * np.arange(AZIMUTHS) / AZIMUTHS
    ahead, across = np.array([np.cos(psi), np.sin(psi)]), np.array([-np.sin(psi), np.cos(psi)])
    pickoff = _pickoff(electronics, n)
    true = np.linalg.solve(pickoff, ahead)
    g = np.linalg.det(pickoff) * (true**2).sum(axis=0)
    drive = (electronics.drive.matrix(n) * np.exp(1j * electronics.pickoff.phase)) @ across
    # of a force, over the amplitude that the pick-offs show as the commanded one
    arrives = (true[0] * drive[1] - true[1] * drive[0]).real / (true**2).sum(axis=0)
    return _terms(g - 1), _terms(g * arrives - 1)


def _drifts(rows: StandingWave, electronics: Electronics) -> Complex:
    """Of B at the rows: the terms, array (N, HARMONICS). B is linear in 1/τ and in both parts of ½Δ(1/τ) and of ½Δω."""
    n, quarter = rows.harmonic, np.pi / (4 * rows.harmonic)
    one, axis = np.repeat(np.eye(5), AZIMUTHS, axis=0)[:, 1:].T, np.tile(np.pi * np.arange(AZIMUTHS) / AZIMUTHS / n, 5)
    unit = StandingWave(
        1.0, 1.0, one[0] + one[1], quarter * one[1], one[2] + one[3], quarter * one[3], n, rows.bryan_factor
    )
    found = _terms(settle_rebalance(unit, electronics, 0.0, axis).rate.reshape(5, AZIMUTHS))
    found[1:] = 2 * (found[1:] - found[0])
    damped, detuned = rows.damped(), rows.detuned()
    return np.asarray(
        np.stack([1 / np.asarray(rows.tau), damped.real, damped.imag, detuned.real, detuned.imag], axis=1) @ found
    )


def _terms(values: Array) -> Complex:
    """Terms c_0 ... of Re Σ c_j e^{2 i j ψ} through values at even ψ in 0 ... π, over the last axis."""
    found = np.fft.rfft(values, axis=-1)[..., :HARMONICS] * (2 / AZIMUTHS)
    found[..., 0] /= 2
    return np.asarray(found)


def _integrate(
    rows: StandingWave, electronics: Electronics, t: Array, rate: Array, command: Array, angle: Array
) -> Array:
    """The azimuth at the rows: what departs from `angle` and the turn that rate and command would make alone.

    Rates, commands and B are straight lines between rows; the steps, one or more between two rows, are those of Simpson
    collocation,  x_m = x + h/24 (5 ẋ + 8 ẋ_m − ẋ'),  x' = x + h/6 (ẋ + 4 ẋ_m + ẋ'),  many of them solved at once in rounds.
    """
    k, n = rows.bryan_factor, rows.harmonic
    shown, arriving = _channels(electronics, n)
    drift = _drifts(rows, electronics)
    order = np.arange(HARMONICS)
    known = np.abs(k * rate) + np.abs(command)
    speed = 2 * n * (known + k * np.abs(drift).sum(axis=1))
    pieces = np.maximum(np.ceil(np.maximum(speed[1:], speed[:-1]) * np.diff(t) / TURN), 1.0).astype(int)
    first = np.concatenate([[0], np.cumsum(pieces)])
    # nodes and middles of the steps, in rows
    place = np.interp(np.arange(2 * first[-1] + 1), 2 * first, np.arange(len(t)))
    time, turning, commanded, begun = (np.interp(place, np.arange(len(t)), x) for x in (t, k * rate, command, angle))
    speeds = turning + commanded
    swept = begun + np.concatenate([[0.0], np.cumsum(np.diff(time) * ((speeds[1:] + speeds[:-1]) / 2))])
    answers = 2 * n * (k * (np.abs(drift) @ order) + known * float((np.abs(shown) + np.abs(arriving)) @ order))
    window = np.cumsum(np.diff(time)[::2] * np.interp(place[1::2], np.arange(len(t)), answers)) // WINDOW
    edges = 2 * np.concatenate([[0], np.flatnonzero(np.diff(window)) + 1, [first[-1]]])
    departed, h = np.zeros(len(time)), time[2::2] - time[:-2:2]
    for begin, end in pairwise(edges):
        here, steps = slice(begin, end + 1), h[begin // 2 : end // 2]
        row = place[here].astype(int)
        part, later = place[here] - row, np.minimum(row + 1, len(t) - 1)
        b = (drift[row] + part[:, None] * (drift[later] - drift[row])).T * k
        x = np.full(end + 1 - begin, departed[begin])
        for _ in range(MOST):
            e = np.exp(2j * n * (swept[here] + x))
            g, feigned = _series(shown, e), _series(b, e)
            f = feigned + g * (feigned + turning[here]) + _series(arriving, e) * commanded[here]
            f0, fm, f1 = f[:-2:2], f[1::2], f[2::2]
            before, x = x, np.empty_like(x)
            x[::2] = departed[begin] + np.concatenate([[0.0], np.cumsum(steps / 6 * (f0 + 4 * fm + f1))])
            x[1::2] = x[:-2:2] + steps / 24 * (5 * f0 + 8 * fm - f1)
            if np.abs(x - before).max() < SETTLED:
                break
        departed[here] = x
    return np.asarray((swept + departed)[2 * first])


def _series(terms: Complex, e: Complex) -> Array:
    """Re Σ c_j e^j by Horner's rule, without the terms that vanish."""
    size = np.abs(terms).reshape(HARMONICS, -1).max(axis=1)
    found = np.zeros_like(e)
    for c in terms[: np.count_nonzero(np.cumsum(size[::-1]) > 1e-17 * size.sum())][::-1]:
        found = found * e + c
    return np.asarray(found.real)
