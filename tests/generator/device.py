"""A virtual gyro in a chamber, with one hidden effect, or an alien one, or none. Knows nothing of the diagnosis."""

import datetime
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import minimize_scalar

from studies.record import Record
from tests.generator import hidden, noises
from tests.generator.designs import DESIGNS
from tests.generator.thermal_twin import STEP, Heat, chamber_to_housing, follow, resonator

CHANNELS = ("frequency_Hz", "bias_deg_per_h", "inverse_q")


@dataclass
class Truth:
    """What was hidden."""

    design: str
    family: str
    effects: tuple[str, ...] = ()
    alien: str = ""
    snr: float = 0.0
    channel: str = ""
    parameters: dict = field(default_factory=dict)
    noise: dict = field(default_factory=dict)
    levels: dict = field(default_factory=dict)
    alone: list = field(default_factory=list)
    """For every effect its channel and the records with it alone, without and with the noise of the responses."""
    twin: object = None


@dataclass
class Device:
    """Random physics of one gyro."""

    f0: float
    slope: float
    bend: float
    contact: float
    housing: float
    bias: tuple
    loss: tuple
    sigma: dict
    spread: float
    sensor: float

    @classmethod
    def draw(cls, rng):
        f0 = rng.uniform(3500, 8000)
        slope = f0 * rng.uniform(65e-6, 90e-6)
        bias1 = rng.choice([-1, 1]) * rng.uniform(0.05, 0.4)
        q0 = 10 ** rng.uniform(-7.3, -6.3)
        return cls(
            f0,
            slope,
            -f0 * rng.uniform(0.05e-6, 0.12e-6),
            float(np.exp(rng.uniform(np.log(1200), np.log(4500)))),
            rng.uniform(300, 900),
            (bias1, bias1 * rng.uniform(-0.01, 0.01), bias1 * rng.uniform(-1e-4, 1e-4)),
            (q0, q0 * rng.uniform(-2e-3, 4e-3), q0 * rng.uniform(-2e-5, 4e-5)),
            {
                "frequency_Hz": rng.uniform(0.004, 0.02),
                "bias_deg_per_h": rng.uniform(0.05, 0.3),
                "inverse_q": q0 * rng.uniform(0.003, 0.02),
            },
            rng.uniform(2.0, 8.0),
            rng.uniform(1.0, 4.0),
        )


@dataclass
class World:
    """Everything that an effect may look at, one entry a run, on the 5 s grid."""

    device: Device
    time: list
    campaign: list
    housing: list
    temperature: list
    tilt: list
    volts: list
    drive: list
    angle: list
    quadrature: list
    rng: np.random.Generator
    has_volts: bool
    has_drive: bool
    has_angle: bool


class Memory:
    """A random generator that remembers what it drew, by method, and first says again what it is told."""

    def __init__(self, rng, said=None):
        self.rng, self.drawn = rng, {}
        self.said = {name: list(values) for name, values in (said or {}).items()}

    def __getattr__(self, name):
        def draw(*arguments, **options):
            told = self.said.get(name)
            value = told.pop(0) if told else getattr(self.rng, name)(*arguments, **options)
            self.drawn.setdefault(name, []).append(value)
            return value

        return draw


@dataclass
class Twin:
    """A gyro whose campaign can go on: everything that its first runs have fixed."""

    world: World
    hidden: tuple
    sizes: list
    drawn: dict
    family: str
    levels: dict
    begin: list


def run_heat(plan, device, rng, heat=None, starts=None):
    """Chamber to housing to resonator, every run."""
    heat = heat or Heat(device.contact, device.spread)
    housing, mean, tilt = [], [], []
    for k, chamber in enumerate(plan["chambers"]):
        shell = chamber_to_housing(chamber, device.housing, chamber[0])
        drive = plan["drives"][k] if plan["drives"] else None
        power = None if drive is None else drive**2
        if power is None and heat.heating:
            power = np.ones_like(chamber)
        m, t = resonator(shell, heat, power, start_offset=starts[k])
        housing.append(shell)
        mean.append(m)
        tilt.append(t)
    return housing, mean, tilt


def build(design, family, rng, effects=(), alien="", snr=0.0):
    """Return (records, truth): a campaign with the named effects at the stated SNR each.

    `design` is a name, a name with the number of its first runs ("rich/2"), or a design of its own.
    """
    device = Device.draw(rng)
    plan = design if isinstance(design, dict) else first_runs(design)
    runs = len(plan["chambers"])
    starts = rng.normal(0.0, 0.3, runs)
    housing, plain, tilt = run_heat(plan, device, rng, None, starts)
    time = [STEP * np.arange(c.size) for c in plan["chambers"]]
    begin = np.cumsum([plan["gaps"][k] * 3600.0 + (time[k - 1][-1] if k else 0.0) for k in range(runs)])
    sample = [_jittered(t, rng) for t in time]
    sample = [_incomplete(s, rng) for s in sample]
    angle = [np.full(t.size, np.radians(plan["angles"][k])) if plan["angles"] else None for k, t in enumerate(time)]
    quad = [hidden.quadrature(t, p, rng) for t, p in zip(time, plain, strict=True)]
    world = World(
        device,
        time,
        [t + b for t, b in zip(time, begin, strict=True)],
        housing,
        plain,
        tilt,
        [
            np.full(t.size, 80.0) if not plan["volts"] or plan["volts"][k] is None else plan["volts"][k]
            for k, t in enumerate(time)
        ],
        [
            np.full(t.size, 1.0) if not plan["drives"] or plan["drives"][k] is None else plan["drives"][k]
            for k, t in enumerate(time)
        ],
        angle,
        quad,
        Memory(rng),
        plan["volts"] is not None,
        plan["drives"] is not None,
        plan["angles"] is not None,
    )
    noise, levels = {}, {}
    for c in CHANNELS:
        levels[c] = noises.draw_level(family, rng)
        noise[c] = [device.sigma[c] * noises.draw(family, s, levels[c], rng) for s in sample]
    offsets = rng.normal(0.0, 5.0 * device.sigma["bias_deg_per_h"], runs)
    pieces = [hidden.EFFECTS[name](world) for name in effects] + ([hidden.ALIENS[alien](world)] if alien else [])
    truth = Truth("own" if isinstance(design, dict) else design, family, tuple(effects), alien, snr)
    sizes = []
    for piece in pieces:
        size = _size(piece, world, plan, device, starts, sample, noise, snr)
        sizes.append(size)
        truth.parameters[piece.name] = {**piece.parameters, "size": size}
        truth.channel = piece.channel
    responses, sensed = _responses(pieces, sizes, world, plan, device, starts)
    records = []
    for k in range(runs):
        own = {c: noise[c][k] for c in CHANNELS}
        path = f"run{k + 1}.csv"
        records.append(_record(world, k, sample[k], responses, sensed, own, offsets[k], begin[k], rng, path))
    silent = {c: [np.zeros(s.size) for s in sample] for c in CHANNELS}
    for piece, size in zip(pieces, sizes, strict=True):
        own, read = _responses([piece], [size], world, plan, device, starts)
        both = [
            [
                _record(
                    world,
                    k,
                    sample[k],
                    own,
                    read,
                    {c: part[c][k] for c in CHANNELS},
                    offsets[k],
                    begin[k],
                    np.random.default_rng(k),
                    "",
                )
                for k in range(runs)
            ]
            for part in (silent, noise)
        ]
        truth.alone.append((piece.channel, *both))
    truth.levels = {c: (device.sigma[c], levels[c]) for c in CHANNELS}
    truth.twin = Twin(world, (tuple(effects), alien), sizes, world.rng.drawn, family, levels, list(begin))
    for c in CHANNELS:
        truth.noise[c] = float(np.sqrt(np.mean(np.concatenate(noise[c]) ** 2)))
    return records, truth


def first_runs(design):
    """Return a design by name, or its first runs: "rich/2"."""
    name, _, count = design.partition("/")
    plan = DESIGNS[name]
    return {key: None if value is None else value[: int(count)] for key, value in plan.items()} if count else plan


def add_run(twin, chamber, rng, volts=None, drive=None, angle=None, gap=16.0):
    """Return the record of one more run of the same gyro with the same hidden effect, `gap` hours after the last.

    `chamber`, °C, and the drives are on the 5 s grid; a drive that is None stays at its nominal value.
    """
    world, device = twin.world, twin.world.device
    last = len(world.time) - 1
    time = STEP * np.arange(chamber.size)
    begin = twin.begin[last] + world.time[last][-1] + 3600.0 * gap
    start = [float(rng.normal(0.0, 0.3))]
    plan = {"chambers": [chamber], "drives": [drive] if world.has_drive else None}
    housing, plain, tilt = run_heat(plan, device, rng, None, start)
    run = {
        "time": time,
        "campaign": time + begin,
        "housing": housing[0],
        "temperature": plain[0],
        "tilt": tilt[0],
        "volts": np.full(time.size, 80.0) if volts is None else volts,
        "drive": np.full(time.size, 1.0) if drive is None else drive,
        "angle": np.full(time.size, np.radians(angle or 0.0)) if world.has_angle else None,
        "quadrature": hidden.quadrature(time, plain[0], rng),
    }
    s = _incomplete(_jittered(time, rng), rng)
    noise = {c: device.sigma[c] * noises.draw(twin.family, s, twin.levels[c], rng) for c in CHANNELS}
    offset = rng.normal(0.0, 5.0 * device.sigma["bias_deg_per_h"])
    # effects scale some of their numbers by the last run of the campaign: the old last one stays the last
    asked = replace(
        world,
        rng=Memory(rng, twin.drawn),
        **{name: [*getattr(world, name), part, getattr(world, name)[last]] for name, part in run.items()},
    )
    effects, alien = twin.hidden
    pieces = [hidden.EFFECTS[name](asked) for name in effects] + ([hidden.ALIENS[alien](asked)] if alien else [])
    pieces = [
        replace(piece, signals={c: [signal[last + 1]] for c, signal in (piece.signals or {}).items()})
        for piece in pieces
    ]
    alone = replace(world, **{name: [part] for name, part in run.items()})
    responses, sensed = _responses(pieces, twin.sizes, alone, plan, device, start)
    twin.world = replace(world, **{name: [*getattr(world, name), part] for name, part in run.items()})
    twin.begin = [*twin.begin, begin]
    return _record(alone, 0, s, responses, sensed, noise, offset, begin, rng, f"run{last + 2}.csv")


def _jittered(time, rng):
    return np.sort(np.arange(0.0, time[-1] - 5, 10.0) + rng.uniform(-2, 2, int(np.ceil((time[-1] - 5) / 10.0))))


def _incomplete(sample, rng):
    return sample[(rng.random(sample.size) > 0.01) & (sample >= 0)]


def _record(world, k, s, responses, sensed, noise, offset, begin, rng, path):
    """One run as it is recorded."""
    columns = {"time_s": s}
    reading = follow(sensed[k], world.device.sensor)
    columns["housing_temperature_degC"] = (
        0.08 + 1.0006 * np.interp(s, world.time[k], reading) + rng.normal(0.0, 0.003, s.size)
    )
    for c in CHANNELS:
        columns[c] = np.interp(s, world.time[k], responses[c][k]) + noise[c]
    columns["bias_deg_per_h"] += offset
    pick = np.minimum(np.searchsorted(world.time[k], s, side="right") - 1, world.time[k].size - 1)
    if world.has_volts:
        columns["electrode_bias_V"] = world.volts[k][pick]
    if world.has_drive:
        columns["drive_amplitude_V"] = world.drive[k][pick]
    if world.has_angle:
        columns["pattern_angle_deg"] = np.degrees(world.angle[k][pick])
    columns["quadrature_V"] = np.interp(s, world.time[k], world.quadrature[k])
    moment = datetime.datetime(2026, 1, 5, tzinfo=datetime.UTC) + datetime.timedelta(seconds=float(begin))
    return Record(columns, path=path, start=moment)


def _responses(pieces, sizes, world, plan, device, starts):
    """True responses of every run, and what the housing sensor is about to read."""
    heat = Heat(device.contact, device.spread)
    for piece, size in zip(pieces, sizes, strict=True):
        if piece.heat:
            heat = piece.heat(heat, size)
    temperature, _tilt, housing = world.temperature, world.tilt, world.housing
    if any(piece.heat for piece in pieces):
        housing, temperature, _tilt = run_heat(plan, device, world.rng, heat, starts)
    sensed = housing
    out = {c: [] for c in CHANNELS}
    for t in temperature:
        x = t - 20.0
        thermal = device.slope * x + device.bend * x**2
        u = thermal / device.slope
        out["frequency_Hz"].append(device.f0 + thermal)
        out["bias_deg_per_h"].append(device.bias[0] * u + device.bias[1] * u**2 + device.bias[2] * u**3)
        out["inverse_q"].append(device.loss[0] + device.loss[1] * x + device.loss[2] * x**2)
    for piece, size in zip(pieces, sizes, strict=True):
        if piece.sensor:
            faulty = piece.sensor_runs
            sensed = [piece.sensor(h, size) if faulty is None or k in faulty else h for k, h in enumerate(sensed)]
        for channel, signal in (piece.signals or {}).items():
            for k in range(len(temperature)):
                out[channel][k] = out[channel][k] + size * signal[k]
    return out, sensed


def _size(piece, world, plan, device, starts, sample, noise, snr):
    """Size that gives the wanted SNR: what the refitted baseline leaves of the effect over what it leaves of the noise."""
    channel = piece.channel
    size = piece.start
    for _ in range(3):
        with_it, sensed = _responses([piece], [size], world, plan, device, starts)
        left = _baseline_residual(world, with_it, sensed, sample, channel, device)
        size *= float(np.clip(snr * _noise_rms(noise[channel], sample, channel) / max(left, 1e-300), 1e-4, 1e4))
        size = float(np.clip(size, -piece.most, piece.most))
        if piece.linear and _ >= 1:
            break
    return size


def _noise_rms(parts, sample, channel):
    """Noise left by a per-run constant (bias) or a constant: close to the full projection, which has few columns."""
    if channel == "bias_deg_per_h":
        parts = [p - p.mean() for p in parts]
        return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))
    return float(np.std(np.concatenate(parts)))


def _baseline_residual(world, responses, sensed, sample, channel, device, every=24):
    """rms that the contract's baseline cannot absorb, on noise-free data; least squares, its own lag."""
    y = np.concatenate([r[::every] for r in responses[channel]])
    runs = len(sensed)

    def columns(tau):
        rows = []
        for k in range(runs):
            t = world.time[k]
            if channel == "frequency_Hz":
                x = follow_fast(sensed[k], tau)[::every] - 20.0
                own = np.zeros((x.size, runs))
                own[:, k] = np.exp(-t[::every] / tau)
                rows.append(np.column_stack([np.ones_like(x), x / 10, (x / 10) ** 2, own]))
            else:
                f = responses["frequency_Hz"][k][::every]
                u = (f - device.f0) / device.slope / 10
                own = np.zeros((u.size, runs))
                own[:, k] = 1.0
                if channel == "bias_deg_per_h":
                    rows.append(np.column_stack([u, u**2, u**3, own]))
                else:
                    rows.append(np.column_stack([np.ones_like(u), u, u**2]))
        return np.concatenate(rows)

    def left(log_tau):
        a = columns(np.exp(log_tau))
        return float(np.sum((y - a @ np.linalg.lstsq(a, y, rcond=None)[0]) ** 2))

    if channel != "frequency_Hz":
        return float(np.sqrt(left(0.0) / y.size))
    centre = np.log(device.contact)
    found = minimize_scalar(left, bounds=(centre - 1.5, centre + 1.0), method="bounded", options={"xatol": 2e-4})
    return float(np.sqrt(found.fun / y.size))


def follow_fast(drive, tau):
    """Trapezoidal follower by a recursive filter."""
    from scipy.signal import lfilter

    r = STEP / (2 * tau)
    a = (1 - r) / (1 + r)
    b = r / (1 + r)
    out, _ = lfilter([b, b], [1.0, -a], drive, zi=np.array([drive[0] * (1 - b)]))
    return out
