"""The run that should come next: what would separate rivals, sharpen a cause or show a hidden one, per chamber hour.

Were a rival a true, b would be in error in a further run by Δ = y_a − y_b, of which it may take back what its unknowns allow:

    D(a, b) = Δᵀ C_b⁻¹ Δ + ln|C_b| − ln|C_a|,   C = N + J Σ Jᵀ

is the evidence (twice the log odds) against b, N the noise, over all sizes that the records leave possible: a family may grow to look
like the other. A run is as good as its worst pair, either way round. Of a named cause
that nothing rivals, a run counts by how much narrower it makes the coefficients; where nothing is named, by how much it raises the
energy of every effect of the library beyond what the card absorbs.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import scipy

from compensation.arrays import Array
from shell.material import spell
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.verdict import Verdict, spell_structure
from studies.effects import find_effect, library
from studies.inference.background import Background
from studies.inference.hypothesis import Hypothesis
from studies.inference.inferred import Inferred
from studies.inference.linear import SCALES, Term
from studies.planning.candidate import Candidate, Known, simulate_candidates, unabsorbed
from studies.planning.chamber import Chamber
from studies.planning.programme import BY_INPUT, NextRun, Programme, candidates

MOST_RIVALS, CLOSE = 3, 10.0
"""Rivals that are held against each other; log evidence so near the winner's that it deserves a run."""
SMALLEST, ENOUGH = 6.0, 20.0
"""Evidence below which no run is worth the chamber's time, and from which on a shorter run is as good as a longer one: of 23 some 14 came in three simulated runs."""
UNLIKELY = -30.0
"""Log weight of a scale, below which no run will make it likely."""
WORTH = 0.8
"""Width of a cause's interval, over today's, below which a run that sharpens it is worth the chamber's time."""
UNIT, FRESH = 10.0, 1.0 / 30.0
"""Evidence, today, of the hidden effect for which a run is judged; this part of the energy with the best run is added to every energy,
for what cannot show today would otherwise outweigh everything."""


Advice = tuple[str | None, NextRun | None]
Scored = tuple[float, tuple[str, str], Programme]
"""Evidence, the pair that it separates, and the run."""


def suggest(
    found: Inferred, verdict: Verdict, chamber: Chamber, progress: Callable[[str], None] = lambda words: None
) -> Advice:
    """Return one or two sentences about the run that would tell most, and the run; None where nothing can be gained."""
    progress("the next run")
    if verdict.verdict == "unexplained":
        return _look_again(found, verdict, chamber)
    for k, term in enumerate(found.final.terms):
        names = next(
            (c.names for c in verdict.causes if term.effect.name in c.names and c.response == term.response), ()
        )
        rivals = {h.terms[-1].effect.name: h for h in reversed(found.outcome.rivals[k])}
        exact = term.effect.equivalents.get(term.response, ())
        best = max(h.score for h in rivals.values())
        near = [n for n, h in rivals.items() if (n in names or h.score > best - CLOSE) and n not in exact]
        near.sort(key=lambda n: -rivals[n].score)
        if len(near) > 1 or any(n in exact for n in names):
            return _separate(found, term, [rivals[n] for n in near[:MOST_RIVALS]], exact, chamber)
    return _sharpen(found, chamber) if found.final.terms else _detect(found, chamber)


def _candidates(found: Inferred, chamber: Chamber, terms: Sequence[Term] | None) -> list[Candidate]:
    """Simulate what could come next; the drives of some terms, or of all effects, are stepped."""
    effects = library().values() if terms is None else [term.effect for term in terms]
    stepped = sorted({need for effect in effects for need in effect.needs})
    return simulate_candidates(found, candidates(found.search.linear.problem.runs, chamber, stepped))


def _separate(
    found: Inferred, term: Term, rivals: Sequence[Hypothesis], exact: Sequence[str], chamber: Chamber
) -> Advice:
    """Separate rivals by a run; those that no record separates need another measurement."""
    names = [h.terms[-1].effect.name for h in rivals]
    kin = (term.effect.name, *exact) if exact else names
    sensors = "; or ".join(sorted({find_effect(name).sensor for name in kin} - {""}))
    more = f" Alternatively, without a run: {sensors}." if sensors else ""
    if exact:
        more = f" No run can distinguish {term.effect.name} from {spell(exact)}; another sensor can: {sensors}."
    if len(rivals) > 1:
        scored = between(found, rivals, _candidates(found, chamber, [one for h in rivals for one in h.terms]))
        evidence, pair, best = max(scored, key=_worth)
        if evidence > SMALLEST:
            begin = f"To distinguish {names[0]} from {spell(names[1:])}, run"
            repeat = max((e for e, _, p in scored if p.repeats), default=None)
            run = NextRun.of(best, expected_evidence=evidence, repeat_evidence=repeat, separates=pair)
            return f"{begin} {_told(best, evidence, scored)}.{more}", run
    if exact:
        return more.strip(), None
    return f"To distinguish {names[0]} from {spell(names[1:])}: {term.effect.isolate}.{more}", None


def between(found: Inferred, rivals: Sequence[Hypothesis], runs: Sequence[Candidate]) -> list[Scored]:
    """Score runs by the evidence that would separate the worst pair of rivals."""
    known = [_by_size(found, h) for h in rivals]
    names = [h.terms[-1].effect.name for h in rivals]
    pairs = [(a, b) for a in range(len(rivals)) for b in range(len(rivals)) if a != b]
    scored = []
    for run in runs:
        own = [[(weight, *run.ahead(one)) for weight, one in sizes] for sizes in known]
        best = [max(sizes, key=lambda one: one[0])[1] for sizes in own]
        gained = {(a, b): 2.0 * (_log_likelihood(best[a], own[a]) - _log_likelihood(best[a], own[b])) for a, b in pairs}
        worst = min((max(evidence, 0.0), (names[a], names[b])) for (a, b), evidence in gained.items())
        scored.append((*worst, run.programme))
    return scored


def _by_size(found: Inferred, h: Hypothesis) -> list[tuple[float, Known]]:
    """Return what is known beside a rival at each of its possible scales, with the log of that scale's weight."""
    *others, last = h.terms
    gains = Background(found.search.linear, tuple(others), h.noise).by_scale(last)
    weights = gains - scipy.special.logsumexp(gains)
    return [
        (float(weight), Known(found, replace(h, terms=(*others, replace(last, scale=float(scale))))))
        for weight, scale in zip(weights, SCALES, strict=True)
        if weight > UNLIKELY
    ]


def _log_likelihood(rows: Array, sizes: Sequence[tuple[float, Array, Array]]) -> float:
    """Return ln Σ weight · N(rows; mean, 1 + J Jᵀ) of white rows, but for a constant."""
    logs = [
        weight - 0.5 * np.linalg.slogdet(np.eye(J.shape[1]) + J.T @ J)[1] - 0.5 * unabsorbed(rows - mean, J)
        for weight, mean, J in sizes
    ]
    return float(scipy.special.logsumexp(logs))


def _worth(scored: Scored, power: float = 1.0) -> tuple[bool, float]:
    """Runs that tell enough come first, those that tell most per hour before the others; else the most telling."""
    evidence, _, programme = scored
    return evidence >= ENOUGH, evidence / programme.hours**power if evidence >= ENOUGH else evidence


def _told(best: Programme, evidence: float, scored: Sequence[Scored], size: str = "") -> str:
    repeat = max(((e, p) for e, _, p in scored if p.repeats), key=lambda one: one[0], default=None)
    text = f"{best.name} ({best.hours:.2g} h): expected evidence {evidence:.0f}{size}"
    if repeat is not None and repeat[1] is not best:
        text += f", against {repeat[0]:.0f} for a {repeat[1].profile} ({repeat[1].hours:.2g} h)"
    return text


def _sharpen(found: Inferred, chamber: Chamber) -> Advice:
    """Narrow the coefficients of the causes: the geometric mean of their standard deviations after over before, per chamber hour."""
    model = found.final
    known, runs = Known(found, model), _candidates(found, chamber, model.terms)
    root = known.root[len(found.search.linear.problem.priors.values) :]
    before, scored = np.linalg.slogdet(root @ root.T)[1], []
    for run in runs:
        J = run.ahead(known)[1]
        after = np.linalg.inv(np.eye(J.shape[1]) + J.T @ J)[: root.shape[1], : root.shape[1]]
        narrower = np.linalg.slogdet(root @ after @ root.T)[1] - before
        scored.append((float(np.exp(narrower / (2.0 * len(root)))), run.programme))
    worth = [one for one in scored if one[0] < WORTH]
    if not worth:
        return None, None
    narrows, best = min(worth, key=lambda one: np.log(one[0]) / one[1].hours)
    names = spell(list(dict.fromkeys(term.effect.name for term in model.terms)))
    text = f"To know {names} better, run {best.name} ({best.hours:.2g} h): the interval of its size becomes {narrows:.2f} times as wide."
    return text, NextRun.of(best, narrows=narrows)


def _detect(found: Inferred, chamber: Chamber) -> Advice:
    """Raise the energy of what may be hidden: an effect counts by how likely it is today; the score is the mean of the logarithm."""
    search, known = found.search, Known(found, found.final)
    beside = Background(search.linear, (), found.final.noise)
    seen = [one for one in search.scan(found.final, less=()) if _by_programme(one.term)]
    if not seen:
        return None, None
    runs = _candidates(found, chamber, None)
    today, energy = np.zeros(len(seen)), np.zeros((len(seen), len(runs)))
    for k, one in enumerate(seen):
        leading = int(np.argmax(one.term.unit))
        signal = {name: own[:, [leading]] * one.term.spread[leading] for name, own in one.term.columns.items()}
        _, (today[k],), absorbed = beside.left_of(signal)
        for c, run in enumerate(runs):
            change = run.columns(one.term)[:, leading] - run.slopes[:, : run.values] @ absorbed[: run.values, 0]
            energy[k, c] = today[k] + unabsorbed(change, run.ahead(known)[1])
    weights = np.exp(np.clip([one.gain for one in seen], -10.0, 30.0) / CONSTANTS["temper"])
    least = FRESH * energy.max(axis=1) + 1e-300
    score = weights @ np.log((energy + least[:, None]) / (today + least)[:, None]) / weights.sum()
    pair = (seen[int(np.argmax(weights))].term.effect.name, "nothing")
    scored = [(UNIT * float(np.exp(v)), pair, run.programme) for v, run in zip(score, runs, strict=True)]
    evidence, _, best = max(scored, key=lambda one: _worth(one, power=0.5))
    told = _told(best, evidence, scored, " for an effect whose evidence is 10 now")
    repeat = max((e for e, _, p in scored if p.repeats), default=None)
    proposed = NextRun.of(best, expected_evidence=evidence, repeat_evidence=repeat, separates=pair)
    return f"No cause is named. A hidden cause would show best in {told}.", proposed


def _by_programme(term: Term) -> bool:
    effect = term.effect
    return not (effect.event or effect.by_clock or effect.needs == ("quadrature",))


def _look_again(found: Inferred, verdict: Verdict, chamber: Chamber) -> Advice:
    """Repeat a run to see whether what nobody explains recurs, then vary its input alone."""
    results = verdict.responses
    name = max(
        (n for n, r in results.items() if r.verdict == "unexplained"), key=lambda n: results[n].left_over_evidence
    )
    seen = results[name].left_over_input
    kind = next((kind for begin, kind in BY_INPUT.items() if seen.startswith(begin)), "repeat")
    needs = ("voltage_squared", "amplitude_squared", "quadrature", "pattern_angle") if kind == "quiet" else ()
    programmes = candidates(found.search.linear.problem.runs, chamber, needs)
    best = next(one for one in programmes if one.kind == kind)
    text = f"{name} has {spell_structure(seen)} that no known effect explains: run a {programmes[0].profile} unchanged to see whether it recurs"
    text += "." if best.repeats else f", then {best.name} ({best.hours:.2g} h), which varies only that."
    return text, NextRun.of(best)
