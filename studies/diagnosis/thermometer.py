"""The frequency as a thermometer, freed of what is not temperature, and the smooth state that effects see.

A shift of the frequency that is not thermal (voltage, amplitude, ageing, a jump) would leak into bias and 1/Q through
their polynomials; it is taken out before.
"""

from dataclasses import dataclass, replace

import numpy as np

from studies.diagnosis.baseline import term_columns
from studies.diagnosis.campaign import Campaign
from studies.diagnosis.fit import Fit
from studies.diagnosis.states import FloatArray, States


@dataclass(frozen=True)
class Thermometer:
    """Temperature of the resonator from its frequency.

    Attributes
    ----------
    change : tuple of (N,) arrays
        Change of frequency over its slope at the reference, K: the regressor of the bias.
    excess : tuple of (N,) arrays
        The same through the bent frequency law: temperature minus reference, K.
    states : tuple of States
        Runs on the fine grid with the smooth fitted resonator temperature.
    """

    change: tuple[FloatArray, ...]
    excess: tuple[FloatArray, ...]
    states: tuple[States, ...]


def read_thermometer(campaign: Campaign, fit: Fit, corrected: bool = True) -> Thermometer | None:
    """Turn the fitted frequency of a campaign into a thermometer.

    Parameters
    ----------
    campaign : Campaign
    fit : Fit
        Of the frequency.
    corrected : bool
        Take the non-thermal terms out.

    Returns
    -------
    thermometer : Thermometer or None
        None when the frequency hardly follows temperature, so that it is no thermometer.
    """
    problem, coefficients = fit.problem, fit.linear.coefficients
    slope = float(coefficients[1])
    if slope == 0.0 or abs(slope) < 3.0 * np.sqrt(fit.linear.covariance[1, 1]):
        return None
    views = problem.views(problem.tau)
    model = [fit_part for fit_part in np.split(problem.model(problem.tau, fit.terms) @ coefficients, _ends(fit))]
    changes, excesses, states = [], [], []
    for k, (run, view) in enumerate(zip(campaign.runs, views, strict=True)):
        measured = run.responses["frequency_Hz"].copy()
        gaps = ~np.isfinite(measured)
        if gaps.any():
            whole = np.full(measured.shape, np.nan)
            whole[~gaps] = model[k]
            rest = measured - whole
            smooth = slope * view.coarse.excess + coefficients[2] * view.coarse.excess**2 + coefficients[0]
            measured[gaps] = smooth[gaps] + (np.nanmedian(rest) if np.isfinite(rest).any() else 0.0)
        warmer = np.zeros_like(view.fine.resonator)
        for index, term in enumerate(fit.terms):
            part = fit.coefficients_of(index)
            if term.effect.acts_on == "temperature":
                warmer += term.effect.columns(view.fine, term.shape, problem.response)[:, : term.count] @ part / slope
            elif corrected:
                measured = measured - term_columns(problem, term, view) @ part
        start = float(coefficients[3 + k] / slope) if 3 + k < coefficients.size else 0.0
        warmer += start * np.exp(-(view.fine.time - view.fine.time[0]) / problem.tau)
        change = (measured - coefficients[0]) / slope
        x = change
        for _ in range(6):
            x = change - problem.bend * x**2
        changes.append(change)
        excesses.append(x)
        states.append(replace(view.fine, resonator=view.fine.resonator + warmer))
    return Thermometer(tuple(changes), tuple(excesses), tuple(states))


def _ends(fit: Fit) -> list[int]:
    return [int(end) for end in np.cumsum([mask.sum() for mask in fit.problem.present])][: len(fit.problem.present)][:-1] + (
        [int(sum(mask.sum() for mask in fit.problem.present))] if fit.problem.delay_row is not None else []
    )
