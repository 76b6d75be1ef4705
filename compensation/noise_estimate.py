"""Levels of noise by restricted likelihood with a weak prior (`compensation.noise_rows`): Newton's steps from several starts."""

from collections.abc import Callable, Sequence

import numpy as np

from compensation.arrays import Array
from compensation.noise import Noise
from compensation.noise_rows import KINDS, NoiseRows
from compensation.noise_within import within

Seen = tuple[float, Array, Array]
"""−2 ln L at a point, its slopes and curvature."""
LEAST, MOST = -7.0, 8.0  # ln of the rms of slow noise within a run over that of a row's white noise
WHITE = -0.3  # ln of white noise over the scatter of neighbouring rows, where the search begins
TOO_QUIET = 1.0  # ln by which white noise below that is odd
USUAL, SPREAD = -1.0, 3.0
"""Weak prior of the same: it keeps a level that the rows say nothing about from running away."""
STATED_SPREAD = 0.7  # the same about ln of a level that is stated: a factor of 2
LONGEST, CLOSE = 3.0, 1e-3  # of a step in ln of a level, and fall of −2 ln L that the last one promises
MOST_STEPS, MOST_HALVINGS = 50, 12
LOUD = 1.0  # ln of slow noise within a run over that of a row, beyond which its kinds are searched each for itself
STOOD = 0.1
"""Fall of −2 ln L up to which a search has ended where it began: every kind was searched when that was found."""
PURE = 0.02  # of it, within which it is of one kind


def estimate_noise(
    rows: NoiseRows, target: Array, columns: Array | None = None, precision: Array | None = None,
    kinds: Sequence[str] = KINDS, near: Noise | None = None, stated: Noise | None = None,
) -> Noise:  # fmt: skip
    """Estimate the levels of the noise by its marginal likelihood: of coarse rows, and of what they say within these (`compensation.noise_within`).

    `target` (M,) are residuals of all runs, `columns` (M, p) what else is unknown, of prior `precision`; `kinds`:
    "white" (always), "flicker", "walk", "offset"; `near`: where to begin; `stated`: slow levels known to a factor of 3.
    """
    fine = np.zeros((rows.count, 0)) if columns is None else columns
    X, y, coarse = rows.means(fine), rows.means(target), rows.coarse
    size = np.linalg.norm(X, axis=0)
    size[size == 0] = 1.0
    lam = np.zeros(X.shape[1]) if precision is None else precision
    X, lam = X / size, lam / size**2
    free_part = np.linalg.lstsq(np.vstack([X, np.diag(np.sqrt(lam))]), np.append(y, np.zeros(len(lam))))[0]
    rest, inner = y - X @ free_part, within(rows, target, fine)
    step = np.concatenate([np.diff(rest[s]) for s in coarse.slices])
    spread = float(np.median(np.abs(step))) / 0.954 if step.size else 0.0
    spread = max(spread, 1e-14 * float(np.abs(target).max()), 1e-300)
    free = [kind for kind in KINDS[1:] if kind in kinds and (kind != "offset" or len(rows.times) > 1)]
    root, unit = float(np.sqrt(coarse.span)), coarse.slow_units

    def levels(x: Array) -> Noise:
        white = float(spread * np.exp(x[0]))
        slow = {kind: white * unit[kind] * float(np.exp(one)) for kind, one in zip(free, x[1:], strict=True)}
        return Noise(white * root, **slow)

    places = [0, *(KINDS.index(kind) for kind in free)]
    along = np.eye(len(places))
    along[:, 0] = 1.0  # slow levels are over the white one

    def objective(x: Array) -> tuple[float, Array, Array]:
        noise = levels(x)
        try:
            seen = [coarse.deviance(rest, X, lam, noise, -free_part), *(one.deviance(noise) for one in inner)]
        except np.linalg.LinAlgError:  # levels so far apart that rounding decides
            return np.inf, x, np.eye(len(x))
        total = sum(one for one, _, _ in seen)
        slopes, curvature = (np.sum(own, axis=0) for own in list(zip(*seen, strict=True))[1:])
        bend = curvature[np.ix_(places, places)] + np.diag(2 * np.maximum(slopes[places], 0.0))  # Σ goes with θ²
        slope, bend = slopes[places] @ along, along.T @ bend @ along
        for k, (surprise, spread, absolute) in enumerate(_surprises(coarse, noise, free, stated), 1):
            way = (along if absolute else np.eye(len(x)))[k] / spread
            total, slope, bend = total + surprise**2, slope + 2 * surprise * way, bend + 2 * np.outer(way, way)
        return total, slope, bend

    first = usual = np.array([WHITE, *[USUAL] * len(free)])
    if near is not None and near.white > 0:
        white = near.white / root
        slow = [max(getattr(near, kind) / unit[kind] / white, float(np.exp(LEAST))) for kind in free]
        first = np.log([white / spread, *slow])
        first[1:] = np.clip(first[1:], LEAST, MOST)
    low, high = (np.array([end, *[slow] * len(free)]) for end, slow in ((-12.0, LEAST), (12.0, MOST)))

    begin = objective(first)
    found = _newton(objective, first, begin, low, high)
    if near is None or begin[0] - found[0] > STOOD:
        for start in _other_slow(found[1], free):  # what is slow may be of another kind than where the search ended
            there = objective(start)
            if start.max() > LOUD or there[0] < found[0]:
                found = min(found, _newton(objective, start, there, low, high), key=lambda one: one[0])
    if found[1][0] < WHITE - TOO_QUIET:  # slow noise that stands for the scatter of rows may only be a lesser optimum
        found = min(found, _newton(objective, usual, objective(usual), low, high), key=lambda one: one[0])
    return levels(found[1])


def _newton(objective: Callable[[Array], Seen], x: Array, seen: Seen, low: Array, high: Array) -> tuple[float, Array]:
    """Return the least value between bounds, and where, by Newton's steps from what is seen at x, halved until they lower it."""
    value, slope, bend = seen
    for _ in range(MOST_STEPS):
        free = ~(((x <= low) & (slope > 0)) | ((x >= high) & (slope < 0)))
        step = np.zeros_like(x)
        step[free] = -np.linalg.solve(bend[np.ix_(free, free)] + 1e-9 * np.eye(free.sum()), slope[free])
        step *= min(1.0, LONGEST / max(np.abs(step).max(), 1e-300))
        promised = -(slope @ step + 0.5 * step @ bend @ step)
        if promised < CLOSE:
            break
        for _ in range(MOST_HALVINGS):
            tried = np.clip(x + step, low, high)
            there = objective(tried)
            if there[0] < value:
                break
            step /= 2
        else:
            break
        x, (value, slope, bend) = tried, there
    return value, x


def _other_slow(x: Array, free: Sequence[str]) -> list[Array]:
    """Return starts with all slow noise within a run as flicker, or as random walk: of the kind that it is not already."""
    kinds = [k for k, kind in enumerate(free, 1) if kind != "offset"]
    if len(kinds) < 2:
        return []
    total = 0.5 * float(np.logaddexp.reduce(2.0 * x[kinds]))
    starts = []
    for k in kinds:
        if x[k] < total - PURE:
            start = x.copy()
            start[kinds] = total + USUAL - SPREAD
            start[k] = total
            start[1:] = np.clip(start[1:], LEAST, MOST)
            starts.append(start)
    return starts


def log_prior(rows: NoiseRows, noise: Noise, stated: Noise | None = None) -> float:
    """Return the log of the weak prior of the slow levels that are there."""
    free = [kind for kind in KINDS[1:] if getattr(noise, kind) > 0]
    return -0.5 * sum(surprise**2 for surprise, _, _ in _surprises(rows, noise, free, stated))


def _surprises(
    rows: NoiseRows, noise: Noise, kinds: Sequence[str], stated: Noise | None
) -> list[tuple[float, float, bool]]:
    """Return by how many standard deviations each level departs from its prior, that deviation, and whether it is that of a stated level."""
    white, unit, found = noise.white / float(np.sqrt(rows.span)), rows.slow_units, []
    for kind in kinds:
        level, said = getattr(noise, kind), 0.0 if stated is None else getattr(stated, kind)
        if said > 0:
            found.append((float(np.log(level / said)) / STATED_SPREAD, STATED_SPREAD, True))
        else:
            found.append(((float(np.log(level / unit[kind] / white)) - USUAL) / SPREAD, SPREAD, False))
    return found
