"""Levels of noise by restricted likelihood with a weak prior (`compensation.noise_rows`): Newton's steps from several starts."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from compensation.arrays import Array
from compensation.noise import Noise
from compensation.noise_rows import KINDS, UNKNOWNS, NoiseRows
from compensation.noise_within import Within, within

Seen = tuple[float, Array, Array]
"""−2 ln L at a point, its slopes and curvature."""
LEAST, MOST = -7.0, 8.0  # ln of the rms of slow noise within a run over that of a row's white noise
WHITE = -0.3  # ln of white noise over the scatter of neighbouring rows, where the search begins
TOO_QUIET = 1.0  # ln by which white noise below that is odd
USUAL, SPREAD = -1.0, 3.0
"""Weak prior of the same: it keeps a level that the rows say nothing about from running away."""
STATED_SPREAD = 0.7  # the same about ln of a level that is stated: a factor of 2
LONGEST, CLOSE = 3.0, 1e-5  # of a step in ln of a level, and fall of −2 ln L that the last one promises
MOST_STEPS, MOST_HALVINGS = 50, 12
NEAR, STRAIGHT = 0.1, 1e-3
"""Promised fall from which the slope's turn by a step tells its curvature, and the least part of the old one that it may tell."""
LOUD = 1.0  # ln of slow noise within a run over that of a row, beyond which its kinds are searched each for itself
STOOD = 0.1
"""Fall of −2 ln L up to which a search has ended where it began: every kind was searched when that was found."""
PRICE = 5.0
"""Of correlated noise, in log evidence: two more unknowns, and few records have it."""
QUIET = -1.2  # ln of slow noise within a run over that of a row, below which it is not looked for
LESS, PART = 1.0, 60.0
"""Where its search begins: ln of its rms below all slow noise, for a walk's grows over a run, and its time in parts of a run."""
HOPE = 5.0  # times what a step promises is still hoped for
PURE = 0.02  # of it, within which it is of one kind


def estimate_noise(
    rows: NoiseRows, target: Array, columns: Array | None = None, precision: Array | None = None,
    kinds: Sequence[str] = KINDS, near: Noise | None = None, stated: Noise | None = None,
) -> Noise:  # fmt: skip
    """Estimate the levels of the noise by its marginal likelihood: of coarse rows, and of what they say within these (`compensation.noise_within`).

    `target` (M,) are residuals of all runs, `columns` (M, p) what else is unknown, of prior `precision`; `kinds`:
    "white" (always), "flicker", "walk", "offset", "markov"; `near`: where to begin; `stated`: slow levels known to a factor of 3.
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
    free = tuple(k for k in KINDS[1:-1] if k in kinds and (k != "offset" or len(rows.times) > 1))
    plain = _Levels(coarse, rest, X, lam, -free_part, inner, spread, free, stated)

    first = usual = np.array([WHITE, *[USUAL] * len(free)])
    if near is not None and near.white > 0:
        first = plain.place(near)
    begin = plain(first)
    found = _newton(plain, first, begin)
    if near is None or begin[0] - found[0] > STOOD:
        for start in _other_slow(found[1], free):  # what is slow may be of another kind than where the search ended
            there = plain(start)
            if start.max() > LOUD or there[0] < found[0]:
                found = min(found, _newton(plain, start, there, found[0]), key=lambda one: one[0])
    if found[1][0] < WHITE - TOO_QUIET:  # slow noise that stands for the scatter of rows may only be a lesser optimum
        found = min(found, _newton(plain, usual, plain(usual), found[0]), key=lambda one: one[0])
    if "markov" not in kinds:
        return plain.noise(found[1])
    return _with_correlated(plain, found, near)


def _with_correlated(plain: "_Levels", found: tuple[float, Array], near: Noise | None) -> Noise:
    """Return the noise with a Gauss–Markov part where that is worth its price."""
    own = replace(plain, free=(*plain.free, "markov", "markov_time"))
    slow = _slow_rms(found[1][[k for k, kind in enumerate(plain.free, 1) if kind != "offset"]])
    if near is not None and near.markov:
        start = own.place(near)
    elif slow > QUIET:
        loud = slow + found[1][0] - WHITE - LESS
        start = np.array([WHITE, *[USUAL - SPREAD] * len(plain.free), loud, own.ends[1][-1] - np.log(PART)])
    else:
        return plain.noise(found[1])
    best = _newton(own, start, own(start), found[0])
    return own.noise(best[1]) if best[0] < found[0] else plain.noise(found[1])


@dataclass(frozen=True)
class _Levels:
    """What rows say of unknown levels: ln of the white noise over `spread`, of the rms of each other kind within a run over that of a row's white noise, and of the time of correlated noise in s."""

    rows: NoiseRows
    rest: Array
    columns: Array
    precision: Array
    mean: Array
    inner: Sequence[Within]
    spread: float
    free: tuple[str, ...]
    stated: Noise | None

    def noise(self, x: Array) -> Noise:
        white = float(self.spread * np.exp(x[0]))
        slow = dict(zip(self.free, (self._units(white) * np.exp(x[1:])).tolist(), strict=True))
        return Noise(white * float(np.sqrt(self.rows.span)), **slow)

    def place(self, noise: Noise) -> Array:
        """Return where the levels of a noise are."""
        white = noise.white / float(np.sqrt(self.rows.span))
        slow = np.array([getattr(noise, kind) for kind in self.free]) / self._units(white)
        return np.clip(np.log(np.maximum([white / self.spread, *slow], 1e-300)), *self.ends)

    def _units(self, white: float) -> Array:
        """Levels that are as loud within a run as white noise of a row, and a time of 1 s."""
        slow = self.rows.slow_units
        return np.array([white * slow[kind] if kind in slow else 1.0 for kind in self.free])

    @property
    def ends(self) -> tuple[Array, Array]:
        """Ends between which the levels are looked for; correlated noise of the time of a row is white, of a run a walk."""
        longest = max(float(np.ptp(t)) for t in self.rows.times)
        times = {"markov_time": (np.log(self.rows.span), np.log(longest))}
        ends = [(-12.0, 12.0), *(times.get(kind, (LEAST, MOST)) for kind in self.free)]
        low, high = np.array(ends).T
        return low, high

    def likelihood(self, noise: Noise) -> tuple[float, Array, Array, Array]:
        """Return −2 ln L of the rows and of what is within them, with the parts of its slopes and its curvature by ln of every kind."""
        told = [self.rows.deviance(self.rest, self.columns, self.precision, noise, self.mean)]
        told += [one.deviance(noise) for one in self.inner]
        value, expected, seen, curvature = (sum(own[1:], own[0]) for own in zip(*told, strict=True))
        return float(value), expected, seen, curvature

    @cached_property
    def _ways(self) -> tuple[list[int], Array, list[str], Array]:
        """Which of `UNKNOWNS` the levels are, and their slopes by these: slow levels are over the white one; the slow kinds, and the slopes of their surprises."""
        one, slow = np.eye(1 + len(self.free)), [kind for kind in self.free if kind in KINDS]
        along = np.column_stack([[kind != "markov_time" for kind in ("white", *self.free)], one[:, 1:]])
        said = [self.stated is not None and getattr(self.stated, kind) > 0 for kind in slow]
        ways = [along[k] / STATED_SPREAD if stated else one[k] / SPREAD for k, stated in enumerate(said, 1)]
        places = [0, *(UNKNOWNS.index(kind) for kind in self.free)]
        return places, along, slow, np.reshape(ways, (len(slow), len(one)))

    def __call__(self, x: Array) -> Seen:
        noise = self.noise(x)
        try:
            total, expected, seen, curvature = self.likelihood(noise)
        except np.linalg.LinAlgError:  # levels so far apart that rounding decides
            return np.inf, x, np.eye(len(x))
        places, along, slow, ways = self._ways
        slope = (expected - seen)[places]
        bend = _bent(curvature[places][:, places], expected[places], seen[places], along[:, 0] > 0)
        surprise = np.array(_surprises(self.rows, noise, slow, self.stated))
        slope = slope @ along + 2 * surprise @ ways
        bend = along.T @ bend @ along + 2 * ways.T @ ways
        total += float(surprise @ surprise)
        return total + 2.0 * price_of(noise, self.stated), slope, bend


def _bent(bend: Array, expected: Array, seen: Array, is_level: NDArray[np.bool_]) -> Array:
    """Return a curvature by ln θ whose step leads far: −2 ln L = e ln θ² + s/θ² of one level alone is least after ln(s/e)/2, the slope e − s over twice the logarithmic mean of both."""
    ratio = np.maximum(expected, 1e-300) / np.maximum(seen, 1e-300)
    mean = np.where(is_level, scipy.special.exprel(np.log(ratio)), 1.0)  # logarithmic mean over what is seen
    less = np.sqrt(np.minimum(mean, 1.0))
    more = np.where(is_level, seen * np.maximum(mean - 1.0, 0.0), np.maximum(expected - seen, 0.0))
    return np.asarray(bend * np.outer(less, less) + np.diag(2.0 * more))


def _by_last_step(bend: Array, moved: Array, turned: Array) -> Array:
    """Return a curvature that explains how the last step turned the slope (BFGS); along a step of none or of a ridge it stays."""
    along = bend @ moved
    if turned @ moved < STRAIGHT * (along @ moved):
        return bend
    return np.asarray(bend - np.outer(along, along) / (along @ moved) + np.outer(turned, turned) / (turned @ moved))


def _newton(objective: _Levels, x: Array, seen: Seen, below: float = np.inf) -> tuple[float, Array]:
    """Return the least value between bounds, and where, by Newton's steps from what is seen at x, halved until they lower it; ended early where it would not come `below`."""
    value, slope, bend = seen
    low, high = objective.ends
    for _ in range(MOST_STEPS):
        free = ~(((x <= low) & (slope > 0)) | ((x >= high) & (slope < 0)))
        step = np.zeros_like(x)
        step[free] = -np.linalg.solve(bend[free][:, free] + 1e-9 * np.eye(free.sum()), slope[free])
        step *= min(1.0, LONGEST / max(np.abs(step).max(), 1e-300))
        promised = -(slope @ step + 0.5 * step @ bend @ step)
        if promised < CLOSE or value - HOPE * promised > below:
            break
        for _ in range(MOST_HALVINGS):
            tried = np.clip(x + step, low, high)
            there = objective(tried)
            if there[0] < value:
                break
            step /= 2
        else:
            break
        known = _by_last_step(there[2], tried - x, there[1] - slope) if promised < NEAR else there[2]
        x, (value, slope, bend) = tried, (*there[:2], known)
    return value, x


def _other_slow(x: Array, free: Sequence[str]) -> list[Array]:
    """Return starts with all slow noise within a run as flicker, or as random walk: of the kind that it is not already."""
    kinds = [k for k, kind in enumerate(free, 1) if kind != "offset"]
    if len(kinds) < 2:
        return []
    total = _slow_rms(x[kinds])
    starts = []
    for k in kinds:
        if x[k] < total - PURE:
            start = x.copy()
            start[kinds] = total + USUAL - SPREAD
            start[k] = total
            start[1:] = np.clip(start[1:], LEAST, MOST)
            starts.append(start)
    return starts


def _slow_rms(x: Array) -> float:
    """Return ln of the rms of all slow noise within a run from those of its kinds."""
    return 0.5 * float(np.logaddexp.reduce(2.0 * x))


def log_prior(rows: NoiseRows, noise: Noise, stated: Noise | None = None) -> float:
    """Return the log of the weak prior of the slow levels that are there."""
    free = [kind for kind in KINDS[1:] if getattr(noise, kind) > 0]
    return -0.5 * sum(surprise**2 for surprise in _surprises(rows, noise, free, stated)) - price_of(noise, stated)


def price_of(noise: Noise, stated: Noise | None) -> float:
    """Return the log odds against correlated noise: none where it is stated."""
    return PRICE if noise.markov and not (stated is not None and stated.markov) else 0.0


def _surprises(rows: NoiseRows, noise: Noise, kinds: Sequence[str], stated: Noise | None) -> list[float]:
    """Return by how many standard deviations each level departs from its prior: about one that is stated, or about the white noise."""
    white, unit, found = noise.white / float(np.sqrt(rows.span)), rows.slow_units, []
    for kind in kinds:
        level, said = getattr(noise, kind), 0.0 if stated is None else getattr(stated, kind)
        usual, spread = (math.log(said), STATED_SPREAD) if said > 0 else (math.log(unit[kind] * white) + USUAL, SPREAD)
        found.append((math.log(level) - usual) / spread)
    return found
