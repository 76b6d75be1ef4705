"""Periodic disturbance: a line at one period."""

from collections.abc import Sequence

import numpy as np

from studies.diagnosis.effects import Effect, Parameter, Span
from studies.diagnosis.states import FloatArray, States

CYCLES = 3.0
"""Periods in the longest run that make a line: with fewer, a wandering response looks the same."""


def columns(states: States, shape: Sequence[float], response: str) -> FloatArray:
    """A sin(2πt/P) + b cos(2πt/P), its mean over a step; t from the start of the campaign or, after a restart, of the run."""
    period, restarts = shape
    phase = 2.0 * np.pi * (states.time if restarts else states.campaign_time) / period
    return np.stack([np.sin(phase), np.cos(phase)], axis=1) * np.sinc(states.step / period)


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """Periods from 2.5 steps of the grid to a third of a run, spaced finer than a phase slip of 1/4 turn."""
    slowest, fastest = CYCLES / span.longest_run, 1.0 / (2.5 * span.step)
    in_run = np.arange(slowest, fastest, 0.35 / span.longest_run)
    forms: list[tuple[float, ...]] = [(float(1.0 / f), 1.0) for f in in_run]
    if span.runs > 1:
        across = np.arange(
            slowest, min(fastest, slowest + 300 * 0.4 / span.campaign_length), 0.4 / span.campaign_length
        )
        across = np.concatenate([across, *(_around(line, span) for line in span.lines)])
        across = across[across >= slowest]
        forms += [(float(1.0 / f), 0.0) for f in across]
    return forms


def _around(line: float, span: Span) -> FloatArray:
    """Frequencies with one phase through all runs, as far from a line as one run leaves it uncertain."""
    wide, fine = 0.6 / span.longest_run, 0.4 / span.campaign_length
    return np.linspace(line - wide, line + wide, min(2 * int(wide / fine) + 1, 400))


EFFECT = Effect(
    name="periodic",
    summary="a disturbance of one period: an air conditioner, a table, a beat of two clocks",
    source="harmonic regression",
    isolate="change the period of the chamber's control, or let the table turn at a known rate",
    responses=("bias_deg_per_h", "frequency_Hz", "inverse_q"),
    coefficients=("sine_{unit}", "cosine_{unit}"),
    shape=(
        Parameter("period_s", 1.0, 1e7, "period", of_run=1.0 / CYCLES),
        Parameter("restarts_each_run", 0.0, 1.0, "1 when each run starts with the same phase", False, True),
    ),
    columns=columns,
    grid=grid,
)
