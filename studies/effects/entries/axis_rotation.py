"""Axis rotation: the principal axes of the resonator turn with temperature."""

import numpy as np

from compensation.arrays import Array
from studies.effects.effect import Coefficient, Effect, Parameter, Shape, Span
from studies.effects.states import States


def columns(states: States, shape: Shape, response: str) -> Array:
    """B = D sin 4(θ − ψ(T)) with ψ = ψ₀ + ψ₁ x, x = T_r − T₀ in units of 10 K: what a wave meets of a split, across and along."""
    assert states.pattern_angle is not None
    across = 4 * (states.pattern_angle - np.radians(shape[0]) * states.excess / 10.0)
    return np.stack([np.sin(across), np.cos(across)], axis=1)


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """Rotations in both senses, up to a turn of the n = 2 pattern over the covered range."""
    most = 90.0 / max(span.temperature_range / 10.0, 1e-3)
    return [(float(sense * most * part),) for part in (0.03, 0.1, 0.2, 0.35, 0.6, 1.0) for sense in (1, -1)]


EFFECT = Effect(
    name="axis-rotation",
    summary="the principal axes turn with temperature, so the bias depends on azimuth and temperature together",
    source="two-axis damping and stiffness mismatch, B = D sin 4(θ − ψ)",
    isolate="the same temperatures at two azimuths or more",
    sensor="the pattern angle, moved to two azimuths or more",
    coefficients=(Coefficient("sine_{unit}"), Coefficient("cosine_{unit}")),
    columns=columns,
    grid=grid,
    sizes={"bias_deg_per_h": 30.0},
    shape=(Parameter("rotation_deg_per_10K", -90.0, 90.0, "turn of the axes", False),),
    needs=("pattern_angle",),
)
