"""Amplitude-frequency effect: the spring of a large vibration is not linear."""

import numpy as np

from compensation.arrays import Array
from studies.effects.effect import Coefficient, Effect, Shape
from studies.effects.states import States


def columns(states: States, shape: Shape, response: str) -> Array:
    """Backbone of a cubic (Duffing) spring: δf = κ A², at once; the next order, A⁴, of a spring that hardens or softens more."""
    power = states.amplitude_squared
    assert power is not None
    return np.stack([power, power**2], axis=1)


EFFECT = Effect(
    name="amplitude-frequency",
    summary="the frequency depends on the vibration amplitude: a nonlinear spring",
    source="Duffing oscillator, Nayfeh and Mook, Nonlinear Oscillations (1979), backbone curve",
    isolate="step the drive amplitude at constant temperature: an instant change, which the bias does not follow",
    coefficients=(Coefficient("slope_{unit}_per_V2"), Coefficient("quartic_{unit}_per_V4", (0.1,))),
    columns=columns,
    sizes={"frequency_Hz": 1e-4},
    needs=("amplitude_squared",),
)
