"""The model of one response: a baseline with named effects, fitted by evidence."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from studies.diagnosis.baseline import Baseline, Tangent
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.evidence import START, Linear, Solved, solve
from studies.diagnosis.noise import SHARES
from studies.diagnosis.problem import Problem
from studies.diagnosis.terms import Term, inexact_columns, remembers, term_columns, used
from studies.effects.states import FloatArray

NEARER = (0.5, 0.25, 0.12, 0.06)
"""Distances, e-folds, at which a better point of a baseline is looked for about one that was found far away."""
IN_ONE_RUN = 0.99
"""Part of the power of what an effect does beyond the baseline from which on it does it in one run."""


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

    def deviation_of(self, name: str) -> float:
        """Return the standard deviation of a value of the baseline."""
        place = self.tangent.names.index(name)
        return float(np.sqrt(max(self.solved.covariance[place, place], 0.0)))

    def columns_of(self, index: int) -> "np.ndarray":
        """Return the places of a term's columns."""
        return np.flatnonzero(self.linear.owner == index)

    def starts_of(self, run: int) -> list[int]:
        """Return the places of the columns of what effects with memory had at the start of a run."""
        return np.flatnonzero(self.linear.owner == START - run).tolist()

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
            if remembers(term, problem.span):  # the last ones, one a run
                owner[-1][-problem.span.runs :] = START - np.arange(problem.span.runs)
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
    linear = linearise(problem, tangent, terms)
    return Fit(
        problem, baseline, tuple(terms), tangent, linear, solve(linear, 0 if sized else len(terms), scales, kinds)
    )


def exact_forms(model: Fit) -> Fit:
    """Return a model with its forms taken at their word: for numbers that belong to the forms themselves."""
    if not any(term.about for term in model.terms):
        return model
    terms = [replace(term, named=False, exact=True) for term in model.terms]
    return fit(model.problem, model.baseline, terms, 1, model.solved.scales)


def from_elsewhere(model: Fit, rounds: int = 2) -> Fit:
    """Return the fit of the same model from another point of its baseline, where one is better than where it is."""

    def best(now: Fit, starts: Sequence[Baseline]) -> Fit:
        tried = [fit(now.problem, start, now.terms, 1, now.solved.scales, [now.solved.kind]) for start in starts]
        return max([now, *tried], key=lambda f: f.log_evidence)

    found = best(model, model.baseline.elsewhere())
    if found is model:
        return model
    for near in NEARER:
        found = best(found, found.baseline.elsewhere(near))
    again = fit(model.problem, found.baseline, found.terms, rounds, found.solved.scales)
    return max(model, again, key=lambda f: f.log_evidence)


def settle(problem: Problem, baseline: Baseline) -> Fit:
    """Fit a baseline alone, from the best two of several points where it has them."""
    tried = [fit(problem, start, (), 1) for start in baseline.elsewhere()]
    if not tried:
        return fit(problem, baseline, (), 12 if baseline.lagged else 3)
    best = sorted(tried, key=lambda f: -f.log_evidence)[:2]
    return from_elsewhere(max((fit(problem, f.moved(), (), 6) for f in best), key=lambda f: f.log_evidence), 6)
