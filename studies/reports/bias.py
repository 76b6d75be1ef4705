"""Parts of the page of a bias calibration: selection of terms, coefficients with both errors, improvement, Allan deviation."""

import math

import numpy as np

from compensation.bias import POWERS, SELECTED_BY_THE_PAPER, TERMS, Variable
from compensation.bias_selection import AVERAGING, Method
from compensation.memory import Memory
from compensation.noise import FLAT
from studies.fits.bias import BiasStudy, Judged
from studies.models.file import widen
from studies.models.kinds.bias import OUTPUTS
from studies.reports import style
from studies.reports.digits import plain, raised, to_error, to_interval
from studies.results import Column, Drawing, Facts, Figure, Part, Sentence, Table, Where

SOURCES = (
    "Wang X. et al., Sensors 2012, 12, 6434 (the HRG paper), eqs. (19)–(22).",
    "Riley W. J., Handbook of Frequency Stability Analysis, NIST SP 1065 (Allan deviation, degrees of freedom).",
    "IEEE Std 952 (coefficients N, B, K).",
)
SYMBOLS = {
    "f": "f", "f^2": "f²", "f^3": "f³", "fdot": "ḟ", "fdot^2": "ḟ²", "fdot^3": "ḟ³", "f*fdot": "f·ḟ",
    "f^2*fdot": "f²·ḟ", "f*fdot^2": "f·ḟ²", "play": "hysteresis", "f*play": "f·hysteresis",
    "play^2": "hysteresis²",
}  # fmt: skip
ORDER = list(SYMBOLS)
MOST_RUNS = 12  # that are drawn
FEW = 40  # averages: four to each of nine terms and a constant
MEMORY = {"lag": ("Lag behind the thermometer", "s"), "play": ("Half-width of the hysteresis", "K")}
METHOD = {"guarded": "guarded", "paper": "as in the paper"}
PATH_NOTE = (
    "The paper's selection treats all averages as independent. Drift and flicker noise correlate neighbouring averages, so this"
    " selection finds terms in pure noise. The guarded selection estimates the correlation time of the noise and divides the"
    " significance level among the candidates. A term can enter only after the lower-order terms that it contains. BIC is comparable only within one selection."
)
NO_TERMS = "These data support no term: a constant describes the bias just as well. Compensation brings no improvement; the saved model only removes the mean."
STEP_COLUMNS = "Step | action: Term | F: F .2f | p | bic: BIC .2f | score: Held out .3f | Model"
COEFFICIENTS = "number: No. | Term | value ± error: Value | naive: Error if rows were independent .2 | Unit | printed: In eq. (22)"  # fmt: skip


def facts(study: BiasStudy, method: Method) -> Facts:
    """Return the numbers that carry the answer."""
    judged, unit = study.by(method), _unit(study.output)
    (before, after), held = judged.training, judged.held_out
    left_out = ("unknown", "needs two runs of a kind")
    if held is not None:
        left_out = _times(held.gain), f"{held.before:.3g} → {held.after:.3g} {unit}"
    count = f"of {len(POWERS if judged.fit.memory.play else TERMS)} candidates; the HRG paper selects {len(SELECTED_BY_THE_PAPER)}"
    ends = {name: to_interval(*own) for name, own in judged.fit.memory_intervals.items()}
    memory = [
        (label, f"{ends[name][0]} {per}", f"90 % with these terms: {ends[name][1]} … {ends[name][2]} {per}")
        for name, (label, per) in MEMORY.items()
        if name in ends
    ]
    return Facts([
        ("Improvement, fitted data", _times(judged.training_gain), f"{before:.3g} → {after:.3g} {unit}"),
        ("Improvement, held-out data", *left_out),
        ("Terms", str(len(judged.fit.terms)), count), *memory,
    ])  # fmt: skip


def _times(gain: float) -> str:
    return "none" if f"{gain:.2f}" == "1.00" else f"{gain:.2f}×"


def verdict(study: BiasStudy, method: Method) -> str:
    """Say in one or two sentences what the model is worth."""
    judged = study.by(method)
    if not judged.fit.terms:
        return NO_TERMS
    fitted, held = f"Improvement of the bias stability: {judged.training_gain:.2f}× on the fitted data", judged.held_out
    if held is None:
        return f"{fitted}. The improvement on other data is unknown: {study.no_held_out}"
    what = "held-out runs" if held.by_runs else "held-out blocks of the same run"
    share, variable = 100 * held.coverage, judged.fit.variable.name
    inside = f"{share:.0f} % of their rows lie inside the fitted range of {variable} and rate"
    sentence = f"{fitted}, {held.gain:.2f}× on {what} ({inside})."
    if not held.by_runs:
        return f"{sentence} For a stronger test, record a second run, warming if this one cooled."
    worse = " On held-out runs the model makes the bias worse: do not use it unless another run shows an improvement."
    return sentence + worse * (held.gain <= 1)


def doubts(study: BiasStudy) -> list[Sentence]:
    """Warn where the runs are too short to select terms by."""
    averages = int(sum(float(np.ptp(run.time)) + run.width for run in study.runs) / AVERAGING)
    if averages >= FEW:
        return []
    spread = 100 / math.sqrt(2 * max(averages - 1, 1))
    text = (
        f"The data are short: {averages} averages of {AVERAGING:g} s. A standard deviation of so few is uncertain by {spread:.0f} %,"
        f" and the selection of terms is unreliable; record {FEW * AVERAGING / 3600:.1f} h or more, over the full temperature range."
    )
    return [Sentence(text, "warning")]


def how_rows_were_made(study: BiasStudy) -> str:
    """Say how the rows of the fit were made."""
    run, variable = study.runs[0], study.runs[0].variable
    missing, spikes = sum(r.missing for r in study.runs), sum(r.spikes for r in study.runs)
    rows = ", ".join(str(r.time.size) for r in study.runs)
    late = f"lags by {run.lag:g} s, half of that" if run.lag else "is centred on its row, without lag"
    return (
        f"Each row is an average over {run.width:g} s ({rows} rows). Samples left out: {missing} with missing values, {spikes} as"
        f" spikes. The rate is the slope of a line through {run.window:g} s of averages; it {late}. Changes of"
        f" {variable.name} are relative to {study.by('guarded').fit.reference:.4f} {variable.unit}."
        + memory_sentence(run.memory)
    )


def memory_sentence(memory: Memory) -> str:
    """Say what stands between the thermometer and the bias, if anything does."""
    parts, after = [f"a lag of {memory.lag:.4g} s"] if memory.lag else [], ""
    if memory.play:
        parts.append(f"a hysteresis of half-width {memory.play:.3g} K, with three candidates of its own")
        starts = ", ".join(f"{start:+g}" if start else "0" for start in memory.starts)
        after = f" The runs start at {starts} half-widths from its middle; a compensated record at 0, so it is not compensated for the hysteresis until its temperature has once changed by {2 * memory.play:.3g} K."
    return f" The temperature acts through {' and '.join(parts)}.{after}" if parts else ""


def path_table(judged: Judged, where: Where = "everywhere") -> Table:
    """Return the steps of a selection: term, F, p, criterion, residual."""
    selection, symbol = judged.fit.selection, judged.fit.variable.symbol
    steps = () if selection is None else (selection.start, *selection.steps)
    rows = [
        {
            "step": str(k),
            "action": f"{'add' if step.added else 'remove'} {_symbol(step.term, symbol)}" if k else "initial",
            "F": None if math.isnan(step.F) else step.F,
            "p": "" if math.isnan(p := step.p_value) else f"{p:.1e}" if p >= 1e-99 else "< 1e-99",
            "bic": step.criterion,
            "score": None if math.isnan(score) else score,
            "model": ", ".join(_symbol(name, symbol) for name in sorted(step.terms, key=ORDER.index)) or "constant",
        }
        for k, (step, score) in enumerate(zip(steps, judged.path_scores or (math.nan,) * len(steps), strict=True))
    ]
    left_out = [f"{_symbol(name, symbol)} (constant)" for name in selection.constant] if selection else []
    notes = [f"Candidates left out: {', '.join(left_out)}."] if left_out else []
    if len(steps) < 2:
        notes.append("No candidate is significant.")
    elif judged.fit.held_out or judged.path_scores:
        rule = "the model with the smallest value is kept" if judged.fit.held_out else "here the F-tests decide"
        notes.append(f"Held out: residual on held-out data over that of a constant; {rule}.")
    return Table(f"Selection, {METHOD[judged.method]}", rows, STEP_COLUMNS, " ".join(notes), where)


def coefficients_table(judged: Judged, output: str) -> Table:
    """Return the coefficients with the naive error and the one that respects the autocorrelation."""
    fit, rows = judged.fit, []
    numbers = fit.coefficients, fit.standard_errors, fit.naive_errors
    for name, value, error, naive in zip(("constant", *fit.terms), *numbers, strict=True):
        factor, words = _coefficient_unit(_unit(output), name, fit.variable)
        number = f"k{list(TERMS).index(name) + 1}" if name in TERMS else ""
        printed = "yes" if name in SELECTED_BY_THE_PAPER else "no"
        said = {"number": number, "term": _symbol(name, fit.variable.symbol), "printed": printed}
        said = {"number": "B0", "term": name, "printed": ""} if name == "constant" else said
        rows.append(said | {"value": factor * value, "error": factor * error, "naive": factor * naive, "unit": words})
    unit = fit.variable.unit
    per, words = (60.0, "K/min") if unit == "°C" else (1.0, f"{unit}/s")
    (low, high), (slow, fast) = widen(*fit.state_range), (plain(per * end) for end in widen(*fit.rate_range))
    note = f"Valid from {plain(low, 8)} to {plain(high, 8)} {unit} and from {slow} to {fast} {words}, a little beyond the data. Whiteness of the residual: θ = {fit.theta:.3f} (1: white, 0: random walk). Errors are with these terms: how their choice scatters from campaign to campaign is not in them."
    if judged.method == "guarded" and fit.theta < 0.99:
        note += " The errors include the drift of the bias."
    return Table(f"Coefficients, {METHOD[judged.method]}", rows, COEFFICIENTS, note)


def gain_table(study: BiasStudy) -> Table:
    """Return bias stability before and after, on the fitted and on held-out data, for both selections."""
    unit, rows = _unit(study.output), []
    for judged in study.judged:
        (before, after), held = judged.training, judged.held_out
        terms = ", ".join(_symbol(name, judged.fit.variable.symbol) for name in judged.fit.terms) or "none"
        rows.append((METHOD[judged.method], terms, "fitted", before, after, judged.training_gain, 1.0))
        if held is not None:
            data = f"held-out {'runs' if held.by_runs else 'blocks'}"
            reselected = (METHOD[judged.method], "reselected without the held-out data", data)
            rows.append((*reselected, held.before, held.after, held.gain, held.coverage))
    columns = f"0: Selection | 1: Terms | 2: Data | 3: Before ({unit}) | 4: After ({unit}) | 5: Improvement .2f | 6: Rows in range (%) ×100 .0f"
    note = "Standard deviation of 100 s averages about the mean of each run or block."
    if study.no_held_out:
        note += f" No held-out data: {study.no_held_out}"
    return Table("Bias stability", rows, columns, note)


def stability_parts(study: BiasStudy) -> list[Part]:
    """Return Allan deviation and noise coefficients before and after, where the longest run is long enough."""
    if study.before is None:
        return []
    caption = "Overlapping Allan deviation with its 90 % interval; dashed: fitted N, B, K."
    figure = Figure(lambda: _draw_allan(study), caption, "Allan deviation before and after compensation.")
    return [figure, noise_table(study), Sentence(_where_read(study.output), "note", "page")]


def _where_read(output: str) -> str:
    """Say where on the curve N, B and K are: in °/√h and °/h/√h the time is in hours."""
    unit = "h" if output == "bias_deg_per_h" else "s"
    return (
        f"N is the value at τ = 1 {unit} of the line that falls as 1/√τ, K the value at τ = 3 {unit} of the line that rises as √τ, and B"
        f" the flat part divided by {FLAT:.3f}. All three are fitted to the whole curve."
    )


def noise_table(study: BiasStudy) -> Table:
    """Return N, B, K and the minimum of the Allan deviation before and after, on the longest run."""
    hours, unit = study.output == "bias_deg_per_h", _unit(study.output)
    n_scale, k_scale, n_unit, k_unit = (1 / 60, 60.0, "°/√h", "°/h/√h") if hours else (1.0, 1.0, "°/√s", "°/s/√s")

    columns: list[Column | str] = [
        "0: Output",
        Column(lambda row: _measured(row[1].noise.N * n_scale, row[1].noise.N_uncertainty * n_scale), "N", n_unit),
        Column(lambda row: _measured(row[1].noise.B, row[1].noise.B_uncertainty), "B", unit),
        Column(lambda row: _measured(row[1].noise.K * k_scale, row[1].noise.K_uncertainty * k_scale), "K", k_unit),
        Column(lambda row: "{:.3g} ({:.3g} … {:.3g})".format(*row[1].allan.bias_instability), f"Minimum / {FLAT:.3f}, 90 %", unit),
        "1.noise.misfit: Misfit .1f",
    ]  # fmt: skip
    if any(spectrum.noise.markov for spectrum in (study.before, study.after) if spectrum is not None):
        columns += ["1.noise.markov: Correlated, rms .3", "1.noise.markov_time: its time (s) .2"]
    note = (
        f"Longest run, samples of {study.allan_step:g} s. A misfit well above 1 shows more than white noise, flicker noise and random"
        " walk, such as drift with temperature; the errors are increased accordingly."
    )
    rows = [row for row in (("before", study.before), ("after", study.after)) if row[1] is not None]
    return Table("Noise coefficients", rows, columns, note)


def runs_figure(study: BiasStudy, method: Method) -> Figure:
    """Return the averages before and after, and the model, three runs beside each other: like the paper's figure 6."""
    first = f" The first {MOST_RUNS} of {len(study.runs)} runs." if len(study.runs) > MOST_RUNS else ""
    caption = f"Averages of the output with the model (above) and residuals (below), as in the paper's figure 6.{first}"
    alt = "Zero-rate output over time before and after compensation."
    return Figure(lambda: _draw_runs(study, method), caption, alt)


def _draw_runs(study: BiasStudy, method: Method) -> Drawing:
    unit = _unit(study.output)
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
            below.set_xlabel("time (h)")
            above.set_title(f"run {k + 1}", fontsize=10)
            if k % columns == 0:
                above.set_ylabel(f"output ({unit})")
                below.set_ylabel(f"compensated ({unit})")
        for empty in axes[-2:, len(shown) - (rows - 1) * columns :].flat:
            empty.set_axis_off()
        return figure


def _draw_allan(study: BiasStudy) -> Drawing:
    label = f"Allan deviation ({_unit(study.output)})"
    with style.figure(height=3.8, x="averaging time τ (s)", y=label) as (figure, axes):
        for spectrum, colour, label in ((study.before, style.ORANGE, "before"), (study.after, style.BLUE, "after")):
            if spectrum is not None:
                style.draw_allan(axes, spectrum.allan, colour, label, spectrum.noise)
        return figure


def _unit(output: str) -> str:
    return OUTPUTS[output].replace("deg", "°")


def _symbol(term: str, symbol: str) -> str:
    if term == "constant":
        return term
    return SYMBOLS[term] if symbol == "f" else SYMBOLS[term].replace("ḟ", "Ṫ").replace("f", symbol)


def _measured(value: float, uncertainty: float) -> str:
    return " ± ".join(to_error(value, uncertainty)) if value > 0 else f"not detected (< {plain(2 * uncertainty, 1)})"


def _coefficient_unit(output: str, term: str, variable: Variable) -> tuple[float, str]:
    """Return the unit of a coefficient for people, and what its value is multiplied by: a rate of temperature is in K/min."""
    state, rate, play = POWERS.get(term, (0, 0, 0))
    state += play
    over = "K" if variable.unit == "°C" else variable.unit
    timed = ("K/min", 60.0) if over == "K" else (f"{over}/s", 1.0)
    powers = [over + raised(state) * (state > 1)] * (state > 0)
    if rate:
        powers.append(timed[0] if rate == 1 and not state else f"({timed[0]})" + raised(rate) * (rate > 1))
    return timed[1] ** -rate, output + (f" per {' '.join(powers)}" if powers else "")
