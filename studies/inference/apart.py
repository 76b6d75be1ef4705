"""Runs that lie apart, where no card states a turn-on: a level of every run is one more hypothesis beside the effects."""

from studies.calibration.fit import LASTING
from studies.inference.generic_forms import offsets
from studies.inference.search import MARGIN, Hypothesis, Outcome, Search


def with_levels(search: Search, now: Hypothesis, name: str) -> Hypothesis:
    """Return a model with a level of every run of a response, where that is more probable by far; else the model."""
    problem = search.linear.problem
    if problem.instrument.polynomial is None or len(problem.runs) == 1 or name not in LASTING:
        return now
    form = offsets(len(problem.runs))
    bank = search.shapes_of([(form, name)])
    tried = [search.settle((*now.terms, one.term), one.noise, [name]) for one in search.scan(now, bank)]
    best = max(tried, key=lambda one: one.score, default=now)
    return best if best.score > now.score + MARGIN else now


def only_apart(search: Search, outcome: Outcome, k: int) -> bool:
    """Whether levels of the runs are far likelier where a cause stands."""
    return with_levels(search, outcome.without[k], outcome.final.terms[k].response).score > outcome.final.score + MARGIN
