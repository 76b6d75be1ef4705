"""What the loops of a card are like at one temperature: margins, steps, bias by source and azimuth, noise by source, start-up."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from compensation.actuators import RangeUse
from compensation.arrays import Array
from compensation.closed_loop import ClosedLoop
from compensation.controllers import Loops, Margin
from compensation.electronics import Electronics, LoopNoise
from compensation.rebalance import close_loops
from compensation.start_up import StartUp, start_up
from compensation.wave import StandingWave
from compensation.whole_angle import close_without_rate
from studies.errors import naming
from studies.instrument.card import Instrument
from studies.simulation.loop import (
    DEG_PER_H,
    electronics_of,
    find_range_use,
    loops_of,
    require_loop,
    require_range,
    require_stable_loops,
    settled_columns,
    wave_of,
)

ERRORS = {
    # source of bias: keys of the card that are 0 without it
    "damping anisotropy": ("bias.damping_anisotropy",),
    "turn of the drives": ("loop.misalignment_mrad",),
    "gain ratios": ("loop.pickoff_gain_ratio", "loop.drive_gain_ratio"),
    "phase errors on the quadrature": ("loop.pickoff_phase_deg", "loop.drive_phase_deg"),
    "phase differences": ("loop.pickoff_phase_difference_deg", "loop.drive_phase_difference_deg"),
    "skewed axes": ("loop.pickoff_skew_mrad", "loop.drive_skew_mrad"),
}
SHARED = ("bias.damping_axis_deg", "loop.frequency_axis_deg", "loop.frequency_split_mHz")
"""Values that several sources share."""
ROUNDING = 1e-9  # of a difference of two variances, relative
NOISES = ("pickoff", "adc_step", "dac_step", "drive", "thermal")
SETTLING = 6.0
"""Of a loop after a jump, over its bandwidth (s Hz)."""


@dataclass(frozen=True)
class BiasSource:
    """One source of bias: what it makes (deg/h), and one standard deviation of it from the card's uncertain values."""

    name: str
    bias: float
    sd: float


@dataclass(frozen=True)
class BiasSlope:
    """What an uncertain value of the card does to the bias: the value, its standard deviation, deg/h per its unit."""

    key: str
    value: float
    sd: float
    slope: float

    @property
    def effect(self) -> float:
        """Deg/h by one standard deviation."""
        return abs(self.slope) * self.sd


@dataclass(frozen=True)
class LoopStudy:
    """What the loops of a card are like at one temperature; `noise` by source: deg/h over 1 s, walk (deg/√h) and white noise (arcsec) of the angle."""

    instrument: Instrument
    frequency: float
    inverse_q: float
    bryan_factor: float
    wave: StandingWave
    electronics: Electronics
    loops: Loops
    settled: dict[str, float]
    sources: tuple[BiasSource, ...]
    slopes: tuple[BiasSlope, ...]
    noise: dict[str, tuple[float, float, float]]
    margins: tuple[Margin, ...]
    start: StartUp
    use: RangeUse

    @property
    def decay(self) -> float:
        """1/τ, 1/s."""
        return float(1 / np.asarray(self.wave.tau))

    @property
    def angle(self) -> float:
        """Azimuth of the wave at the start, rad."""
        return float(np.radians(self.instrument.bias.pattern_angle_deg))

    def closed(self) -> ClosedLoop:
        """Return the loops closed about the wave."""
        return _close(self.instrument, self.wave, self.electronics, self.loops)


def study_loops(
    instrument: Instrument, frequency: float, inverse_q: float, bryan_factor: float, rate: float = 0.0
) -> LoopStudy:
    """Return margins, bias by source, noise by source, start and range of a card's loops, the range under a rate (rad/s)."""
    loop = require_loop(instrument)
    wave = wave_of(instrument, frequency, inverse_q, bryan_factor)
    electronics, loops = electronics_of(instrument, wave), loops_of(loop)
    decay = float(1 / np.asarray(wave.tau))
    margins = require_stable_loops(instrument, frequency, inverse_q)
    use = find_range_use(instrument, wave, rate)
    require_range(instrument, use, rate, wave.coupling)
    with naming(f"{instrument.path} [loop]"):
        _close(instrument, wave, electronics, loops).require_stable()
        start = start_up(1 / decay, loops, headroom=loop.drive_headroom, offset=2 * np.pi * loop.start_offset_Hz)
        noise = {
            name: (float(over[0]), walk / 60, _angle_noise(walk, 100.0, float(over[1])))
            for name, (walk, over) in _noise(instrument, wave, electronics, loops, (1.0, 100.0)).items()
        }
    bias = _bias_of(instrument, frequency, inverse_q, bryan_factor)
    slopes = _slopes(instrument, bias)
    settled = settled_columns(instrument, np.array([frequency]), np.array([inverse_q]), bryan_factor)
    return LoopStudy(
        instrument,
        frequency,
        inverse_q,
        bryan_factor,
        wave,
        electronics,
        loops,
        {name: float(values[0]) for name, values in settled.items()},
        _sources(bias, slopes),
        slopes,
        noise,
        margins,
        start,
        use,
    )


def noise_over(study: LoopStudy, seconds: tuple[float, ...]) -> dict[str, Array]:
    """Return the standard deviation (deg/h) of means of the rate over these times, by source and of all."""
    found = _noise(study.instrument, study.wave, study.electronics, study.loops, seconds)
    return {name: over for name, (_, over) in found.items()}


def answer_steps(study: LoopStudy, points: int = 300) -> dict[str, tuple[Array, Array]]:
    """Return what each loop commands, over what it should, after what it holds has jumped at 0: times (s) and answers."""
    loop = study.closed()
    return {
        margin.loop: loop.answer_step(
            margin.loop, max(round(SETTLING / margin.crossover * study.loops.sampling / points), 1), points
        )
        for margin in study.margins
    }


def bias_around(study: LoopStudy, azimuths: Array) -> dict[str, Array]:
    """Return the bias (deg/h) over the azimuth of the wave (rad): of each source that makes any, and of all."""
    bias = _bias_of(study.instrument, study.frequency, study.inverse_q, study.bryan_factor, azimuths)
    total = bias({})
    parts = {name: total - bias(dict.fromkeys(keys, 0.0)) for name, keys in ERRORS.items()}
    most = max(float(np.max(np.abs(total))), 1e-12)
    return {name: part for name, part in parts.items() if float(np.max(np.abs(part))) > 1e-6 * most} | {"all": total}


def _bias_of(
    instrument: Instrument, frequency: float, inverse_q: float, bryan_factor: float, azimuths: Array | None = None
) -> Callable[[dict[str, float]], Array]:
    """Bias (deg/h) of the settled loops, at the card's azimuth or at others (rad), as a function of values of the card."""
    f, loss = (np.full(1 if azimuths is None else len(azimuths), x) for x in (frequency, inverse_q))

    def bias(values: dict[str, float]) -> Array:
        return settled_columns(instrument.with_values(values), f, loss, bryan_factor, azimuths)["bias_deg_per_h"]

    return bias


def _slopes(instrument: Instrument, bias: Callable[[dict[str, float]], Array]) -> tuple[BiasSlope, ...]:
    """What each uncertain value of loops and damping does to the bias, largest effect first."""
    keys = {*(key for keys in ERRORS.values() for key in keys), *SHARED}
    found = []
    for one in instrument.uncertain:
        if one.name in keys and one.sd > 0:
            low, high = _ends(one.value, one.sd, one.name)
            slope = float((bias({one.name: high}) - bias({one.name: low}))[0]) / (high - low)
            found.append(BiasSlope(one.name, one.value, one.sd, slope))
    # equal effects, such as those of the two phase errors, stand in the card's order, not in that of rounding
    return tuple(sorted(found, key=lambda one: -float(f"{one.effect:.9g}")))


def _sources(bias: Callable[[dict[str, float]], Array], slopes: tuple[BiasSlope, ...]) -> tuple[BiasSource, ...]:
    """Bias of each source: what goes when its keys are 0; its spread: that of the card's uncertain values."""
    effects = {one.key: one.effect for one in slopes}

    def source(name: str, keys: Iterable[str], value: Array) -> BiasSource:
        return BiasSource(
            name, float(value[0]), float(np.hypot.reduce([0.0, *(effects.get(key, 0.0) for key in keys)]))
        )

    total = bias({})
    parts = (source(name, keys, total - bias(dict.fromkeys(keys, 0.0))) for name, keys in ERRORS.items())
    return (*parts, source("all", effects, total))


def _ends(value: float, sd: float, key: str) -> tuple[float, float]:
    """One standard deviation below and above a value of the card, within what it can be."""
    least = 0.0 if key.endswith(("anisotropy", "mHz")) else -np.inf
    return max(value - sd, least), value + sd


def _close(instrument: Instrument, wave: StandingWave, electronics: Electronics, loops: Loops) -> ClosedLoop:
    if require_loop(instrument).mode == "whole-angle":
        return close_without_rate(wave, electronics, loops)
    return close_loops(wave, electronics, loops, 0.0, float(np.radians(instrument.bias.pattern_angle_deg)))[0]


def _noise(
    instrument: Instrument, wave: StandingWave, electronics: Electronics, loops: Loops, seconds: tuple[float, ...]
) -> dict[str, tuple[float, Array]]:
    """Of each source and of all: the walk N of the angle (deg/h √s), the standard deviation (deg/h) of means of the rate over t.

    σ² = N²/t + 2 Q²/t²: rate that is white, as of forces, and angle that is white at both ends, as of readings (IEEE 952's N, Q).
    """
    there = [name for name in NOISES if getattr(electronics.noise, name) > 0]
    found, t = {}, np.array(seconds)
    for label, names in (*((name, (name,)) for name in there), ("all", NOISES)):
        only = LoopNoise(**{name: getattr(electronics.noise, name) for name in names})
        if require_loop(instrument).mode == "whole-angle":
            # forces across the wave walk, readings at both ends scatter
            walk = float(np.hypot(only.thermal, np.sqrt(only.command_variance(loops.sampling) / loops.sampling)))
            reading = only.measurement_variance(loops.sampling) * loops.smoothing / (2 - loops.smoothing)
            spread = np.sqrt(walk**2 / t + 2 * reading / t**2)
        else:
            held = _close(instrument, wave, replace(electronics, noise=only), loops)
            walk, spread = held.walk("rate"), np.array(_held_spread(held, seconds))
        found[label] = walk / wave.coupling * DEG_PER_H, spread / wave.coupling * DEG_PER_H
    return found


def _angle_noise(walk: float, seconds: float, spread: float) -> float:
    """Return the white noise Q of the angle (arcsec) that a walk leaves of the spread over so many seconds; 0 where only rounding is left."""
    squared = (seconds * spread) ** 2 - seconds * walk**2
    return float(np.sqrt(squared / 2)) if squared > ROUNDING * seconds * walk**2 else 0.0


def _held_spread(loop: ClosedLoop, lengths: tuple[float, ...]) -> list[float]:
    """Spread of the mean rate command (1/s) over rows of these lengths (s), the loops settled before."""
    at = loop.places
    settled = loop.row(round(100 * loop.loops.sampling)).covariance.copy()
    settled[at["sum"]] = settled[:, at["sum"]] = settled[at["wave_sum"]] = settled[:, at["wave_sum"]] = 0.0
    spread = []
    for seconds in lengths:
        row = loop.row(max(round(seconds * loop.loops.sampling), 1))
        total = row.map @ settled @ row.map.T + row.covariance
        place = at["sum"].start + 2
        spread.append(float(np.sqrt(max(total[place, place], 0.0)) / row.samples))
    return spread
