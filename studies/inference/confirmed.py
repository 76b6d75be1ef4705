"""Which of the effects that were found stay: those of a definite size, beside which rows that were held out are predicted better."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from compensation.arrays import Array
from studies.inference.background import Background
from studies.inference.causes import only_apart
from studies.inference.heat_path import FREQUENCY
from studies.inference.held_out import HeldOut
from studies.inference.hypothesis import Outcome
from studies.inference.lack_of_fit import is_rounding
from studies.inference.predicted import Model, Rows
from studies.inference.search import Search

Left = tuple[dict[str, Rows], Mapping[str, Array]]
"""What a model leaves of the rows of every response, and of its blocks."""
Confirmed = tuple[Outcome, dict[str, tuple[float | None, float | None]], dict[str, Rows]]
"""What is named, what is left of rows that were held out before and after, and of those that were seen."""
FAINT = 60.0
"""Log evidence up to which a cause whose definite coefficients may all be 0 is not named: of 13 such names on 127 judged campaigns all 7 below were wrong, 4 of 6 above right."""


def confirm(search: Search, outcome: Outcome, plain: Model, calibrated: Left, longer: Model | None) -> Confirmed:
    """Leave out faint causes of no definite size, and those whose model predicts unseen rows no better than the card alone, or a `longer` heat path alone, the weakest first; none, where that predicts better only beside them."""
    events = any(term.effect.event for term in outcome.final.terms)
    by_record = len(search.linear.problem.runs) > 1 and not events
    alone = _left_by(longer or plain) or calibrated
    before = HeldOut(plain, calibrated[0] if longer else alone[0], by_record)
    beside_path = HeldOut(longer, alone[0], by_record) if longer else before
    given_up: set[tuple[str, str]] = set()
    better: list[tuple[float, int, Confirmed]] = []
    while True:
        final = outcome.final
        beside = Background(search.linear, final.terms, final.noise)
        model = Model(search.linear, search.signatures, final.terms, final.noise)
        more = bool(final.terms) or longer is not None
        told = _left_by(model) if more else alone
        rows, blocks = told or alone
        after = HeldOut(model, rows, by_record) if more else before
        held = before.beside(after)
        gained = held if longer is None else beside_path.beside(after)
        weak = [
            k
            for k, name in enumerate(term.response for term in final.terms)
            if told is None
            or is_worse(*gained[name])
            or beside.size(name, blocks) > beside.size(name, alone[1])
            or (final.score - outcome.without[k].score < FAINT and not beside.sized(k))
            or is_rounding(search.linear.problem, name, alone[0][name])
            or only_apart(search, outcome, k)
        ]
        if longer and told is not None and not is_worse(*held[FREQUENCY]):
            better.append((held[FREQUENCY][1] or np.inf, len(better), (outcome, held, rows)))
        if not weak:
            return min(better)[2] if better and is_worse(*held[FREQUENCY]) else (outcome, held, rows)
        gone = min(weak, key=lambda k: final.score - outcome.without[k].score)
        given_up.add(final.terms[gone].key)
        outcome = _in_place(search, outcome, gone, given_up) or _left_out(search, outcome, gone)


def _left_by(model: Model) -> Left | None:
    """What a model leaves of the records' rows and of their blocks; None where its straight lines end and there is no prediction."""
    numbers = model.numbers
    if numbers is None:
        return None
    there = model.signatures.there(numbers.point)
    return model.residuals(numbers, there), model.left(numbers, there)


def _in_place(search: Search, outcome: Outcome, gone: int, given_up: set[tuple[str, str]]) -> Outcome | None:
    """Put the likeliest effect of a definite size in the place of a faint one without; what was given up is no rival of it."""
    base = outcome.without[gone]
    if outcome.final.score - base.score >= FAINT:
        return None
    for one in outcome.rivals[gone]:
        own = one.terms[-1]
        if own.key in given_up or one.score - base.score < search.needed(own, base.terms):
            continue
        if Background(search.linear, one.terms, one.noise).sized(len(one.terms) - 1):
            found = search.compare(outcome.plain, search.grow(one.terms, noise=one.noise, most=0)[1])
            rivals = (tuple(h for h in own if h.terms[-1].key not in given_up) for own in found.rivals)
            return replace(found, rivals=tuple(rivals))
    return None


def _left_out(search: Search, outcome: Outcome, gone: int) -> Outcome:
    terms = tuple(term for k, term in enumerate(outcome.final.terms) if k != gone)
    final = search.settle(terms, outcome.final.noise) if terms else outcome.plain
    without, rivals = [], []
    for k in range(len(outcome.final.terms)):
        if k != gone:
            others = tuple(t for j, t in enumerate(outcome.final.terms) if j not in (k, gone))
            base = search.beside(others, outcome.plain, outcome.final.noise)
            drop = outcome.without[k].score - base.score
            without.append(base)
            rivals.append(tuple(replace(h, evidence=h.evidence - drop) for h in outcome.rivals[k]))
    return Outcome(outcome.plain, final, tuple(rivals), tuple(without))


def is_worse(before: float | None, after: float | None) -> bool:
    """Whether what is left of unseen rows has not become less, where both are known."""
    return before is not None and after is not None and after >= before
