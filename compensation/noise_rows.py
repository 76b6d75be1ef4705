"""Likelihood of noise in the rows of several runs: whitening, and levels by restricted likelihood with a prior.

Levels of r ~ N(0, Σ + X Λ⁻¹ Xᵀ), Σ the covariance of `noise.Noise`, X the columns of what else is unknown and Λ the precision of
its prior, 0 for none, are those of the highest marginal likelihood

    −2 ln L = ln|Σ| + ln|Λ + XᵀΣ⁻¹X| + rᵀΣ⁻¹r − bᵀ(Λ + XᵀΣ⁻¹X)⁻¹b,   b = XᵀΣ⁻¹r

(restricted likelihood of Patterson & Thompson 1971, Biometrika 58, 545, where Λ = 0), beside a weak prior of the levels. Rows may be
uneven and have gaps. A run takes N³/3 operations per evaluation, once for all runs of equal rows: average long records to some hundred rows.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from compensation.arrays import Array
from compensation.errors import CompensationError
from compensation.noise import SLOW_TIMES, Noise, flicker, random_walk

Seen = tuple[float, Array, Array]
"""−2 ln L at a point, its slopes and curvature."""
KEPT = 4  # roots of the covariance of rows
COARSE = 150  # most rows of a run from which noise is estimated in a model with many unknowns
LEAST, MOST = -7.0, 8.0  # ln of the rms of slow noise within a run over that of a row's white noise
KINDS = ("white", "flicker", "walk", "offset")
WHITE = -0.3  # ln of white noise over the scatter of neighbouring rows, where the search begins
TOO_QUIET = 1.0  # ln by which white noise below that is odd
USUAL, SPREAD = -1.0, 3.0  # their weak prior, which keeps a level that the rows say nothing about from running away
STATED_SPREAD = 0.7  # the same about ln of a level that is stated: a factor of 2
LONGEST, CLOSE = 3.0, 1e-3  # of a step in ln of a level, and fall of −2 ln L that the last one promises
MOST_STEPS, MOST_HALVINGS = 50, 12
LOUD = 1.0  # ln of slow noise within a run over that of a row, beyond which its kinds are searched each for itself
STOOD = 0.1
"""Fall of −2 ln L up to which a search has ended where it began: every kind was searched when that was found."""
PURE = 0.02  # of it, within which it is of one kind


@dataclass(frozen=True)
class NoiseRows:
    """Rows of all runs in order: their times and spans (s), one array a run, and what their white variance is multiplied by."""

    times: tuple[Array, ...]
    spans: tuple[Array, ...]
    stretch: tuple[Array, ...]
    _of: "tuple[NoiseRows, Sequence[tuple[int, NDArray[np.bool_]]]] | None" = field(
        default=None, repr=False, compare=False
    )
    """Rows of which they are some, and the run and the rows of each that are kept."""
    _roots: dict[Noise, "Whitener"] = field(default_factory=dict, init=False, repr=False, compare=False)

    @classmethod
    def of(cls, times: Sequence[Array], spans: Sequence[Array] | None = None) -> "NoiseRows":
        """Make rows from times (s) and what each is the mean over (s): a usual step of its run unless given."""
        if not times or any(len(t) == 0 for t in times):
            raise CompensationError("correlated noise needs rows in every run.")
        if any((np.diff(t) <= 0).any() for t in times):
            raise CompensationError("the times of a run must increase.")
        own = tuple(np.asarray(t, dtype=float) for t in times)
        wide = [np.full(len(t), np.median(np.diff(t)) if len(t) > 1 else 1.0) for t in own] if spans is None else spans
        return cls(own, tuple(np.asarray(w, dtype=float) for w in wide), tuple(np.ones(len(t)) for t in own))

    @cached_property
    def count(self) -> int:
        """Number of rows of all runs."""
        return sum(len(t) for t in self.times)

    @cached_property
    def slices(self) -> tuple[slice, ...]:
        """Places of each run in stacked rows."""
        edges = np.cumsum([0, *(len(t) for t in self.times)])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(edges))

    @cached_property
    def _groups(self) -> tuple[tuple[Array, Array, tuple[int, ...]], ...]:
        """Flicker and walk matrices of every distinct set of rows, and the runs that have it."""
        found: dict[bytes, tuple[Array, Array, list[int]]] = {}
        for run, (t, spans, stretch) in enumerate(zip(self.times, self.spans, self.stretch, strict=True)):
            x = np.round(t - t[0], 3)
            key = x.tobytes() + np.round(spans, 6).tobytes() + np.round(stretch, 9).tobytes()
            if key not in found:
                found[key] = (*self._slow(run), [])
            found[key][2].append(run)
        return tuple((F, W, tuple(runs)) for F, W, runs in found.values())

    def _slow(self, run: int) -> tuple[Array, Array]:
        """Flicker and walk matrices of one run; of rows that are kept, from those of all: a walk is 0 where the first row begins."""
        if self._of is None:
            t = self.times[run]
            return _slow(np.round(t - t[0], 3).tobytes(), self.spans[run].tobytes())
        whole, kept = self._of
        place, mask = kept[run]
        F, W = (own[np.ix_(mask, mask)] for own in whole._slow(place))
        begin = self.times[run][0] - whole.times[place][0] + 0.5 * (whole.spans[place][0] - self.spans[run][0])
        return F, W - begin

    @cached_property
    def _starts(self) -> tuple[tuple[NDArray[np.intp], ...], "NoiseRows"]:
        """Rows at which the coarse rows of each run begin, and these: weighted means of neighbours."""
        every = [-(-len(t) // COARSE) for t in self.times]
        starts = tuple(np.arange(0, len(t), k) for t, k in zip(self.times, every, strict=True))
        rows = zip(self.times, self.spans, self.stretch, starts, strict=True)
        spans = tuple(np.add.reduceat(w, at) for w, at in zip(self.spans, starts, strict=True))
        means = [(np.add.reduceat(w * t, at), np.add.reduceat(w * s, at)) for t, w, s, at in rows]
        times, stretch = zip(*[(t / w, s / w) for (t, s), w in zip(means, spans, strict=True)], strict=True)
        return starts, NoiseRows(tuple(times), spans, tuple(stretch))

    @property
    def coarse(self) -> "NoiseRows":
        """At most `COARSE` rows a run: what is slow in a run is in these, for a small part of the work."""
        return self._starts[1]

    def means(self, columns: Array) -> Array:
        """Return stacked columns, (M,) or (M, p), in the coarse rows."""
        starts, coarse = self._starts
        places = np.concatenate([own.start + at for own, at in zip(self.slices, starts, strict=True)])
        weights = np.concatenate(self.spans).reshape(-1, *[1] * (columns.ndim - 1))
        total = np.concatenate(coarse.spans).reshape(-1, *[1] * (columns.ndim - 1))
        return np.asarray(np.add.reduceat(weights * columns, places, axis=0) / total)

    @cached_property
    def span(self) -> float:
        """Span of a usual row, s."""
        return float(np.median(np.concatenate(self.spans)))

    def slow_share(self, noise: Noise) -> float:
        """Return the rms of slow noise within a usual run over the white noise of a row."""
        unit = _units(self)
        slow = np.hypot(noise.flicker / unit["flicker"], noise.walk / unit["walk"] / 6**0.5)
        return float(slow / max(noise.white / self.span**0.5, 1e-300))

    def covariance(self, run: int, noise: Noise) -> Array:
        """Covariance of the rows of one run."""
        F, W = next((F, W) for F, W, runs in self._groups if run in runs)
        total: Array = noise.flicker**2 * F + noise.walk**2 * W + noise.offset**2
        np.einsum("ii->i", total)[:] += noise.white**2 * self.stretch[run] / self.spans[run]
        return total

    def variances(self, noise: Noise) -> Array:
        """Variance of every row."""
        return np.concatenate([np.diag(self.covariance(run, noise)) for run in range(len(self.times))])

    def whiten(self, columns: Array, noise: Noise) -> Array:
        """Return stacked columns, (M,) or (M, p), in which this noise is white of variance 1: L⁻¹ of Σ = L Lᵀ."""
        return self.whitener(noise)(columns)

    def whitener(self, noise: Noise) -> "Whitener":
        """Return the root of the covariance; those of a few levels are kept, for a search goes to and fro between them."""
        found = self._roots.pop(noise) if noise in self._roots else self._factor(noise)
        if len(self._roots) == KEPT:  # the one that was not asked for longest goes
            del self._roots[next(iter(self._roots))]
        self._roots[noise] = found
        return found

    def _factor(self, noise: Noise) -> "Whitener":
        """Factor the covariance of every distinct set of rows once; products with L⁻¹ cost less than solutions with L."""
        roots = ((cholesky(self.covariance(runs[0], noise)), runs) for _, _, runs in self._groups)
        return Whitener(self.slices, tuple((scipy.linalg.lapack.dtrtri(L, lower=1)[0], runs) for L, runs in roots))

    def left_out(self, residual: Array, noise: Noise) -> tuple[Array, Array]:
        """Return by how much each row, left out, is missed by what the others say of it, and the variance of that: y = Σ⁻¹r and 1 by (Σ⁻¹)_ii."""
        whitener, precision, weighted = self.whitener(noise), np.empty(self.count), np.empty(self.count)
        for K, runs in whitener.roots:
            told = np.sum(K**2, axis=0)
            for run in runs:
                own = self.slices[run]
                precision[own], weighted[own] = told, K.T @ (K @ residual[own])
        return weighted / precision, 1 / precision

    def kept(self, masks: Sequence[NDArray[np.bool_]]) -> "NoiseRows":
        """Return the rows that a mask of each run keeps; a run without any is left out."""
        parts = [k for k, mask in enumerate(masks) if mask.any()]
        own = [tuple(one[k][masks[k]] for k in parts) for one in (self.times, self.spans, self.stretch)]
        return NoiseRows(own[0], own[1], own[2], (self, [(k, masks[k]) for k in parts]))

    def deviance(
        self, target: Array, columns: Array, precision: Array, noise: Noise, mean: Array | None = None
    ) -> tuple[float, Array, Array]:
        """Return −2 ln L (see the module) of residuals (M,) beside columns (M, p) of prior precision and mean, its slopes by ln θ of the levels `KINDS`, and their curvature.

        With Σ_θ = θ ∂Σ/∂θ, V⁻¹ = Σ⁻¹ − U Uᵀ, U = Σ⁻¹ X C, C Cᵀ = (Λ + XᵀΣ⁻¹X)⁻¹, and v = Σ⁻¹ times what is left: tr V⁻¹Σ_θ − vᵀΣ_θ v,
        and vᵀΣ_θ V⁻¹ Σ_φ v, the mean of observed and expected information (Johnson & Thompson 1995, J. Dairy Sci. 78, 449).
        """
        whitener = self._factor(noise)
        white, total = whitener(np.column_stack([columns, target])), whitener.log_determinant
        X, r = white[:, :-1], white[:, -1]
        about = np.zeros(X.shape[1]) if mean is None else mean
        A = X.T @ X
        root = cholesky(A + np.diag(precision + 1e-12 * (1 + A.diagonal())))
        beside = solve_lower(root, X.T).T
        found = solve_lower(root, solve_lower(root, X.T @ r + precision * about), transposed=True)
        rest = r - X @ found
        total += float(rest @ rest + (found - about) @ (precision * (found - about)))
        total += 2 * float(np.log(np.diag(root)).sum())
        both, slopes, moved = np.column_stack([beside, rest]), np.zeros(len(KINDS)), np.zeros((len(rest), len(KINDS)))
        levels = 2 * np.array([noise.white, noise.flicker, noise.walk, noise.offset]) ** 2
        for (K, runs), (F, W, _) in zip(whitener.roots, self._groups, strict=True):
            S = len(runs) * scipy.linalg.lapack.dlauum(K, lower=1)[0]  # of V⁻¹ − v vᵀ the lower half
            wide = self.stretch[runs[0]] / self.spans[runs[0]]
            for run in runs:
                U = multiply_lower(K, both[self.slices[run]], transposed=True)
                S = scipy.linalg.blas.dsyrk(-1.0, U, beta=1.0, c=S, lower=1)
                v = U[:, -1]
                own = np.column_stack([wide * v, F @ v, W @ v, np.full(len(v), v.sum())])
                moved[self.slices[run]] = multiply_lower(K, own * levels)
            diagonal = S.diagonal()
            by_kind = diagonal @ wide, *(2 * np.vdot(S, own) - diagonal @ own.diagonal() for own in (F, W))
            slopes += levels * np.array([*by_kind, 2 * S.sum() - diagonal.sum()])
        told = beside.T @ moved
        return total, slopes, moved.T @ moved - told.T @ told


@lru_cache(maxsize=32)
def _slow(times: bytes, spans: bytes) -> tuple[Array, Array]:
    """Flicker and walk matrices of rows, which many sets share."""
    x, wide = np.frombuffer(times), np.frombuffer(spans)
    return flicker(x, wide), random_walk(x, wide)


def cholesky(matrix: Array) -> Array:
    """Lower root of a symmetric matrix straight from LAPACK: of small ones, checks cost as much as the work."""
    root, failed = scipy.linalg.lapack.dpotrf(matrix, lower=1, clean=1)
    if failed:
        raise np.linalg.LinAlgError("the covariance of the rows is not positive definite.")
    return np.asarray(root)


def solve_lower(root: Array, columns: Array, transposed: bool = False) -> Array:
    """Return L⁻¹ or L⁻ᵀ times columns, (N,) or (N, p)."""
    if not columns.size:
        return columns
    return np.asarray(scipy.linalg.lapack.dtrtrs(root, columns, lower=1, trans=transposed)[0]).reshape(columns.shape)


def multiply_lower(root: NDArray[np.floating], columns: NDArray[np.floating], transposed: bool = False) -> Array:
    """Return L or Lᵀ times columns, (N,) or (N, p), in their digits."""
    if columns.ndim == 1:
        return np.asarray((root.T if transposed else root) @ columns)
    multiply = scipy.linalg.blas.strmm if columns.dtype == np.float32 else scipy.linalg.blas.dtrmm
    return np.asarray(multiply(1.0, root, columns, lower=1, trans_a=transposed))


@dataclass(frozen=True)
class Whitener:
    """L⁻¹ of the covariance L Lᵀ of rows, with the runs that each is of."""

    slices: tuple[slice, ...]
    roots: tuple[tuple[Array, tuple[int, ...]], ...]

    def __call__(self, columns: NDArray[np.floating]) -> Array:
        """Return stacked columns, (M,) or (M, p), whitened; those of seven digits in seven."""
        white: NDArray[np.floating] = np.array(columns, np.float32 if columns.dtype == np.float32 else np.float64)
        for K, runs in self.roots:
            root = K.astype(white.dtype, copy=False)
            for run in runs:
                white[self.slices[run]] = multiply_lower(root, white[self.slices[run]])
        return white.astype(np.float64, copy=False)

    @property
    def log_determinant(self) -> float:
        """ln|Σ| of all rows."""
        return sum(-2 * len(runs) * float(np.log(K.diagonal()).sum()) for K, runs in self.roots)


def estimate_noise(
    rows: NoiseRows, target: Array, columns: Array | None = None, precision: Array | None = None,
    kinds: Sequence[str] = KINDS, near: Noise | None = None, stated: Noise | None = None,
) -> Noise:  # fmt: skip
    """Estimate the levels of the noise by its marginal likelihood.

    `target` (M,) are residuals of all runs, `columns` (M, p) what else is unknown, of prior `precision`; `kinds`:
    "white" (always), "flicker", "walk", "offset"; `near`: where to begin; `stated`: slow levels known to a factor of 3.
    """
    X = np.zeros((rows.count, 0)) if columns is None else columns
    size = np.linalg.norm(X, axis=0)
    size[size == 0] = 1.0
    lam = np.zeros(X.shape[1]) if precision is None else precision
    X, lam = X / size, lam / size**2
    free_part = np.linalg.lstsq(np.vstack([X, np.diag(np.sqrt(lam))]), np.append(target, np.zeros(len(lam))))[0]
    rest = target - X @ free_part
    step = np.concatenate([np.diff(rest[s]) for s in rows.slices])
    spread = float(np.median(np.abs(step))) / 0.954 if step.size else 0.0
    spread = max(spread, 1e-14 * float(np.abs(target).max()), 1e-300)
    free = [kind for kind in KINDS[1:] if kind in kinds and (kind != "offset" or len(rows.times) > 1)]
    root, unit = float(np.sqrt(rows.span)), _units(rows)

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
            total, slopes, curvature = rows.deviance(rest, X, lam, noise, -free_part)
        except np.linalg.LinAlgError:  # levels so far apart that rounding decides
            return np.inf, x, np.eye(len(x))
        bend = curvature[np.ix_(places, places)] + np.diag(2 * np.maximum(slopes[places], 0.0))  # Σ goes with θ²
        slope, bend = slopes[places] @ along, along.T @ bend @ along
        for k, (surprise, spread, absolute) in enumerate(_surprises(rows, noise, free, stated), 1):
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


def _units(rows: NoiseRows) -> dict[str, float]:
    """Slow levels whose rms in a run is about 1."""
    seconds = max(max(float(np.ptp(t)) for t in rows.times), 1e-6)
    return {"flicker": SLOW_TIMES**-0.5, "walk": seconds**-0.5, "offset": 1.0}


def _surprises(
    rows: NoiseRows, noise: Noise, kinds: Sequence[str], stated: Noise | None
) -> list[tuple[float, float, bool]]:
    """Return by how many standard deviations each level departs from its prior, that deviation, and whether it is that of a stated level."""
    white, unit, found = noise.white / float(np.sqrt(rows.span)), _units(rows), []
    for kind in kinds:
        level, said = getattr(noise, kind), 0.0 if stated is None else getattr(stated, kind)
        if said > 0:
            found.append((float(np.log(level / said)) / STATED_SPREAD, STATED_SPREAD, True))
        else:
            found.append(((float(np.log(level / unit[kind] / white)) - USUAL) / SPREAD, SPREAD, False))
    return found
