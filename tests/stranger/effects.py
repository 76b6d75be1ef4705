"""The known effects, each by a formula of its own, as shapes of unit size on the grid of the runs.

`target` says where a shape enters: the shell's `temperature` (K), `frequency` (Hz), `bias` (deg/h), `inverse_q`,
the gyro's `clock` (relative) or the `reading` of the housing (K).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tests.stranger.network import STEP_S, lag
from tests.stranger.protocol import Run

Shape = list[np.ndarray]
Rng = np.random.Generator
KELVIN = 273.15


@dataclass(frozen=True)
class Effect:
    name: str
    targets: tuple[str, ...]
    draw: Callable[[list[Run], Rng], Shape]
    needs: frozenset[str] = frozenset()  # drive columns it varies, or "returns", "starts", "reference"


EFFECTS: dict[str, Effect] = {}


def effect(
    name: str, *targets: str, needs: tuple[str, ...] = ()
) -> Callable[[Callable[..., Shape]], Callable[..., Shape]]:
    def enter(draw: Callable[..., Shape]) -> Callable[..., Shape]:
        EFFECTS[name] = Effect(name, targets, draw, frozenset(needs))
        return draw

    return enter


def _span(runs: list[Run]) -> tuple[float, float]:
    every = np.concatenate([r.mode for r in runs])
    return float(every.min()), float(np.ptp(every))


def _last(runs: list[Run]) -> float:
    return float(runs[-1].age[-1])


@effect("second-lag", "temperature")
def second_lag(runs: list[Run], rng: Rng) -> Shape:
    """A mass on the stem, or diffusion into a slab: lags τ/(2 (m − ½)²) of weight 1/(m − ½)², m = 1 … 6."""
    tau = rng.uniform(3, 8) * 1800
    if rng.random() < 0.5:
        return [lag(r.stem, tau) - r.mode for r in runs]
    order = (np.arange(1, 7) - 0.5) ** 2
    weight = (1 / order) / np.sum(1 / order)
    return [sum(w * lag(r.stem, 2 * tau / (4 * k)) for w, k in zip(weight, order, strict=True)) - r.mode for r in runs]


@effect("rate-bias", "bias")
def rate_bias(runs: list[Run], rng: Rng) -> Shape:
    """Gradient along the shell, q = dT/dt behind a short lag of its own, with a small loss of symmetry."""
    tau, skew = rng.uniform(20, 90), rng.uniform(0, 0.08)
    return [lag(q := np.gradient(r.mode, STEP_S) * 60, tau) + skew * q * np.tanh(q) for r in runs]


@effect("hysteresis", "bias", "frequency", needs=("returns",))
def hysteresis(runs: list[Run], rng: Rng) -> Shape:
    """Bouc–Wen, relays of Preisach over the half plane, or plays of spread width; memory lasts over the runs."""
    low, span = _span(runs)
    kind = rng.integers(0, 3)
    drive = [(r.mode - low) / span for r in runs]
    if kind == 0:
        width, beta = rng.uniform(0.05, 0.2), rng.uniform(0.5, 0.9)
        out, z = [], 0.0
        for x in drive:
            loop = np.empty(len(x))
            for i, step in enumerate(np.diff(x, prepend=x[0]) / width):
                z += step * (1 - abs(z) * (beta * np.sign(step * z) + 1 - beta))
                loop[i] = z
            out.append(loop)
        return out
    alpha, gap = rng.uniform(0, 1, 60), rng.gamma(2.0, 0.07, 60)
    state = np.where(alpha > drive[0][0], -1.0, 1.0) if kind == 1 else np.full(60, drive[0][0])
    mass = rng.uniform(0.3, 1, 60)
    out = []
    for x in drive:
        loop = np.empty(len(x))
        for i, value in enumerate(x):
            if kind == 1:
                state = np.where(value > alpha + gap, 1.0, np.where(value < alpha - gap, -1.0, state))
            else:
                state = np.clip(state, value - gap, value + gap)
            loop[i] = mass @ state / 60
        out.append(loop)
    return out


@effect("ageing", "frequency", needs=("starts",))
def ageing(runs: list[Run], rng: Rng) -> Shape:
    """Logarithm, stretched exponential or two exponentials of the time since the first run."""
    kind, total = rng.integers(0, 3), _last(runs)
    tau = total * rng.uniform(0.05, 0.4)
    if kind == 0:
        return [np.log1p(r.age / tau) for r in runs]
    if kind == 1:
        power = rng.uniform(0.4, 0.8)
        return [1 - np.exp(-((r.age / tau) ** power)) for r in runs]
    return [1.6 - np.exp(-r.age / tau) - 0.6 * np.exp(-r.age / (6 * tau)) for r in runs]


@effect("jump", "frequency", "bias")
def jump(runs: list[Run], rng: Rng) -> Shape:
    """A step within a run that relaxes by a third and stays in the runs after it."""
    which = int(rng.integers(0, len(runs)))
    when = runs[which].start + rng.uniform(0.25, 0.75) * runs[which].time[-1]
    part, tau = rng.uniform(0, 0.35), rng.uniform(300, 3000)
    return [np.where(r.age >= when, 1 - part + part * np.exp(-np.clip(r.age - when, 0, None) / tau), 0.0) for r in runs]


@effect("activity-dip", "frequency", needs=("returns",))
def activity_dip(runs: list[Run], rng: Rng) -> Shape:
    """Two frequencies that cross and repel, f = mean ± √(δ² + κ²), or a Lorentzian."""
    low, span = _span(runs)
    centre, width = low + rng.uniform(0.3, 0.7) * span, rng.uniform(0.02, 0.06) * span
    x = [(r.mode - centre) / width for r in runs]
    if rng.random() < 0.5:
        return [np.sign(v) * np.sqrt(v**2 + 1) - v for v in x]
    return [-1 / (1 + v**2) for v in x]


@effect("electrostatic-softening", "frequency", needs=("electrode_bias_V",))
def softening(runs: list[Run], rng: Rng) -> Shape:
    """Parallel plates near pull-in: f √(1 − v²/(1 − v²/9)) − f, v against a pull-in far away."""
    pull = rng.uniform(250, 500)
    return [-((v := r.drive["electrode_bias_V"] / pull) ** 2) / (1 - v**2) for r in runs]


@effect("amplitude-frequency", "frequency", needs=("drive_amplitude_V",))
def amplitude_frequency(runs: list[Run], rng: Rng) -> Shape:
    """Backbone of a hardening spring beyond Duffing: √(1 + c A²) − 1, of either sign."""
    c, sign = rng.uniform(0.02, 0.3), rng.choice([-1.0, 1.0])
    return [sign * (np.sqrt(1 + c * r.drive["drive_amplitude_V"] ** 2) - 1) for r in runs]


@effect("curvature", "frequency", needs=("returns",))
def curvature(runs: list[Run], rng: Rng) -> Shape:
    """A knee (softened) or a tanh in the law."""
    low, span = _span(runs)
    centre, width = low + rng.uniform(0.3, 0.7) * span, rng.uniform(0.08, 0.25) * span
    if rng.random() < 0.5:
        return [np.logaddexp(0, (r.mode - centre) / (0.4 * width)) for r in runs]
    return [np.tanh((r.mode - centre) / width) for r in runs]


@effect("cross-damping", "bias", needs=("returns",))
def cross_damping(runs: list[Run], rng: Rng) -> Shape:
    """A steep tanh, or a Chebyshev polynomial of degree 5 to 7 over the range, behind a lag of seconds."""
    low, span = _span(runs)
    tau = rng.uniform(5, 40)
    x = [2 * (lag(r.mode, tau) - low) / span - 1 for r in runs]
    if rng.random() < 0.5:
        centre, steep = rng.uniform(-0.4, 0.4), rng.uniform(4, 9)
        return [np.tanh(steep * (v - centre)) for v in x]
    mix = np.zeros(8)
    mix[5:] = rng.normal(0, [1, 0.5, 0.3])
    return [np.polynomial.chebyshev.chebval(np.clip(v, -1, 1), mix) for v in x]


@effect("self-heating", "temperature", needs=("drive_amplitude_V",))
def self_heating(runs: list[Run], rng: Rng) -> Shape:
    """Drive power A² heats the shell at once a little, through the mount more."""
    share, slow = rng.uniform(0.3, 0.7), rng.uniform(900, 2500)
    return [share * lag(p := r.drive["drive_amplitude_V"] ** 2, 200.0) + (1 - share) * lag(p, slow) for r in runs]


@effect("loss-peak", "inverse_q", needs=("returns",))
def loss_peak(runs: list[Run], rng: Rng) -> Shape:
    """Debye: ωτ/(1 + ω²τ²), τ = τ₀ exp(E/kT), its top inside the range."""
    low, span = _span(runs)
    top, energy = low + rng.uniform(0.25, 0.75) * span + KELVIN, rng.uniform(0.5, 1.0) / 8.617e-5
    return [1 / np.cosh(energy * (1 / (r.mode + KELVIN) - 1 / top)) for r in runs]


@effect("leak", "inverse_q", needs=("starts",))
def leak(runs: list[Run], rng: Rng) -> Shape:
    """Gas damping p/√T, the pressure rising to the outside's: p = 1 − exp(−t/τ)."""
    tau = _last(runs) * rng.uniform(0.4, 3)
    return [-np.expm1(-r.age / tau) / np.sqrt((r.mode + KELVIN) / 293.15) for r in runs]


@effect("periodic", "bias", "frequency")
def periodic(runs: list[Run], rng: Rng) -> Shape:
    """A line with harmonics (tanh of a sine, or a rounded saw), in some with a new phase in every run."""
    period = np.exp(rng.uniform(np.log(400), np.log(2500)))
    phase = rng.uniform(0, 2 * np.pi, len(runs) if rng.random() < 0.5 else 1)
    saw, hard = rng.random() < 0.5, rng.uniform(0.5, 2.5)
    out = []
    for r in runs:
        angle = 2 * np.pi * (r.age if len(phase) == 1 else r.time) / period + phase[r.index % len(phase)]
        out.append(np.arctan2(0.7 * np.sin(angle), 1 - 0.7 * np.cos(angle)) if saw else np.tanh(hard * np.sin(angle)))
    return out


@effect("radiation", "temperature")
def radiation(runs: list[Run], rng: Rng) -> Shape:
    """The part of T⁴ exchange that a constant conductance misses, to first order in its share of the mount's heat."""
    out = []
    for r in runs:
        tau = r.main_s
        h, m = r.housing + KELVIN, r.mode + KELVIN
        excess = (h**4 - m**4) / (4 * 293.15**3) - (h - m)
        out.append(lag(excess, tau, 0.0))
    return out


@effect("clock-drift", "clock", needs=("reference", "starts"))
def clock_drift(runs: list[Run], rng: Rng) -> Shape:
    """The clock's crystal: warm-up in every run and a straight drift."""
    total, warm = _last(runs), rng.uniform(600, 3000)
    size = rng.uniform(0.1, 0.5)
    return [r.age / total - size * np.exp(-r.time / warm) for r in runs]


@effect("quadrature-leakage", "bias", needs=("quadrature_V",))
def quadrature_leakage(runs: list[Run], rng: Rng) -> Shape:
    """Quadrature times the sine of a demodulation phase that turns a little with temperature."""
    phase, turn = rng.uniform(0.3, 0.8), rng.uniform(-0.003, 0.003)
    return [r.drive["quadrature_V"] * np.sin(phase + turn * (r.mode - 20)) for r in runs]


@effect("axis-rotation", "bias", needs=("pattern_angle_deg",))
def axis_rotation(runs: list[Run], rng: Rng) -> Shape:
    """Damping anisotropy sin 4(θ − θ_τ), its axis θ_τ turned by temperature."""
    axis, turn = rng.uniform(0, 90), rng.uniform(0.1, 0.4) * rng.choice([-1.0, 1.0])
    return [np.sin(4 * np.deg2rad(r.drive["pattern_angle_deg"] - axis - turn * (r.mode - 20))) for r in runs]


@effect("thermometer-scale", "reading", needs=("returns",))
def thermometer_scale(runs: list[Run], rng: Rng) -> Shape:
    """The housing sensor's scale: a new one for some runs, or (one run) an S-shaped linearisation error."""
    if len(runs) > 1:
        change = np.zeros(len(runs))
        change[int(rng.integers(1, len(runs))) :] = 1.0
        return [c * (r.housing - 20) * (1 + 0.001 * (r.housing - 20)) for c, r in zip(change, runs, strict=True)]
    return [10 * np.sin((r.housing - 10) / 18) for r in runs]


@effect("mounting-stress", "frequency")
def mounting_stress(runs: list[Run], rng: Rng) -> Shape:
    """Joint between housing and stem: strain from their difference, in part relaxing, softening when large."""
    tau, part, knee = rng.uniform(900, 4000), rng.uniform(0.2, 0.6), rng.uniform(15, 50)
    out = []
    for r in runs:
        strain = r.housing - r.mode
        out.append(knee * np.tanh((strain - part * lag(strain, tau)) / knee))
    return out


JUDGED = tuple(EFFECTS)
"""Effects that a seed of mixed campaigns draws from; those below came later and leave its campaigns as they were."""


@effect("thermometer-lag", "reading")
def thermometer_lag(runs: list[Run], rng: Rng) -> Shape:
    """A sensor behind the housing by a short lag, in some with a slower part of its own: glue beside a bead."""
    tau, share = rng.uniform(40, 120), rng.uniform(0, 0.2)
    return [(1 - share) * lag(r.housing, tau) + share * lag(r.housing, 3 * tau) - r.housing for r in runs]


@effect("clock-offset", "reading")
def clock_offset(runs: list[Run], rng: Rng) -> Shape:
    """The thermometer of one run is logged by a clock of its own, a minute or two off."""
    late, offset = int(rng.integers(0, len(runs))), rng.uniform(30, 120) * rng.choice([-1.0, 1.0])
    return [np.interp(r.time - (r.index == late) * offset, r.time, r.housing) - r.housing for r in runs]


@effect("rate-frequency", "frequency")
def rate_frequency(runs: list[Run], rng: Rng) -> Shape:
    """A gradient across the shell, dT/dt behind a lag of seconds, shifts its frequency: dynamic temperature coefficient."""
    tau = rng.uniform(5, 40)
    return [60 * np.gradient(lag(r.mode, tau), STEP_S) for r in runs]
