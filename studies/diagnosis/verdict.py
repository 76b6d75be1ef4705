"""From scores to words: sets that the data cannot separate, probabilities, and the verdict of each response."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from studies.diagnosis.consistency import Agreement
from studies.diagnosis.effects import find_effect
from studies.diagnosis.fit import Interval
from studies.diagnosis.next_run import NextRun
from studies.diagnosis.selection import Found

VERDICTS = ("unexplained", "not-identifiable", "explained", "adequate")
TEMPER = 1.6
"""Evidence differences are divided by this: likelihoods of imperfect models are too sure of themselves."""
MEMBER = 0.06
"""A rival belongs to the set when its weight is at least this part of the winner's."""
KIN = 0.15
"""Part of its evidence by which an effect must be better than one whose formula is nearly the same."""
BESIDE_UNKNOWN = 0.1
"""What is left of a claim where structure is left over: one in ten was right on 139 campaigns of the generator."""
DOUBT = 0.02
"""Share of answers that are wrong for reasons outside the likelihood."""


@dataclass(frozen=True)
class Cause:
    """One named cause, or the set that this data cannot separate."""

    effect: str
    response: str
    probability: float
    equivalent: tuple[str, ...]
    parameters: Mapping[str, Interval]
    evidence: float
    agreement: Agreement = field(default_factory=Agreement)

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of the contract."""
        return {
            "effect": self.effect,
            "response": self.response,
            "probability": round(self.probability, 4),
            "equivalent": list(self.equivalent),
            "parameters": {k: {"value": p.value, "low": p.low, "high": p.high} for k, p in self.parameters.items()},
            "evidence": self.evidence,
            "consistency": self.agreement.p,
            "summary": find_effect(self.effect).summary,
        }


@dataclass(frozen=True)
class ResponseResult:
    """What was found about one response."""

    verdict: str
    noise: float | None
    baseline: tuple[float | None, float | None]
    extended: tuple[float | None, float | None] | None
    left_over: str
    left_over_input: str = ""
    left_over_evidence: float = 0.0
    remark: str = ""

    @property
    def gain(self) -> float | None:
        """Baseline over extended held-out residual."""
        if self.extended is None or not self.extended[1] or self.baseline[1] is None:
            return None
        return self.baseline[1] / self.extended[1]

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of the contract."""

        def pair(values: tuple[float | None, float | None] | None) -> dict[str, float | None] | None:
            return None if values is None else {"residual_rms": values[0], "held_out_rms": values[1]}

        out: dict[str, Any] = {
            "verdict": self.verdict,
            "noise": self.noise,
            "baseline": pair(self.baseline),
            "extended": pair(self.extended),
            "gain": self.gain,
            "left_over": self.left_over,
            "left_over_evidence": self.left_over_evidence,
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
    details: Mapping[str, Any] = field(default_factory=dict)
    next_run: NextRun | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return the object of `hrg diagnose --json`."""
        return {
            "schema": "hrg.diagnosis/1",
            "verdict": self.verdict,
            "causes": [cause.as_dict() for cause in self.causes],
            "responses": {name: result.as_dict() for name, result in self.responses.items()},
            "next_experiment": self.next_experiment,
            "next_run": None if self.next_run is None else self.next_run.as_dict(),
            "extended_model": self.extended_model,
            "notes": list(self.notes),
        }


def overall(verdicts: Sequence[str]) -> str:
    """Return the first verdict, in the contract's order, that any response has."""
    return next((v for v in VERDICTS if v in verdicts), "not-identifiable")


def equivalent_to(found: Found, response: str, clock_drifts: bool | None = None) -> tuple[str, ...]:
    """Return the other members of the set that the data cannot separate from a selected effect.

    Parameters
    ----------
    found : Found
    response : str
    clock_drifts : bool, optional
        What a reference clock says: it tells a drifting clock from an ageing frequency.
    """
    evidence = {rival.name: rival.evidence for rival in found.rivals}
    return set_beside(found.rivals[0].name, evidence, response, clock_drifts)


def set_beside(
    name: str, evidence: Mapping[str, float], response: str, clock_drifts: bool | None = None
) -> tuple[str, ...]:
    """Return what the strongest effect cannot be told from, given the evidence of all that contend."""
    members = {other for other, own in evidence.items() if np.exp((own - evidence[name]) / (2.0 * TEMPER)) >= MEMBER}
    kin = (find_effect(name).kin or {}).get(response, ())
    members |= {other for other, own in evidence.items() if other in kin and own > (1.0 - KIN) * evidence[name]}
    clock = {"clock-drift", "ageing"}
    if clock_drifts is None or name not in clock:
        members |= set((find_effect(name).equivalents or {}).get(response, ()))
    else:
        members -= clock
    members.discard(name)
    return tuple(sorted(members))


def probability_of(found: Found, equivalent: Sequence[str], threshold: float, leftover: bool) -> float:
    """Return the probability that the truth is in the set.

    Weights exp(evidence / (2 temper)) of all rivals and of chance (at half the threshold); what the likelihood
    cannot know (a cause outside the library, a wrong noise model) takes a constant share, and most of the claim where
    structure is left over.
    """
    names = {found.rivals[0].name, *equivalent}
    evidence = np.array([rival.evidence for rival in found.rivals] + [0.5 * threshold])
    weight = np.exp((evidence - evidence.max()) / (2.0 * TEMPER))
    inside = sum(w for w, rival in zip(weight, found.rivals, strict=False) if rival.name in names)
    claim = float(inside / weight.sum()) * (1.0 - DOUBT)
    return claim * (BESIDE_UNKNOWN if leftover else 1.0)
