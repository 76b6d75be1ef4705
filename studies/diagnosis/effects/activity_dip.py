"""Activity dip: a spurious mode crosses the working mode at one temperature."""

from collections.abc import Sequence

import numpy as np

from studies.diagnosis.effects import Effect, Parameter, Span
from studies.diagnosis.states import FloatArray, States


def columns(states: States, shape: Sequence[float], response: str) -> FloatArray:
    """Weakly coupled, damped modes: with z = (T − T_d)/w, f shifts by z/(1+z²), 1/Q by 1/(1+z²)."""
    centre, width = shape
    z = (states.resonator - 273.15 - centre) / width
    return ((z if response == "frequency_Hz" else np.ones_like(z)) / (1.0 + z * z))[:, None]


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """Centres over the covered range, a width apart."""
    low, high = span.temperature_low - 273.15, span.temperature_high - 273.15
    widths = [width for width in (0.25, 0.5, 1.0, 2.0) if width < 0.2 * (high - low)]
    return [
        (float(centre), width)
        for width in widths
        for centre in np.arange(low, high, max(width * 0.8, (high - low) / 80))
    ]


EFFECT = Effect(
    name="activity-dip",
    summary="a spurious mode crosses the working mode at one temperature and pulls frequency and damping",
    source="avoided crossing of two damped modes; Ballato and Tilton, IEEE UFFC 25 (1978) on activity dips",
    isolate="cross the temperature twice in both directions, then with another amplitude or bias voltage: the dip moves",
    responses=("frequency_Hz", "inverse_q"),
    coefficients=("pull_{unit}",),
    shape=(
        Parameter("temperature_degC", -150.0, 250.0, "where the modes cross", False),
        Parameter("width_K", 0.05, 2.5, "half width of the crossing"),
    ),
    columns=columns,
    grid=grid,
    fine=True,
)
