"""What an ideal detector would see: it knows the form of the hidden effect and the noise, but not the baseline's values.

With the noise-free response y of the effect alone, the baseline's columns F (priors D, linearised where it fits), the true
covariance C of the noise and another, C′, the log likelihood of the truth over that of "no effect, noise C′" is on average

    L = ½ [min_φ (y − F φ)ᵀ C′⁻¹ (y − F φ) + φᵀ D⁻² φ + tr(C′⁻¹ C) − n + log |C′|/|C|].

C′ = C gives the ratio where the noise is known; the least of all C′ = C + a wander of the diagnosis' kinds that where nobody knows
whether the noise wanders. What stays below the price of a name (its prior and the margin) cannot be named by anybody.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from studies.diagnosis.noise import KERNELS, SHARES


@dataclass(frozen=True)
class Ceiling:
    """Log likelihood ratio of an effect with the noise known, and with a wander possible."""

    known: float
    wandering: float


def above(campaign, plain, rows, noise, white):
    """Return the ceiling of a response without its noise, in steps of the grid, above a baseline in noise of given covariance.

    Wanders are counted in the white noise of a step, `white`.
    """
    problem, tangent = plain.problem, plain.tangent
    times = [run.time[mask] for run, mask in zip(campaign.runs, problem.present, strict=True)]
    target = problem.split(problem.stack(rows) + problem.stack(tangent.shift))
    columns = problem.split(problem.stack(tangent.columns))

    def ratio(kernel, share):
        wander = [share * white * kernel(t, campaign.step) for t in times] if share else [0.0] * len(times)
        return 0.5 * _divergence(target, columns, tangent.prior, noise, wander)

    known = ratio(None, 0.0)
    ratios = [ratio(kernel, share) for kernel in KERNELS.values() for share in SHARES[1:-3]]
    return Ceiling(known, min(known, *ratios))


def _divergence(target, columns, prior, noise, wander):
    """Return twice the mean log likelihood ratio."""
    total, ys, xs = 0.0, [], []
    for y, x, own, more in zip(target, columns, noise, wander, strict=True):
        root = cholesky(own + more, lower=True)
        white = solve_triangular(root, np.column_stack([y, x]), lower=True)
        ys.append(white[:, 0])
        xs.append(white[:, 1:])
        if np.ndim(more):
            inner = cholesky(own, lower=True)
            total += float(np.sum(solve_triangular(root, inner, lower=True) ** 2)) - y.size
            total += 2.0 * float(np.sum(np.log(np.diag(root)) - np.log(np.diag(inner))))
    held = np.diag(np.where(np.isinf(prior), 0.0, 1.0 / prior))
    whole, y = np.concatenate([*xs, held]), np.concatenate([*ys, np.zeros(prior.size)])
    size = np.maximum(np.linalg.norm(whole, axis=0), 1e-300)
    found = np.linalg.lstsq(whole / size, y, rcond=1e-12)[0]
    return total + float(np.sum((y - whole / size @ found) ** 2))
