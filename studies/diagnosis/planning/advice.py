"""The next experiment: what would separate what these data leave together, by a run or by a sensor."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from shell.material import spell
from studies.diagnosis.campaign import Campaign, longest_resolved
from studies.diagnosis.model import Fit
from studies.diagnosis.planning.next_run import (
    NOTHING,
    SMALLEST,
    Scored,
    as_next_run,
    between_rivals,
    to_detect,
)
from studies.diagnosis.planning.programme import candidates, programme_for
from studies.diagnosis.response import RESPONSES
from studies.diagnosis.verdict import Cause, Verdict
from studies.effects import find_effect
from studies.planning.chamber import Chamber
from studies.planning.programme import NextRun

if TYPE_CHECKING:
    from studies.diagnosis.inquiry import Inquiry
    from studies.diagnosis.search import Place

CLOSE = 10.0
"""A rival whose log evidence comes so near the winner's deserves a run, even where it is no member of the set."""
Advice = tuple[str | None, NextRun | None]


def suggest_next(
    campaign: Campaign, verdict: Verdict, inquiries: "Mapping[str, Inquiry]", chamber: Chamber | None = None
) -> Advice:
    """Return one or two sentences about the run that would tell most and the run itself; None when nothing is open."""
    if not inquiries:
        return "Record a run that covers the temperature range in both directions.", None
    if verdict.verdict == "unexplained":
        return _look_again(campaign, verdict, inquiries, chamber)
    clock = next((i.final for i in inquiries.values() if i.problem.response.thermometer), None)
    for cause in verdict.causes:
        if cause.equivalent:
            return _separate(campaign, cause, inquiries, clock, chamber)
    if not verdict.causes:
        return _detect(campaign, {column: i.final for column, i in inquiries.items()}, chamber)
    for cause in verdict.causes:
        place = _place_of(cause, inquiries)
        if place is None:
            continue
        best = place.rivals[0].score
        near = [n for n, r in zip(place.names, place.rivals, strict=True) if r.score > best - CLOSE]
        if len(near) > 1:
            scored = between_rivals(campaign, place, near, _clock_for(cause, clock), chamber)
            if scored and scored[0].evidence > SMALLEST:
                return _told(scored, f"To confirm {cause.effect} against {spell(near[1:])}, run")
    return None, None


def _clock_for(cause: Cause, clock: Fit | None) -> Fit | None:
    return None if RESPONSES[cause.response].thermometer else clock


def _place_of(cause: Cause, inquiries: "Mapping[str, Inquiry]") -> "Place | None":
    places = inquiries[cause.response].selection.places
    return next((place for place in places if place.names[0] in cause.names), None)


def _separate(
    campaign: Campaign,
    cause: Cause,
    inquiries: "Mapping[str, Inquiry]",
    clock: Fit | None,
    chamber: Chamber | None,
) -> Advice:
    """Separate the members of a set; those that no record separates need another measurement, not a run."""
    place = _place_of(cause, inquiries)
    effect = find_effect(cause.effect)
    exact = [name for name in cause.equivalent if name in effect.equivalents.get(cause.response, ())]
    names = [cause.effect, *(name for name in cause.equivalent if name not in exact)]
    sensors = {find_effect(name).sensor for name in cause.names} - {""}
    sensor = f" Alternatively, without a run: {'; or '.join(sorted(sensors))}." if sensors else ""
    further = f"No run can distinguish {cause.effect} from {spell(exact)}: {effect.isolate}."
    if place is not None and len(names) > 1:
        scored = between_rivals(campaign, place, names, _clock_for(cause, clock), chamber)
        if scored and scored[0].evidence > SMALLEST:
            text, run = _told(scored, f"To distinguish {cause.effect} from {spell(names[1:])}, run")
            return (f"{text} {further}" if exact else f"{text}{sensor}"), run
    if exact:
        return further, None
    return f"To distinguish {cause.effect} from {spell(names[1:])}: {effect.isolate}.{sensor}", None


def _detect(campaign: Campaign, models: Mapping[str, Fit], chamber: Chamber | None) -> Advice:
    scored = to_detect(campaign, models, chamber)
    if not scored:
        return None, None
    return _told(scored, "No cause is named. A hidden cause would show best in")


def _told(scored: Sequence[Scored], begin: str) -> Advice:
    best = scored[0]
    repeat = max((s for s in scored if s.programme.repeats), key=lambda s: s.evidence, default=None)
    run = as_next_run(best, None if repeat is None else repeat.evidence)
    text = f"{begin} {_name(best)} ({best.programme.hours:.2g} h): expected evidence {best.evidence:.0f}"
    if best.pair[1] == NOTHING:
        text += " for an effect whose evidence is 10 now"
    if repeat is not None and repeat is not best:
        text += f", against {repeat.evidence:.0f} for a {repeat.programme.profile} ({repeat.programme.hours:.2g} h)"
    return f"{text}.", run


def _name(scored: Scored) -> str:
    programme = scored.programme
    drives = ", ".join(
        f"{column} stepped between {min(steps.levels):g} and {max(steps.levels):g}"
        for column, steps in programme.drives.items()
    )
    profile = f"a {programme.profile}" if programme.repeats else f"`{programme.profile}`"
    return f"{profile} with {drives}" if drives else profile


def _look_again(
    campaign: Campaign, verdict: Verdict, inquiries: "Mapping[str, Inquiry]", chamber: Chamber | None
) -> Advice:
    results = verdict.responses
    name = max(
        (name for name, result in results.items() if result.verdict == "unexplained"),
        key=lambda name: results[name].left_over_evidence,
    )
    if (line := inquiries[name].leftover.line) is not None:
        hours = longest_resolved(line.period) / 3600.0
        text = f"{name} has a periodic component of {line.period:.3g} s, which averages over {campaign.step:.3g} s do not resolve: "
        return f"{text}diagnose a part of at most {hours:.2g} h by itself, so that the finer grid resolves it.", None
    seen = results[name].left_over_input
    programme = programme_for(campaign, seen, chamber)
    repeat = candidates(campaign, (), chamber)[0]
    scored = Scored(programme, 0.0, ("", ""))
    text = f"{name} has structure in {seen} that no known effect explains: run a {repeat.profile} unchanged to see whether it recurs"
    text += "." if programme.repeats else f", then {_name(scored)}, which varies only that."
    return text, as_next_run(scored, None, expected=False)
