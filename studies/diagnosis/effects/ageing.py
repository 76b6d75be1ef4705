"""Ageing: a drift with time that slows down."""

from collections.abc import Sequence

import numpy as np

from studies.diagnosis.effects import Effect, Parameter, Span
from studies.diagnosis.states import FloatArray, States


def columns(states: States, shape: Sequence[float], response: str) -> FloatArray:
    """C log(1 + t/t₀), t from the start of the campaign or, after a restart, of the run."""
    onset, restarts = shape
    time = states.time if restarts else states.campaign_time
    return np.log1p(time / onset)[:, None]


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """Onsets from minutes to far beyond the campaign (a straight line)."""
    forms: list[tuple[float, ...]] = [
        (float(onset), 0.0) for onset in np.geomspace(300.0, 30.0 * span.campaign_length, 10)
    ]
    if response == "bias_deg_per_h":
        forms += [(float(onset), 1.0) for onset in np.geomspace(300.0, 10.0 * span.longest_run, 6)]
    return forms


EFFECT = Effect(
    name="ageing",
    summary="the response drifts with time and slows down: relaxation of glass, bond or coating",
    source="logarithmic ageing, Vig and Meeker, Proc. 45th Frequency Control Symposium (1991) 77",
    isolate="repeat one run days later at the same temperature, against a reference clock",
    responses=("frequency_Hz", "bias_deg_per_h", "inverse_q"),
    coefficients=("drift_{unit}",),
    shape=(
        Parameter("onset_s", 60.0, 1e8, "time after which the drift slows down"),
        Parameter("restarts_each_run", 0.0, 1.0, "1 when the drift starts anew in each run", False, True),
    ),
    columns=columns,
    grid=grid,
    equivalents={"frequency_Hz": ("clock-drift",)},
    kin={"inverse_q": ("leak",)},
)
