"""The run that would tell most: the evidence between rivals, detection energy where nothing is named, per chamber hour.

Rivals a and b, fitted to the campaign, predict a further run. If a were true, b would be in error by Δ = y_a − y_b, of which it
may take back what its own uncertain values allow: the evidence against b is

    D(a, b) = Δᵀ (N + J_b Σ_b J_bᵀ)⁻¹ Δ

with the noise N, b's columns J_b and the posterior covariance Σ_b of its values, those of the new run's own start and offset
at their priors. A run is as good as the worst of its pairs, either way round. Where nothing is named yet, b is the
baseline and a any effect of the library at the size at which it would just be noticed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from shell.constants import zero_Celsius
from studies.diagnosis.baseline import Baseline, Followed, Reading
from studies.diagnosis.campaign import Campaign
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.model import Fit
from studies.diagnosis.noise import KERNELS, SHARES
from studies.diagnosis.planning.programme import Programme, candidates
from studies.diagnosis.scan import applicable, scan
from studies.diagnosis.search import Place
from studies.diagnosis.terms import Term, term_columns, used
from studies.effects import library
from studies.effects.states import FloatArray, States, average
from studies.planning.chamber import Chamber
from studies.planning.programme import NextRun

NOTHING = "nothing"
MOST_RIVALS = 3
SMALLEST = 6.0
"""Evidence below which no run of the family is worth the chamber's time to separate two rivals."""
ENOUGH = 20.0
"""Evidence from which on a shorter run is as good as a longer one."""
UNIT = 10.0
"""Evidence, today, of the hidden effect for which a detecting run is judged."""
OFFSET = 1e3
"""Standard deviation of a new run's own offset, in white noise of a row of the grid."""
FRESH = 1.0 / 30.0
"""This part of a signature's energy with the best run is added to every energy: what cannot show today would otherwise
outweigh everything."""


@dataclass(frozen=True)
class Scored:
    """A candidate run with the evidence that it would bring."""

    programme: Programme
    evidence: float
    pair: tuple[str, str]

    @property
    def worth(self) -> tuple[bool, float]:
        """Runs that tell enough come first, the shortest of them before the others; else the most telling."""
        enough = self.evidence >= ENOUGH
        return enough, self.evidence / self.programme.hours if enough else self.evidence


def as_next_run(scored: Scored, repeat: float | None, expected: bool = True) -> NextRun:
    """Return a candidate as the suggestion."""
    programme = scored.programme
    return NextRun(
        programme.profile,
        programme.drives,
        programme.hours,
        programme.states.time / 3600.0,
        programme.chamber - zero_Celsius,
        scored.evidence if expected else None,
        repeat,
        scored.pair if expected else None,
    )


@dataclass(frozen=True)
class Ahead:
    """A fitted model on the rows of a further run: its mean, its columns with the covariance of their values, the states."""

    mean: FloatArray
    columns: FloatArray
    covariance: FloatArray
    continued: Fit


def follow(model: Fit, states: States, clock: Fit | None) -> Ahead:
    """Continue a fitted model into one further run: no offset, in thermal equilibrium at first.

    Parameters
    ----------
    model : Fit
    states : States
        What the run goes through, on the fine grid.
    clock : Fit or None
        The fit of the frequency, where that is the thermometer of the model's response.
    """
    baseline = _alone(model, states, clock)
    rows = states.time.size // model.problem.group
    problem = replace(model.problem, present=(np.ones(rows, dtype=bool),))
    alone = replace(model, problem=problem, baseline=baseline, tangent=baseline.tangent())
    for _ in range(2 if baseline.lagged else 0):
        warmer = alone.warmer()
        if warmer is None:
            break
        baseline = replace(baseline, warmer=tuple(warmer))  # type: ignore[type-var]
        alone = replace(alone, baseline=baseline, tangent=baseline.tangent())
    tangent = alone.tangent
    old = list(model.tangent.names)
    kept, own = [], []
    for k, name in enumerate(tangent.names):
        if name.endswith("@0"):
            own.append(k)
        else:
            kept.append((k, old.index(name)))
    parts = [tangent.columns[0][:rows]]
    parts += [
        term_columns(term, tangent.views[0], problem.group, problem.response.column)[:rows, used(term.effect)]
        for term in model.terms
    ]
    table = np.concatenate(parts, axis=1)
    base, before = len(tangent.names), len(old)
    places = [*(k for k, _ in kept), *range(base, table.shape[1])]
    source = [*(k for _, k in kept), *range(before, before + table.shape[1] - base)]
    values = model.solved.coefficients[source]
    covariance = np.zeros((len(places) + len(own),) * 2)
    covariance[: len(places), : len(places)] = model.solved.covariance[np.ix_(source, source)]
    for n, k in enumerate(own):
        sd = tangent.prior[k] if np.isfinite(tangent.prior[k]) else OFFSET * model.problem.sigma
        covariance[len(places) + n, len(places) + n] = sd**2
    mean = table[:, places] @ values - tangent.shift[0][:rows]
    return Ahead(mean, table[:, [*places, *own]], covariance, alone)


def _alone(model: Fit, states: States, clock: Fit | None) -> Baseline:
    own = model.baseline
    if not isinstance(own, Followed) or clock is None:
        return own.alone(states)
    view = follow(clock, states, None).continued.tangent.views[0]
    whole = view.seen_fine.excess
    change = cast("Reading", clock.baseline).change
    reading = average(whole, own.group)
    instead = change(reading)
    if own.response.bent:
        reading, instead, whole = instead, reading, change(whole)
    return replace(own.alone(view.seen_fine), reading=(reading,), whole=(whole,), instead=(instead,))


def covariance_of_noise(model: Fit, rows: int, step: float) -> FloatArray:
    """Return the covariance of the noise of one further run."""
    s = model.solved
    time = np.asarray(np.arange(rows) * step, dtype=float)
    wander = [*KERNELS.values()][s.kind](time, step)
    return np.asarray(s.variance * (np.eye(rows) + SHARES[s.share] * wander))


def against(truth: Ahead, rival: Ahead, noise: FloatArray) -> float:
    """Return D: the evidence that the run would bring against a rival if the other were true."""
    difference = truth.mean - rival.mean
    spread = noise + rival.columns @ rival.covariance @ rival.columns.T
    return float(difference @ np.linalg.solve(spread, difference))


def between_rivals(
    campaign: Campaign,
    place: Place,
    names: Sequence[str],
    clock: Fit | None,
    chamber: Chamber | None = None,
) -> list[Scored]:
    """Score every candidate run by the evidence that would separate the worst pair of the named rivals, best first."""
    rivals = [(n, r.fit) for n, r in zip(place.names, place.rivals, strict=True) if n in names][:MOST_RIVALS]
    if len(rivals) < 2:
        return []
    stepped = {need for _, model in rivals for term in model.terms for need in term.effect.needs}
    out = []
    for programme in candidates(campaign, sorted(stepped), chamber):
        ahead = [(name, follow(model, programme.states, clock)) for name, model in rivals]
        noise = covariance_of_noise(rivals[0][1], ahead[0][1].mean.size, campaign.step)
        worst = min(
            (against(a, b, noise), (first, second)) for first, a in ahead for second, b in ahead if first != second
        )
        out.append(Scored(programme, *worst))
    return sorted(out, key=lambda scored: scored.worth, reverse=True)


def to_detect(campaign: Campaign, models: Mapping[str, Fit], chamber: Chamber | None = None) -> list[Scored]:
    """Score every candidate run by how much it would raise the energy of what may be hidden, best first.

    An effect counts by how likely it is today; the score is the weighted mean of the logarithm of the energy of its
    signature, beyond what the baseline absorbs, with the run over that without it. Its `evidence` is what an effect would
    stand at that stands at 10 today.
    """
    from studies.diagnosis.scan import build_bank

    clock = next((m for m in models.values() if m.problem.response.thermometer), None)
    signatures: list[tuple[str, Term, Fit, float, float]] = []
    for column, model in models.items():
        effects = [e for e in applicable(model.problem, model) if not (e.event or e.by_clock)]
        effects = [e for e in effects if e.needs != ("quadrature",)]
        for seen in scan(model, build_bank(model, effects), 1):
            weight = float(np.exp(np.clip(seen.gain, -10.0, 30.0) / CONSTANTS["temper"]))
            signatures.append((column, seen.term, model, weight, _energy(model, seen.term)))
    stepped = {need for effect in library().values() for need in effect.needs}
    programmes = candidates(campaign, sorted(stepped), chamber)
    if not signatures:
        return []
    energy = np.zeros((len(signatures), len(programmes)))
    for c, programme in enumerate(programmes):
        known: dict[str, tuple[Ahead, FloatArray]] = {}
        for column, model in models.items():
            ahead = follow(model, programme.states, None if model.problem.response.thermometer else clock)
            noise = covariance_of_noise(model, ahead.mean.size, campaign.step)
            spread = noise + ahead.columns @ ahead.covariance @ ahead.columns.T
            known[column] = ahead, np.asarray(np.linalg.inv(spread))
        for k, (column, term, model, _, before) in enumerate(signatures):
            ahead, inverse = known[column]
            signature = term_columns(term, ahead.continued.tangent.views[0], model.problem.group, column)
            own = signature[: ahead.mean.size, int(np.argmax(term.effect.spread))]
            energy[k, c] = before + max(float(own @ inverse @ own), 0.0)
    today = np.array([s[4] for s in signatures])
    weights = np.array([s[3] for s in signatures])
    least = FRESH * energy.max(axis=1) + 1e-300
    score = weights @ np.log((energy + least[:, None]) / (today + least)[:, None]) / weights.sum()
    leading = signatures[int(np.argmax(weights))][1].name
    out = [Scored(p, UNIT * float(np.exp(v)), (leading, NOTHING)) for p, v in zip(programmes, score, strict=True)]
    return sorted(out, key=lambda scored: -scored.evidence / np.sqrt(scored.programme.hours))


def _energy(model: Fit, term: Term) -> float:
    """Energy of a signature in the record, beyond what the model absorbs, over the noise."""
    column = model.problem.response.column
    own = model.problem.stack(
        [
            term_columns(term, view, model.problem.group, column)[:, int(np.argmax(term.effect.spread))]
            for view in model.tangent.views
        ]
    )
    basis, root = model.problem.noise.bases[model.solved.kind], np.sqrt(model.weights)
    span = np.linalg.qr(basis.rotate(model.linear.columns) * root[:, None])[0]
    turned = basis.rotate(own) * root
    left = turned - span @ (span.T @ turned)
    return float(left @ left)
