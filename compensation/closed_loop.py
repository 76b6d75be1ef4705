"""The four loops closed around the averaged wave, sample by sample, and many samples in one exact step.

In the frame of the commanded wave and over its amplitude, antinode and node are P = 1 + p, S (complex), and

    (ṗ, Ṡ) = A (p, S) + C_d c + w,   y = C_p (1 + p, S) + offset + noise,

A the averaged dynamics (`wave`), w what drives the wave from its command: decay, rate, damping and frequency split.
Between samples the plant is propagated by its matrix exponential with w linear in time, so one sample is a linear map;
a row of the record is that map to the power of the samples in it; where a command comes near the limit of
its actuator, the row is followed sample by sample, each command is what the actuator gives, and the integral of a channel at its limit waits. Nothing is lost by the long step, and the noise of the row, with
all that the loops remember of it, is drawn from its exact covariance.

Channels, in this order: amplitude, phase, rate, quadrature. The phase command is a frequency of the oscillator.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from compensation.arrays import Array, Complex
from compensation.controllers import Loops
from compensation.electronics import Electronics
from compensation.errors import CompensationError

FOUR = 4


@dataclass(frozen=True)
class ClosedLoop:
    """One sample of wave and loops as a linear map of the state, and its powers."""

    A: Complex  # complex (2, 2), 1/s, averaged dynamics in the frame of the wave
    pickoff: Complex  # pickoff, drive: complex (2, 2), channels in the frame of the wave
    drive: Complex
    loops: Loops
    electronics: Electronics  # for the noise; its channels are those above
    turning: bool = False  # the wave turns freely (whole angle): the frame follows it, there is no rate loop

    @cached_property
    def places(self) -> dict[str, slice]:
        """Places of wave (p, S), filtered, integral, sent commands (newest first), forcing w and offset with slopes, and sums over the row."""
        late = self.loops.late[0] + 1
        sizes = {"wave": 4, "filtered": 4, "integral": 4, "sent": 4 * late, "forcing": 4, "forcing_slope": 4}
        sizes |= {"offset": 4, "offset_slope": 4, "sum": 4, "wave_sum": 4}
        places, start = {}, 0
        for name, size in sizes.items():
            places[name] = slice(start, start + size)
            start += size
        return places

    @property
    def kept(self) -> NDArray[np.intp]:
        """Places of what the loops remember from sample to sample: wave, filtered, integral, sent."""
        at = self.places
        kept = np.r_[at["wave"], at["filtered"], at["integral"], at["sent"]]
        if self.turning:
            kept = kept[~np.isin(kept, [at[name].start + 2 for name in ("wave", "filtered", "integral")])]
        return np.asarray(kept, dtype=np.intp)

    @property
    def size(self) -> int:
        """Length of the state."""
        return int(self.places["wave_sum"].stop)

    @cached_property
    def sample(self) -> tuple[Array, Array]:
        """The map of one sample, and the covariance of the noise that it adds."""
        T, (late, rest) = self.loops.step, self.loops.late
        at, N = self.places, self.size
        rows = np.eye(N)

        def part(name: str) -> Array:
            return rows[at[name]]

        A, C_p = real_form(self.A), real_form(self.pickoff)
        active = np.ones(FOUR)
        if self.turning:
            active[2] = 0.0
            A[2, :] = A[:, 2] = 0.0
        drive = self.drive_map
        K = np.array([self.loops.gains(name)[0] for name in Loops.NAMES]) * active
        K_i = np.array([self.loops.gains(name)[1] for name in Loops.NAMES]) * active
        smoothing = self.loops.smoothing
        seen = C_p @ part("wave") + part("offset")
        filtered = part("filtered") + smoothing * (seen - part("filtered"))
        command = -(K[:, None] * filtered + part("integral"))
        sent = part("sent")
        newest = np.vstack([command, sent])  # c_n, c_{n−1}, …
        first, second = newest[4 * (late + 1) : 4 * (late + 2)], newest[4 * late : 4 * (late + 1)]
        whole, early = _held_maps(A, T), _held_maps(A, T - rest)
        before = scipy.linalg.expm(A * (T - rest)) @ _held_maps(A, rest)[1]
        wave = whole[0] @ part("wave") + whole[1] @ part("forcing") + whole[2] @ part("forcing_slope")
        wave += before @ drive @ first + early[1] @ drive @ second
        F = np.zeros((N, N))
        F[at["wave"]] = wave
        F[at["filtered"]] = filtered
        F[at["integral"]] = part("integral") + (K_i * T)[:, None] * filtered
        F[at["sent"]] = newest[: sent.shape[0]]
        for name in ("forcing", "offset"):
            F[at[name]] = part(name) + T * part(f"{name}_slope")
            F[at[f"{name}_slope"]] = part(f"{name}_slope")
        F[at["sum"]] = part("sum") + command
        F[at["wave_sum"]] = part("wave_sum") + part("wave")
        noise = self.electronics.noise
        reading = np.zeros((N, FOUR))
        reading[at["filtered"]] = smoothing * np.eye(FOUR)
        reading[at["integral"]] = np.diag(K_i * T * smoothing)
        reading[at["sum"]] = np.diag(-K * smoothing)
        reading[at["sent"].start : at["sent"].start + 4] = np.diag(-K * smoothing)
        if late == 0:  # a command acts in the sample that made it
            reading[at["wave"]] = early[1] @ drive @ np.diag(-K * smoothing)
        force = np.zeros((N, FOUR))
        force[at["wave"]] = whole[1] @ drive
        heat = np.zeros((N, FOUR))
        heat[at["wave"]] = np.diag(active) if self.turning else np.eye(FOUR)
        limits = self.electronics.actuators
        finer = limits.stiffness / limits.force if limits.stiff and limits.finite else 1.0  # steps of the stiffness
        covariance = (
            noise.measurement_variance(self.loops.sampling) * reading @ reading.T
            + noise.command_variance(self.loops.sampling) * force @ np.diag([1.0, 0.0, active[2], finer**2]) @ force.T
            + noise.thermal**2 * T * heat @ heat.T
        )
        return F, covariance

    @cached_property
    def drive_map(self) -> Array:
        """The wave's four rates for the four commands: forces through the channels, phase and stiffness directly."""
        drive = real_form(self.drive)
        drive[:, 1] = [0.0, 1.0, 0.0, 0.0]
        if self.electronics.actuators.stiff:
            drive[:, 3] = [0.0, 0.0, 0.0, 1.0]
        if self.turning:
            drive[2, :] = 0.0
        return drive

    @cached_property
    def _sample_root(self) -> Array:
        return square_root(self.sample[1])

    @cached_property
    def _at_once(self) -> Array | None:
        """What a command does to the wave in the sample that made it; None where every command comes later."""
        late, rest = self.loops.late
        if late:
            return None
        return np.asarray(_held_maps(real_form(self.A), self.loops.step - rest)[1] @ self.drive_map)

    def follow(self, state: Array, samples: int, generator: np.random.Generator | None) -> tuple[Array, bool]:
        """Return the state after a row, each command limited and its integral then held (anti-windup), and whether any was."""
        at, F, limits = self.places, self.sample[0], self.electronics.actuators
        newest = slice(at["sent"].start, at["sent"].start + FOUR)
        limited = False
        for _ in range(samples):
            before, state = state, F @ state
            if generator is not None:
                state = state + self._sample_root @ generator.standard_normal(self.size)
            lost = limits.give(state[newest]) - state[newest]
            if np.any(lost):
                limited = True
                state[newest] += lost
                state[at["sum"]] += lost
                waits = at["integral"].start + np.flatnonzero(lost)
                state[waits] = before[waits]
                if self._at_once is not None:
                    state[at["wave"]] += self._at_once @ lost
        return state, limited

    def require_stable(self) -> None:
        """Raise when the loops together, with the errors of the electronics, do not come to rest."""
        F = self.sample[0][np.ix_(self.kept, self.kept)]
        radius = float(np.max(np.abs(np.linalg.eigvals(F))))
        if radius >= 1:
            raise CompensationError(
                "the loops together are unstable, although each alone is not: the electronics' errors couple them"
                f" (growth {np.log(radius) * self.loops.sampling:.3g} 1/s); lower the bandwidths or the errors."
            )

    def settle(self, forcing: Array, offset: Array) -> Array:
        """Return the state at rest under a constant forcing and measurement offset."""
        at, F = self.places, self.sample[0]
        state = np.zeros(self.size)
        state[at["forcing"]], state[at["offset"]] = forcing, offset
        kept, given = self.kept, np.r_[at["forcing"], at["offset"]]
        left = np.eye(len(kept)) - F[np.ix_(kept, kept)]
        state[kept] = np.linalg.solve(left, F[np.ix_(kept, given)] @ state[given])
        return state

    def walk(self, channel: str) -> float:
        """Return the random walk (1/√s) of a command's integral: white noise of density S(0), which means over long times show."""
        F, noise = self.sample
        kept, place = self.kept, self.places["sum"].start + Loops.NAMES.index(channel)
        answer = np.zeros(self.size)  # of the command's sum to what enters the state once
        answer[place] = 1.0
        answer[kept] = np.linalg.solve((np.eye(len(kept)) - F[np.ix_(kept, kept)]).T, F[place, kept])
        return float(np.sqrt(answer @ noise @ answer * self.loops.step))

    def answer_step(self, channel: str, samples: int, count: int) -> tuple[Array, Array]:
        """Return times (s) and what a channel commands against a forcing of 1 that sets in at 0, every `samples` samples."""
        at, k = self.places, Loops.NAMES.index(channel)
        state, F = np.zeros(self.size), self.row(samples).map
        state[at["forcing"].start + k] = 1.0
        found = np.zeros(count + 1)
        for n in range(1, count + 1):
            state[at["sum"]] = state[at["wave_sum"]] = 0.0
            state = F @ state
            found[n] = -state[at["sent"].start + k]
        return np.asarray(self.loops.step * samples * np.arange(count + 1.0)), found

    def row(self, samples: int) -> "RowMap":
        """Return the map of a row of this many samples."""
        F, noise = self.sample
        total, covariance = np.eye(self.size), np.zeros_like(F)
        power, spread, left = F, noise, samples
        while left:
            if left & 1:
                covariance = power @ covariance @ power.T + spread
                total = power @ total
            left >>= 1
            if left:
                spread = power @ spread @ power.T + spread
                power = power @ power
        return RowMap(self, samples, total, covariance)


@dataclass(frozen=True)
class RowMap:
    """The map of a row of `samples` samples, and the covariance of the noise that gathers in it."""

    loop: ClosedLoop
    samples: int
    map: Array
    covariance: Array

    @cached_property
    def root(self) -> Array:
        """A square root of the covariance."""
        return square_root(self.covariance)

    def start(self, state: Array, forcing: tuple[Array, Array], offset: tuple[Array, Array], seconds: float) -> Array:
        """Return the state at the start of a row: sums empty, forcing and offset linear from one end to the other."""
        at, begun = self.loop.places, state.copy()
        begun[at["sum"]] = begun[at["wave_sum"]] = 0.0
        for name, (begin, end) in (("forcing", forcing), ("offset", offset)):
            begun[at[name]] = begin
            begun[at[f"{name}_slope"]] = (end - begin) / seconds
        return begun


def real_form(matrix: Complex) -> Array:
    """Return a complex (2, 2) matrix as the real (4, 4) one of (Re, Im) pairs."""
    form = np.zeros((FOUR, FOUR))
    form[0::2, 0::2] = form[1::2, 1::2] = matrix.real
    form[1::2, 0::2] = matrix.imag
    form[0::2, 1::2] = -matrix.imag
    return form


def square_root(covariance: Array) -> Array:
    """Return R with R Rᵀ = covariance."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.clip(values, 0.0, None)))


def _held_maps(A: Array, time: float) -> tuple[Array, Array, Array]:
    """e^{At}, ∫ e^{As} ds and ∫ (t − s) e^{As} ds: free motion, a constant and a linear input."""
    n = len(A)
    block = np.zeros((3 * n, 3 * n))
    block[:n, :n] = A
    block[:n, n : 2 * n] = block[n : 2 * n, 2 * n :] = np.eye(n)
    E = scipy.linalg.expm(block * time)
    return E[:n, :n], E[:n, n : 2 * n], E[:n, 2 * n :]
