"""Law of a rate output over the applied rate, chosen among physical forms.

    line        y = a + k Ω
    directions  y = a + k₊ Ω for Ω > 0, k₋ Ω for Ω < 0
    quadratic   y = a + k Ω + c Ω²
    cubic       y = a + k Ω + c Ω³                  electrodes, large amplitudes
    sine        y = a + k A sin(Ω/A)                an angle read by its sine, a saturating output
    dead band   y = a + k sign(Ω) max(|Ω| − d, 0)   a wave held by its damping

on the means of the held rates. The form with the least N ln(mean square) + p ln N is taken; a richer one than the line must be
better on rates held out of the fit, too.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from compensation.arrays import Array

SURE = 6.0  # fall of N ln(mean square) + p ln N below the line's for which another form is taken (20:1)
LEAST = 6


@dataclass(frozen=True)
class RateForm:
    """One form: its values by name, its criterion against the line's, the rms error on rates left out (rate units), and its residual."""

    name: str
    values: dict[str, float]
    gain: float
    held_out: float
    residual: Array


@dataclass(frozen=True)
class RateLaw:
    """The forms, the line first, the one that is `chosen`, and whether it leaves more than the means' own errors."""

    rate: Array
    forms: tuple[RateForm, ...]
    chosen: RateForm
    structure: bool


def fit_rate_law(rate: Array, output: Array, error: Array) -> RateLaw | None:
    """Choose the form of mean outputs at held rates, with standard errors; None below six rates or of one direction."""
    if len(rate) < LEAST or not rate.min() < 0 < rate.max():
        return None
    forms: list[RateForm] = []
    for name in ("line", "directions", "quadratic", "cubic", "sine", "dead band"):
        values, fitted = _fit(name, rate, output)
        r = output - fitted
        # a mean has errors of its own: nothing is gained below them
        cost = len(rate) * float(np.log(np.mean(r**2) + np.mean(error**2))) + len(values) * float(np.log(len(rate)))
        away = [
            output[k] - _value(name, _fit(name, np.delete(rate, k), np.delete(output, k))[0], rate[k : k + 1])[0]
            for k in range(len(rate))
        ]
        held_out = float(np.sqrt(np.mean(np.square(away)))) / abs(values["k"])
        forms.append(RateForm(name, values, -cost if not forms else -cost - forms[0].gain, held_out, r))
    line = RateForm("line", forms[0].values, 0.0, forms[0].held_out, forms[0].residual)
    better = [form for form in forms[1:] if form.gain > SURE and form.held_out < line.held_out]
    chosen = max(better, key=lambda form: form.gain, default=line)
    excess = float(np.sum((chosen.residual / np.maximum(error, 1e-300)) ** 2))
    structure = excess > float(scipy.special.chdtri(len(rate) - len(chosen.values), 1e-3))
    return RateLaw(rate, (line, *forms[1:]), chosen, structure)


def _columns(name: str, shape: float, x: Array) -> list[Array]:
    rows = {
        "line": [x],
        "directions": [x, np.maximum(x, 0.0)],
        "quadratic": [x, x**2],
        "cubic": [x, x**3],
        "sine": [shape * np.sin(x / shape)],
        "dead band": [np.sign(x) * np.maximum(np.abs(x) - shape, 0.0)],
    }
    return rows[name]


NAMES = {
    "directions": ("k", "k_positive_more"),
    "quadratic": ("k", "c"),
    "cubic": ("k", "c"),
    "sine": ("k", "A"),
    "dead band": ("k", "d"),
}


def _value(name: str, values: dict[str, float], x: Array) -> Array:
    rest = list(values.values())
    shaped = name in ("sine", "dead band")
    columns = _columns(name, rest[2] if shaped else 1.0, x)
    return np.asarray(rest[0] + sum(b * column for b, column in zip(rest[1:], columns, strict=False)))


def _fit(name: str, x: Array, y: Array) -> tuple[dict[str, float], Array]:
    def solve(shape: float) -> tuple[Array, Array]:
        X = np.column_stack([np.ones_like(x), *_columns(name, shape, x)])
        scale = np.max(np.abs(X), axis=0)
        b = np.linalg.lstsq(X / scale, y, rcond=None)[0] / scale
        return b, X @ b

    shape = 1.0
    if name in ("sine", "dead band"):
        most = float(np.max(np.abs(x)))
        grid = most * (np.geomspace(0.65, 30, 40) if name == "sine" else np.r_[1e-4, np.linspace(0, 0.5, 41)[1:]])
        costs = [float(np.sum((y - solve(one)[1]) ** 2)) for one in grid]
        at = int(np.argmin(costs))
        ends = grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)]
        shape = float(
            scipy.optimize.minimize_scalar(
                lambda s: float(np.sum((y - solve(s)[1]) ** 2)), bounds=ends, method="bounded"
            ).x
        )
    b, fitted = solve(shape)
    values = dict(zip(("a", *NAMES.get(name, ("k",))), [*b.tolist(), shape], strict=False))
    return values, fitted
