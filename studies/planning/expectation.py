"""Expected answers of a diagnosis, by algebra: what every effect would be named as, averaged over the noise.

A campaign is linear in its unknowns about the card, so that a hidden effect of size a is a signal a x in its rows. Of it the card
absorbs a part; what it leaves has the energy a² E in whitened rows. For each hypothesis h (effect, shape, size) beside the card the
expected log evidence over nothing is, with eigenvalues λ and moments α of its Gram matrix and prior variance s²,

    S_h(a) = −½ Σ ln(1 + s² λ) + ½ Σ s² (a² α² + λ) / (1 + s² λ)

and the log odds of the truth against h scatter with the noise as N(S_t − S_h, a² E − e_h), e_h the energy that h explains; those of h
against nothing as N(S_h, Σ w² λ a² α²), w = s²/(1 + s² λ). (The expectation over data of known signal: Cowan et al. 2011, Eur. Phys. J. C 71, 1554.) So the chance that
it is detected, that another effect is named or cannot be told from it, are normal integrals. Of all others the worst one counts.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from compensation.arrays import Array
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.verdict import temper_of
from studies.effects import Effect
from studies.inference.background import Background
from studies.inference.linear import PRICE, SCALES, Shapes
from studies.inference.search import MARGIN, Search
from studies.inference.shapes import MOST_SHAPES

Key = tuple[str, str]
"""Effect and response."""
CASES = 12
"""Shapes in which an effect is hidden, evenly chosen."""


@dataclass(frozen=True)
class Hidden:
    """One effect in several shapes, at the size of strong cases."""

    effect: Effect
    response: str
    signal: Mapping[str, Array]  # response -> (M, B)
    unit: float  # what its definite coefficient is then, in its own unit
    name: str  # of that coefficient

    @property
    def key(self) -> Key:
        """Effect and response."""
        return self.effect.name, self.response

    @property
    def cases(self) -> int:
        """Number of shapes."""
        return int(next(iter(self.signal.values())).shape[1])


@dataclass(frozen=True)
class Chances:
    """Answers to one hidden effect by size (A,) in strong cases and by shape."""

    size: Array
    # named, alone, nothing: array (A, B): Chance that the answer holds the effect, alone or in a set; that it is the
    # effect alone; that nothing is named.
    named: Array
    alone: Array
    nothing: Array
    # beside, instead: effect -> array (A, B): Chance that it stands in a set with another, and that the other is named
    # in its place.
    beside: Mapping[str, Array]
    instead: Mapping[str, Array]


def hide(search: Search, group: Sequence[Shapes], rng: np.random.Generator) -> Hidden:
    """Hide an effect in shapes of its grid: the definite curve, and the rest of its family as nature might add it."""
    effect, response = group[0].effect, group[0].response
    places = [(own, h) for own in group for h in range(len(own.shapes))]
    chosen = [places[k] for k in np.unique(np.linspace(0, len(places) - 1, CASES).round().astype(int))]
    definite = int(np.argmax(effect.spread == 1.0)) if np.any(effect.spread == 1.0) else int(np.argmax(effect.spread))
    columns: dict[str, list[Array]] = {}
    for own, h in chosen:
        weight = rng.standard_normal(len(own.members)) * search.signatures.unit(effect, response, own.members)
        at = (
            own.members.index(definite) if definite in own.members else int(np.argmax(effect.spread[list(own.members)]))
        )
        weight[at] = search.signatures.unit(effect, response, own.members)[at]
        for name, X in own.columns.items():
            columns.setdefault(name, []).append(X[:, h] @ weight)
    unit = float(search.signatures.unit(effect, response, [definite])[0])
    names = [n for n, c in zip(effect.coefficient_names(response), effect.coefficients, strict=True) for _ in c.spread]
    return Hidden(effect, response, {n: np.stack(own, axis=1) for n, own in columns.items()}, unit, names[definite])


class Expectation:
    """Hidden effects and all hypotheses beside a card that is known as well as a campaign lets it be."""

    def __init__(self, search: Search, beside: Background, hidden: Sequence[Hidden]) -> None:
        self.hidden = tuple(hidden)
        counts = [one.cases for one in hidden]
        edges = np.cumsum([0, *counts])
        self.places = [slice(int(a), int(b)) for a, b in itertools.pairwise(edges)]
        signals = {name: np.zeros((len(target), edges[-1])) for name, target in search.linear.target.items()}
        for one, place in zip(hidden, self.places, strict=True):
            for name, columns in one.signal.items():
                signals[name][:, place] = columns
        left, self.energy, absorbed = beside.left_of(signals)
        self.signals = signals
        self.left = {n: own - search.linear.columns(beside.terms, n) @ absorbed for n, own in signals.items()}
        self._explained: dict[Key, list[tuple[Array, ...]]] = {}
        for own in search.bank:
            units = np.broadcast_to(
                search.signatures.unit(own.effect, own.response, own.members), (len(own.shapes), len(own.members))
            )
            values, _, along = beside.against(own.columns, units, left)
            seen = SCALES[:, None, None] ** 2 / (1.0 + SCALES[:, None, None] ** 2 * values)  # (S, H, k)
            energy, spread = (np.einsum("shk,hkb->shb", w, along**2) for w in (seen, seen**2 * values))
            level = 0.5 * (seen * values - np.log1p(SCALES[:, None, None] ** 2 * values)).sum(axis=-1)
            level -= np.log(len(SCALES) * min(own.count, MOST_SHAPES))
            flat = tuple(
                one.reshape(-1, energy.shape[-1]) for one in (energy, spread, level[:, :, None] + 0.0 * energy)
            )
            self._explained.setdefault((own.effect.name, own.response), []).append(flat)

    def score(self, key: Key, size: Array) -> tuple[Array, Array, Array]:
        """Expected log posterior of an effect over nothing, the energy that it explains and the variance of its log odds, (A, B)."""
        energy, spread, level = (np.concatenate(parts) for parts in zip(*self._explained[key], strict=True))
        score, best = np.empty((2, len(size), energy.shape[1]))
        for k, a in enumerate(size):
            gain = level + 0.5 * a**2 * energy
            best[k], highest = np.argmax(gain, axis=0), gain.max(axis=0)
            score[k] = PRICE + highest + np.log(np.exp(gain - highest).sum(axis=0))
        explained, variance = (
            size[:, None] ** 2 * np.take_along_axis(of, best.astype(int), axis=0) for of in (energy, spread)
        )
        return score, explained, variance

    def chances(self, size: Array) -> dict[Key, Chances]:
        """Return the answers to every hidden effect at sizes in strong cases."""
        scores = {key: self.score(key, size) for key in self._explained}
        return {
            one.key: self._answers(one, place, size, scores)
            for one, place in zip(self.hidden, self.places, strict=True)
        }

    def _answers(
        self, one: Hidden, place: slice, size: Array, scores: Mapping[Key, tuple[Array, Array, Array]]
    ) -> Chances:
        own = scores[one.key][0][:, place]
        energy = size[:, None] ** 2 * self.energy[place]
        seen = [(score[:, place], variance[:, place]) for score, _, variance in scores.values()]
        best = np.max([score for score, _ in seen], axis=0)
        detected = np.max(
            [scipy.special.ndtr((score - MARGIN) / np.sqrt(variance + 0.25)) for score, variance in seen], axis=0
        )
        near = np.vectorize(temper_of)(best) * -np.log(CONSTANTS["member"])
        ahead: dict[str, Array] = {}
        level: dict[str, Array] = {}
        for (name, _), (score, explained, _) in scores.items():
            if name == one.effect.name:
                continue
            spread = np.sqrt(np.maximum(energy - explained[:, place], 0.0) + 1.0)
            lead = (score[:, place] - own) / spread
            ahead[name] = np.maximum(ahead.get(name, 0.0), scipy.special.ndtr(lead - near / spread))
            level[name] = np.maximum(level.get(name, 0.0), scipy.special.ndtr(lead + near / spread))
        wrong = np.max(list(ahead.values()), axis=0, initial=0.0)
        named = detected * (1.0 - wrong)
        exact = one.effect.equivalents.get(one.response, ())
        beside = {n: named * (1.0 if n in exact else share) for n, share in level.items()}
        beside |= {n: named for n in exact if n not in beside}
        alone = named * (
            1.0 - np.max([share / np.maximum(named, 1e-12) for share in beside.values()], axis=0, initial=0.0)
        )
        total = np.maximum(sum(ahead.values(), np.zeros_like(wrong)), 1e-12)
        instead = {n: detected * wrong * share / total for n, share in ahead.items()}
        return Chances(size, named, alone, 1.0 - detected, beside, instead)
