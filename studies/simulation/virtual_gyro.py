"""A card and a drive become a record: the prediction of the one forward model, read with sensor, noise and rounding."""

import datetime
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING
from warnings import warn

import numpy as np

from compensation.arrays import Array
from compensation.noise import Noise
from shell.constants import zero_Celsius
from studies.effects import find_effect
from studies.errors import numbered
from studies.instrument.tables.noise import SILENT
from studies.progress import tell
from studies.record import Record, check_plausible
from studies.resonator.law import beyond_records, unknown_slope
from studies.simulation.chamber import check_profile
from studies.simulation.drive import COLUMN, COMMANDS, RATE, Drive, drive_by_profile, rows_of
from studies.simulation.holes import longest_hole
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
    drive = replace(drive, means=True)
    if isinstance(driven, Drive):
        rate = 1 / float(np.median(np.diff(drive.time)))
    check_profile(drive.profile, instrument)
    levels = instrument.noise if noise else SILENT
    law = law or law_for(instrument, drive, theory=theory)
    if instrument.loop is not None:
        frequency = float(law.frequency(instrument.reference_temperature))
        require_stable_loops(instrument, frequency, instrument.loss.inverse_q)
    free = instrument.loop is not None and instrument.loop.mode == "whole-angle"
    scatter = _draw_noise(levels, len(drive.time), rate, np.random.default_rng(seed))
    if free:  # what scatters as a rate turns the wave, which all columns then follow
        drive = replace(drive, wander=np.radians(scatter["bias_deg_per_h"] / 3600))
    tell("the run", 0.2)
    prediction = predict(instrument, drive, law=law, longest=_longest_step(drive))
    tell("the run", 0.7)
    true = dict(prediction.columns)
    if instrument.loop is not None:
        # the effort that drives a turning wave may be a brake; its actuators are made for the loss
        loss = instrument.loss.inverse_q if free else true["inverse_q"]
        wave = wave_of(instrument, true["frequency_Hz"], loss, law.bryan_factor)
        turned = 0.0 if drive.rate is None else drive.rate.largest(drive.time)
        effort = np.pi * true["frequency_Hz"] * true["inverse_q"] if free else None
        use = find_range_use(instrument, wave, turned, drive.commands.get("pattern_angle"), effort)
        require_range(instrument, use, turned, wave.coupling, drive.source)
    if not noise:
        true["housing_temperature_degC"] = prediction.housing - zero_Celsius
    columns = {"time_s": drive.time.copy()}
    if drive.boundary == "chamber":
        columns[COLUMN["chamber"]] = drive.profile.at(drive.time) - zero_Celsius
    else:
        true["housing_temperature_degC"] = drive.profile.at(drive.time) - zero_Celsius
    columns |= _observe(true, levels, scatter, sensed=drive.boundary == "chamber", free=free)
    for name, (column, factor, power) in COMMANDS.items():
        if name in drive.commands:
            columns[column] = drive.commands[name] ** (1 / power) / factor
    if drive.rate is not None:
        columns[RATE] = np.degrees(drive.applied)
        columns["measured_rate_deg_per_s"] = columns[RATE] + columns["bias_deg_per_h"] / 3600
    unseen = instrument.part("posterior").unseen
    for name in (*unseen, *(("measured_rate_deg_per_s",) if "bias_deg_per_h" in unseen else ())):
        columns.pop(name, None)
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
    if drive.holes:
        longest, after = longest_hole(drive.profile, drive.holes)
        several = len(drive.holes) > 1
        size = f"{numbered(len(drive.holes), 'hole')}, the longest" if several else "a hole"
        bridged = "smooth curves bridge them" if several else "a smooth curve bridges it"
        warnings += (
            f"the housing's temperature has {size} of {longest:.0f} s after {after:.0f} s: {bridged}; what else happened there is not known.",
        )
    return VirtualRun(record, prediction, warnings)


def _longest_step(drive: Drive) -> float:
    """Return the steps (s) of the heat path of a run: as fine as its digits ask for, coarser where it lasts days."""
    return min(max(FINEST, float(np.ptp(drive.time)) / MOST_STEPS), LONGEST_ROW)


def _draw_noise(levels: "NoiseKeys", count: int, rate: float, generator: np.random.Generator) -> dict[str, Array]:
    """Draw the noise of the columns, of 1/Q over its size."""
    own = {
        "housing_temperature_degC": Noise(levels.housing_white_K),
        "frequency_Hz": frequency_noise(levels),
        "bias_deg_per_h": bias_noise(levels),
        "inverse_q": Noise(levels.inverse_q_white),
        "quadrature_V": Noise(levels.quadrature_white_V),
        "pattern_angle_deg": Noise(levels.pattern_angle_white_deg),
    }
    return {name: noise.draw(count, rate, generator) for name, noise in own.items()}


def _observe(
    true: dict[str, Array], levels: "NoiseKeys", scatter: dict[str, Array], sensed: bool, free: bool
) -> dict[str, Array]:
    """Return the columns as they are read: noise and rounding, but of an imposed housing and of the azimuth of a wave that is held."""
    housing, rounding = true["housing_temperature_degC"], levels.housing_resolution_degC
    read = {
        "housing_temperature_degC": quantise(housing + scatter["housing_temperature_degC"], rounding) if sensed else housing,
        "resonator_temperature_degC": true["resonator_temperature_degC"],
        "frequency_Hz": quantise(true["frequency_Hz"] + scatter["frequency_Hz"], levels.frequency_resolution_Hz),
        "bias_deg_per_h": quantise(true["bias_deg_per_h"] + scatter["bias_deg_per_h"], levels.bias_resolution_deg_per_h),
        "inverse_q": true["inverse_q"] * (1 + scatter["inverse_q"]),
    }  # fmt: skip
    for name in ("quadrature_V", "pattern_angle_deg"):
        if name in true:
            read[name] = true[name] + (scatter[name] if free or name == "quadrature_V" else 0.0)
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
