"""Before any data: which effects could a planned campaign tell apart?

A gyro without effects goes through the planned chamber profiles with nominal physics. Every effect is hidden in it many
times, with random shapes, under white and slow noise by turns, at the stated SNR (rms of what the refitted baseline
cannot absorb over the rms of the noise after the same projection). The scan of the diagnosis looks at every case, and the
answer counts by its rules: named rightly means that the set it names holds the truth. Drives that are not planned cannot show.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from shell.constants import zero_Celsius
from studies.diagnosis.campaign import Campaign, load_campaign
from studies.diagnosis.inquiry import Thermometer, begin, read_thermometer
from studies.diagnosis.model import Fit
from studies.diagnosis.planning.chamber import Chamber, limited
from studies.diagnosis.planning.programme import HOUSING_LAG
from studies.diagnosis.planning.rehearsal import NOISES, NOTHING, Answer, hide, rehearse, set_stage
from studies.diagnosis.response import RESPONSES
from studies.diagnosis.scan import applicable
from studies.effects import library
from studies.effects.states import lag
from studies.errors import InputError
from studies.record import Record

RESONATOR_LAG = 2500.0
LADDER, SURE = (1.0, 0.3, 0.1), 0.9
OFTEN = 0.05
"""Share of the cases from which on a set is worth a sensor."""
NOISE = {"frequency_Hz": 0.01, "bias_deg_per_h": 0.1, "inverse_q": 1e-9}


@dataclass(frozen=True)
class Plan:
    """Predicted confusion of one planned campaign.

    Attributes
    ----------
    snr : float
        SNR at which every effect was hidden.
    cases : int
        Cases of each effect.
    confusion : mapping effect -> mapping said -> share
        Said is the effect itself where the answer, alone or as a set, holds it.
    sets : mapping effect -> mapping other -> share
        Shares of the cases in which the answer is a set that holds the effect and the other.
    by_noise : mapping noise -> effect -> said -> share
        The confusion under white noise alone and with slow noise besides.
    survives : mapping effect -> share of the signature's rms that the baseline cannot absorb
    invisible : mapping effect -> why it cannot show
    sizes : mapping response -> size of an effect at this SNR, mHz, °/h or ppb
    hours : float
        Chamber time of the plan.
    """

    snr: float
    cases: int
    confusion: dict[str, dict[str, float]]
    sets: dict[str, dict[str, float]]
    by_noise: dict[str, dict[str, dict[str, float]]]
    survives: dict[str, float]
    invisible: dict[str, str]
    sizes: dict[str, float] = field(default_factory=dict)
    hours: float = 0.0

    def outcome(self, key: str) -> dict[str, float]:
        """Return the shares of named, nothing and wrong of one effect; they sum to one."""
        said = self.confusion[key]
        known = {"named": effect_of(key), NOTHING: NOTHING}
        shares = {word: said.get(name, 0.0) for word, name in known.items()}
        return {**shares, "wrong": max(1.0 - sum(shares.values()), 0.0)}

    @property
    def sensors(self) -> dict[str, list[str]]:
        """What would part sets without a further run: each sensor with the pairs that it parts, the most useful first."""
        found: dict[str, set[str]] = {}
        for key, others in self.sets.items():
            response = response_of(key)
            for other in (name for name, share in others.items() if share >= OFTEN):
                pair = " / ".join(sorted((effect_of(key), other)))
                for name in (effect_of(key), other):
                    sensor = library()[name].sensor
                    if sensor and (response == "frequency_Hz" or "reference_frequency_Hz" not in sensor):
                        found.setdefault(sensor, set()).add(pair)
        return {sensor: sorted(found[sensor]) for sensor in sorted(found, key=lambda s: (-len(found[s]), s))}

    def as_dict(self) -> dict[str, Any]:
        """Return the object for `--json`."""
        return {
            "schema": "hrg.plan/1",
            "snr": self.snr,
            "cases": self.cases,
            "confusion": self.confusion,
            "as_set_with": self.sets,
            "by_noise": self.by_noise,
            "outcome": {key: self.outcome(key) for key in self.confusion},
            "survives_baseline": self.survives,
            "invisible": self.invisible,
            "size_at_snr": self.sizes,
            "chamber_hours": self.hours,
            "sensors": self.sensors,
        }


def response_of(key: str) -> str:
    """Return the response that the effect of a key is hidden in."""
    return key.split(" (")[1].rstrip(")") if " (" in key else library()[key].responses[0]


def effect_of(key: str) -> str:
    """Return the effect of a key such as `ageing (bias_deg_per_h)`."""
    return key.split(" ")[0]


@dataclass(frozen=True)
class Outlook:
    """The same campaign with effects of several sizes, the largest SNR first; one of them is told in full."""

    plans: tuple[Plan, ...]

    @property
    def close(self) -> Plan:
        """The plan that is told in full: the middle one."""
        return self.plans[len(self.plans) // 2]

    def smallest(self, key: str) -> float | None:
        """Return the smallest SNR from which on an effect is named in at least nine of ten cases."""
        found = None
        for plan in self.plans:
            if key not in plan.confusion or plan.outcome(key)["named"] < SURE:
                break
            found = plan.snr
        return found

    def as_dict(self) -> dict[str, Any]:
        """Return the object of `hrg diagnose --plan --json`."""
        named = {f"{p.snr:g}": {key: p.outcome(key)["named"] for key in p.confusion} for p in self.plans}
        return {**self.close.as_dict(), "named_at": named}


def plan_campaign(
    profiles: Sequence[str],
    snrs: Sequence[float] = LADDER,
    cases: int = 100,
    seed: int = 0,
    card: str | None = None,
    chamber: Chamber | None = None,
    progress: Callable[[str], None] | None = None,
) -> Outlook:
    """Predict what a campaign of the given chamber profiles could tell apart.

    Parameters
    ----------
    profiles : sequence of str
        In words ("step 20 -10 5h") or as files; one a run.
    snrs : sequence of float
        Of every hidden effect, the largest first.
    cases : int
        Cases of each effect, at every SNR the same ones.
    seed : int
    card : str, optional
        Takes the resonator's lag from its thermal network.
    chamber : Chamber, optional
        Jumps in words become ramps of its rate.
    progress : callable, optional
        Is told what comes next.
    """
    rng = np.random.default_rng(seed)
    if chamber is not None:
        profiles = [limited(words, chamber.rate) for words in profiles]
        for words in profiles:
            require_reach(chamber, words)
    return predict(imagine(profiles, rng, card), snrs, cases, rng, progress)


def require_reach(chamber: Chamber, words: str) -> None:
    """Raise when a planned profile leaves what the chamber reaches, or, from a file, is faster than it."""
    from studies.simulation.chamber import load_profile

    profile = load_profile(words)
    values, time = profile.value - zero_Celsius, profile.time
    fastest = float(np.max(np.abs(np.diff(values)) / np.maximum(np.diff(time), 1e-9))) * 60.0
    if fastest > 1.001 * chamber.rate:
        raise InputError(
            f'"{words}" needs {fastest:.3g} K/min, but the chamber reaches only {chamber.rate:g}; use slower ramps.'
        )
    low, high = float(values.min()), float(values.max())
    allowed = chamber.within(low, high)
    if low < allowed[0] - 1e-6 or high > allowed[1] + 1e-6:
        raise InputError(
            f'"{words}" runs from {low:g} to {high:g} °C, but the chamber reaches {allowed[0]:g} to {allowed[1]:g} °C;'
            " plan within its range, or state another range with --chamber."
        )


def predict(
    campaign: Campaign,
    snrs: Sequence[float],
    cases: int,
    rng: np.random.Generator,
    progress: Callable[[str], None] | None = None,
) -> Outlook:
    """Predict the confusion for the temperatures and drives of a campaign, planned or recorded.

    Parameters
    ----------
    campaign : Campaign
    snrs : sequence of float
        Of every hidden effect.
    cases : int
        Cases of each effect.
    rng : numpy Generator
        Seeded by the caller.
    progress : callable, optional
        Is told what comes next.
    """
    hours = sum(float(np.ptp(run.row_time)) for run in campaign.runs) / 3600.0
    plans = tuple(Plan(snr, cases, {}, {}, {noise: {} for noise in NOISES}, {}, {}, hours=hours) for snr in snrs)
    thermometer: Thermometer | None = None
    for column in (c for c in RESPONSES if c in campaign.responses):
        response = RESPONSES[column]
        model: Fit = begin(campaign, column, thermometer)
        if response.thermometer:
            thermometer = read_thermometer(campaign, model)
        stage = set_stage(model, applicable(model.problem, model))
        for effect in stage.effects:
            if progress is not None:
                progress(f"{response.word}: {effect.name}")
            key = effect.name if effect.responses[0] == column else f"{effect.name} ({column})"
            hidden = hide(stage, effect, cases, rng)
            for plan in plans:
                plan.survives[key] = hidden.survives
                if hidden.noise.shape[1]:
                    _fill(plan, key, rehearse(stage, hidden, plan.snr), hidden.assumed)
        white = float(np.sqrt(model.solved.variance * model.problem.noise.rows))
        for plan in plans:
            plan.sizes[f"{response.word} / {response.shown}"] = plan.snr * white * response.scale
    for plan in plans:
        plan.invisible.update(
            {
                name: "the plan does not vary the quantity that drives the effect"
                if effect.needs
                else "it needs more runs or a varying temperature"
                for name, effect in library().items()
                if not any(effect_of(key) == name for key in plan.confusion)
            }
        )
    return Outlook(plans)


def _fill(plan: Plan, key: str, answers: Sequence[Answer], scene: "np.ndarray") -> None:
    """Count the answers to the cases of one effect."""
    plan.confusion[key], plan.sets[key] = _shares(effect_of(key), answers)
    for n, noise in enumerate(NOISES):
        mine = [answer for answer, own in zip(answers, scene, strict=True) if own == n]
        if mine:
            plan.by_noise[noise][key] = _shares(effect_of(key), mine)[0]


def _shares(truth: str, answers: Sequence[Answer]) -> tuple[dict[str, float], dict[str, float]]:
    """Return what is said, the truth where the set holds it, and with whom it stands in a set: shares of all cases."""

    def shares(counted: Counter[str]) -> dict[str, float]:
        return {name: count / len(answers) for name, count in counted.most_common()}

    said = Counter(truth if truth in members else members[0] for members in answers)
    beside = Counter(other for members in answers if truth in members for other in members if other != truth)
    return shares(said), shares(beside)


def imagine(profiles: Sequence[str], rng: np.random.Generator, card: str | None = None) -> Campaign:
    """Return a campaign without effects through the given chamber profiles, with nominal physics and noise."""
    from studies.simulation.chamber import load_schedule

    tau = RESONATOR_LAG
    if card is not None:
        from studies.instrument.card import load_card
        from studies.simulation.heat_path import build_network, slowest_lag

        instrument = load_card(card)
        tau = slowest_lag(build_network(instrument), instrument.reference_temperature)
    records = []
    for number, words in enumerate(profiles):
        profile, commands = load_schedule(words)
        step = max(10.0, (profile.end - profile.start) / 20000.0)
        time = np.arange(profile.start, profile.end, step)
        chamber = np.asarray(profile.at(time))
        chamber[0] = profile.value[0]  # settled there, also where the set point jumps at once
        housing = lag(chamber, step, HOUSING_LAG)
        x = lag(housing, step, tau) - 293.15
        level = {name: value * rng.standard_normal(time.size) for name, value in NOISE.items()}
        records.append(
            Record(
                {
                    "time_s": time - time[0],
                    "housing_temperature_degC": housing - zero_Celsius + 0.003 * rng.standard_normal(time.size),
                    "frequency_Hz": 5000.0 + 0.4 * x - 4e-4 * x**2 + level["frequency_Hz"],
                    "bias_deg_per_h": 0.1 * x + level["bias_deg_per_h"],
                    "inverse_q": 1e-7 * (1.0 + 1e-3 * x) + level["inverse_q"],
                    **{name: np.interp(time, profile.time, values) for name, values in commands.items()},
                },
                path=f"planned run {number + 1}",
            )
        )
    return replace(load_campaign(records), notes=())
