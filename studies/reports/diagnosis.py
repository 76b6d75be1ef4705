"""Parts of a diagnosis: the verdict, its causes, sizes and gain, and the evidence after them."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from studies.diagnosis.response import RESPONSES
from studies.diagnosis.verdict import Cause, Verdict, spell_structure
from studies.effects import find_effect
from studies.instrument.display import display_name, spell_parameter
from studies.reports import diagnosis_pictures as pictures
from studies.reports.digits import plain
from studies.results import Chapter, Fact, Facts, Figure, Part, Sentence, Table

if TYPE_CHECKING:
    from studies.inference.diagnosis import Inference

NAMES = {column: response.word for column, response in RESPONSES.items()}
WORDS = {
    "adequate": "Adequate: the simulation agrees with the data to within noise.",
    "explained": "Explained: {} at least 90 % of the structure in the residual.",
    "not-identifiable": "Not identifiable: these data cannot distinguish between the possible causes.",
    "unexplained": "Unexplained: no known effect explains the structure in the residual.",
}
PARTLY = "Not identifiable: beside what is named, these data do not decide every response."
UNDECIDED = "Not decided: these data neither confirm the simulation nor name a cause."
EVIDENCE = "Evidence: twice the logarithm of the Bayes factor against no effect."
CAUSES = "cause | or: or equally | response | peak: peak to peak | probability: probability .2f | name: parameter | value in low … high: value | low … high: 90 % interval .0"
RESULTS = (
    "response | verdict | baseline: baseline .3 | extended: with causes .3 | noise: noise .3 | white: white noise .3"
    " | wander: coloured noise .3 | gain: gain .3 | explained_share: explained (%) ×100 .1f | left: lack of fit"
)
WITH_CARD = (
    "Frequency, bias and 1/Q are fitted together: the card's uncertain values within their tolerances, the start of each run, what"
    " happened in gaps, and the effects in the library, each with a prior on its size, beside the noise of each response. "
)
WITHOUT_CARD = (
    "The baseline is calibrated first. Without a card it is the frequency through one thermal lag with free f0, slope and curvature,"
    " the bias as a cubic in the frequency change with an offset for each run, and 1/Q as a quadratic in temperature. "
)
METHOD = (
    "Each effect in the library is a family of curves with a prior on its size. Models with no, one or several effects are compared by their"
    " marginal likelihood in white and coloured noise. Effects that fit equally well are named as a set; the other responses help"
    " to decide between them. Smooth generic functions of time, temperature, rate, history and drives detect structure that no"
    " effect explains. A cause is rejected if it makes the prediction of held-out rows worse."
)


def shown(column: str, value: float | None, digits: int = 3) -> str:
    """Return a size of a response for people, with its unit."""
    response = RESPONSES[column]
    return "—" if value is None else f"{plain(value * response.scale, digits)} {response.shown}"


def headline(verdict: Verdict) -> str:
    """Return the verdict in a sentence, the causes in another, and in a third what they leave that noise does not."""
    known = verdict.named
    causes, others = "; ".join(map(name_cause, known)), (one for one in verdict.causes if one not in known)
    strayed = ", ".join(f"{display_name(one.effect)} by {one.evidence**0.5:.1f} standard deviations" for one in others)
    left = "; ".join(
        f"{spell_structure(one.left_over_input)} in {spoken(name)}"
        for name, one in verdict.responses.items()
        if causes and one.left_over == "structure" and one.verdict != "unexplained"
    )
    named = f" {causes[0].upper()}{causes[1:]}." if causes else ""
    chance = f" Values of the card that moved, perhaps by chance: {strayed}." if strayed else ""
    return _sentence(verdict) + named + (left and f" Still left: {left}.") + chance


def _sentence(verdict: Verdict) -> str:
    removes = "the named causes remove" if len(verdict.named) > 1 else "the named cause removes"
    if verdict.verdict == "not-identifiable" and not any(cause.equivalent for cause in verdict.causes):
        return PARTLY if verdict.named else UNDECIDED
    return WORDS[verdict.verdict].format(removes)


def reason(verdict: Verdict) -> str:
    """Return the verdict's sentence without its name."""
    return _sentence(verdict).split(": ", 1)[-1].rstrip(".")


def spoken(response: str) -> str:
    """Return a response as it stands within a sentence: the frequency, the bias, 1/Q."""
    return NAMES[response] if "/" in NAMES[response] else f"the {NAMES[response]}"


def name_cause(cause: Cause) -> str:
    """Return a cause, or its set, with response and probability."""
    *others, last = map(display_name, cause.names) if cause.kind == "value" else cause.names
    names = f"{'one of ' if len(others) > 1 else ''}{', '.join(others)}{' or ' if others else ''}{last}"
    return f"{names} in {spoken(cause.response)} (probability {cause.probability:.2f})"


def cause_table(verdict: Verdict) -> Table:
    """Return the causes with their size in the record and their parameters."""
    rows: list[dict[str, Any]] = []
    for cause in verdict.causes:
        head: dict[str, Any] = {
            "cause": display_name(cause.effect) if cause.kind == "value" else cause.effect,
            "or": ", ".join(cause.equivalent),
            "response": NAMES[cause.response],
            "peak": "" if cause.kind == "value" else shown(cause.response, cause.peak),
            "probability": cause.probability,
        }
        for name, p in cause.parameters.items():
            words, factor = spell_parameter(name)
            size = {"value": factor * p.value, "low": factor * p.low, "high": factor * p.high}
            rows.append(head | {"name": words} | size)
            head = {}
    note = "Peak to peak: change of the response in this record due to the cause. The saved card has all coefficients of a cause."
    return Table("Causes", rows, CAUSES, note)  # fmt: skip


def response_table(verdict: Verdict) -> Table:
    """Return every response with its residuals on held-out rows."""
    rows = []
    for name, one in verdict.responses.items():
        numbers: Mapping[str, float | None] = {
            "baseline": one.baseline[1], "extended": (one.extended or (None, None))[1], "noise": one.noise,
            "white": one.white, "wander": one.wander,
        }  # fmt: skip
        rows.append({
            **{key: None if value is None else value * RESPONSES[name].scale for key, value in numbers.items()},
            "response": f"{NAMES[name]} ({RESPONSES[name].shown})",
            "verdict": one.verdict,
            "gain": one.gain,
            "explained_share": one.explained_share,
            "left": ("perhaps " if one.left_over == "none" and one.left_over_input else "")
            + (spell_structure(one.left_over_input) if one.left_over_input else one.left_over),
        })  # fmt: skip
    note = "Rms residuals."
    if any(row["baseline"] is not None for row in rows):
        note += " Baseline and with causes: on rows left out of the fit, where these can be predicted."
    note += " Noise: the residual that no model removes; white: from row to row, coloured: within a run."
    if any(row["explained_share"] is not None for row in rows):
        note += " Explained: share of the structure that the causes remove."
    return Table("Responses", rows, RESULTS, note)


def remarks(verdict: Verdict) -> list[Sentence]:
    """Return remarks on responses, and the notes."""
    found = [f"{NAMES[n][:1].upper()}{NAMES[n][1:]}: {r.remark}." for n, r in verdict.responses.items() if r.remark]
    return [Sentence(words, "note") for words in (*found, *verdict.notes)]


def next_step(verdict: Verdict) -> list[Sentence]:
    """Return what to measure next."""
    return [Sentence(f"Next experiment: {verdict.next_experiment}", "note")] if verdict.next_experiment else []


def diagnosis_parts(diagnosis: "Inference") -> list[Chapter]:
    """Return what people read of the diagnosis of a campaign."""
    verdict = diagnosis.verdict
    files = ", ".join(diagnosis.labels)
    physics = [cause for cause in verdict.causes if cause.kind == "physics"]
    return [
        Chapter("The answer", [
            Sentence(headline(verdict), where="terminal"),
            Facts(_facts(verdict), "page"),
            *([Figure(lambda: pictures.ladder(diagnosis), "Rms residual of each response; for the frequency also as a temperature error. Calibrated and with causes: on held-out rows where these can be predicted, else on the rows of the fit.")] if diagnosis.shown_responses else []),
            *next_step(verdict),
            *remarks(verdict),
            Sentence(f"Files read: {files}.", where="page"),
        ]),
        Chapter("Residual and next run", list(_residual(diagnosis))),
        Chapter("Causes and responses", [
            cause_table(verdict), response_table(verdict),
            *(Sentence(f"{cause.effect}: {_summary(cause)}", where="page") for cause in physics),
        ]),
        *(Chapter(f"Residual of {spoken(name)}", list(_alternatives(diagnosis, name))) for name in diagnosis.shown_responses),
        Chapter("Method", [Sentence((WITH_CARD if diagnosis.with_card else WITHOUT_CARD) + METHOD, where="page")]),
    ]  # fmt: skip


def _residual(diagnosis: "Inference") -> Iterator[Part]:
    main, run = _main_response(diagnosis.verdict), diagnosis.verdict.next_run
    if main is not None and main in diagnosis.shown_responses:
        when = " before and after the named causes are added" if diagnosis.seen(main).named else ""
        yield Figure(lambda: pictures.before_and_after(diagnosis, main), f"Residual of {spoken(main)}{when}.")
    if run is not None:
        yield Figure(lambda: pictures.next_run_picture(run), f"Suggested next run: {run.profile}.")


def _alternatives(diagnosis: "Inference", response: str) -> Iterator[Part]:
    seen = diagnosis.seen(response)
    caption = f"Baseline residual of {spoken(response)} (averages over {seen.step:.0f} s) against its inputs."
    yield Figure(lambda: pictures.residual_views(diagnosis, response), caption)
    for rivals in seen.alternatives:
        columns = "0: effect | 1: evidence .1f"
        yield Table(f"Alternatives to {rivals[0][0]}", rivals, columns, note=EVIDENCE, where="page")
    if seen.left is not None:
        words = f"Lack of fit: strongest against {seen.left[0]}, evidence {seen.left[1]:.0f}."
        yield Sentence(words, where="page")


def _summary(cause: Cause) -> str:
    effect = find_effect(cause.effect)
    return f"{effect.summary}. To isolate it: {effect.isolate}. Source: {effect.source}."


def _facts(verdict: Verdict) -> list[Fact]:
    facts = [("Verdict", verdict.verdict.replace("-", " "), reason(verdict))]
    for cause in verdict.named[:3]:
        names = " or ".join(cause.names)
        size = f"{shown(cause.response, cause.peak)} peak to peak in {spoken(cause.response)}"
        if cause.kind == "value":
            (one,) = cause.parameters.values()
            names = display_name(cause.effect)
            size = f"{cause.effect} = {plain(one.value)} ({plain(one.low)} … {plain(one.high)})"
        facts.append(("Cause", names, f"{size}; probability {cause.probability:.2f}"))
    main = _main_response(verdict)
    if main is not None:
        result = verdict.responses[main]
        if result.gain is not None:
            remark = f"smaller residual of {spoken(main)} on held-out rows"
            facts.append(("Gain", f"{plain(result.gain)} times", remark))
        facts.append(("Noise", shown(main, result.noise), f"rms residual of {spoken(main)} that no model removes"))
    return facts  # fmt: skip


def _main_response(verdict: Verdict) -> str | None:
    if verdict.causes:
        return verdict.causes[0].response
    ranked = sorted(verdict.responses, key=lambda name: -verdict.responses[name].left_over_evidence)
    return next((name for name in ranked if verdict.responses[name].noise is not None), None)
