"""The run that would tell most: two-sided T-optimality between rivals, detection energy where nothing is named.

Rivals a and b, fitted to the campaign, predict it and a further run. The evidence by which b would lose if a were true is

    D(a, b) = min over b's parameters of Σ (y_a − y_b)² / σ²

in the basis of the fitted noise, over all recorded rows and the new ones together; b's coefficients, shapes and the lag
are refitted (Atkinson and Fedorov, Biometrika 62 (1975) 57; shapes linearised). A run is as good as the worst of its pairs,
either way round. Where nothing is named yet, b is the baseline and a any effect of the library: the run counts that
raises the energy of their signatures most.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from studies.diagnosis.baseline import Problem, Term, span_of
from studies.diagnosis.campaign import Campaign
from studies.diagnosis.effects import Effect, library
from studies.diagnosis.fit import Fit, jacobian_of
from studies.diagnosis.likelihood import NoiseBasis, orthonormal, unit
from studies.diagnosis.null import shipped_levels
from studies.diagnosis.programme import Programme, Steps, candidates
from studies.diagnosis.selection import Found, Selection
from studies.diagnosis.states import FloatArray, States, average
from studies.diagnosis.thermometer import thermal_correction

NOTHING = "nothing"
MOST_RIVALS = 3
SMALLEST = 6.0
"""Evidence below which no run of the family is worth the chamber's time to separate two rivals."""
EVENTS = ("jump", "periodic", "calibration")
"""Effects that no chamber programme brings about."""
UNIT = 10.0
"""Evidence, today, of the hidden effect for which a detecting run is judged."""
FRESH = 1.0 / 30.0
"""This part of a signature's energy with the best run is added to every energy: what cannot show today would otherwise
outweigh everything."""
TEMPER = 1.6
SHAPES = 3


@dataclass(frozen=True)
class NextRun:
    """One suggested run.

    Attributes
    ----------
    profile : str
        In words, as `hrg simulate` takes them, or "repeat of FILE".
    drives : mapping from column to Steps
    expected_evidence, repeat_evidence : float or None
        Evidence that would separate the two after this run, and after the best repeat of a recorded run.
    separates : (str, str) or None
    time_h, temperature_degC : arrays
        The profile, for pictures.
    """

    profile: str
    drives: Mapping[str, Steps]
    expected_evidence: float | None
    repeat_evidence: float | None
    separates: tuple[str, str] | None
    time_h: FloatArray
    temperature_degC: FloatArray

    def as_dict(self) -> dict[str, Any]:
        """Return the object `next_run` of the contract."""
        return {
            "profile": self.profile,
            "drives": {c: {"levels": list(s.levels), "hold_min": s.hold_min} for c, s in self.drives.items()},
            "expected_evidence": self.expected_evidence,
            "repeat_evidence": self.repeat_evidence,
            "separates": None if self.separates is None else list(self.separates),
        }


@dataclass(frozen=True)
class Scored:
    """A candidate run with the evidence that it would bring."""

    programme: Programme
    evidence: float
    pair: tuple[str, str]


def as_next_run(scored: Scored, repeat: float | None, expected: bool = True) -> NextRun:
    """Return a candidate as the suggestion."""
    programme = scored.programme
    return NextRun(
        programme.profile,
        programme.drives,
        scored.evidence if expected else None,
        repeat,
        scored.pair if expected else None,
        programme.states.time / 3600.0,
        programme.chamber - 273.15,
    )


class Member:
    """One explanation, fitted to the record, that can be continued into a further run."""

    def __init__(self, name: str, fit: Fit, clock: Fit | None, noise: Fit) -> None:
        """Keep the fit; `clock` is the fit of the frequency where that is the thermometer, `noise` sets the metric."""
        self.name, self.fit, self.clock = name, fit, clock
        self.share, self.deviation = noise.linear.share, float(np.sqrt(noise.linear.variance))

    @cached_property
    def recorded(self) -> tuple[FloatArray, FloatArray]:
        """Whitened mean on the recorded rows, and whitened columns of what can be refitted."""
        mean = self.fit.columns() @ self.fit.linear.coefficients
        tangent = np.concatenate([self.fit.columns(), jacobian_of(self.fit)], axis=1)
        basis = self.fit.problem.basis
        root = np.sqrt(basis.weights(self.share)) / self.deviation
        return basis.rotate(mean) * root, basis.rotate(tangent) * root[:, None]

    def follow(self, states: States) -> tuple[FloatArray, FloatArray]:
        """Whitened mean and columns of a further run; columns of other runs' own states are left out."""
        fit = continued(self.fit, states, self.clock)
        rows = fit.problem.present[0].size
        columns = np.concatenate([fit.columns(), jacobian_of(fit)], axis=1)[:rows]
        basis = NoiseBasis.of([average(states.time, fit.problem.group)], fit.problem.kernel)
        root = np.sqrt(basis.weights(self.share)) / self.deviation
        mean = columns[:, : fit.linear.coefficients.size] @ fit.linear.coefficients
        return basis.rotate(mean) * root, basis.rotate(columns) * root[:, None]

    def joined(self, ahead: FloatArray) -> FloatArray:
        """Columns of the record and of the further run, one above the other, with their own states apart."""
        return join(self.recorded[1], ahead, own_count(self.fit.problem), len(self.fit.problem.states))


def own_count(problem: Problem) -> int:
    """How many columns of the baseline belong to one run alone: offset, initial state."""
    return int(problem.response == "bias_deg_per_h") + int(problem.lagged)


def join(recorded: FloatArray, ahead: FloatArray, own: int, runs: int) -> FloatArray:
    """Put columns of a record and of a further run above each other; 3 shared ones come first, then the runs' own."""
    old, new = 3 + own * runs, 3 + own
    top = np.concatenate([recorded, np.zeros((recorded.shape[0], own))], axis=1)
    bottom = np.concatenate(
        [ahead[:, :3], np.zeros((ahead.shape[0], own * runs)), ahead[:, new:], ahead[:, 3:new]], axis=1
    )
    assert recorded.shape[1] - old == ahead.shape[1] - new
    return np.concatenate([top, bottom], axis=0)


def continued(fit: Fit, states: States, clock: Fit | None) -> Fit:
    """Return the fit as the model of one further run: same coefficients, no offset, in thermal equilibrium at first."""
    problem = fit.problem
    rows = states.time.size // problem.group
    basis = NoiseBasis.of([average(states.time, problem.group)], problem.kernel)
    thermometer = None
    if clock is not None and not problem.lagged:
        warm = continued(clock, states, None)
        fine = states.with_lag(clock.problem.tau)
        states = replace(fine, resonator=fine.resonator + thermal_correction(warm)[0])
        x = average(states.excess, problem.group)
        bent = problem.response == "bias_deg_per_h"
        thermometer = (x + clock.problem.bend * x**2 if bent else x,)
    delayed = problem.delay_row is not None
    own, runs = own_count(problem), len(problem.states)
    old = fit.linear.coefficients
    coefficients = np.concatenate([old[:3], np.zeros(own), old[3 + own * runs :]])
    ahead = replace(
        problem,
        states=(states,),
        present=(np.ones(rows, dtype=bool),),
        values=np.zeros(rows + delayed),
        basis=basis.with_row() if delayed else basis,
        thermometer=thermometer,
        correction=None,
    )
    linear = replace(fit.linear, coefficients=coefficients)
    out = Fit(ahead, fit.terms, linear, ahead.model(ahead.tau, fit.terms))
    if problem.correction is None:
        return out
    seen = replace(ahead, correction=thermal_correction(out))
    return Fit(seen, fit.terms, linear, seen.model(seen.tau, fit.terms))


def loss(truth: tuple[FloatArray, FloatArray], rival: tuple[FloatArray, FloatArray], columns: FloatArray) -> float:
    """Return D: what is left of the difference of two means after the rival is refitted."""
    difference = np.concatenate([truth[0] - rival[0], truth[1] - rival[1]])
    span = orthonormal(unit(columns))
    left = difference - span @ (span.T @ difference)
    return float(left @ left)


def clock_of(response: str, selections: Mapping[str, Selection]) -> Fit | None:
    """Return the fit of the frequency where it is the thermometer of a response."""
    if response == "frequency_Hz" or "frequency_Hz" not in selections:
        return None
    return selections["frequency_Hz"].fit


def between_rivals(
    campaign: Campaign, selection: Selection, found: Found, names: Sequence[str], selections: Mapping[str, Selection]
) -> list[Scored]:
    """Score every candidate run by the evidence that would separate the worst pair of the named rivals.

    Parameters
    ----------
    campaign : Campaign
    selection, found
        The response and the place in its fit for which the rivals compete.
    names : sequence of str
        Of the rivals.
    selections : mapping from response to Selection

    Returns
    -------
    scored : list of Scored
        Best first; empty when fewer than two of the names are fitted.
    """
    rivals = [rival for rival in found.rivals if rival.name in names][:MOST_RIVALS]
    if len(rivals) < 2:
        return []
    clock = clock_of(selection.fit.problem.response, selections)
    members = [Member(rival.name, rival.fit, clock, selection.fit) for rival in rivals]
    stepped = {need for rival in rivals for term in rival.fit.terms for need in term.effect.needs}
    out = []
    for programme in candidates(campaign, sorted(stepped)):
        ahead = [member.follow(programme.states) for member in members]
        worst: tuple[float, tuple[str, str]] = (np.inf, ("", ""))
        for b, rival in enumerate(members):
            columns = rival.joined(ahead[b][1])
            for a, truth in enumerate(members):
                if a != b:
                    parts = (truth.recorded[0], ahead[a][0]), (rival.recorded[0], ahead[b][0])
                    worst = min(worst, (loss(*parts, columns), (truth.name, rival.name)))
        out.append(Scored(programme, *worst))
    return sorted(out, key=lambda scored: -scored.evidence)


@dataclass(frozen=True)
class _Signature:
    """One effect of unit size in one response, on the record and beyond."""

    effect: Effect
    term: Term
    member: Member
    recorded: FloatArray
    energy: float
    weight: float


def to_detect(campaign: Campaign, selections: Mapping[str, Selection]) -> list[Scored]:
    """Score every candidate run by how much it would raise the energy of what may be hidden.

    An effect counts by its present weight exp(evidence / (2 temper)); the score is the weighted mean of the logarithm of
    the energy of its signature, beyond what the baseline absorbs, with the run over that without it. Its `evidence` is
    what an effect would stand at that stands at 10 today.
    """
    signatures = [s for selection in selections.values() for s in _signatures(campaign, selection, selections)]
    if not signatures:
        return []
    stepped = {need for signature in signatures for need in signature.effect.needs}
    programmes = candidates(campaign, sorted(stepped))
    members = {id(s.member): s.member for s in signatures}
    energy = np.zeros((len(signatures), len(programmes)))
    for c, programme in enumerate(programmes):
        spans = {}
        for key, member in members.items():
            columns = member.joined(member.follow(programme.states)[1])
            spans[key] = orthonormal(unit(columns))
        for k, s in enumerate(signatures):
            column = np.concatenate([s.recorded, _ahead(s, programme.states)])
            span = spans[id(s.member)]
            left = column - span @ (span.T @ column)
            energy[k, c] = left @ left
    before, least = np.array([s.energy for s in signatures]), FRESH * energy.max(axis=1) + 1e-300
    weight = np.array([s.weight for s in signatures])
    score = weight @ np.log((energy + least[:, None]) / (before + least)[:, None]) / weight.sum()
    leading = signatures[int(np.argmax(weight))].effect.name
    out = [
        Scored(programme, UNIT * float(np.exp(value)), (leading, NOTHING))
        for programme, value in zip(programmes, score, strict=True)
    ]
    return sorted(out, key=lambda scored: -scored.evidence)


def _ahead(signature: _Signature, states: States) -> FloatArray:
    member = signature.member
    fit = continued(member.fit, states, member.clock)
    problem = replace(fit.problem, delay_row=None)
    column = problem.term(signature.term, problem.views(problem.tau))[:, 0]
    basis = NoiseBasis.of([average(states.time, problem.group)], problem.kernel)
    return np.asarray(basis.rotate(column) * np.sqrt(basis.weights(member.share)) / member.deviation)


def _signatures(campaign: Campaign, selection: Selection, selections: Mapping[str, Selection]) -> list[_Signature]:
    """Return the most telling shape of every effect that the response could show."""
    fit = selection.fit
    problem = fit.problem
    member = Member(NOTHING, fit, clock_of(problem.response, selections), fit)
    mean, columns = member.recorded
    span = orthonormal(unit(columns))
    root = np.sqrt(problem.basis.weights(member.share)) / member.deviation
    rest = problem.rotated * root - mean
    rest = rest - span @ (span.T @ rest)
    views = problem.views(problem.tau)
    ranges = span_of(campaign, problem.tau if problem.lagged else 1000.0)
    out = []
    for effect in library().values():
        if effect.name in EVENTS or problem.response not in effect.responses:
            continue
        if effect.acts_on == "temperature" and problem.response != "frequency_Hz":
            continue
        if any(getattr(s, need) is None for s in problem.states for need in effect.needs):
            continue
        grid = list(effect.grid(ranges, problem.response))
        best: _Signature | None = None
        gain_of_best = -np.inf
        for shape in grid[:: max(1, len(grid) // SHAPES)]:
            term = Term(effect, tuple(shape), 1)
            column = problem.basis.rotate(problem.term(term, views)[:, 0]) * root
            left = column - span @ (span.T @ column)
            energy = float(left @ left)
            gain = float(left @ rest) ** 2 / energy if energy > 1e-8 * float(column @ column) else 0.0
            net = gain - shipped_levels([effect.name])[effect.name]
            if gain > gain_of_best:
                weight = float(np.exp(np.clip(net, -20.0, 60.0) / (2.0 * TEMPER)))
                best, gain_of_best = _Signature(effect, term, member, column, energy, weight), gain
        if best is not None:
            out.append(best)
    return out
