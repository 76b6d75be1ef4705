"""`hrg fit cross-damping`: the bias of a CVG from cross-damping over temperature."""

from typing import TYPE_CHECKING, Any

from studies.cli.output import Answer, answers

if TYPE_CHECKING:
    from compensation.improvement import Change
    from studies.cross_damping import CrossDampingStudy
    from studies.record import Record
    from studies.rest import RestData


@answers("hrg.fit-cross-damping/1")
def fit_cross_damping(
    *data: str,
    frequency: float | None = None,
    quality: float | None = None,
    order: int = 3,
    calibration_temperature: float = 20.0,
    save: str | None = None,
    report: str | None = None,
) -> Answer:
    """Fit the cross-damping of a cylindrical gyro over temperature (CVG cross-damping paper, equations 9 and 10).

    The records are of a gyro at rest: time_s, a temperature, and bias_deg_per_h or measured_rate_deg_per_s.
    Only the product of cross-damping and frequency is seen in the output, so the scale of the coefficients
    is as good as the frequency given.

    Parameters
    ----------
    data : str
        One or more records (CSV).
    frequency : float
        Natural frequency in Hz; by default the median of the records' frequency_Hz.
    quality : float
        Quality factor Q, from which the relative damping 1/(2Q) follows; by default from the records' inverse_q.
    order : int
        Highest power of the temperature; the paper takes 3.
    calibration_temperature : float
        Temperature in °C from which the shift T is counted.
    save : str
        Write the model (TOML), for hrg compensate.
    report : str
        Write a page (HTML).
    """
    import math

    from shell.constants import zero_Celsius
    from studies.cli.output import print_table, say
    from studies.cross_damping import study_cross_damping
    from studies.errors import InputError, naming
    from studies.files.writing import write_text
    from studies.models import source_of, write_model
    from studies.models.kinds.cross_damping import OUTPUTS, save_cross_damping
    from studies.plausible import records_of_one_gyro
    from studies.record import read_record
    from studies.reports import cross_damping as page
    from studies.rest import gather_rest

    if not data:
        raise InputError("name at least one record (CSV) of a gyro at rest.")
    records = records_of_one_gyro([read_record(path) for path in data], say)
    carrier = frequency if frequency is not None else _median(records, "frequency_Hz", "--frequency")
    quality = quality if quality is not None else _quality(records)
    if not (0 < carrier < 1e9 and 1 < quality < 1e12):
        raise InputError(
            f"a frequency of {carrier:g} Hz with Q = {quality:g} is no resonator; give --frequency and --quality."
        )
    if not abs(calibration_temperature) <= 1000:
        raise InputError(
            f"--calibration-temperature {calibration_temperature:g} °C is not a temperature of a gyro: give one within the range of the record, in °C."
        )
    gathered = gather_rest(records, OUTPUTS)
    with naming(", ".join(data)):
        study = study_cross_damping(
            gathered.runs,
            k=2 * math.pi * carrier,
            zeta=1 / (2 * quality),
            calibration_temperature=calibration_temperature + zero_Celsius,
            order=order,
        )
    model = save_cross_damping(
        study.model,
        gathered.output,
        gathered.temperature_column,
        tuple(source_of(record) for record in records),
        "hrg-workbench, hrg fit cross-damping",
    )
    if save is not None:
        write_model(model, save)
        say(f"model: {save}")
    if gathered.left_out:
        say(f"{gathered.left_out} rows with an empty cell or an outlier were left out.")
    if gathered.block_s:
        say(f"long records were averaged over {gathered.block_s:g} s before the fit.")
    if report is not None:
        write_text(report, page.cross_damping_page(study, gathered, ", ".join(data)))
        say(f"report: {report}")
    yield {"schema": "hrg.fit-cross-damping/1", "records": list(data), **_summarise(study, gathered)}
    for block in (page.coefficients_table(study), page.improvement_table(study, gathered)):
        print_table(block.caption, block.columns, block.rows, block.note)
    if not study.is_useful:
        print(page.USELESS)


def _summarise(study: "CrossDampingStudy", data: "RestData") -> dict[str, Any]:
    """Numbers of the fit; before, after and dynamic_part in the unit of the output column."""
    import math

    import numpy as np

    from shell.constants import zero_Celsius
    from studies.models.kinds.cross_damping import OUTPUTS

    unit, model = OUTPUTS[data.output], study.model
    return {
        "output": data.output,
        "temperature": data.temperature_column,
        "frequency_Hz": model.k / (2 * math.pi),
        "quality": 1 / (2 * model.zeta),
        "calibration_temperature_degC": round(model.calibration_temperature - zero_Celsius, 9),
        "coefficients": model.coefficients,
        "standard_errors": np.sqrt(np.diag(model.covariance)),
        "training": _change(study.training.rows, unit),
        "training_averages_100s": _change(study.training.averages, unit),
        "held_out": _change(study.held_out.rows, unit),
        "held_out_averages_100s": _change(study.held_out.averages, unit),
        "improvement_training": study.training.rows.ratio,
        "improvement_held_out": study.held_out.rows.ratio,
        "useful": study.is_useful,
        "dynamic_part": study.memory / unit,
        "rows_left_out": data.left_out,
    }


def _change(change: "Change", unit: float) -> dict[str, float]:
    return {"before": change.before / unit, "after": change.after / unit, "improvement": change.ratio}


def _quality(records: "list[Record]") -> float:
    """Quality factor from the median 1/Q of the records."""
    loss = _median(records, "inverse_q", "--quality")
    return 1 / loss if loss else float("inf")


def _median(records: "list[Record]", column: str, option: str) -> float:
    """Median of a column over all records that have it."""
    import numpy as np

    from studies.errors import InputError

    values = np.concatenate([record[column] for record in records if column in record] or [np.empty(0)])
    if not np.any(np.isfinite(values)):
        raise InputError(f"the records have no {column}; give {option}.")
    return float(np.nanmedian(values))
