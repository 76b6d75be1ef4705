"""Steady forms of effects, weighed beside what a table's baseline can do, in every noise that its rows may have."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from compensation.arrays import Array
from compensation.constants import NINETY
from compensation.noise import Noise
from studies.calibration.observed import SETTLED, SettledTable
from studies.calibration.problem import SOAK
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.verdict import Cause, Interval, weigh
from studies.effects import Effect, library
from studies.inference.background import Background
from studies.inference.linear import SCALES, Linear, Term

WHITES = 8
"""White noises from rounding to scatter."""
WANDERS = (0.0, 3.0, 30.0, 300.0, 3e3, 3e4)
"""Variance of a random walk along the whole table over that of the white noise."""
FEWEST_WANDERING = 24
MOST_WALK = 10.0
"""Largest random walk over the whole table, in what the readings leave of their parabola: a walk leaves about a sixth of itself."""
STRONG = 0.1
"""Largest usual size of an effect, in what the readings vary by."""
FREE = 1e3
"""Scale of a form whose size nothing holds, as it is shown."""


@dataclass(frozen=True)
class Form:
    """One steady form of an effect: twice its log evidence over nothing, and the model with it, of any size, in white noise."""

    evidence: float
    model: Background

    @property
    def term(self) -> Term:
        """Effect, shape and columns."""
        return self.model.terms[0]

    @property
    def words(self) -> str:
        """The form in words."""
        return self.term.effect.steady_words.format(*self.term.shape)

    @property
    def residual(self) -> Array:
        """What it leaves of the rows, Hz."""
        return self.model.residual(SETTLED)

    @property
    def left_out(self) -> float:
        """Rms by which it misses rows that are left out, Hz."""
        return rms(self.model.left_out(SETTLED))


def each_once(forms: Sequence[Form], placed: bool = False) -> list[Form]:
    """Return the likeliest form of every effect, or of all that differ in words, but for where they are placed."""
    best: dict[str, Form] = {}
    for one in forms:
        words = one.term.effect.steady_words
        best.setdefault(one.term.effect.name if placed else one.words if "{0:.0f}" in words else words, one)
    return list(best.values())


def cause_of(forms: Sequence[Form]) -> Cause:
    """Return the likeliest form as a cause, with the effects that the table cannot tell from it."""
    best, each = forms[0], each_once(forms, placed=True)
    scores = [0.5 * one.evidence + CONSTANTS["log_prior_effect"] for one in each]
    (name, *others), probability = weigh([one.term.effect.name for one in each], scores, 0.0)
    size, sd = best.model.peak_to_peak(0, SETTLED)
    numbers = {"peak_to_peak_Hz": Interval(size, max(size - NINETY * sd, 0.0), size + NINETY * sd)}
    return Cause(name, "frequency_Hz", probability, tuple(sorted(others)), numbers, best.evidence, peak=size)


def weigh_forms(linear: Linear, table: SettledTable) -> tuple[list[Form], float]:
    """Return the steady forms of all effects, the likeliest first, and the white noise of the rows without any, Hz."""
    levels = _noises(linear, table)
    nothing, noise = _averaged(levels, np.array([one.evidence for one in levels]))
    effects = [effect for effect in library().values() if effect.steady]
    forms = [form for effect in effects for form in _weigh(effect, levels, table, nothing)]
    return sorted(forms, key=lambda form: -form.evidence), noise.white


def _noises(linear: Linear, table: SettledTable) -> list[Background]:
    """Return the baseline in white noise from the rounding of the readings up to their scatter, with a wander along many rows."""
    count, most = len(table.frequency), max(table.scatter, 2.0 * table.rounding)
    return [
        Background(linear, (), {SETTLED: Noise(white, walk=white * float(np.sqrt(wander / count / SOAK)))})
        for white in map(float, np.geomspace(table.rounding, most, WHITES))
        for wander in (WANDERS if count >= FEWEST_WANDERING else WANDERS[:1])
        if np.sqrt(wander) * white <= MOST_WALK * most
    ]


def _averaged(levels: Sequence[Background], values: Array) -> tuple[float, Noise]:
    """Return the log of the mean of likelihoods over noises, and the white noise of the rows, weighted by them."""
    whites = np.log([one.noise[SETTLED].white for one in levels])
    white = Noise(float(np.exp(scipy.special.softmax(values) @ whites)))
    return float(scipy.special.logsumexp(values) - np.log(len(values))), white


def _weigh(effect: Effect, levels: Sequence[Background], table: SettledTable, nothing: float) -> list[Form]:
    """Weigh an effect in all its shapes, the sizes averaged; the best one stands for the mean over them."""
    assert effect.steady is not None
    assert effect.steady_grid is not None
    x, least = table.middled, table.rounding
    pairs = [(shape, effect.steady(x, shape)) for shape in effect.steady_grid(float(x.min()), float(x.max()))]
    pairs = [(shape, own) for shape, own in pairs if own.shape[1] + 4 <= x.size and own.any(axis=0).all()]
    if not pairs:
        return []
    columns = np.zeros((x.size, len(pairs), max(own.shape[1] for _, own in pairs)))
    for h, (_, own) in enumerate(pairs):
        columns[:, h, : own.shape[1]] = own
    strong = max(STRONG * float(np.ptp(table.frequency)), 10.0 * least)
    seen = SCALES >= SCALES[-1] * least / strong  # what is smaller than the last digit is nothing
    size = np.sqrt(np.mean(columns**2, axis=0))
    units = strong / SCALES[-1] * np.divide(1.0, size, out=np.zeros_like(size), where=size > 0.0)
    every = [one.evidence + one.gains({SETTLED: columns}, units, effect.settled)[seen] for one in levels]
    values = scipy.special.logsumexp(every, axis=1) - np.log(seen.sum())
    white = [k for k, one in enumerate(levels) if one.noise[SETTLED].walk == 0.0]
    scores = np.array([_averaged(levels, own)[0] for own in values.T]) - np.log(len(pairs)) - nothing
    scores[np.argmax(scores)] = scipy.special.logsumexp(scores)
    found = []
    for h, (shape, own) in enumerate(pairs):
        term = Term(effect, SETTLED, shape, {SETTLED: own}, tuple(range(own.shape[1])), units[h, : own.shape[1]], FREE)
        noise = _averaged([levels[k] for k in white], values[white, h])[1]
        found.append(Form(2.0 * float(scores[h]), Background(levels[0].linear, (term,), {SETTLED: noise})))
    return found


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))
