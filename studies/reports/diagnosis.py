"""The page of a diagnosis: verdict, cause, size, gain and a picture first; the evidence after it."""

from typing import TYPE_CHECKING

import numpy as np

from studies.diagnosis.gain import row_residuals
from studies.diagnosis.investigate import Diagnosis
from studies.diagnosis.next_run import NextRun
from studies.diagnosis.verdict import Cause, Verdict
from studies.reports.page import Block, Chapter, Facts, Picture, Table, Text, draw, render_page
from studies.reports.style import BLACK, BLUE, ORANGE, VERMILION, figure

if TYPE_CHECKING:
    from studies.diagnosis.table import TableDiagnosis

NAMES = {"frequency_Hz": "frequency", "bias_deg_per_h": "bias", "inverse_q": "1/Q"}
UNITS = {"frequency_Hz": "Hz", "bias_deg_per_h": "°/h", "inverse_q": "1"}
WORDS = {
    "adequate": "The simulation is adequate: nothing beyond noise is left.",
    "explained": "Explained: the named cause brings the residual down to noise.",
    "not-identifiable": "Not identifiable: this data cannot decide.",
    "unexplained": "Unexplained: something is there that no known effect explains.",
}


def headline(verdict: Verdict) -> str:
    """Return the verdict in one or two sentences."""
    text = WORDS[verdict.verdict]
    if verdict.causes:
        causes = "; ".join(name_cause(cause) for cause in verdict.causes)
        text += f" {causes[0].upper()}{causes[1:]}."
    return text


def name_cause(cause: Cause) -> str:
    """Return a cause, or its set, with response and probability."""
    names = " or ".join([cause.effect, *cause.equivalent])
    return f"{names} in the {NAMES[cause.response]} (probability {cause.probability:.2f})"


def number(value: float | None, digits: int = 3) -> str:
    """Return a number for people; a dash where there is none."""
    return "—" if value is None or not np.isfinite(value) else f"{value:.{digits}g}"


def cause_table(verdict: Verdict) -> Table:
    """Return the causes with parameters."""
    rows = []
    for cause in verdict.causes:
        first = True
        for name, p in cause.parameters.items():
            lead = (
                [
                    cause.effect,
                    ", ".join(cause.equivalent) or "—",
                    NAMES[cause.response],
                    f"{cause.probability:.2f}",
                    f"{cause.evidence:.0f}",
                ]
                if first
                else [""] * 5
            )
            between = f" ({number(p.low, 4)} … {number(p.high, 4)})" if p.high > p.low else ""
            rows.append([*lead, name, number(p.value, 4) + between])
            first = False
    return Table(
        "Causes",
        ("cause", "or equally", "in", "probability", "evidence", "parameter", "value (90 % interval)"),
        rows,
        "Evidence: twice the log-likelihood ratio, net of what chance gains.",
    )


def response_table(verdict: Verdict) -> Table:
    """Return every response with its residuals."""
    rows = []
    for name, result in verdict.responses.items():
        extended = result.extended or (None, None)
        rows.append(
            [
                f"{NAMES[name]} ({UNITS[name]})",
                result.verdict,
                number(result.noise),
                number(result.baseline[0]),
                number(result.baseline[1]),
                number(extended[0]),
                number(extended[1]),
                number(result.gain),
                result.left_over + (f" in {result.left_over_input}" if result.left_over_input else ""),
                result.remark or "—",
            ]
        )
    return Table(
        "Responses, residual rms",
        ("response", "verdict", "noise", "baseline", "held out", "extended", "held out", "gain", "left over", "remark"),
        rows,
        "Gain: baseline over extended residual on runs that were left out of the fit.",
    )


def diagnosis_page(diagnosis: Diagnosis) -> str:
    """Return the page as HTML."""
    verdict = diagnosis.verdict
    first: list[Block] = [Facts(_facts(verdict))]
    main = _main_response(verdict)
    if main is not None and main in diagnosis.inquiries:
        first.append(before_and_after(diagnosis, main))
    if verdict.next_experiment:
        first.append(Text(f"Next experiment: {verdict.next_experiment}", "note"))
    if verdict.next_run is not None:
        first.append(next_run_picture(verdict.next_run))
    chapters = [
        Chapter("The answer", first),
        Chapter(
            "Causes and numbers",
            [
                *([cause_table(verdict)] if verdict.causes else []),
                response_table(verdict),
                *(Text(f"{cause.effect}: {_summary(cause)}") for cause in verdict.causes),
                *(Text(f"{cause.effect}: {agreement_words(cause)}") for cause in verdict.causes),
                *(Text(note, "note") for note in verdict.notes),
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
    "The baseline is calibrated first: the frequency through one thermal lag with free f0, slope and curvature; the bias as a cubic in "
    "the change of frequency with an offset per run; 1/Q as a quadratic in temperature. Every effect of the library is then "
    "fitted inside a likelihood of white plus slow noise, its shape polished, and accepted only when its evidence exceeds "
    "what the best of all signatures gains on pure noise. Smooth functions of time, temperature, rate and drives look "
    "for what no effect explains. Gains are measured on runs that the fit has not seen."
)


def _summary(cause: Cause) -> str:
    from studies.diagnosis.effects import find_effect

    effect = find_effect(cause.effect)
    return f"{effect.summary}. To isolate it: {effect.isolate}. Source: {effect.source}."


def agreement_words(cause: Cause) -> str:
    """Return whether all parts of the record agree about a cause's coefficient."""
    agreement = cause.agreement
    if not agreement.by_split:
        return "no two parts of the record both measure its coefficient."
    if agreement.p < DISAGREE:
        return f"{SPLITS[agreement.split]} disagree about its coefficient (p = {agreement.p:.1g})."
    said = ", ".join(SPLITS[name] for name in agreement.by_split)
    return f"its coefficient is the same in {said} (p = {agreement.p:.2g})."


DISAGREE = 1e-3
SPLITS = {
    "hot and cold": "the hot and the cold half",
    "heating and cooling": "heating and cooling",
    "early and late": "the early and the late half of the runs",
    "run and run": "the runs",
}


def next_run_picture(run: NextRun) -> Picture:
    """Draw the suggested run: the chamber's temperature, and the drives that step."""
    rows = 1 + len(run.drives)
    heights = [2.0] + [0.7] * len(run.drives)
    with figure(rows, 1, height=1.1 + sum(heights), sharex=True, squeeze=False, height_ratios=heights) as (
        canvas,
        axes,
    ):
        axes[0, 0].plot(run.time_h, run.temperature_degC, color=VERMILION)
        axes[0, 0].set_ylabel("chamber / °C")
        for axis, (column, steps) in zip(axes[1:, 0], run.drives.items(), strict=True):
            begin = np.arange(len(steps.levels) + 1) * steps.hold_min / 60.0
            axis.stairs(steps.levels, begin, baseline=None, color=BLUE)
            axis.set_ylabel(column, rotation=0, ha="right", va="center", fontsize=8)
            axis.locator_params(axis="y", nbins=3)
            axis.margins(y=0.2)
        axes[-1, 0].set_xlabel("time / h")
        return draw(canvas, f"Suggested next run: {run.profile}.", f"Chamber profile of the next run: {run.profile}.")


def _facts(verdict: Verdict) -> list[tuple[str, str, str]]:
    facts = [("verdict", verdict.verdict, WORDS[verdict.verdict])]
    if verdict.causes:
        cause = verdict.causes[0]
        facts.append(("cause", " or ".join([cause.effect, *cause.equivalent]), f"probability {cause.probability:.2f}"))
        name, p = list(cause.parameters.items())[-1]
        facts.append(("size", number(p.value), f"{name}, 90 %: {number(p.low)} … {number(p.high)}"))
    main = _main_response(verdict)
    if main is not None:
        result = verdict.responses[main]
        facts.append(("gain", number(result.gain), f"of the {NAMES[main]}, on runs left out of the fit"))
        facts.append(("noise", f"{number(result.noise)} {UNITS[main]}", "rms that no model removes"))
    return facts


def _main_response(verdict: Verdict) -> str | None:
    if verdict.causes:
        return verdict.causes[0].response
    ranked = sorted(verdict.responses, key=lambda name: -verdict.responses[name].left_over_evidence)
    return next((name for name in ranked if verdict.responses[name].noise is not None), None)


def before_and_after(diagnosis: Diagnosis, response: str) -> Picture:
    """Draw the residual over the campaign before and, if anything is named, after the extension; the noise as a band."""
    selection = diagnosis.inquiries[response].selection
    noise = diagnosis.verdict.responses[response].noise or 0.0
    strips = [(selection.plain, "before: the simulation with its baseline", VERMILION)]
    if selection.found:
        strips.append((selection.fit, "after: with the named causes", BLUE))
    with figure(len(strips), 1, height=2.3 * len(strips), sharex=True, sharey=True, squeeze=False) as (canvas, grid):
        axes = grid[:, 0]
        for axis, (fit, title, colour) in zip(axes, strips, strict=True):
            begin = 0.0
            for run, rest in zip(diagnosis.campaign.runs, row_residuals(fit, diagnosis.campaign), strict=True):
                time, values = _thinned(run.row_time, rest)
                axis.plot((begin + time - time[0]) / 3600.0, values, color=colour, linewidth=0.6)
                begin += float(run.row_time[-1] - run.row_time[0])
                axis.axvline(begin / 3600.0, color="#b0b6bd", linewidth=0.8)
            axis.axhspan(-2 * noise, 2 * noise, color=ORANGE, alpha=0.25, label="noise, ± 2 rms")
            axis.set_title(title, loc="left", fontsize=10)
            axis.set_ylabel(f"residual / {UNITS[response]}")
        axes[0].legend(loc="upper right")
        axes[-1].set_xlabel("time, runs one after the other / h")
        after = " and after" if selection.found else ""
        return draw(
            canvas,
            f"Residual of the {NAMES[response]} before{after} the extension.",
            f"The {NAMES[response]} residual over time before{after} the extension; the last strip has rms {number(noise)}.",
        )


def _thinned(time: np.ndarray, values: np.ndarray, most: int = 500) -> tuple[np.ndarray, np.ndarray]:
    step = max(1, time.size // most)
    return time[::step], values[::step]


def residual_views(diagnosis: Diagnosis, response: str) -> Picture:
    """Draw the baseline's residual against temperature (heating and cooling), rate, frequency and the drives."""
    campaign, inquiry = diagnosis.campaign, diagnosis.inquiries[response]
    fit = inquiry.selection.plain
    problem = fit.problem
    views = problem.views(problem.tau)
    rest = problem.values - fit.columns() @ fit.linear.coefficients
    count = sum(int(mask.sum()) for mask in problem.present)
    rest = rest[:count]
    inputs: dict[str, np.ndarray] = {
        "resonator temperature / °C": problem.stack([v.coarse.resonator - 273.15 for v in views])[:count],
        "rate / (K/h)": 3600.0 * problem.stack([v.coarse.rate for v in views])[:count],
    }
    if "frequency_Hz" in campaign.responses:
        inputs["frequency / Hz"] = problem.stack([run.responses["frequency_Hz"] for run in campaign.runs])[:count]
    for label, drive in (("amplitude / V", "amplitude_squared"), ("electrode voltage / V", "voltage_squared")):
        if all(getattr(v.coarse, drive) is not None for v in views):
            inputs[label] = np.sqrt(problem.stack([getattr(v.coarse, drive) for v in views])[:count])
    heating = inputs["rate / (K/h)"] > 0
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
            axis.locator_params(axis="x", nbins=5)
        axis = flat[len(inputs)]
        axis.boxplot([rest[runs == k] for k in np.unique(runs)], showfliers=False)
        axis.set_xlabel("run")
        for axis in flat[len(inputs) + 1 :]:
            axis.set_visible(False)
        for axis in flat[::columns]:
            axis.set_ylabel(f"residual / {UNITS[response]}")
        flat[0].legend(markerscale=4)
        return draw(
            canvas,
            f"Baseline residual of the {NAMES[response]} (means over {campaign.step:.0f} s) against its inputs.",
            f"Scatter of the {NAMES[response]} residual against temperature, rate, frequency and drives.",
        )


def _rivals(diagnosis: Diagnosis, response: str) -> list[Block]:
    inquiry = diagnosis.inquiries[response]
    blocks: list[Block] = []
    for found in inquiry.selection.found:
        rows = [[rival.name, f"{rival.evidence:.1f}"] for rival in found.rivals]
        blocks.append(
            Table(f"Who else could stand in the place of {found.rivals[0].name}", ("effect", "evidence"), rows)
        )
    left = inquiry.leftover
    blocks.append(
        Text(
            f"Generic witness: strongest in {left.input or 'nothing'}, evidence {left.evidence:.1f}. "
            f"Slow noise taken as: {inquiry.problem.kernel}."
        )
    )
    return blocks


def table_text(found: "TableDiagnosis") -> str:
    """Return the diagnosis of a steady-state table as text."""
    return "\n".join([headline(found.verdict), *found.sentences])


def table_page(found: "TableDiagnosis", path: str) -> str:
    """Return the page of a steady-state table as HTML."""
    return render_page(f"Diagnosis of {path}", headline(found.verdict), table_chapters(found))


def table_chapters(found: "TableDiagnosis") -> list[Chapter]:
    """Return the chapters of a steady-state table: the answer, and who else could have given it."""
    facts = [
        ("verdict", found.verdict.verdict, WORDS[found.verdict.verdict]),
        ("law imposed", f"{number(found.law_rms)} Hz", "rms left, degrees of freedom counted by points"),
        ("curvature", f"{number(found.curvature_ratio)} times", "the measured one over the law's"),
    ]
    rows = [[name, number(ssq), number(loo), number(score)] for name, ssq, loo, score in found.candidates]
    columns = ("candidate", "sum of squares / Hz²", "leave-one-out / Hz", "evidence")
    candidates = Table("Candidates on top of the baseline", columns, rows)
    return [
        Chapter("The answer", [Facts(facts), table_residuals(found), *(Text(s) for s in found.sentences)]),
        Chapter("Candidates", [candidates]),
    ]


def table_residuals(found: "TableDiagnosis") -> Picture:
    """Draw what the law, the baseline and the strongest candidate leave of a steady-state table."""
    with figure(1, 1, height=3.2) as (canvas, axis):
        axis.plot(found.temperature, found.law_residual, "o-", color=VERMILION, label="law imposed, f₀ and slope free")
        axis.plot(found.temperature, found.baseline_residual, "s-", color=ORANGE, label="baseline: curvature free")
        axis.plot(found.temperature, found.extended_residual, "^-", color=BLACK, label="with the strongest candidate")
        axis.set_xlabel("temperature / °C")
        axis.set_ylabel("measured − model / Hz")
        axis.legend()
        return draw(
            canvas, "What each model leaves of the measured table.", "Residuals of three models over temperature."
        )
