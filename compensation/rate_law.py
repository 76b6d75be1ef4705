"""Law of a rate output over the applied rate, temperature, and warming or cooling, chosen among physical forms.

    line        y = a + k Ω
    directions  y = a + k₊ Ω for Ω > 0, k₋ Ω for Ω < 0
    quadratic   y = a + k Ω + c Ω²
    cubic       y = a + k Ω + c Ω³                  electrodes, large amplitudes
    sine        y = a + k A sin(Ω/A)                an angle read by its sine, a saturating output
    dead band   y = a + k sign(Ω) max(|Ω| − d, 0)   a wave held by its damping

on the means of the held rates. Null and scale may go with the temperature (a line or a square, from its mean) and be others while it
rises than while it falls: y + a_T ΔT + k_T ΔT Ω, and the same with ΔT² and with ±1. The form with the least N ln(mean square) + p ln N
is taken, with the conditions that lower it; a richer form than the line must be better on rates held out of the fit, too, all means of
one rate at a time. A form beyond the paper's parabola is a step of the chain too, read backwards: `RateCurve`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike

from compensation.arrays import Array
from compensation.bell import PolynomialCurve
from compensation.errors import CompensationError
from compensation.linearity import same_rate
from compensation.noise_regression import correlated_covariance
from compensation.regression import fit_linear

SURE = 6.0  # fall of N ln(mean square) + p ln N below the line's for which another form is taken (20:1)
LEAST = 6
BLIND = 5.0  # deviations of a row by which an output must leave a dead band to tell the sign of the rate


class Form(NamedTuple):
    """The name of a form's own coefficient s, its columns of k and s, and Ω over u = (y − a)/k, k, s if a chain takes it."""

    own: tuple[str, ...]
    columns: Callable[[Array, float], list[Array]]
    rate: Callable[[Array, float, float], Array] = lambda u, k, s: u


def _cubic(u: Array, k: float, c: float) -> Array:
    """For c < 0, which turns back at t² = k/3|c|, Ω = 2t sin φ gives u = ⅔ t sin 3φ; for c > 0 the same with sinh."""
    w = 1.5 * u / (t := np.sqrt(k / (3 * max(abs(c), 1e-30))))
    return np.asarray(2 * t * (np.sinh(np.arcsinh(w) / 3) if c > 0 else np.sin(np.arcsin(np.clip(w, -1, 1)) / 3)))


FORMS = {
    "line": Form((), lambda x, s: [x]),
    "directions": Form(("k_positive_more",), lambda x, s: [x, np.maximum(x, 0)], lambda u, k, s: u / np.where(u < 0, 1, 1 + s / k)),
    "quadratic": Form(("c",), lambda x, s: [x, x**2]),
    "cubic": Form(("c",), lambda x, s: [x, x**3], _cubic),
    "sine": Form(("A",), lambda x, s: [s * np.sin(x / s)], lambda u, k, s: s * np.arcsin(np.clip(u / s, -1, 1))),
    "dead band": Form(("d",), lambda x, s: [np.sign(x) * np.maximum(np.abs(x) - s, 0)], lambda u, k, s: u + np.sign(u) * s),
}  # fmt: skip
CARRIED = ("directions", "cubic", "sine", "dead band")  # by a chain; a line and a square are (35)'s parabola
SHAPED = ("sine", "dead band")  # not linear in their last value


@dataclass(frozen=True)
class RateForm:
    """One form: its values by name, its criterion against the line's, the rms error on rates left out (rate units), and its residual."""

    name: str
    values: dict[str, float]
    gain: float
    held_out: float
    residual: Array
    over: tuple[str, ...] = ()  # conditions that it goes with: temperature, temperature squared, warming


@dataclass(frozen=True)
class RateLaw:
    """The forms, the line first, the one that is `chosen`, and whether it leaves more than the means' own errors."""

    rate: Array
    forms: tuple[RateForm, ...]
    chosen: RateForm
    structure: bool


@dataclass(frozen=True)
class RateCurve(PolynomialCurve):
    """y = a + k f(Ω) read backwards: Ω over the measured rate y; `coefficients` are a, k and the form's own.

    With u = (y − a)/k unknown (NaN) where |u| < `blind`: beside a dead band noise makes the sign.
    """

    form: str = "cubic"
    blind: float = 0.0  # rate units

    def value(self, x: ArrayLike) -> Array:
        """Return the rate that the output x tells."""
        a, k, s = self.coefficients
        u = (np.asarray(x, dtype=float) - a) / k
        return np.where(np.abs(u) < self.blind, np.nan, FORMS[self.form].rate(u, k, s))

    def inverse(self, y: ArrayLike) -> Array:
        """Return the output at a rate."""
        a, *sizes = self.coefficients
        columns = FORMS[self.form].columns(np.asarray(y, dtype=float), sizes[-1])
        return np.asarray(a + sum(size * column for size, column in zip(sizes, columns, strict=False)))


def fit_rate_curve(form: str, averaged: float, measured: Array, rate: Array) -> RateCurve:
    """Fit a form to the measured over the applied rate, means of so many rows; errors as of the linear form nearby."""
    values, _ = _fit(form, rate, measured, {})
    _, k, s = found = np.array([values[name] for name in ("a", "k", *FORMS[form].own)])
    if form == "cubic" and k + 3 * s * np.max(rate**2) < 0:
        turn = np.sqrt(-k / (3 * s))
        raise CompensationError(f"the output turns back at {turn:.4g} °/s; leave out the rates beyond.")
    columns = FORMS[form].columns(rate, s)
    if form in SHAPED:
        columns.append(k * (FORMS[form].columns(rate, s * (1 + 1e-4))[0] - columns[0]) / (1e-4 * s))
    near = fit_linear(np.stack(columns, axis=1), measured, ("k", *FORMS[form].own))
    blind = BLIND * near.standard_deviation * np.sqrt(averaged) / k if form == "dead band" else 0.0
    return RateCurve(found, correlated_covariance(near), measured.min(), measured.max(), form, blind)


def fit_rate_law(
    rate: Array, output: Array, error: Array, temperature: Array | None = None, warming: Array | None = None
) -> RateLaw | None:
    """Choose the form of mean outputs at held rates, with errors, or None; `warming` is 1 while the temperature (K) rises, −1, 0."""
    level = same_rate(rate)
    if len(np.unique(level)) < LEAST or not rate.min() < 0 < rate.max():
        return None
    T = np.zeros_like(rate) if temperature is None else temperature - np.mean(temperature)
    given = {"temperature": T, "temperature squared": T**2, "warming": T * 0 if warming is None else warming}
    known = {name: np.stack([x, x * rate], axis=1) for name, x in given.items() if len(np.unique(np.round(x, 3))) > 1}

    def judge(name: str, over: tuple[str, ...]) -> tuple[float, dict[str, float], Array]:
        values, fitted = _fit(name, rate, output, {one: known[one] for one in over})
        # a mean has errors of its own: nothing is gained below them
        square = float(np.mean((output - fitted) ** 2) + np.mean(error**2))
        return len(rate) * float(np.log(square)) + len(values) * float(np.log(len(rate))), values, output - fitted

    forms: list[RateForm] = []
    base = 0.0
    for name in FORMS:
        over: tuple[str, ...] = ()
        best = judge(name, over)
        base = base or best[0]
        while rest := [one for one in known if one not in over]:
            more = min(rest, key=lambda one: judge(name, (*over, one))[0])
            if best[0] - judge(name, (*over, more))[0] < SURE:
                break
            over = (*over, more)
            best = judge(name, over)
        away = []
        for one in np.unique(level):
            out = level == one
            left = _fit(name, rate[~out], output[~out], {key: known[key][~out] for key in over})[0]
            away.append(output[out] - _value(name, left, rate[out], [known[key][out] for key in over]))
        held_out = float(np.sqrt(np.mean(np.square(np.concatenate(away))))) / abs(best[1]["k"])
        forms.append(RateForm(name, best[1], base - best[0], held_out, best[2], over))
    line = forms[0]
    better = [form for form in forms[1:] if form.gain > line.gain + SURE and form.held_out < line.held_out]
    chosen = max(better, key=lambda form: form.gain, default=line)
    excess = float(np.sum((chosen.residual / np.maximum(error, 1e-300)) ** 2))
    structure = excess > float(scipy.special.chdtri(len(rate) - len(chosen.values), 1e-3))
    return RateLaw(rate, tuple(forms), chosen, structure)


SUFFIX = {"temperature": "_T", "temperature squared": "_TT", "warming": "_warming"}


def _value(name: str, values: dict[str, float], x: Array, over: list[Array]) -> Array:
    names = ("a", "k", *FORMS[name].own)
    columns = [np.ones_like(x), *FORMS[name].columns(x, values[names[-1]])]
    told = sum(values[one] * column for one, column in zip(names, columns, strict=False))
    rest = [value for one, value in values.items() if one not in names]
    return np.asarray(told + np.concatenate([np.zeros((len(x), 0)), *over], axis=1) @ np.array(rest))


def _fit(name: str, x: Array, y: Array, over: Mapping[str, Array]) -> tuple[dict[str, float], Array]:
    def solve(shape: float) -> tuple[Array, Array]:
        X = np.column_stack([np.ones_like(x), *FORMS[name].columns(x, shape), *over.values()])
        scale = np.maximum(np.max(np.abs(X), axis=0), 1e-300)
        b = np.linalg.lstsq(X / scale, y, rcond=None)[0] / scale
        return b, X @ b

    shape = 1.0
    names = ["a", "k", *FORMS[name].own]
    if name in SHAPED:
        most = float(np.max(np.abs(x)))
        grid = most * (np.geomspace(0.65, 30, 40) if name == "sine" else np.r_[1e-4, np.linspace(0, 0.5, 41)[1:]])
        Q = np.linalg.qr(np.column_stack([np.ones_like(x), *over.values()]))[0]
        free = y - Q @ (Q.T @ y)

        def cost(s: float) -> float:
            """The sum of squares, the other coefficients at their best."""
            c = FORMS[name].columns(x, s)[0]
            c = c - Q @ (Q.T @ c)
            left = free - c * (float(c @ free) / max(float(c @ c), 1e-300))
            return float(left @ left)

        at = int(np.argmin([cost(one) for one in grid]))
        ends = grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)]
        shape = float(scipy.optimize.minimize_scalar(cost, bounds=ends, options={"xatol": 1e-8 * most}).x)
    last = [names.pop()] if name in SHAPED else []
    names += [*(f"{one}{SUFFIX[key]}" for key in over for one in "ak"), *last]
    b, fitted = solve(shape)
    return dict(zip(names, [*b.tolist(), shape], strict=False)), fitted
