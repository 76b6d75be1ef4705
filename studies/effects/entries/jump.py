"""Jump: the response steps once and stays."""

import numpy as np

from studies.effects.effect import Coefficient, Effect, Parameter, Shape, Span
from studies.effects.states import FloatArray, States


def columns(states: States, shape: Shape, response: str) -> FloatArray:
    """H(t − t*) of one run; where the jump stays, all later runs have it too."""
    run, time, stays = shape
    if states.run != int(run):
        return np.full((states.time.size, 1), float(bool(stays) and states.run > run))
    # a mean over the step of the grid: the share of it that lies behind the jump
    return np.asarray(np.clip((states.time - time) / states.step + 0.5, 0.0, 1.0)[:, None])


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """Every step of every run."""
    lasting = (0.0, 1.0) if response != "bias_deg_per_h" else (0.0,)
    return [
        (float(run), float(time) + span.step / 2, stays)
        for run, times in enumerate(span.bins)
        for time in times[:-1]
        for stays in lasting
        if not (stays and run == span.runs - 1)
    ]


EFFECT = Effect(
    name="jump",
    summary="the response stepped once, at one moment",
    source="step at an unknown time; stress release, charge, a mode of the electronics",
    isolate="repeat the run: a jump does not come back at the same temperature",
    coefficients=(Coefficient("step_{unit}"),),
    columns=columns,
    grid=grid,
    sizes={"frequency_Hz": 1e-4, "bias_deg_per_h": 30.0, "inverse_q": 0.5},
    shape=(
        Parameter("run", 0.0, 1e4, "run that has the jump, from 0", False, True),
        Parameter("time_s", 0.0, 1e9, "when in that run", False),
        Parameter("stays_in_later_runs", 0.0, 1.0, "1 when later runs keep it", False, True),
    ),
    event=True,
    once=True,
)
