"""Hysteresis: a response that depends on where the temperature came from, however slowly."""

from collections.abc import Sequence

import numpy as np

from studies.diagnosis.effects import Effect, Parameter, Span
from studies.diagnosis.states import FloatArray, States, play


def columns(states: States, shape: Sequence[float], response: str) -> FloatArray:
    """Mean of three plays of scattered half widths (a small Preisach model) less the temperature itself, K."""
    radius, scatter, start = shape
    radii = [radius * max(1.0 + scatter * part, 0.05) for part in (-1.2247, 0.0, 1.2247)]
    loops = play(states.resonator, radii, start)
    return np.asarray(loops.mean(axis=1, keepdims=True) - states.resonator[:, None])


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """Loop half widths from half a percent to a third of the covered range; three initial memories."""
    radii = span.temperature_range * np.geomspace(0.006, 0.35, 9)
    return [(float(radius), 0.12, start) for radius in radii for start in (0.0, -1.0, 1.0)]


EFFECT = Effect(
    name="hysteresis",
    summary="a rate-independent loop: heating and cooling branches differ and stay apart in a soak",
    source="play operator, Visintin, Differential Models of Hysteresis (1994); Preisach models are sums of plays",
    isolate="the same cycle at two rates, and soak points approached from both sides: hysteresis does not decay",
    responses=("bias_deg_per_h", "frequency_Hz", "inverse_q"),
    coefficients=("loop_{unit}_per_K",),
    shape=(
        Parameter("half_width_K", 0.02, 40.0, "half width of the loop in temperature"),
        Parameter("width_scatter", 0.0, 0.7, "scatter of the half widths over their mean", False),
        Parameter("initial_memory", -1.0, 1.0, "where in its band each run starts", False, True),
    ),
    columns=columns,
    grid=grid,
)
