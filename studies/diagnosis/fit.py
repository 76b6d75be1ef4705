"""Variable projection: linear coefficients are solved for, shapes and the lag are polished by Gauss and Newton."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from studies.diagnosis.baseline import Problem, Term
from studies.diagnosis.likelihood import SHARES, LinearFit, fit_linear
from studies.diagnosis.states import FloatArray

ROUNDS = 12
TWO_LAGS = ("second-lag", "mounting-stress")
"""Effects that divide one thermal constant in two."""
LIKELY = 2.71
"""Twice the log-likelihood that a single parameter of a 90 % interval may cost."""
FRINGE, MOST_FRINGES = 0.2, 150
"""Steps of a period between its fringes, in cycles over the campaign, and at most so many on each side."""
QUIET = 0.02
"""A round that gains less than this in minus twice the log-likelihood is the last."""


@dataclass(frozen=True)
class Fit:
    """A response fitted by the baseline and a set of effects.

    Attributes
    ----------
    problem : Problem
        With the fitted lag.
    terms : tuple of Term
        Effects with their fitted shapes.
    linear : LinearFit
        Coefficients of the baseline, then of the terms in order.
    matrix : (M, p) array
        The columns that they multiply.
    """

    problem: Problem
    terms: tuple[Term, ...]
    linear: LinearFit
    matrix: FloatArray

    @property
    def score(self) -> float:
        """Minus twice the log-likelihood, up to a constant."""
        return self.linear.score

    def columns(self) -> FloatArray:
        """Columns of baseline and terms, (M, p)."""
        return self.matrix

    def coefficients_of(self, index: int) -> FloatArray:
        """Coefficients of one term."""
        begin = len(self.linear.coefficients) - sum(term.count for term in self.terms[index:])
        return self.linear.coefficients[begin : begin + self.terms[index].count]


@dataclass(frozen=True)
class _Knob:
    """One nonlinear parameter: of term `term`, number `number`; the lag when `term` is −1."""

    term: int
    number: int
    logarithmic: bool
    low: float
    high: float
    nudge: float
    reach: float


def fit_terms(problem: Problem, terms: Sequence[Term], rounds: int = ROUNDS) -> Fit:
    """Fit baseline and terms; polish the shapes and the lag from where they are.

    Parameters
    ----------
    problem : Problem
    terms : sequence of Term
        Effects with starting shapes.
    rounds : int
        Most rounds of refinement of the nonlinear parameters; 0 solves for the coefficients only.
    """
    problem, terms = _with_bend(problem, terms), tuple(terms)
    target = problem.rotated
    fit = _evaluate(problem, terms, target, SHARES)
    if not rounds:
        return fit
    if rounds == ROUNDS:
        fit = _evaluate(problem, _place_jumps(_flip(fit, target), target), target, SHARES)
        return min((_polish(start, target, rounds) for start in _spread_lags(fit, target)), key=lambda one: one.score)
    return _polish(fit, target, rounds)


def _polish(fit: Fit, target: FloatArray, rounds: int) -> Fit:
    knobs = _knobs(fit)
    for _ in range(rounds if knobs else 0):
        better = _gauss_newton(fit, knobs, target)
        if better is None:
            break
        gained = fit.score - better.score
        fit = better
        if gained < QUIET:
            break
    return replace(fit, linear=fit_linear(fit.problem.basis, target, fit.problem.basis.rotate(fit.columns()), SHARES))


def _with_bend(problem: Problem, terms: Sequence[Term]) -> Problem:
    if problem.response != "frequency_Hz":
        return problem
    coefficients = _evaluate(problem, tuple(terms), problem.rotated, SHARES[3:9:2]).linear.coefficients
    if coefficients[1] == 0.0:
        return problem
    return replace(problem, bend=float(np.clip(coefficients[2] / coefficients[1], -0.02, 0.02)))


def _evaluate(
    problem: Problem, terms: tuple[Term, ...], target: FloatArray, shares: Sequence[float] | FloatArray
) -> Fit:
    columns = problem.model(problem.tau, terms)
    return Fit(problem, terms, fit_linear(problem.basis, target, problem.basis.rotate(columns), shares), columns)


def _knobs(fit: Fit) -> list[_Knob]:
    knobs = [_Knob(-1, 0, True, 10.0, 1e5, 0.01, 0.3)] if fit.problem.lagged else []
    longest = max(float(np.ptp(states.time)) for states in fit.problem.states)
    for index, term in enumerate(fit.terms):
        for number, parameter in enumerate(term.effect.shape):
            if parameter.steady or term.name == "jump":
                continue
            if parameter.logarithmic:
                small, far = (3e-4, 0.03) if term.name == "periodic" else (0.01, 0.5)
            else:
                small, far = 0.02, 2.0 if parameter.high > 2.0 else 0.2
            high = min(parameter.high, parameter.of_run * longest)
            knobs.append(_Knob(index, number, parameter.logarithmic, parameter.low, high, small, far))
    return knobs


def _turn(fit: Fit, knobs: Sequence[_Knob], turns: Sequence[float]) -> tuple[Problem, tuple[Term, ...]]:
    """Return problem and terms with every knob turned."""
    problem, terms = fit.problem, list(fit.terms)
    for knob, turn in zip(knobs, turns, strict=True):
        if knob.term < 0:
            problem = replace(problem, tau=float(np.clip(problem.tau * np.exp(turn), knob.low, knob.high)))
            continue
        shape = list(terms[knob.term].shape)
        value = shape[knob.number]
        value = value * float(np.exp(turn)) if knob.logarithmic else value + turn
        shape[knob.number] = float(np.clip(value, knob.low, knob.high))
        terms[knob.term] = replace(terms[knob.term], shape=tuple(shape))
    return problem, tuple(terms)


def _gauss_newton(fit: Fit, knobs: Sequence[_Knob], target: FloatArray) -> Fit | None:
    """Return a better fit one step further, or None."""
    basis, coefficients = fit.problem.basis, fit.linear.coefficients
    jacobian = jacobian_of(fit, knobs)
    columns = np.concatenate([fit.columns(), jacobian], axis=1)
    size = np.linalg.norm(columns, axis=0)
    size[size == 0.0] = 1.0
    root = np.sqrt(basis.weights(fit.linear.share))[:, None]
    solution = np.linalg.lstsq(basis.rotate(columns / size) * root, target * root[:, 0], rcond=1e-10)[0] / size
    step = np.clip(solution[coefficients.size :], [-k.reach for k in knobs], [k.reach for k in knobs])
    near = int(np.argmin(np.abs(SHARES - fit.linear.share)))
    shares = SHARES[max(0, near - 1) : near + 2]
    for shrink in (1.0, 0.4, 0.12):
        problem, terms = _turn(fit, knobs, step * shrink)
        tried = _evaluate(problem, terms, target, shares)
        if tried.score < fit.score:
            return tried
    return None


def jacobian_of(fit: Fit, knobs: Sequence[_Knob] | None = None) -> FloatArray:
    """Return the derivatives of the fitted response with respect to every nonlinear parameter, (M, k)."""
    knobs = _knobs(fit) if knobs is None else knobs
    out = np.empty((fit.problem.values.size, len(knobs)))
    views = fit.problem.views(fit.problem.tau)
    for k, knob in enumerate(knobs):
        sides = []
        for sign in (1.0, -1.0):
            problem, terms = _turn(fit, [knob], [sign * knob.nudge])
            if knob.term < 0:
                sides.append(problem.model(problem.tau, terms) @ fit.linear.coefficients)
            else:
                sides.append(problem.term(terms[knob.term], views) @ fit.coefficients_of(knob.term))
        out[:, k] = (sides[0] - sides[1]) / (2.0 * knob.nudge)
    return out


def _flip(fit: Fit, target: FloatArray) -> Fit:
    """Try the other values of switches (restart, lasting, memory): a scan under much slow noise cannot tell them."""
    for index, term in enumerate(fit.terms):
        for number, parameter in enumerate(term.effect.shape):
            if not parameter.steady or parameter.name in ("run", "share_of_form"):
                continue
            if term.name == "ageing" and fit.problem.response != "bias_deg_per_h":
                continue
            for value in {parameter.low, 0.0, parameter.high} - {term.shape[number]}:
                shape = (*term.shape[:number], value, *term.shape[number + 1 :])
                terms = (*fit.terms[:index], replace(term, shape=shape), *fit.terms[index + 1 :])
                tried = _evaluate(fit.problem, terms, target, SHARES)
                if tried.score < fit.score:
                    fit, term = tried, terms[index]
    return fit


def _spread_lags(fit: Fit, target: FloatArray) -> list[Fit]:
    """Return starts for two time constants: their likelihood has several summits, one for each order.

    The best of a grid as it stands, and the best once the derivatives of all shapes are free: a summit is narrow in the
    larger of the two, and a grid passes beside it.
    """
    problem = fit.problem
    index = next((k for k, term in enumerate(fit.terms) if term.name in TWO_LAGS), None)
    if not problem.lagged or index is None:
        return [fit]
    ahead, least = fit, np.inf
    before, own, after = fit.terms[:index], fit.terms[index], fit.terms[index + 1 :]
    span = problem.states[0].step * problem.group
    for first in problem.tau * np.array([0.35, 0.6, 1.0, 1.25, 1.6]):
        for second in first * np.array([0.1, 0.25, 0.5, 1.6, 3.0, 7.0, 20.0]):
            parameter = own.effect.shape[0]
            if not max(parameter.low, span / 2) < second < parameter.high:
                continue
            term = replace(own, shape=(float(second), *own.shape[1:]))
            tried = _evaluate(replace(problem, tau=float(first)), (*before, term, *after), target, SHARES[::3])
            if tried.score < fit.score:
                fit = tried
            free = problem.basis.rotate(np.concatenate([tried.columns(), jacobian_of(tried)], axis=1))
            score = fit_linear(problem.basis, target, free, SHARES[::3]).score
            if score < least:
                ahead, least = tried, score
    return [fit, ahead]


def _place_jumps(fit: Fit, target: FloatArray) -> tuple[Term, ...]:
    """Move each jump between the steps of the grid, by the share of the step that lies behind it."""
    terms = fit.terms
    step = fit.problem.states[0].step * fit.problem.group
    for index, term in enumerate(terms):
        if term.name != "jump":
            continue
        tried = []
        for part in (-0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75):
            moved = replace(term, shape=(term.shape[0], term.shape[1] + part * step, term.shape[2]))
            others = (*terms[:index], moved, *terms[index + 1 :])
            tried.append((_evaluate(fit.problem, others, target, [fit.linear.share]).score, others))
        terms = min(tried, key=lambda pair: pair[0])[1]
    return terms


@dataclass(frozen=True)
class Interval:
    """A fitted parameter with its 90 % interval."""

    value: float
    low: float
    high: float


def intervals(fit: Fit, index: int) -> dict[str, Interval]:
    """Return the parameters of one term with 90 % intervals from the joint covariance of all parameters.

    Coefficients of effects on temperature are divided by the slope of the frequency.
    """
    term, problem = fit.terms[index], fit.problem
    knobs = _knobs(fit)
    columns = np.concatenate([fit.columns(), jacobian_of(fit, knobs)], axis=1)
    linear = fit_linear(problem.basis, problem.rotated, problem.basis.rotate(columns), [fit.linear.share])
    deviation = 1.6449 * np.sqrt(np.maximum(np.diag(linear.covariance), 0.0))
    count = fit.linear.coefficients.size
    out: dict[str, Interval] = {}
    for k, knob in enumerate(knobs):
        if knob.term != index:
            continue
        parameter = term.effect.shape[knob.number]
        value, wide = term.shape[knob.number], float(deviation[count + k])
        if parameter.logarithmic:
            factor = float(np.exp(min(wide, 20.0)))
            out[parameter.name] = Interval(
                value, max(value / factor, parameter.low), min(value * factor, parameter.high)
            )
        else:
            out[parameter.name] = Interval(value, max(value - wide, parameter.low), min(value + wide, parameter.high))
    for number, parameter in enumerate(term.effect.shape):
        if parameter.name not in out:
            half = 0.5 * problem.states[0].step * problem.group if parameter.name == "time_s" else 0.0
            value = term.shape[number]
            out[parameter.name] = Interval(value, value - half, value + half)
    if term.name == "periodic" and len(problem.basis.vectors) > 1 and not term.shape[1]:
        out["period_s"] = _span_of_fringes(fit, index, out["period_s"])
    scale = fit.linear.coefficients[1] if term.effect.acts_on == "temperature" else 1.0
    begin = count - sum(t.count for t in fit.terms[index:])
    for k, name in enumerate(term.effect.coefficient_names(problem.response, term.count)):
        value = float(fit.linear.coefficients[begin + k] / scale)
        wide = float(deviation[begin + k] / abs(scale))
        out[name] = Interval(value, value - wide, value + wide)
    if term.effect.sees_heat:
        out["share_of_form"] = out["radiated_share"]
    return out


def _span_of_fringes(fit: Fit, index: int, local: Interval) -> Interval:
    """Return the interval of a period whose phase goes on from run to run: the gaps leave fringes that fit as well.

    Where the records do not say when they start, every run has a phase of its own.
    """
    problem, term = fit.problem, fit.terms[index]
    longest = max(float(np.ptp(states.time)) for states in problem.states)
    campaign = max(float(states.campaign_time[-1]) for states in problem.states)
    steps = min(int(campaign / longest / FRINGE), MOST_FRINGES)
    frequencies = 1.0 / local.value + np.linspace(-1.0, 1.0, 2 * steps + 1) / longest
    periods = 1.0 / frequencies[frequencies > 0.5 / local.value]
    others = fit.terms[:index] + fit.terms[index + 1 :]
    beside = problem.basis.rotate(problem.model(problem.tau, others))
    views = problem.views(problem.tau)
    scores = []
    for period in periods:
        parts = [
            term.effect.columns(view.seen, (float(period), float(not problem.timed)), problem.response)
            for view in views
        ]
        if not problem.timed:
            parts = [np.kron(np.eye(len(parts))[k], part) for k, part in enumerate(parts)]
        columns = np.concatenate([beside, problem.basis.rotate(problem.stack(parts))], axis=1)
        scores.append(fit_linear(problem.basis, problem.rotated, columns, [fit.linear.share]).score)
    likely = periods[np.array(scores) < min(scores) + LIKELY]
    return Interval(local.value, min(local.low, float(likely.min())), max(local.high, float(likely.max())))
