"""Force to rebalance: the wave is held at its azimuth, and the force that holds it is the rate.

Settled, and to first order in the errors of the electronics, the rate loop indicates

    Ω + Δ(1/τ)/(2 n k) sin 2n(θ − θ_τ) + [(n β − ½ δ sin 2nθ + ½ κ cos 2nθ)/τ − ε ½ Δω sin 2n(θ − θ_ω)] / (n k):

damping anisotropy, the amplitude's drive seen by the rate axis, and quadrature seen through the phase error, with β the turn of
the drives less that of the pick-offs, δ, κ and ε the sums of gain ratio, skew and phase error of both. Where quadrature is nulled by a stiffness the last
term is absent. Loops that need more than the actuators give do not hold the wave: said before anything is simulated; a rate that is
beyond the range for a while turns the wave by n k ∫(Ω − Ω_max) dt, until it is back or lost.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compensation.actuators import require_range
from compensation.applied_rate import AppliedRate
from compensation.arrays import Array
from compensation.closed_loop import ClosedLoop
from compensation.controllers import Loops, require_stable
from compensation.electronics import Electronics
from compensation.errors import CompensationError
from compensation.samples import require_regular
from compensation.wave import PHYSICAL, StandingWave

LOST = 0.3  # node over antinode at which a wave that its force cannot hold has left its azimuth
TELL = 500  # rows from one word on the progress to the next
ALIKE = 0.01
"""Part of 1/τ, and of n k per rad/s, within which rows share one matrix; what drives the wave is exact in every row."""


@dataclass(frozen=True)
class LoopRun:
    """Output of the loops by rows, means: `rate` (rad/s), `quadrature` (1/s, force over 2ω and amplitude: ½ Δω sin 2n(θ − θ_ω)).

    `decay` 1/τ (1/s), `omega` (rad/s), `angle` (rad, azimuth); `limited` rows had an actuator at its limit.
    """

    time: Array
    rate: Array
    quadrature: Array
    decay: Array
    omega: Array
    angle: Array
    limited: int = 0


def simulate_rebalance(
    wave: StandingWave, electronics: Electronics, loops: Loops, time: ArrayLike, *, rate: ArrayLike | AppliedRate = 0.0,
    angle: ArrayLike = 0.0, generator: np.random.Generator | None = None,
    progress: Callable[[float], None] = lambda part: None,
) -> LoopRun:  # fmt: skip
    """Run a gyro in force-to-rebalance mode, settled where the commanded `angle` (rad) changes; `rate` (rad/s) of rows is linear between."""
    t = np.asarray(time, dtype=float)
    samples = samples_in_row(t, loops)
    require_stable(loops, float(np.max(1 / np.asarray(wave.tau))))
    cut = cut_rows(wave.over_rows(len(t)), t, samples, loops, rate)
    rows, count = cut.rows, len(cut.row)
    azimuth = np.broadcast_to(np.asarray(angle, dtype=float), t.shape)[cut.row]
    forcing = np.empty((count, 4))
    start = float(rows.omega[0] + rows.detuning(azimuth)[0])  # type: ignore[index]
    forcing[:, 0] = -rows.decay(azimuth)
    forcing[:, 1] = rows.omega + rows.detuning(azimuth) - start
    forcing[:, 2] = rows.coupling * (cut.begin + rows.drift(azimuth))
    forcing[:, 3] = -rows.quadrature(azimuth)
    later = np.minimum(np.arange(count) + 1, count - 1)
    later = np.where(azimuth[later] == azimuth, later, np.arange(count))
    ends = forcing[later]
    ends[:, 2] += rows.coupling * (cut.end - cut.begin[later])
    sums, at_limit = np.empty((count, 4)), np.zeros(count, dtype=bool)
    state, limits = None, electronics.actuators
    for block in _alike(rows, cut.begin, azimuth):
        middle = (block.start + block.stop) // 2
        here = rows.at_row(middle)
        loop, offset = close_loops(here, electronics, loops, float(cut.begin[middle]), float(azimuth[middle]))
        if block.start == 0 or azimuth[block.start] != azimuth[block.start - 1]:
            loop.require_stable()
            state = loop.settle(forcing[block.start], offset)
            held = state[loop.places["sent"]][:4]
            require_range(limits.use(held[2], held[3], held[0]), f"at {t[cut.row[block.start]]:g} s")
        assert state is not None
        maps, at = {size: loop.row(size) for size in set(cut.samples[block].tolist())}, loop.places
        draws = generator.standard_normal((block.stop - block.start, loop.size)) if generator is not None else None
        for n in range(block.start, block.stop):
            if n % TELL == 0:
                progress(n / count)
            size = int(cut.samples[n])
            begun = maps[size].start(state, (forcing[n], ends[n]), (offset, offset), size * loops.step)
            state = maps[size].map @ begun
            if draws is not None:
                state += maps[size].root @ draws[n - block.start]
            if limits.finite and limits.is_near(np.array([state[at["sum"]] / size, state[at["sent"]][:4]])):
                state, at_limit[n] = loop.follow(begun, size, generator)
                if at_limit[n] and abs(state[at["wave"]][2]) > LOST:
                    raise CompensationError(
                        f"at {t[cut.row[n]]:g} s control of the wave is lost: the force is at its limit and cannot balance a rate of"
                        f" {np.degrees(max(cut.begin[n], cut.end[n], key=abs)):.4g} °/s; lower the rate or its duration, or raise the range."
                    )
            sums[n] = state[at["sum"]]
    commands = np.add.reduceat(sums, cut.first) / samples
    limited = int(np.logical_or.reduceat(at_limit, cut.first).sum())
    rate_said = -commands[:, 2] / rows.coupling
    return LoopRun(t, rate_said, commands[:, 3], commands[:, 0], start - commands[:, 1], azimuth[cut.first], limited)


@dataclass(frozen=True)
class CutRows:
    """Rows of a run cut where the applied rate bends: the wave and the rate (rad/s) where pieces begin, the rate where they end, their rows and samples."""

    rows: StandingWave
    begin: Array
    end: Array
    row: NDArray[np.intp]
    part: Array  # of the row, before the piece
    samples: NDArray[np.intp]

    @property
    def first(self) -> NDArray[np.intp]:
        """The pieces with which rows begin."""
        return np.flatnonzero(np.diff(self.row, prepend=-1))


def cut_rows(rows: StandingWave, time: Array, samples: int, loops: Loops, rate: ArrayLike | AppliedRate) -> CutRows:
    """Cut rows of so many samples of the loops."""
    edges, begin, end = AppliedRate.of(rate, time).in_samples(len(time), samples, float(time[0]), loops.step)
    row, part = edges[:-1] // samples, edges[:-1] % samples / samples
    return CutRows(rows if len(row) == len(time) else rows.between(row, part), begin, end, row, part, np.diff(edges))


def settle_rebalance(
    wave: StandingWave, electronics: Electronics, rate: ArrayLike = 0.0, angle: ArrayLike = 0.0,
    turn: ArrayLike = 0.0, precession: ArrayLike | None = None,
) -> LoopRun:  # fmt: skip
    """Return the output of settled loops, without noise, for any number of rows at once: exact in the electronics' errors.

    Integral control shows the pick-offs their command, C_p (P, S) = (1, 0) = C_p m; amplitude a, rate r, quadrature q and ν,
    how far the oscillator is from the mean frequency, are what that takes:

        C_d (a, r + iq) − iν m = n θ̇ C_p⁻¹ (0, 1) − A m,

    two complex equations; a stiffness acts as iq (m₂, m₁) in the place of C_d (0, iq).
    `turn` is the θ̇ (rad/s) at which the rate's command turns the wave, as the pick-offs show it; given a commanded `precession` p
    instead, r = n p and θ̇ is found. The run's rate is (θ̇ − r/n)/k.
    """
    values = [np.asarray(getattr(wave, name), dtype=float) for name in PHYSICAL]
    shape = np.broadcast_shapes(*(np.shape(x) for x in (*values, rate, angle)), (1,))
    rows = wave.over_rows(shape[0])
    given = turn if precession is None else precession
    turning, azimuth, given = (np.broadcast_to(np.asarray(x, dtype=float), shape) for x in (rate, angle, given))
    A = rows.envelope(turning, azimuth)
    # what the electronics make of a wave depends on its azimuth alone
    angles, at = np.unique(azimuth, return_inverse=True)
    pickoff, drive = electronics.channels(rows.harmonic, angles)
    moved, across = np.moveaxis(np.linalg.inv(pickoff), -1, 0)
    nulling = moved[:, ::-1] if electronics.actuators.stiff else drive[:, :, 1]
    known, sought = across, drive[:, :, 1]
    if precession is not None:
        known, sought = -sought, -known
    acting = np.stack([drive[:, :, 0], sought, 1j * nulling, -1j * moved], axis=-1)
    answer = np.linalg.inv(np.concatenate([acting.real, acting.imag], axis=1))[at]
    needed = wave.harmonic * given[:, None] * known[at] - np.einsum("nij,nj->ni", A, moved[at])
    decay, found, quadrature, nu = np.einsum("nij,nj->in", answer, np.concatenate([needed.real, needed.imag], axis=1))
    ahead = given - found / rows.harmonic if precession is None else found / rows.harmonic - given
    return LoopRun(
        np.arange(shape[0], dtype=float), ahead / rows.bryan_factor, quadrature, decay, rows.omega + nu, azimuth.copy()
    )


def samples_in_row(time: Array, loops: Loops) -> int:
    """Return how many samples of the loops make one row, or say that they do not."""
    step = require_regular(time, "the simulation of the loops")
    samples = round(step * loops.sampling)
    if samples < 1 or abs(samples - step * loops.sampling) > 1e-6 * samples:
        raise CompensationError(f"a row of {step:g} s is not a whole number of the loops' samples of {loops.step:g} s; change one of them.")  # fmt: skip
    return samples


def _alike(rows: StandingWave, rate: Array, angle: Array) -> Iterator[slice]:
    """Cut the rows where the averaged dynamics have changed by more than `ALIKE`, and where the azimuth moves."""
    scale, damped, detuned = 1 / np.asarray(rows.tau), 2 * rows.damped(), 2 * rows.detuned()
    columns = np.stack([scale, damped.real, damped.imag, detuned.real, detuned.imag, rows.coupling * rate], axis=1)
    width = np.concatenate([np.full(5, ALIKE * scale[0]), [ALIKE * rows.coupling]])
    cell = np.column_stack([np.floor(columns / width + 0.5), angle])
    edges = np.flatnonzero(np.any(np.diff(cell, axis=0) != 0, axis=1)) + 1
    for begin, end in zip([0, *edges], [*edges, len(rate)], strict=True):
        yield slice(int(begin), int(end))


def close_loops(
    wave: StandingWave, electronics: Electronics, loops: Loops, rate: float, angle: float
) -> tuple[ClosedLoop, Array]:
    """Return the loops closed about a wave held at an azimuth (rad), and what the pick-offs' errors add to their reading."""
    settled = settle_rebalance(wave, electronics, rate, angle)
    A = wave.envelope(rate, angle) - 1j * (settled.omega[0] - float(wave.omega)) * np.eye(2)
    if electronics.actuators.stiff:
        A = A + 1j * settled.quadrature[0] * np.array([[0.0, 1.0], [1.0, 0.0]])
    pickoff, drive = electronics.channels(wave.harmonic, angle)
    seen = pickoff[:, 0]
    offset = np.array([seen[0].real - 1, seen[0].imag, seen[1].real, seen[1].imag])
    return ClosedLoop(A, pickoff, drive, loops, electronics), offset
