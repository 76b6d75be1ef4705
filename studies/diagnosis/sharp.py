"""Witnesses for what no smooth function follows: bursts, one step, one line in the spectrum.

Like the smooth witness they name no cause. Where the library knows jumps and lines it has named them before; what is left
of them then is more of the same kind.
"""

import numpy as np
from scipy.stats import chi2

from studies.diagnosis.discrepancy import Leftover, near_shares
from studies.diagnosis.fit import Fit, jacobian_of
from studies.diagnosis.innovations import find_innovations, line_powers
from studies.diagnosis.likelihood import orthonormal, unit

SHARP = 4.0
"""Second difference of a model, over the noise of a row, at which the rows around it are no witnesses."""


def sharp_leftover(fit: Fit) -> Leftover:
    """Return the strongest of the three witnesses."""
    found = {
        "time, brief events": brief_events(fit),
        "time, a step": step_evidence(fit),
        "time, a line": line_evidence(fit),
    }
    name = max(found, key=lambda key: found[key])
    return Leftover(name, found[name])


def brief_events(fit: Fit) -> float:
    """Return how far the innovations are from Gaussian: evidence of bursts that no smooth function follows.

    The excess kurtosis of the innovations (residuals whitened in their order of time), scaled so that 17 stands for
    an excess of 1.2, about seven standard deviations of a Gaussian record of 800 rows. Rows that stand out alone are
    noise with heavy tails, no event; rows where the model itself bends sharply (a step of a voltage within one step of
    the grid) are left out: nobody knows them well.
    """
    model = fit.columns() @ fit.linear.coefficients
    edge = SHARP * np.sqrt(fit.linear.variance)
    begin, parts = 0, []
    for innovations in find_innovations(fit, spikes=False):
        end = begin + innovations.size
        if innovations.size > 8:
            bend = np.zeros(innovations.size + 4)
            bend[3:-3] = np.abs(np.diff(model[begin:end], 2))
            beside = np.max(np.stack([bend[k : k + innovations.size] for k in range(5)]), axis=0)
            parts.append(innovations[beside < edge])
        begin = end
    innovations = np.concatenate(parts) if parts else np.empty(0)
    if innovations.size < 50:
        return 0.0
    innovations = innovations / max(float(innovations.std()), 1e-300)
    return float(17.0 * (np.mean(innovations**4) - 3.0) / 1.2 * min(1.0, np.sqrt(innovations.size / 800.0)))


def step_evidence(fit: Fit) -> float:
    """Return the evidence of one step anywhere in one run, net of the look at every row.

    A step s_k in the noise basis gains rows · ln(R² / (R² − (s_k·r)² / |s_k|²)), with r the whitened residual of the model
    and s_k freed of what the model absorbs.
    """
    problem, basis = fit.problem, fit.problem.basis
    model = unit(basis.rotate(np.concatenate([fit.columns(), jacobian_of(fit)], axis=1)))
    rows = problem.values.size
    null = best = np.inf
    for share in near_shares(fit.linear.share):
        root = np.sqrt(basis.weights(share))
        ortho = orthonormal(model * root[:, None])
        rest = problem.rotated * root
        rest = rest - ortho @ (ortho.T @ rest)
        total = float(rest @ rest)
        determinant = basis.log_determinant(share)
        null = min(null, rows * np.log(total) + determinant)
        begin = 0
        for block, mask in enumerate(mask for mask in problem.present if mask.any()):
            end = begin + int(mask.sum())
            steps = basis.steps(block) * root[begin:end, None]
            size = (steps**2).sum(axis=0)
            free = size - ((ortho[begin:end].T @ steps) ** 2).sum(axis=0)
            gain = (rest[begin:end] @ steps) ** 2 / np.where(free > 1e-3 * size, free, np.inf)
            if gain.size:
                best = min(best, rows * np.log(max(total - float(gain.max()), 1e-9 * total)) + determinant)
            begin = end
    return float(null - best - 2.0 * np.log(rows))


def line_evidence(fit: Fit) -> float:
    """Return the evidence of one line in the spectrum of the innovations, net of the look at every frequency.

    Twice the periodogram of unit white noise, summed over R runs whatever their phases, is χ² of 2R.
    """
    frequencies, power, runs = line_powers(fit)
    if not frequencies.size:
        return 0.0
    return float(-2.0 * chi2.logsf(power.max(), 2 * runs) - 2.0 * np.log(frequencies.size))
