"""What a reference clock says: it tells a drifting clock from an ageing frequency, and finds a drift that noise would hide."""

from dataclasses import replace

import numpy as np

from studies.diagnosis.baseline import Term, fit_at, restricted
from studies.diagnosis.campaign import Campaign
from studies.diagnosis.effects import find_effect
from studies.diagnosis.fit import fit_terms
from studies.diagnosis.selection import Found, Rival, Selection
from studies.diagnosis.states import average
from studies.diagnosis.thermometer import corrected

CLOCK_PAIR = ("clock-drift", "ageing")
CLEAR = 4.0
"""Standard deviations at which a drift of the clock is believed."""
AGREE = 4.0
"""Standard deviations within which the record must show the drift that the comparison of the clocks shows."""
INDEPENDENT = 10.0
"""Neighbouring rows share slow noise: one row in so many counts as independent."""


def clock_slope(campaign: Campaign) -> tuple[float, float] | None:
    """Return the drift of the gyro's clock against the reference, Hz per day, and its standard deviation.

    None where no reference was recorded.
    """
    errors = [run.clock_error for run in campaign.runs if run.clock_error is not None]
    if not campaign.runs or len(errors) < len(campaign.runs):
        return None
    error = np.concatenate(errors)
    days = np.concatenate([average(run.states.campaign_time, campaign.group) for run in campaign.runs]) / 86400.0
    known = np.isfinite(error)
    if known.sum() < INDEPENDENT:
        return None
    line = np.polyfit(days[known], error[known], 1)
    rest = error[known] - np.polyval(line, days[known])
    spread = np.sqrt(INDEPENDENT * np.mean(rest**2) / known.sum()) / max(float(np.std(days[known])), 1e-300)
    return float(line[0]), float(spread)


def clock_drifts(campaign: Campaign) -> bool | None:
    """Whether the gyro's clock drifts against the reference clock; None where no reference was recorded."""
    slope = clock_slope(campaign)
    return None if slope is None else abs(slope[0]) > CLEAR * slope[1]


def with_clock(selection: Selection, campaign: Campaign) -> Selection:
    """Return the selection with the drift that a reference clock shows, where the record agrees and nothing names it yet."""
    slope = clock_slope(campaign)
    if slope is None or any(found.name in CLOCK_PAIR for found in selection.found):
        return selection
    drift, spread = slope
    evidence = (drift / max(spread, 1e-300)) ** 2
    if evidence < max(selection.threshold, CLEAR**2):
        return selection
    term = Term(find_effect(CLOCK_PAIR[0]), (), 1)
    fit = corrected(fit_terms(selection.fit.problem, (*selection.fit.terms, term)))
    # beside a random walk: stationary noise would not let a record wander from run to run
    walking = fit_at(restricted(fit.problem, kernel="walk"), fit.problem.tau, fit.terms)
    own, deviation = walking.coefficients[-1], np.sqrt(walking.covariance[-1, -1])
    if abs(own - drift) > AGREE * np.hypot(deviation, spread):
        return selection
    found = Found(len(fit.terms) - 1, term.name, evidence, (Rival(term.name, evidence, fit),))
    return replace(selection, fit=fit, found=tuple(sorted((*selection.found, found), key=lambda f: -f.evidence)))
