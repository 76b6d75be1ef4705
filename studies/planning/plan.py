"""Before any data: which effects a planned campaign could tell apart, and how small they may be (`studies.planning.expectation`)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from compensation.arrays import Array
from compensation.noise import Noise
from shell.constants import zero_Celsius
from studies.effects import find_effect, library
from studies.errors import InputError
from studies.inference.background import Background
from studies.inference.diagnosis import build_problem
from studies.inference.linear import SCALES, Linear, Shapes
from studies.inference.search import Search
from studies.inference.signatures import Signatures
from studies.instrument.card import Instrument
from studies.planning.chamber import Chamber, limited
from studies.planning.expectation import Chances, Expectation, Hidden, Key, hide
from studies.record import Record
from studies.simulation.drive import drive_by_schedule
from studies.simulation.noise import bias_noise, frequency_noise
from studies.simulation.prediction import law_about

SNRS, SURE, OFTEN, SMALLER = (1.0, 0.3, 0.1), 0.9, 0.05, 0.5
"""Where chances are shown; chance from which on an effect is identified; share from which on another answer is listed, and the part of
the least size at which what would be named instead is asked."""
ROW, MOST_ROWS = 10.0, 1990
"""Row (s) of which the SNR counts; and rows of a simulated run, as many as a fit takes one by one."""
SIZES = np.asarray(10.0 ** np.arange(-5.0, np.log10(SCALES[-1]) + 1e-9, 0.25))
"""Sizes that are tried, in strong cases; the largest is more than any source shows."""
LADDER = 10.0 ** np.arange(-2.0, 3.01, 0.05)
WHITE = {
    "frequency_Hz": "frequency_white_Hz",
    "bias_deg_per_h": "bias_white_deg_per_rt_h",
    "inverse_q": "inverse_q_white",
}


@dataclass(frozen=True)
class Prospect:
    """What would be said of one hidden effect."""

    hidden: Hidden
    chances: Chances
    # array (B,): Of a strong case: rms of what the calibrated card cannot absorb over rms of the noise of one row after
    # the same projection.
    snr: Array
    survives: float  # part of the rms of the effect that the calibrated card cannot absorb

    def at(self, curves: Array, snr: float) -> float | None:
        """Return a chance at one SNR, the mean over shapes; None where that is larger than any source shows."""
        sizes = snr / self.snr
        within = np.flatnonzero(sizes <= SIZES[-1] * (1.0 + 1e-9))  # the largest is asked for by its SNR, which rounds
        if 2 * within.size < sizes.size:
            return None
        own = [np.interp(np.log(sizes[b]), np.log(self.chances.size), curves[:, b]) for b in within]
        return float(np.mean(own))

    def least(self, curves: Array, lasting: bool = True) -> dict[str, float] | None:
        """Return the least SNR, and the size that is in the shape of median size, where a chance is `SURE`, there and above if `lasting`."""
        found = [self.at(curves, float(snr)) for snr in LADDER]
        sure = np.array([chance is not None and chance >= SURE for chance in found])
        known = np.array([chance is not None for chance in found])
        good = sure & (np.flip(np.logical_and.accumulate(np.flip(sure | ~known))) if lasting else True)
        if not good.any():
            return None
        return self.size(float(LADDER[int(np.argmax(good))]))

    def size(self, snr: float) -> dict[str, float]:
        """Return an SNR with the coefficient that has it, of the median shape."""
        return {"snr": snr, "value": snr * self.hidden.unit / float(np.median(self.snr))}

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of `hrg diagnose --plan --json`."""
        chances, least = self.chances, self.least(self.chances.named)
        largest = self.size(float(SIZES[-1] * np.median(self.snr)))
        there = (least or largest)["snr"]

        def shares(curves: Mapping[str, Array], snr: float) -> dict[str, float]:
            found = {name: self.at(own, snr) or 0.0 for name, own in curves.items()}
            return {n: share for n, share in sorted(found.items(), key=lambda one: -one[1]) if share >= OFTEN}

        return {
            "effect": self.hidden.effect.name,
            "response": self.hidden.response,
            "coefficient": self.hidden.name,
            "least": least,
            "least_alone": self.least(chances.alone, lasting=False),
            "largest": self.size(float(SIZES[-1] * np.median(self.snr))),
            "identified": {f"{snr:g}": self.at(chances.named, snr) for snr in SNRS},
            "alone": {f"{snr:g}": self.at(chances.alone, snr) for snr in SNRS},
            "nothing": {f"{snr:g}": self.at(chances.nothing, snr) for snr in SNRS},
            "as_set_with": shares(chances.beside, there),
            "instead": shares(chances.instead, SMALLER * there),
            "survives_baseline": self.survives,
        }


@dataclass(frozen=True)
class Plan:
    """What a planned campaign could tell apart."""

    card: str  # name of the card whose simulation went through the profiles
    hours: float
    noise: Mapping[str, float]  # response -> rms of one row of `ROW` after the calibrated card has been taken out
    prospects: tuple[Prospect, ...]  # of the effects that the campaign excites, the smallest visible ones first
    invisible: Mapping[str, str]  # effect -> why it cannot show

    @property
    def sensors(self) -> dict[str, list[str]]:
        """What would separate sets without a further run: each sensor with the pairs that it separates, the most useful first."""
        found: dict[str, set[str]] = {}
        for one in self.prospects:
            name, response = one.hidden.key
            for other in one.as_dict()["as_set_with"]:
                for sensor in {find_effect(name).sensor, find_effect(other).sensor} - {""}:
                    if response == "frequency_Hz" or "reference_frequency_Hz" not in sensor:
                        found.setdefault(sensor, set()).add(" / ".join(sorted((name, other))))
        return {sensor: sorted(found[sensor]) for sensor in sorted(found, key=lambda s: (-len(found[s]), s))}

    def as_dict(self) -> dict[str, Any]:
        """Return the object of `hrg diagnose --plan --json`."""
        return {
            "schema": "hrg.plan/2",
            "card": self.card,
            "chamber_hours": self.hours,
            "row_s": ROW,
            "noise": dict(self.noise),
            "effects": [one.as_dict() for one in self.prospects],
            "not_testable": dict(self.invisible),
            "sensors": self.sensors,
        }


def plan_campaign(
    card: Instrument,
    profiles: Sequence[str],
    chamber: Chamber | None = None,
    progress: Callable[[str], None] = lambda words: None,
) -> Plan:
    """Predict what a campaign of the given chamber profiles, in words or as files, could tell apart."""
    if chamber is not None:
        profiles = [limited(words, chamber.rate) for words in profiles]
        for words in profiles:
            require_reach(chamber, words)
    progress("the card's simulation")
    records = simulate_plan(card, profiles)
    problem = build_problem(card, records, housing=False)
    state = problem.evaluate(np.zeros(problem.count))
    linear = Linear(
        problem,
        problem.rows,
        {name: np.zeros_like(own) for name, own in state.residual.items()},
        state.slope,
        np.zeros((0, problem.count + 1)),
    )
    noise = stated_noises(card, records)
    progress("all effects in all shapes")
    search = Search(linear, Signatures.at(problem, state.point), noise)
    groups: dict[Key, list[Shapes]] = {}
    for own in search.bank:
        groups.setdefault((own.effect.name, own.response), []).append(own)
    rng = np.random.default_rng(8)
    hidden = [hide(search, group, rng) for group in groups.values()]
    progress("what would be answered")
    expected = Expectation(search, Background(linear, (), noise), hidden)
    chances = expected.chances(SIZES)
    rms = {name: row_noise(linear, name, noise[name]) for name in linear.responses}
    prospects = []
    for one, place in zip(hidden, expected.places, strict=True):
        left, whole = (
            np.sqrt(np.mean(of[one.response][:, place] ** 2, axis=0)) for of in (expected.left, expected.signals)
        )
        snr = np.maximum(left, 1e-300) / rms[one.response]
        prospects.append(
            Prospect(one, chances[one.key], snr, float(min(np.median(left / np.maximum(whole, 1e-300)), 1.0)))
        )
    prospects.sort(key=_least_snr)
    hours = sum(float(np.ptp(record["time_s"])) for record in records) / 3600.0
    invisible = {
        name: "the plan does not vary the quantity that drives the effect"
        if effect.needs
        else "it needs more runs or a varying temperature"
        for name, effect in library().items()
        if not any(name == shown for shown, _ in groups)
    }
    return Plan(card.name, hours, rms, tuple(prospects), invisible)


def _least_snr(one: Prospect) -> float:
    least = one.least(one.chances.named)
    return np.inf if least is None else least["snr"]


def simulate_plan(card: Instrument, profiles: Sequence[str]) -> list[Record]:
    """Return the records of planned runs: the card's own simulation, with its noise."""
    from studies.simulation.chamber import load_schedule
    from studies.simulation.virtual_gyro import simulate_run

    schedules = [load_schedule(words) for words in profiles]
    law = law_about(card, np.concatenate([profile.value for profile, _ in schedules]))
    runs = [
        simulate_run(
            card,
            drive_by_schedule(profile, commands, MOST_ROWS / max(profile.end - profile.start, ROW * MOST_ROWS)),
            seed=k,
            law=law,
        )
        for k, (profile, commands) in enumerate(schedules)
    ]
    return [replace(run.told(), path=f"planned run {k}") for k, run in enumerate(runs, 1)]


def stated_noises(card: Instrument, records: Sequence[Record]) -> dict[str, Noise]:
    """Return the noise of every response as the card states it."""
    for response, key in WHITE.items():
        if getattr(card.noise, key) <= 0:
            raise InputError(
                f"{card.path or card.name} [noise]: {key} is 0, but a plan needs the noise of {response}; state it."
            )
    loss = float(np.median(np.concatenate([record["inverse_q"] for record in records])))
    return {
        "frequency_Hz": frequency_noise(card.noise),
        "bias_deg_per_h": bias_noise(card.noise),
        "inverse_q": Noise(card.noise.inverse_q_white * loss),
    }


def row_noise(linear: Linear, name: str, noise: Noise) -> float:
    """Rms of the noise of one row beside what the columns of the card take of its slow part."""
    rows, J = linear.rows[name], linear.columns((), name)
    U, S, _ = np.linalg.svd(J, full_matrices=False)
    Q, total = U[:, S > 1e-9 * S[0]], 0.0
    slow = replace(noise, white=0.0)
    for k, place in enumerate(rows.slices):
        Sigma = rows.covariance(k, slow)
        total += float(np.trace(Sigma) - np.sum((Q[place].T @ Sigma) * Q[place].T))
    return float(np.sqrt(noise.white**2 / ROW + max(total, 0.0) / len(J)))


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
