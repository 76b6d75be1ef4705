"""Clock offset: the thermometer of one run was logged by another clock."""

from compensation.arrays import Array
from studies.effects.effect import Coefficient, Effect, Parameter, Shape, Span
from studies.effects.states import States


def columns(states: States, shape: Shape, response: str) -> Array:
    """T_r(t − Δ) in place of T_r(t), in one run: −Δ dT_r/dt."""
    return (-states.rate * float(states.run == int(shape[0])))[:, None]


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """Every run, where there are several."""
    return [(float(run),) for run in range(span.runs)] if span.runs > 1 else []


EFFECT = Effect(
    name="clock-offset",
    summary="the columns of one run were logged by clocks that are seconds apart; to first order in the offset",
    source="two loggers with clocks of their own",
    isolate="log a mark that both loggers see, such as a step of the supply, at the start and the end of the run",
    sensor="one logger for all columns, or a common mark",
    coefficients=(Coefficient("offset_s"),),
    columns=columns,
    grid=grid,
    sizes={"frequency_Hz": 100.0, "bias_deg_per_h": 100.0},
    shape=(Parameter("run", 0.0, 1e4, "run that is late, from 0", False, True),),
    acts_on="temperature",
    event=True,
    once=True,
)
