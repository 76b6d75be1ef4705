"""Maximum-likelihood fit of a free decay to complex amplitudes, with its Cramér–Rao bound.

The noise of each channel's amplitudes is white and complex, so least squares of the real and imaginary parts are the maximum
likelihood, and σ² (JᵀJ)⁻¹ is the bound that no unbiased estimate passes. What is derived of the rates (frequencies, Q, axes)
gets its interval from draws of that normal distribution, because a split near zero and an axis bend.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from compensation.arrays import Array, Complex
from compensation.errors import CompensationError
from compensation.ringdown.envelope import Envelope
from compensation.ringdown.model import NAMES, ONE_MODE, TWO_MODES, Decay, propagate
from compensation.samples import block_means

COARSE = 256  # rows of the averaged envelope on which starting points are looked for


@dataclass(frozen=True)
class DecayFit:
    """A decay fitted to an envelope."""

    envelope: Envelope
    decay: Decay  # decay, start: Decay, array (channels,), rates, and the complex amplitudes at the first row
    start: Complex
    # the rates that were fitted; the real and imaginary parts of `start` follow them in `covariance`
    names: tuple[str, ...]
    covariance: Array  # array, Cramér–Rao bound of rates and start at the noise found (times `widening`²)
    noise: Array  # array (channels,), standard deviation of a complex row, √⟨|n|²⟩
    residual: Complex  # array (channels, rows), data minus model
    widening: float = 1.0  # factor on the bound where the residual is not white
    summed: bool = False  # whether one channel sees the sum of the two modes

    @property
    def one_mode(self) -> bool:
        """Whether a single frequency and decay were fitted."""
        return "damping_cos" not in self.names

    @property
    def cost(self) -> float:
        """−2 ln of the likelihood with the noise at its most probable, but for a constant."""
        return float(2 * self.residual.shape[1] * np.sum(np.log(np.mean(np.abs(self.residual) ** 2, axis=1))))

    def sd(self, name: str) -> float:
        """Standard deviation of a fitted rate."""
        k = self.names.index(name)
        return float(np.sqrt(self.covariance[k, k]))

    def draw(self, count: int, generator: np.random.Generator) -> list[Decay]:
        """Draws of the rates from their normal distribution."""
        size = len(self.names)
        mean = self.decay.vector(self.names)
        draws = generator.multivariate_normal(mean, self.covariance[:size, :size], count, method="eigh")
        fixed = {name: getattr(self.decay, name) for name in NAMES if name not in self.names}
        return [Decay(**dict(zip(self.names, map(float, one), strict=True)), **fixed) for one in draws]


def fit_decay(
    envelope: Envelope, *, extra: Sequence[str] = (), modes: int = 2, starts: Sequence[Decay] = ()
) -> DecayFit:
    """Fit the decay of one or two modes, with `extra` rates beyond the linear ones, to one or two channels."""
    z = envelope.values
    summed = z.shape[0] == 1 and modes == 2
    linear = ONE_MODE if modes == 1 else TWO_MODES if not summed else (*ONE_MODE, "damping_cos", "stiffness_cos")
    names = (*linear, *extra)
    time = envelope.time - envelope.time[0]
    if time.size < 2 * (len(names) + 4):
        raise CompensationError(
            f"{time.size} rows are too few for a decay of {modes} mode(s); record longer or faster."
        )
    best: DecayFit | None = None
    for start in starts or find_starts(envelope, modes):
        found = _fit_from(envelope, time, names, start, summed)
        if best is None or found.cost < best.cost:
            best = found
    assert best is not None
    return best


def find_starts(envelope: Envelope, modes: int) -> list[Decay]:
    """Return starting points: exponentials of the averaged envelope (matrix pencil), and the two largest spectral lines."""
    time, z = envelope.time - envelope.time[0], envelope.values
    rates = [_pencil(time, z, modes), _lines(time, z, modes)]
    return [_from_rates(time, z, one) for one in rates if one is not None]


def _fit_from(envelope: Envelope, time: Array, names: tuple[str, ...], guess: Decay, summed: bool) -> DecayFit:
    z = envelope.values
    channels = 2 if summed else z.shape[0]
    fixed = {name: 0.0 for name in NAMES if name not in names}
    size = float(np.sqrt(np.mean(np.abs(z) ** 2))) or 1.0
    span, most = float(time[-1]) or 1.0, 1e9 * size  # a trial point's growth ends there
    scale = np.array(
        [
            1 / (span * size**2 if name in ("hardening", "thickening") else span**2 if name == "chirp" else span)
            for name in names
        ]
    )

    def of(point: Array) -> tuple[Decay, Complex]:
        rates = dict(zip(names, (point[: len(names)] * scale).tolist(), strict=True))
        parts = point[len(names) :] * size
        return Decay(**rates, **fixed), parts[:channels] + 1j * parts[channels:]

    def model(point: Array) -> Complex:
        with np.errstate(over="ignore", invalid="ignore"):
            found = propagate(of(point)[0], time, of(point)[1])
        found = found.sum(axis=0, keepdims=True) if summed else found
        if np.max(np.abs(found)) < most:  # nor is it no number
            return found
        real, imaginary = (np.clip(np.nan_to_num(part, nan=most), -most, most) for part in (found.real, found.imag))
        return np.asarray(real + 1j * imaginary)

    first = _amplitudes(time, z, guess, summed)
    point = np.concatenate([guess.vector(names) / scale, first.real / size, first.imag / size])
    weight = np.full(z.shape[0], size)
    for _ in range(z.shape[0]):  # the second time with each channel's own noise

        def residuals(point: Array, weight: Array = weight) -> Array:
            return _flatten((model(point) - z) / weight[:, None])

        solved = scipy.optimize.least_squares(
            residuals, point, method="lm", x_scale="jac", xtol=1e-12, ftol=1e-12, gtol=1e-12, max_nfev=12 * point.size
        )
        point = np.asarray(solved.x)
        r = z - model(point)
        freedom = max(1.0, r.shape[1] - point.size / (2 * z.shape[0]))
        noise = np.sqrt(np.sum(np.abs(r) ** 2, axis=1) / freedom)
        weight = np.maximum(noise, 1e-12 * size)
    # each real part has half of the complex variance
    steps = np.diag(1e-6 * np.maximum(1.0, np.abs(point)))
    around = [_flatten((model(point + h) - model(point - h)) / weight[:, None]) / (2 * h.max()) for h in steps]
    J = np.stack(around, axis=1)
    bound = 0.5 * np.linalg.pinv(J.T @ J, rcond=1e-15, hermitian=True)
    units = np.concatenate([scale, np.full(2 * channels, size)])
    decay, start = of(point)
    return DecayFit(
        envelope,
        decay,
        start,
        names,
        (bound * np.outer(units, units)).astype(np.float64),
        noise.astype(np.float64),
        r,
        1.0,
        summed,
    )


def _flatten(values: Complex) -> Array:
    return np.concatenate([values.real.ravel(), values.imag.ravel()])


def _amplitudes(time: Array, z: Complex, decay: Decay, summed: bool) -> Complex:
    """Return the start amplitudes that fit best, by linear least squares."""
    plain = Decay(**{**{name: getattr(decay, name) for name in NAMES}, "hardening": 0.0, "thickening": 0.0})
    count = 2 if summed else z.shape[0]
    columns = np.stack([propagate(plain, time, one) for one in np.eye(count, dtype=complex)], axis=-1)
    if summed:
        columns = columns.sum(axis=0, keepdims=True)
    return np.asarray(np.linalg.lstsq(columns.reshape(-1, count), z.ravel(), rcond=None)[0])


def _from_rates(time: Array, z: Complex, rates: Complex) -> Decay:
    """Return the decay with these eigenvalues and the axes that their amplitudes have."""
    mean = complex(np.mean(rates))
    if rates.size == 1:
        return Decay(mean.imag, max(-mean.real, 0.1 / time[-1]))
    half = complex(rates[0] - rates[1]) / 2
    a, b = half, 0j
    if z.shape[0] == 2:
        basis = np.exp(np.outer(time, rates))
        parts = np.linalg.lstsq(basis, z.T, rcond=None)[0]  # rows: modes; columns: channels
        u, v = parts / np.maximum(np.linalg.norm(parts, axis=1, keepdims=True), 1e-300)
        turned = v[::-1] * np.array([1, -1])  # what lies across the second is the first, seen again
        shape = u if np.linalg.norm(parts[0]) >= np.linalg.norm(parts[1]) else turned
        square = shape @ shape
        if abs(square) > 1e-3:
            a = half * (shape[0] ** 2 - shape[1] ** 2) / square
            b = half * 2 * shape[0] * shape[1] / square
    return Decay(mean.imag, max(-mean.real, 0.1 / time[-1]), -a.real, -b.real, a.imag, b.imag)


def _pencil(time: Array, z: Complex, modes: int) -> Complex | None:
    """Return the exponents of the averaged rows: eigenvalues of a shift on the signal space of a Hankel matrix."""
    count = min(COARSE, time.size // 2)
    size = time.size // count
    rows = block_means(z, size)[:, :count]
    step = float(time[size] - time[0])
    length = count // 3
    hankel = np.concatenate([np.lib.stride_tricks.sliding_window_view(row, length) for row in rows], axis=0)
    space = np.linalg.svd(hankel, full_matrices=False)[2][:modes].T
    poles = np.linalg.eigvals(np.linalg.lstsq(space[:-1], space[1:], rcond=None)[0])
    if not np.all(np.isfinite(poles)) or np.any(np.abs(poles) < 1e-12):
        return None
    return np.asarray(np.log(poles) / step)


def _lines(time: Array, z: Complex, modes: int) -> Complex | None:
    """Return the exponents of the largest spectral lines: the second is looked for in what the first leaves."""
    step = float(np.median(np.diff(time)))
    grid = np.rint(time / step).astype(int)
    rest = np.zeros((z.shape[0], int(grid[-1]) + 1), dtype=complex)
    rest[:, grid] = z
    energy = np.sum(np.abs(rest) ** 2, axis=0)
    half = np.flatnonzero(np.cumsum(energy) >= 0.63 * np.sum(energy))[0] + 1
    decay = 1 / (2 * half * step)
    t = step * np.arange(rest.shape[1])
    found: list[complex] = []
    for _ in range(modes):
        power = np.sum(np.abs(np.fft.fft(rest, 2 * rest.shape[1], axis=1)) ** 2, axis=0)
        at = int(np.argmax(power))
        found.append(complex(-decay, 2 * np.pi * float(np.fft.fftfreq(power.size, step)[at])))
        basis = np.exp(np.outer(t, np.array(found)))
        rest[:, grid] = z - (basis @ np.linalg.lstsq(basis[grid], z.T, rcond=None)[0]).T[:, grid]
    return np.array(found)
