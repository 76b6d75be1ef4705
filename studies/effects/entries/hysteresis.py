"""Hysteresis: a response that depends on where the temperature came from, however slowly."""

import numpy as np

from compensation.arrays import Array
from shell.constants import zero_Celsius
from studies.effects.effect import Coefficient, Effect, Parameter, Shape, Span
from studies.effects.states import States, play


def columns(states: States, shape: Shape, response: str) -> Array:
    """Plays less the temperature itself, K: half widths of 1, 0.4, 0.7, 1.5 and 2.2 times the named one (Prandtl-Ishlinskii).

    Beside them what curves of the first play do that the same curves of the temperature do not, in units of (play − T): a
    relay of Preisach is a step of a play, and many of them a curve (generalised Prandtl-Ishlinskii).
    """
    radius, start, low, high = shape
    radii, past = [radius * ratio for ratio in RATIOS], np.empty(0)
    if start == KEPT:
        start, past = 0.0, past if states.before is None else states.before
    loops = play(np.concatenate([past, states.resonator]), radii, start)[past.size :]
    turns = np.pi * np.arange(1, ENVELOPE + 1) / max(high - low, 1e-9)
    bottom = low + zero_Celsius

    def curves(temperature: Array) -> Array:
        return np.asarray(np.cos(np.clip(temperature - bottom, 0.0, max(high - low, 0.0))[:, None] * turns) / turns)

    return np.concatenate([loops - states.resonator[:, None], curves(loops[:, 0]) - curves(states.resonator)], axis=1)


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """Loop half widths from half a percent of the covered range; three initial memories, and that which the runs before have left."""
    radii = span.temperature_range * np.geomspace(0.006, WIDEST, 8)
    starts = (0.0, -1.0, 1.0, KEPT) if span.runs > 1 else (0.0, -1.0, 1.0)
    ends = span.temperature_low - zero_Celsius, span.temperature_high - zero_Celsius
    return [(float(radius), start, *ends) for radius in radii for start in starts]


def steady(x: Array, shape: Shape) -> Array:
    """A play through the temperatures in the order of the rows."""
    return np.asarray((play(x, shape[0]) - x)[:, None])


WIDEST = 0.25
"""Largest half width, in parts of the covered range: the play of a wider loop hardly moves, and less the temperature it is a
static curve."""
KEPT = 2.0  # initial memory that stands for what the runs before have left
ENVELOPE = 8  # half waves over the covered range that the width of a loop may follow
RATIOS = (1.0, 0.4, 0.7, 1.5, 2.2)


EFFECT = Effect(
    name="hysteresis",
    summary="a rate-independent loop: heating and cooling branches differ and stay apart in a soak",
    source="play operators, Visintin, Differential Models of Hysteresis (1994); envelopes: Al Janaideh, Rakheja and Su, Mechatronics 19 (2009) 656",
    isolate="the same cycle at two rates, and soak points approached from both sides: hysteresis does not decay",
    coefficients=(
        Coefficient("loop_{unit}_per_K", (1.0, 0.5, 0.6, 0.6, 0.5)),
        Coefficient("envelope_{unit}_per_K", tuple(0.35 / np.sqrt(k) for k in range(1, ENVELOPE + 1))),
    ),
    columns=columns,
    grid=grid,
    sizes={"bias_deg_per_h": 2.0, "frequency_Hz": 3e-5, "inverse_q": 0.02},
    alike=True,
    shape=(
        Parameter("half_width_K", 0.02, 40.0, "half width of the loop in temperature", of_range=WIDEST),
        Parameter(
            "initial_memory",
            -1.0,
            KEPT,
            "where each run starts in its band, -1 to 1; 2: where the last run ended",
            False,
            True,
        ),
        Parameter("from_degC", -273.0, 500.0, "lower end of the envelope", False, True),
        Parameter("to_degC", -273.0, 500.0, "upper end of the envelope", False, True),
    ),
    steady=steady,
    steady_grid=lambda low, high: [(part * (high - low),) for part in (0.01, 0.05, 0.15, 0.4)],
    steady_words="hysteresis, from the order of the rows",
)
