"""Jump: the response steps once and stays, but for what relaxes within the hour."""

import numpy as np

from compensation.arrays import Array
from studies.effects.effect import Coefficient, Effect, Parameter, Shape, Span
from studies.effects.states import States


def columns(states: States, shape: Shape, response: str) -> Array:
    """H(t − t*) of one run, and H(t − t*) e^(−(t − t*)/τ) for what relaxes after it; where the jump stays, later runs have the first."""
    run, time, stays = shape
    out = np.zeros((states.time.size, 1 + len(RELAXING)))
    if states.run != int(run):
        out[:, 0] = float(bool(stays) and states.run > run)
        return out
    # means over the step of the grid: only the share of it that lies behind the jump
    end = np.maximum(states.time + states.step / 2 - time, 0.0)
    begin = np.maximum(end - states.step, 0.0)
    out[:, 0] = (end - begin) / states.step
    for k, tau in enumerate(RELAXING, 1):
        out[:, k] = tau / states.step * (np.exp(-begin / tau) - np.exp(-end / tau))
    return out


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


RELAXING = (300.0, 1000.0, 3000.0)  # time constants of what relaxes after the jump, s


EFFECT = Effect(
    name="jump",
    summary="the response stepped once, at one moment",
    source="step at an unknown time; stress release, charge, a mode of the electronics",
    isolate="repeat the run: a jump does not come back at the same temperature",
    coefficients=(Coefficient("step_{unit}"), Coefficient("relaxing_{unit}", (0.2,) * len(RELAXING))),
    columns=columns,
    grid=grid,
    sizes={"frequency_Hz": 1e-4, "bias_deg_per_h": 30.0, "inverse_q": 0.5},
    alike=True,
    shape=(
        Parameter("run", 0.0, 1e4, "run that has the jump, from 0", False, True),
        Parameter("time_s", 0.0, 1e9, "when in that run", False),
        Parameter("stays_in_later_runs", 0.0, 1.0, "1 when later runs keep it", False, True),
    ),
    event=True,
    once=True,
)
