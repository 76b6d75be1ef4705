"""A search that follows what it finds: the model is linearised anew where values are most probable beside the effects, and searched again."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from compensation.arrays import Array
from compensation.noise import Noise
from studies.calibration.fit import IMPOSSIBLE, CardFit
from studies.inference.hypothesis import Hypothesis, Outcome
from studies.inference.linear import Linear, Shapes, Term
from studies.inference.predicted import STRAYED, Model
from studies.inference.relinearise import relinearise
from studies.inference.search import MOST_TERMS, Search
from studies.inference.signatures import Signatures

AGAIN, SETTLING = 7, 4
"""Most linearisations after the first, and how many of these look for no further effects."""
STILL = 0.2
"""Prior standard deviations by which it must have moved to be made anew once more."""
STRAIGHT = 1.0
"""The same, up to which further effects are looked for beside one before the model is linearised anew."""
PATIENCE = 2
"""Linearisations in a row that bring no more, after which none is made."""
FOLLOWED, CLOSE = 2, 0.5
"""Causes that may come first, followed to values of their own, and part of the leader's gain that the others must have: what leads in straight lines is often not what leads there."""
SAME_PATH = 0.02
"""Part of its range by which the resonator's temperature may move before the columns of all effects are computed anew."""


@dataclass(frozen=True)
class _Place:
    """A model where its values are likeliest."""

    score: float
    search: Search
    point: Array
    grown: Hypothesis


class Pursuit:
    """A search with the values linearised at a start, and again where they are most probable beside the effects."""

    def __init__(self, start: CardFit, progress: Callable[[str], None] = lambda _: None) -> None:
        progress("all effects in all shapes")
        self.start, self.progress, self.point = start, progress, start.point
        paths = Signatures.at(start.problem, start.point)
        self.first = self.search = Search(Linear.of(start), paths, start.noise, progress=progress)
        self.least = -np.inf

    def outcome(self, least: float = -np.inf) -> tuple[Search, Outcome]:
        """Return the last search and what it found; given up below a `least` score."""
        self.least = least
        plain, final = self.begun()
        return (self.search, Outcome(plain, final, (), ())) if self._beaten(final) else self.ended(plain, final)

    def most(self, plain: Hypothesis) -> float:
        """Return what effects can bring at most, by straight lines: as many as there may be, each as much as the best."""
        return MOST_TERMS * max((one.gain for one in self.first.scan(plain)), default=0.0)

    def ended(self, plain: Hypothesis, final: Hypothesis) -> tuple[Search, Outcome]:
        """Go on from what has begun to the end."""
        if self.start.problem.instrument.polynomial is not None:
            plain, final = self._elsewhere(plain, final)
        plain, final = self._without_needless(plain, final)
        return self.search, self.search.compare(plain, final)

    def begun(self) -> tuple[Hypothesis, Hypothesis]:
        """Grow from nothing; where straight lines do not reach what comes first beside a card, the likeliest that may come first are followed to values of their own."""
        plain, final = self.search.grow(near=self._near)
        if self.start.problem.instrument.polynomial is None and len(final.terms) == 1 and not self._near(final):
            first = self.search.first[:FOLLOWED]
            close = [one for gain, one in first if gain > CLOSE * first[0][0]]
            if len(close) > 1 and (best := self._best_of((one.terms, one.noise) for one in close)):
                plain, final = self._going_on(best)
        return self._straightened(plain, final)

    def _straightened(self, plain: Hypothesis, final: Hypothesis) -> tuple[Hypothesis, Hypothesis]:
        best, waited = -np.inf, 0
        for left in range(AGAIN, 0, -1):
            if self._holds(final) or not (final.terms or left == AGAIN) or self._beaten(final):
                break
            self.progress("linearising the model again with the effects found")
            before = self.point
            self.search, self.point, terms = self._linearise(final.terms, final.noise)
            if left > SETTLING:
                plain, final = self.search.grow(terms, self._near if left > SETTLING + 1 else lambda _: True)
            else:
                plain, final = self.search.grow(terms, most=0)
            score = self.search.fair(final)
            best, waited = max(best, score), 0 if score > best else waited + 1
            if waited == PATIENCE or np.abs(self.point - before).max(initial=0.0) < STILL:
                break
        if not final.terms and self.search is not self.first:  # it begins where values are likeliest without effects
            self.search, self.point = self.first, self.start.point
            return self.search.grow(most=0)
        return plain, final

    def _elsewhere(self, plain: Hypothesis, final: Hypothesis) -> tuple[Hypothesis, Hypothesis]:
        """Go on where less noise, or an effect in the place of slow noise, is likelier with values of its own."""
        best = self._best_of(self.search.suspects(final))
        if best is None or best.score <= self.search.fair(final) + STRAYED:
            return plain, final
        self.progress("a better minimum found elsewhere; continuing there")
        return self._straightened(*self._going_on(best))

    def _without_needless(self, plain: Hypothesis, final: Hypothesis) -> tuple[Hypothesis, Hypothesis]:
        """Leave out what pays beside another effect only along straight lines, the least first: without it, values of their own do as much."""
        for term in sorted(final.terms, key=lambda one: one.brought) if len(final.terms) > 1 else ():
            others = tuple(one for one in final.terms if one is not term)
            if self._near(self.search.beside(others, plain, final.noise)):
                continue
            fewer = self._best_of([(others, final.noise)])
            if fewer and self.search.fair(final) - fewer.score < self.search.needed(term, others):
                return self._without_needless(*self._going_on(fewer, most=0))
        return plain, final

    def _best_of(self, tried: Iterable[tuple[Sequence[Term], Mapping[str, Noise]]]) -> "_Place | None":
        """The likeliest of some models, each with values of its own."""
        found = []
        for terms, noise in tried:
            there, point, own = self._linearise(terms, noise, [])
            grown = there.grow(own, noise=noise, most=0)[1]
            found.append(_Place(there.fair(grown), there, point, grown))
        return max(found, key=lambda one: one.score, default=None)

    def _going_on(self, place: "_Place", most: int = MOST_TERMS) -> tuple[Hypothesis, Hypothesis]:
        """Search on from a model."""
        there, self.point, grown = place.search, place.point, place.grown
        bank = self._bank_at(there.signatures)
        self.search = Search(there.linear, there.signatures, grown.noise, bank, self.progress)
        return self.search.grow(grown.terms, self._near, grown.noise, most)

    def _model(self, final: Hypothesis) -> Model:
        return Model(self.search.linear, self.search.signatures, final.terms, final.noise)

    def _near(self, final: Hypothesis) -> bool:
        """Whether the values are not far from where the model is linear, or the straight lines reach as far."""
        model = self._model(final)
        far = np.abs(model.kept(model.mean()).point - self.point).max(initial=0.0) >= STRAIGHT
        return not far or self._holds(final)

    def _holds(self, final: Hypothesis) -> bool:
        """Whether the straight lines are those of the simulation where they end."""
        model = self._model(final)
        mean = model.mean()
        try:
            return model.strayed(mean, model.left(model.kept(mean))) < STRAYED
        except IMPOSSIBLE:
            return False

    def _beaten(self, final: Hypothesis) -> bool:
        return self.least > -np.inf and self.search.fair(final) < self.least

    def _linearise(
        self, terms: Sequence[Term], noise: Mapping[str, Noise], bank: Sequence[Shapes] | None = None
    ) -> tuple[Search, Array, tuple[Term, ...]]:
        start = replace(self.start, rows=self.search.linear.rows)
        there = relinearise(start, self.search.linear, self.point, terms, noise)
        bank = self._bank_at(there.signatures) if bank is None else bank
        return Search(there.linear, there.signatures, noise, bank, self.progress), there.values, there.terms

    def _bank_at(self, paths: Signatures) -> Sequence[Shapes] | None:
        """The columns of all effects where they are the same along other paths; None where they are to be computed."""
        return self.search.bank if paths.away(self.search.signatures) < SAME_PATH else None
