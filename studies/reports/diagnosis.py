"""The page of a diagnosis: verdict, cause, size, gain and a picture first; the evidence after it."""

from typing import TYPE_CHECKING

from studies.diagnosis.response import RESPONSES
from studies.diagnosis.verdict import Cause, Verdict
from studies.instrument.units import split_unit, unit_of
from studies.reports.diagnosis_pictures import before_and_after, ladder, next_run_picture, residual_views
from studies.reports.digits import plain, to_interval
from studies.reports.page import Block, Chapter, Facts, Table, Text, render_page

if TYPE_CHECKING:
    from studies.diagnosis.investigate import Diagnosis

NAMES = {column: response.word for column, response in RESPONSES.items()}
WORDS = {
    "adequate": "The simulation is adequate: nothing beyond noise is left.",
    "explained": "Explained: {} nine tenths of the structure or more.",
    "not-identifiable": "Not identifiable: these data cannot decide between several causes.",
    "unexplained": "Unexplained: there is structure that no known effect explains.",
}


def shown(column: str, value: float | None, digits: int = 3) -> str:
    """Return a size of a response for people, with its unit."""
    response = RESPONSES[column]
    return "—" if value is None else f"{plain(value * response.scale, digits)} {response.shown}"


def headline(verdict: Verdict) -> str:
    """Return the verdict in one or two sentences."""
    text = _sentence(verdict)
    if verdict.causes:
        causes = "; ".join(name_cause(cause) for cause in verdict.causes)
        text += f" {causes[0].upper()}{causes[1:]}."
    return text


def _sentence(verdict: Verdict) -> str:
    causes = "the named causes remove" if len(verdict.causes) > 1 else "the named cause removes"
    return WORDS[verdict.verdict].format(causes)


def reason(verdict: Verdict) -> str:
    """Return the verdict's sentence without its name."""
    return _sentence(verdict).split(": ", 1)[-1].rstrip(".")


def name_cause(cause: Cause) -> str:
    """Return a cause, or its set, with response and probability."""
    *others, last = [cause.effect, *cause.equivalent]
    names = f"one of {', '.join(others)} and {last}" if len(others) > 1 else " or ".join([*others, last])
    return f"{names} in the {NAMES[cause.response]} (probability {cause.probability:.2f})"


def spell_parameter(name: str) -> tuple[str, float]:
    """Return a parameter's name with its unit in brackets, and what its value is multiplied by: rates are in K/min."""
    words, unit = (name, unit_of(name)) if "." in name else split_unit(name)
    factor = 1.0
    if unit.endswith(("/(K/s)", "/(K²/s)")):
        unit, factor = unit.replace("/(K/s)", " per K/min").replace("/(K²/s)", " per K²/min"), 1.0 / 60.0
    unit = unit.replace("1 per ", "per ")
    return (words if "." in name else words.replace("_", " ")) + (f" ({unit})" if unit != "1" else ""), factor


def cause_table(verdict: Verdict) -> Table:
    """Return the causes with their size in the record and their parameters."""
    rows = []
    for cause in verdict.causes:
        first = True
        for name, p in cause.parameters.items():
            lead = (
                [
                    cause.effect,
                    ", ".join(cause.equivalent) or "—",
                    NAMES[cause.response],
                    shown(cause.response, cause.peak),
                    f"{cause.probability:.2f}",
                ]
                if first
                else [""] * 5
            )
            words, factor = spell_parameter(name)
            value, low, high = to_interval(*(factor * x for x in (p.value, p.low, p.high)))
            rows.append([*lead, words, value, f"{low} … {high}" if p.high > p.low else "exact"])
            first = False
    return Table(
        "Causes",
        ("Cause", "Or equally", "In", "Peak to peak", "Probability", "Parameter", "Value", "90 % interval"),
        rows,
        "Peak to peak: what the cause changes in this record. Further coefficients of a cause are in the saved card.",
    )


def response_table(verdict: Verdict) -> Table:
    """Return every response with its residuals on rows that the fit has not seen."""
    rows = []
    for name, result in verdict.responses.items():
        extended = result.extended or (None, None)
        scale = RESPONSES[name].scale
        cells = (result.baseline[1], extended[1], result.noise, result.white, result.wander)
        left = result.left_over + (f" in {result.left_over_input}" if result.left_over_input else "")
        rows.append(
            [
                f"{NAMES[name]} ({RESPONSES[name].shown})",
                result.verdict,
                *(plain(None if value is None else value * scale) for value in cells),
                plain(result.gain),
                "—" if result.explained_share is None else f"{100 * result.explained_share:.1f} %",
                left,
            ]
        )
    return Table(
        "Responses: residual rms",
        (
            "Response",
            "Verdict",
            "Baseline",
            "With causes",
            "Noise",
            "White",
            "Wander",
            "Gain",
            "Explained",
            "Left over",
        ),
        rows,
        "Baseline and with causes: on rows left out of the fit. Noise: what no model removed, its white part a row and its "
        "wander within a run. Explained: part of the structure that the causes remove.",
    )


def remarks(verdict: Verdict) -> list[str]:
    """Return what must be said of a response beside its numbers, a sentence each."""
    found = [(NAMES[name], result.remark) for name, result in verdict.responses.items() if result.remark]
    return [f"{name[:1].upper()}{name[1:]}: {remark}." for name, remark in found]


def diagnosis_page(diagnosis: "Diagnosis") -> str:
    """Return the page as HTML."""
    verdict = diagnosis.verdict
    first: list[Block] = [Facts(_facts(verdict))]
    if diagnosis.inquiries:
        first.append(ladder(diagnosis))
    if verdict.next_experiment:
        first.append(Text(f"Next experiment: {verdict.next_experiment}", "note"))
    files = ", ".join(dict.fromkeys(run.label for run in diagnosis.campaign.runs))
    first.append(Text(f"Files read: {files}."))
    main = _main_response(verdict)
    pictures: list[Block] = []
    if main is not None and main in diagnosis.inquiries:
        pictures.append(before_and_after(diagnosis, main))
    if verdict.next_run is not None:
        pictures.append(next_run_picture(verdict.next_run))
    chapters = [
        Chapter("The answer", first),
        *([Chapter("The residual, and the next run", pictures)] if pictures else []),
        Chapter(
            "Causes and numbers",
            [
                *([cause_table(verdict)] if verdict.causes else []),
                response_table(verdict),
                *(Text(remark, "note") for remark in remarks(verdict)),
                *(Text(f"{cause.effect}: {_summary(cause)}") for cause in verdict.causes if cause.kind == "physics"),
                *(Text(f"{note[:1].upper()}{note[1:]}", "note") for note in verdict.notes),
            ],
        ),
    ]
    chapters += [
        Chapter(
            f"Residual of the {NAMES[response]}", [residual_views(diagnosis, response), *_rivals(diagnosis, response)]
        )
        for response in diagnosis.inquiries
    ]
    chapters.append(Chapter("How it was found", [Text(METHOD)]))
    return render_page("Diagnosis of a campaign", headline(verdict), chapters)


METHOD = (
    "The baseline is calibrated first: without a card, the frequency through one thermal lag with free f0, slope and curvature, the "
    "bias as a cubic in the change of frequency with an offset per run, 1/Q as a quadratic in temperature. Every effect of the "
    "library is a family of curves with a prior on its size. Models with none, one or several of them are compared by their "
    "marginal likelihood in white noise with a wander; equal ones are named as a set, and the other responses vote. Generic smooth "
    "functions of time, temperature, rate, history and drives look for what no effect explains. A cause is refused where "
    "the model with it is worse on rows that the fit has not seen."
)


def _summary(cause: Cause) -> str:
    from studies.effects import find_effect

    effect = find_effect(cause.effect)
    return f"{effect.summary}. To isolate it: {effect.isolate}. Source: {effect.source}."


def _facts(verdict: Verdict) -> list[tuple[str, str, str]]:
    facts = [("Verdict", verdict.verdict.replace("-", " "), reason(verdict))]
    for cause in verdict.causes[:3]:
        size = shown(cause.response, cause.peak)
        sure = f"{size} peak to peak in the {NAMES[cause.response]}; probability {cause.probability:.2f}"
        facts.append(("Cause", " or ".join(cause.names), sure))
    main = _main_response(verdict)
    if main is not None:
        result = verdict.responses[main]
        if result.gain is not None:
            facts.append(("Gain", f"{plain(result.gain)} times", f"of the {NAMES[main]}, on rows left out of the fit"))
        facts.append(("Noise", shown(main, result.noise), f"rms of the {NAMES[main]} that no model removes"))
    return facts


def _main_response(verdict: Verdict) -> str | None:
    if verdict.causes:
        return verdict.causes[0].response
    ranked = sorted(verdict.responses, key=lambda name: -verdict.responses[name].left_over_evidence)
    return next((name for name in ranked if verdict.responses[name].noise is not None), None)


def _rivals(diagnosis: "Diagnosis", response: str) -> list[Block]:
    inquiry = diagnosis.inquiries[response]
    blocks: list[Block] = []
    for place in inquiry.selection.places:
        nothing = place.without.score
        rows = [[n, f"{2.0 * (r.score - nothing):.1f}"] for n, r in zip(place.names, place.rivals, strict=True)]
        blocks.append(Table(f"Alternatives to {place.names[0]}", ("Effect", "Evidence"), rows))
    left = inquiry.leftover
    if left.significant:
        blocks.append(
            Text(f"Unmodelled structure: strongest against {left.input}, evidence {2.0 * left.evidence:.0f}.")
        )
    return blocks
