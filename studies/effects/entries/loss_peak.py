"""Loss peak: a Debye relaxation damps the resonator around one temperature."""

import numpy as np

from compensation.arrays import Array
from shell.constants import zero_Celsius
from shell.damping.anelastic import activated_loss, activation_energy
from studies.effects.effect import Coefficient, Effect, Parameter, Shape, Span
from studies.effects.states import States


def columns(states: States, shape: Shape, response: str) -> Array:
    """2 ωτ/(1 + ω²τ²) = 1/cosh(ln ωτ) of an activated τ, as in a loss budget; E = k T_p²/w."""
    peak, width = shape[0] + zero_Celsius, shape[1]
    return activated_loss(1.0, activation_energy(peak, width), peak, states.resonator)[:, None]


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """Peaks over the covered range."""
    low, high = span.temperature_low - zero_Celsius, span.temperature_high - zero_Celsius
    return [
        (float(centre), width)
        for width in (2.5, 4.0, 7.0, 12.0, 20.0)
        for centre in np.arange(low, high + 1e-9, max(width / 2, (high - low) / 30))
    ]


EFFECT = Effect(
    name="loss-peak",
    summary="a relaxation in glass or coating damps the resonator around one temperature",
    source="Debye peak with activated relaxation time; Fraser, J. Appl. Phys. 41 (1970) 6 for silica",
    isolate="cover the peak from both sides; another harmonic moves an activated peak",
    sensor="1/Q of another harmonic",
    coefficients=(Coefficient("peak_{unit}"),),
    columns=columns,
    grid=grid,
    sizes={"inverse_q": 2.0},
    shape=(
        Parameter("temperature_degC", -150.0, 250.0, "where the peak is", False),
        Parameter("width_K", 2.5, 60.0, "width of the peak"),
    ),
    positive=True,
)
