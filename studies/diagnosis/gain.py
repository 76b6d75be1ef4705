"""What the extension is worth: residuals on the records' own rows, and on runs that were left out of the fit."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from studies.diagnosis.baseline import Problem, Term, View, baseline_columns, restricted, term_columns
from studies.diagnosis.campaign import Campaign
from studies.diagnosis.fit import Fit, fit_terms
from studies.diagnosis.likelihood import orthonormal, unit
from studies.diagnosis.states import FloatArray, States

BLOCKS = 5
KNOWN_START = 0.5
"""Part of the initial state's signature in a block from which on it is refitted there."""


@dataclass(frozen=True)
class Score:
    """Residual rms on the rows of the fit and on rows that the fit has not seen (None where that cannot be had)."""

    residual_rms: float
    held_out_rms: float | None


def row_residuals(fit: Fit, campaign: Campaign) -> list[FloatArray]:
    """Return the residual of every run on its own rows; NaN where a row is missing or an outlier."""
    return [
        run.row_responses[fit.problem.response]
        - on_rows(campaign, k, fine_model(fit.problem, fit.terms, campaign, k) @ fit.linear.coefficients)
        for k, run in enumerate(campaign.runs)
    ]


def fine_model(problem: Problem, terms: Sequence[Term], campaign: Campaign, k: int) -> FloatArray:
    """Return the columns of baseline and terms of run `k` on its fine grid."""
    run = campaign.runs[k]
    fine = problem.states[k].with_lag(problem.tau) if problem.lagged else problem.states[k]
    seen = fine
    if problem.correction is not None:
        seen = replace(fine, resonator=fine.resonator + problem.correction[k])
    view = View(fine, fine, seen, seen, 1)
    thermometer = None
    if problem.thermometer is not None:
        thermometer = [
            np.interp(fine.time, run.time, values) if j == k else np.zeros(1)
            for j, values in enumerate(problem.thermometer)
        ]
    others = [(fine, seen) if j == k else (_short(s), _short(s)) for j, s in enumerate(problem.states)]
    base = baseline_columns(problem, others, thermometer)[k]
    return np.concatenate([base, *(term_columns(problem, term, view) for term in terms)], axis=1)


def on_rows(campaign: Campaign, k: int, values: FloatArray) -> FloatArray:
    """Interpolate values of run `k` from its fine grid onto its own rows."""
    run = campaign.runs[k]
    return np.interp(run.row_time, run.states.time, values)


def _short(states: States) -> States:
    return replace(
        states,
        time=states.time[:1],
        campaign_time=states.campaign_time[:1],
        housing=states.housing[:1],
        resonator=states.resonator[:1],
        fading=states.fading[:1] if isinstance(states.fading, np.ndarray) else states.fading,
    )


def own_columns(problem: Problem, k: int) -> list[int]:
    """Return which baseline columns belong to run `k` alone: its offset and its initial thermal state."""
    runs = len(problem.states)
    own = []
    if problem.response == "bias_deg_per_h":
        own.append(3 + k)
        if problem.lagged:
            own.append(3 + runs + k)
    elif problem.lagged:
        own.append(3 + k)
    return own


def rms(parts: Sequence[FloatArray]) -> float:
    """Root mean square of what is finite."""
    values = np.concatenate([part[np.isfinite(part)] for part in parts] or [np.empty(0)])
    return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")


def score(fit: Fit, campaign: Campaign) -> Score:
    """Return training and held-out residual of a fit.

    One record is left out at a time, the rest is fitted anew (coefficients, shapes and lag); of the record that was
    left out only its own offset and initial state are refitted. With one record it is cut into blocks in time, with
    one thermal constant left out on both sides.
    """
    training = rms(row_residuals(fit, campaign))
    if len(campaign.records) > 1:
        return Score(training, _leave_one_record_out(fit, campaign))
    return Score(training, _leave_one_block_out(fit, campaign))


def _leave_one_record_out(fit: Fit, campaign: Campaign) -> float | None:
    residuals = []
    for record in campaign.records:
        keep = [
            np.full(mask.shape, run.record != record)
            for mask, run in zip(fit.problem.present, campaign.runs, strict=True)
        ]
        if sum(int((m & k).sum()) for m, k in zip(fit.problem.present, keep, strict=True)) < 40:
            return None
        trained = _train(restricted(fit.problem, keep), fit.terms)
        for k, run in enumerate(campaign.runs):
            if run.record == record:
                every = np.ones(run.row_time.size, dtype=bool)
                residuals.append(_refit(trained, campaign, k, own_columns(trained.problem, k), every))
    return rms(residuals)


def _train(problem: Problem, terms: Sequence[Term]) -> Fit:
    """Fit the rows that are left; an effect of which they know nothing (a jump in the run left out) stays at zero."""
    views = problem.views(problem.tau)
    columns = problem.baseline(views)
    known: list[Term] = []
    for term in terms:
        own = problem.term(term, views)
        ortho = orthonormal(unit(columns))
        left = own - ortho @ (ortho.T @ own)
        if (np.linalg.norm(left, axis=0) > 1e-6 * np.linalg.norm(own, axis=0)).all():
            known.append(term)
            columns = np.concatenate([columns, own], axis=1)
    return fit_terms(problem, known, rounds=2)


def _refit(trained: Fit, campaign: Campaign, k: int, own: Sequence[int], inside: NDArray[np.bool_]) -> FloatArray:
    """Return the residual of some rows of run `k`, the columns `own` refitted on them."""
    columns = fine_model(trained.problem, trained.terms, campaign, k)
    coefficients = trained.linear.coefficients.copy()
    coefficients[list(own)] = 0.0
    measured = campaign.runs[k].row_responses[trained.problem.response]
    rest = (measured - on_rows(campaign, k, columns @ coefficients))[inside]
    known = np.isfinite(rest)
    if own and known.sum() > len(own):
        free = np.stack([on_rows(campaign, k, columns[:, index])[inside] for index in own], axis=1)
        rest = rest - free @ np.linalg.lstsq(free[known], rest[known], rcond=None)[0]
    return np.asarray(rest)


def _leave_one_block_out(fit: Fit, campaign: Campaign) -> float | None:
    problem = fit.problem
    begin = campaign.runs[0].row_time[0]
    end = campaign.runs[-1].row_time[-1]
    gap = problem.tau if problem.lagged else problem.states[0].tau
    if (end - begin) / BLOCKS < 2.0 * campaign.step or end - begin < 4.0 * gap:
        return None
    residuals = []
    for block in range(BLOCKS):
        low, high = (begin + (end - begin) * part / BLOCKS for part in (block, block + 1))
        keep = [(run.time < low - gap) | (run.time > high + gap) for run in campaign.runs]
        if sum(int((m & k).sum()) for m, k in zip(problem.present, keep, strict=True)) < 40:
            return None
        trained = _train(restricted(problem, keep), fit.terms)
        for k, run in enumerate(campaign.runs):
            inside = (run.row_time >= low) & (run.row_time < high + (1e-9 if block < BLOCKS - 1 else 1.0))
            if inside.any():
                start = _start_within(trained, campaign, k, inside)
                residuals.append(_refit(trained, campaign, k, start, inside))
    return rms(residuals)


def _start_within(trained: Fit, campaign: Campaign, k: int, inside: NDArray[np.bool_]) -> list[int]:
    """Return the column of the initial thermal state where a block holds most of it: other rows know next to nothing of it."""
    if not trained.problem.lagged:
        return []
    place = own_columns(trained.problem, k)[-1]
    start = on_rows(campaign, k, fine_model(trained.problem, trained.terms, campaign, k)[:, place])
    return [place] if np.linalg.norm(start[inside]) >= KNOWN_START * np.linalg.norm(start) else []
