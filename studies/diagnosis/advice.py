"""The next experiment: what would separate what this data leaves together."""

from collections.abc import Mapping, Sequence

from studies.diagnosis.campaign import Campaign
from studies.diagnosis.effects import find_effect
from studies.diagnosis.next_run import NOTHING, SMALLEST, NextRun, Scored, as_next_run, between_rivals, to_detect
from studies.diagnosis.programme import candidates, programme_for
from studies.diagnosis.selection import Found, Selection
from studies.diagnosis.verdict import Cause, ResponseResult

CLOSE = 20.0
"""A rival whose evidence comes so near the winner's deserves a run, even where it is no member of the set."""
Advice = tuple[str | None, NextRun | None]


def suggest_next(
    campaign: Campaign,
    verdict: str,
    causes: Sequence[Cause],
    results: Mapping[str, ResponseResult],
    selections: Mapping[str, Selection],
) -> Advice:
    """Return one or two sentences about the run that would tell most and the run itself; None when nothing is open.

    Parameters
    ----------
    campaign : Campaign
    verdict : str
        Overall.
    causes : sequence of Cause
    results : mapping from response to ResponseResult
    selections : mapping from response to Selection
    """
    if not selections:
        return "Record a run that covers the temperature range in both directions.", None
    if verdict == "unexplained":
        return _look_again(campaign, results)
    for cause in causes:
        if cause.equivalent:
            return _separate(campaign, cause, selections)
    if not causes:
        return _detect(campaign, selections)
    for cause in causes:
        found = _place_of(cause, selections)
        if found is not None and (near := _near(found)):
            scored = between_rivals(campaign, selections[cause.response], found, near, selections)
            if scored and scored[0].evidence > SMALLEST:
                return _told(scored, f"To confirm {cause.effect} against {' and '.join(near[1:])}, run", campaign)
    return None, None


def _place_of(cause: Cause, selections: Mapping[str, Selection]) -> Found | None:
    places = selections[cause.response].found
    return next((f for f in places if f.rivals[0].name in (cause.effect, *cause.equivalent)), None)


def _near(found: Found) -> list[str]:
    best = found.rivals[0].evidence
    near = [rival.name for rival in found.rivals if rival.evidence > best - CLOSE]
    return near if len(near) > 1 else []


def _separate(campaign: Campaign, cause: Cause, selections: Mapping[str, Selection]) -> Advice:
    """Separate the members of a set; those that no record separates need another measurement, not a run."""
    found = _place_of(cause, selections)
    exact = set((find_effect(cause.effect).equivalents or {}).get(cause.response, ()))
    names = [cause.effect, *(name for name in cause.equivalent if name not in exact)]
    further = f"No run separates {cause.effect} from {', '.join(sorted(exact))}: {find_effect(cause.effect).isolate}."
    if found is not None and len(names) > 1:
        scored = between_rivals(campaign, selections[cause.response], found, names, selections)
        if scored and scored[0].evidence > SMALLEST:
            others = " and ".join(names[1:])
            text, run = _told(scored, f"To separate {cause.effect} from {others}, run", campaign)
            return f"{text} {further}" if exact & set(cause.equivalent) else text, run
    if exact & set(cause.equivalent):
        return further, None
    return f"To separate {cause.effect} from {', '.join(names[1:])}: {find_effect(cause.effect).isolate}.", None


def _detect(campaign: Campaign, selections: Mapping[str, Selection]) -> Advice:
    scored = to_detect(campaign, selections)
    if not scored:
        return None, None
    return _told(scored, "Nothing is named; what may be hidden would show best in", campaign)


def _told(scored: Sequence[Scored], begin: str, campaign: Campaign) -> Advice:
    best = scored[0]
    repeat = next((s for s in scored if s.programme.repeats), None)
    run = as_next_run(best, None if repeat is None else repeat.evidence)
    text = f"{begin} {_name(best)}: expected evidence {best.evidence:.0f}"
    if best.pair[1] == NOTHING:
        text += " for an effect that stands at 10 today"
    if repeat is not None and repeat is not best:
        text += f", against {repeat.evidence:.0f} for a {repeat.programme.profile}"
    return f"{text}.", run


def _name(scored: Scored) -> str:
    programme = scored.programme
    drives = ", ".join(
        f"{column} stepped between {min(steps.levels):g} and {max(steps.levels):g}"
        for column, steps in programme.drives.items()
    )
    profile = f"a {programme.profile}" if programme.repeats else f"`{programme.profile}`"
    return f"{profile} with {drives}" if drives else profile


def _look_again(campaign: Campaign, results: Mapping[str, ResponseResult]) -> Advice:
    name = max(
        (name for name, result in results.items() if result.verdict == "unexplained"),
        key=lambda name: results[name].left_over_evidence,
    )
    seen = results[name].left_over_input
    programme = programme_for(campaign, seen)
    repeat = candidates(campaign)[0]
    scored = Scored(programme, 0.0, ("", ""))
    text = f"{name} holds structure in {seen} that no known effect has: "
    text += (
        f"run a {repeat.profile} unchanged to see whether it comes back."
        if programme.repeats
        else f"run a {repeat.profile} unchanged to see whether it comes back, then {_name(scored)}, which varies that alone."
    )
    return text, as_next_run(scored, None, expected=False)
