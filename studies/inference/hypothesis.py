"""Models of a search: what a scan sees of one more effect, a model with its noise, and what is found in the end."""

from collections.abc import Mapping
from dataclasses import dataclass

from compensation.noise import Noise
from studies.inference.linear import Term


@dataclass(frozen=True)
class Seen:
    """What a scan sees of one effect: log evidence over all shapes, the best of them, its scale, and the noise beside it."""

    gain: float
    best: float
    term: Term
    noise: Mapping[str, Noise]


@dataclass(frozen=True)
class Hypothesis:
    """A model with its noise; `score` is its log posterior up to a constant."""

    terms: tuple[Term, ...]
    noise: Mapping[str, Noise]
    evidence: float

    @property
    def score(self) -> float:
        """Log evidence and the prices of the terms."""
        return self.evidence + sum(term.price for term in self.terms)


@dataclass(frozen=True)
class Outcome:
    """The model without effects, the best one, and for each of its terms the rivals that could stand there, best first."""

    plain: Hypothesis
    final: Hypothesis
    rivals: tuple[tuple[Hypothesis, ...], ...]
    without: tuple[Hypothesis, ...]
