"""Two thermal paths: the resonator follows the housing through more than one time constant."""

import numpy as np

from compensation.arrays import Array
from studies.effects.effect import Coefficient, Effect, Parameter, Shape, Span
from studies.effects.states import States, lag


def columns(states: States, shape: Shape, response: str) -> Array:
    """T_r = (1 − w) Σ wᵢ lag(T_h; τᵢ) + w lag(T_h; τ₂): the change for w = 1, and for paths at a third and at three times of τ₂."""
    first = states.behind(states.housing)
    paths = [lag(states.housing, states.step, shape[0] * ratio) - first for ratio in (1.0, 1.0 / 3.0, 3.0)]
    return np.stack(paths, axis=1)


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """Time constants away from the first one."""
    ratios = (0.03, 0.1, 0.2, 0.4, 0.6, 1.6, 2.5, 4.0, 6.5, 10.0, 20.0)
    return [(span.tau * ratio,) for ratio in ratios if span.tau * ratio > span.step / 2]


EFFECT = Effect(
    name="second-lag",
    summary="a second thermal time constant: part of the heat takes another path to the resonator",
    source="two-node thermal network; Bacher and Madsen, Energy and Buildings 43 (2011) 1511",
    isolate="equal steps up and down at two mean temperatures, with a soak longer than five times the slow time constant",
    sensor="a thermometer on the base or stem: a second lag would show there, a stress would not",
    coefficients=(Coefficient("weight", (1.0, 0.2, 0.2), most=1.0),),
    columns=columns,
    grid=grid,
    delay=0,
    sizes={"frequency_Hz": 0.5},
    shape=(Parameter("second_time_constant_s", 20.0, 3e5, "the other time constant"),),
    acts_on="temperature",
    card_key="law.second_lag_s",
    memory="second_time_constant_s",
)
