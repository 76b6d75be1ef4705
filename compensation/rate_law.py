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
one rate at a time.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy

from compensation.arrays import Array
from compensation.linearity import same_rate

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
    over: tuple[str, ...] = ()  # conditions that it goes with: temperature, temperature squared, warming


@dataclass(frozen=True)
class RateLaw:
    """The forms, the line first, the one that is `chosen`, and whether it leaves more than the means' own errors."""

    rate: Array
    forms: tuple[RateForm, ...]
    chosen: RateForm
    structure: bool


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
    for name in ("line", "directions", "quadratic", "cubic", "sine", "dead band"):
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


SUFFIX = {"temperature": "_T", "temperature squared": "_TT", "warming": "_warming"}


def _value(name: str, values: dict[str, float], x: Array, over: list[Array]) -> Array:
    names = ("a", *NAMES.get(name, ("k",)))
    shaped = name in ("sine", "dead band")
    columns = [np.ones_like(x), *_columns(name, values[names[-1]] if shaped else 1.0, x)]
    told = sum(values[one] * column for one, column in zip(names, columns, strict=False))
    rest = [value for one, value in values.items() if one not in names]
    return np.asarray(told + np.concatenate([np.zeros((len(x), 0)), *over], axis=1) @ np.array(rest))


def _fit(name: str, x: Array, y: Array, over: Mapping[str, Array]) -> tuple[dict[str, float], Array]:
    def solve(shape: float) -> tuple[Array, Array]:
        X = np.column_stack([np.ones_like(x), *_columns(name, shape, x), *over.values()])
        scale = np.maximum(np.max(np.abs(X), axis=0), 1e-300)
        b = np.linalg.lstsq(X / scale, y, rcond=None)[0] / scale
        return b, X @ b

    shape = 1.0
    names = ["a", *NAMES.get(name, ("k",))]
    conditions = [f"{one}{SUFFIX[key]}" for key in over for one in "ak"]
    if name in ("sine", "dead band"):
        most = float(np.max(np.abs(x)))
        grid = most * (np.geomspace(0.65, 30, 40) if name == "sine" else np.r_[1e-4, np.linspace(0, 0.5, 41)[1:]])
        costs = [float(np.sum((y - solve(one)[1]) ** 2)) for one in grid]
        at = int(np.argmin(costs))
        ends = grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)]
        cost = lambda s: float(np.sum((y - solve(s)[1]) ** 2))  # noqa: E731
        shape = float(scipy.optimize.minimize_scalar(cost, bounds=ends, method="bounded").x)
        b, fitted = solve(shape)
        return dict(zip([*names[:2], *conditions, names[2]], [*b.tolist(), shape], strict=True)), fitted
    b, fitted = solve(shape)
    return dict(zip([*names, *conditions], b.tolist(), strict=True)), fitted
