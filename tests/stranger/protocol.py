"""What is done to the device: chamber schedules, drive columns, sampling."""

from dataclasses import dataclass, field

import numpy as np

from tests.stranger.network import STEP_S

PROTOCOLS = ("paper-step", "steps", "ramp", "cycles", "soak", "far")


@dataclass
class Run:
    """One run on the grid (10 s): `time`, temperatures in °C, `drive` columns; `start` in s since the first run."""

    time: np.ndarray
    chamber: np.ndarray
    start: float
    index: int
    housing: np.ndarray = field(default_factory=lambda: np.zeros(0))
    mode: np.ndarray = field(default_factory=lambda: np.zeros(0))
    stem: np.ndarray = field(default_factory=lambda: np.zeros(0))
    start_offset: float = 0.0
    main_s: float = 1000.0  # the device's slow lag
    drive: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def age(self) -> np.ndarray:
        return self.start + self.time


def draw_runs(rng: np.random.Generator, protocol: str, count: int) -> list[Run]:
    runs, start = [], 0.0
    for index in range(count):
        time, chamber = _schedule(rng, protocol)
        runs.append(Run(time, chamber, start, index, start_offset=rng.normal(0, 0.4)))
        gap = rng.uniform(20, 60) * 86400 if protocol == "far" else rng.uniform(2, 40) * 3600
        start += time[-1] + gap
    return runs


def _schedule(rng: np.random.Generator, protocol: str) -> tuple[np.ndarray, np.ndarray]:
    room, cold, hot = rng.uniform(19, 25), rng.uniform(-30, 5), rng.uniform(38, 55)
    if protocol == "paper-step":
        target = cold if rng.random() < 0.5 else hot
        points = [(0, room), (rng.uniform(60, 900), room), (60, target), (18000, target)]
    elif protocol == "steps":
        levels = rng.permutation(np.linspace(cold, hot, rng.integers(3, 5)))
        points = [(0, room)]
        for level in levels:
            points += [(180, level), (rng.uniform(5000, 9000), level)]
    elif protocol == "ramp":
        rate = rng.uniform(0.3, 1.0) / 60
        points = [(0, room), (1200, room)]
        for level in (hot, cold, room) if rng.random() < 0.5 else (cold, hot, room):
            points += [(abs(level - points[-1][1]) / rate, level), (rng.uniform(1800, 5400), level)]
    elif protocol == "cycles":
        period = rng.uniform(5400, 10800)
        points = [(0, room)]
        for _ in range(int(rng.integers(2, 5))):
            points += [(period * 0.3, hot), (period * 0.2, hot), (period * 0.3, cold), (period * 0.2, cold)]
    else:  # soak, far: long rests at a few levels near each other
        points = [(0, room), (3600, room)]
        for _ in range(3):
            points += [(600, rng.uniform(cold, hot))]
            points += [(rng.uniform(6000, 9000), points[-1][1])]
    when = np.cumsum([p[0] for p in points])
    time = np.arange(0, min(when[-1], 12 * 3600) + 1, STEP_S)
    return time, np.interp(time, when, [p[1] for p in points])


def _levels(rng: np.random.Generator, time: np.ndarray, low: float, high: float) -> np.ndarray:
    """A drive held at levels for 20 to 80 minutes each."""
    edges = np.cumsum(rng.uniform(1200, 4800, 60))
    return np.round(rng.uniform(low, high, 61), 3)[np.searchsorted(edges, time)]


DRIVE = {
    "drive_amplitude_V": (0.6, 1.6),
    "electrode_bias_V": (40.0, 110.0),
    "quadrature_V": (-2.0, 2.0),
    "pattern_angle_deg": (0.0, 90.0),
}


def add_drive(rng: np.random.Generator, runs: list[Run], varied: set[str], shown: set[str]) -> None:
    for name, (low, high) in DRIVE.items():
        hold = round(rng.uniform(low, high), 3)
        for run in runs:
            if name in varied:
                run.drive[name] = _levels(rng, run.time, low, high)
            elif name in shown:
                run.drive[name] = np.full(len(run.time), hold)


def sample_times(rng: np.random.Generator, runs: list[Run], dt: float, holes: bool) -> list[np.ndarray]:
    """Rows with holes, in some with a jitter of the clock of the logger."""
    out, jitter = [], rng.random() < 0.3
    for run in runs:
        time = np.arange(0, run.time[-1], dt)
        if jitter:
            time[1:] += rng.uniform(-0.2, 0.2, len(time) - 1) * dt
        keep = np.ones(len(time), bool)
        for _ in range(rng.poisson(0.7) if holes else 0):
            begin = rng.uniform(0.05, 0.9) * time[-1]
            keep &= ~((time > begin) & (time < begin + rng.uniform(60, 1500)))
        out.append(np.round(time[keep], 3))
    return out
