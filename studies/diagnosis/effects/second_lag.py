"""Two thermal paths: the resonator follows the housing through two time constants."""

from collections.abc import Sequence

from studies.diagnosis.effects import Effect, Parameter, Span
from studies.diagnosis.states import FloatArray, States, lag


def columns(states: States, shape: Sequence[float], response: str) -> FloatArray:
    """T_r = (1 − w) lag(T_h; τ) + w lag(T_h; τ₂): the change for w = 1."""
    first = lag(states.housing, states.step, states.tau)
    return (lag(states.housing, states.step, shape[0]) - first)[:, None]


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """Time constants away from the first one."""
    ratios = (0.03, 0.1, 0.2, 0.4, 2.5, 4.0, 6.5, 10.0, 20.0)
    return [(span.tau * ratio,) for ratio in ratios if span.tau * ratio > span.step / 2]


EFFECT = Effect(
    name="second-lag",
    summary="a second thermal time constant: part of the heat takes another path to the resonator",
    source="two-node thermal network; Bacher and Madsen, Energy and Buildings 43 (2011) 1511",
    isolate="equal steps up and down at two mean temperatures, with a soak longer than five of the slow constant",
    responses=("frequency_Hz",),
    acts_on="temperature",
    coefficients=("weight",),
    shape=(Parameter("second_time_constant_s", 20.0, 3e5, "the other time constant"),),
    kin={"frequency_Hz": ("mounting-stress",)},
    columns=columns,
    grid=grid,
    fine=True,
)
