"""Resonances in the power spectrum of a spectrum analyser: Lorentzian lines on a background.

    S(f) = B e^{s f} + Σ P / (1 + (2 (f − f₀)/Γ)²),   Q = f₀/Γ

The scatter of a power is taken in proportion to it (a periodogram's is), so the deviance 2 Σ (y/S − 1 − ln y/S) is made least; the
errors are the largest of those of such noise, and of the scores themselves, each alone and neighbours together, for other noise.
"""

from math import exp, log, pi

import numpy as np
import scipy
from numpy.typing import ArrayLike

from compensation.arrays import Array
from compensation.errors import CompensationError
from compensation.ringdown.answer import Curve, Estimate, RingDown
from compensation.ringdown.laws import long_run
from compensation.samples import block_means

PAYS = 20.0
NARROW = 3.0  # points within the width below which the analyser, not the resonator, makes it


def fit_spectrum(frequency: ArrayLike, power: ArrayLike) -> RingDown:
    """Fit one line, or two where the second pays."""
    f, y = np.asarray(frequency, dtype=np.float64), np.asarray(power, dtype=np.float64)
    keep = np.isfinite(f) & np.isfinite(y) & (y > 0)
    f, y = f[keep], y[keep]
    if f.size < 16:
        raise CompensationError(f"a spectrum needs 16 points or more with a positive power, not {f.size}.")
    y = y / np.median(y)
    # the kernel of three points steadies the start only
    smooth = np.exp(np.convolve(np.log(np.pad(y, 1, mode="edge")), np.ones(3) / 3, mode="valid"))
    one = _fit(f, y, [_line_at(f, smooth)])
    scatter = _scatter(one, f, y)
    if not smooth.max() / exp(one[0]) > 1 + 4 * scatter:
        raise CompensationError(
            "no resonance stands above the background; average more, or take a span about the line."
        )
    rest = smooth / _model(one, f)
    two = _fit(f, y, [tuple(one[2:5]), _line_at(f, rest * np.median(smooth))])
    gain = (_deviance(one, f, y) - _deviance(two, f, y)) / _scatter(two, f, y) ** 2
    split = gain > PAYS + 6 * log(f.size) and abs(two[2] - two[5]) > 0.2 * exp(min(two[3], two[6]))
    point = two if split else one
    if split and point[2] < point[5]:
        point = np.concatenate([point[:2], point[5:8], point[2:5]])
    fitted = _model(point, f)
    scatter = _scatter(point, f, y)
    steps = np.full(point.size, 1e-4)
    steps[2::3] = 1e-4 * np.exp(point[3::3])
    around = [np.log(_model(point + h, f) / _model(point - h, f)) / (2 * h.max()) for h in np.diag(steps)]
    J = np.stack(around, axis=1)
    scale = 1 / np.linalg.norm(J, axis=0)
    bread = np.linalg.pinv((J * scale).T @ (J * scale), hermitian=True)
    share = np.minimum(np.sum((J * scale @ bread) * J * scale, axis=1), 0.9)
    scores = J * scale * ((y / fitted - 1) / (1 - share))[:, None]
    middles = (long_run(np.arange(f.size), scores), scores.T @ scores)
    spreads = [np.diag(bread) * scatter**2, *(np.diag(bread @ middle @ bread) for middle in middles)]
    sd = np.sqrt(np.max(spreads, axis=0)) * scale
    found: dict[str, Estimate] = {}
    for k in range(2 if split else 1):
        f0, width = float(point[2 + 3 * k]), exp(point[3 + 3 * k])
        rel, mark = float(sd[3 + 3 * k]), f"_{k + 1}" if split else ""
        found[f"frequency{mark}_Hz"] = Estimate.normal(f0, float(sd[2 + 3 * k]))
        if split:
            found[f"q_{k + 1}"] = Estimate.relative(f0 / width, rel)
        else:
            found["inverse_q"] = Estimate.relative(width / f0, rel)
            found["decay_time_s"] = Estimate.relative(1 / (pi * width), rel)
    if split:
        found["split_Hz"] = Estimate.normal(float(point[2] - point[5]), float(np.hypot(sd[2], sd[5])))
    size = max(4, y.size // 40)
    widening = float(np.sqrt(max(1.0, size * float(np.mean(block_means(y / fitted - 1, size) ** 2)) / scatter**2)))
    level, foretold = 10 * np.log10(y), 10 * np.log10(fitted)
    curve = Curve(f, level, foretold, level - foretold)
    return RingDown(found, tuple(_remark(f, point, split, widening)), (scatter,), widening, (curve,))


def _line_at(f: Array, y: Array) -> tuple[float, float, float]:
    """Return the frequency, ln of the width and ln of the power of the largest line."""
    at = int(np.argmax(y))
    half = (y[at] + np.median(y)) / 2
    below = np.flatnonzero(y < half)
    step = float(np.median(np.diff(f)))
    width = 2 * float(np.min(np.abs(f[below] - f[at]))) if below.size else float(np.ptp(f)) / 4
    return float(f[at]), log(max(width, step)), log(float(y[at]))


def _model(point: Array, f: Array) -> Array:
    middle = (f[0] + f[-1]) / 2
    S = np.exp(np.clip(point[0] + point[1] * (f - middle) / np.ptp(f), -200, 200))
    for f0, width, power in np.reshape(point[2:], (-1, 3)):
        S = S + np.exp(np.clip(power, -200, 200)) / (1 + (2 * (f - f0) / np.exp(np.clip(width, -200, 200))) ** 2)
    return np.asarray(S)


def _fit(f: Array, y: Array, lines: list[tuple[float, float, float]]) -> Array:
    start = np.array([log(float(np.quantile(y, 0.2))), 0.0, *(x for line in lines for x in line)])

    def residuals(point: Array) -> Array:
        ratio = y / _model(point, f)
        return np.asarray(np.sign(ratio - 1) * np.sqrt(2 * np.maximum(ratio - 1 - np.log(ratio), 0.0)))

    steps = np.array([1.0, 1.0, *(x for line in lines for x in (exp(line[1]), 1.0, 1.0))])
    return np.asarray(scipy.optimize.least_squares(residuals, start, x_scale=steps, method="trf", max_nfev=400).x)


def _deviance(point: Array, f: Array, y: Array) -> float:
    ratio = y / _model(point, f)
    return float(2 * np.sum(ratio - 1 - np.log(ratio)))


def _scatter(point: Array, f: Array, y: Array) -> float:
    return float(np.sqrt(np.sum((y / _model(point, f) - 1) ** 2) / max(f.size - point.size, 1)))


def _remark(f: Array, point: Array, split: bool, widening: float) -> list[str]:
    said = []
    step = float(np.median(np.diff(f)))
    if exp(min(point[3::3])) < NARROW * step:
        said.append(
            f"The line is narrower than {NARROW:g} points of {step:.3g} Hz: the analyser sets its width, and the stated Q is a lower limit."
        )
    if widening > 2:
        said.append(
            "The line is not a Lorentzian (amplitude too large, drift during the sweep, or a coarse resolution bandwidth): take Q as an indication."
        )
    if not all(f[0] < f0 < f[-1] for f0 in point[2::3]):
        said.append("The line lies at the edge of the span: centre the span on it.")
    if split:
        said.append("Two lines are seen: without phase, a spectrum cannot give axes.")
    return said
