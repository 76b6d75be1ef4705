"""Quadrature leakage: a phase error of the demodulator turns quadrature into bias."""

import numpy as np

from compensation.arrays import Array
from studies.effects.effect import Coefficient, Effect, Shape
from studies.effects.states import States


def columns(states: States, shape: Shape, response: str) -> Array:
    """B = V_q (φ₀ + φ₁ x), x = T_r − T₀ in units of 10 K."""
    assert states.quadrature is not None
    return np.stack([states.quadrature, states.quadrature * (states.excess / 10.0)], axis=1)


EFFECT = Effect(
    name="quadrature-leakage",
    summary="the demodulation phase is off: part of the quadrature appears as rate",
    source="B = S_q sin φ, phase error φ linear in temperature",
    isolate="step the quadrature control at constant temperature",
    sensor="the quadrature control's voltage (quadrature_V)",
    coefficients=(Coefficient("leakage_{unit}_per_V"), Coefficient("leakage_slope_{unit}_per_V_per_10K", (0.2,))),
    columns=columns,
    sizes={"bias_deg_per_h": 20.0},
    needs=("quadrature",),
)
