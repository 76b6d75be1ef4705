"""Which effects a response has: models grow and are examined again as long as their evidence pays for it.

Every hypothesis is a model: nothing, one effect, several. Its log evidence holds the prior of its effects, of their sizes
and of their shapes (the mean over the grid of shapes, carried over to the best shape between its points).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.model import Fit, fit, from_elsewhere
from studies.diagnosis.scan import Bank, Seen, build_bank, scan
from studies.diagnosis.terms import Term
from studies.effects import Parameter

MOST_CAUSES = 4
CONTENDERS = 7
NEAR = 25.0
"""A contender's scan may be this far behind the best one's, beside what the misfit of forms allows."""
NARROW = 0.2
"""Part of the best one's scan that is enough for an effect which may lie between its shapes."""
LEAST_OF_TWO = 20.0
"""Lead over nothing below which one cause is not asked whether it is two."""
SHARPER = 0.04
"""Part of the distance to the next shapes of the grid within which the first look leaves a shape: a hop is found closer."""


@dataclass(frozen=True)
class Hypothesis:
    """A fitted model and its log posterior up to a constant: evidence with the price of effects and shapes.

    `price` holds, for every term, the log prior of the effect and what the choice of its shape costs.
    """

    fit: Fit
    price: tuple[float, ...] = ()

    @property
    def score(self) -> float:
        """Log posterior, up to the constant that all models of the response share."""
        return self.fit.log_evidence + sum(self.price)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its effects."""
        return tuple(term.name for term in self.fit.terms)


@dataclass(frozen=True)
class Place:
    """One cause in the final model: the hypotheses that could stand there, best first, and the model without any."""

    index: int
    rivals: tuple[Hypothesis, ...]
    without: Hypothesis

    @property
    def names(self) -> tuple[str, ...]:
        """Name of the effect that each rival puts there."""
        return tuple(rival.fit.terms[self.index].name for rival in self.rivals)


@dataclass(frozen=True)
class Selection:
    """The outcome of a search: the baseline alone, the final model, and the places of its causes.

    `nearest` is the log posterior of the best single effect over the baseline's, whether it paid or not.
    """

    plain: Hypothesis
    final: Hypothesis
    places: tuple[Place, ...] = ()
    nearest: float = -np.inf
    bank: Bank | None = field(default=None, repr=False)


def search(plain: Fit, bank: Bank) -> Selection:
    """Grow a model from a fitted baseline."""
    start = Hypothesis(plain)
    now, nearest = start, -np.inf
    while len(now.fit.terms) < MOST_CAUSES:
        tried = contenders(now, bank)
        best = max(tried, key=lambda h: h.score, default=None)
        nearest = best.score - start.score if best and now is start else nearest
        if best is None or best.score - now.score < needed(start, now):
            break
        now = examine(sharpen(best), bank, start)
    places = places_of(now, bank, start)
    for _ in range(MOST_CAUSES):
        best = max((place.rivals[0] for place in places), key=lambda h: h.score, default=now)
        if best.score < now.score + 1.0 or best.names[-1] in now.names:
            best = two_for_one(now, places, bank, start)
        if best is now:
            break
        now = best
        places = places_of(now, bank, start)
    return Selection(start, now, places, nearest, bank)


def two_for_one(now: Hypothesis, places: Sequence[Place], bank: Bank, start: Hypothesis) -> Hypothesis:
    """Return the model with a rival and one effect more in the place of one cause, where the two pay for it.

    A wide family may imitate two effects at once: a model that grows by one never sees them side by side.
    """
    enough, best = now.score + needed(start, now), now
    if len(now.names) == MOST_CAUSES or now.score - start.score < LEAST_OF_TWO:
        return now
    for rival in (rival for place in places for rival in place.rivals if rival.names[-1] not in now.names):
        others = {*now.names, rival.names[-1]}
        partner = next((s for s in scan(rival.fit, bank, like=now.fit) if s.term.name not in others), None)
        if partner and rival.score + CONSTANTS["log_prior_effect"] + partner.gain > enough - NEAR:
            pair = polish(rival, partner)
            best = pair if pair.score > max(enough, best.score) else best
    return best if best is now else examine(best, bank, start)


def needed(start: Hypothesis, now: Hypothesis) -> float:
    """Log posterior that a further cause must bring: a margin for noise, and a part of what is explained for misfit."""
    return CONSTANTS["margin"] + CONSTANTS["further"] * max(now.score - start.score, 0.0)


def contenders(base: Hypothesis, bank: Bank, but: Sequence[str] = ()) -> list[Hypothesis]:
    """Return the models with one effect more whose scans are near enough to the best, each with its shape polished."""
    taken = {term.name for term in base.fit.terms}
    seen = [s for s in scan(base.fit, bank) if s.term.name not in {*but, *taken}]
    if not seen or seen[0].gain < -2.0:
        return []
    most = max(seen[0].gain, 0.0)
    unsure = _astray(base.fit)
    near = [s for s in seen if s.gain > (most * NARROW - NEAR if s.narrow or unsure else max(0.5 * most - NEAR, 0.0))]
    return [polish(base, s) for s in near[:CONTENDERS]]


def polish(base: Hypothesis, seen: Seen) -> Hypothesis:
    """Add an effect and move its shape to where the evidence is largest; forms of one effect are compared where each is best."""
    price = CONSTANTS["log_prior_effect"] + seen.choice
    about = base.fit.moved()
    forms = []
    tops = [seen.term] if seen.other is None else [seen.term, seen.other]
    for term in (near for top in tops for near in nearer(base.fit, top)):
        scales = np.append(base.fit.solved.scales, 0.1)
        model = fit(base.fit.problem, about, (*base.fit.terms, term), 2, scales)
        forms.append(refine(from_elsewhere(model) if _astray(model) else model, len(model.terms) - 1))
    return Hypothesis(max(forms, key=lambda f: f.log_evidence), (*base.price, price))


def _astray(model: Fit) -> bool:
    """Whether its lag may be far off: a bias or 1/Q without a thermometer finds one by itself, and a wrong one beside a rate."""
    return model.baseline.lagged and not model.problem.response.thermometer


def nearer(model: Fit, term: Term) -> list[Term]:
    """Return the likeliest of the shapes that a shape of the coarse grid stands for, one of every form."""
    effect = term.effect
    if effect.near is None:
        return [term]
    shapes = effect.near(model.problem.span, model.problem.response.column, term.shape)
    forms: dict[tuple[float, ...], list[tuple[float, ...]]] = {}
    for shape in shapes:
        forms.setdefault(tuple(shape[k] for k, own in enumerate(effect.shape) if own.steady), []).append(shape)
    seen = [scan(model, build_bank(model, [replace(effect, grid=lambda *_, own=own: own)])) for own in forms.values()]
    return [replace(term, shape=found[0].term.shape) for found in seen if found] or [term]


def sharpen(grown: Hypothesis) -> Hypothesis:
    """Look once more at the shape of the last term, near where it is."""
    return replace(grown, fit=refine(grown.fit, len(grown.fit.terms) - 1, SHARPER))


def refine(model: Fit, index: int, reach: float = 1.0) -> Fit:
    """Move the free shape parameters of one term to where the evidence is largest; wrong signs are refused."""
    term = model.terms[index]
    free = [(k, p) for k, p in enumerate(term.effect.shape) if p.moves(term.shape[k])]
    best = model
    for k, parameter in free if free else ():
        best = _along(best, index, k, parameter, reach)
    if len(free) > 1:
        best = _along(best, index, *free[0], reach)
    best = fit(best.problem, best.moved(), best.terms, 2, best.solved.scales)
    best = max(best, model, key=lambda f: f.log_evidence)
    return _signed(best, index)


def _signed(model: Fit, index: int) -> Fit:
    """An effect that cannot be negative and is has no evidence: by what it does along its first column, which the others resemble."""
    places = model.columns_of(index)
    own = model.linear.columns[:, places] - model.linear.columns[:, places].mean(axis=0)
    if model.terms[index].effect.positive and own[:, 0] @ own @ model.solved.coefficients[places] < 0.0:
        return replace(model, solved=replace(model.solved, log_evidence=-np.inf))
    return model


def _along(model: Fit, index: int, place: int, parameter: Parameter, reach: float) -> Fit:
    """Golden section along one shape parameter, about where it is, over a part of the way to the next shapes of the grid."""
    from scipy.optimize import minimize_scalar

    term = model.terms[index]
    baseline, kinds = model.baseline, [model.solved.kind]
    best = [model]

    def tried(value: float) -> float:
        actual = float(np.exp(value)) if parameter.logarithmic else value
        shape = (*term.shape[:place], actual, *term.shape[place + 1 :])
        terms = (*model.terms[:index], replace(term, shape=shape), *model.terms[index + 1 :])
        own = fit(model.problem, baseline, terms, 1, model.solved.scales, kinds)
        if own.log_evidence > best[0].log_evidence:
            best[0] = own
        return -own.log_evidence

    low, high = _bracket(term, place, model)
    at = float(np.log(term.shape[place])) if parameter.logarithmic else term.shape[place]
    low, high = at + reach * min(low - at, 0.0), at + reach * max(high - at, 0.0)
    tolerance = 0.02 * (high - low)
    minimize_scalar(tried, bounds=(low, high), method="bounded", options={"xatol": tolerance, "maxiter": 12})
    return best[0]


def _bracket(term: Term, place: int, model: Fit) -> tuple[float, float]:
    """As far to both sides as the next points of the grid, or of the finer one about it."""
    span, effect, at = model.problem.span, term.effect, term.shape[place]
    parameter, response = effect.shape[place], model.problem.response.column
    shapes = list(effect.grid(span, response))
    if effect.near is not None:
        steady = [k for k, own in enumerate(effect.shape) if own.steady]
        near = effect.near(span, response, term.shape)
        shapes = [one for one in near if all(one[k] == term.shape[k] for k in steady)]
    grid = np.unique([shape[place] for shape in shapes if parameter.moves(shape[place])])
    low = grid[grid < at * (1 - 1e-9) if at > 0 else grid < at - 1e-9]
    high = grid[grid > at * (1 + 1e-9) if at > 0 else grid > at + 1e-9]
    below = float(low[-1]) if low.size else (at / 1.6 if parameter.logarithmic else at - 1.0)
    above = float(high[0]) if high.size else (at * 1.6 if parameter.logarithmic else at + 1.0)
    most = min(parameter.high, parameter.of_run * span.longest_run, parameter.of_range * span.temperature_range)
    below, above = max(below, parameter.low), min(above, most)
    if above <= below:
        below, above = min(at, most) * (1 - 1e-6), min(at, most) * (1 + 1e-6) + 1e-9
    return (float(np.log(below)), float(np.log(above))) if parameter.logarithmic else (below, above)


def examine(now: Hypothesis, bank: Bank, start: Hypothesis) -> Hypothesis:
    """Look at the terms of a grown model again: drop what no longer pays, exchange what another effect does better."""
    for index in range(len(now.fit.terms) - 1):
        base = drop(now, index)
        if base.score > now.score - CONSTANTS["margin"]:
            return examine(base, bank, start) if len(base.fit.terms) > 1 else base
        for other in contenders(base, bank):
            if other.score > now.score + 1.0:
                now = other
                break
    return now


def drop(now: Hypothesis, index: int) -> Hypothesis:
    """Return the model without one of its terms."""
    terms = (*now.fit.terms[:index], *now.fit.terms[index + 1 :])
    scales = np.delete(now.fit.solved.scales, index)
    price = (*now.price[:index], *now.price[index + 1 :])
    own = fit(now.fit.problem, now.fit.moved(), terms, 3, scales)
    if not terms:
        return Hypothesis(own, price)
    return Hypothesis(own, price)


def places_of(now: Hypothesis, bank: Bank, start: Hypothesis) -> tuple[Place, ...]:
    """Return the place of every cause of a model."""
    return tuple(_place(now, index, bank, start) for index in range(len(now.fit.terms)))


def _place(now: Hypothesis, index: int, bank: Bank, start: Hypothesis) -> Place:
    """Return the alternatives to one term, the others held."""
    base = drop(now, index)
    base = base if base.names else max(base, start, key=lambda h: h.score)
    last = _moved_last(now, index)
    rivals = [last, *(h for h in contenders(base, bank, (now.fit.terms[index].name,)) if np.isfinite(h.score))]
    rivals.sort(key=lambda h: -h.score)
    return Place(len(now.fit.terms) - 1, tuple(rivals), base)


def _moved_last(now: Hypothesis, index: int) -> Hypothesis:
    """Return the same model with one term at the end, where rivals have theirs."""
    order = [k for k in range(len(now.fit.terms)) if k != index] + [index]
    if order == list(range(len(order))):
        return now
    terms = tuple(now.fit.terms[k] for k in order)
    own = fit(now.fit.problem, now.fit.baseline, terms, 2, now.fit.solved.scales[order])
    return Hypothesis(own, tuple(now.price[k] for k in order))
