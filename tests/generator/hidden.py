"""The effects that the virtual gyro may hide, each by its own formula, and aliens that no library knows."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from tests.generator.thermal_twin import STEP, follow, preisach


@dataclass
class Piece:
    """One hidden effect of unit size."""

    name: str
    channel: str
    signals: dict | None = None
    heat: Any = None
    sensor: Any = None
    sensor_runs: tuple | None = None
    start: float = 1.0
    most: float = 1e9
    linear: bool = True
    parameters: dict = field(default_factory=dict)


def quadrature(time, temperature, rng):
    """Quadrature control: a trend with temperature and slow wandering."""
    wander = np.interp(time, np.linspace(0, time[-1], 14), np.cumsum(rng.normal(0, 0.15, 14)))
    return 1.0 + 0.01 * (temperature - 20.0) + wander


def _sign(rng):
    return float(rng.choice([-1.0, 1.0]))


def second_lag(w):
    ratio = w.rng.uniform(2.5, 7.0) if w.rng.random() < 0.7 else w.rng.uniform(0.12, 0.3)
    tau = w.device.contact * ratio
    return Piece(
        "second-lag",
        "frequency_Hz",
        heat=lambda h, s: replace(h, side=(min(abs(s), 0.6), tau)),
        start=0.05,
        most=0.6,
        linear=False,
        parameters={"time": tau},
    )


def radiation(w):
    return Piece(
        "radiation",
        "frequency_Hz",
        heat=lambda h, s: replace(h, radiated=min(abs(s), 1.0)),
        start=0.1,
        most=1.0,
        linear=False,
    )


def self_heating(w):
    return Piece("self-heating", "frequency_Hz", heat=lambda h, s: replace(h, heating=s), start=0.1, linear=False)


def thermometer_scale(w):
    skew = w.rng.uniform(-0.5, 0.5)
    return Piece(
        "thermometer-scale",
        "frequency_Hz",
        sensor=lambda t, s: t + s * (((t - 12) / 30) ** 3 + skew * ((t - 12) / 30) ** 2),
        start=0.05,
        linear=False,
    )


def _loop(w, channel):
    width = w.rng.uniform(0.8, 6.0)
    return Piece(
        "hysteresis",
        channel,
        {channel: [preisach(t, width, w.rng) for t in w.temperature]},
        start=_sign(w.rng) * 0.1,
        parameters={"width": width},
    )


def hysteresis(w):
    return _loop(w, "bias_deg_per_h")


def rate_bias(w):
    return Piece(
        "rate-bias",
        "bias_deg_per_h",
        {"bias_deg_per_h": [np.gradient(t, STEP) * 1e3 for t in w.temperature]},
        start=_sign(w.rng) * 0.1,
    )


def _ageing(w, channel):
    total = w.campaign[-1][-1]
    onset = float(np.exp(w.rng.uniform(np.log(1800), np.log(total / 2))))
    kind = w.rng.choice(["log", "exp"])
    shape = (lambda t: np.log1p(t / onset)) if kind == "log" else (lambda t: 1 - np.exp(-t / (3 * onset)))
    return Piece(
        "ageing",
        channel,
        {channel: [shape(t) for t in w.campaign]},
        start=_sign(w.rng) * 0.01,
        parameters={"onset": onset, "kind": str(kind)},
    )


def ageing(w):
    return _ageing(w, "frequency_Hz")


def ageing_bias(w):
    onset = float(np.exp(w.rng.uniform(np.log(600), np.log(8000))))
    return Piece(
        "ageing",
        "bias_deg_per_h",
        {"bias_deg_per_h": [np.log1p(t / onset) for t in w.campaign]},
        start=_sign(w.rng) * 0.01,
        parameters={"onset": onset},
    )


def clock_drift(w):
    return Piece("clock-drift", "frequency_Hz", {"frequency_Hz": [w.device.f0 * 1e-9 * t / 86400 for t in w.campaign]})


def _jump(w, channel, lasting):
    run = int(w.rng.integers(len(w.time)))
    when = w.rng.uniform(0.15, 0.85) * w.time[run][-1]
    out = []
    for k, t in enumerate(w.time):
        out.append(0.5 * (1 + np.tanh((t - when) / 4.0)) if k == run else np.full(t.size, float(lasting and k > run)))
    return Piece("jump", channel, {channel: out}, start=_sign(w.rng) * 0.01, parameters={"run": run, "time": when})


def jump(w):
    return _jump(w, "frequency_Hz", bool(w.rng.random() < 0.5))


def jump_bias(w):
    return _jump(w, "bias_deg_per_h", False)


def activity_dip(w):
    low, high = min(t.min() for t in w.temperature), max(t.max() for t in w.temperature)
    centre = w.rng.uniform(low + 0.2 * (high - low), low + 0.8 * (high - low))
    width = w.rng.uniform(0.4, 1.6)
    frequency, loss = [], []
    for t in w.temperature:
        # two coupled damped modes: the eigenvalue of the working one, to all orders
        detune = (t - centre) / width
        g = 0.2
        root = np.sqrt((0.5 * (detune - 1j)) ** 2 + g**2 + 0j)
        root = np.where(root.real * detune < 0, -root, root)
        shift = 0.5 * (detune - 1j) - root
        frequency.append(-shift.real)
        loss.append(-shift.imag)
    scale = w.device.sigma["inverse_q"] / w.device.sigma["frequency_Hz"]
    scale *= -np.sign(sum(float(np.sum(q)) for q in loss)) * -1.0
    return Piece(
        "activity-dip",
        "frequency_Hz",
        {"frequency_Hz": frequency, "inverse_q": [scale * q for q in loss]},
        start=0.1,
        parameters={"centre": centre, "width": width},
    )


def softening(w):
    return Piece(
        "electrostatic-softening",
        "frequency_Hz",
        {"frequency_Hz": [w.device.f0 * (np.sqrt(1 - 2e-9 * v**2) - 1) for v in w.volts]},
    )


def amplitude_frequency(w):
    return Piece(
        "amplitude-frequency",
        "frequency_Hz",
        {"frequency_Hz": [w.device.f0 * 1e-7 * a**2 for a in w.drive]},
        start=_sign(w.rng),
    )


def curvature(w):
    quartic = w.rng.uniform(-0.2, 0.2)
    return Piece(
        "curvature",
        "frequency_Hz",
        {"frequency_Hz": [((t - 20) / 30) ** 3 + quartic * ((t - 20) / 30) ** 4 for t in w.temperature]},
        start=_sign(w.rng) * 0.01,
    )


def cross_damping(w):
    fifth = w.rng.uniform(-0.2, 0.2)
    return Piece(
        "cross-damping",
        "bias_deg_per_h",
        {"bias_deg_per_h": [((t - 20) / 30) ** 4 + fifth * ((t - 20) / 30) ** 5 for t in w.temperature]},
        start=_sign(w.rng),
    )


def leak(w):
    life = 40 * w.campaign[-1][-1]
    return Piece(
        "leak",
        "inverse_q",
        {
            "inverse_q": [
                w.device.loss[0] * (1 - np.exp(-c / life)) * np.sqrt((t + 273.15) / 293.15)
                for c, t in zip(w.campaign, w.temperature, strict=True)
            ]
        },
    )


def loss_peak(w):
    low, high = min(t.min() for t in w.temperature), max(t.max() for t in w.temperature)
    centre = w.rng.uniform(low + 0.15 * (high - low), low + 0.85 * (high - low)) + 273.15
    energy = w.rng.uniform(0.8, 2.2) * 1.602e-19 / 1.381e-23
    out = []
    for t in w.temperature:
        product = np.exp(energy * (1 / (t + 273.15) - 1 / centre))
        out.append(w.device.loss[0] * product / (1 + product**2))
    return Piece("loss-peak", "inverse_q", {"inverse_q": out}, start=0.1, parameters={"centre": centre - 273.15})


def _line(w, channel):
    period = float(np.exp(w.rng.uniform(np.log(900), np.log(9000))))
    phase = w.rng.uniform(0, 2 * np.pi)
    use = w.campaign if w.rng.random() < 0.5 else w.time
    return Piece(
        "periodic",
        channel,
        {channel: [np.sin(2 * np.pi * t / period + phase) for t in use]},
        start=0.01,
        parameters={"period": period},
    )


def periodic(w):
    return _line(w, "bias_deg_per_h")


def quadrature_leakage(w):
    slope = w.rng.uniform(-0.01, 0.01)
    return Piece(
        "quadrature-leakage",
        "bias_deg_per_h",
        {
            "bias_deg_per_h": [
                q * np.sin(0.3 + slope * (t - 20)) for q, t in zip(w.quadrature, w.temperature, strict=True)
            ]
        },
    )


def axis_rotation(w):
    turn = np.radians(_sign(w.rng) * w.rng.uniform(0.08, 0.5))
    start = w.rng.uniform(0, np.pi / 2)
    return Piece(
        "axis-rotation",
        "bias_deg_per_h",
        {
            "bias_deg_per_h": [
                np.sin(4 * (a - start - turn * (t - 20))) for a, t in zip(w.angle, w.temperature, strict=True)
            ]
        },
    )


def mounting_stress(w):
    relax = w.device.contact * w.rng.uniform(1.0, 5.0)
    out = []
    for t in w.temperature:
        strain = follow(t, relax)
        out.append(t - strain)
    return Piece(
        "mounting-stress", "frequency_Hz", {"frequency_Hz": out}, start=_sign(w.rng) * 1e-3, parameters={"relax": relax}
    )


def thermometer_lag(w):
    return Piece(
        "thermometer-lag",
        "frequency_Hz",
        sensor=lambda t, s: follow(t, max(abs(s), 1.0)),
        start=30.0,
        most=600.0,
        linear=False,
    )


def rate_frequency(w):
    return Piece(
        "rate-frequency",
        "frequency_Hz",
        {"frequency_Hz": [np.gradient(t, STEP) * 1e3 for t in w.temperature]},
        start=_sign(w.rng) * 0.01,
    )


def clock_offset(w):
    run = int(w.rng.integers(len(w.time)))
    grid = w.time[run]
    return Piece(
        "clock-offset",
        "frequency_Hz",
        sensor=lambda t, s: np.interp(grid - s, grid, t),
        sensor_runs=(run,),
        start=_sign(w.rng) * 10.0,
        most=200.0,
        linear=False,
        parameters={"run": run},
    )


EFFECTS = {
    "thermometer-lag": thermometer_lag,
    "rate-frequency": rate_frequency,
    "clock-offset": clock_offset,
    "second-lag": second_lag,
    "rate-bias": rate_bias,
    "hysteresis": hysteresis,
    "ageing": ageing,
    "jump": jump,
    "activity-dip": activity_dip,
    "electrostatic-softening": softening,
    "amplitude-frequency": amplitude_frequency,
    "curvature": curvature,
    "cross-damping": cross_damping,
    "self-heating": self_heating,
    "loss-peak": loss_peak,
    "leak": leak,
    "periodic": periodic,
    "radiation": radiation,
    "clock-drift": clock_drift,
    "quadrature-leakage": quadrature_leakage,
    "axis-rotation": axis_rotation,
    "thermometer-scale": thermometer_scale,
    "mounting-stress": mounting_stress,
    "ageing@bias": ageing_bias,
    "jump@bias": jump_bias,
}


def _alien(name, channel, make):
    def piece(w):
        return Piece(name, channel, {channel: make(w)}, start=_sign(w.rng) * 0.1)

    return piece


def _bump(w):
    low, high = min(t.min() for t in w.temperature), max(t.max() for t in w.temperature)
    centre = w.rng.uniform(low + 0.25 * (high - low), low + 0.75 * (high - low))
    width = w.rng.uniform(1.0, 3.0)
    return [np.exp(-0.5 * ((t - centre) / width) ** 2) for t in w.temperature]


def _bump_train(w):
    pitch = w.rng.uniform(6, 11)
    return [np.cos(2 * np.pi * t / pitch) for t in w.temperature]


def _chirp(w):
    fast, slow = w.rng.uniform(6, 10), w.rng.uniform(1, 2)
    return [np.sin(2 * np.pi * (slow * (t / t[-1]) + 0.5 * (fast - slow) * (t / t[-1]) ** 2)) for t in w.time]


def _rate_square(w):
    return [np.gradient(t, STEP) ** 2 * 1e6 for t in w.temperature]


def _kink(w):
    low, high = min(t.min() for t in w.temperature), max(t.max() for t in w.temperature)
    corner = w.rng.uniform(low + 0.5 * (high - low), low + 0.7 * (high - low))
    return [np.maximum(t - corner, 0.0) for t in w.temperature]


def _volt_temperature(w):
    return [(v / 80) ** 2 * (t - 12) / 30 for v, t in zip(w.volts, w.temperature, strict=True)]


def _amplitude_temperature(w):
    return [a**2 * (t - 12) / 30 for a, t in zip(w.drive, w.temperature, strict=True)]


def _bursts(w):
    return [
        np.convolve((w.rng.random(t.size) < 8 / t.size) * w.rng.normal(0, 1, t.size), np.exp(-np.arange(400) / 80.0))[
            : t.size
        ]
        for t in w.time
    ]


def _drift(w):
    return [np.interp(t, np.linspace(0, t[-1], 7), np.cumsum(w.rng.normal(0, 1, 7))) for t in w.time]


ALIENS = {
    "volt-temperature": _alien("volt-temperature", "frequency_Hz", _volt_temperature),
    "amplitude-temperature@bias": _alien("amplitude-temperature@bias", "bias_deg_per_h", _amplitude_temperature),
    "bump": _alien("bump", "frequency_Hz", _bump),
    "bump@bias": _alien("bump@bias", "bias_deg_per_h", _bump),
    "fringes@bias": _alien("fringes@bias", "bias_deg_per_h", _bump_train),
    "chirp@bias": _alien("chirp@bias", "bias_deg_per_h", _chirp),
    "chirp": _alien("chirp", "frequency_Hz", _chirp),
    "rate-square@bias": _alien("rate-square@bias", "bias_deg_per_h", _rate_square),
    "kink@bias": _alien("kink@bias", "bias_deg_per_h", _kink),
    "volts@loss": _alien("volts@loss", "inverse_q", lambda w: [(v / 80) ** 2 for v in w.volts]),
}
NOISY_ALIENS = {
    "bursts@bias": _alien("bursts@bias", "bias_deg_per_h", _bursts),
    "drift@bias": _alien("drift@bias", "bias_deg_per_h", _drift),
}
ALIENS_ALL = {**ALIENS, **NOISY_ALIENS}
ALIENS = ALIENS_ALL


def possible(name, design):
    """Whether a design, or its first runs ("rich/2"), can show an effect at all: its drives must vary."""
    from tests.generator.device import first_runs

    plan = first_runs(design)

    def varies(drive):
        return plan[drive] is not None and any(np.ptp(v) > 0 for v in plan[drive] if v is not None)

    if "volt" in name or name == "electrostatic-softening":
        return varies("volts")
    if "amplitude" in name or name == "self-heating":
        return varies("drives")
    if name == "axis-rotation":
        return plan["angles"] is not None and len(set(plan["angles"])) > 1
    return name != "clock-offset" or len(plan["chambers"]) > 1
