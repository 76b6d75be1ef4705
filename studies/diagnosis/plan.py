"""Before any data: which effects could a planned campaign tell apart?

A gyro without effects goes through the planned chamber profiles with nominal physics. Every effect is hidden in it many
times, with random shapes, under white and slow noise of random kind and strength, at the stated SNR (rms of what the
refitted baseline cannot absorb over the rms of the noise after the same projection). The scan of the diagnosis looks at
every case, and the answer counts by the rules of the diagnosis: named rightly means that the set it names holds the truth.
Drives that are not planned cannot show.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from studies.diagnosis.baseline import pose
from studies.diagnosis.campaign import Campaign, load_campaign
from studies.diagnosis.effects import library
from studies.diagnosis.fit import fit_terms
from studies.diagnosis.investigate import SPARSE, THRESHOLD
from studies.diagnosis.programme import HOUSING_LAG
from studies.diagnosis.rehearsal import NOISES, NOTHING, UNEXPLAINED, Answer, hide, rehearse, set_stage
from studies.diagnosis.states import lag
from studies.diagnosis.thermometer import read_thermometer
from studies.record import Record

RESONATOR_LAG = 2500.0
LADDER, SURE = (1.0, 0.3, 0.1), 0.9
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
    """

    snr: float
    cases: int
    confusion: dict[str, dict[str, float]]
    sets: dict[str, dict[str, float]]
    by_noise: dict[str, dict[str, dict[str, float]]]
    survives: dict[str, float]
    invisible: dict[str, str]

    def outcome(self, key: str) -> dict[str, float]:
        """Return the shares of named, nothing, unexplained and wrong of one effect; they sum to one."""
        said = self.confusion[key]
        known = {"named": effect_of(key), NOTHING: NOTHING, UNEXPLAINED: UNEXPLAINED}
        shares = {word: said.get(name, 0.0) for word, name in known.items()}
        return {**shares, "wrong": max(1.0 - sum(shares.values()), 0.0)}

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
        }


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
    """
    rng = np.random.default_rng(seed)
    return predict(imagine(profiles, rng, card), snrs, cases, rng)


def predict(campaign: Campaign, snrs: Sequence[float], cases: int, rng: np.random.Generator) -> Outlook:
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
    """
    plans = tuple(Plan(snr, cases, {}, {}, {noise: {} for noise in NOISES}, {}, {}) for snr in snrs)
    thermometer = None
    for response in campaign.responses:
        if thermometer is None or response == "frequency_Hz":
            problem = pose(campaign, response)
        else:
            readings = thermometer.change if response == "bias_deg_per_h" else thermometer.excess
            problem = pose(campaign, response, readings, thermometer.states)
        fit = fit_terms(problem, ())
        if response == "frequency_Hz":
            thermometer = read_thermometer(campaign, fit)
        threshold = THRESHOLD
        if response == "frequency_Hz":
            threshold *= max(1.0, campaign.runs[0].states.step / SPARSE)
        stage = set_stage(campaign, fit, threshold, problem.tau if problem.lagged else RESONATOR_LAG)
        keys = [e.name if e.responses[0] == response else f"{e.name} ({response})" for e in stage.effects]
        every = dict(zip(keys, (hide(stage, effect, cases, rng) for effect in stage.effects), strict=True))
        seen = {key: own for key, own in every.items() if own.noise.shape[1]}
        for plan in plans:
            plan.survives.update({key: own.survives for key, own in every.items()})
        if seen:
            for plan, said in zip(plans, rehearse(stage, list(seen.values()), snrs), strict=True):
                _fill(plan, list(seen), said)
    for plan in plans:
        plan.invisible.update(
            {
                name: "its drive is not part of the plan" if effect.needs else "no temperature varies"
                for name, effect in library().items()
                if name not in plan.confusion and name != "calibration"
            }
        )
    return Outlook(plans)


def _fill(plan: Plan, keys: Sequence[str], said: Sequence[Sequence[Answer]]) -> None:
    """Count the answers to the cases of every effect."""
    for key, answers in zip(keys, said, strict=True):
        plan.confusion[key], plan.sets[key] = _shares(effect_of(key), answers)
        for turn, noise in enumerate(NOISES):
            plan.by_noise[noise][key] = _shares(effect_of(key), answers[turn :: len(NOISES)])[0]


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
        housing = lag(np.asarray(profile.at(time)), step, HOUSING_LAG)
        x = lag(housing, step, tau) - 293.15
        level = {name: value * rng.standard_normal(time.size) for name, value in NOISE.items()}
        records.append(
            Record(
                {
                    "time_s": time - time[0],
                    "housing_temperature_degC": housing - 273.15 + 0.003 * rng.standard_normal(time.size),
                    "frequency_Hz": 5000.0 + 0.4 * x - 4e-4 * x**2 + level["frequency_Hz"],
                    "bias_deg_per_h": 0.1 * x + level["bias_deg_per_h"],
                    "inverse_q": 1e-7 * (1.0 + 1e-3 * x) + level["inverse_q"],
                    **{name: np.interp(time, profile.time, values) for name, values in commands.items()},
                },
                path=f"planned run {number + 1}",
            )
        )
    return replace(load_campaign(records), notes=())
