"""The linear-Gaussian model of all responses of a campaign: y = J u + Σ X_k c_k + noise, every unknown with a normal prior.

J are the derivatives of the calibrated card by its values and by the starts of the runs, u of unit prior; X_k the columns of an effect,
its coefficients of standard deviation scale · spread · size. With rows whitened by the noise of each response,

    −2 ln L = ln|Σ| + ln|A| + |r|² − bᵀA⁻¹b,   A = 1 + XᵀX,  b = Xᵀr,

and what one more effect adds to it follows from its own small Gram matrix beside the columns that are there.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from compensation.arrays import Array
from compensation.noise import Noise
from compensation.noise_rows import NoiseRows
from studies.calibration.fit import CardFit, step_within
from studies.calibration.noise_levels import stated_noise
from studies.calibration.problem import CardProblem
from studies.effects import Effect

SCALES = 10.0 ** np.arange(-4.0, 0.51, 0.5)
"""Sizes of an effect over that of strong cases, every one as likely."""
TOLD = "told"
PRICE = -4.0
"""Log prior of one effect of some thirty against nothing."""

Columns = Mapping[str, NDArray[np.floating]]


@dataclass(frozen=True)
class Term:
    """An effect of one shape with its columns, by response (M, k).

    `members` are places of its columns, `unit` their prior sd in a strong case, `scale` one of SCALES, `price` the log
    prior of the choice, `brought` its log posterior when found, `bend` (M, p + 1) how its columns go with the card's coordinates.
    """

    effect: Effect
    response: str
    shape: tuple[float, ...]
    columns: Mapping[str, Array]
    members: tuple[int, ...]
    unit: Array
    scale: float = 1.0
    price: float = PRICE
    brought: float = 0.0
    bend: Mapping[str, Array] = field(default_factory=dict)

    @property
    def key(self) -> tuple[str, str]:
        """Name and response."""
        return self.effect.name, self.response

    @property
    def starts(self) -> bool:
        """Whether what each run began with is beside its members."""
        return len(self.unit) > len(self.members)

    @property
    def spread(self) -> Array:
        """Prior standard deviations of its coefficients."""
        return self.scale * self.unit


@dataclass(frozen=True)
class Shapes:
    """All shapes of an effect with the same members: the columns that are scanned."""

    effect: Effect
    response: str
    shapes: tuple[tuple[float, ...], ...]
    members: tuple[int, ...]
    columns: Columns
    """response -> (M, H, k)"""
    count: int
    """Shapes of the whole grid."""
    weight: float = 1.0
    """How many of the scanned ones each stands for."""


@dataclass(frozen=True)
class Linear:
    """The rows of a calibration linearised at u = 0: `target` (M,), `slope` (M, p); `told`, (q, p + 1), further white rows on u."""

    problem: CardProblem
    rows: Mapping[str, NoiseRows]
    target: Mapping[str, Array]
    slope: Mapping[str, Array]
    told: Array | None = None

    @classmethod
    def of(cls, fit: CardFit) -> "Linear":
        """Linearise at the most probable point."""
        state = fit.state
        target = {n: state.residual[n] + state.slope[n] @ state.point for n in fit.problem.responses}
        return cls(fit.problem, fit.rows, target, state.slope, fit.told)

    @property
    def responses(self) -> tuple[str, ...]:
        """Names of the responses."""
        return self.problem.responses

    @property
    def count(self) -> int:
        """Number of the card's coordinates, starts included."""
        return self.problem.count

    def bent(self, terms: Sequence[Term]) -> "Linear":
        """Return it beside terms whose columns go with the coordinates."""
        bends = [term.bend for term in terms if term.bend]
        if not bends:
            return self
        more = {name: np.sum([bend[name] for bend in bends if name in bend], axis=0) for name in set().union(*bends)}
        slope = {name: own + more[name][:, :-1] if name in more else own for name, own in self.slope.items()}
        target = {name: own + more[name][:, -1] if name in more else own for name, own in self.target.items()}
        return replace(self, slope=slope, target=target)

    def stated(self, name: str) -> Noise | None:
        """Return what the card states of the slow noise of a response."""
        return stated_noise(self.problem.instrument.noise, name)

    def columns(self, terms: Sequence[Term], name: str) -> Array:
        """Return J and the columns of terms in units of their priors for one response."""
        parts = [self.slope[name]]
        for term in terms:
            own = term.columns.get(name)
            parts.append(np.zeros((len(self.target[name]), len(term.unit))) if own is None else own * term.spread)
        return np.hstack(parts)

    def whitened(
        self,
        terms: Sequence[Term],
        noise: Mapping[str, Noise],
        keep: Mapping[str, Sequence[NDArray[np.bool_]]] | None = None,
    ) -> tuple[dict[str, Array], dict[str, Array], float]:
        """Return columns and target by response in rows of white noise of variance 1, and ln|Σ|; of the responses and rows to keep alone."""
        X, r, total = {}, {}, 0.0
        for name in self.responses if keep is None else keep:
            both = np.column_stack([self.columns(terms, name), self.target[name]])
            rows = self.rows[name]
            if keep is not None:
                both = both[np.concatenate(keep[name])]
                rows = rows.kept(keep[name])
            whitener = rows.whitener(noise[name])
            white = whitener(both)
            X[name], r[name], total = white[:, :-1], white[:, -1], total + whitener.log_determinant
        if (told := self.told_beside(terms)) is not None:
            X[TOLD], r[TOLD] = told[:, :-1], told[:, -1]
        return X, r, total

    def stacked(
        self,
        terms: Sequence[Term],
        noise: Mapping[str, Noise],
        keep: Mapping[str, Sequence[NDArray[np.bool_]]] | None = None,
    ) -> tuple[Array, Array]:
        """Return columns and target of all responses together, as `whitened` gives them."""
        X, r, _ = self.whitened(terms, noise, keep)
        return np.vstack(list(X.values())), np.concatenate(list(r.values()))

    def told_beside(self, terms: Sequence[Term]) -> Array | None:
        """Return the rows of what is told beside terms, of which nothing is."""
        if self.told is None:
            return None
        nothing = np.zeros((len(self.told), sum(len(term.unit) for term in terms)))
        return np.hstack([self.told[:, :-1], nothing, self.told[:, -1:]])


def split(terms: Sequence[Term], coordinates: Array) -> list[Array]:
    """Return the coefficients of every term in its own units, from the coordinates of all."""
    ends = np.cumsum([0, *(len(term.unit) for term in terms)])
    return [coordinates[a:b] * term.spread for a, b, term in zip(ends[:-1], ends[1:], terms, strict=True)]


def solve_posterior(X: Array, r: Array, ends: tuple[Array, Array] | None = None) -> tuple[Array, Array]:
    """Return mean and covariance of unknowns of unit prior from whitened rows; the first have `ends`, and where one is held at its end the others are solved anew."""
    p = X.shape[1]
    R = np.linalg.qr(np.column_stack([np.vstack([X, np.eye(p)]), np.append(r, np.zeros(p))])).R[:p]
    root = scipy.linalg.solve_triangular(R[:, :p], np.eye(p))
    mean = root @ R[:, p]
    if ends is not None:
        low, high = (
            np.append(end, np.full(p - len(end), fill)) for end, fill in zip(ends, (-np.inf, np.inf), strict=True)
        )
        if np.any((mean < low) | (mean > high)):
            mean = step_within(R[:, :p], R[:, p], low, high)
    return mean, root @ root.T
