"""Leak: gas enters the housing, and damps."""

import numpy as np

from compensation.arrays import Array
from shell.damping.gas import free_impedance
from studies.effects.effect import AROUND, Coefficient, Effect, Parameter, Shape, Span
from studies.effects.states import States


def columns(states: States, shape: Shape, response: str) -> Array:
    """1/Q ∝ p √(M/(R T)) of free molecules, as in a loss budget: with p ∝ t T in a sealed housing t (T/T₀)^½, with p ∝ t −½.

    Through a hole p ∝ t, and τ (1 − e^(−t/τ)) as it nears the pressure outside; where diffusion feeds it, outgassing, p ∝ √t.
    """
    exponent, filling = shape
    days = states.campaign_time / 86400.0
    grown = -np.expm1(-states.campaign_time / filling) * filling / 86400.0 if filling else days
    warm = (states.resonator / AROUND) ** (exponent + 0.5)
    rest = free_impedance(1.0, 1.0, AROUND)
    return np.stack([free_impedance(p * warm, 1.0, states.resonator) / rest for p in (grown, np.sqrt(days))], axis=1)


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """Gas that stays and is warmed with the housing, or comes and goes at one pressure; at one rate, or until it is full."""
    fillings = [0.0, *(span.campaign_length * part for part in (0.3, 0.6, 1.2, 2.4))]
    return [(exponent, filling) for exponent in (0.5, -0.5) for filling in fillings]


EFFECT = Effect(
    name="leak",
    dated=True,
    summary="gas leaks into the housing: the damping grows with time",
    source="free molecular gas damping, Christian, Vacuum 16 (1966) 175; diffusion-limited outgassing ∝ t^-1/2, O'Hanlon",
    isolate="store the gyro warm for a known time and repeat the run; heat the getter",
    sensor="a pressure gauge, or 1/Q before and after warm storage",
    coefficients=(Coefficient("growth_{unit}_per_day"), Coefficient("outgassing_{unit}_per_root_day", (0.3,))),
    columns=columns,
    grid=grid,
    sizes={"inverse_q": 1.0},
    shape=(
        Parameter("temperature_exponent", -0.5, 0.5, "0.5 in a sealed housing, -0.5 at one pressure", False, True),
        Parameter("filling_s", 0.0, 1e12, "time in which the pressure nears that outside; 0: never", False, True),
    ),
    positive=True,
    event=True,
)
