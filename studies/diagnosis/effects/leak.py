"""Leak: gas enters the vacuum housing and damps the resonator."""

from collections.abc import Sequence

from studies.diagnosis.effects import AROUND, Effect, Parameter, Span
from studies.diagnosis.states import FloatArray, States


def columns(states: States, shape: Sequence[float], response: str) -> FloatArray:
    """1/Q ∝ P/√T in the free molecular regime: with P ∝ t T in a sealed housing, growth is t (T/T₀)^½; with P ∝ t, −½."""
    (exponent,) = shape
    return (states.campaign_time / 86400.0 * (states.resonator / AROUND) ** exponent)[:, None]


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """Gas that stays and is warmed with the housing, or that comes and goes at one pressure."""
    return [(0.5,), (-0.5,)]


EFFECT = Effect(
    name="leak",
    summary="gas leaks into the housing: the damping grows with time",
    source="free molecular gas damping, Christian, Vacuum 16 (1966) 175",
    isolate="store the gyro warm for a known time and repeat the run; heat the getter",
    responses=("inverse_q",),
    coefficients=("growth_per_day",),
    positive=True,
    kin={"inverse_q": ("ageing",)},
    shape=(Parameter("temperature_exponent", -0.5, 0.5, "0.5 in a sealed housing, -0.5 at one pressure", False, True),),
    columns=columns,
    grid=grid,
)
