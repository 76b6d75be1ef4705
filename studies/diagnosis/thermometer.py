"""The frequency as a thermometer, freed of what is not temperature, and the smooth state that effects see.

A shift of the frequency that is not thermal (voltage, amplitude, ageing, a jump) would leak into bias and 1/Q through
their polynomials; it is taken out before.
"""

from dataclasses import dataclass, replace

import numpy as np

from studies.diagnosis.baseline import Term, steepness, term_columns
from studies.diagnosis.campaign import Campaign
from studies.diagnosis.fit import Fit, fit_terms
from studies.diagnosis.states import FloatArray, States, average

UPDATES, SETTLED = 5, 0.5
"""At most so many updates of the corrected temperature, until minus twice the log-likelihood changes by less."""


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


def read_thermometer(campaign: Campaign, fit: Fit, clean: bool = True) -> Thermometer | None:
    """Turn the fitted frequency of a campaign into a thermometer.

    Parameters
    ----------
    campaign : Campaign
    fit : Fit
        Of the frequency.
    clean : bool
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
    model = list(np.split(problem.model(problem.tau, fit.terms) @ coefficients, _ends(fit)))
    warmer = thermal_correction(fit)
    slow = slow_residual(fit)
    changes, excesses, states = [], [], []
    for k, (run, view) in enumerate(zip(campaign.runs, views, strict=True)):
        measured = run.responses["frequency_Hz"].copy()
        gaps = ~np.isfinite(measured)
        if gaps.any():
            whole = np.full(measured.shape, np.nan)
            whole[~gaps] = model[k]
            rest = measured - whole
            smooth = slope * view.seen.excess + coefficients[2] * view.seen.excess**2 + coefficients[0]
            measured[gaps] = smooth[gaps] + (np.nanmedian(rest) if np.isfinite(rest).any() else 0.0)
        for index, term in enumerate(fit.terms):
            part = fit.coefficients_of(index)
            if clean and term.effect.acts_on == "response":
                measured = measured - term_columns(problem, term, view) @ part
        change = (measured - coefficients[0]) / slope
        x = change
        for _ in range(6):
            x = change - problem.bend * x**2
        changes.append(change)
        excesses.append(x)
        missed = np.interp(view.fine.time, run.time, slow[k] / (slope * steepness(problem, view.seen)))
        states.append(replace(view.fine, resonator=view.fine.resonator + warmer[k] + missed))
    return Thermometer(tuple(changes), tuple(excesses), tuple(states))


def smooth_thermometer(campaign: Campaign, thermometer: Thermometer, bend: float) -> Thermometer:
    """Return the thermometer with the fitted model in the place of the measured frequency: no noise, no surprise."""
    excess = tuple(average(s.excess, campaign.group) for s in thermometer.states)
    return replace(thermometer, change=tuple(x + bend * x**2 for x in excess), excess=excess)


def slow_residual(fit: Fit) -> tuple[FloatArray, ...]:
    """Return the slow part of what a fit leaves, Hz on the coarse grid, as its own noise model divides it from the white.

    Most of it is temperature that the heat path does not know. Row i of the rotated residual has the variance
    σ² (1 + q walk_i), of which q walk_i is slow.
    """
    problem = fit.problem
    rest = problem.values - fit.columns() @ fit.linear.coefficients
    out, begin, block = [], 0, 0
    for mask, states in zip(problem.present, problem.states, strict=True):
        grid = average(states.time, problem.group)
        end = begin + int(mask.sum())
        if end > begin:
            vectors = problem.basis.vectors[block]
            slow = fit.linear.share * problem.basis.walk[begin:end]
            smooth = vectors @ (slow / (1.0 + slow) * (vectors.T @ rest[begin:end]))
            out.append(np.interp(grid, grid[mask], smooth))
            block += 1
        else:
            out.append(np.zeros_like(grid))
        begin = end
    return tuple(out)


def thermal_correction(fit: Fit) -> tuple[FloatArray, ...]:
    """Return what a fit adds to the lagged temperature, K on the fine grid: initial state, delay, thermal effects."""
    problem, coefficients = fit.problem, fit.linear.coefficients
    slope = float(coefficients[1])
    out = []
    for k, view in enumerate(problem.views(problem.tau)):
        fine = view.fine
        warmer = np.zeros_like(fine.resonator)
        if slope != 0.0:
            for index, term in enumerate(fit.terms):
                if term.effect.acts_on == "temperature":
                    states = view.seen_fine if term.effect.sees_heat else fine
                    columns = term.effect.columns(states, term.shape, problem.response)[:, : term.count]
                    warmer += columns @ fit.coefficients_of(index) / slope
            warmer += coefficients[3 + k] / slope * fine.fading
            if problem.delay_row is not None:
                delay = float(coefficients[3 + len(problem.states)] / slope)
                warmer -= delay * (fine.housing - fine.resonator) / problem.tau
        out.append(warmer)
    return tuple(out)


def corrected(fit: Fit) -> Fit:
    """Return the fit with the temperature that static effects and radiation see brought up to date."""
    if fit.problem.response != "frequency_Hz":
        return fit
    fit = _updated(fit)
    for index, term in enumerate(fit.terms):
        if term.effect.sees_heat:
            # which law of conductance holds shows only once the temperature is right
            other = replace(term, shape=(*term.shape[:-1], 1.0 - term.shape[-1]))
            terms = (*fit.terms[:index], other, *fit.terms[index + 1 :])
            fit = min(fit, _updated(fit_terms(fit.problem, terms, rounds=3)), key=lambda tried: tried.score)
    return fit


def _updated(fit: Fit) -> Fit:
    for _ in range(UPDATES):
        problem = replace(fit.problem, correction=thermal_correction(fit))
        before, fit = fit, fit_terms(problem, _with_heat(fit), rounds=3)
        if abs(before.score - fit.score) < SETTLED:
            break
    return fit


def _with_heat(fit: Fit) -> tuple[Term, ...]:
    """The terms, now that the corrected temperature holds what is radiated too."""
    return tuple(replace(t, shape=(0.0, *t.shape[1:])) if t.effect.sees_heat else t for t in fit.terms)


def _ends(fit: Fit) -> list[int]:
    return [int(end) for end in np.cumsum([mask.sum() for mask in fit.problem.present])][: len(fit.problem.present)][
        :-1
    ] + ([int(sum(mask.sum() for mask in fit.problem.present))] if fit.problem.delay_row is not None else [])
