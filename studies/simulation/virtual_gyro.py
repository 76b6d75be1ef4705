"""A card and a drive become a record: the prediction of the one forward model, read with sensor, noise and rounding."""

import datetime
from dataclasses import dataclass
from typing import TYPE_CHECKING
from warnings import warn

import numpy as np

from compensation.arrays import Array
from compensation.noise import Noise
from shell.constants import zero_Celsius
from studies.effects import find_effect
from studies.instrument.tables.noise import SILENT
from studies.progress import tell
from studies.record import Record, check_plausible
from studies.resonator.law import beyond_records, unknown_slope
from studies.simulation.chamber import check_profile
from studies.simulation.drive import COLUMN, COMMANDS, RATE, Drive, drive_by_profile, rows_of
from studies.simulation.loop import find_range_use, require_range, require_stable_loops, wave_of
from studies.simulation.noise import bias_noise, frequency_noise, quantise
from studies.simulation.prediction import Prediction, law_for, predict
from thermal.profile import Profile
from thermal.sweeping import LONGEST_ROW

if TYPE_CHECKING:
    from shell.law import FrequencyLaw
    from shell.layout import Theory
    from studies.instrument.card import Instrument
    from studies.instrument.tables.noise import NoiseKeys

DIGITS = {
    # decimals that are recorded, far below any noise
    "time_s": 9,
    "chamber_temperature_degC": 6,
    "housing_temperature_degC": 6,
    "resonator_temperature_degC": 6,
    "frequency_Hz": 8,
    "bias_deg_per_h": 6,
    "inverse_q": 16,
}
COMMAND_DIGITS = 9
FINEST, MOST_STEPS = 5.0, 20_000
"""Steps of the heat path (s) with which every column of ten hours is exact to 1e-9, and how many of them."""


@dataclass(frozen=True)
class VirtualRun:
    """A simulated run: its record, and the prediction from which it was made."""

    record: Record
    prediction: Prediction
    warnings: tuple[str, ...] = ()

    def told(self) -> Record:
        """Return the record alone, once its warnings are said."""
        for warning in self.warnings:
            warn(warning, stacklevel=3)
        return self.record

    @property
    def law(self) -> "FrequencyLaw":
        """The frequency law that it follows."""
        return self.prediction.law


def simulate_run(
    instrument: "Instrument",
    driven: Profile | Drive,
    rate: float = 1.0,
    seed: int = 0,
    noise: bool = True,
    theory: "Theory" = "solid",
    law: "FrequencyLaw | None" = None,
) -> VirtualRun:
    """Run a virtual gyro through chamber temperatures (K), settled at the first, or a drive with its own rows; `rate`: rows per second."""
    drive = driven if isinstance(driven, Drive) else drive_by_profile(driven, rows_of(driven, rate))
    if isinstance(driven, Drive):
        rate = 1 / float(np.median(np.diff(drive.time)))
    check_profile(drive.profile, instrument)
    levels = instrument.noise if noise else SILENT
    law = law or law_for(instrument, drive, theory=theory)
    if instrument.loop is not None:
        frequency = float(law.frequency(instrument.reference_temperature))
        require_stable_loops(instrument, frequency, instrument.loss.inverse_q)
    tell("the run", 0.2)
    prediction = predict(instrument, drive, law=law, longest=_longest_step(drive))
    tell("the run", 0.7)
    true = dict(prediction.columns)
    if instrument.loop is not None:
        wave = wave_of(instrument, true["frequency_Hz"], true["inverse_q"], law.bryan_factor)
        turned = 0.0 if drive.rate is None else drive.rate
        use = find_range_use(instrument, wave, turned, drive.commands.get("pattern_angle"))
        require_range(instrument, use, turned, wave.coupling, drive.source)
    free = instrument.loop is not None and instrument.loop.mode == "whole-angle"
    if free:  # its rate is what the azimuth does from row to row, and its other columns are means over the same time
        for name in ("frequency_Hz", "bias_deg_per_h", "inverse_q", "quadrature_V"):
            true[name] = np.append((true[name][1:] + true[name][:-1]) / 2, true[name][-1])
    if not noise:
        true["housing_temperature_degC"] = prediction.housing - zero_Celsius
    columns = {"time_s": drive.time.copy()}
    if drive.boundary == "chamber":
        columns[COLUMN["chamber"]] = drive.profile.at(drive.time) - zero_Celsius
    else:
        true["housing_temperature_degC"] = drive.profile.at(drive.time) - zero_Celsius
    columns |= _observe(
        true,
        levels,
        rate,
        np.random.default_rng(seed),
        sensed=drive.boundary == "chamber",
        turns_by=prediction.law.bryan_factor if free else None,
    )
    for name, (column, factor, power) in COMMANDS.items():
        if name in drive.commands:
            columns[column] = drive.commands[name] ** (1 / power) / factor
    if drive.rate is not None:
        columns[RATE] = np.degrees(drive.rate)
        columns["measured_rate_deg_per_s"] = columns[RATE] + columns["bias_deg_per_h"] / 3600
    for name, values in columns.items():
        columns[name] = np.round(values, DIGITS.get(name, COMMAND_DIGITS))
    check_plausible(
        columns, lambda row: f"{instrument.name} at {drive.time[row]:g} s", "correct the card, the profile or a command"
    )
    resolution = {
        "frequency_Hz": levels.frequency_resolution_Hz,
        "bias_deg_per_h": levels.bias_resolution_deg_per_h,
        "housing_temperature_degC": levels.housing_resolution_degC,
    }
    record = Record(
        columns,
        instrument=instrument.name,
        source=f"simulated, rate {rate:g} Hz, " + (f"seed {seed}" if noise else "without noise"),
        start=None if drive.moment is None else datetime.datetime.fromtimestamp(drive.moment, datetime.UTC),
        resolution={name: step for name, step in resolution.items() if step > 0},
    )
    reached = prediction.columns["resonator_temperature_degC"] + zero_Celsius
    warnings = idle_effects(instrument, drive) + beyond_records(instrument, reached, "this run")
    if why := unknown_slope(instrument):
        warnings += (f"the frequency follows no temperature: {why}",)
    return VirtualRun(record, prediction, warnings)


def _longest_step(drive: Drive) -> float:
    """Return the steps (s) of the heat path of a run: as fine as its digits ask for, coarser where it lasts days."""
    return min(max(FINEST, float(np.ptp(drive.time)) / MOST_STEPS), LONGEST_ROW)


def _observe(
    true: dict[str, Array],
    levels: "NoiseKeys",
    rate: float,
    generator: np.random.Generator,
    sensed: bool,
    turns_by: float | None,
) -> dict[str, Array]:
    """Return the columns as they are read: noise and rounding, but of an imposed housing; `turns_by`: Bryan factor of a free wave."""
    count = len(true["frequency_Hz"])
    housing = true["housing_temperature_degC"]
    scatter = Noise(levels.housing_white_K).draw(count, rate, generator)
    frequency = true["frequency_Hz"] + frequency_noise(levels).draw(count, rate, generator)
    wander = bias_noise(levels).draw(count, rate, generator)
    bias = true["bias_deg_per_h"] + wander
    loss = true["inverse_q"] * (1 + Noise(levels.inverse_q_white).draw(count, rate, generator))
    read = {
        "housing_temperature_degC": quantise(housing + scatter, levels.housing_resolution_degC) if sensed else housing,
        "resonator_temperature_degC": true["resonator_temperature_degC"],
        "frequency_Hz": quantise(frequency, levels.frequency_resolution_Hz),
        "bias_deg_per_h": quantise(bias, levels.bias_resolution_deg_per_h),
        "inverse_q": loss,
    }
    if "quadrature_V" in true:
        read["quadrature_V"] = true["quadrature_V"] + Noise(levels.quadrature_white_V).draw(count, rate, generator)
    if "pattern_angle_deg" in true:
        read["pattern_angle_deg"] = true["pattern_angle_deg"]
    if turns_by is not None:  # what scatters as a rate has turned the wave
        angle = true["pattern_angle_deg"] + turns_by / rate / 3600 * np.cumsum(np.append(0.0, wander[:-1]))
        read["pattern_angle_deg"] = angle + Noise(levels.pattern_angle_white_deg).draw(count, rate, generator)
    return read


def idle_effects(instrument: "Instrument", drive: Drive) -> tuple[str, ...]:
    """Name the effects whose drive (amplitude, voltage, quadrature) the run does not have, an azimuth it always has, and those whose time it does not know."""
    if not instrument.effects:
        return ()
    found = [
        f"the effect '{effect.name}' does not act in this run, which lacks its drive ({', '.join(find_effect(effect.name).needs)})."
        for effect in instrument.effects
        if any(need not in (*drive.commands, "pattern_angle") for need in find_effect(effect.name).needs)
    ]
    for effect in instrument.effects:
        if effect.since is not None and (drive.moment is None or drive.moment < effect.since):
            why = "says no '# start'" if drive.moment is None else "is from before"
            found.append(f"the effect '{effect.name}' has a date (since) and the run {why}: it begins with the run.")
    return tuple(found)
