"""Runs that could come next: chamber programmes in words over the covered range, drives stepped where they help."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from shell.constants import zero_Celsius
from studies.diagnosis.campaign import Campaign
from studies.effects.states import FloatArray, States, lag
from studies.planning.chamber import Chamber, limited
from studies.planning.programme import Steps, words_of

HOUSING_LAG = 600.0
"""The housing behind the chamber's air, s, where the housing is measured."""
NEXT_DAY = 16 * 3600.0
"""From the end of the last run to the start of the next one, s."""
NARROW, WIDENED = 5.0, 15.0
"""A campaign that covers less than this, K, is widened by so much on both sides."""
SHORTEST, LONGEST = 3600.0, 16 * 3600.0
DRIVES = {
    "voltage_squared": "electrode_bias_V",
    "amplitude_squared": "drive_amplitude_V",
    "quadrature": "quadrature_V",
    "pattern_angle": "pattern_angle_deg",
}
LEVELS = (0.5, 1.0, 0.0, 0.75, 0.25, 0.9)
"""Order of the levels of a stepped drive, from the lowest (0) to the highest (1)."""
HOLDS = {"voltage_squared": 5, "amplitude_squared": 7, "quadrature": 6, "pattern_angle": 4}
"""Steps of each drive in a run: different numbers, so that no two drives step together."""


@dataclass(frozen=True)
class Programme:
    """One possible run.

    Attributes
    ----------
    kind : str
        "repeat", or the name in the family.
    profile : str
        Chamber profile in words, as `hrg simulate` takes it, or "repeat of FILE".
    states : States
        What the run would go through, on the campaign's fine grid.
    drives : mapping from column to Steps
        How the drives are stepped; those not named stay at their mean.
    chamber : (N,) array
        Temperature that the chamber (of a repeat, the recorded sensor) goes through, K.
    """

    kind: str
    profile: str
    states: States
    chamber: FloatArray
    drives: Mapping[str, Steps] = field(default_factory=dict)

    @property
    def hours(self) -> float:
        """How long it takes the chamber."""
        return float(np.ptp(self.states.time)) / 3600.0

    @property
    def repeats(self) -> bool:
        """Whether it is a recorded run once more."""
        return self.kind == "repeat"


DURATIONS = (1.0, 0.5)
"""Lengths of the runs that are considered, in parts of the recorded runs'."""


def candidates(campaign: Campaign, stepped: Sequence[str] = (), chamber: Chamber | None = None) -> list[Programme]:
    """Return the runs that could follow a campaign: the repeats of its runs first.

    Parameters
    ----------
    campaign : Campaign
    stepped : sequence of str
        Fields of `States` that shall be stepped where the campaign has them.
    chamber : Chamber, optional
        What the chamber can do; 3 K/min between the covered temperatures unless given.
    """
    chamber = Chamber() if chamber is None else chamber
    spans = [float(np.ptp(run.states.time)) for run in campaign.runs]
    duration = float(np.clip(600.0 * round(float(np.median(spans)) / 600.0), SHORTEST, LONGEST))
    begin = max(float(run.states.campaign_time[-1]) for run in campaign.runs) + NEXT_DAY
    housing = np.concatenate([run.states.housing for run in campaign.runs]) - zero_Celsius
    low, high = float(np.ceil(housing.min())), float(np.floor(housing.max()))
    if high - low < NARROW:
        low, high = low - WIDENED, high + WIDENED
    low, high = chamber.within(low, high)
    out = [_repeat(campaign, k, begin) for k, span in enumerate(spans) if span >= 0.5 * np.median(spans)]
    for part in DURATIONS:
        if part * duration < SHORTEST:
            continue
        count = campaign.group * max(5, round(part * duration / campaign.step))
        time = np.asarray(np.arange(count) * (campaign.step / campaign.group))
        drives = _drives(campaign, time, stepped)
        for kind, words in words_of(low, high, part * duration).items():
            out.append(_imagine(campaign, kind, limited(words, chamber.rate), time, begin, drives))
    return out


def programme_for(campaign: Campaign, seen: str, chamber: Chamber | None = None) -> Programme:
    """Return the run that varies one input alone; of time and brief events the repeat of the first run."""
    kinds = {
        "time": "repeat",
        "temperature": "staircase both ways",
        "rate": "two rates",
        "history": "steps and soaks",
        "voltage": "quiet",
    }
    kind = next((kind for begin, kind in kinds.items() if seen.startswith(begin)), "repeat")
    stepped = tuple(DRIVES) if kind == "quiet" else ()
    return next(programme for programme in candidates(campaign, stepped, chamber) if programme.kind == kind)


def _repeat(campaign: Campaign, k: int, begin: float) -> Programme:
    run = campaign.runs[k]
    time = run.states.time - run.states.time[0]
    states = replace(run.states, run=len(campaign.runs), time=time, campaign_time=time + begin)
    return Programme("repeat", f"repeat of {run.label}", states, run.states.housing)


def _imagine(
    campaign: Campaign,
    kind: str,
    words: str,
    time: FloatArray,
    begin: float,
    drives: tuple[dict[str, FloatArray | None], dict[str, Steps]],
) -> Programme:
    from thermal.profile import parse_profile

    profile = parse_profile(words)
    chamber = np.asarray(profile.at(np.minimum(time, profile.end)))
    inside = campaign.temperature_source != "chamber_temperature_degC"
    housing = lag(chamber, float(time[1] - time[0]), HOUSING_LAG) if inside else chamber
    states = States(
        run=len(campaign.runs),
        time=time,
        campaign_time=time + begin,
        housing=housing,
        resonator=housing,
        tau=1.0,
        reference=campaign.reference,
        voltage_squared=drives[0]["voltage_squared"],
        amplitude_squared=drives[0]["amplitude_squared"],
        quadrature=drives[0]["quadrature"],
        pattern_angle=drives[0]["pattern_angle"],
    )
    return Programme(kind, words, states, chamber, drives[1])


def _drives(
    campaign: Campaign, time: FloatArray, stepped: Sequence[str]
) -> tuple[dict[str, FloatArray | None], dict[str, Steps]]:
    """Return what each recorded drive does in the next run, and the words for those that step."""
    values: dict[str, FloatArray | None] = {}
    steps: dict[str, Steps] = {}
    for name, column in DRIVES.items():
        parts = [getattr(run.states, name) for run in campaign.runs]
        if any(part is None for part in parts):
            values[name] = None
            continue
        recorded = np.concatenate(parts)
        squared = name.endswith("_squared")
        recorded = np.sqrt(recorded) if squared else recorded
        if name not in stepped:
            mean = float(recorded.mean())
            values[name] = np.full(time.size, mean**2 if squared else mean)
            continue
        levels = _levels(name, recorded, HOLDS[name])
        index = np.minimum((time / (time[-1] / len(levels))).astype(int), len(levels) - 1)
        shown = np.degrees(levels) if name == "pattern_angle" else levels
        steps[column] = Steps(tuple(float(f"{v:.3g}") for v in shown), round(time[-1] / len(levels) / 60.0))
        values[name] = levels[index] ** 2 if squared else levels[index]
    return values, steps


def _levels(name: str, recorded: FloatArray, count: int) -> FloatArray:
    """Levels between the recorded extremes; around a drive that stood still, 20 % (azimuth: 22.5°) up and down."""
    low, high = float(recorded.min()), float(recorded.max())
    if high - low < 0.02 * max(abs(high), abs(low), 1e-12):
        reach = np.radians(22.5) if name == "pattern_angle" else 0.2 * max(abs(high), 1e-12)
        low, high = low - reach, high + reach
    return low + (high - low) * np.resize(np.array(LEVELS), count)
