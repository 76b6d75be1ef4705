"""`hrg fit cross-damping`: the bias of a CVG from cross-damping over temperature."""

import math
from typing import Annotated, Any

import numpy as np

from compensation.constants import NINETY
from compensation.improvement import Change
from shell.constants import zero_Celsius
from studies.cli.arguments import ORDER, POSITIVE, Records, SaveModel
from studies.cli.output import answers, keep_model, say
from studies.errors import InputError, naming, numbered
from studies.fits.cross_damping import CrossDampingStudy, study_cross_damping
from studies.models import source_of
from studies.models.kinds.cross_damping import OUTPUTS, save_cross_damping
from studies.papers.cvg_cross_damping import RUNS, SOURCES, draw_runs
from studies.record import Record, read_record
from studies.record.one_gyro import records_of_one_gyro
from studies.record.rest import RestData, gather_rest
from studies.reports import style
from studies.reports.digits import lowered, raised
from studies.results import Chapter, Drawing, Facts, Figure, Result, Sentence, Table, row_of

ITSELF = 2.0  # times by which a fit improves its own records, from which they do show something
CHANGES = 0.1  # part of a frequency, more than temperature or trimming ever changes
LABELS = {
    "training": "fitted, rows",
    "training_averages_100s": "fitted, 100 s averages",
    "held_out": "held out, rows",
    "held_out_averages_100s": "held out, 100 s averages",
}
COEFFICIENTS = "name: Coefficient | value ± error: Value | Unit | ratio: Ratio to ζ₀"
USELESS = "On held-out data the compensation does not improve the output: beyond its noise, this record shows no cross-damping that varies with temperature."
ALONE = "Each record is improved by its own fit, but held-out data become worse: the records do not predict each other. Is each right (unit, sign, temperature), of one gyro, and over the temperatures of the others?"
SCALE = (
    "The output depends only on the product of cross-damping and frequency, so an error of the given frequency scales all coefficients."
    " A constant bias of any other origin is included in ζ₀."
)
HELD_OUT = "Before: standard deviation; after: rms. Held out: each run, or each fifth of a single run, predicted from the others."


@answers("hrg.fit-cross-damping/1")
def fit_cross_damping(
    *data: Records,
    frequency: Annotated[float | None, POSITIVE] = None,
    quality: Annotated[float | None, POSITIVE] = None,
    order: Annotated[int, ORDER] = 3,
    calibration_temperature: float = 20.0,
    save: SaveModel = None,
) -> Result:
    """Fit the cross-damping of a cylindrical gyro over temperature (CVG cross-damping paper, equations 9 and 10).

    The records are of a gyro at rest: time_s, a temperature, and bias_deg_per_h or measured_rate_deg_per_s. The output depends
    only on the product of cross-damping and frequency, so the coefficients are only as accurate as the given frequency.

    Args:
        frequency: Natural frequency in Hz; by default the median of frequency_Hz in the records.
        quality: Quality factor Q, which gives the relative damping 1/(2Q); by default from inverse_q in the records.
        order: Highest power of the temperature; the paper uses 3.
        calibration_temperature: Temperature in °C about which the polynomial is expanded.
    """
    records = records_of_one_gyro([read_record(path) for path in data], say)
    carrier = frequency
    if carrier is None or any(record.has_values("frequency_Hz") for record in records):
        measured = _median(records, "frequency_Hz", "--frequency")
        carrier = measured if carrier is None else carrier
        if abs(carrier / measured - 1) > CHANGES:
            raise InputError(f"--frequency {carrier:g}: frequency_Hz of the records is {measured:.6g} Hz (median), and no resonator changes by so much. Correct the option or the column.")  # fmt: skip
    if quality is None:
        loss = _median(records, "inverse_q", "--quality")
        quality = 1 / loss if loss else float("inf")
    if not (0 < carrier < 1e9 and 1 < quality < 1e12):
        wrong = f"--quality {quality:g}" if 0 < carrier < 1e9 else f"--frequency {carrier:g}"
        raise InputError(f"{wrong}: {carrier:g} Hz with Q = {quality:g} is not a resonator; correct the option or the columns of the record.")  # fmt: skip
    if not -zero_Celsius < calibration_temperature <= 1000:
        raise InputError(f"--calibration-temperature {calibration_temperature:g} °C: no gyro has this temperature; give one within the record, in °C.")  # fmt: skip
    gathered = gather_rest(records, OUTPUTS)
    with naming(", ".join(data)):
        gyro = {"k": 2 * math.pi * carrier, "zeta": 1 / (2 * quality)}
        study = study_cross_damping(gathered.runs, **gyro, calibration_temperature=calibration_temperature, order=order)
    sources, made_by = tuple(map(source_of, records)), "hrg-workbench, hrg fit cross-damping"
    model = save_cross_damping(study.model, gathered.output, gathered.temperature_column, sources, made_by)
    keep_model(model, save)
    summary = _summarise(study, gathered)
    unit = {"bias_deg_per_h": "°/h", "measured_rate_deg_per_s": "°/s"}[gathered.output]
    changes = [{"label": label} | summary[key] for key, label in LABELS.items()]
    fitted, held_out = study.training.averages, study.held_out.averages
    residual, dynamic = summary["held_out_averages_100s"]["after"], summary["dynamic_part"]
    left = (
        f"Left out: {numbered(gathered.left_out, 'row')} with an empty cell or an outlier." if gathered.left_out else ""
    )
    averaged = f"Long records were averaged over {gathered.block_s:g} s before the fit." if gathered.block_s else ""
    return Result(
        {"records": list(data), **summary},
        "Cross-damping over temperature",
        f"Zero-rate output of {', '.join(data)}, fitted with a cross-damping of order {order} in temperature.",
        [
            Facts([
                ("Improvement, fitted data", f"{fitted.ratio:.2f}×", "100 s averages"),
                ("Improvement, held-out data", f"{held_out.ratio:.2f}×", f"100 s averages; rows {study.held_out.rows.ratio:.2f}×"),
                ("Residual, held-out data", f"{residual:.3g} {unit}", "rms of 100 s averages"),
                ("Effect of the filter (9)", f"{dynamic:.2g} {unit}", "largest change that it makes to the correction"),
            ]),
            None if study.is_useful else Sentence(ALONE if len(data) > 1 and fitted.ratio > ITSELF else USELESS, "warning"), left, averaged,
            Chapter("Output before and after", [
                Figure(lambda: draw_runs(study.runs, study.model, OUTPUTS[gathered.output], unit), RUNS),
                Table("Zero-rate output", changes,
                    f"label: Data | before: Before ({unit}) | after: After ({unit}) | improvement: Improvement .2f", HELD_OUT),
            ]),
            Chapter("Cross-damping over temperature", [
                Figure(lambda: _draw_curve(study), "Cross-damping over temperature, relative to its value at calibration."),
                Table(f"Cross-damping about {calibration_temperature:g} °C", _coefficients(summary), COEFFICIENTS,
                    "The errors allow for white noise plus a random walk of the bias."),
                Sentence(SCALE, "note", "page"),
            ]),
        ],
        sources=SOURCES,
    )  # fmt: skip


def _coefficients(summary: dict[str, Any]) -> list[dict[str, Any]]:
    values, errors = summary["coefficients"], summary["standard_errors"]
    units = ["", "1/K", *(f"1/K{raised(i)}" for i in range(2, len(values)))]
    return [
        {"name": f"ζ{lowered(i)}", "value": value, "error": error, "unit": units[i], "ratio": value / values[0]}
        for i, (value, error) in enumerate(zip(values, errors, strict=True))
    ]


def _draw_curve(study: CrossDampingStudy) -> Drawing:
    model = study.model
    T = np.linspace(model.lowest, model.highest, 200)
    powers = (T - model.calibration_temperature)[:, None] ** np.arange(len(model.coefficients))
    size = model.coefficients[0]
    spread = NINETY * np.sqrt(np.einsum("ni,ij,nj->n", powers, model.covariance, powers)) / abs(size)
    middle = powers @ model.coefficients / size
    with style.figure(height=3.0, x="temperature (°C)", y="ζ₁₂ / ζ₀") as (made, axes):
        axes.fill_between(T, middle - spread, middle + spread, color=style.SKY, alpha=0.4, label="90 % band")
        axes.plot(T, middle, label="fitted")
        return made


def _summarise(study: CrossDampingStudy, data: RestData) -> dict[str, Any]:
    """Numbers of the fit; before, after and dynamic_part in the unit of the output column."""
    unit, model = OUTPUTS[data.output], study.model
    judged = {"training": study.training, "held_out": study.held_out}
    return {
        **row_of(data, "output", temperature="temperature_column", rows_left_out="left_out"),
        "frequency_Hz": model.k / (2 * math.pi),
        "quality": 1 / (2 * model.zeta),
        "calibration_temperature_degC": model.calibration_temperature,
        "coefficients": model.coefficients,
        "standard_errors": np.sqrt(np.diag(model.covariance)),
        **{name: _change(one.rows, unit) for name, one in judged.items()},
        **{f"{name}_averages_100s": _change(one.averages, unit) for name, one in judged.items()},
        **{f"improvement_{name}": one.rows.ratio for name, one in judged.items()},
        "useful": study.is_useful,
        "dynamic_part": study.memory / unit,
    }


def _change(change: Change, unit: float) -> dict[str, float]:
    return {"before": change.before / unit, "after": change.after / unit, "improvement": change.ratio}


def _median(records: list[Record], column: str, option: str) -> float:
    values = np.concatenate([record[column] for record in records if column in record] or [np.empty(0)])
    if not np.any(np.isfinite(values)):
        raise InputError(f"the records have no {column}; give {option}.")
    return float(np.nanmedian(values))
