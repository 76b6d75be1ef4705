"""The page of a diagnosis: verdict, cause, size, gain and a picture first; the evidence after it."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.constants import zero_Celsius

from studies.diagnosis.held_out import residuals
from studies.diagnosis.planning.next_run import NextRun
from studies.diagnosis.response import RESPONSES
from studies.diagnosis.verdict import Cause, ResponseResult, Verdict
from studies.instrument.units import split_unit, unit_of
from studies.reports.digits import plain, to_interval
from studies.reports.page import Block, Chapter, Facts, Picture, Table, Text, draw, render_page
from studies.reports.style import BLACK, BLUE, ORANGE, VERMILION, figure

if TYPE_CHECKING:
    from studies.diagnosis.investigate import Diagnosis
    from studies.diagnosis.table import TableDiagnosis

NAMES = {column: response.word for column, response in RESPONSES.items()}
WORDS = {
    "adequate": "The simulation is adequate: nothing beyond noise is left.",
    "explained": "Explained: the named cause removes nine tenths of the structure or more.",
    "not-identifiable": "Not identifiable: these data cannot decide between several causes.",
    "unexplained": "Unexplained: there is structure that no known effect explains.",
}


def shown(column: str, value: float | None, digits: int = 3) -> str:
    """Return a size of a response for people, with its unit."""
    response = RESPONSES[column]
    return "—" if value is None else f"{plain(value * response.scale, digits)} {response.shown}"


def headline(verdict: Verdict) -> str:
    """Return the verdict in one or two sentences."""
    text = WORDS[verdict.verdict]
    if verdict.causes:
        causes = "; ".join(name_cause(cause) for cause in verdict.causes)
        text += f" {causes[0].upper()}{causes[1:]}."
    return text


def _reason(verdict: str) -> str:
    """Return the verdict's sentence without its name."""
    return WORDS[verdict].split(": ", 1)[-1].rstrip(".")


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


def next_run_picture(run: NextRun) -> Picture:
    """Draw the suggested run: the chamber's temperature, and the drives that step."""
    rows = 1 + len(run.drives)
    heights = [2.0] + [0.7] * len(run.drives)
    with figure(rows, 1, height=1.1 + sum(heights), sharex=True, squeeze=False, height_ratios=heights) as (
        canvas,
        axes,
    ):
        axes[0, 0].plot(run.time_h, run.temperature_degC, color=VERMILION)
        axes[0, 0].set_ylabel("chamber (°C)")
        for axis, (column, steps) in zip(axes[1:, 0], run.drives.items(), strict=True):
            begin = np.arange(len(steps.levels) + 1) * steps.hold_min / 60.0
            axis.stairs(steps.levels, begin, baseline=None, color=BLUE)
            axis.set_ylabel(column, rotation=0, ha="right", va="center", fontsize=8)
            axis.locator_params(axis="y", nbins=3)
            axis.margins(y=0.2)
        axes[-1, 0].set_xlabel("time (h)")
        return draw(canvas, f"Suggested next run: {run.profile}.", f"Chamber profile of the next run: {run.profile}.")


def _facts(verdict: Verdict) -> list[tuple[str, str, str]]:
    facts = [("Verdict", verdict.verdict.replace("-", " "), _reason(verdict.verdict))]
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


def ladder(diagnosis: "Diagnosis") -> Picture:
    """Draw what is left of every response: as shipped, calibrated, with the named physics, noise; on held-out rows."""
    columns = [c for c in diagnosis.verdict.responses if c in diagnosis.inquiries]
    with figure(1, len(columns), height=3.0, squeeze=False) as (canvas, axes):
        for axis, column in zip(axes[0], columns, strict=True):
            response, result = RESPONSES[column], diagnosis.verdict.responses[column]
            steps = [(word, value) for word, value in rungs(result) if value]
            values = [value * response.scale for _, value in steps]
            colours = {"as shipped": BLACK, "calibrated": VERMILION, "with causes": BLUE, "noise": ORANGE}
            axis.bar(range(len(steps)), values, color=[colours[word] for word, _ in steps], width=0.7)
            for k, (_, value) in enumerate(steps):
                label = f"{plain(value * response.scale)} {response.shown}"
                kelvin = as_temperature(diagnosis, column, value)
                axis.annotate(
                    label if kelvin is None else f"{label}\n{kelvin}",
                    (k, values[k]),
                    ha="center",
                    va="bottom",
                    fontsize=8,
                )
            axis.set_xticks(range(len(steps)), [word.replace(" ", "\n") for word, _ in steps], fontsize=8)
            axis.set_ylim(0.0, 1.3 * max(values, default=1.0))
            axis.set_title(f"{response.word} ({response.shown})", loc="left", fontsize=10)
            axis.grid(visible=False, axis="x")
        return draw(
            canvas,
            "Residual of each response, rms; calibrated and with causes: on rows left out of the fit. Of the frequency also as an error of temperature.",
            "Bars of the residual rms of each response from the calibrated simulation to the noise.",
        )


def rungs(result: ResponseResult) -> list[tuple[str, float | None]]:
    """Return the steps of the ladder, held out where that could be had."""

    def best(pair: tuple[float | None, float | None] | None) -> float | None:
        return None if pair is None else (pair[1] if pair[1] is not None else pair[0])

    return [
        ("as shipped", result.shipped),
        ("calibrated", best(result.baseline)),
        ("with causes", best(result.extended)),
        ("noise", result.noise),
    ]


def as_temperature(diagnosis: "Diagnosis", column: str, value: float) -> str | None:
    """Return the error of temperature that a residual of the frequency amounts to; None for the others."""
    if not RESPONSES[column].thermometer:
        return None
    inquiry = diagnosis.inquiries[column]
    steep = np.concatenate([np.abs(view.steep) for view in inquiry.final.tangent.views])
    slope = float(np.median(steep)) if steep.size else 0.0
    return (
        None
        if not slope
        else f"{plain(1e3 * value / slope, 2)} mK"
        if value < 0.1 * slope
        else f"{plain(value / slope, 2)} K"
    )


def _main_response(verdict: Verdict) -> str | None:
    if verdict.causes:
        return verdict.causes[0].response
    ranked = sorted(verdict.responses, key=lambda name: -verdict.responses[name].left_over_evidence)
    return next((name for name in ranked if verdict.responses[name].noise is not None), None)


def before_and_after(diagnosis: "Diagnosis", response: str) -> Picture:
    """Draw the residual over the campaign before and, if anything is named, after the extension; the noise as a band."""
    inquiry, unit = diagnosis.inquiries[response], RESPONSES[response]
    noise = (diagnosis.verdict.responses[response].noise or 0.0) * unit.scale
    strips = [(inquiry.plain, "the calibrated simulation", VERMILION)]
    if inquiry.final.terms:
        strips = [(inquiry.plain, "before: the calibrated simulation", VERMILION)]
        strips.append((inquiry.final, "after: with the named causes", BLUE))
    with figure(len(strips), 1, height=2.0 * len(strips), sharex=True, sharey=True, squeeze=False) as (canvas, grid):
        axes = grid[:, 0]
        for axis, (model, title, colour) in zip(axes, strips, strict=True):
            begin = 0.0
            for run, rest in zip(diagnosis.campaign.runs, residuals(model, diagnosis.campaign), strict=True):
                time, values = _thinned(run.row_time, rest * unit.scale)
                axis.plot((begin + time - time[0]) / 3600.0, values, color=colour, linewidth=0.6)
                begin += float(run.row_time[-1] - run.row_time[0])
                axis.axvline(begin / 3600.0, color="#b0b6bd", linewidth=0.8)
            axis.axhspan(-2 * noise, 2 * noise, color=ORANGE, alpha=0.25, label="noise, ± 2 rms")
            axis.set_title(title, loc="left", fontsize=10)
            axis.set_ylabel(f"residual ({unit.shown})")
        axes[0].legend(loc="upper right")
        axes[-1].set_xlabel("time of the runs one after the other (h)")
        when = " before and after the extension" if inquiry.final.terms else ""
        return draw(
            canvas,
            f"Residual of the {NAMES[response]}{when}.",
            f"The {NAMES[response]} residual over time{when}; the last strip has rms {plain(noise)} {unit.shown}.",
        )


def _thinned(time: np.ndarray, values: np.ndarray, most: int = 500) -> tuple[np.ndarray, np.ndarray]:
    step = max(1, time.size // most)
    return time[::step], values[::step]


def residual_views(diagnosis: "Diagnosis", response: str) -> Picture:
    """Draw the baseline's residual against temperature (heating and cooling), rate, frequency and the drives."""
    campaign, inquiry, unit = diagnosis.campaign, diagnosis.inquiries[response], RESPONSES[response]
    fit = inquiry.plain
    problem, views = fit.problem, fit.tangent.views
    rest = fit.residual * unit.scale
    inputs: dict[str, np.ndarray] = {
        "resonator temperature (°C)": problem.stack([v.seen.resonator - zero_Celsius for v in views]),
        "rate (K/min)": 60.0 * problem.stack([v.seen.rate for v in views]),
    }
    if "frequency_Hz" in campaign.responses:
        inputs["frequency (Hz)"] = problem.stack([run.responses["frequency_Hz"] for run in campaign.runs])
    for label, drive in (("amplitude (V)", "amplitude_squared"), ("electrode voltage (V)", "voltage_squared")):
        if all(getattr(v.coarse, drive) is not None for v in views):
            inputs[label] = np.sqrt(problem.stack([getattr(v.coarse, drive) for v in views]))
    heating = inputs["rate (K/min)"] > 0
    runs = np.concatenate([np.full(int(mask.sum()), k) for k, mask in enumerate(problem.present)])
    columns = 2
    rows = (len(inputs) + 2) // columns
    with figure(rows, columns, height=2.5 * rows, sharey=True) as (canvas, axes):
        flat = list(np.ravel(axes))
        for axis, (label, values) in zip(flat, inputs.items(), strict=False):
            axis.plot(
                values[heating], rest[heating], ".", color=VERMILION, markersize=2, label="heating", rasterized=True
            )
            axis.plot(values[~heating], rest[~heating], ".", color=BLUE, markersize=2, label="cooling", rasterized=True)
            axis.set_xlabel(label)
            axis.locator_params(axis="x", nbins=4)
            axis.ticklabel_format(axis="x", useOffset=False)
        axis = flat[len(inputs)]
        axis.boxplot([rest[runs == k] for k in np.unique(runs)], showfliers=False)
        axis.set_xlabel("run")
        for axis in flat[len(inputs) + 1 :]:
            axis.set_visible(False)
        for axis in flat[::columns]:
            axis.set_ylabel(f"residual ({unit.shown})")
        flat[0].legend(markerscale=4)
        return draw(
            canvas,
            f"Baseline residual of the {NAMES[response]} (means over {campaign.step:.0f} s) against its inputs.",
            f"Scatter of the {NAMES[response]} residual against temperature, rate, frequency and drives.",
        )


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


def table_text(found: "TableDiagnosis") -> str:
    """Return the diagnosis of a steady-state table as text."""
    following = [f"Next: {found.verdict.next_experiment}"] if found.verdict.next_experiment else []
    return "\n".join([headline(found.verdict), *found.sentences, *following])


def table_page(found: "TableDiagnosis", path: str) -> str:
    """Return the page of a steady-state table as HTML."""
    return render_page(f"Diagnosis of {Path(path).name}", headline(found.verdict), table_chapters(found))


def table_chapters(found: "TableDiagnosis") -> list[Chapter]:
    """Return the chapters of a steady-state table: the answer, and who else could have given it."""
    facts = [
        ("Verdict", found.verdict.verdict.replace("-", " "), _reason(found.verdict.verdict)),
        ("Law imposed", f"{plain(1e3 * found.law_rms)} mHz", "misfit rms with the law's curvature fixed"),
        ("Curvature", f"{plain(found.curvature_ratio)} times", "the measured one over the law's"),
    ]
    rows = [[name, plain(ssq), plain(loo), plain(score)] for name, ssq, loo, score in found.candidates]
    columns = ("Candidate", "Sum of squares (Hz²)", "Leave-one-out (Hz)", "Evidence")
    candidates = Table("Candidates on top of the baseline", columns, rows)
    following = found.verdict.next_experiment
    note = [Text(f"Next experiment: {following}", "note")] if following else []
    return [
        Chapter("The answer", [Facts(facts), *note, table_residuals(found), *(Text(s) for s in found.sentences)]),
        Chapter("Candidates", [candidates]),
    ]


def table_residuals(found: "TableDiagnosis") -> Picture:
    """Draw what the law, the baseline and the strongest candidate leave of a steady-state table."""
    with figure(1, 1, height=3.2) as (canvas, axis):
        # lines in the order of the rows, so that a loop shows as one
        axis.plot(found.temperature, found.law_residual, "o-", color=VERMILION, label="law imposed, f₀ and slope free")
        axis.plot(found.temperature, found.baseline_residual, "s-", color=ORANGE, label="baseline: curvature free")
        axis.plot(found.temperature, found.extended_residual, "^-", color=BLACK, label="with the strongest candidate")
        axis.set_xlabel("temperature (°C)")
        axis.set_ylabel("measured − model (Hz)")
        axis.legend()
        return draw(
            canvas, "What each model leaves of the measured table.", "Residuals of three models over temperature."
        )
