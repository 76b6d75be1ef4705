"""What a named effect adds to a response: its columns, what its form may miss, and what it had at the start of a run."""

from dataclasses import dataclass

import numpy as np

from studies.diagnosis.baseline import View
from studies.diagnosis.problem import Problem
from studies.effects import Effect, Span
from studies.effects.states import FloatArray, States, average, lag

LATE = 0.1
"""Delay of what a form may miss, in parts of the thermal lag."""


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


def used(effect: Effect) -> "np.ndarray":
    """Return which columns of an effect a diagnosis fits: those that have a prior."""
    return np.flatnonzero(effect.spread > 0)


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
