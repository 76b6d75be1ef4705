"""Ageing: a drift with time that slows down."""

import numpy as np

from compensation.arrays import Array
from studies.effects.effect import Coefficient, Effect, Parameter, Shape, Span
from studies.effects.states import States


def columns(states: States, shape: Shape, response: str) -> Array:
    """C log(1 + t/t₀), beside it 1 − e^(−t/3t₀) and t/t₀; t from the start of the campaign or, after a restart, of the run."""
    onset, restarts = shape
    time = states.time if restarts else states.campaign_time
    steps = time / onset
    return np.stack([np.log1p(steps), -np.expm1(-steps / 3.0), steps], axis=1)


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """Onsets from minutes to far beyond the campaign (a straight line)."""
    forms: list[tuple[float, ...]] = [(float(t), 0.0) for t in np.geomspace(300.0, 10.0 * span.campaign_length, 8)]
    if response == "bias_deg_per_h" and span.runs > 1:
        forms += [(float(t), 1.0) for t in np.geomspace(300.0, 10.0 * span.longest_run, 5)]
    return forms


EFFECT = Effect(
    name="ageing",
    dated=True,
    summary="the response drifts with time and slows down: relaxation of glass, bond or coating",
    source="logarithmic and exponential ageing, Vig and Meeker, Proc. 45th Frequency Control Symposium (1991) 77",
    isolate="repeat one run days later at the same temperature, against a reference clock",
    sensor="a reference clock (reference_frequency_Hz)",
    coefficients=(
        Coefficient("drift_{unit}"),
        Coefficient("exponential_{unit}", (0.5,)),
        Coefficient("linear_{unit}", (0.1,)),
    ),
    columns=columns,
    grid=grid,
    sizes={"frequency_Hz": 1e-4, "bias_deg_per_h": 20.0, "inverse_q": 1.0},
    alike=True,
    shape=(
        Parameter("onset_s", 60.0, 1e8, "time after which the drift slows down"),
        Parameter("restarts_each_run", 0.0, 1.0, "1 when the drift starts anew in each run", False, True),
    ),
    equivalents={"frequency_Hz": ("clock-drift",)},
    event=True,
)
