"""Noise of a response: white noise and a wander of unknown kind and share, in the bases where both are independent.

The noise of one run has the covariance σ² (1 + q K), K one of `KERNELS`, q one of `SHARES` (`compensation.wander`). What is
noise is a matter of belief: a wander whose rms over a run is many times the white noise of one row is structure
that nobody has explained, not noise. `NoiseModels.prior` says how many.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.special import gammaln

from compensation.wander import Covariance, Eigenbasis, flicker, gauss_markov, random_walk
from studies.diagnosis.constants import CONSTANTS
from studies.effects.states import FloatArray

SHARES = np.array([0.0, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 400.0, 2000.0, 6000.0, 2e4, 6e4, 2e5])


def _walked(t: FloatArray) -> FloatArray:
    """Covariance of a random walk of variance 1 after 8 h that has walked for 4 h when the run starts."""
    return random_walk(t) / 8.0 + 0.5


def _oscillator(t: FloatArray) -> FloatArray:
    """Covariance of flicker noise and a random walk together: every oscillator has both (IEEE Std 1139)."""
    return _walked(t) + flicker(t)


KERNELS: Mapping[str, Covariance] = {
    "random walk": _walked,
    "flicker": flicker,
    "Gauss–Markov, 10 min": partial(gauss_markov, tau=600.0),
    "Gauss–Markov, 45 min": partial(gauss_markov, tau=2700.0),
    "flicker and random walk": _oscillator,
}
"""Kinds of wander."""


def student_log(square: FloatArray, freedom: float) -> float:
    """Return the log likelihood of Student's law at its likeliest scale, from squares."""
    scale = max(float(np.mean(square)), 1e-300)
    for _ in range(30):
        scale = float(np.mean((freedom + 1.0) * square / (freedom + square / scale)))
    norm = gammaln((freedom + 1.0) / 2.0) - gammaln(freedom / 2.0) - 0.5 * np.log(np.pi * freedom * scale)
    return float(square.size * norm - (freedom + 1.0) / 2.0 * np.log1p(square / (freedom * scale)).sum())


def tails_of(values: FloatArray) -> float:
    """Return the likeliest degrees of freedom of Student's law for a sample about 0."""
    square = values[values != 0.0] ** 2
    return max(TAILS, key=lambda freedom: student_log(square, freedom)) if square.size else TAILS[-1]


TAILS = (3.0, 4.0, 6.0, 9.0, 15.0, 30.0, 1e3)


MOST_MOMENTS = 31
"""Rows of a mean beyond which it is as one over all moments."""


@dataclass(frozen=True)
class NoiseModels:
    """Every noise model that a response is tried with: each kind of wander with each share.

    Attributes
    ----------
    bases : tuple of Eigenbasis
        One a kind, in the order of `KERNELS`.
    rows : float
        Rows of the record to a row of the grid.
    floor : float
        Variance of a row of the record beyond that, over the white variance of a row of the grid: what the thermometer's reading
        brings into it, and what is white from row to row although the means of many rows are not.
    tails : float
        Degrees of freedom of Student's law of the noise of a row.
    """

    bases: tuple[Eigenbasis, ...]
    rows: float
    floor: float = 0.0
    tails: float = np.inf

    @classmethod
    def of(cls, times: Sequence[FloatArray], rows: float, step: float = 0.0) -> "NoiseModels":
        """Build every basis from the times of the present rows, one array a run, each the mean of `rows` over a step."""
        count = int(np.clip(round(rows), 1, MOST_MOMENTS))
        moments = step * ((np.arange(count) + 0.5) / count - 0.5)
        return cls(tuple(Eigenbasis.of(times, kernel, moments) for kernel in KERNELS.values()), rows)

    def weights(self, kind: int) -> FloatArray:
        """Inverse variances over σ² for every share, (S, M)."""
        return np.asarray(1.0 / (1.0 + SHARES[:, None] * self.bases[kind].eigenvalues))

    def ratio(self, kind: int) -> FloatArray:
        """Return rms of the wander within a run over the noise of one row of the record within minutes, for every share."""
        own = self.bases[kind]
        return np.sqrt(SHARES * own.within / (self.rows + self.floor + SHARES * own.brief))

    def prior(self, kind: int) -> FloatArray:
        """Log prior of every share: a wander far above the white noise of a row is not believed to be noise.

        Beyond the usual ratio it falls as a normal law of the ratio's logarithm, but never below that of unexplained
        structure: then it is that.
        """
        usual, fall, least = CONSTANTS["wander_usual"], CONSTANTS["wander_fall"], CONSTANTS["log_prior_unknown"]
        excess = np.log(np.maximum(self.ratio(kind) / usual, 1.0)) / fall
        return np.asarray(np.maximum(-0.5 * excess**2, least))

    def believed(self, kind: int, share: int) -> bool:
        """Whether a wander is believed to be noise."""
        return bool(self.prior(kind)[share] > CONSTANTS["log_prior_unknown"])
