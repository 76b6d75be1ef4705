"""What a reference clock says: it settles what a record of the frequency alone cannot, a drifting clock or an ageing gyro."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from studies.diagnosis.campaign import Campaign
from studies.diagnosis.evidence import solve
from studies.diagnosis.model import Fit, fit
from studies.diagnosis.search import Hypothesis, Place, Selection
from studies.diagnosis.terms import Term
from studies.effects import Effect, library
from studies.effects.states import average

CLEAR = 4.0
"""Standard deviations at which a drift of the clock is believed, and within which the record must agree."""
INDEPENDENT = 10.0
"""Neighbouring rows share slow noise: one row in so many counts as independent."""


def clock_slope(campaign: Campaign) -> tuple[float, float] | None:
    """Return the drift of the gyro's clock against the reference, Hz per day, and its standard deviation.

    None where no reference was recorded.
    """
    if not campaign.clock_known:
        return None
    error = np.concatenate([run.clock_error for run in campaign.runs if run.clock_error is not None])
    days = np.concatenate([average(run.states.campaign_time, campaign.group) for run in campaign.runs]) / 86400.0
    known = np.isfinite(error)
    if known.sum() < INDEPENDENT:
        return None
    line = np.polyfit(days[known], error[known], 1)
    rest = error[known] - np.polyval(line, days[known])
    spread = np.sqrt(INDEPENDENT * np.mean(rest**2) / known.sum()) / max(float(np.std(days[known])), 1e-300)
    return float(line[0]), float(spread)


def judged(campaign: Campaign, selection: Selection, effects: Sequence[Effect] | None) -> Selection:
    """Return the selection with what a reference clock settles: which of two equal effects it is, and a drift it shows."""
    slope = clock_slope(campaign)
    problem = selection.plain.fit.problem
    chosen = library().values() if effects is None else effects
    judges = [e for e in chosen if e.judge == "reference_frequency_Hz" and problem.response.column in e.sizes]
    if slope is None or not judges:
        return selection
    drift, spread = slope
    drifts = abs(drift) > CLEAR * spread
    own = judges[0]
    pair = {own.name, *own.equivalents.get(problem.response.column, ())}
    places = list(selection.places)
    for number, place in enumerate(places):
        if place.names[0] in pair:
            wanted = [
                (n, r)
                for n, r in zip(place.names, place.rivals, strict=True)
                if n not in pair or (n == own.name) == drifts
            ]
            if wanted:
                best = max((r for n, r in wanted if n in pair), key=lambda r: r.score, default=wanted[0][1])
                rivals = (best, *(r for _, r in wanted if r is not best))
                places[number] = replace(place, rivals=rivals)
                final = best if len(places) == 1 else selection.final
                return replace(selection, final=final, places=tuple(places))
    if not drifts:
        return selection
    now = selection.final
    term = Term(own, ())
    model = fit(problem, now.fit.moved(), (*now.fit.terms, term), 2, np.append(now.fit.solved.scales, 0.1))
    value, deviation = _own_drift(model)
    if abs(value - drift) > CLEAR * np.hypot(deviation, spread):
        return selection
    added = Hypothesis(model, (*now.price, 0.5 * (drift / spread) ** 2))
    place = Place(len(model.terms) - 1, (added,), now)
    return replace(selection, final=added, places=(*selection.places, place))


def _own_drift(model: Fit) -> tuple[float, float]:
    """Return the drift that the record alone shows, Hz per day, and its standard deviation, beside a random walk.

    Without a prior, and beside a walk: stationary noise would not let a record wander from run to run.
    """
    linear = model.linear
    last = int(np.flatnonzero(linear.owner == len(model.terms) - 1)[0])
    order = [last, *(k for k in range(linear.owner.size) if k != last)]
    prior, owner = linear.prior[order].copy(), linear.owner[order].copy()
    prior[0], owner[0] = np.inf, -1
    free = replace(linear, columns=linear.columns[:, order], prior=prior, owner=owner)
    found = solve(free, len(model.terms) - 1, model.solved.scales[:-1], [0])
    return float(found.coefficients[0]), float(np.sqrt(found.covariance[0, 0]))
