"""Free decay of a standing wave seen by two pick-offs: amplitudes, modes, axes.

With z = (X, Y) the complex amplitudes along cos nθ and sin nθ (`compensation.wave`, no rate and no force),

    ż = M z + iκ (2 |z|² z + (z·z) z*)/3 − γ |z|² z,    M = iδ − 1/τ − C·S + i W·S,    C·S = [[C₁, C₂], [C₂, −C₁]],

C = ½ Δ(1/τ) (cos 2nθ_τ, sin 2nθ_τ), W = ½ Δω (cos 2nθ_ω, sin 2nθ_ω), δ the mean frequency against the carrier of the
demodulation. κ is a cubic stiffness of a body of revolution, the average of |x|² x: it shifts a straight line by κ|z|² and turns an
ellipse, which a split makes of any line; γ is a cubic damping.
"""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from compensation.arrays import Array, Complex


@dataclass(frozen=True)
class Decay:
    """The rates of a free decay, all in 1/s (rad/s), about a carrier; those of draws are arrays."""

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
        return -self.decay + 1j * self.detuning

    @property
    def matrix(self) -> Complex:
        """M without its mean: symmetric and without a trace."""
        a = complex(-self.damping_cos, self.stiffness_cos)
        b = complex(-self.damping_sin, self.stiffness_sin)
        return np.array([[a, b], [b, -a]])

    @property
    def rates(self) -> Complex:
        """The two eigenvalues of M, the higher frequency first; of draws a row of them each."""
        a, b = -self.damping_cos + 1j * self.stiffness_cos, -self.damping_sin + 1j * self.stiffness_sin
        s = np.sqrt(a * a + b * b)
        s = np.where(s.imag < 0, -s, s)
        return np.array([self.mean + s, self.mean - s])

    def vector(self, names: tuple[str, ...]) -> Array:
        """The named rates as an array."""
        return np.array([getattr(self, name) for name in names])


NAMES = tuple(field.name for field in fields(Decay))
ONE_MODE = ("detuning", "decay")
BENT, ROUNDS, CLOSE = 4.0, 30, 1e-8  # radians by which κ turns in one go; iterations, and the change that ends them
NODES = 6  # a radian
MOST_TURNS = 600.0  # radians within a window, beyond which a trial point is not followed
MOST_HALVINGS = 60  # of a window, within which κ turns far: each may be of a wave that grows
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


@np.errstate(all="ignore")  # of trial points that grow
def swing(decays: "list[Decay]", time: Array, starts: Complex, halvings: int = 0) -> Complex:
    """Return z (decays, channels, rows) of decays with κ and γ from their start amplitudes (decays, channels).

    With e = |z|² and P = ∫e dt of z without γ, z = e^{(iδ−1/τ)t} (1+2γP)^{−½} e^{iκΦ} u, Φ = ln(1+2γP)/2γ: what all patterns share.
    Beside it κ turns a pattern by ⅔κS, S = Im(z₁* z₂) the area of its ellipse: u = e^{At} w with

        ẇ = ⅔κS e^{−At} J e^{At} w,  J = [[0, −1], [1, 0]],

    by Picard's iteration over the whole time, in halves of it where κ turns far.
    """
    channels, end = starts.shape[1], float(time[-1]) or 1.0
    turn, loss, decay, detuning = (
        np.array([[getattr(one, k)] for one in decays]) for k in ("hardening", "thickening", "decay", "detuning")
    )
    a, b = np.array([one.matrix[0] for one in decays]).T[:, :, None] if channels == 2 else np.zeros((2, *turn.shape))
    s, energy = np.sqrt(a * a + b * b + 0j), np.sum(np.abs(starts) ** 2, axis=1)[:, None]
    turns = float(np.max(np.abs([s, decay + 0j, loss * energy + 0j]))) * abs(end)
    rate = np.where(decay == 0, 1e-300, 2 * decay)
    bent = float(np.max(np.abs(turn * energy * np.expm1(-rate * end) / rate)))
    if not turns + bent < MOST_TURNS or halvings > MOST_HALVINGS:  # near the time at which it grows without limit
        return np.full((len(decays), channels, time.size), np.nan + 0j)
    if channels == 2 and bent > BENT:
        first = time[np.abs(time) < abs(end) / 2]
        early = swing(decays, np.append(first, end / 2), starts, halvings + 1)
        late = swing(decays, time[first.size :] - end / 2, early[:, :, -1], halvings + 1)
        return np.concatenate([early[:, :, :-1], late], axis=2)

    def waves(x: Array) -> tuple[Complex, Complex]:
        """The c and r of e^{Ax} = c + A r."""
        up = np.exp(s * x)
        return (up + 1 / up) / 2, np.where(np.abs(s * x) < 1e-4, x, (up - 1 / up) / np.where(s == 0, 1.0, 2 * s))

    def along(c: Complex, r: Complex, w: Complex) -> Complex:
        return np.asarray([c * w[0] + r * (a * w[0] + b * w[1]), c * w[1] + r * (b * w[0] - a * w[1])])

    x = np.linspace(0.0, end, max(96, int(NODES * turns)))
    c, r = waves(x)
    first_w: Complex = np.zeros((2, len(decays), 1), dtype=np.complex128)
    first_w[:channels, :, 0] = starts.T
    w = np.repeat(first_w, x.size, axis=2)
    fall = np.exp(-2 * decay * x)
    for _ in range(ROUNDS):
        u = along(c, r, w)
        power = fall * np.sum(u.real**2 + u.imag**2, axis=0)
        P = _sum_up(power, x[1])
        spin = 2 / 3 * turn * fall / (1 + 2 * loss * P) * (u[0].real * u[1].imag - u[0].imag * u[1].real)
        old, slope = w, along(c, -r, np.asarray([-spin * u[1], spin * u[0]], dtype=np.complex128))
        w = first_w + _sum_up(slope, x[1])
        if not np.max(np.abs(w - old)) > CLOSE * np.max(np.abs(starts)):
            break
    known, slopes = np.concatenate([w, P[None]]), np.concatenate([slope, power[None]]) * end
    if not (np.all(1 + 2 * loss * P > 0) and np.all(np.isfinite(known)) and np.all(np.isfinite(slopes))):
        return np.full((len(decays), channels, time.size), np.nan + 0j)  # a trial point that grows without limit
    told = np.asarray(scipy.interpolate.CubicHermiteSpline(x / end, known, slopes, axis=-1)(time / end))
    held = told[2].real
    left = 2 * loss * held
    phase = turn * np.where(np.abs(left) < 1e-9, held, np.log1p(left) / np.where(loss == 0, 1.0, 2 * loss))
    z = along(*waves(time), told[:2]) * np.exp((1j * detuning - decay) * time + 1j * phase) / np.sqrt(1 + left)
    return np.asarray(np.moveaxis(z[:channels], 0, 1))


def _sum_up(values: NDArray[Any], step: float) -> NDArray[Any]:
    """Integral from the first of even values, along the last axis, by the cubic through the four around each step."""
    f = np.moveaxis(values, -1, 0)
    f = np.concatenate([[4 * f[0] - 6 * f[1] + 4 * f[2] - f[3]], f, [4 * f[-1] - 6 * f[-2] + 4 * f[-3] - f[-4]]])
    cells = step / 24 * (13 * (f[1:-2] + f[2:-1]) - f[:-3] - f[3:])
    return np.moveaxis(np.concatenate([0 * cells[:1], np.cumsum(cells, axis=0)]), 0, -1)
