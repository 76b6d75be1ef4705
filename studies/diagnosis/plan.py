"""Before any data: which effects could a planned campaign tell apart?

A campaign without effects is simulated through the planned chamber profiles with nominal physics and noise. Every effect is
then hidden in it many times, with random shapes and the stated SNR (rms of what the refitted baseline cannot absorb over
the rms of the noise), and the scan of the diagnosis names what it sees. Drives that are not planned cannot show.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from studies.diagnosis.baseline import Problem, Term, pose, span_of
from studies.diagnosis.campaign import Campaign, load_campaign
from studies.diagnosis.effects import Effect, Parameter, library
from studies.diagnosis.fit import fit_terms
from studies.diagnosis.likelihood import fit_linear, orthonormal
from studies.diagnosis.null import draw_null, levels_of
from studies.diagnosis.scan import applicable, best_gains, build_dictionary, scan_gains
from studies.diagnosis.selection import scan_model
from studies.diagnosis.states import FloatArray, lag
from studies.diagnosis.thermometer import read_thermometer
from studies.record import Record
from studies.reports.page import Table

HOUSING_LAG, RESONATOR_LAG = 600.0, 2500.0
NOISE = {"frequency_Hz": 0.01, "bias_deg_per_h": 0.1, "inverse_q": 1e-9}
NOTHING = "nothing"


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
    survives : mapping effect -> share of the signature's rms that the baseline cannot absorb
    invisible : mapping effect -> why it cannot show
    """

    snr: float
    cases: int
    confusion: dict[str, dict[str, float]]
    survives: dict[str, float]
    invisible: dict[str, str]

    def as_dict(self) -> dict[str, Any]:
        """Return the object of `hrg diagnose --plan --json`."""
        return {
            "schema": "hrg.plan/1",
            "snr": self.snr,
            "cases": self.cases,
            "confusion": self.confusion,
            "survives_baseline": self.survives,
            "invisible": self.invisible,
        }


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
    """Predict the confusion for the temperatures and drives of a campaign, planned or recorded."""
    confusion: dict[str, dict[str, float]] = {}
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
        _predict_response(campaign, fit.problem, scan_model(fit), snr, cases, rng, confusion, survives)
    invisible = {
        name: "its drive is not part of the plan" if effect.needs else "no temperature varies"
        for name, effect in library().items()
        if name not in confusion and name != "calibration"
    }
    return Plan(snr, cases, confusion, survives, invisible)


def _predict_response(
    campaign: Campaign,
    problem: Problem,
    model: FloatArray,
    snr: float,
    cases: int,
    rng: np.random.Generator,
    confusion: dict[str, dict[str, float]],
    survives: dict[str, float],
) -> None:
    span = span_of(campaign, problem.tau if problem.lagged else RESONATOR_LAG)
    effects = [e for e in applicable(problem) if e.name != "calibration"]
    dictionary = build_dictionary(problem, span, effects)
    noise = draw_null(problem, model, 200, rng)
    gains, _, _ = best_gains(dictionary, *scan_gains(problem, dictionary, model, noise))
    levels = levels_of(gains)
    from studies.diagnosis.investigate import THRESHOLD

    fit = fit_linear(problem.basis, problem.rotated, model)
    ortho = orthonormal(model)
    for effect in effects:
        key = effect.name if effect.responses[0] == problem.response else f"{effect.name} ({problem.response})"
        signals, kept = _signals(problem, effect, span, ortho, cases, rng)
        if signals.shape[1] == 0:
            survives[key] = 0.0
            continue
        survives[key] = kept
        # the noise of a row of the record: the coarse step averages `rows` of them
        rows = max(campaign.group, 1)
        size = snr * np.sqrt(fit.variance * rows) * np.sqrt(problem.values.size) / np.linalg.norm(signals, axis=0)
        draws = signals * size + draw_null(problem, model, signals.shape[1], rng)
        net = best_gains(dictionary, *scan_gains(problem, dictionary, model, draws))[0] - levels[:, None]
        best = np.argmax(net, axis=0)
        said = [dictionary.effects[k] if net[k, j] > THRESHOLD else NOTHING for j, k in enumerate(best)]
        confusion[key] = {
            name: float(said.count(name)) / len(said) for name in sorted(set(said), key=said.count, reverse=True)
        }


def _signals(
    problem: Problem, effect: Effect, span: Any, ortho: FloatArray, cases: int, rng: np.random.Generator
) -> tuple[FloatArray, float]:
    """Rotated signatures of random shapes after the baseline took its part, and the median share that survives."""
    grid = list(effect.grid(span, problem.response))
    views = problem.views(problem.tau)
    out, shares = [], []
    for _ in range(cases):
        shape = list(grid[int(rng.integers(len(grid)))])
        for k, parameter in enumerate(effect.shape):
            if not parameter.steady and effect.name != "jump":
                shape[k] = _jitter(shape[k], parameter, rng)
        columns = problem.term(Term(effect, tuple(shape), 2), views)
        used = columns[:, :1] if effect.nested and rng.random() < 0.5 else columns
        scale = np.linalg.norm(used, axis=0)
        signal = problem.basis.rotate(used / np.where(scale > 0, scale, 1.0)) @ rng.standard_normal(used.shape[1])
        left = signal - ortho @ (ortho.T @ signal)
        share = float(np.linalg.norm(left)) / max(float(np.linalg.norm(signal)), 1e-300)
        shares.append(share)
        if share > 3e-3:
            out.append(left)
    stacked = np.stack(out, axis=1) if out else np.empty((problem.values.size, 0))
    return stacked, float(np.median(shares)) if shares else 0.0


def _jitter(value: float, parameter: Parameter, rng: np.random.Generator) -> float:
    moved = (
        value * float(np.exp(0.2 * rng.standard_normal()))
        if parameter.logarithmic
        else (value + 0.02 * (parameter.high - parameter.low) * float(rng.uniform(-0.1, 0.1)))
    )
    return float(np.clip(moved, parameter.low, parameter.high))


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
    rows = []
    for name, said in sorted(plan.confusion.items(), key=lambda item: -item[1].get(item[0].split(" ")[0], 0.0)):
        own = said.get(name.split(" ")[0], 0.0)
        others = ", ".join(
            f"{other} {100 * share:.0f} %"
            for other, share in said.items()
            if other != name.split(" ")[0] and share >= 0.02
        )
        rows.append([name, f"{100 * own:.0f}", f"{100 * plan.survives[name]:.0f}", others or "—"])
    rows += [[name, "0", "0", why] for name, why in plan.invisible.items()]
    return Table(
        f"What this campaign could tell apart, effects at SNR {plan.snr:g}, {plan.cases} cases each",
        ("effect", "named rightly / %", "survives baseline / %", "named otherwise"),
        rows,
        "Named rightly: share of hidden cases in which the diagnosis names the effect.",
    )
