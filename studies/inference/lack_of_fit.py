"""Lack of fit: what no named effect explains, seen by generic forms of every input, by what is sharp in time and by fast lines."""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from compensation.arrays import Array
from compensation.lines import Line
from compensation.noise_estimate import price_of
from compensation.noise_rows import NoiseRows
from studies.calibration.problem import CardProblem
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.verdict import spell_structure
from studies.inference.background import Background
from studies.inference.generic_forms import BUMP, STEP, SWITCH, beside_chamber, generic_forms
from studies.inference.hypothesis import Hypothesis
from studies.inference.linear import Shapes, Term
from studies.inference.predicted import Model, Rows
from studies.inference.search import LESS, SUSPICIOUS, Search
from studies.inference.sharp import brief_events, fast_line, intermittent, loudness, recurring, switching, tails_of
from studies.simulation.drive import COLUMN

ENOUGH = CONSTANTS["margin"] - CONSTANTS["log_prior_unknown"]
"""Log evidence from which on structure is no chance."""

DRAWS = 8
"""Of normal noise, none of which may show as much switching: noise that keeps its level for some rows is no telegraph."""
LAST_DIGIT = "the last digit of the readings"
REPEATED, ROUNDING = 0.5, 1.3
"""Part of the readings that are as the one before, from which on they are rounded to more than their noise; the rms of that, in its own parts."""
COARSE = 0.6
"""Residual over the last digit, up to which it makes of noise what is brief, and levels."""


@dataclass(frozen=True)
class Leftover:
    """What is left of one response: in which input, with how much log evidence, the part of the structure that is explained, and the forms looked for."""

    input: str
    evidence: float
    share: float
    forms: int
    line: Line | None = None

    @property
    def significant(self) -> bool:
        """Whether it is more than chance."""
        return self.evidence > ENOUGH

    @property
    def doubtful(self) -> bool:
        """Whether it is more than noise leaves, the likeliest of so many forms, though perhaps too little to be called structure."""
        return self.evidence > CONSTANTS["margin"] + float(np.log(self.forms))


def doubt_of(input_: str, evidence: float) -> str:
    """Return the sentence on structure that is more than noise leaves and less than it takes to name it."""
    needed = 2.0 * (CONSTANTS["margin"] - CONSTANTS["log_prior_unknown"])
    return (
        f"the residual may hold {spell_structure(input_)}: its evidence of {2.0 * evidence:.3g} is more than noise leaves,"
        f" but less than the {needed:g} that proves it"
    )


def generic_bank(search: Search) -> list[Shapes]:
    """Return the columns of the generic forms."""
    signatures = search.signatures
    forms = [*generic_forms(signatures.span, [path.states for path in signatures.paths]), BUMP, STEP]
    runs = signatures.problem.runs
    if all(run.inner.boundary == "housing" and run.record.has_values(COLUMN["chamber"]) for run in runs):
        forms.append(beside_chamber(signatures.span, [run.record for run in runs]))
    return search.signatures.shapes_of(signatures.applicable({form.name: form for form in forms}))


def look(
    search: Search, bank: Sequence[Shapes], plain: "Hypothesis | Model", final: Hypothesis, rows: Mapping[str, Rows]
) -> dict[str, Leftover]:
    """Return what a model leaves of every response, on `rows` of the records; `plain` has no effects, or another heat path."""
    seen = search.scan(final, bank, less=())
    own = Background(search.linear, final.terms, final.noise)
    longer, problem = isinstance(plain, Model), search.linear.problem
    before = Background(plain.linear if isinstance(plain, Model) else search.linear, plain.terms, final.noise)
    found = {}
    for name in search.linear.responses:
        mine = [one for one in seen if one.term.response == name]
        best = max(mine, key=lambda one: one.gain)
        word, smooth = best.term.effect.name, best.gain
        if search.linear.rows[name].slow_share(final.noise[name]) > SUSPICIOUS:
            instead = _instead_of_noise(search, bank, final, name)
            # the odds against correlated noise are no evidence of structure in its place
            less = final.evidence + price_of(final.noise[name], search.linear.stated(name))
            if instead is not None and instead.evidence - less > smooth:
                best = replace(best, term=instead.terms[-1])
                word, smooth = best.term.effect.name, instead.evidence - less
        evidence, line = smooth, None
        level, rest = search.linear.rows[name], own.residual(name)
        white = level.whiten(rest, final.noise[name])
        apart = [np.sign(rest[place]) * (far > 1) for place, far in zip(level.slices, level.stretch, strict=True)]
        # readings between two digits are two levels, one of them at times brief
        coarse = name in rows and rows[name].rms < COARSE * problem.digits[name]
        brief = -np.inf if coarse else max(_brief(white), recurring(apart))
        if brief > evidence:
            word, evidence = "time: brief events", brief
        even = white / _louder(level, rows[name]) if name in rows else white
        fitful = intermittent([even[place] for place in level.slices])
        if fitful > evidence:
            word, evidence = "time: an intermittent oscillation", fitful
        # levels between which a form of an input goes would be two as well
        switches = _switching(search, final, name, rest) if smooth <= ENOUGH and not coarse else -np.inf
        if switches > evidence:
            word, evidence = SWITCH.name, switches
        fast = _line(search, name, rows.get(name))
        if fast is not None and fast.evidence > evidence:
            word = f"time: a line of {fast.period:.3g} s, too fast for steps of {_step(search, name):.3g} s"
            evidence, line = fast.evidence, fast
        named = [term for term in final.terms if term.response == name or term.effect.thermal]
        share = _share(search, name, before, own, best.term) if named or longer else 0.0
        if evidence > smooth and (named or longer):
            gained = max(own.evidence - before.evidence, 0.0)
            share = min(share, gained / max(gained + evidence, 1e-9))
        if name in rows and is_rounding(problem, name, rows[name]):
            word, evidence, line = LAST_DIGIT, min(evidence, 0.0), None
        found[name] = Leftover(word, float(evidence), share, len(mine), line)
    return found


def _brief(white: Array) -> float:
    """Log evidence of brief events in rows of white noise, over such noise with tails as heavy as theirs."""
    return brief_events(white, tails_of(white / max(float(np.std(white)), 1e-300)))


def is_rounding(problem: CardProblem, name: str, rest: Rows) -> bool:
    """Whether what is left of readings that mostly repeat is what a step of q leaves, q/√12: it follows the level as structure does."""
    readings = [problem.runs[part.run].own_rows[name][1] for part in problem.members(name)]
    repeats = np.concatenate([np.diff(own) == 0.0 for own in readings])
    return bool(repeats.mean() > REPEATED and rest.rms < ROUNDING * problem.digits[name] / 12**0.5)


def _louder(level: NoiseRows, rest: Rows) -> Array:
    """How many times louder than usual the noise of the rows about each block is."""
    runs = zip(level.times, rest.time, rest.residual, strict=True)
    about = [np.interp(t - t[0], rows - rows[0], loudness(own)) for t, rows, own in runs]
    return np.asarray(np.sqrt(np.maximum(np.concatenate(about), 1.0)))


def _instead_of_noise(search: Search, bank: Sequence[Shapes], final: Hypothesis, name: str) -> Hypothesis | None:
    """Return the model with the likeliest form where slow noise stands that may hide it; none in time, which slow noise is too."""
    forms = [own for own in bank if own.response == name and not own.effect.by_clock]
    seen = search.scan(final, forms, less=LESS[:1])[:1]
    return search.settle((*final.terms, seen[0].term), seen[0].noise, [name]) if seen else None


def _switching(search: Search, final: Hypothesis, name: str, rest: Array) -> float:
    """Log evidence of a level that switches to another one and back, in noise of its own, over slow noise alone, less the most that normal noise of the same spectrum shows in some draws."""
    found = _by_path(search, final, name, rest)
    if found > ENOUGH:
        found -= max(0.0, *(_of_noise(search, final, name, rest, seed) for seed in range(DRAWS)))
    return found


def _by_path(search: Search, final: Hypothesis, name: str, rest: Array) -> float:
    """The same of the likeliest path of levels, as likely as it is."""
    found = switching([rest[place] for place in search.linear.rows[name].slices])
    if found is None:
        return -np.inf
    path, chance = found
    unit = search.signatures.unit(SWITCH, name, (0,))
    term = Term(SWITCH, name, (), {name: path[:, None]}, (0,), unit, price=0.0)
    return search.settle((*final.terms, term), final.noise, [name]).evidence - final.evidence + chance


def _of_noise(search: Search, final: Hypothesis, name: str, rest: Array, seed: int) -> float:
    """The same where what the model leaves is normal noise of its spectrum: phases by chance."""
    there, rng = copy(search), np.random.default_rng(seed)
    noise = np.concatenate([_any_phase(rest[place], rng) for place in search.linear.rows[name].slices])
    there.linear = replace(
        search.linear, target={**search.linear.target, name: search.linear.target[name] - rest + noise}
    )
    own = there.settle(final.terms, final.noise, [name])
    return _by_path(there, own, name, Background(there.linear, own.terms, own.noise).residual(name))


def _any_phase(rest: Array, rng: np.random.Generator) -> Array:
    spectrum = np.fft.rfft(rest)
    turned = np.abs(spectrum) * np.exp(2j * np.pi * rng.random(len(spectrum)))
    turned[0] = spectrum[0]
    return np.asarray(np.fft.irfft(turned, len(rest)))


def _share(search: Search, name: str, before: Background, own: Background, generic: Term) -> float:
    """Part of the structure that the named effects explain, in independent rows of the noise."""
    term, _ = own.with_term(generic)
    fullest = replace(own, terms=(*own.terms, term))
    rows, noise = search.linear.rows[name], own.noise[name]
    left = [float(np.sum(rows.whiten(one.residual(name), noise) ** 2)) for one in (before, own, fullest)]
    total = max(left[0] - left[2], 1e-9)
    return float(np.clip(1.0 - (left[1] - left[2]) / total, 0.0, 1.0)) if left[0] > left[1] else 0.0


def _step(search: Search, name: str) -> float:
    times = search.linear.rows[name].times
    return float(np.median(np.concatenate([np.diff(t) for t in times if len(t) > 1])))


def _line(search: Search, name: str, rows: Rows | None) -> Line | None:
    if rows is None:
        return None
    sampling = float(np.median(np.concatenate([np.diff(t) for t in rows.time])))
    series = list(zip(rows.time, rows.residual, strict=True))
    return fast_line(series, sampling, _step(search, name), rows.rms)
