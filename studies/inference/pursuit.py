"""A search that follows what it finds: the model is linearised anew where values are most probable beside the effects, and searched again."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from compensation.noise import Noise
from studies.calibration.fit import IMPOSSIBLE, CardFit
from studies.inference.held_out import Model
from studies.inference.model import Background, Linear, Term
from studies.inference.relinearise import relinearise
from studies.inference.search import Hypothesis, Outcome, Search, Shapes
from studies.inference.signatures import Signatures

Array = NDArray[np.float64]
AGAIN, SETTLING = 7, 4
"""Most linearisations after the first, and how many of these look for no further effects."""
STRAYED = 1.0
"""Error of −2 ln L up to which a linearisation is taken as it is."""
STILL = 0.2
"""Prior standard deviations by which it must have moved to be made anew once more."""
STRAIGHT = 1.0
"""The same, up to which further effects are looked for beside one before the model is linearised anew."""
PATIENCE = 2
"""Linearisations in a row that bring no more, after which none is made."""
SAME_PATH = 0.02
"""Part of its range by which the resonator's temperature may move before the columns of all effects are computed anew."""


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
        plain, final = self._straightened(*self.search.grow(near=self._near))
        if self._beaten(final):
            return self.search, Outcome(plain, final, (), ())
        if self.start.problem.instrument.polynomial is not None:
            plain, final = self._elsewhere(plain, final)
        return self.search, self.search.compare(plain, final)

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
            score = on_all_rows(self.search, final)
            best, waited = max(best, score), 0 if score > best else waited + 1
            if waited == PATIENCE or np.abs(self.point - before).max(initial=0.0) < STILL:
                break
        if not final.terms and self.search is not self.first:  # it begins where values are likeliest without effects
            self.search, self.point = self.first, self.start.point
            return self.search.grow(most=0)
        return plain, final

    def _elsewhere(self, plain: Hypothesis, final: Hypothesis) -> tuple[Hypothesis, Hypothesis]:
        """Go on where less noise, or an effect in the place of slow noise, is likelier with values of its own."""
        tried = []
        for terms, noise in self.search.suspects(final):
            there, at, own = self._linearise(terms, noise, [])
            grown = there.grow(own, noise=noise, most=0)[1]
            tried.append((on_all_rows(there, grown), there, at, grown))
        best = max(tried, key=lambda one: one[0], default=None)
        if best is None or best[0] <= on_all_rows(self.search, final) + STRAYED:
            return plain, final
        self.progress("a better minimum found elsewhere; continuing there")
        _, there, self.point, grown = best
        self.search = Search(there.linear, there.signatures, grown.noise, None, self.progress)
        return self._straightened(*self.search.grow(grown.terms, self._near, grown.noise))

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
        linear, mean = model.linear, model.mean()
        try:
            left = model.left(model.kept(mean))
        except IMPOSSIBLE:
            return False
        apart = {n: linear.target[n] - linear.columns(final.terms, n) @ mean - left[n] for n in linear.responses}
        return STRAYED > sum(np.sum(linear.rows[n].whiten(own, final.noise[n]) ** 2) for n, own in apart.items())

    def _beaten(self, final: Hypothesis) -> bool:
        return self.least > -np.inf and on_all_rows(self.search, final) < self.least

    def _linearise(
        self, terms: Sequence[Term], noise: Mapping[str, Noise], bank: Sequence[Shapes] | None = None
    ) -> tuple[Search, Array, tuple[Term, ...]]:
        there = relinearise(self.start, self.search.linear, self.point, terms, noise)
        if bank is None and there.signatures.away(self.search.signatures) < SAME_PATH:
            bank = self.search.bank
        return Search(there.linear, there.signatures, noise, bank, self.progress), there.values, there.terms


def on_all_rows(search: Search, final: Hypothesis) -> float:
    """Log posterior of a model, no row taken for an outlier."""
    alone = Background(search.linear.on_all_rows, final.terms, final.noise).evidence
    return alone + sum(term.price for term in final.terms)
