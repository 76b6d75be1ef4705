"""Mounting stress: the bond strains the resonator's support and relaxes."""

from collections.abc import Sequence

import numpy as np

from studies.diagnosis.effects import Effect, Parameter, Span
from studies.diagnosis.states import FloatArray, States, lag


def columns(states: States, shape: Sequence[float], response: str) -> FloatArray:
    """Maxwell element: stress ∝ T_r − lag(T_r; τ_s), a thermal mismatch that relaxes with τ_s."""
    return (states.resonator - lag(states.resonator, states.step, shape[0]))[:, None]


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """Relaxation times from half the thermal one (a shorter one would be the rate) to well beyond a run."""
    return [(float(tau),) for tau in np.geomspace(max(0.5 * span.tau, 600.0), max(4.0 * span.longest_run, 4000.0), 6)]


EFFECT = Effect(
    name="mounting-stress",
    summary="thermal mismatch strains the mount and relaxes slowly; frequency shifts that are not temperature",
    source="viscoelastic bond (Maxwell element) under thermal mismatch strain",
    isolate="soak for days after a large step and watch f against an independent thermometer on the resonator",
    responses=("frequency_Hz", "bias_deg_per_h"),
    coefficients=("stress_{unit}_per_K",),
    shape=(Parameter("relaxation_time_s", 600.0, 1e6, "time in which the stress relaxes"),),
    kin={"frequency_Hz": ("second-lag",)},
    columns=columns,
    grid=grid,
    fine=True,
)
