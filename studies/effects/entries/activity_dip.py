"""Activity dip: a spurious mode crosses the working mode at one temperature."""

import numpy as np

from compensation.arrays import Array
from shell.constants import zero_Celsius
from studies.effects.effect import Coefficient, Effect, Parameter, Shape, Span
from studies.effects.states import States


def columns(states: States, shape: Shape, response: str) -> Array:
    """With z = (T − T_d)/w, f shifts by z/(1 + z²), 1/Q by 1/(1 + z²); a stronger coupling mixes and widens the two.

    A loop that follows the branch δ ± √(δ² + κ²) hops where they cross: sgn(z) (√(z² + 1) − |z|), and 1 − |z|/√(z² + 1) in 1/Q.
    """
    centre, width = shape
    out = []
    for ratio in (1.0, 2.0):
        z = (states.resonator - zero_Celsius - centre) / (width * ratio)
        pair = [z / (1.0 + z * z), 1.0 / (1.0 + z * z)]
        out += pair if response == "frequency_Hz" else pair[::-1]
    for ratio in (1.0, 3.0):
        z = (states.resonator - zero_Celsius - centre) / (width * ratio)
        root = np.sqrt(z * z + 1.0)
        out.append(np.sign(z) * (root - np.abs(z)) if response == "frequency_Hz" else 1.0 - np.abs(z) / root)
    return np.stack(out, axis=1)


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """Centres over the covered range, a width apart."""
    low, high = span.temperature_low - zero_Celsius, span.temperature_high - zero_Celsius
    widths = [width for width in (0.25, 0.5, 1.0, 2.0) if width < 0.2 * (high - low)]
    return [(float(centre), width) for width in widths for centre in np.arange(low, high, apart(span, width))]


def apart(span: Span, width: float) -> float:
    """Distance of the first centres, K."""
    return max(0.8 * width, span.temperature_range / 80)


def near(span: Span, response: str, shape: Shape) -> list[tuple[float, ...]]:
    """Centres up to the next ones, a sixth of a width apart: a hop is sharp."""
    centre, width = shape
    reach = apart(span, width)
    step = max(width / 6, reach / 15)
    steps = int(reach / step)
    centres = centre + step * np.arange(-steps, steps + 1)
    return [(float(at), float(width * ratio)) for ratio in (0.7, 1.0, 1.4) for at in centres]


def steady(x: Array, shape: Shape) -> Array:
    """Dispersion of one crossing."""
    z = (x - shape[0]) / shape[1]
    return np.asarray((z / (1.0 + z * z))[:, None])


EFFECT = Effect(
    name="activity-dip",
    summary="a spurious mode crosses the working mode at one temperature and pulls frequency and damping",
    source="avoided crossing of two damped modes; Ballato and Tilton, IEEE UFFC 25 (1978) on activity dips",
    isolate="cross the temperature twice in both directions, then with another amplitude or bias voltage: the dip moves",
    sensor="1/Q beside the frequency: a dip shows in both at the same temperature",
    coefficients=(Coefficient("pull_{unit}", (1.0, 0.4, 0.4, 0.2, 0.35, 0.35)),),
    columns=columns,
    grid=grid,
    near=near,
    sizes={"frequency_Hz": 1e-4, "inverse_q": 1.0},
    shape=(
        Parameter("temperature_degC", -150.0, 250.0, "where the modes cross", False),
        Parameter("width_K", 0.05, 2.5, "half width of the crossing"),
    ),
    steady=steady,
    steady_grid=lambda low, high: [
        (float(c), float(w)) for c in np.linspace(low, high, 25) for w in np.array([0.05, 0.1, 0.2, 0.4]) * (high - low)
    ],
    steady_words="frequency crossing with a spurious mode, {0:+.0f} K from the reference temperature",
)
