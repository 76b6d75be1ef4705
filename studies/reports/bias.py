"""The page of a bias calibration: the path of the selection, coefficients with both errors, gains, Allan deviation."""

import math
from typing import TYPE_CHECKING, Literal

import numpy as np

from compensation.bias import SELECTED_BY_THE_PAPER, TERMS
from compensation.noise import FLAT
from studies.models.kinds.bias import OUTPUTS
from studies.reports import style
from studies.reports.digits import plain, raised, to_error
from studies.reports.page import Block, Chapter, Facts, Picture, Table, Text, draw, render_page

if TYPE_CHECKING:
    from compensation.bias import Variable
    from compensation.memory import Memory
    from studies.bias import BiasStudy, Judged, Stability

SOURCES = (
    "Wang X. et al., Sensors 2012, 12, 6434 (the HRG paper), eqs. (19)–(22).",
    "Riley W. J., Handbook of Frequency Stability Analysis, NIST SP 1065 (Allan deviation, degrees of freedom).",
    "IEEE Std 952 (coefficients N, B, K).",
)
SYMBOLS = {
    "f": "f", "f^2": "f²", "f^3": "f³", "fdot": "ḟ", "fdot^2": "ḟ²", "fdot^3": "ḟ³", "f*fdot": "f·ḟ",
    "f^2*fdot": "f²·ḟ", "f*fdot^2": "f·ḟ²", "play": "loop",
}  # fmt: skip
ORDER = list(SYMBOLS)
MOST_RUNS = 12  # that are drawn
METHOD = {"guarded": "guarded", "paper": "as the paper does"}
Method = Literal["guarded", "paper"]


def bias_page(study: "BiasStudy", source: str, method: Method) -> str:
    """Return the page for a user's records."""
    name = study.runs[0].variable.name
    lead = (
        f"The zero-rate output of {source} as a function of the gyro's own {name} and its rate, selected stepwise from the"
        " nine terms of the HRG paper's equation (21)."
    )
    other: Method = "paper" if method == "guarded" else "guarded"
    judged = study.by(method)
    chapters = [
        Chapter("In short", [_facts(study, method), Text(verdict(study, method))]),
        Chapter("Before and after", [runs_figure(study, method), gain_table(study)]),
        Chapter(
            "The selection, step by step",
            [path_table(judged), path_table(study.by(other)), Text(PATH_NOTE, "note")],
        ),
        Chapter("Coefficients", [coefficients_table(judged, study.output), Text(how_rows_were_made(study), "note")]),
    ]
    if study.before:
        chapters.append(Chapter("Stability", [allan_figure(study), noise_table(study), Text(WHERE_READ, "note")]))
    return render_page(f"Bias over {name} and its rate", lead, chapters, SOURCES)


PATH_NOTE = (
    "The paper's selection treats all averages as independent. Drift and flicker correlate neighbouring averages, so it finds"
    " terms in noise alone; the guarded selection estimates the correlation time of the noise and shares the entry level among"
    " the competing candidates. A term enters only after the lower-order terms that it contains. BIC compares steps of one path."
)
WHERE_READ = (
    "N is read where the curve falls like 1/√τ and is by definition its value at τ = 1 s on that line; K where it rises like"
    f" √τ, at τ = 3 s on that line; B is the flat part over {FLAT:.3f}. All three are fitted to the whole curve, so none"
    " depends on a single point."
)


def verdict(study: "BiasStudy", method: Method) -> str:
    """Say in two or three sentences what the model is worth."""
    judged = study.by(method)
    if not judged.fit.terms:
        return (
            "These data support no term: a constant describes the bias as well. Compensation gains nothing; the saved model"
            " only removes the mean."
        )
    if judged.held_out is None:
        return f"Improvement on the fitted data {judged.training_gain:.2f} times. Its worth on other data is unknown: {study.no_held_out}"
    held = judged.held_out
    what = "runs" if held.by_runs else "blocks of the same run"
    sentence = (
        f"Improvement {judged.training_gain:.2f} times on the data that were fitted and {held.gain:.2f} times on held-out {what}"
        f" ({100 * held.coverage:.0f} % of the rows lie within the fitted range of {study.runs[0].variable.name} and rate)."
    )
    if held.by_runs and held.gain <= 1:
        sentence += " On held-out runs it does harm: do not use it unless a further run shows a gain."
    elif not held.by_runs:
        sentence += " For more, record a second run, warming if this one cooled."
    return sentence


def how_rows_were_made(study: "BiasStudy") -> str:
    """Say how the rows of the fit came about."""
    run = study.runs[0]
    left_out = sum(r.missing for r in study.runs), sum(r.spikes for r in study.runs)
    rows = ", ".join(str(r.time.size) for r in study.runs)
    return (
        f"Each row is the average over {run.width:g} s ({rows} rows); {left_out[0]} samples with missing values and {left_out[1]}"
        f" spikes were left out. The rate is the slope of the line through {run.window:g} s of averages; its lag is {run.lag:g} s."
        f" Changes of {run.variable.name} are counted from"
        f" {study.by('guarded').fit.reference:.4f} {run.variable.unit}. Bias stability is the standard deviation of 100 s averages."
        + memory_sentence(run.memory)
    )


def memory_sentence(memory: "Memory") -> str:
    """Say what stands between the thermometer and the bias, if anything does."""
    parts = [f"a lag of {memory.lag:g} s"] if memory.lag else []
    parts += [f"a loop of half-width {memory.play:.2g} °C as a tenth candidate"] if memory.play else []
    return f" The temperature acts behind {' and '.join(parts)}." if parts else ""


def path_table(judged: "Judged") -> Table:
    """Return the steps of a selection: term, F, p, criterion, residual."""
    selection, symbol = judged.fit.selection, judged.fit.variable.symbol
    rows = []
    steps = () if selection is None else (selection.start, *selection.steps)
    held_out = judged.path_scores or (math.nan,) * len(steps)
    for k, (step, score) in enumerate(zip(steps, held_out, strict=True)):
        action = "start" if k == 0 else f"{'+' if step.added else '−'} {_symbol(step.term, symbol)}"
        rows.append(
            [
                str(k),
                action,
                "" if math.isnan(step.F) else f"{step.F:.2f}",
                "" if math.isnan(step.p_value) else _probability(step.p_value),
                f"{step.criterion:.2f}",
                "" if math.isnan(score) else f"{score:.3f}",
                ", ".join(_symbol(name, symbol) for name in sorted(step.terms, key=ORDER.index)) or "constant only",
            ]
        )
    refused = {} if selection is None else selection.refused
    notes = (
        [f"Left out from the start: {', '.join(f'{_symbol(n, symbol)} ({why})' for n, why in refused.items())}."]
        if refused
        else []
    )
    if len(steps) < 2:
        notes.append("No candidate passes the entry level.")
    elif judged.fit.held_out:
        notes.append("The model with the smallest held-out figure is kept.")
    elif judged.path_scores:
        notes.append("The held-out figures (over that of a constant) are shown; the tests decide.")
    columns = ["Step", "Term", "F", "p", "BIC", "Held out", "Model"]
    return Table(f"Selection, {METHOD[judged.method]}", columns, rows, " ".join(notes))


def coefficients_table(judged: "Judged", output: str) -> Table:
    """Return the coefficients with the naive error and the one that respects the autocorrelation."""
    fit, unit = judged.fit, OUTPUTS[output].replace("deg", "°")
    rows = []
    for name, value, error, naive in zip(
        ("constant", *fit.terms), fit.coefficients, fit.standard_errors, fit.naive_errors, strict=True
    ):
        number = list(TERMS).index(name) + 1 if name in TERMS else 0
        factor, words = _coefficient_unit(unit, name, fit.variable)
        printed = "" if name == "constant" else ("yes" if name in SELECTED_BY_THE_PAPER else "no")
        rows.append(
            [
                f"k{number}" if number else ("B0" if name == "constant" else ""),
                "constant" if name == "constant" else _symbol(name, fit.variable.symbol),
                *to_error(factor * value, factor * error),
                plain(factor * naive, 2),
                words,
                printed,
            ]
        )
    columns = ["", "Term", "Value", "Standard error", "If rows were independent", "Unit", "In eq. (22)"]
    low, high = fit.state_range
    unit = fit.variable.unit
    per, words = (60.0, "K/min") if unit == "°C" else (1.0, f"{unit}/s")
    slow, fast = (plain(per * end) for end in fit.rate_range)
    note = (
        f"Valid from {plain(low, 8)} to {plain(high, 8)} {unit} and from {slow} to {fast} {words}."
        f" The noise is autocorrelated with θ = {fit.theta:.3f} (1: white, 0: random walk)."
    )
    if judged.method == "guarded" and fit.theta < 0.99:
        note += " The selection weighs the drift of the bias down; these least-squares coefficients cannot, hence their errors."
    return Table(f"Coefficients, {METHOD[judged.method]}", columns, rows, note)


def gain_table(study: "BiasStudy") -> Table:
    """Return bias stability before and after, on the fitted and on held-out data, for both ways of selecting."""
    unit = OUTPUTS[study.output].replace("deg", "°")
    rows = []
    for judged in study.judged:
        terms = ", ".join(_symbol(name, judged.fit.variable.symbol) for name in judged.fit.terms) or "none"
        before, after = judged.training
        rows.append(
            [
                METHOD[judged.method],
                terms,
                "fitted data",
                f"{before:.4g}",
                f"{after:.4g}",
                f"{judged.training_gain:.2f}",
                "100 %",
            ]
        )
        held = judged.held_out
        if held is not None:
            of = "held-out runs" if held.by_runs else "held-out blocks"
            rows.append(
                [
                    METHOD[judged.method],
                    "selected anew",
                    of,
                    f"{held.before:.4g}",
                    f"{held.after:.4g}",
                    f"{held.gain:.2f}",
                    f"{100 * held.coverage:.0f} %",
                ]
            )
    columns = ["Selection", "Terms", "On", f"Before ({unit})", f"After ({unit})", "Times better", "Rows in range"]
    note = "Standard deviation of 100 s averages about each piece's own mean."
    if study.no_held_out:
        note += f" No held-out figure: {study.no_held_out}"
    return Table("Bias stability", columns, rows, note)


def noise_table(study: "BiasStudy") -> Table:
    """Return N, B, K and the flat minimum before and after, on the longest run."""
    hours = study.output == "bias_deg_per_h"
    n_scale, k_scale, n_unit, k_unit = (1 / 60, 60.0, "°/√h", "°/h/√h") if hours else (1.0, 1.0, "°/√s", "°/s/√s")
    unit = OUTPUTS[study.output].replace("deg", "°")

    def row(label: str, spectrum: "Stability") -> list[str]:
        noise, (flat, low, high) = spectrum.noise, spectrum.allan.bias_instability
        cells = [
            _measured(noise.N * n_scale, noise.N_uncertainty * n_scale),
            _measured(noise.B, noise.B_uncertainty),
            _measured(noise.K * k_scale, noise.K_uncertainty * k_scale),
        ]
        return [label, *cells, f"{flat:.3g} ({low:.3g}…{high:.3g})", f"{noise.misfit:.1f}"]

    columns = ["", f"N ({n_unit})", f"B ({unit})", f"K ({k_unit})", f"Lowest point / 0.664 ({unit})", "Misfit"]
    note = (
        f"Longest run, samples of {study.allan_step:g} s. A misfit well above 1 says that more than white noise, flicker and random"
        " walk is there, such as drift with temperature; the uncertainties are widened by it."
    )
    rows = [row(label, s) for label, s in (("before", study.before), ("after", study.after)) if s is not None]
    return Table("Noise coefficients", columns, rows, note)


def runs_figure(study: "BiasStudy", method: Method) -> Picture:
    """Draw the averages before and after, and the model, three runs beside each other: like the paper's figure 6."""
    unit = OUTPUTS[study.output].replace("deg", "°")
    fit, shown = study.by(method).fit, study.runs[:MOST_RUNS]
    columns = min(len(shown), 3)
    rows = -(-len(shown) // columns)
    with style.figure(2 * rows, columns, height=4.6 * rows, squeeze=False, sharey="row") as (figure, axes):
        for k, run in enumerate(shown):
            above, below = axes[2 * (k // columns) : 2 * (k // columns) + 2, k % columns]
            predicted = run.bias - fit.left(run)
            hours = run.time / 3600
            offset = np.mean(run.bias - predicted)
            above.plot(hours, run.bias, ".", color=style.SKY, markersize=3, label="output")
            above.plot(hours, predicted + offset, color=style.VERMILION, label="model")
            below.plot(hours, run.bias - predicted - offset, ".", color=style.BLUE, markersize=3)
            below.set_xlabel("Time (h)")
            above.set_title(f"run {k + 1}", fontsize=10)
            if k % columns == 0:
                above.set_ylabel(f"Output ({unit})")
                below.set_ylabel(f"Compensated ({unit})")
        for empty in axes[-2:, len(shown) - (rows - 1) * columns :].flat:
            empty.set_axis_off()
        axes[0, 0].legend()
        first = f" The first {MOST_RUNS} of {len(study.runs)} runs." if len(study.runs) > MOST_RUNS else ""
        caption = (
            f"Averages of the output with the model (above) and residuals (below), as in the paper's figure 6.{first}"
        )
        return draw(figure, caption, "Zero-rate output over time before and after compensation.")


def allan_figure(study: "BiasStudy") -> Picture:
    """Draw the Allan deviation before and after with its confidence band and fitted noise."""
    unit = OUTPUTS[study.output].replace("deg", "°")
    with style.figure(height=3.8) as (figure, axes):
        for spectrum, colour, label in ((study.before, style.ORANGE, "before"), (study.after, style.BLUE, "after")):
            if spectrum is None:
                continue
            allan = spectrum.allan
            axes.fill_between(allan.tau, allan.low, allan.high, color=colour, alpha=0.25, linewidth=0)
            axes.loglog(allan.tau, allan.deviation, color=colour, label=label)
            axes.loglog(allan.tau, spectrum.noise.deviation(allan.tau), "--", color=colour, linewidth=1)
        axes.set_xlabel("Averaging time τ (s)")
        axes.set_ylabel(f"Allan deviation ({unit})")
        axes.legend()
        caption = "Overlapping Allan deviation, 68.3 % band; dashed: fitted N, B, K."
        return draw(figure, caption, "Allan deviation before and after compensation.")


def _facts(study: "BiasStudy", method: Method) -> Block:
    judged = study.by(method)
    unit = OUTPUTS[study.output].replace("deg", "°")
    held = judged.held_out
    facts = [
        (
            "On the fitted data",
            f"{judged.training_gain:.2f} times",
            f"{judged.training[0]:.3g} → {judged.training[1]:.3g} {unit}",
        ),
        (
            "Held out",
            "unknown" if held is None else f"{held.gain:.2f} times",
            "needs two runs of a kind" if held is None else f"{held.before:.3g} → {held.after:.3g} {unit}",
        ),
        (
            "Terms",
            str(len(judged.fit.terms)),
            f"of {len(TERMS)} candidates; the paper keeps {len(SELECTED_BY_THE_PAPER)}",
        ),
    ]
    return Facts(facts)


def _symbol(term: str, symbol: str) -> str:
    return SYMBOLS[term] if symbol == "f" else SYMBOLS[term].replace("ḟ", "Ṫ").replace("f", symbol)


def _probability(p: float) -> str:
    return f"{p:.1e}" if p >= 1e-99 else "< 1e-99"


def _measured(value: float, uncertainty: float) -> str:
    return " ± ".join(to_error(value, uncertainty)) if value > 0 else f"not seen (< {plain(2 * uncertainty, 1)})"


def _coefficient_unit(output: str, term: str, variable: "Variable") -> tuple[float, str]:
    """Return the unit of a coefficient for people, and what its value is multiplied by: a rate of temperature is in K/min."""
    state, rate = TERMS.get(term, (1, 0)) if term != "constant" else (0, 0)
    over = "K" if variable.unit == "°C" else variable.unit
    timed = ("K/min", 60.0) if over == "K" else (f"{over}/s", 1.0)
    powers = [over + raised(state) * (state > 1)] * (state > 0)
    if rate:
        powers.append(timed[0] if rate == 1 and not state else f"({timed[0]})" + raised(rate) * (rate > 1))
    return timed[1] ** -rate, output + (f" per {' '.join(powers)}" if powers else "")
