"""Values with which the data agree: they stay as the card has them.

Values of one table of the card, away from it by z (posterior covariance C) with zᵀ C⁻¹ z below the 90 % quantile of χ²,
are held at the card's, and the others solved for anew, if that costs the fit no more than the same quantile.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from studies.calibration.estimates import Estimate
from studies.calibration.fit import CardFit, covariance_at, objective, whitened
from studies.calibration.priors import to_standard

AGREEING = 0.9  # quantile up to which values of a table are where the card has them
STEPS = 3
ZERO = 1e-9  # prior standard deviations: what rounding leaves of a value that is held


def keep_agreeing(found: CardFit) -> CardFit:
    """Return the fit with the values of each table that the data do not contradict at the card's."""
    problem, priors = found.problem, found.problem.priors
    z = found.away - priors.shipped
    C = priors.covariance(found.covariance)
    tables: dict[str, list[int]] = {}
    for k, name in enumerate(priors.names):
        tables.setdefault(name.split(".", maxsplit=1)[0], []).append(k)
    costs = {
        name: float(z[own] @ np.linalg.solve(C[np.ix_(own, own)], z[own]))
        / float(scipy.special.chdtri(len(own), 1 - AGREEING))
        for name, own in tables.items()
    }
    agreeing = sorted((name for name in tables if costs[name] < 1.0), key=lambda name: costs[name])
    while agreeing:
        held = [k for name in agreeing for k in tables[name]]
        kept = _hold(found, held)
        risen = objective(problem, kept.state, found.noise, found.rows) - objective(
            problem, found.state, found.noise, found.rows
        )
        if risen < scipy.special.chdtri(len(held), 1 - AGREEING):
            return kept
        agreeing.pop()
    return found


def _hold(found: CardFit, held: Sequence[int]) -> CardFit:
    """Solve for the coordinates u whose values `held` are the card's, in the noise of the fit; what leaves its bounds is held at them."""
    problem, priors = found.problem, found.problem.priors
    rows = scipy.linalg.block_diag(priors.root, np.eye(problem.count - len(priors.values)))[list(held)]
    values, state, (low, high) = priors.shipped[list(held)], found.state, problem.ends
    for _ in range(STEPS):
        J, r = whitened(problem, state, found.noise, found.rows)
        while True:
            fixed, ways = np.linalg.lstsq(rows, values, rcond=None)[0], scipy.linalg.null_space(rows)
            target = np.concatenate([r + J @ (state.point - fixed), -fixed])
            point = fixed + ways @ np.linalg.lstsq(np.vstack([J @ ways, ways]), target, rcond=None)[0]
            inside = np.clip(point, low, high)
            beyond = np.abs(point - inside) > ZERO
            if not beyond.any():
                break
            rows, values = np.vstack([rows, np.eye(problem.count)[beyond]]), np.append(values, inside[beyond])
        state = problem.evaluate(inside)
    return replace(found, state=state, covariance=covariance_at(problem, state, found.noise, found.rows))


def put_back(estimates: Sequence[Estimate], kept: CardFit) -> tuple[Estimate, ...]:
    """Return estimates with the values of the kept fit; intervals stay, and hold them."""
    priors = kept.problem.priors
    point = kept.point[: len(priors.values)]
    at, away = priors.at(point), priors.standard(point) - priors.shipped
    out = []
    for one, prior, moved in zip(estimates, priors.values, np.abs(away) > ZERO, strict=True):
        value = at[one.parameter] if moved else prior.value
        low, high = min(one.low, value), max(one.high, value)
        out.append(replace(one, value=value, low=low, high=high, shift_sd=to_standard(prior, value)))
    return tuple(out)
