"""Wave and loops through every cycle of the carrier: pick-off samples, their rounding, demodulation, and rounded commands.

The check of `closed_loop`: nothing is averaged, linearised or small here. Between samples of the loops the two patterns
obey their full equations of motion under forces F cos Φ(t) of the oscillator's phase Φ; demodulation correlates the
pick-off samples of one loop interval, a whole number of cycles, with the oscillator. That mean is half an interval old.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from compensation.controllers import Loops
from compensation.electronics import Electronics
from compensation.errors import CompensationError
from compensation.wave import StandingWave, turn

Real = NDArray[np.float64]
FOLLOWING = 0.2
"""Part of a deviation of the angle that corrects the speed of the frame."""


def oscillate(wave: StandingWave, rate: float) -> Real:
    """Return the matrix (4, 4) of d/dt (x, y, ẋ, ẏ), every cycle of the carrier: `compensation.derivation.oscillator`."""

    def split(azimuth: float) -> Real:
        cosine, sine = np.cos(2 * wave.harmonic * azimuth), np.sin(2 * wave.harmonic * azimuth)
        return np.array([[cosine, sine], [sine, -cosine]])

    damping = 2 / wave.tau * np.eye(2) + wave.damping_split * split(float(wave.damping_axis))
    stiffness = wave.omega**2 * np.eye(2) + wave.omega * wave.frequency_split * split(float(wave.frequency_axis))
    turning = 2 * wave.coupling * rate * np.array([[0.0, -1.0], [1.0, 0.0]])
    return np.asarray(np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, turning - damping]]))


@dataclass(frozen=True)
class CarrierRun:
    """Commands after every sample: `time` (s), `rate` (rad/s), `quadrature`, `decay` (1/s), `omega` (rad/s), `angle` (rad)."""

    time: Real
    rate: Real
    quadrature: Real
    decay: Real
    omega: Real
    angle: Real


def simulate_carrier(
    wave: StandingWave,
    electronics: Electronics,
    loops: Loops,
    seconds: float,
    *,
    rate: float = 0.0,
    rate_from: float = 0.0,
    rate_until: float = np.inf,
    angle: float = 0.0,
    precession: float | None = None,
    readings: int = 16,
    generator: np.random.Generator | None = None,
) -> CarrierRun:
    """Run a gyro through every cycle, starting with the wave at its commanded amplitude and azimuth.

    Parameters
    ----------
    wave : StandingWave
        In numbers.
    electronics, loops
        The delay must be whole samples, the sampling interval about a whole number of cycles (half a per cent).
    seconds : float
    rate, rate_from, rate_until : float
        Rate (rad/s), applied between these times (s).
    precession : float, optional
        Whole angle: the wave is free but for this commanded turn of its azimuth (rad/s); else it is held at `angle`.
    readings : int
        Pick-off samples per cycle, about.
    generator : numpy Generator, optional
        Of the pick-off noise (thermal and drive noise are left out here); without it there is none.
    """
    late, rest = loops.late
    omega, tau = float(wave.omega), float(wave.tau)
    cycles = omega / (2 * np.pi) * loops.step
    if rest > 1e-9 or round(cycles) < 1 or abs(cycles / round(cycles) - 1) > 0.005:
        raise CompensationError("the carrier is followed with whole samples of delay and whole cycles in a sample.")
    count = round(cycles) * readings
    h = loops.step / count
    R, (G_p, G_d) = turn(wave.harmonic * angle), electronics.channels(wave.harmonic)
    K, K_i = np.array([loops.gains(name) for name in loops.NAMES]).T
    noise, limits = electronics.noise, electronics.actuators
    start = omega + float(wave.detuning(angle))
    y = np.concatenate([R[:, 0], np.zeros(2)])
    phase, nu = 0.0, 0.0
    filtered, integral = np.zeros(4), np.array([-1 / tau, 0.0, 0.0, 0.0])
    waiting = [np.array([1 / tau, 0.0, 0.0, 0.0])] * (late + 1)
    maps = {value: _free_motion(oscillate(wave, value), h, count) for value in {0.0, rate}}
    steps = round(seconds * loops.sampling)
    speed = wave.coupling * rate + wave.harmonic * (precession or 0.0)
    out, frame, turned = np.empty((steps, 4)), wave.harmonic * angle, np.empty(steps)
    if precession is not None:
        K[2] = K_i[2] = 0.0
    at = h * np.arange(count + 1)
    for n in range(steps):
        turning = rate if rate_from - 1e-12 <= n * loops.step < rate_until - 1e-12 else 0.0
        command = waiting[-1].copy()
        if precession is not None:
            command[2] = wave.harmonic * precession
        w = start + nu
        A, path_map, quadrature = oscillate(wave, turning), maps[turning], 1j * command[3]
        if limits.quadrature == "stiffness":  # a spring 2ωκ that couples the patterns of the frame
            A = A.copy()
            A[2:, :2] -= 2 * omega * command[3] * R @ np.array([[0.0, 1.0], [1.0, 0.0]]) @ R.T
            path_map, quadrature = _free_motion(A, h, count), 0.0
        force = 2j * w * G_d @ R @ np.array([command[0], command[2] + quadrature])
        x = _response(A, w, force)
        forced = np.real(np.exp(1j * (phase + w * at))[:, None] * np.concatenate([x, 1j * w * x]))
        path = path_map @ (y - forced[0]) + forced
        y = path[-1]
        seen = _pick_off(path[1:], G_p, w)
        if generator is not None and noise.pickoff:
            seen = seen + generator.normal(0, noise.pickoff * np.sqrt(1 / (2 * h)), seen.shape)
        carrier = np.exp(-1j * (phase + w * at[1:]))
        X = R.T @ (2 * carrier @ seen / count)
        if precession is not None:  # the frame follows the wave that is seen, and goes ahead of it to the next interval
            ahead = float(np.arctan2(X[1].real, X[0].real))
            X = turn(-ahead) @ X
            turned[n] = (frame + ahead) / wave.harmonic
            speed += FOLLOWING * ahead / loops.step
            frame += ahead + speed * loops.step
            R = turn(frame)
        else:
            turned[n] = angle
        phase += w * loops.step
        error = np.array([X[0].real - 1, X[0].imag, X[1].real, X[1].imag])
        if noise.adc_step:
            error = np.round(error / noise.adc_step) * noise.adc_step
        filtered = filtered + loops.smoothing * (error - filtered)
        wanted = -(K * filtered + integral)
        new = wanted.copy()
        if limits.quadrature == "force":
            new[2:] *= min(1.0, limits.force / max(np.hypot(*wanted[2:]), 1e-300))
        integral = np.where(new == wanted, integral + K_i * loops.step * filtered, integral)
        if noise.dac_step:
            new[[0, 2, 3]] = np.round(new[[0, 2, 3]] / noise.dac_step) * noise.dac_step
        out[n] = new
        waiting = [new, *waiting[:-1]]
        nu = -waiting[-1][1]
    t = np.asarray(loops.step * np.arange(1, steps + 1), dtype=float)
    return CarrierRun(t, -out[:, 2] / wave.coupling, out[:, 3], out[:, 0], start - out[:, 1], turned)


def _free_motion(A: Real, h: float, count: int) -> Real:
    """Return e^{A j h}, j = 0 … count: (count + 1, 4, 4)."""
    one = expm(A * h)
    powers = [np.eye(4)]
    for _ in range(count):
        powers.append(one @ powers[-1])
    return np.array(powers)


def _response(A: Real, omega: float, force: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the complex amplitude of the motion that Re{F e^{iωt}} keeps up: (A₂₁ + iω A₂₂ + ω²) x = −F."""
    return np.asarray(np.linalg.solve(A[2:, :2] + 1j * omega * A[2:, 2:] + omega**2 * np.eye(2), -force))


def _pick_off(path: Real, channels: NDArray[np.complex128], omega: float) -> Real:
    """Return what the pick-offs show: gains act on the displacement, phase errors through its quarter cycle −ẋ/ω."""
    return np.asarray(path[:, :2] @ channels.real.T + path[:, 2:] @ channels.imag.T / omega)
