"""Is a coefficient the same wherever it is measured? A second witness against effects that only resemble the truth.

A physical coefficient is one number: in every run, hot and cold, heating and cooling, early and late in a run. For each of
these splits the coefficients of one effect may differ between the parts, everything else is refitted (shapes and the lag
by their derivatives), and the likelihood-ratio test of equality gives p from χ². The smallest p counts, times the
number of splits (Bonferroni).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import chi2

from studies.diagnosis.baseline import Problem
from studies.diagnosis.fit import Fit, jacobian_of
from studies.diagnosis.likelihood import fit_linear, orthonormal, unit
from studies.diagnosis.states import FloatArray

SURVIVES = 1e-3
"""A difference between two parts of which the model absorbs all but this share of its norm cannot be tested."""


@dataclass(frozen=True)
class Agreement:
    """How well the parts of a record agree about one effect.

    Attributes
    ----------
    p : float
        Smallest p of the splits, corrected for their number; 1 where nothing could be split.
    split : str
        Which split that is.
    gain : float
        Twice the log-likelihood ratio of that split.
    by_split : mapping
        p of each split, uncorrected.
    """

    p: float = 1.0
    split: str = ""
    gain: float = 0.0
    by_split: Mapping[str, float] = field(default_factory=dict)


def splits_of(problem: Problem) -> dict[str, FloatArray]:
    """Return the parts of each split as columns of ones and zeros, (M, parts)."""
    views = problem.views(problem.tau)

    def stack(parts: list[FloatArray]) -> FloatArray:
        return problem.stack(parts)

    temperature = stack([view.seen.resonator for view in views])
    rate = stack([view.seen.rate for view in views])
    half = stack([(np.arange(v.seen.time.size) < 0.5 * v.seen.time.size).astype(float) for v in views])
    run = stack([np.full(view.seen.time.size, float(k + 1)) for k, view in enumerate(views)])
    rows = run > 0  # the row of a prior belongs to no part
    middle = np.median(temperature[rows])

    def two(mask: np.ndarray) -> FloatArray:
        return np.stack([mask & rows, ~mask & rows], axis=1).astype(float)

    out = {
        "hot and cold": two(temperature > middle),
        "heating and cooling": two(rate > 0.0),
        "early and late": two(half > 0.5),
    }
    if len(views) > 1:
        out["run and run"] = np.stack([run == k + 1 for k in range(len(views))], axis=1).astype(float)
    return out


def consistency(fit: Fit, index: int) -> Agreement:
    """Test whether the coefficients of one effect of a fit are the same in all parts of the record.

    Parameters
    ----------
    fit : Fit
    index : int
        Which of its terms.
    """
    problem = fit.problem
    columns = np.concatenate([fit.columns(), jacobian_of(fit)], axis=1)
    begin = fit.linear.coefficients.size - sum(term.count for term in fit.terms[index:])
    own = columns[:, begin : begin + fit.terms[index].count]
    basis, target = problem.basis, problem.rotated
    model = basis.rotate(columns)
    together = fit_linear(basis, target, model).score
    root = np.sqrt(basis.weights(fit.linear.share))[:, None]
    span = orthonormal(unit(model) * root)
    p: dict[str, float] = {}
    gains: dict[str, float] = {}
    for name, parts in splits_of(problem).items():
        apart = np.concatenate([own * part[:, None] for part in parts.T[1:]], axis=1)
        apart = basis.rotate(apart)
        white = unit(apart) * root
        left = white - span @ (span.T @ white)
        size = np.linalg.svd(left, compute_uv=False) / max(float(np.linalg.norm(white, 2)), 1e-300)
        freedom = int((size > SURVIVES).sum())
        seen = np.linalg.norm(left, axis=0) > SURVIVES * np.linalg.norm(white, axis=0)
        if freedom == 0 or not seen.any():
            continue
        split = fit_linear(basis, target, np.concatenate([unit(model), unit(apart[:, seen])], axis=1)).score
        gains[name] = max(together - split, 0.0)
        p[name] = float(chi2.sf(gains[name], min(freedom, int(seen.sum()))))
    if not p:
        return Agreement()
    worst = min(p, key=lambda name: p[name])
    return Agreement(min(1.0, p[worst] * len(p)), worst, gains[worst], p)
