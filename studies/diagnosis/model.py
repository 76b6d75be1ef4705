"""One response of a campaign, and its model: a baseline with named effects, fitted by evidence."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from compensation.wander import white_noise
from studies.diagnosis.baseline import Baseline, Tangent, View
from studies.diagnosis.campaign import Campaign
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.evidence import Linear, Solved, solve
from studies.diagnosis.noise import SHARES, NoiseModels
from studies.diagnosis.response import RESPONSES, Response
from studies.effects import Effect, Span
from studies.effects.states import FloatArray, States, average, lag


@dataclass(frozen=True)
class Term:
    """An effect with its shape fixed.

    `about` are the coefficients about which it is known to be inexact, none before it has been fitted; a form that is not
    `named` has none. Of an `exact` one nothing but what it had at the start of a run is unknown.
    """

    effect: Effect
    shape: tuple[float, ...]
    about: tuple[float, ...] = ()
    named: bool = True
    exact: bool = False

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name


@dataclass(frozen=True)
class Problem:
    """The rows of one response on the coarse grid.

    Attributes
    ----------
    response : Response
    present : tuple of bool arrays
        Which steps of the grid have the response, run by run.
    values : (M,) array
        The present values, stacked.
    noise : NoiseModels
    sigma : float
        White noise of a step of the grid, from second differences: no slow effect reaches it.
    level : float
        Level of the response, in parts of which sizes count; 1 where they count in its unit.
    group : int
        Fine samples to a step.
    span : Span
    """

    response: Response
    present: tuple["np.ndarray", ...]
    values: FloatArray
    noise: NoiseModels
    sigma: float
    level: float
    group: int
    span: Span

    def stack(self, parts: Sequence[FloatArray]) -> FloatArray:
        """Stack the present rows of arrays given run by run."""
        return np.concatenate([part[mask] for part, mask in zip(parts, self.present, strict=True)])

    def size(self, effect: Effect) -> float:
        """Strong cases of an effect in this response, in the unit of its first coefficient."""
        own = effect.sizes[self.response.column]
        return own * self.level if self.response.relative and not effect.thermal else own

    @property
    def run(self) -> "np.ndarray":
        """Number of the run of every stacked row."""
        return np.repeat(np.arange(len(self.present)), [int(mask.sum()) for mask in self.present])

    def split(self, rows: FloatArray) -> list[FloatArray]:
        """Return stacked rows run by run, the present ones only."""
        return np.split(rows, np.cumsum([int(mask.sum()) for mask in self.present])[:-1])

    def unstack(self, rows: FloatArray) -> list[FloatArray]:
        """Return stacked rows run by run; missing ones are NaN."""
        out = []
        for mask, part in zip(self.present, self.split(rows), strict=True):
            own = np.full(mask.shape, np.nan)
            own[mask] = part
            out.append(own)
        return out


def pose(campaign: Campaign, column: str, tau: float, keep: Sequence["np.ndarray"] | None = None) -> Problem:
    """Set up the rows of one response; `keep` restricts them."""
    response = RESPONSES[column]
    present = [np.isfinite(run.responses[column]) for run in campaign.runs]
    if keep is not None:
        present = [mask & own for mask, own in zip(present, keep, strict=True)]
    values = np.concatenate([run.responses[column][m] for run, m in zip(campaign.runs, present, strict=True)])
    times = [run.time[m] for run, m in zip(campaign.runs, present, strict=True) if m.any()]
    rows = sum(int(np.isfinite(run.row_responses[column]).sum()) for run in campaign.runs)
    steps = sum(int(np.isfinite(run.responses[column]).sum()) for run in campaign.runs)
    level = abs(float(np.median(values))) if response.relative else 1.0
    return Problem(
        response,
        tuple(present),
        values,
        NoiseModels.of(times, max(rows / max(steps, 1), 1.0), campaign.step),
        white_level(campaign, column),
        level,
        campaign.group,
        span_of(campaign, tau),
    )


def white_level(campaign: Campaign, column: str) -> float:
    """Return the white noise of a step of the grid, from second differences."""
    parts = [run.responses[column] for run in campaign.runs]
    if (level := white_noise(*parts)) > 0.0:
        return level
    values = np.concatenate(parts)
    return max(1e-9 * float(np.nanmax(np.abs(values))), 1e-300)


def span_of(campaign: Campaign, tau: float) -> Span:
    """Return what a campaign covers."""
    housing = np.concatenate([run.states.housing for run in campaign.runs])
    starts = [run.states.campaign_time for run in campaign.runs]
    angles = [run.states.pattern_angle for run in campaign.runs]
    known = [angle for angle in angles if angle is not None]
    turns = bool(known) and len(known) == len(angles) and float(np.ptp(np.concatenate(known))) > 1e-3
    return Span(
        float(np.percentile(housing, 0.5)),
        float(np.percentile(housing, 99.5)),
        max(float(np.ptp(run.states.time)) for run in campaign.runs),
        max(float(t[-1]) for t in starts) - min(float(t[0]) for t in starts),
        campaign.step,
        tau,
        len(campaign.runs),
        tuple(run.time for run in campaign.runs),
        turns,
        campaign.timed,
    )


def term_columns(term: Term, view: View, group: int, column: str) -> FloatArray:
    """Return the columns of an effect for one run on the coarse grid, in units of the response."""
    effect = term.effect
    if effect.thermal:
        states = view.seen_fine if effect.sees_heat else view.fine
        return average(effect.columns(states, term.shape, column), group) * view.steep[:, None]
    if effect.fine:
        return average(effect.columns(view.seen_fine, term.shape, column), group)
    return effect.columns(view.seen, term.shape, column)


def inexact_columns(term: Term, view: View, problem: Problem, group: int) -> FloatArray:
    """Return what a form may miss of an effect for one run: no form is exact.

    The world's loop is not a play, its leak not linear, its peak not the textbook's: e(t), what the effect was found to do,
    may change slowly with temperature and time, e · P₁(x), e · P₂(x), e · P₃(x), e · u, and come late, lag(e) − e, each by a
    small part of it. x is the temperature over the covered range, u the time over the run. The discrepancy of Kennedy and
    O'Hagan, J. R. Statist. Soc. B 63 (2001) 425, one for every hypothesis, so that it needs no second name.
    """
    span = problem.span
    seen = view.seen if group > 1 else view.seen_fine
    starts = _starts(term, view, span, seen)
    if term.exact:
        return starts
    curve = term_columns(term, view, group, problem.response.column)[:, used(term.effect)] @ np.array(term.about)
    x = np.clip(2.0 * (seen.resonator - span.temperature_low) / max(span.temperature_range, 1e-9) - 1.0, -1.2, 1.2)
    u = 2.0 * (seen.time - seen.time[0]) / max(span.longest_run, 1e-9) - 1.0
    late = lag(curve, seen.step, max(LATE * span.tau, seen.step)) - curve
    factors = np.stack([x, 1.5 * x**2 - 0.5, 2.5 * x**3 - 1.5 * x, u], axis=1)
    return np.concatenate([curve[:, None] * factors, late[:, None] / LATE, starts], axis=1)


def remembers(term: Term, span: Span) -> float:
    """Return the time constant, s, with which an effect forgets what came before a run; 0 where it does so sooner than the resonator."""
    effect = term.effect
    times = [value for value, own in zip(term.shape, effect.shape, strict=True) if own.name == effect.memory]
    return times[0] if times and times[0] > span.tau else 0.0


def _starts(term: Term, view: View, span: Span, seen: States) -> FloatArray:
    """Return the columns of what an effect with memory had at the start of each run: as much as the covered range would give it."""
    if not (tau := remembers(term, span)):
        return np.zeros((seen.time.size, 0))
    steep = view.steep if term.effect.thermal else 1.0
    out = np.zeros((seen.time.size, span.runs))
    out[:, seen.run] = term.about[0] * steep * span.temperature_range * np.exp(-(seen.time - seen.time[0]) / tau)
    return out


FORMS = 5
"""Columns of what a form may miss, before those of its starts."""
IN_ONE_RUN = 0.99
"""Part of the power of what an effect does beyond the baseline from which on it does it in one run."""
LATE = 0.1
"""Delay of what a form may miss, in parts of the thermal lag."""


@dataclass(frozen=True)
class Fit:
    """A model at its most likely noise, sizes and coefficients."""

    problem: Problem
    baseline: Baseline
    terms: tuple[Term, ...]
    tangent: Tangent
    linear: Linear
    solved: Solved

    @property
    def log_evidence(self) -> float:
        """Log evidence of the model."""
        return self.solved.log_evidence

    def values(self) -> dict[str, float]:
        """Values of the baseline by name."""
        return dict(zip(self.tangent.names, self.solved.coefficients.tolist(), strict=False))

    def columns_of(self, index: int) -> "np.ndarray":
        """Return the places of a term's columns."""
        return np.flatnonzero(self.linear.owner == index)

    def starts_of(self, run: int) -> list[int]:
        """Return the places of the columns of what effects with memory had at the start of a run."""
        place, out = self.tangent.prior.size + sum(used(term.effect).size for term in self.terms), []
        for term in (term for term in self.terms if term.about):
            place += 0 if term.exact else FORMS
            if remembers(term, self.problem.span):
                out.append(place + run)
                place += self.problem.span.runs
        return out

    def coefficients_of(self, index: int) -> FloatArray:
        """Return one value for each column of a term, zero for those that have no prior."""
        out = np.zeros(self.terms[index].effect.spread.size)
        out[used(self.terms[index].effect)] = self.solved.coefficients[self.columns_of(index)]
        return out

    def alone(self, index: int) -> bool:
        """Whether the runs but one know next to nothing of a term: an event, or what it does there the baseline does as well."""
        if self.terms[index].effect.event:
            return True
        places, run = self.columns_of(index), self.problem.run
        curve = self.linear.columns[:, places] @ self.solved.coefficients[places]
        free = self.linear.columns[:, : self.tangent.prior.size]

        def beyond(rows: "np.ndarray") -> float:
            columns = free[rows] / np.maximum(np.linalg.norm(free, axis=0), 1e-300)
            return float(np.sum((curve[rows] - columns @ np.linalg.lstsq(columns, curve[rows])[0]) ** 2))

        least = (1.0 - IN_ONE_RUN) * beyond(np.ones(run.size, dtype=bool))
        return any(beyond(run != k) <= least for k in np.unique(run))

    def known(self, index: int) -> Term:
        """Return a term with what was found of it, about which it may be inexact."""
        term = self.terms[index]
        if not term.named:
            return term
        return replace(term, about=tuple(self.solved.coefficients[self.columns_of(index)].tolist()))

    @property
    def consistent(self) -> bool:
        """Whether every effect still does at least half of what its inexactness was counted about."""
        for index, term in enumerate(self.terms):
            if term.about:
                places = self.columns_of(index)
                before = self.linear.columns[:, places] @ np.array(term.about)
                now = self.linear.columns[:, places] @ self.solved.coefficients[places]
                if float(before @ now) < 0.5 * float(before @ before):
                    return False
        return True

    @cached_property
    def residual(self) -> FloatArray:
        """What the model leaves of the stacked rows."""
        return self.linear.target - self.linear.columns @ self.solved.coefficients

    @cached_property
    def weights(self) -> FloatArray:
        """Inverse variances of the rotated rows."""
        s = self.solved
        return np.asarray(self.problem.noise.weights(s.kind)[s.share] / s.variance)

    @cached_property
    def whitened(self) -> FloatArray:
        """What the model leaves, in independent rows of unit variance."""
        return self.problem.noise.bases[self.solved.kind].rotate(self.residual) * np.sqrt(self.weights)

    @property
    def wander(self) -> float:
        """Rms of the wander within a run."""
        s = self.solved
        return float(np.sqrt(s.variance * SHARES[s.share] * self.problem.noise.bases[s.kind].within))

    @property
    def wander_ratio(self) -> float:
        """Rms of the wander within a run over the noise of one row of the record within minutes."""
        return float(self.problem.noise.ratio(self.solved.kind)[self.solved.share])

    @property
    def believed(self) -> bool:
        """Whether the wander is believed to be noise."""
        return self.problem.noise.believed(self.solved.kind, self.solved.share)

    def slow_part(self) -> list[FloatArray]:
        """Return the slow part of what is left, run by run, as the noise model tells it from the white."""
        basis = self.problem.noise.bases[self.solved.kind]
        slow = SHARES[self.solved.share] * basis.eigenvalues
        rows = basis.unrotate(basis.rotate(self.residual) * slow / (1.0 + slow))
        return self.problem.unstack(rows)

    def beside_temperature(self) -> list[list[FloatArray]]:
        """Return what every effect on the response itself adds to it, effect by effect and run by run."""
        out = []
        for k, term in enumerate(self.terms):
            if not term.effect.thermal:
                column, places = self.problem.response.column, used(term.effect)
                out.append(
                    [
                        term_columns(term, view, self.problem.group, column)[:, places]
                        @ self.solved.coefficients[self.columns_of(k)]
                        for view in self.tangent.views
                    ]
                )
        return out

    def inexact_temperature(self) -> list[FloatArray]:
        """Return what the forms of effects on the temperature may miss, one deviation in units of the response, run by run."""
        problem = self.problem
        thermal = [term for term in self.terms if term.effect.thermal and term.about]
        return [
            np.concatenate(
                [
                    np.zeros((view.seen.time.size, 0)),
                    *(CONSTANTS["inexact"] * inexact_columns(term, view, problem, problem.group) for term in thermal),
                ],
                axis=1,
            )
            for view in self.tangent.views
        ]

    def warmer(self) -> list[FloatArray] | None:
        """Return what the effects on the temperature add to it, K on the fine grid, run by run."""
        thermal = [k for k, term in enumerate(self.terms) if term.effect.thermal]
        if not thermal:
            return None
        out = []
        for view in self.tangent.views:
            own = np.zeros(view.fine.time.size)
            for k in thermal:
                states = view.seen_fine if self.terms[k].effect.sees_heat else view.fine
                columns = self.terms[k].effect.columns(states, self.terms[k].shape, self.problem.response.column)
                own += columns @ self.coefficients_of(k)
            out.append(own)
        return out

    def moved(self) -> Baseline:
        """Return the baseline at the values of this fit."""
        return self.baseline.moved(self.values(), self.warmer())


def used(effect: Effect) -> "np.ndarray":
    """Return which columns of an effect a diagnosis fits: those that have a prior."""
    return np.flatnonzero(effect.spread > 0)


def linearise(problem: Problem, tangent: Tangent, terms: Sequence[Term]) -> Linear:
    """Return baseline and effects side by side as a linear model of the stacked rows."""
    columns = [problem.stack(tangent.columns)]
    prior = [tangent.prior]
    owner = [np.full(tangent.prior.size, -1)]
    for index, term in enumerate(terms):
        places = used(term.effect)
        own = [term_columns(term, view, problem.group, problem.response.column)[:, places] for view in tangent.views]
        columns.append(problem.stack(own))
        prior.append(problem.size(term.effect) * term.effect.spread[places])
        owner.append(np.full(places.size, index))
    for term in terms:
        if term.about:
            own = [inexact_columns(term, view, problem, problem.group) for view in tangent.views]
            columns.append(problem.stack(own))
            prior.append(np.full(own[0].shape[1], CONSTANTS["inexact"]))
            owner.append(np.full(own[0].shape[1], -1))
    return Linear(
        problem.values + problem.stack(tangent.shift),
        np.concatenate(columns, axis=1),
        np.concatenate(prior),
        np.concatenate(owner),
        problem.noise,
        problem.sigma,
    )


def fit(
    problem: Problem,
    baseline: Baseline,
    terms: Sequence[Term] = (),
    rounds: int = 1,
    scales: FloatArray | None = None,
    kinds: Sequence[int] | None = None,
    release: bool = True,
    sized: bool = False,
) -> Fit:
    """Fit a model; every further round moves the baseline to where the last one ended, as long as that pays.

    Parameters
    ----------
    problem : Problem
    baseline : Baseline
        Where it is linearised at first.
    terms : sequence of Term
    rounds : int
    scales : array, optional
        Sizes of the terms to start from.
    kinds : sequence of int, optional
        Kinds of wander to look at.
    release : bool
        Let go what the baseline holds.
    sized : bool
        The sizes of the terms are known: `scales`.
    """
    best: Fit | None = None
    if rounds > 1 and release:
        baseline = baseline.released()
    for left in reversed(range(rounds)):
        now = _once(problem, baseline, terms, scales, kinds, sized)
        if rounds > 1 and (held := baseline.held(now.values())) is not None:
            baseline, best = held, None
            now = _once(problem, baseline, terms, now.solved.scales, kinds, sized)
        if not now.consistent:
            if best is not None:
                break
            terms = [replace(term, about=()) for term in terms]
            now = _once(problem, baseline, terms, now.solved.scales, kinds, sized)
        settled = best is not None and abs(now.log_evidence - best.log_evidence) < 0.3
        if best is None or now.log_evidence > best.log_evidence:
            best = now
        if settled or not left:
            break
        baseline, scales = now.moved(), now.solved.scales
        terms = [now.known(index) for index in range(len(terms))]
    assert best is not None
    return best


def _once(
    problem: Problem,
    baseline: Baseline,
    terms: Sequence[Term],
    scales: FloatArray | None,
    kinds: Sequence[int] | None,
    sized: bool,
) -> Fit:
    tangent = baseline.tangent()
    linear = replace(linearise(problem, tangent, terms), absolute=not baseline.from_card)
    return Fit(
        problem, baseline, tuple(terms), tangent, linear, solve(linear, 0 if sized else len(terms), scales, kinds)
    )


def exact_forms(model: Fit) -> Fit:
    """Return a model with its forms taken at their word: for numbers that belong to the forms themselves."""
    if not any(term.about for term in model.terms):
        return model
    terms = [replace(term, named=False, exact=True) for term in model.terms]
    return fit(model.problem, model.baseline, terms, 1, model.solved.scales)


def settle(problem: Problem, baseline: Baseline, taus: FloatArray | None = None) -> Fit:
    """Fit a baseline alone, from the best of several lags where it has one."""
    from studies.diagnosis.baseline import Lagged

    if not isinstance(baseline, Lagged):
        return fit(problem, baseline, (), 12 if baseline.lagged else 3)
    starts = np.geomspace(60.0, 2e4, 7) if taus is None else taus
    tried = [fit(problem, replace(baseline, tau=float(tau)), (), 1) for tau in starts]
    best = sorted(tried, key=lambda f: -f.log_evidence)[:2]
    return max((fit(problem, f.moved(), (), 6) for f in best), key=lambda f: f.log_evidence)
