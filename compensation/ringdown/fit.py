"""Maximum-likelihood fit of a free decay to complex amplitudes, with its Cramér–Rao bound.

    data = z(t) e^{iφ(t)} + Σ tones + noise

z is the decay of `model`, φ a slow drift of all frequencies (polynomials without a straight line, so that δ stays the mean with the
power of the decay as weight), a tone a line of constant amplitude. The noise of each channel is white and complex, so least squares of the real and
imaginary parts are the maximum likelihood, and σ² (JᵀJ)⁻¹ is the bound that no unbiased estimate passes. What is derived of the
rates (frequencies, Q, axes) gets its interval from draws of that normal distribution, because a split near zero and an axis bend.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from compensation.arrays import Array, Complex
from compensation.errors import CompensationError
from compensation.ringdown.envelope import Envelope
from compensation.ringdown.model import ONE_MODE, TWO_MODES, Decay, differentiate, propagate, swing
from compensation.ringdown.starts import find_starts

CURVED = ("hardening", "thickening")
STEP = 1e-5
MOST = 1e9  # times the rms of the data, beyond which a trial point is none


@dataclass(frozen=True)
class Terms:
    """What a fit has: one mode or two, rates beyond the linear ones, polynomials of the drift, tones."""

    modes: int = 2
    curved: tuple[str, ...] = ()
    drift: int = 0
    tones: int = 0


@dataclass(frozen=True)
class Guess:
    """Where a fit starts, and what it finds: rates, drift (rad), tones (rad/s) and their complex amplitudes (tones, channels)."""

    decay: Decay
    start: Complex | None = None
    drift: tuple[float, ...] = ()
    tones: tuple[float, ...] = ()
    sizes: tuple[tuple[complex, ...], ...] = ()


@dataclass(frozen=True)
class DecayFit:
    """A decay fitted to an envelope."""

    envelope: Envelope
    terms: Terms
    found: Guess
    # the rates that were fitted; the real and imaginary parts of `start` follow them in `covariance`
    names: tuple[str, ...]
    covariance: Array  # array, Cramér–Rao bound of the rates at the noise found (times `widening`²)
    noise: Array  # array (channels,), standard deviation of a complex row, √⟨|n|²⟩
    residual: Complex  # array (channels, rows), data minus model
    jacobian: Array  # array (2 channels rows, values), of the weighted residual
    widening: float = 1.0  # factor on the bound where the residual is not white
    summed: bool = False  # whether one channel sees the sum of the two modes

    @property
    def decay(self) -> Decay:
        """The rates."""
        return self.found.decay

    @property
    def start(self) -> Complex:
        """The complex amplitudes at the first row."""
        assert self.found.start is not None
        return self.found.start

    @property
    def one_mode(self) -> bool:
        """Whether a single frequency and decay were fitted."""
        return self.terms.modes == 1

    @property
    def cost(self) -> float:
        """−2 ln of the likelihood with the noise at its most probable, but for a constant."""
        return float(2 * self.residual.shape[1] * np.sum(np.log(np.mean(np.abs(self.residual) ** 2, axis=1))))

    def sd(self, name: str) -> float:
        """Standard deviation of a fitted rate."""
        k = self.names.index(name)
        return float(np.sqrt(self.covariance[k, k]))

    def draw(self, count: int, generator: np.random.Generator) -> Decay:
        """Draws of the rates from their normal distribution, each rate an array of them."""
        sd = np.sqrt(np.diag(self.covariance))
        root = np.linalg.cholesky(self.covariance / np.outer(sd, sd))  # unlike eigenvectors, it has no free signs
        draws: Any = self.decay.vector(self.names)[:, None] + sd[:, None] * (
            root @ generator.standard_normal((len(sd), count))
        )
        return Decay(**dict(zip(self.names, draws, strict=True)))


def fit_decay(envelope: Envelope, terms: Terms = Terms(), starts: Sequence[Guess] = ()) -> DecayFit:
    """Fit the decay of one or two modes to one or two channels, from the best of the starting points."""
    rows = envelope.time.size
    if rows < 2 * (2 * terms.modes + len(terms.curved) + 4):
        raise CompensationError(f"{rows} rows are too few for a decay of {terms.modes} mode(s); record more.")
    tried = starts or [Guess(one) for one in find_starts(envelope, terms.modes)]
    return min((_fit_from(envelope, terms, one) for one in tried), key=lambda one: one.cost)


def drift_shapes(envelope: Envelope, count: int) -> Array:
    """Legendre polynomials of degree 2, 3, … less the straight line that fits best with weights Σ|z|²: δ and its error stay."""
    y = 2 * (envelope.time - envelope.time[0]) / (envelope.time[-1] - envelope.time[0]) - 1
    size = np.linalg.norm(envelope.values, axis=0)
    line = np.vander(y, 2)
    shapes = np.polynomial.legendre.legvander(y, count + 1)[:, 2:].T
    return np.asarray(shapes - (line @ np.linalg.lstsq(line * size[:, None], (shapes * size).T, rcond=None)[0]).T)


@dataclass(frozen=True)
class _Form:
    """The model over x = t/span and amplitudes over their size, so that every value of a point is of order one."""

    x: Array
    terms: Terms
    names: tuple[str, ...]
    channels: int  # of the data
    parts: int  # amplitudes at the start
    shapes: Array
    blur: float  # half the variance of the times that a row averages, over the step²

    def split(self, point: Array) -> tuple[Decay, Complex, Array, Array, Complex]:
        ends = np.cumsum([len(self.names), len(self.shapes), 2 * self.parts, self.terms.tones])
        rates, drift, start, tones, sizes = np.split(point, ends)
        amplitudes = sizes.reshape(2, self.terms.tones, self.channels)
        return (
            Decay(**dict(zip(self.names, rates.tolist(), strict=True))), start[: self.parts] + 1j * start[self.parts :],
            drift, tones, amplitudes[0] + 1j * amplitudes[1],
        )  # fmt: skip

    def join(self, decay: Decay, start: Complex, drift: Array, tones: Array, sizes: Complex) -> Array:
        flat = sizes.ravel()
        return np.concatenate([decay.vector(self.names), drift, start.real, start.imag, tones, flat.real, flat.imag])

    def _seen(self, z: Complex) -> Complex:
        return z.sum(axis=-2, keepdims=True) if self.parts > self.channels else z

    def tell(self, point: Array) -> tuple[Complex, Complex]:
        """Return the model (channels, rows) and its derivatives (values, channels, rows)."""
        decay, start, drift, tones, sizes = self.split(point)
        if self.terms.curved:
            first, last = len(self.names), len(self.names) + len(drift)
            moved = [*range(first), *range(last, last + 2 * self.parts)]
            trials = [self.split(point + STEP * one) for one in np.vstack([0 * point, np.eye(point.size)[moved]])]
            z, *moved_z = self._seen(swing([one[0] for one in trials], self.x, np.array([one[1] for one in trials])))
            columns = [(one - z) / STEP for one in moved_z]
            rates, parts = columns[:first], columns[first:]
        else:
            z, by, units = differentiate(decay, self.x, start)
            z, rates = self._seen(z), [self._seen(by[name]) for name in self.names]
            parts = [self._seen(turn * one) for turn in (1, 1j) for one in units]
        phase, waves = np.exp(1j * (drift @ self.shapes)), np.exp(1j * np.outer(tones, self.x))
        found = [one * phase for one in rates]
        found += [1j * shape * z * phase for shape in self.shapes]
        found += [one * phase for one in parts]
        found += [1j * self.x * size[:, None] * wave for size, wave in zip(sizes, waves, strict=True)]
        each = [np.eye(self.channels)[:, c : c + 1] * wave for wave in waves for c in range(self.channels)]
        every = np.array([z * phase + sizes.T @ waves, *found, *each, *(1j * one for one in each)])
        if self.blur and (self.terms.curved or self.terms.drift):  # what averaging takes; of a linear decay a factor
            bend = np.diff(every, 2, axis=-1)
            bend[..., np.abs(np.diff(self.x, 2)) > 0.01 * self.x[1]] = 0.0  # beside a gap
            every[..., 1:-1] += self.blur * bend
            every[..., [0, -1]] += self.blur * (2 * bend[..., [0, -1]] - bend[..., [1, -2]])
        return every[0], every[1:]


def _fit_from(envelope: Envelope, terms: Terms, guess: Guess) -> DecayFit:
    z = envelope.values
    channels = z.shape[0]
    summed = channels == 1 and terms.modes == 2
    linear = (*ONE_MODE, "damping_cos", "stiffness_cos") if summed else TWO_MODES if terms.modes == 2 else ONE_MODE
    names = (*linear, *terms.curved)
    time = envelope.time - envelope.time[0]
    span, size = float(time[-1]) or 1.0, float(np.sqrt(np.mean(np.abs(z) ** 2))) or 1.0
    x, data = time / span, z / size
    form = _Form(x, terms, names, channels, 2 if summed else channels, drift_shapes(envelope, terms.drift),
                 envelope.spread / 2 / float(np.median(np.diff(time))) ** 2)  # fmt: skip
    scale = np.array([span * size**2 if name in CURVED else span for name in names])
    scaled = Decay(**dict(zip(names, (guess.decay.vector(names) * scale).tolist(), strict=True)))
    drift = np.resize(np.append(guess.drift, np.zeros(terms.drift)), terms.drift)
    tones = np.array(guess.tones) * span
    sizes: Complex = np.array(guess.sizes, dtype=np.complex128).reshape(terms.tones, channels) / size
    start: Complex = (
        np.asarray(guess.start, dtype=np.complex128) / size
        if guess.start is not None
        else _amplitudes(x, data, scaled, form.parts)
    )
    point, weight = form.join(scaled, start, drift, tones, sizes), np.ones(channels)
    known: dict[bytes, tuple[Complex, Complex]] = {}

    def tell(point: Array) -> tuple[Complex, Complex]:
        if point.tobytes() not in known:
            known.clear()  # only the last point is asked for again
            with np.errstate(over="ignore", invalid="ignore"):
                told = form.tell(point)
            fine = np.all(np.abs(told[0]) < MOST) and np.all(np.isfinite(told[1]))
            known[point.tobytes()] = told if fine else (MOST + 0 * data, np.zeros_like(told[1]))
        return known[point.tobytes()]

    for _ in range(channels):  # the second time with each channel's own noise

        def residuals(point: Array, weight: Array = weight) -> Array:
            return _flatten((tell(point)[0] - data) / weight[:, None])

        def jacobian(point: Array, weight: Array = weight) -> Array:
            return np.stack([_flatten(one) for one in tell(point)[1] / weight[:, None]], axis=1)

        solved = scipy.optimize.least_squares(
            residuals,
            point,
            jacobian,
            method="lm",
            x_scale="jac",
            xtol=1e-11,
            ftol=1e-11,
            gtol=1e-11,
            max_nfev=15 if terms.curved else 25,
        )
        point = np.asarray(solved.x)
        r = data - tell(point)[0]
        freedom = max(1.0, r.shape[1] - point.size / (2 * channels))
        noise = np.sqrt(np.sum(np.abs(r) ** 2, axis=1) / freedom)
        weight = np.maximum(noise, 1e-12)
    J = jacobian(point, weight)
    # each real part has half of the complex variance
    bound = (
        0.5 * np.linalg.pinv(J.T @ J, rcond=1e-15, hermitian=True)[: len(names), : len(names)] / np.outer(scale, scale)
    )
    scaled, start, drift, tones, sizes = form.split(point)
    rates = dict(zip(names, (scaled.vector(names) / scale).tolist(), strict=True))
    found = Guess(
        Decay(**rates), start * size, tuple(drift.tolist()), tuple((tones / span).tolist()),
        tuple(map(tuple, (sizes * size).tolist())),
    )  # fmt: skip
    return DecayFit(envelope, terms, found, names, bound, noise * size, r * size, J, 1.0, summed)


def _flatten(values: Complex) -> Array:
    return np.concatenate([values.real.ravel(), values.imag.ravel()])


def _amplitudes(x: Array, data: Complex, decay: Decay, parts: int) -> Complex:
    """Return the start amplitudes that fit the linear decay best."""
    columns = np.stack([propagate(decay, x, one) for one in np.eye(parts, dtype=complex)], axis=-1)
    if parts > data.shape[0]:
        columns = columns.sum(axis=0, keepdims=True)
    return np.asarray(np.linalg.lstsq(columns.reshape(-1, parts), data.ravel(), rcond=None)[0])


def carry_over(fit: DecayFit, envelope: Envelope) -> Guess:
    """Return what a fit foretells of another window as a start there: its state at the first row, and its drift, straight beyond it."""
    old, time, found = fit.envelope.time, envelope.time, fit.found
    back = float(time[0] - old[0])
    if fit.terms.curved:
        start = swing([found.decay], np.array([0.0, back]), fit.start[None, :])[0, :, -1] if back else fit.start
    else:
        start = propagate(found.decay, np.array([back]), fit.start)[:, 0]
    phase = np.array(found.drift) @ drift_shapes(fit.envelope, fit.terms.drift)
    beside = np.clip(time, old[0], old[-1])
    ends = np.gradient(phase, old)[[0, -1]] if fit.terms.drift else (0.0, 0.0)
    phase = np.interp(beside, old, phase) + np.where(time < beside, ends[0], ends[1]) * (time - beside)
    x = (time - time[0]) / (time[-1] - time[0])
    level, slope, *drift = np.linalg.lstsq(
        np.vstack([np.ones_like(x), x, drift_shapes(envelope, fit.terms.drift)]).T, phase, rcond=None
    )[0].tolist()
    decay = replace(found.decay, detuning=found.decay.detuning + slope / float(time[-1] - time[0]))
    turned = [np.exp(1j * tone * back) for tone in found.tones]
    sizes = tuple(tuple(c * one for c in size) for size, one in zip(found.sizes, turned, strict=True))
    known = start * np.exp(1j * level) if np.all(np.isfinite(start)) else None
    return Guess(decay, known, tuple(drift), found.tones, sizes)
