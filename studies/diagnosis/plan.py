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
from studies.diagnosis.rehearsal import NOTHING, UNEXPLAINED, Answer, hide, rehearse, set_stage
from studies.diagnosis.states import lag
from studies.diagnosis.thermometer import read_thermometer
from studies.record import Record
from studies.reports.page import Table

RESONATOR_LAG = 2500.0
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
    survives : mapping effect -> share of the signature's rms that the baseline cannot absorb
    invisible : mapping effect -> why it cannot show
    """

    snr: float
    cases: int
    confusion: dict[str, dict[str, float]]
    sets: dict[str, dict[str, float]]
    survives: dict[str, float]
    invisible: dict[str, str]

    def outcome(self, key: str) -> dict[str, float]:
        """Return the shares of named, nothing, unexplained and wrong of one effect; they sum to one."""
        said = self.confusion[key]
        known = {"named": effect_of(key), NOTHING: NOTHING, UNEXPLAINED: UNEXPLAINED}
        shares = {word: said.get(name, 0.0) for word, name in known.items()}
        return {**shares, "wrong": max(1.0 - sum(shares.values()), 0.0)}

    def as_dict(self) -> dict[str, Any]:
        """Return the object of `hrg diagnose --plan --json`."""
        return {
            "schema": "hrg.plan/1",
            "snr": self.snr,
            "cases": self.cases,
            "confusion": self.confusion,
            "as_set_with": self.sets,
            "outcome": {key: self.outcome(key) for key in self.confusion},
            "survives_baseline": self.survives,
            "invisible": self.invisible,
        }


def effect_of(key: str) -> str:
    """Return the effect of a key such as `ageing (bias_deg_per_h)`."""
    return key.split(" ")[0]


def plan_campaign(
    profiles: Sequence[str], snr: float = 1.0, cases: int = 60, seed: int = 0, card: str | None = None
) -> Plan:
    """Predict what a campaign of the given chamber profiles could tell apart.

    Parameters
    ----------
    profiles : sequence of str
        In words ("step 20 -10 5h") or as files; one a run.
    snr : float
        Of every hidden effect.
    cases : int
        Cases of each effect.
    seed : int
    card : str, optional
        Takes the resonator's lag from its thermal network.
    """
    rng = np.random.default_rng(seed)
    campaign = imagine(profiles, rng, card)
    return predict(campaign, snr, cases, rng)


def predict(campaign: Campaign, snr: float, cases: int, rng: np.random.Generator) -> Plan:
    """Predict the confusion for the temperatures and drives of a campaign, planned or recorded.

    Parameters
    ----------
    campaign : Campaign
    snr : float
        Of every hidden effect.
    cases : int
        Cases of each effect.
    rng : numpy Generator
        Seeded by the caller.
    """
    confusion: dict[str, dict[str, float]] = {}
    sets: dict[str, dict[str, float]] = {}
    survives: dict[str, float] = {}
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
        hidden = []
        for effect in stage.effects:
            key = effect.name if effect.responses[0] == response else f"{effect.name} ({response})"
            own = hide(stage, effect, snr, cases, rng)
            survives[key] = own.survives
            if own.noise.shape[1]:
                hidden.append((key, own))
        if hidden:
            said = rehearse(stage, [own for _, own in hidden])
            for (key, own), answers in zip(hidden, said, strict=True):
                confusion[key], sets[key] = _shares(own.effect.name, answers)
    invisible = {
        name: "its drive is not part of the plan" if effect.needs else "no temperature varies"
        for name, effect in library().items()
        if name not in confusion and name != "calibration"
    }
    return Plan(snr, cases, confusion, sets, survives, invisible)


def _shares(truth: str, answers: Sequence[Answer]) -> tuple[dict[str, float], dict[str, float]]:
    """Return what is said, the truth where the set holds it, and with whom it stands in a set: shares of all cases."""

    def shares(counted: Counter[str]) -> dict[str, float]:
        return {name: count / len(answers) for name, count in counted.most_common()}

    said = Counter(truth if truth in members else members[0] for members in answers)
    beside = Counter(other for members in answers if truth in members for other in members if other != truth)
    return shares(said), shares(beside)


def imagine(profiles: Sequence[str], rng: np.random.Generator, card: str | None = None) -> Campaign:
    """Return a campaign without effects through the given chamber profiles, with nominal physics and noise."""
    from studies.simulation.chamber import load_profile

    tau = RESONATOR_LAG
    if card is not None:
        from studies.instrument.card import load_card
        from studies.simulation.virtual_gyro import slowest_lag

        tau = slowest_lag(load_card(card))
    records = []
    for number, words in enumerate(profiles):
        profile = load_profile(words)
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
                },
                path=f"planned run {number + 1}",
            )
        )
    return replace(load_campaign(records), notes=())


def plan_table(plan: Plan) -> Table:
    """Return the prediction as a table."""

    def listed(shares: dict[str, float], but: tuple[str, ...]) -> str:
        words = (f"{name} {100 * share:.0f} %" for name, share in shares.items() if name not in but and share >= 0.02)
        return ", ".join(words) or "—"

    rows = []
    for name in sorted(plan.confusion, key=lambda name: -plan.outcome(name)["named"]):
        own, outcome = effect_of(name), plan.outcome(name)
        rows.append(
            [
                name,
                f"{100 * outcome['named']:.0f}",
                listed(plan.sets[name], ()),
                f"{100 * outcome[NOTHING]:.0f}",
                f"{100 * outcome[UNEXPLAINED]:.0f}",
                listed(plan.confusion[name], (own, NOTHING, UNEXPLAINED)),
                f"{100 * plan.survives[name]:.0f}",
            ]
        )
    rows += [[name, "0", "—", "100", "0", why, "0"] for name, why in plan.invisible.items()]
    return Table(
        f"What this campaign could tell apart, effects at SNR {plan.snr:g}, {plan.cases} cases each",
        (
            "effect",
            "named rightly / %",
            "as a set with",
            "nothing / %",
            "unexplained / %",
            "wrongly",
            "survives baseline / %",
        ),
        rows,
        "Named rightly: share of hidden cases in which the answer, alone or as a set, holds the effect.",
    )
