"""Free decay of a standing wave seen by two pick-offs: amplitudes, modes, axes.

With z = (X, Y) the complex amplitudes along cos nθ and sin nθ (`compensation.wave`, no rate and no force),

    ż = M z + iκ (2 |z|² z + (z·z) z*)/3 − γ |z|² z,    M = iδ − 1/τ − C·S + i W·S,    C·S = [[C₁, C₂], [C₂, −C₁]],

C = ½ Δ(1/τ) (cos 2nθ_τ, sin 2nθ_τ), W = ½ Δω (cos 2nθ_ω, sin 2nθ_ω), δ the mean frequency against the carrier of the
demodulation. κ is a cubic stiffness of a body of revolution, the average of |x|² x: it shifts a straight line by κ|z|² and turns an
ellipse, which a split makes of any line; γ is a cubic damping.
"""

from dataclasses import dataclass, fields

import numpy as np
import scipy

from compensation.arrays import Array, Complex


@dataclass(frozen=True)
class Decay:
    """The rates of a free decay, all in 1/s (rad/s), about a carrier."""

    detuning: float  # detuning, decay: δ and 1/τ
    decay: float
    # damping_cos, damping_sin, stiffness_cos, stiffness_sin: C₁, C₂ and W₁, W₂; the stiffness pair alone is used
    # of a single channel with two modes
    damping_cos: float = 0.0
    damping_sin: float = 0.0
    stiffness_cos: float = 0.0
    stiffness_sin: float = 0.0
    hardening: float = 0.0  # hardening, thickening: κ and γ per squared amplitude
    thickening: float = 0.0

    @property
    def mean(self) -> complex:
        """Half the trace of M."""
        return complex(-self.decay, self.detuning)

    @property
    def matrix(self) -> Complex:
        """M without its mean: symmetric and without a trace."""
        a = complex(-self.damping_cos, self.stiffness_cos)
        b = complex(-self.damping_sin, self.stiffness_sin)
        return np.array([[a, b], [b, -a]])

    @property
    def rates(self) -> Complex:
        """The two eigenvalues of M, the higher frequency first."""
        a, b = self.matrix[0]
        s = np.sqrt(a * a + b * b)
        found = np.array([self.mean + s, self.mean - s])
        return found if found[0].imag >= found[1].imag else found[::-1]

    def vector(self, names: tuple[str, ...]) -> Array:
        """The named rates as an array."""
        return np.array([getattr(self, name) for name in names])


NAMES = tuple(field.name for field in fields(Decay))
ONE_MODE = ("detuning", "decay")
MOST_TURNS = 600.0  # radians within a window, beyond which a trial point is not followed
TWO_MODES = (*ONE_MODE, "damping_cos", "damping_sin", "stiffness_cos", "stiffness_sin")


def propagate(decay: Decay, time: Array, start: Complex) -> Complex:
    """Return z (channels, rows) of the linear decay (κ = γ = 0) at the times (s) after the start, where it is `start`."""
    return differentiate(decay, time, start)[0]


def differentiate(decay: Decay, time: Array, start: Complex) -> tuple[Complex, dict[str, Complex], list[Complex]]:
    """Return z of the linear decay, its derivatives by the rates, and by each start amplitude.

    exp(M t) = e^{mt} (c + A r), A = [[a, b], [b, −a]], s² = a² + b², c = cosh st, r = sinh(st)/s; dc/ds² = t r/2,
    dr/ds² = (t c − r)/2s².
    """
    common = np.exp(decay.mean * time)
    if start.size == 1:
        z = start[:, None] * common
        return z, {"detuning": 1j * time * z, "decay": -time * z}, [common[None, :]]
    A = decay.matrix
    a, b = A[0]
    q = a * a + b * b
    s = np.sqrt(q + 0j)
    small = np.abs(s * time) < 1e-2
    up, square = np.exp(s * time), q * time**2
    c = (up + 1 / up) / 2
    r = np.where(small, time * (1 + square / 6 * (1 + square / 20)), (up - 1 / up) / (2 * (s or 1.0)))
    bend = np.where(small, time**3 / 6 * (1 + square / 10), (time * c - r) / (2 * (q or 1.0)))
    units = [common * (c * one[:, None] + r * (A @ one)[:, None]) for one in np.eye(2, dtype=complex)]
    z = start[0] * units[0] + start[1] * units[1]
    by_q = common * (time * r / 2 * start[:, None] + bend * (A @ start)[:, None])
    along = common * r
    by_a = 2 * a * by_q + along * np.array([start[0], -start[1]])[:, None]
    by_b = 2 * b * by_q + along * start[::-1, None]
    by = {
        "detuning": 1j * time * z, "decay": -time * z, "damping_cos": -by_a, "stiffness_cos": 1j * by_a,
        "damping_sin": -by_b, "stiffness_sin": 1j * by_b,
    }  # fmt: skip
    return z, by, units


def swing(decays: "list[Decay]", time: Array, starts: Complex) -> Complex:
    """Return z (decays, channels, rows) of decays with κ and γ from their start amplitudes, integrated in the same steps.

    Without the common phase δt + κ∫|z|² dt, κ turns a pattern (x, y) by ⅔κ S, S = Im(x* y) the area of its ellipse.
    """
    channels = starts.shape[1]
    turn, loss, decay = (np.array([getattr(one, k) for one in decays]) for k in ("hardening", "thickening", "decay"))
    a, b = np.array([one.matrix[0] for one in decays]).T if channels == 2 else (0j * turn, 0j * turn)
    first = np.zeros((3, len(decays)), complex)
    first[:channels] = starts.T
    most = 4 * np.sum(np.abs(starts) ** 2, axis=1) + 1e-300

    def law(_: float, state: Complex) -> Complex:
        x, y = state.reshape(first.shape)[:2]
        energy = x.real**2 + x.imag**2 + y.real**2 + y.imag**2
        free = energy < most  # what grows is no decay, and is not followed
        rate, spin = decay + loss * energy, 2 / 3 * turn * (x.real * y.imag - x.imag * y.real)
        return np.concatenate(
            [free * ((a - rate) * x + (b - spin) * y), free * ((b + spin) * x - (a + rate) * y), energy]
        )

    size, end = float(np.max(np.abs(starts))), float(time[-1]) or 1.0
    fastest = float(np.max(np.abs([a, b, decay, turn * size**2, loss * size**2])))
    if not fastest * abs(end) < MOST_TURNS:
        return np.full((len(decays), channels, time.size), np.nan + 0j)
    solved = scipy.integrate.solve_ivp(law, (0.0, end), first.ravel(), "DOP853", time, rtol=3e-8, atol=3e-8 * size)
    if solved.y.shape[1] < time.size:  # a trial point that grows without limit
        return np.full((len(decays), channels, time.size), np.nan + 0j)
    states = solved.y.reshape(*first.shape, -1)
    phase = np.array([one.detuning for one in decays])[:, None] * time + turn[:, None] * states[2].real
    return np.asarray(np.moveaxis(states[:channels], 0, 1) * np.exp(1j * phase)[:, None, :])
