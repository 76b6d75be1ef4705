"""From evidence to words: sets that the data cannot separate, probabilities, and the verdict of each response."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from compensation.constants import NINETY
from studies.diagnosis.constants import CONSTANTS
from studies.effects import find_effect

if TYPE_CHECKING:
    from pandas import DataFrame

    from studies.planning.programme import NextRun

VERDICTS = ("unexplained", "not-identifiable", "explained", "adequate")

FAR = 2.0
"""Prior standard deviations beyond which a value of the card is wrong."""
SHOWN_IN = {"bias": "bias_deg_per_h", "loss": "inverse_q"}
"""Response that shows the values of a table; of the others it is the frequency."""


@dataclass(frozen=True)
class Interval:
    """A value with its 90 % interval."""

    value: float
    low: float
    high: float

    @classmethod
    def about(cls, value: float, sd: float, low: float = -np.inf, high: float = np.inf) -> "Interval":
        """Return the interval of a value with a normal error, within bounds."""
        return cls(value, max(value - NINETY * sd, low), min(value + NINETY * sd, high))

    @property
    def sd(self) -> float:
        """Its standard deviation, were its error normal."""
        return (self.high - self.low) / (2.0 * NINETY)

    def as_dict(self) -> dict[str, float]:
        """Return the object of the contract."""
        return {"value": self.value, "low": self.low, "high": self.high}


@dataclass(frozen=True)
class Cause:
    """One named cause, or the set that these data cannot separate; `kind` is "physics" or "value" (of the card)."""

    effect: str
    response: str
    probability: float
    equivalent: tuple[str, ...]
    parameters: Mapping[str, Interval]
    evidence: float
    kind: str = "physics"
    peak: float = 0.0
    """Largest less smallest change of the response that the effect makes in this campaign, in its unit."""
    shapes: Mapping[str, Mapping[str, Interval]] = field(default_factory=dict)
    """Where and when each of its equals would be: shape parameters by name."""
    together: bool = False
    """Whether it was found in one with others."""

    @property
    def names(self) -> tuple[str, ...]:
        """The effect and its equals."""
        return (self.effect, *self.equivalent)

    @property
    def is_wrong_value(self) -> bool:
        """Whether it is a value of the card that is rather wrong than not."""
        return self.kind == "value" and self.probability >= CONSTANTS["believed"]

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of the contract."""
        return {
            "kind": self.kind,
            "effect": self.effect,
            "response": self.response,
            "probability": round(self.probability, 4),
            "equivalent": list(self.equivalent),
            "parameters": {name: p.as_dict() for name, p in self.parameters.items()},
            "evidence": self.evidence,
            "peak_to_peak": self.peak,
            "summary": find_effect(self.effect).summary if self.kind == "physics" else "a value of the card",
        }


@dataclass(frozen=True)
class Shift:
    """A value that the baseline moved: the card's, the calibrated one, and how far it went in its own uncertainty."""

    parameter: str
    card: float
    value: float
    low: float
    high: float
    shift_sd: float

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of the contract."""
        return dict(vars(self))


@dataclass(frozen=True)
class ResponseResult:
    """What was found about one response; `noise`, rms per row of what no model could remove, has the parts `white` and `wander`."""

    verdict: str
    noise: float | None
    baseline: tuple[float | None, float | None]
    extended: tuple[float | None, float | None] | None
    left_over: str
    left_over_input: str = ""
    left_over_evidence: float = 0.0
    explained_share: float | None = None
    remark: str = ""
    white: float | None = None
    wander: float | None = None
    shipped: float | None = None
    run_shifts: tuple[float, ...] = ()

    @property
    def gain(self) -> float | None:
        """Baseline over extended held-out residual."""
        return gain_of(self.baseline[1], self.extended[1]) if self.extended else None

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of the contract."""

        def pair(values: tuple[float | None, float | None] | None) -> dict[str, float | None] | None:
            return None if values is None else {"residual_rms": values[0], "held_out_rms": values[1]}

        out: dict[str, Any] = {
            "verdict": self.verdict,
            "noise": self.noise,
            "white": self.white,
            "wander": self.wander,
            "shipped_rms": self.shipped,
            "baseline": pair(self.baseline),
            "extended": pair(self.extended),
            "gain": self.gain,
            "explained_share": self.explained_share,
            "left_over": self.left_over,
            "left_over_evidence": self.left_over_evidence,
            "run_shifts": list(self.run_shifts),
        }
        if self.left_over_input:
            out["left_over_input"] = self.left_over_input
        if self.remark:
            out["remark"] = self.remark
        return out


@dataclass(frozen=True)
class Verdict:
    """The outcome of a diagnosis, as the contract lays it down."""

    verdict: str
    causes: tuple[Cause, ...]
    responses: Mapping[str, ResponseResult]
    next_experiment: str | None
    notes: tuple[str, ...] = ()
    extended_model: str | None = None
    next_run: "NextRun | None" = None
    calibration: tuple[Shift, ...] = ()
    details: Mapping[str, Any] = field(default_factory=dict)

    @property
    def named(self) -> tuple[Cause, ...]:
        """Causes without values of the card that chance may have moved."""
        return tuple(one for one in self.causes if one.kind != "value" or one.is_wrong_value)

    def __str__(self) -> str:
        causes = "; ".join(
            f"{' or '.join(cause.names)} in {cause.response}, probability {cause.probability:.2f}"
            for cause in self.named
        )
        return f"{self.verdict}: {causes}" if causes else self.verdict

    def to_frame(self) -> "DataFrame":
        """Return one row a response: verdict, noise, residuals without and with the causes, gain."""
        import pandas as pd

        rows = {name: result.as_dict() for name, result in self.responses.items()}
        table = pd.json_normalize(list(rows.values())) if rows else pd.DataFrame()
        table.index = pd.Index(rows, name="response")
        return table

    def as_dict(self) -> dict[str, Any]:
        """Return the object of `hrg diagnose --json`."""
        return {
            "schema": "hrg.diagnosis/1",
            "verdict": self.verdict,
            "causes": [cause.as_dict() for cause in self.causes],
            "calibration": [shift.as_dict() for shift in self.calibration],
            "responses": {name: result.as_dict() for name, result in self.responses.items()},
            "next_experiment": self.next_experiment,
            "next_run": None if self.next_run is None else self.next_run.as_dict(),
            "extended_model": self.extended_model,
            "notes": list(self.notes),
            **self.details,
        }


def spell_structure(input_: str) -> str:
    """Return what is left over in words, from "temperature: a narrow feature": a narrow feature in temperature."""
    place, _, what = input_.partition(": ")
    return what if what and place == "time" else f"{what or 'structure'} in {place}"


def gain_of(before: float | None, after: float | None) -> float | None:
    """Return by how much causes lower what is left; None where that is not known."""
    return before / after if before is not None and after else None


def overall(verdicts: Sequence[str]) -> str:
    """Return the first verdict, in the contract's order, that any response has."""
    return next((v for v in VERDICTS if v in verdicts), "not-identifiable")


def doubted(causes: Sequence[Cause]) -> tuple[Cause, ...]:
    """Return the causes, strongest first, with probabilities lowered by how often such names were wrong; further names
    may only patch the first.
    """
    first = next((cause for cause in causes if cause.kind == "physics"), None)
    one = first is not None and first.together
    alike = [cause is first or cause.kind == "value" or (cause.together and one) for cause in causes]
    return tuple(
        replace(cause, probability=cause.probability * (1.0 - share_wrong(cause.evidence, not one)))
        for cause, one in zip(causes, alike, strict=True)
    )


def share_wrong(evidence: float, further: bool) -> float:
    """Return the probability that a name is wrong for reasons outside the likelihood: the less, the more evidence it has."""
    usual = scipy.special.logit(CONSTANTS["doubt"]) - CONSTANTS["doubt_falls"] * np.log(max(evidence, 1.0) / 100.0)
    return float(scipy.special.expit(usual + further * np.log(CONSTANTS["doubt_further"])))


def temper_of(lead: float) -> float:
    """Return what differences of log evidence are divided by where so much is explained: no form is exact."""
    return CONSTANTS["temper"] + CONSTANTS["misfit"] * max(lead, 0.0)


def weigh(
    names: Sequence[str], scores: Sequence[float], nothing: float, unknown: float = -np.inf
) -> tuple[tuple[str, ...], float]:
    """Return the set of effects that stands for one cause, the likeliest first, and the probability that it holds the truth.

    Weights exp(score / temper) of log posteriors: of `names`, of `nothing`, and of structure that nobody can name
    (`unknown`). No form is exact: a difference counts less by a part of the best one's lead over nothing.
    """
    values = np.array(scores, dtype=float)
    order = np.argsort(-values)
    lead = float(values.max()) - nothing
    temper = temper_of(lead)
    weight = np.exp((values - values.max()) / temper)
    chance = np.exp(max(-lead, 0.0) / temper - max(lead - CONSTANTS["margin"] / 2.0, 0.0) / CONSTANTS["chance"])
    # a generic form must be the better one by as much as the named form may be inexact before it counts for more
    strange = np.exp(np.clip(unknown / (temper if unknown > 0 else CONSTANTS["temper"]), -50.0, 50.0))
    members: list[str] = []
    for k in order:
        if weight[k] >= CONSTANTS["member"] and names[k] not in members:
            members.append(names[k])
    inside = sum(w for w, name in zip(weight, names, strict=True) if name in members)
    probability = float(inside / (weight.sum() * (1.0 + strange) + chance))
    return tuple(members), probability


def wrong_values(shifts: Sequence[Shift]) -> list[Cause]:
    """Return the card's values that the data move by more than two of their standard deviations: of many, some do by chance."""
    return [
        Cause(
            shift.parameter,
            SHOWN_IN.get(shift.parameter.partition(".")[0], "frequency_Hz"),
            _doubt_of_sd(shift.shift_sd),
            (),
            {shift.parameter: Interval(shift.value, shift.low, shift.high)},
            shift.shift_sd**2,
            kind="value",
        )
        for shift in shifts
        if abs(shift.shift_sd) > FAR
    ]


def _doubt_of_sd(z: float) -> float:
    """Probability that a card states too small a deviation of a value moved by z of it: the prior odds of an effect, times e^((z² − 1)/2)/|z| at most."""
    return float(scipy.special.expit(CONSTANTS["log_prior_effect"] + (z**2 - 1.0) / 2.0 - np.log(abs(z))))


def same_cause(one: Cause, two: Cause) -> bool:
    """Return whether two entries are one cause: one effect in two responses whose places agree, or two members of one set."""
    if one.response == two.response:
        return one.effect == two.effect or (one.effect in two.equivalent and two.effect in one.equivalent)
    if not all(_acts(name, own.response) for name in (*one.names, *two.names) for own in (one, two)):
        return False
    shared = [name for name in (one.effect, two.effect) if name in one.names and name in two.names]
    return any(_agree(one.shapes.get(name, {}), two.shapes.get(name, {})) for name in shared)


def _acts(name: str, response: str) -> bool:
    effect = find_effect(name)
    return effect.thermal or response in effect.responses


def _agree(one: Mapping[str, Interval], two: Mapping[str, Interval]) -> bool:
    for name in ("time_s", "temperature_degC", "period_s", "run"):
        if name in one and name in two:
            a, b = one[name], two[name]
            slack = 300.0 if name == "time_s" else 0.05 * abs(b.value) + 0.5
            if not (a.low - slack <= b.value <= a.high + slack or b.low - slack <= a.value <= b.high + slack):
                return False
    return True
