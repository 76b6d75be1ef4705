"""Likelihood of noise in the rows of several runs: whitening, and the restricted likelihood of levels (found in `compensation.noise_estimate`).

Levels of r ~ N(0, Σ + X Λ⁻¹ Xᵀ), Σ the covariance of `noise.Noise`, X the columns of what else is unknown and Λ the precision of
its prior, 0 for none, are those of the highest marginal likelihood

    −2 ln L = ln|Σ| + ln|Λ + XᵀΣ⁻¹X| + rᵀΣ⁻¹r − bᵀ(Λ + XᵀΣ⁻¹X)⁻¹b,   b = XᵀΣ⁻¹r

(restricted likelihood of Patterson & Thompson 1971, Biometrika 58, 545, where Λ = 0), beside a weak prior of the levels. Rows may be
uneven and have gaps. A run takes N³/3 operations per evaluation, once for all runs of equal rows: average long records to some hundred rows.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from compensation.arrays import Array
from compensation.errors import CompensationError
from compensation.noise import SLOW_TIMES, Noise, flicker, gauss_markov, gauss_markov_and_slope, random_walk

KEPT = 4  # roots of the covariance of rows
COARSE = 150  # most rows of a run from which noise is estimated in a model with many unknowns
CLOSER = 3.0  # correlated noise follows structure with a third of the rms that flicker or a walk need (a quartic: 2.2 for 6.0)
KINDS = ("white", "flicker", "walk", "offset", "markov")
UNKNOWNS = (*KINDS, "markov_time")


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
    def together(self) -> tuple[int, ...]:
        """How many rows of each run make a coarse one."""
        return tuple(-(-len(t) // COARSE) for t in self.times)

    @cached_property
    def _starts(self) -> tuple[tuple[NDArray[np.intp], ...], "NoiseRows"]:
        """Rows at which the coarse rows of each run begin, and these: weighted means of neighbours."""
        starts = tuple(np.arange(0, len(t), k) for t, k in zip(self.times, self.together, strict=True))
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

    @cached_property
    def slow_units(self) -> dict[str, float]:
        """Slow levels whose rms in a run is about 1."""
        seconds = max(max(float(np.ptp(t)) for t in self.times), 1e-6)
        return {"flicker": SLOW_TIMES**-0.5, "walk": seconds**-0.5, "offset": 1.0, "markov": 1.0}

    def slow_share(self, noise: Noise) -> float:
        """Return the rms of slow noise within a usual run over the white noise of a row, correlated noise `CLOSER` times."""
        unit = self.slow_units
        slow = np.array([noise.flicker / unit["flicker"], noise.walk / unit["walk"] / 6**0.5, CLOSER * noise.markov])
        return float(np.linalg.norm(slow) / max(noise.white / self.span**0.5, 1e-300))

    def covariance(self, run: int, noise: Noise) -> Array:
        """Covariance of the rows of one run."""
        F, W = next((F, W) for F, W, runs in self._groups if run in runs)
        total: Array = noise.flicker**2 * F + noise.walk**2 * W + noise.offset**2
        if noise.markov:
            total += noise.markov**2 * gauss_markov(self.times[run], self.spans[run], noise.markov_time)
        total.reshape(-1)[:: len(total) + 1] += noise.white**2 * self.stretch[run] / self.spans[run]
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
    ) -> tuple[float, Array, Array, Array]:
        """Return −2 ln L (see the module) of residuals (M,) beside columns (M, p) of prior precision and mean, the two parts of its slopes by ln θ of the `UNKNOWNS`, and their curvature.

        With Σ_θ = θ ∂Σ/∂θ, V⁻¹ = Σ⁻¹ − U Uᵀ, U = Σ⁻¹ X C, C Cᵀ = (Λ + XᵀΣ⁻¹X)⁻¹, and v = Σ⁻¹ times what is left: tr V⁻¹Σ_θ, what is expected
        of the noise, less vᵀΣ_θ v, what is seen; and vᵀΣ_θ V⁻¹ Σ_φ v, the mean of observed and expected information (Johnson & Thompson 1995, J. Dairy Sci. 78, 449).
        """
        total, whitener, X, root, rest = self._likelihood(target, columns, precision, noise, mean)
        beside = solve_lower(root, X.T).T
        both, levels = np.column_stack([beside, rest]), level_slopes(noise)
        expected, seen = np.zeros((2, len(UNKNOWNS)))
        moved = np.zeros((len(rest), len(UNKNOWNS)))
        for (K, runs), (F, W, _) in zip(whitener.roots, self._groups, strict=True):
            S = len(runs) * scipy.linalg.lapack.dlauum(K, lower=1)[0]  # of V⁻¹ the lower half
            wide = self.stretch[runs[0]] / self.spans[runs[0]]
            correlated = self._correlated(runs[0], noise)
            theirs = levels[: 4 + len(correlated)]
            for run in runs:
                U = multiply_lower(K, both[self.slices[run]], transposed=True)
                S = scipy.linalg.blas.dsyrk(-1.0, U[:, :-1], beta=1.0, c=S, lower=1)
                v = U[:, -1]
                own = np.empty((len(v), len(theirs)), order="F")
                for k, column in enumerate((wide * v, F @ v, W @ v, v.sum(), *(M @ v for M in correlated))):
                    own[:, k] = column
                seen[: len(theirs)] += theirs * (v @ own)
                moved[self.slices[run], : len(theirs)] = multiply_lower(K, own * theirs)
            diagonal = S.diagonal()
            # Sᵀ as it lies in memory: the covariances are symmetric
            f, w, *m = (2 * np.vdot(S.T, own) - diagonal @ own.diagonal() for own in (F, W, *correlated))
            expected[: len(theirs)] += theirs * np.array([diagonal @ wide, f, w, 2 * S.sum() - diagonal.sum(), *m])
        told = beside.T @ moved
        return total, expected, seen, moved.T @ moved - told.T @ told

    def likelihood(self, target: Array, columns: Array, precision: Array, noise: Noise) -> float:
        """Return −2 ln L alone, without slopes and curvature."""
        return self._likelihood(target, columns, precision, noise, None)[0]

    def _likelihood(
        self, target: Array, columns: Array, precision: Array, noise: Noise, mean: Array | None
    ) -> tuple[float, "Whitener", Array, Array, Array]:
        """Return −2 ln L with the roots of Σ, L⁻¹ X, the root of Λ + XᵀΣ⁻¹X and what is left, whitened."""
        whitener = self._factor(noise)
        white, total = whitener(np.column_stack([columns, target])), whitener.log_determinant
        X, r = white[:, :-1], white[:, -1]
        about = np.zeros(X.shape[1]) if mean is None else mean
        A = X.T @ X
        root = cholesky(A + np.diag(precision + 1e-12 * (1 + A.diagonal())))
        found = solve_lower(root, solve_lower(root, X.T @ r + precision * about), transposed=True)
        rest = r - X @ found
        total += float(rest @ rest + (found - about) @ (precision * (found - about)))
        return total + 2 * float(np.log(np.diag(root)).sum()), whitener, X, root, rest

    def _correlated(self, run: int, noise: Noise) -> tuple[Array, ...]:
        """Covariance of the rows of a run by correlated noise of rms 1, and its slope by ln of its time; none without such noise."""
        own = self.times[run], self.spans[run], noise.markov_time
        return gauss_markov_and_slope(*own) if noise.markov else ()


def level_slopes(noise: Noise) -> Array:
    """Return what the covariance of each of `UNKNOWNS` at a level of 1 is multiplied by in the slope by its ln."""
    squares = np.array([getattr(noise, kind) for kind in KINDS]) ** 2
    return np.append(2 * squares, squares[-1])


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
