"""Quadrature leakage: a phase error of the demodulator turns quadrature into bias."""

from collections.abc import Sequence

import numpy as np

from studies.diagnosis.effects import Effect, Span
from studies.diagnosis.states import FloatArray, States


def columns(states: States, shape: Sequence[float], response: str) -> FloatArray:
    """B = V_q (φ₀ + φ₁ x), x = T_r − T₀ in units of 10 K."""
    assert states.quadrature is not None
    return np.stack([states.quadrature, states.quadrature * states.excess / 10.0], axis=1)


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """No shape parameter."""
    return [()]


EFFECT = Effect(
    name="quadrature-leakage",
    summary="the demodulation phase is off: part of the quadrature appears as rate",
    source="B = S_q sin φ, phase error φ linear in temperature",
    isolate="step the quadrature control at constant temperature",
    responses=("bias_deg_per_h",),
    needs=("quadrature",),
    coefficients=("leakage_{unit}_per_V", "leakage_slope_{unit}_per_V_per_10K"),
    columns=columns,
    grid=grid,
    nested=True,
)
