"""Whole angle: the wave precesses freely, or at a commanded rate (self-precession), and its azimuth is the output.

    ψ̇ = n k Ω + ½ Δ(1/τ) sin 2(ψ − ψ_τ) + Δω s cos 2(ψ − ψ_ω) + Re u/a,     ψ = n θ,

s the quadrature that the loop leaves (−q/a), a the amplitude over its command, and u the force across the wave: the commanded turn, and what gain ratios,
skew and phase errors let through from amplitude drive and quadrature control. Amplitude, phase and quadrature loops are
`closed_loop` in the frame of the wave, driven by what the turning wave meets; errors of the electronics are kept to first
order there, and exactly in the measured azimuth.
"""

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from compensation.actuators import require_range
from compensation.arrays import Array
from compensation.closed_loop import ClosedLoop, RowMap
from compensation.controllers import Loops, require_stable
from compensation.electronics import Electronics
from compensation.rebalance import TELL, LoopRun, samples_in_row
from compensation.wave import StandingWave

TURN = 0.1  # largest turn of 2ψ (rad) in one step
Means = tuple[float, float, float, float, float]
"""Means over a step: commands of amplitude and quadrature, the quadrature left, the amplitude, its phase (rad)."""
WITHOUT_RATE = ("amplitude", "phase", "quadrature")


def simulate_whole_angle(
    wave: StandingWave, electronics: Electronics, loops: Loops, time: ArrayLike, *, rate: ArrayLike = 0.0,
    precession: ArrayLike = 0.0, angle: float = 0.0, generator: np.random.Generator | None = None,
    progress: Callable[[float], None] = lambda part: None,
) -> LoopRun:  # fmt: skip
    """Run a gyro in whole-angle mode, its loops settled at the first row; the run's `angle` is measured at rows, all else means to the next."""
    t = np.asarray(time, dtype=float)
    samples = samples_in_row(t, loops)
    require_stable(loops, float(np.max(1 / np.asarray(wave.tau))), WITHOUT_RATE)
    rows = wave.over_rows(len(t))
    turning, commanded = (np.broadcast_to(np.asarray(x, dtype=float), t.shape) for x in (rate, precession))
    course = _Course(rows, electronics, turning, commanded * rows.harmonic)
    loop = close_without_rate(wave, electronics, loops)
    loop.require_stable()
    maps: dict[int, RowMap] = {}
    h = samples * loops.step
    psi = rows.harmonic * angle
    means = (float(rows.decay(angle)[0]), float(rows.quadrature(angle)[0]), 0.0, 1.0, 0.0)
    forcing = course.forcing(0, 0.0, psi, means)
    state = loop.settle(forcing, course.offset(0, psi))
    at = loop.places
    noise = electronics.noise
    readout = math.sqrt(noise.measurement_variance(loops.sampling) * loops.smoothing / (2 - loops.smoothing))
    commands, measured = np.empty((len(t), 4)), np.empty(len(t))
    for n in range(len(t)):
        if n % TELL == 0:
            progress(n / len(t))
        measured[n] = course.measured(psi) + (generator.normal(0, readout) if generator is not None else 0.0)
        pieces = min(samples, math.ceil(2 * abs(course.turn(n, 0.0, psi, means)) * h / TURN) or 1)
        total = np.zeros(4)
        for piece in range(pieces):
            done, part = piece * samples // pieces, (piece + 1) * samples // pieces - piece * samples // pieces
            if part not in maps:
                maps[part] = loop.row(part)
            row, step = maps[part], part * loops.step
            begin, end = done / samples, (done + part) / samples
            shake = row.root @ generator.standard_normal(loop.size) if generator is not None else 0.0
            psi_end = psi + step * course.turn(n, begin, psi, means)
            for _ in range(2):
                first, last = course.forcing(n, begin, psi, means), course.forcing(n, end, psi_end, means)
                centre = course.forcing(n, (begin + end) / 2, (psi + psi_end) / 2, means)
                bow = (2 * centre - first - last) / 3  # gives the straight line the mean of the bent one
                ends = first + bow, last + bow
                offsets = course.offset(n, psi), course.offset(n, psi_end)
                new = row.map @ row.start(state, ends, offsets, step) + shake
                sums, waves = new[at["sum"]] / part, new[at["wave_sum"]] / part
                means = (float(sums[0]), float(sums[3]), float(waves[3]), 1 + float(waves[0]), float(waves[1]))
                middle = (psi + psi_end) / 2
                psi_end = psi + step / 6 * (
                    course.turn(n, begin, psi, means)
                    + 4 * course.turn(n, (begin + end) / 2, middle, means)
                    + course.turn(n, end, psi_end, means)
                )
            if generator is not None:
                psi_end += noise.thermal * math.sqrt(step) * generator.standard_normal()
                pushed = math.sqrt(noise.command_variance(loops.sampling) * step / loops.sampling)
                psi_end += pushed * generator.standard_normal()
            psi, state = psi_end, new
            total += new[at["sum"]]
        commands[n] = total / samples
    use = electronics.actuators.use(course.command, commands[:, 3], commands[:, 0])
    worst = int(np.argmax(np.max([use.across, use.quadrature, use.drive], axis=0)))
    require_range(electronics.actuators.use(course.command[worst], *commands[worst, [3, 0]]), f"at {t[worst]:g} s")
    after = course.measured(psi)
    theta = measured / rows.harmonic
    turned = np.diff(np.append(theta, after / rows.harmonic)) / h
    indicated = (turned - (commanded + np.append(commanded[1:], commanded[-1])) / 2) / rows.bryan_factor
    return LoopRun(t, indicated, commands[:, 3], commands[:, 0], course.start - commands[:, 1], theta)


def close_without_rate(wave: StandingWave, electronics: Electronics, loops: Loops) -> ClosedLoop:
    """Return the loops of amplitude, phase and quadrature closed in the frame of a precessing wave, without errors of the electronics."""
    decay = float(np.mean(1 / np.asarray(wave.tau)))
    ideal = np.eye(2, dtype=complex)
    return ClosedLoop(np.asarray(-decay * ideal, dtype=complex), ideal, ideal, loops, electronics, turning=True)


@dataclass
class _Course:
    """What the turning wave meets, at a fraction of a row and an angle ψ of the plane."""

    rows: StandingWave
    electronics: Electronics
    rate: Array
    command: Array

    def __post_init__(self) -> None:
        rows = self.rows
        n = rows.harmonic
        self.start = float(rows.at_row(0).omega)
        drift = np.asarray(rows.omega) - self.start
        columns = [
            1 / np.asarray(rows.tau),
            drift,
            rows.coupling * self.rate,
            self.command,
            rows.damped(),
            rows.detuned(),
        ]
        self.columns = np.stack(columns, axis=1).tolist()
        self.columns.append(self.columns[-1])
        pickoff, drive = self.electronics.pickoff, self.electronics.drive
        self.pickoff = (pickoff.matrix(n) * cmath.exp(-1j * pickoff.phase)).tolist()
        self.drive = (drive.matrix(n) * cmath.exp(1j * pickoff.phase)).tolist()
        self.stiff = self.electronics.actuators.stiff
        self.ideal = pickoff == type(pickoff)() and drive == type(drive)()

    def values(self, row: int, fraction: float, psi: float) -> tuple[list[float], complex, complex]:
        """1/τ, ω − ω₀, n k Ω and commanded ψ̇, linear between rows; ½Δ(1/τ) e^{2i(ψ_τ − ψ)} and ½Δω e^{2i(ψ_ω − ψ)}."""
        now = self.columns[row]
        if fraction:
            now = [a + fraction * (b - a) for a, b in zip(now, self.columns[row + 1], strict=True)]
        turned = cmath.exp(-2j * psi)
        return [one.real for one in now[:4]], now[4] * turned, now[5] * turned

    def measured(self, psi: float) -> float:
        """The angle ψ that the pick-offs show."""
        if self.ideal:
            return psi
        (xx, xy), (yx, yy) = self.pickoff
        c, s = math.cos(psi), math.sin(psi)
        seen = math.atan2((yx * c + yy * s).real, (xx * c + xy * s).real)
        return psi + (seen - psi + math.pi) % (2 * math.pi) - math.pi

    def forces(self, psi: float, command: float, means: Means) -> tuple[complex, complex]:
        """The forces along and across the wave that commands (along a, across + i quadrature) become; a stiffness is none."""
        along, across = means[0], complex(command, 0.0 if self.stiff else means[1])
        if self.ideal:
            return along, across
        return _through(self.drive, along, across, self.measured(psi), psi)

    def turn(self, row: int, fraction: float, psi: float, means: Means) -> float:
        """ψ̇ (rad/s)."""
        (_, _, coriolis, command), damped, detuned = self.values(row, fraction, psi)
        across = self.forces(psi, command, means)[1]
        forced = 2 * detuned.real * means[2] + across.real + across.imag * means[4]
        return coriolis - damped.imag + forced / means[3]

    def forcing(self, row: int, fraction: float, psi: float, means: Means) -> Array:
        """What drives amplitude, phase and quadrature from their commands (1/s)."""
        (decay, drift, _, command), damped, detuned = self.values(row, fraction, psi)
        along, across = self.forces(psi, command, means)
        # a stiffness couples the patterns against the split
        coupled = -detuned.imag - (means[1] if self.stiff else 0.0)
        return np.array([
            -decay - damped.real + coupled * means[2] + along.real - means[0],
            drift + detuned.real - damped.imag * means[2] + along.imag,
            0.0,
            -coupled * means[3] + across.imag - means[1],
        ])  # fmt: skip

    def offset(self, row: int, psi: float) -> Array:
        """What the pick-offs add to amplitude, phase and quadrature."""
        if self.ideal:
            return np.zeros(4)
        along, across = _through(self.pickoff, 1.0, 0.0, psi, self.measured(psi))
        return np.array([along.real - 1, along.imag, 0.0, across.imag])


def _through(
    channels: list[list[complex]], along: complex, across: complex, at: float, to: float
) -> tuple[complex, complex]:
    """What parts along and across an angle become in channels, along and across another angle."""
    (xx, xy), (yx, yy) = channels
    c, s = math.cos(at), math.sin(at)
    x, y = c * along - s * across, s * along + c * across
    x, y = xx * x + xy * y, yx * x + yy * y
    c, s = math.cos(to), math.sin(to)
    return c * x + s * y, c * y - s * x
