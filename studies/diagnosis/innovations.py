"""Residuals in their order of time, freed of what the noise before them foretells, and the lines in their spectrum."""

from collections.abc import Sequence

import numpy as np

from studies.diagnosis.fit import Fit
from studies.diagnosis.states import FloatArray, average

OVERSAMPLED = 4
MOST_LINES = 2
BESIDE, ALONE = 5, 3.5
"""Rows around a row, and how many robust deviations it is from their median when it stands out alone."""


def find_innovations(fit: Fit, spikes: bool = True) -> list[FloatArray]:
    """Return the innovations of every run that has rows: independent and of one variance when the noise model is right.

    Without `spikes`, rows that stand out alone are brought to the level of their neighbours first.
    """
    problem = fit.problem
    left = problem.values - fit.columns() @ fit.linear.coefficients
    if not spikes:
        left = _without_spikes(left, problem.present)
    rest = problem.basis.rotate(left)
    begin, out = 0, []
    for vectors in problem.basis.vectors[: len(problem.basis.vectors) - (problem.delay_row is not None)]:
        end = begin + vectors.shape[0]
        spread = 1.0 + fit.linear.share * problem.basis.walk[begin:end]
        covariance = (vectors * spread) @ vectors.T
        out.append(np.linalg.solve(np.linalg.cholesky(covariance), vectors @ rest[begin:end]))
        begin = end
    return out


def _without_spikes(left: FloatArray, present: Sequence[np.ndarray]) -> FloatArray:
    from scipy.ndimage import median_filter

    out, begin = left.copy(), 0
    for mask in present:
        end = begin + int(mask.sum())
        if end - begin > 2 * BESIDE:
            level = median_filter(left[begin:end], BESIDE, mode="mirror")
            apart = left[begin:end] - level
            spiky = np.abs(apart) > ALONE * 1.4826 * np.median(np.abs(apart))
            out[begin:end][spiky] = level[spiky]
        begin = end
    return out


def line_powers(fit: Fit) -> tuple[FloatArray, FloatArray, int]:
    """Return frequencies (Hz), the power of the innovations there, and the number of runs.

    The power is twice the periodogram of each run over its variance, summed over the runs whatever their phases.
    """
    problem = fit.problem
    runs = [mask for mask in problem.present if mask.any()]
    states = [s for s, mask in zip(problem.states, problem.present, strict=True) if mask.any()]
    longest = max(float(np.ptp(s.time)) for s in states)
    step = states[0].step * problem.group
    frequencies = np.arange(1.0, longest / (2.5 * step), 1.0 / OVERSAMPLED) / longest
    power = np.zeros(frequencies.size)
    for innovations, mask, own in zip(find_innovations(fit), runs, states, strict=True):
        phases = np.exp(2j * np.pi * frequencies[:, None] * average(own.time, problem.group)[mask])
        power += 2.0 * np.abs(phases @ innovations) ** 2 / max(float(innovations @ innovations), 1e-300)
    return frequencies, power, len(runs)


def find_lines(fit: Fit) -> tuple[float, ...]:
    """Return the frequencies (Hz) whose power, summed over the runs whatever their phases, stands out most."""
    frequencies, power, _ = line_powers(fit)
    if frequencies.size < 3 * OVERSAMPLED:
        return ()
    lines: list[float] = []
    for _ in range(MOST_LINES):
        peak = int(np.argmax(power))
        lines.append(float(frequencies[peak]))
        power[max(0, peak - OVERSAMPLED) : peak + OVERSAMPLED + 1] = 0.0
    return tuple(lines)
