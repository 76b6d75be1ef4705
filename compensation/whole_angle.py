"""Whole angle: the wave precesses freely, or at a commanded rate (self-precession), and its azimuth is the output.

    (Ṗ, Ṡ) = R(−ψ) C_p [A C_p⁻¹ R(ψ) (P, S) + C_d R(ψ) (a, r + iq)] − ψ̇ J (P, S),     Re S = 0 gives ψ̇,     ψ = n θ,

P and S antinode and node as the pick-offs show them, A the averaged dynamics (`wave`), r = n times the commanded turn. Amplitude, phase and
quadrature loops are `closed_loop` in this frame without errors of the electronics; how what the turning wave meets departs
from that drives them, exact but for products of what varies within a step.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from compensation.actuators import require_range
from compensation.applied_rate import AppliedRate
from compensation.arrays import Array
from compensation.closed_loop import ClosedLoop, RowMap
from compensation.controllers import Loops, require_stable
from compensation.electronics import Electronics
from compensation.rebalance import TELL, CutRows, LoopRun, cut_rows, samples_in_row, settle_rebalance
from compensation.wave import StandingWave

TURN = 0.1  # largest turn of 2ψ (rad) in one step
Means = tuple[complex, complex, float, float, float]
"""Means over a step: antinode P and node S, commands of amplitude, phase and quadrature."""
WITHOUT_RATE = ("amplitude", "phase", "quadrature")


def simulate_whole_angle(
    wave: StandingWave, electronics: Electronics, loops: Loops, time: ArrayLike, *, rate: ArrayLike | AppliedRate = 0.0,
    precession: ArrayLike = 0.0, angle: float = 0.0, generator: np.random.Generator | None = None,
    progress: Callable[[float], None] = lambda part: None,
) -> LoopRun:  # fmt: skip
    """Run a gyro in whole-angle mode, its loops settled at the first row; the run's `angle` is measured at rows, all else means to the next."""
    t = np.asarray(time, dtype=float)
    samples = samples_in_row(t, loops)
    require_stable(loops, float(np.max(1 / np.asarray(wave.tau))), WITHOUT_RATE)
    cut = cut_rows(wave.over_rows(len(t)), t, samples, loops, rate)
    rows, commanded = cut.rows, np.broadcast_to(np.asarray(precession, dtype=float), t.shape)
    course = _Course(cut, electronics, np.interp(cut.row + cut.part, np.arange(len(t)), commanded) * rows.harmonic)
    loop = close_without_rate(wave, electronics, loops)
    loop.require_stable()
    maps: dict[int, RowMap] = {}
    h = samples * loops.step
    angle, offset = electronics.shown(rows.harmonic, angle), np.zeros(4)
    psi = rows.harmonic * angle
    settled = settle_rebalance(rows.at_row(0), electronics, cut.begin[0], angle, precession=commanded[0])
    decay, late, quadrature = settled.decay[0], course.start - settled.omega[0], settled.quadrature[0]
    means = 1.0 + 0j, 0j, float(decay), float(late), float(quadrature)
    state = loop.settle(course.forcing(0, 0.0, psi, means), offset)
    at = loop.places
    noise = electronics.noise
    readout = math.sqrt(noise.measurement_variance(loops.sampling) * loops.smoothing / (2 - loops.smoothing))
    totals, measured = np.zeros((len(cut.row), 4)), np.empty(len(cut.row))
    for n in range(len(cut.row)):
        if n % TELL == 0:
            progress(n / len(cut.row))
        if cut.part[n] == 0:
            measured[n] = psi + (generator.normal(0, readout) if generator is not None else 0.0)
        size = int(cut.samples[n])
        pieces = min(size, math.ceil(2 * abs(course.turn(n, 0.0, psi, means)) * size * loops.step / TURN) or 1)
        for piece in range(pieces):
            done, part = piece * size // pieces, (piece + 1) * size // pieces - piece * size // pieces
            if part not in maps:
                maps[part] = loop.row(part)
            row, step = maps[part], part * loops.step
            begin, end = done / size, (done + part) / size
            shake = row.root @ generator.standard_normal(loop.size) if generator is not None else 0.0
            psi_end = psi + step * course.turn(n, begin, psi, means)
            for _ in range(2):
                first, last = course.forcing(n, begin, psi, means), course.forcing(n, end, psi_end, means)
                centre = course.forcing(n, (begin + end) / 2, (psi + psi_end) / 2, means)
                bow = (2 * centre - first - last) / 3  # gives the straight line the mean of the bent one
                ends = first + bow, last + bow
                new = row.map @ row.start(state, ends, (offset, offset), step) + shake
                amplitude, phase, _, quadrature = (new[at["sum"]] / part).tolist()
                antinode, late, _, left = (new[at["wave_sum"]] / part).tolist()
                means = 1 + antinode + 1j * late, 1j * left, amplitude, phase, quadrature
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
            totals[n] += new[at["sum"]]
    commands = np.add.reduceat(totals, cut.first) / samples
    across = commanded * rows.harmonic
    use = electronics.actuators.use(across, commands[:, 3], commands[:, 0])
    worst = int(np.argmax(np.max([use.across, use.quadrature, use.drive], axis=0)))
    require_range(electronics.actuators.use(across[worst], *commands[worst, [3, 0]]), f"at {t[worst]:g} s")
    theta = measured[cut.first] / rows.harmonic
    turned = np.diff(np.append(theta, psi / rows.harmonic)) / h
    indicated = (turned - (commanded + np.append(commanded[1:], commanded[-1])) / 2) / rows.bryan_factor
    return LoopRun(t, indicated, commands[:, 3], commands[:, 0], course.start - commands[:, 1], theta)


def close_without_rate(wave: StandingWave, electronics: Electronics, loops: Loops) -> ClosedLoop:
    """Return the loops of amplitude, phase and quadrature closed in the frame of a precessing wave, without errors of the electronics."""
    decay = float(np.mean(1 / np.asarray(wave.tau)))
    ideal = np.eye(2, dtype=complex)
    return ClosedLoop(np.asarray(-decay * ideal, dtype=complex), ideal, ideal, loops, electronics, turning=True)


@dataclass
class _Course:
    """What the turning wave meets, at a fraction of a piece of a row and an angle ψ of the plane."""

    cut: CutRows
    electronics: Electronics
    command: Array

    def __post_init__(self) -> None:
        rows = self.cut.rows
        self.start = float(rows.at_row(0).omega)
        growth = 1j * (np.asarray(rows.omega) - self.start) - 1 / np.asarray(rows.tau)
        damped, detuned = rows.damped(), rows.detuned()
        even, odd = 1j * detuned.real - damped.real, 1j * detuned.imag - damped.imag
        columns = np.stack([growth, rows.coupling * self.cut.begin, self.command, even, odd], axis=1)
        ends = np.concatenate([columns[1:], columns[-1:]])
        ends[:, 1] = rows.coupling * self.cut.end
        self.columns, self.ends = columns.tolist(), ends.tolist()
        pickoff, drive = self.electronics.channels(rows.harmonic)
        back = np.linalg.inv(pickoff)
        J, S_even, S_odd = np.array([[0, -1], [1, 0]]), np.diag([1, -1]), np.array([[0, 1], [1, 0]])
        self.seen = [(pickoff @ one @ back).ravel().tolist() for one in (J, S_even, S_odd)]
        self.drive = (pickoff @ drive).ravel().tolist()
        self.stiff = self.electronics.actuators.stiff
        self.mean = float(np.mean(1 / np.asarray(rows.tau)))  # of `close_without_rate`

    def growth(self, row: int, fraction: float, psi: float, means: Means) -> tuple[complex, complex]:
        """Growth of antinode and node as the pick-offs show them, C_p (A C_p⁻¹ (P, S) + C_d c), in the frame of ψ."""
        now = self.columns[row]
        if fraction:
            now = [a + fraction * (b - a) for a, b in zip(now, self.ends[row], strict=True)]
        P, S, amplitude, phase, quadrature = means
        grown, coriolis, command, even, odd = now
        c, s = math.cos(psi), math.sin(psi)
        across = command
        if self.stiff:  # iq couples the patterns of the frame
            even, odd = even - 2j * c * s * quadrature, odd + 1j * (c * c - s * s) * quadrature
        else:
            across += 1j * quadrature
        a, b, d, e = (coriolis * j + even * g + odd * h for j, g, h in zip(*self.seen, strict=True))
        f, g, h, i = self.drive
        x, y, u, v = c * P - s * S, s * P + c * S, c * amplitude - s * across, s * amplitude + c * across
        x, y = a * x + b * y + f * u + g * v, d * x + e * y + h * u + i * v
        own = grown + 1j * phase
        return c * x + s * y + own * P, c * y - s * x + own * S

    def turn(self, row: int, fraction: float, psi: float, means: Means) -> float:
        """ψ̇ (rad/s), which keeps the node's part in phase at 0."""
        return self.growth(row, fraction, psi, means)[1].real / means[0].real

    def forcing(self, row: int, fraction: float, psi: float, means: Means) -> Array:
        """What drives amplitude, phase and quadrature from their commands (1/s), beside their own decay and the commands as they are."""
        along, across = self.growth(row, fraction, psi, means)
        P, S, amplitude, phase, quadrature = means
        turn = across.real / P.real
        along += turn * S + self.mean * (P - 1)
        return np.array([
            along.real - amplitude,
            along.imag - phase,
            0.0,
            across.imag - turn * P.imag + self.mean * S.imag - quadrature,
        ])  # fmt: skip
