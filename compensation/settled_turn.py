"""Whole-angle wave over hours with settled loops, without simulating their samples.

The measured azimuth θ obeys

    θ̇ = g(θ) [k (Ω + B(θ)) + c(θ) p],

B the rate that settled loops would have to hold there (`rebalance`), p the commanded turn, c the share of a force across the
wave that arrives there through the drives (over the amplitude that the pick-offs make the loop hold), g how much of a turn the pick-offs show. What the loops make of their own lag,
about the turn of 2 n θ within their response, is left out; `whole_angle` has it.
"""

import cmath
import math
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from compensation.arrays import Array, Complex
from compensation.electronics import Electronics
from compensation.errors import CompensationError
from compensation.rebalance import LoopRun, settle_rebalance
from compensation.wave import PHYSICAL, StandingWave

TURN = 0.3  # largest turn of 2 n θ (rad) in one step
AZIMUTHS, HARMONICS = 16, 5  # azimuths at which B, g and c are taken, and terms of e^{2 i n θ} that are kept of them
TIMES = 200  # times at which B is taken; it is linear between them


def turn_settled(
    wave: StandingWave,
    electronics: Electronics,
    time: ArrayLike,
    *,
    rate: ArrayLike = 0.0,
    precession: ArrayLike = 0.0,
    angle: float = 0.0,
) -> LoopRun:
    """Return the output of settled loops for a precessing wave, without noise.

    `rate` and `precession`, the commanded turn against the shell (rad/s), are linear between rows; `angle` is the true
    one at the start. Of the run `angle` is measured, unwrapped, and `rate` what is not commanded of the turn over k.
    """
    t = np.asarray(time, dtype=float)
    if t.ndim != 1 or not (np.diff(t) > 0).all():
        raise CompensationError("the times of a run must increase.")
    rows = wave.over_rows(len(t))
    turning, commanded = (np.broadcast_to(np.asarray(x, dtype=float), t.shape) for x in (rate, precession))
    n = wave.harmonic
    x, y = _pickoff(electronics, n) @ [math.cos(n * angle), math.sin(n * angle)]
    off = (math.atan2(y, x) - n * angle + math.pi) % (2 * math.pi) - math.pi  # of the measured azimuth, times n
    theta = _integrate(rows, electronics, t, turning, commanded, angle + off / n)
    return read_turning(rows, electronics, theta, rate=turning, precession=commanded, time=t)


def read_turning(
    wave: StandingWave,
    electronics: Electronics,
    angle: Array,
    *,
    rate: ArrayLike = 0.0,
    precession: ArrayLike | None = None,
    time: Array | None = None,
) -> LoopRun:
    """Return the output of settled loops for a wave at measured azimuths, array (N,), rad.

    Unless `precession` is given, it is what turns the wave through these azimuths over the `time`.
    """
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
    """Of g, and of g c: the terms over e^{2 i n θ}, from those at even measured azimuths."""
    psi = np.pi * np.arange(AZIMUTHS) / AZIMUTHS
    ahead, across = np.array([np.cos(psi), np.sin(psi)]), np.array([-np.sin(psi), np.cos(psi)])
    pickoff = _pickoff(electronics, n)
    true = np.linalg.solve(pickoff, ahead)
    g = np.linalg.det(pickoff) * (true**2).sum(axis=0)
    drive = (electronics.drive.matrix(n) * np.exp(1j * electronics.pickoff.phase)) @ across
    # of a force, over the amplitude that the pick-offs show as the commanded one
    arrives = (true[0] * drive[1] - true[1] * drive[0]).real / (true**2).sum(axis=0)
    return _terms(g), _terms(g * arrives)


def _terms(values: Array) -> Complex:
    """Terms c_0 ... of Re Σ c_j e^{2 i j ψ} through values at even ψ in 0 ... π, over the last axis."""
    found = np.fft.rfft(values, axis=-1)[..., :HARMONICS] * (2 / AZIMUTHS)
    found[..., 0] /= 2
    return np.asarray(found)


def _value(terms: Complex, e: Complex) -> Array:
    return np.asarray(np.real(sum(c * e**j for j, c in enumerate(terms))))


def _integrate(
    rows: StandingWave, electronics: Electronics, t: Array, rate: Array, command: Array, angle: float
) -> Array:
    """The azimuth at the rows: Runge-Kutta steps of what departs from the turn that rate and command would make alone."""
    from scipy.interpolate import CubicHermiteSpline

    k, n = rows.bryan_factor, rows.harmonic
    shown, arriving = _channels(electronics, n)
    picked = np.unique(np.linspace(0, len(t) - 1, min(len(t), TIMES)).round().astype(int))
    azimuths = np.pi * np.arange(AZIMUTHS) / AZIMUTHS / n
    many = {name: np.repeat(np.asarray(getattr(rows, name))[picked], AZIMUTHS) for name in PHYSICAL}
    there = StandingWave(harmonic=n, bryan_factor=k, **many)
    held = settle_rebalance(there, electronics, 0.0, np.tile(azimuths, len(picked)))
    drift = _terms(held.rate.reshape(-1, AZIMUTHS))
    known = k * rate + command
    swept = np.concatenate([[0.0], np.cumsum((known[1:] + known[:-1]) / 2 * np.diff(t))])
    strayed = k * float(np.abs(drift).sum(axis=1).max())
    speed = 2 * n * (np.abs(k * rate) + np.abs(command) + strayed)
    phase = np.concatenate([[0.0], np.cumsum(np.maximum(speed[1:], speed[:-1]) * np.diff(t))])
    count = max(math.ceil(phase[-1] / TURN), min(len(t) - 1, TIMES))
    # even in the phase, and in time where nothing turns
    measure = phase / (phase[-1] or 1.0) + 1e-3 * (t - t[0]) / (t[-1] - t[0])
    steps = np.interp(np.linspace(0.0, measure[-1], count + 1), measure, t)
    halves = np.sort(np.concatenate([steps, (steps[1:] + steps[:-1]) / 2]))
    at = [np.interp(halves, t, values).tolist() for values in (rate, command, swept)]
    parts = [np.interp(halves, t[picked], one.real) + 1j * np.interp(halves, t[picked], one.imag) for one in drift.T]
    drifts = np.array(parts).T.tolist()
    g, gc = shown.tolist(), arriving.tolist()
    pure = abs(g[0] - 1) + sum(map(abs, g[1:])) + abs(gc[0] - 1) + sum(map(abs, gc[1:])) < 1e-12

    def stray(place: int, departed: float) -> float:
        """Of the departure: its rate of change."""
        e = cmath.exp(2j * n * (angle + at[2][place] + departed))
        b = _series(drifts[place], e)
        if pure:
            return k * b
        omega, p = at[0][place], at[1][place]
        return float(_series(g, e) * k * (omega + b) + _series(gc, e) * p - k * omega - p)

    departed, slopes = [0.0], [stray(0, 0.0)]
    for step in range(count):
        place, h, y = 2 * step, steps[step + 1] - steps[step], departed[-1]
        one = slopes[-1]
        two = stray(place + 1, y + h / 2 * one)
        three = stray(place + 1, y + h / 2 * two)
        four = stray(place + 2, y + h * three)
        departed.append(y + h / 6 * (one + 2 * two + 2 * three + four))
        slopes.append(stray(place + 2, departed[-1]))
    return np.asarray(angle + swept + CubicHermiteSpline(steps, departed, slopes)(t))


def _series(terms: list[complex], e: complex) -> float:
    """Re Σ c_j e^j by Horner's rule."""
    found = 0j
    for c in reversed(terms):
        found = found * e + c
    return float(found.real)
