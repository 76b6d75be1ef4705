"""The next experiment: what would separate what this data leaves together."""

from collections.abc import Mapping, Sequence

from studies.diagnosis.campaign import Campaign
from studies.diagnosis.effects import find_effect
from studies.diagnosis.verdict import Cause, ResponseResult


def suggest_next(
    campaign: Campaign, verdict: str, causes: Sequence[Cause], results: Mapping[str, ResponseResult]
) -> str | None:
    """Return one or two sentences about the run that would tell most, or None when nothing is open."""
    for cause in causes:
        if cause.equivalent:
            names = ", ".join(cause.equivalent)
            return f"To separate {cause.effect} from {names}: {find_effect(cause.effect).isolate}."
    for name, result in results.items():
        if result.verdict == "unexplained":
            return f"{name} holds structure in {result.left_over_input} that no known effect has: repeat one run unchanged to see whether it comes back, then vary that input alone."
    if verdict == "not-identifiable":
        return "Record a run that covers the temperature range in both directions, with steps and a soak longer than five thermal constants."
    return None
