"""`hrg fit bias`: the zero-rate output as a function of the gyro's own frequency and its rate of change."""

from typing import Annotated, Any, Literal

from compensation.bias_selection import Method
from studies.cli.arguments import POSITIVE, Records, SaveModel
from studies.cli.output import answers, keep_model, say
from studies.fits.bias import BiasStudy, Judged, study_bias
from studies.models.kinds.bias import name_term
from studies.record import read_record
from studies.record.stability import Stability
from studies.reports import bias as parts
from studies.results import Chapter, Result, Sentence, row_of


@answers("hrg.fit-bias/1")
def fit_bias(
    *data: Records,
    method: Literal["guarded", "paper"] = "guarded",
    average: Annotated[float | None, POSITIVE] = None,
    window: Annotated[float | None, POSITIVE] = None,
    causal: bool = False,
    over: Literal["auto", "frequency", "temperature"] = "auto",
    save: SaveModel = None,
) -> Result:
    """Fit the bias over the change of frequency and its rate, with stepwise selection (HRG paper, equations 19 to 22).

    The records are of a gyro at rest while its temperature changes: time_s, bias_deg_per_h or measured_rate_deg_per_s, and
    frequency_Hz or, if the frequency is not measured, a temperature; with a temperature, a lag and a hysteresis loop are added if
    they improve the fit. Terms are selected in two ways, shown side by side: as in the paper, and guarded against autocorrelated
    noise. Give several runs, cooling and warming, so that whole runs can be held out.

    Args:
        method: Selection whose model is saved.
        average: Seconds averaged into one row before the fit; by default 100, or less for a short run.
        window: Seconds over which the rate is taken; by default three times the average.
        causal: Take the rate from past samples only, as firmware must; it then lags by half the window.
        over: Variable of the fit; auto is the frequency if every record has it, else a temperature.
    """
    records = []
    for path in data:
        say(f"reading {path}")
        records.append(read_record(path))
    study = study_bias(records, method, average, window, causal=causal, over=over, progress=say)
    keep_model(study.model, save)
    judged, other = study.by(method), study.by("paper" if method == "guarded" else "guarded")
    variable = judged.fit.variable.name
    return Result(
        _payload(study, method, data),
        f"Bias over {variable} and its rate",
        f"Zero-rate output of {', '.join(data)}, with terms selected from the nine of the HRG paper's equation (21).",
        [
            *parts.doubts(study), parts.facts(study, method), parts.verdict(study, method),
            Chapter("Before and after", [parts.runs_figure(study, method), parts.gain_table(study)]),
            Chapter("Selection of terms", [
                parts.path_table(judged), parts.path_table(other, "page"), Sentence(parts.PATH_NOTE, "note", "page"),
            ]),
            Chapter("Coefficients", [
                parts.coefficients_table(judged, study.output), Sentence(parts.how_rows_were_made(study), "note", "page"),
            ]),
            Chapter("Stability", parts.stability_parts(study)),
        ],
        sources=parts.SOURCES,
    )  # fmt: skip


def _payload(study: BiasStudy, method: Method, data: tuple[str, ...]) -> dict[str, Any]:
    ends = {name: (low, high) for name, (_, low, high) in study.by(method).fit.memory_intervals.items()}
    allan = {"step_s": study.allan_step, "before": _spectrum(study.before), "after": _spectrum(study.after)}
    return {
        "data": data,
        **row_of(study, "output", over="column"),
        **row_of(study.runs[0].memory, lag_s="lag", play_half_width_degC="play", play_starts="starts"),
        "rate_lag_s": study.runs[0].lag,
        "lag_90_s": ends.get("lag"),
        "play_half_width_90_degC": ends.get("play"),
        "method": method,
        "rows": [int(run.time.size) for run in study.runs],
        **{count: sum(getattr(run, count) for run in study.runs) for count in ("missing", "spikes")},
        "methods": {judged.method: _judged(judged) for judged in study.judged},
        "allan": allan if study.before and study.after else None,
    }


def _judged(judged: Judged) -> dict[str, Any]:
    fit, held_out = judged.fit, judged.held_out
    of = {"of": "runs" if held_out and held_out.by_runs else "blocks"}
    held = held_out and row_of(held_out, "before", "after", "gain", "coverage") | of
    return {
        **row_of(fit, "reference", "coefficients", "standard_errors", "theta", naive_standard_errors="naive_errors"),
        "terms": ["constant", *(name_term(name, fit.variable) for name in fit.terms)],
        "path": [
            {"term": name_term(step.term, fit.variable)} | row_of(step, "added", "F", "p_value", bic="criterion")
            for step in (fit.selection.steps if fit.selection else ())
        ],
        "training": {"before": judged.training[0], "after": judged.training[1], "gain": judged.training_gain},
        "held_out": held,
    }


def _spectrum(spectrum: Stability | None) -> dict[str, Any]:
    if spectrum is None:
        return {}
    curve = row_of(spectrum.allan, "deviation", "low", "high", "confidence", tau_s="tau")
    each = [f"{name}{end}" for name in "NBK" for end in ("", "_uncertainty")]
    levels = row_of(spectrum.noise, *each, "misfit", "markov", markov_s="markov_time")
    return curve | levels | {"bias_instability": spectrum.allan.bias_instability[0]}
