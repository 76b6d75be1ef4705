"""The answer of one device: its diagnosis, its values with their errors, and how every effect stands in it."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from compensation.arrays import Array
from compensation.constants import NINETY
from shell.constants import zero_Celsius
from studies.calibration.observed import RESPONSES
from studies.errors import InputError
from studies.fleet.folder import Device
from studies.inference.background import Background
from studies.inference.diagnosis import Inference
from studies.inference.inferred import Inferred
from studies.inference.linear import PRICE, Term
from studies.inference.paths import trace
from studies.instrument.card import load_card
from studies.instrument.units import unit_of
from studies.record import read_record
from studies.simulation.drive import Drive
from studies.simulation.heat_path import slowest_lag
from studies.simulation.prediction import predict
from studies.simulation.variations import Variations, heats
from studies.workbench import diagnose_records
from thermal.profile import Profile

SCHEMA = "hrg.fleet-device/5"
USUAL, APART = 20.0, 0.5  # °C at which devices are compared without a common card, and kelvin to either side for slopes
FROM_REFERENCE = ("law.f0", "law.a", "loss.", "bias.")
"""Values of a card that count from its reference temperature."""
KNOWN, LITTLE = 0.5, 0.9
"""Standard deviation of a value, over that of its prior, below which its records tell it, and above which they say nothing."""


@dataclass(frozen=True)
class Measured:
    """A value of a device as its records alone tell it, the prior of the card taken out; `told` where they tell much more than that."""

    value: float
    sd: float
    told: bool = True
    open: float = 0.0  # standard deviation that the card leaves it; 0: not known


@dataclass(frozen=True)
class Standing:
    """An effect in one device."""

    score: float  # log posterior over nothing being there
    size: float  # rms of what it makes of the response in the records
    sd: float  # how well that is known
    first: float  # its first coefficient; of a family its size
    first_sd: float
    coefficient: str  # name of that

    def as_rms(self, response: str) -> "Standing":
        """Return it with its rms in the response in place of its first coefficient."""
        return replace(self, first=self.size, first_sd=self.sd, coefficient=f"rms ({unit_of(response)})")


@dataclass(frozen=True)
class Answer:
    """What is kept of a device."""

    serial: str
    key: str
    verdict: Mapping[str, Any]  # the object of `hrg diagnose --json`
    level: float | None  # its frequency (Hz), where it was measured
    measured: Mapping[str, Measured]  # name with unit -> Measured
    # response -> effect of which it would take the place, "" beside all -> effect -> Standing
    standings: Mapping[str, Mapping[str, Mapping[str, Standing]]]

    def as_dict(self) -> dict[str, Any]:
        """Return the object of its file."""
        return {"schema": SCHEMA, **asdict(self)}

    @classmethod
    def read(cls, found: Mapping[str, Any]) -> "Answer":
        """Return the answer of a file."""
        measured = {name: Measured(**own) for name, own in found["measured"].items()}
        standings = {
            r: {place: {name: Standing(**own) for name, own in of.items()} for place, of in places.items()}
            for r, places in found["standings"].items()
        }
        return cls(found["serial"], found["key"], found["verdict"], found["level"], measured, standings)


def diagnose_device(
    device: Device, key: str, progress: Callable[[str], None] = lambda words: None
) -> "tuple[Answer, Inference]":
    """Calibrate and diagnose one device."""
    if not device.records:
        raise InputError(f"device {device.serial}: its folder has no records (*.csv).")
    records = [read_record(path) for path in device.records]
    found = diagnose_records(records, None if device.card is None else load_card(device.card), progress=progress)
    at = None if device.card is None else found.card.reference_temperature
    levels = [float(np.nanmedian(record["frequency_Hz"])) for record in records if "frequency_Hz" in record]
    level = float(np.median(levels)) if levels else None
    answer = Answer(device.serial, key, found.verdict.as_dict(), level, measure(found, at), standings_of(found))
    return answer, found


def measure(found: Inferred, reference: float | None) -> dict[str, Measured]:
    """Return settled readings about the reference temperature (K) of a common card, or 20 °C, with the effects found, and the values of the card that the records tell.

    Without a common card those that count from the reference of each device's own are none to compare.
    """
    temperature = USUAL + zero_Celsius if reference is None else reference
    problem, (_, C) = found.search.linear.problem, found.background.posterior
    priors, count = problem.priors, len(problem.priors.values)
    u, first = found.numbers.point[:count], found.search.linear.count
    C = np.delete(np.delete(C, slice(count, first), 0), slice(count, first), 1)
    sizes = [own / term.spread for own, term in zip(found.numbers.coefficients, found.final.terms, strict=True)]
    coordinates = np.concatenate([u, *sizes])
    card = problem.instrument_at(found.numbers.point)
    law, at = problem.law_at(card), priors.at(u)
    slopes = np.pad(priors.slopes(u), ((0, 0), (0, len(C) - count)))  # by the sizes of effects, 0
    each = zip(priors.values, slopes, strict=True)
    rows: dict[str, tuple[float, Array]] = {
        value.name: (at[value.name], row)
        for value, row in each
        if reference is not None or not value.name.startswith(FROM_REFERENCE)
    }
    varied = Variations(card, law, priors.names)
    at_three = (temperature - APART, temperature, temperature + APART)
    settled = {T: _settled(found, varied, card, law, T, slopes) for T in at_three}
    (low, here, high), spot = settled.values(), f"at {temperature - zero_Celsius:g} °C"
    for name, words in (("frequency_Hz", "frequency"), ("bias_deg_per_h", "bias"), ("inverse_q", "1/Q")):
        if name not in problem.responses:
            continue
        value, J = here[name]
        unit = unit_of(name).removeprefix("1")
        rows[f"{words} {spot}" + (f" ({unit})" if unit else "")] = value, J
        relative, unit = (1e6 / value, "ppm/K") if name == "frequency_Hz" else (1.0, f"{unit or 1}/K")
        per = relative / (2.0 * APART)
        rows[f"slope of {words} {spot} ({unit})"] = (
            per * (high[name][0] - low[name][0]),
            per * (high[name][1] - low[name][1]),
        )
    rows["slowest time constant (s)"] = _slowest(varied, temperature, slopes)
    out = {}
    for name, (value, J) in rows.items():
        before, after = float(J @ J), float(J @ C @ J)
        if 0.0 < after < LITTLE**2 * before:  # the prior has its mean where u is 0
            variance = 1.0 / (1.0 / after - 1.0 / before)
            mean = value + float(J @ coordinates) * variance / before
            left_open = before**0.5 if card.polynomial is None else 0.0
            out[name] = Measured(mean, float(np.sqrt(variance)), after < KNOWN**2 * before, left_open)
    return out


def _settled(
    found: Inferred, varied: Variations, card: Any, law: Any, T: float, slopes: Array
) -> dict[str, tuple[float, Array]]:
    """Return every response of the settled gyro, as its campaign begins, and its derivatives by the independent coordinates and those of effects."""
    time = np.array([0.0, 60.0, 120.0])
    alone = predict(card, Drive(time, "housing", Profile(time, np.full(3, T))), varied, law)
    path, out = trace(card, alone, 0), dict[str, tuple[float, Array]]()
    for name in RESPONSES:
        slope = np.array([alone.derivatives[v][name][-1] for v in varied.names]) @ slopes
        out[name] = float(alone.columns[name][-1]), slope
    at = len(varied.names)
    for term, sizes in zip(found.final.terms, found.numbers.coefficients, strict=True):
        place, at = slice(at, at + len(sizes)), at + len(sizes)
        if any(getattr(path.states, drive) is None for drive in term.effect.needs):
            continue
        grid = found.search.signatures.on_grid(term.effect, term.members, term.starts)
        own = grid(path.states, term.shape, term.response)
        for name, change in path.changes(term.effect, own, term.response).items():
            if name in out:
                value, slope = out[name]
                slope[place] = change[-1] * term.spread
                out[name] = value + float(change[-1] @ sizes), slope
    return out


def _slowest(varied: Variations, T: float, slopes: Array) -> tuple[float, Array]:
    """Return the slowest time constant of the resonator behind its housing, and its derivatives: differences."""
    by_value = []
    for name in varied.names:
        below, above = varied.sides(name) if heats(name) else (None, None)
        moved = [slowest_lag(side.network("housing"), T) for side in (below, above) if side is not None]
        by_value.append((moved[1] - moved[0]) / (above.distance - below.distance) if above and below else 0.0)
    return slowest_lag(varied.here.network("housing"), T), np.array(by_value) @ slopes


def standings_of(found: Inferred) -> dict[str, dict[str, dict[str, Standing]]]:
    """Return what every effect would stand at in the place of each that is there, and beside all of them, as an `Answer` has it."""
    linear, outcome = found.search.linear, found.outcome
    out: dict[str, dict[str, dict[str, Standing]]] = {}

    def note(place: str, background: Background, score: float) -> None:
        term = background.terms[-1]
        known = out.setdefault(term.response, {}).setdefault(place, {})
        if term.effect.name not in known or score > known[term.effect.name].score:
            known[term.effect.name] = _standing(background, term, score)

    for leader, rivals, base in zip(outcome.final.terms, outcome.rivals, outcome.without, strict=True):
        for rival in rivals:
            note(leader.effect.name, Background(linear, rival.terms, rival.noise), rival.score - base.score)
    beside = found.background
    for seen in found.search.scan(outcome.final, less=()):
        term, _ = beside.with_term(seen.term)
        note("", Background(linear, (*beside.terms, term), beside.noise), seen.gain + PRICE)
    return out


def _standing(background: Background, term: Term, score: float) -> Standing:
    mean, C = background.coefficients(len(background.terms) - 1)
    own = term.columns.get(term.response, next(iter(term.columns.values())))
    size = float(np.sqrt(np.mean((own @ mean) ** 2)))
    times = float(np.sqrt(max(float(mean @ np.linalg.solve(C + 1e-12 * np.diag(np.diag(C)), mean)), 1e-12)))
    name = term.effect.coefficient_names(term.response)[term.members[0]]
    found = Standing(score, size, size / times, float(mean[0]), float(np.sqrt(C[0, 0])), name)
    return found if len(term.unit) == 1 else found.as_rms(term.response)


def interval(value: float, sd: float) -> dict[str, float]:
    """Return a value with its 90 % interval."""
    return {"value": value, "low": value - NINETY * sd, "high": value + NINETY * sd}
