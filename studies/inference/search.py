"""Search over effects: the model of all responses grows by the effect that adds most evidence, as long as that pays its price."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace

import numpy as np
import scipy

from compensation.arrays import Array
from compensation.noise import Noise, white_rms
from studies.inference.background import Background, estimate_noise_of
from studies.inference.hypothesis import Hypothesis, Outcome, Seen
from studies.inference.linear import PRICE, Linear, Shapes, Term
from studies.inference.shapes import polish
from studies.inference.signatures import Signatures

LESS = (0.1, 0.01)
"""Of the slow noise of a response: what an effect has been taken for until it is named."""
MOST_TERMS, CONTENDERS = 4, 5
MARGIN, UNSTATED, FURTHER = 4.0, 1.0, 0.06
"""Log posterior that a cause must bring, and more where no card states the noise; part of what others explain of its response that it must bring besides."""
NEAR = 0.35, 15.0
"""Part of the best scan, less so much, down to which contenders are refitted."""
HOPELESS = -3.0
FORMS, TUNED = 3, 0.5
"""Most times that a shape is moved anew in the noise that it leaves, or the form of an effect that depends on its own size is computed, and the log evidence that another time must bring."""
SURE = 3.0
"""Log evidence, twenty to one, by which the definite curve of a family must be likelier than all of it."""
SUSPICIOUS, SUSPECTS = 3.0, 2
"""Slow noise within a run over that of a row, from which on effects are tried with values of their own, and how many."""
Report = Callable[[str], None]


class Search:
    """The search in one linearised campaign."""

    def __init__(
        self,
        linear: Linear,
        signatures: Signatures,
        noise: Mapping[str, Noise],
        bank: Sequence[Shapes] | None = None,
        progress: Report = lambda _: None,
    ) -> None:
        self.linear, self.signatures, self.noise, self.progress = linear, signatures, noise, progress
        self.bank = self.signatures.shapes_of(signatures.applicable()) if bank is None else bank
        self.first: list[tuple[float, Hypothesis]] = []  # what may come first, with its gain, as `grow` weighed it

    def gains(self, beside: Background, own: Shapes) -> Array:
        """Return what an effect adds to the evidence beside a model, for each of SCALES and of its shapes."""
        units = np.broadcast_to(
            self.signatures.unit(own.effect, own.response, own.members), (len(own.shapes), len(own.members))
        )
        return beside.gains(own.columns, units, own.effect)

    def scan(self, now: Hypothesis, bank: Sequence[Shapes] | None = None, less: Sequence[float] = LESS) -> list[Seen]:
        """Return what every effect adds to a model, the strongest first, with its noise and with less slow noise of a response."""
        taken = {term.key for term in now.terms}
        plain = Background(self.linear, now.terms, now.noise)
        bank = [*self.bank, *self._strongest(plain)] if bank is None else bank
        open_ = [own for own in bank if (own.effect.name, own.response) not in taken]
        found: dict[tuple[str, str], dict[tuple[float, ...], tuple[float, Shapes, int, Mapping[str, Noise]]]] = {}
        for name, noise in [("", now.noise), *self._quieter(now, less)]:
            beside = plain if not name else Background(self.linear, now.terms, noise)
            behind = beside.evidence - plain.evidence
            for own in open_:
                if name and name != own.response:
                    continue
                gain = scipy.special.logsumexp(self.gains(beside, own), axis=0) - np.log(10) + behind
                best = found.setdefault((own.effect.name, own.response), {})
                for k, shape in enumerate(own.shapes):
                    if np.isfinite(gain[k]) and (shape not in best or gain[k] > best[shape][0]):
                        best[shape] = (float(gain[k]), own, k, noise)
        out = []
        for shapes in found.values():
            if not shapes:
                continue
            gains, weights = np.array([(value[0], value[1].weight) for value in shapes.values()]).T
            top, own, k, noise = max(shapes.values(), key=lambda value: value[0])
            # chosen shapes stand for the whole grid
            total = float(scipy.special.logsumexp(gains, b=weights) - np.log(weights.sum()))
            term = self.signatures.term(own.effect, own.response, own.shapes[k], PRICE + min(total - top, 0.0))
            out.append(Seen(total, top, term, noise))
        return sorted(out, key=lambda seen: -seen.gain)

    def _strongest(self, beside: Background) -> Iterator[Shapes]:
        """Yield the strongest shapes of effects whose grids are too fine to be weighed whole: each stands for itself alone."""
        scanned: dict[tuple[str, str], list[Shapes]] = {}
        for own in self.bank:
            scanned.setdefault((own.effect.name, own.response), []).append(own)
        for (_, name), every in scanned.items():
            effect, count = every[0].effect, sum(len(own.shapes) for own in every)
            if effect.strongest is not None and count < every[0].count:
                rows = self.linear.rows[name].times
                shape = effect.strongest(self.signatures.span, rows, beside.weighed(name))
                for one in self.signatures.shapes(effect, [name], [shape]):
                    yield replace(one, weight=count / one.count)

    def settle(self, terms: tuple[Term, ...], noise: Mapping[str, Noise], names: Sequence[str] = ()) -> Hypothesis:
        """Return the model with noise of its own and the last term at its likeliest scale."""
        noise = estimate_noise_of(self.linear, terms, noise, names)
        if not terms:
            return Hypothesis((), noise, Background(self.linear, (), noise).evidence)
        beside = Background(self.linear, terms[:-1], noise)
        last, gain = beside.with_term(terms[-1])
        return Hypothesis((*terms[:-1], last), noise, beside.evidence + gain)

    def beside(self, terms: tuple[Term, ...], plain: Hypothesis, noise: Mapping[str, Noise]) -> Hypothesis:
        """Return the model with some of the terms; without any where their sizes are impossible alone."""
        fewer = self.settle(terms, noise) if terms else plain
        return fewer if np.isfinite(fewer.evidence) else plain

    def polish(self, beside: Background, term: Term, anew: bool = True) -> Term:
        """Return a term whose shape is where the evidence is largest; not `anew`, near the one that it has."""
        return polish(self.signatures.moved, self.signatures.span, beside, term, anew)

    def contenders(self, now: Hypothesis, less: Sequence[float] = LESS) -> list[Hypothesis]:
        """Return the models with one effect more, best first: each with shape, noise and size of its own where it is near enough."""
        seen = self.scan(now, less=less)[:CONTENDERS]
        tried: list[tuple[float, Term, Mapping[str, Noise]]] = []
        plain = Background(self.linear, now.terms, now.noise)
        for one in seen:
            beside = plain if one.noise is now.noise else Background(self.linear, now.terms, one.noise)
            if _near(one.gain, seen[0].gain):
                term = self.polish(beside, one.term)
                tried.append((beside.with_term(term)[1] + beside.evidence - plain.evidence, term, one.noise))
        best = max((gain for gain, _, _ in tried), default=0.0)
        found = []
        for gain, term, noise in tried:
            if _near(gain, best):
                acts = self.linear.responses if term.effect.thermal else (term.response,)
                found.append(self.settle((*now.terms, term), noise, acts))
        return sorted(found, key=lambda h: -h.score)

    def grow(
        self,
        before: Sequence[Term] = (),
        near: Callable[[Hypothesis], bool] = lambda _: True,
        noise: Mapping[str, Noise] | None = None,
        most: int = MOST_TERMS,
    ) -> tuple[Hypothesis, Hypothesis]:
        """Return the model without effects and the one that grew from it, or from terms of another linearisation, by at most so many as long as it is `near` this one."""
        own = estimate_noise_of(self.linear, (), self.noise)
        plain = now = Hypothesis((), own, Background(self.linear, (), own).evidence)
        for term in before:
            beside = Background(self.linear, now.terms, noise or now.noise)
            here = self.polish(beside, self.signatures.moved(term, term.shape), anew=False)
            now = _credited(self.settle((*now.terms, here), noise or now.noise), now)
        plain, now = self._without_idle(plain, now)
        for _ in range(most):  # a term may leave when another one comes
            if len(now.terms) == MOST_TERMS or not self.bank or (now.terms and not near(now)):
                break
            tried = self.contenders(now)
            self.first = self.first if now.terms else [(one.score - now.score, one) for one in tried]
            if not tried or tried[0].score - now.score < self.needed(tried[0].terms[-1], now.terms):
                break
            self.progress(
                f"{tried[0].terms[-1].effect.name} improves the log evidence by {tried[0].score - now.score:.0f}"
            )
            plain, now = self._without_idle(plain, _credited(self.settle(tried[0].terms, tried[0].noise), now))
        return plain, self._definite(self._tuned(now))

    def _definite(self, now: Hypothesis) -> Hypothesis:
        """Cut families down to their definite curves, wherever of their shapes these are, where that is likelier by `SURE`."""
        for k, term in enumerate(now.terms):
            if len(term.members) == 1:
                continue
            others = (*now.terms[:k], *now.terms[k + 1 :])
            beside, found = Background(self.linear, others, now.noise), []
            for own in self.signatures.shapes_of([(term.effect, term.response)]):
                if 0 in own.members:
                    first = own.members.index(0)
                    columns = {name: one[:, :, first : first + 1] for name, one in own.columns.items()}
                    gain = self.gains(beside, replace(own, members=(0,), columns=columns)).max(axis=0)
                    found.append((float(gain.max()), own.shapes[int(np.argmax(gain))]))
            if not found:
                continue
            one = self.polish(beside, self.signatures.term(term.effect, term.response, max(found)[1], term.price, (0,)))
            there = self._with(now, k, replace(beside.with_term(one)[0], brought=term.brought))
            now = there if there.score > now.score + SURE else now
        return now

    def _tuned(self, now: Hypothesis) -> Hypothesis:
        """Move the shapes to where they are likeliest in the noise that the model leaves, not in that of the model before."""
        for k, term in enumerate(now.terms):
            for _ in range(FORMS):  # the noise that a better shape leaves moves the shape again
                others = (*now.terms[:k], *now.terms[k + 1 :])
                here = self.polish(Background(self.linear, others, now.noise), now.terms[k], anew=False)
                there = self._with(now, k, here)
                gained, now = there.score - now.score, max(there, now, key=lambda one: one.score)
                if gained < TUNED:
                    break
            for _ in range(FORMS if term.effect.sees_heat else 0):  # its form is that of its own size
                size = float(np.clip(Background(self.linear, now.terms, now.noise).coefficients(k)[0][0], 0.0, 1.0))
                now = self._with(now, k, self.signatures.moved(now.terms[k], (size, *now.terms[k].shape[1:])))
        return now

    def _with(self, now: Hypothesis, k: int, term: Term) -> Hypothesis:
        """Return a model with another term in one place."""
        return self.settle((*now.terms[:k], term, *now.terms[k + 1 :]), now.noise)

    def needed(self, term: Term, others: Sequence[Term]) -> float:
        """Return the log posterior that a cause must bring beside others."""
        margin = MARGIN if self.linear.problem.instrument.polynomial is None else MARGIN + UNSTATED
        return margin + FURTHER * sum(other.brought for other in others if other.response == term.response)

    def compare(self, plain: Hypothesis, final: Hypothesis) -> Outcome:
        """Return a model with what could stand in the place of each of its terms."""
        rivals, without = [], []
        for k, term in enumerate(final.terms):
            self.progress(f"what could stand in the place of {term.effect.name}")
            others = (*final.terms[:k], *final.terms[k + 1 :])
            base = self.beside(others, plain, final.noise)
            same = replace(final, terms=(*others, term))
            quiet = replace(base, noise=final.noise)  # a rival leaves as little
            known = [h for h in self.contenders(quiet, ()) if h.terms[-1].key != term.key and h.score > base.score]
            rivals.append(tuple(sorted([same, *known], key=lambda h: -h.score)))
            without.append(base)
        return Outcome(plain, final, tuple(rivals), tuple(without))

    def suspects(self, now: Hypothesis) -> list[tuple[tuple[Term, ...], Mapping[str, Noise]]]:
        """Return what may be behind slow noise far above the white noise of rows: nothing but less noise, and effects that then gain most."""
        found: list[tuple[tuple[Term, ...], Mapping[str, Noise]]] = []
        for name, noise in self._quieter(now, LESS[:1]):
            if self.linear.rows[name].slow_share(now.noise[name]) < SUSPICIOUS:
                continue
            beside, tried = Background(self.linear, now.terms, noise), []
            for own in self.bank:
                if own.response == name and (own.effect.name, name) not in {term.key for term in now.terms}:
                    gain = self.gains(beside, own).max(axis=0)
                    tried.append((float(gain.max()), own, int(np.argmax(gain))))
            best: dict[str, tuple[Term, ...]] = {}
            for _, own, k in sorted(tried, key=lambda one: -one[0]):
                best.setdefault(own.effect.name, (*now.terms, self.signatures.term(own.effect, name, own.shapes[k])))
            found += [(terms, noise) for terms in (now.terms, *list(best.values())[:SUSPECTS])]
        return found

    def _quieter(self, now: Hypothesis, parts: Sequence[float]) -> list[tuple[str, dict[str, Noise]]]:
        """Return noises with less that is slow in one response, and no more white noise than neighbouring rows scatter."""
        found = []
        for name, own in now.noise.items():
            rows = self.linear.rows[name]
            rest = Background(self.linear, now.terms, now.noise).residual(name)
            white = min(own.white, white_rms(*(rest[place] for place in rows.slices)) * rows.span**0.5 or own.white)
            for part in parts:
                less = replace(
                    own,
                    white=white,
                    flicker=own.flicker * max(part, 0.1),
                    walk=own.walk * part,
                    markov=own.markov * part,
                    offset=own.offset * max(part, 0.1),
                )
                found.append((name, {**now.noise, name: less}))
        return found

    def fair(self, one: Hypothesis) -> float:
        """Log posterior of a model, its outliers being what stands out of it."""
        return _fair(Background(self.linear, one.terms, one.noise))

    def _spared(self, one: Hypothesis) -> tuple["Search", Hypothesis, float]:
        """Take for outliers what stands out of a model: the search in such rows, the model with the noise of the rest, and its `fair` score."""
        there, beside = self, Background(self.linear, one.terms, one.noise)
        for _ in range(FORMS):  # an outlier hides in the noise that others make
            if not beside.hides_outliers:
                break
            there = copy(there)
            there.linear = replace(there.linear, rows=beside.spared)
            one = there.settle(one.terms, one.noise)
            beside = Background(there.linear, one.terms, one.noise)
        return there, one, _fair(beside)

    def _without_idle(self, plain: Hypothesis, now: Hypothesis) -> tuple[Hypothesis, Hypothesis]:
        """Leave out terms that do not pay beside the others, or only for rows that else are outliers, which are spared from then on."""
        if not now.terms:
            return plain, now
        there, now, score = self._spared(now)
        plain, now = self._take(there, now, plain)
        for k in range(len(now.terms)):
            others = (*now.terms[:k], *now.terms[k + 1 :])
            there, fewer, without = self._spared(self.beside(others, plain, now.noise))
            if score - without < self.needed(now.terms[k], others):
                return self._without_idle(*self._take(there, fewer, plain))
        return plain, now

    def _take(self, there: "Search", now: Hypothesis, plain: Hypothesis) -> tuple[Hypothesis, Hypothesis]:
        """Go on in the rows of another search; return the model without effects in these, and that one."""
        if there is self:
            return plain, now
        self.linear = there.linear
        return self.settle((), plain.noise), now


def _near(gain: float, best: float) -> bool:
    part, less = NEAR
    return gain > max(part * best - less, HOPELESS)


def _fair(beside: Background) -> float:
    return beside.fair + sum(term.price for term in beside.terms)


def _credited(now: Hypothesis, before: Hypothesis) -> Hypothesis:
    """Return a model whose last term knows what it brought."""
    last = replace(now.terms[-1], brought=max(now.score - before.score, 0.0))
    return replace(now, terms=(*now.terms[:-1], last))
