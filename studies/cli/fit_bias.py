"""`hrg fit bias`: the zero-rate output as a function of the gyro's own frequency and its rate of change.

With --json one object, schema `hrg.fit-bias/1`. `methods.guarded` and `methods.paper` hold coefficients in the unit of `output` per
powers of Hz and Hz/s, the `path` of the selection, and stability `before` and `after` with their ratio, on the fitted data and held
out (null when nothing can be held out). `over` is the column that the bias is a function of, `reference` its value from which changes
are counted; a temperature acts behind `lag_s` and a hysteresis loop of `play_half_width_degC` (0: none). `allan` is of the longest run, N in
unit·√s, B in unit, K in unit/√s; null for runs too short for it.
"""

from typing import Any, Literal

from studies.bias import BiasStudy, Judged, study_bias
from studies.cli.arguments import EmitC, SaveModel
from studies.cli.output import answers, say
from studies.errors import InputError
from studies.files.writing import write_text
from studies.models import emit_c, write_model
from studies.models.kinds.bias import name_term
from studies.record import read_record
from studies.reports import bias as parts
from studies.results import Chapter, Result, Sentence
from studies.stability import Stability


@answers("hrg.fit-bias/1")
def fit_bias(
    *data: str,
    method: Literal["guarded", "paper"] = "guarded",
    average: float | None = None,
    window: float | None = None,
    causal: bool = False,
    over: Literal["auto", "frequency", "temperature"] = "auto",
    save: SaveModel = None,
    emit: EmitC = None,
) -> Result:
    """Fit the bias over the change of frequency and its rate, with stepwise selection (HRG paper, equations 19 to 22).

    The records are of a gyro at rest while its temperature changes: time_s, bias_deg_per_h or measured_rate_deg_per_s, and
    frequency_Hz or, if the frequency is not measured, a temperature; with a temperature, a lag and a hysteresis loop are added if
    they improve the fit. Terms are selected in two ways, shown side by side: as in the paper, and guarded against autocorrelated
    noise. Give several runs, cooling and warming, so that whole runs can be held out.

    Parameters
    ----------
    data : str
        One or more records (CSV).
    method : str
        Selection whose model is saved.
    average : float
        Seconds averaged into one row before the fit; by default 100, or less for a short run.
    window : float
        Seconds over which the rate is taken; by default three times the average.
    causal : bool
        Take the rate from past samples only, as firmware must; it then lags by half the window.
    over : str
        Variable of the fit; auto is the frequency if every record has it, else a temperature.
    """
    if not data:
        raise InputError("name at least one record (CSV) of a gyro at rest while its temperature changes.")
    records = []
    for path in data:
        say(f"reading {path}")
        records.append(read_record(path))
    study = study_bias(records, method, average, window, causal=causal, over=over, progress=say)
    if save is not None:
        write_model(study.model, save)
        say(f"model: {save}")
    if emit is not None:
        write_text(emit, emit_c(study.model))
        say(f"C source: {emit}")
    judged, other = study.by(method), study.by("paper" if method == "guarded" else "guarded")
    variable = judged.fit.variable.name
    return Result(
        _payload(study, method, data),
        f"Bias over {variable} and its rate",
        f"Zero-rate output of {', '.join(data)}, with terms selected from the nine of the HRG paper's equation (21).",
        [
            parts.facts(study, method),
            Sentence(parts.verdict(study, method)),
            *parts.doubts(study),
            Chapter("Before and after", [parts.runs_figure(study, method), parts.gain_table(study)]),
            Chapter(
                "Selection of terms",
                [parts.path_table(judged), parts.path_table(other, "page"), Sentence(parts.PATH_NOTE, "note", "page")],
            ),
            Chapter(
                "Coefficients",
                [
                    parts.coefficients_table(judged, study.output),
                    Sentence(parts.how_rows_were_made(study), "note", "page"),
                ],
            ),
            Chapter("Stability", parts.stability_parts(study)),
        ],
        sources=parts.SOURCES,
    )


def _payload(study: BiasStudy, method: str, data: tuple[str, ...]) -> dict[str, Any]:
    return {
        "schema": "hrg.fit-bias/1",
        "data": data,
        "output": study.output,
        "over": study.column,
        "lag_s": study.runs[0].memory.lag,
        "play_half_width_degC": study.runs[0].memory.play,
        "method": method,
        "rows": [int(run.time.size) for run in study.runs],
        "opposite_sign": study.opposite,
        "missing": sum(run.missing for run in study.runs),
        "spikes": sum(run.spikes for run in study.runs),
        "rate_lag_s": study.runs[0].lag,
        "methods": {judged.method: _judged(judged) for judged in study.judged},
        "allan": {"step_s": study.allan_step, "before": _spectrum(study.before), "after": _spectrum(study.after)}
        if study.before and study.after
        else None,
    }


def _judged(judged: Judged) -> dict[str, Any]:
    fit, held_out = judged.fit, judged.held_out
    steps = fit.selection.steps if fit.selection else ()
    return {
        "reference": fit.reference,
        "terms": ["constant", *(name_term(name, fit.variable) for name in fit.terms)],
        "coefficients": fit.coefficients,
        "standard_errors": fit.standard_errors,
        "naive_standard_errors": fit.naive_errors,
        "theta": fit.theta,
        "path": [
            {
                "added": step.added,
                "term": name_term(step.term, fit.variable),
                "F": step.F,
                "p_value": step.p_value,
                "bic": step.criterion,
            }
            for step in steps
        ],
        "training": {"before": judged.training[0], "after": judged.training[1], "gain": judged.training_gain},
        "held_out": None
        if held_out is None
        else {
            "before": held_out.before,
            "after": held_out.after,
            "gain": held_out.gain,
            "coverage": held_out.coverage,
            "of": "runs" if held_out.by_runs else "blocks",
        },
    }


def _spectrum(spectrum: Stability) -> dict[str, Any]:
    noise, allan = spectrum.noise, spectrum.allan
    return {
        "tau_s": allan.tau, "deviation": allan.deviation, "low": allan.low, "high": allan.high,
        "confidence": allan.confidence, "bias_instability": allan.bias_instability[0],
        "N": noise.N, "N_uncertainty": noise.N_uncertainty, "B": noise.B, "B_uncertainty": noise.B_uncertainty,
        "K": noise.K, "K_uncertainty": noise.K_uncertainty, "misfit": noise.misfit,
    }  # fmt: skip
