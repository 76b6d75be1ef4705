"""Laws from many decays of one resonator: frequency and 1/Q over temperature, pressure, amplitude and time.

    ln f = c + α T + h a² (+ b T²) (+ β t) (+ a step between sessions),      1/Q = 1/Q₀ + s p + q T + g a² (+ b T²) (+ β t) (+ steps)

p is free-molecular gas, which takes momentum in proportion to its pressure; √p takes its place where viscous gas fits better.
A pendulum has h = −1/16 of its angle, a cubic stiffness any h. Bend and time come in where they pay: time as ageing, as steps, or both.

Rows scatter by more than their own errors, those of one decay together, neighbouring decays together, and so do readings at the
same place of every decay (a counter, a launch). The covariance is that of sums over decays and over places, each with the
correlation between neighbours (Newey and West 1987; two ways after Cameron, Gelbach and Miller 2011).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import sqrt

import numpy as np
import scipy
from numpy.typing import NDArray

from compensation.arrays import Array
from compensation.errors import CompensationError
from compensation.ringdown.answer import Estimate
from compensation.samples import robust_spread

Whole = NDArray[np.int64]
PAYS = 12.0  # least fall of −2 ln L, over the widening², for which time or a bend comes in, beside ln N for each value
NEIGHBOURS = 32
"""Sums from which the correlation between neighbours is taken over √N of them; fewer are taken for independent."""
DAY = 86400.0
SESSION = 6 * 3600.0
VISCOUS = 10.0  # Pa from which viscous gas is tried
ROBUST = 2.0  # standard deviations beyond which a row counts less
OUT = 5.0  # usual scatter of the places from which the first rows stand out
UNLIKE = 1.96
"""Standard deviations of the difference from which the effect of the amplitude is another one at the beginning of the decays: a false alarm costs one row in twenty, a launch that is kept a wrong law."""
BEND = 20.0  # span of temperature (K) from which a bend of 1/Q is tried


@dataclass(frozen=True)
class Rows:
    """Readings with their own `sd`, decay, time (s), and conditions: `temperature` (K), `pressure` (Pa), `energy` (amplitude squared)."""

    value: Array
    sd: Array
    decay: Whole
    time: Array
    conditions: Mapping[str, Array]


@dataclass(frozen=True)
class Law:
    """Terms of a law by name, `step k` for sessions; `level` at the means of the conditions, `scatter` relative, `left_out` rows a launch."""

    level: Estimate
    terms: Mapping[str, Estimate]
    sessions: tuple[float, ...]
    scatter: float
    fitted: Array
    left_out: int = 0


def fit_law(rows: Rows, *, loss: bool) -> Law:
    """Fit a law to ln f, or to 1/Q (`loss`), whose scatter goes with their size.

    The first twentieth of every decay is left out where it stands out, or changes the effect of the amplitude (Hausman 1978).
    """
    law = _fit(rows, loss)
    place = _places(rows)
    first = int(place.max() + 1) // 20
    keep = place >= first
    if first and "energy" in rows.conditions and np.ptp(rows.conditions["energy"]) > 0:
        later = Rows(
            rows.value[keep], rows.sd[keep], rows.decay[keep], rows.time[keep],
            {name: x[keep] for name, x in rows.conditions.items()},
        )  # fmt: skip
        rival = _fit(later, loss)
        one, two = law.terms["energy"], rival.terms["energy"]
        means = np.bincount(place, law.fitted - rows.value) / np.bincount(place)
        usual = robust_spread(means[first:])
        stands_out = float(np.max(np.abs(means[:first]))) > OUT * usual
        if stands_out or abs(one.value - two.value) > UNLIKE * sqrt(abs(two.sd**2 - one.sd**2)):
            fitted = np.full(len(rows.value), np.nan)
            fitted[keep] = rival.fitted
            return replace(rival, fitted=fitted, left_out=first)
    return law


def _fit(rows: Rows, loss: bool) -> Law:
    known = {name: x for name, x in rows.conditions.items() if np.ptp(x) > 1e-9 * np.max(np.abs(x))}
    if not loss:
        known.pop("pressure", None)
    columns = {name: x - x.mean() if name == "temperature" else x for name, x in known.items()}
    if len(rows.value) < len(columns) + 3:
        raise CompensationError(f"{len(rows.value)} decays are too few for a law over {', '.join(columns) or 'time'}.")
    begins = find_sessions(rows)
    columns = _add_what_pays(rows, columns, begins, loss)
    X = np.column_stack([np.ones_like(rows.value), *columns.values()])
    found, weight, robust = _solve(X, rows, loss)
    fitted = X @ found
    covariance = _covariance(X, rows.value - fitted, weight * np.sqrt(robust), rows)
    free = max(len(np.unique(rows.decay)) - X.shape[1], 1)
    reach = float(scipy.special.stdtrit(free, 0.95))
    spreads = np.sqrt(np.diag(covariance))
    level, *terms = (Estimate.normal(float(b), float(sd), reach) for b, sd in zip(found, spreads, strict=True))
    left = (rows.value - fitted) / (fitted if loss else 1.0)
    steps = begins if any(name.startswith("step") for name in columns) else ()
    return Law(level, dict(zip(columns, terms, strict=True)), steps, float(np.sqrt(np.mean(left**2))), fitted)


def find_sessions(rows: Rows) -> tuple[float, ...]:
    """Return when sessions after the first begin (s): after a pause of six hours or more that is 20 usual ones."""
    starts = np.sort(np.unique(rows.time))
    pauses = np.diff(starts)
    if pauses.size == 0:
        return ()
    return tuple(starts[1:][pauses > max(SESSION, 20 * float(np.median(pauses)))].tolist())


def _add_what_pays(rows: Rows, columns: dict[str, Array], begins: tuple[float, ...], loss: bool) -> dict[str, Array]:
    """Take viscous gas in place of free-molecular, a bend over temperature, ageing and steps where the means of the decays ask for them."""
    pressure = columns.get("pressure")
    if pressure is not None and float(pressure.max()) > VISCOUS:
        rival = columns | {"pressure": np.sqrt(pressure)}
        if _gain(rows, columns, rival, loss) > 0:
            columns = {"root pressure" if name == "pressure" else name: x for name, x in rival.items()}
    bend: list[dict[str, Array]] = []
    course: list[dict[str, Array]] = []  # of which one is taken
    if "temperature" in columns and (not loss or np.ptp(columns["temperature"]) > BEND):
        bend.append({"temperature squared": columns["temperature"] ** 2})
    if np.ptp(rows.time) > 0:
        course.append({"time": (rows.time - rows.time.min()) / DAY})
    if begins:
        steps = {f"step {k}": np.where(rows.time >= begin, 1.0, 0.0) for k, begin in enumerate(begins, 1)}
        session = np.searchsorted(begins, rows.time, side="right")
        means = np.bincount(session, rows.time) / np.bincount(session)
        course += [steps, steps | {"time within sessions": (rows.time - means[session]) / DAY}]
    while rivals := [
        (_gain(rows, columns, columns | one, loss), k, kind) for kind in (bend, course) for k, one in enumerate(kind)
    ]:
        gain, k, kind = max(rivals, key=lambda one: one[0])
        if gain <= 0:
            break
        columns = columns | kind[k]
        kind.clear()
    return columns


def _gain(rows: Rows, columns: Mapping[str, Array], rival: Mapping[str, Array], loss: bool) -> float:
    """Return by how much −2 ln L of the decays' means falls, over the correlation that the rival leaves, beyond what it must."""
    (before, _, few), (after, widening, many) = (_misfit(rows, one, loss) for one in (columns, rival))
    return (before - after) / widening - (many - few) * float(np.log(len(np.unique(rows.decay)))) - PAYS


def _misfit(rows: Rows, columns: Mapping[str, Array], loss: bool) -> tuple[float, float, int]:
    """Return −2 ln L of the decays' means (but for a constant), the correlation of what is left, and the number of values."""
    index = np.unique(rows.decay, return_inverse=True)[1]
    count = np.bincount(index)
    given = (rows.value, rows.sd, rows.time, np.ones_like(rows.value), *columns.values())
    value, sd, time, *means = (np.bincount(index, x) / count for x in given)
    X = np.column_stack(means)
    n, k = len(value), X.shape[1]
    if n < k + 2:
        return np.inf, 1.0, k
    found, weight, _ = _solve(X, Rows(value, sd, np.arange(n), time, {}), loss)
    z = np.abs((value - X @ found) * weight)
    after = ((value - X @ found) * weight)[np.argsort(time)]
    persistence = float(np.clip(after[1:] @ after[:-1] / max(float(after @ after), 1e-300), 0.0, 0.9))
    square = np.where(z < ROBUST, z**2, 2 * ROBUST * z - ROBUST**2)
    return float(n * np.log(np.mean(square)) - 2 * np.sum(np.log(weight))), (1 + persistence) / (1 - persistence), k


def _solve(X: Array, rows: Rows, loss: bool) -> tuple[Array, Array, Array]:
    """Return the values, the weights (by each row's own error and the scatter), and what outliers keep of theirs (Huber)."""
    y = rows.value
    scale = np.max(np.abs(X), axis=0)
    size = np.abs(y) if loss else np.ones_like(y)
    scatter, weight, robust = 0.1 if loss else float(np.std(y)) or 1e-12, 1 / size, np.ones_like(y)
    for _ in range(30):
        w = weight * np.sqrt(robust)
        found = np.linalg.lstsq(X / scale * w[:, None], y * w, rcond=None)[0] / scale
        if loss:
            size = np.maximum(X @ found, 0.1 * np.abs(y))
        left = np.abs(y - X @ found) / np.hypot(size * scatter, rows.sd)
        scatter *= max(robust_spread(left), 1e-6) if y.size > 2 * X.shape[1] else 1.0
        robust = np.minimum(1.0, ROBUST / np.maximum(left, 1e-9))
        weight = 1 / np.hypot(size * scatter, rows.sd)
    return found, weight, robust


def _covariance(X: Array, residual: Array, weight: Array, rows: Rows) -> Array:
    scale = np.max(np.abs(X), axis=0)
    A = X / scale * weight[:, None]
    inverse = np.linalg.pinv(A.T @ A, hermitian=True)
    # what a row takes out of its own residual (HC3 of MacKinnon and White 1985)
    share = np.minimum(np.sum((A @ inverse) * A, axis=1), 0.9)
    scores = A * (residual * weight / (1 - share))[:, None]
    place = _places(rows)
    decays = np.unique(rows.decay, return_inverse=True)[1]
    began = np.full(decays.max() + 1, np.inf)
    np.minimum.at(began, decays, rows.time)
    order = np.argsort(np.argsort(began, kind="stable"))[decays]
    middle, alone = long_run(order, scores), long_run(order, scores, neighbours=False)
    # what a value takes out of its session falls from the sum of neighbours: it must not count as noise that cancels
    short = np.sqrt(np.maximum(np.diag(alone) / np.maximum(np.diag(middle), 1e-300), 1.0))
    middle = middle * np.outer(short, short) if np.all(np.isfinite(short)) else alone
    if place.max() > 0:
        middle = middle + long_run(place, scores) - scores.T @ scores
    bread = inverse / scale[:, None]
    least = np.diag(np.diag(inverse) / scale**2) * 1e-12
    return np.asarray(bread @ middle @ bread.T + least)


def _places(rows: Rows) -> Whole:
    """Return the place of each row in its decay, from 0."""
    order = np.lexsort((rows.time, rows.decay))
    first = np.r_[0, np.flatnonzero(np.diff(rows.decay[order])) + 1]
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order)) - np.repeat(first, np.diff(np.r_[first, len(order)]))
    return place


def long_run(group: Whole, scores: Array, neighbours: bool = True) -> Array:
    """Return Σ S_i S_jᵀ over sums of scores by group, those of neighbours with a weight that falls to 0 at √N."""
    sums: Array = np.stack([np.bincount(group, column) for column in scores.T], axis=1)
    found: Array = sums.T @ sums
    reach = int(sqrt(len(sums))) if neighbours and len(sums) >= NEIGHBOURS else 0
    for lag in range(1, reach + 1):
        beside = sums[lag:].T @ sums[:-lag]
        found += (1 - lag / (reach + 1)) * (beside + beside.T)
    return np.asarray(found)
