"""`hrg fit frequency`: f(T) and its inverse from a steady-state table, or from the settled parts of records."""

from collections import Counter
from pathlib import Path
from typing import Annotated

from compensation.arrays import Array
from compensation.errors import CompensationError
from compensation.frequency import exchanged_readings, odd_reading
from studies.cli.arguments import ORDER, POSITIVE, SaveModel
from studies.cli.output import answers, keep_model, say
from studies.errors import InputError, naming
from studies.files.columns import read_header
from studies.models import ModelSource
from studies.models.kinds.frequency import save_frequency
from studies.papers.hrg import study_table
from studies.record import read_frequency_table, read_record, reading_resolution
from studies.record.one_gyro import records_of_one_gyro
from studies.record.settled import Soak, advise_hold, find_soaks, settled_table
from studies.reports import frequency as parts
from studies.results import Chapter, Result, Sentence, Table, row_of

DIGITS = 10.0  # steps of the reading by which one that is odd is off at least
SHOWN = ("temperature_degC", "frequency_Hz", "error_Hz", "left_K", "extrapolated_K")
SOAKS = (
    "Record | start_s: From (s) .0f | end_s: To (s) .0f | temperature_degC: Temperature (°C) .3f"
    " | frequency_Hz ± error_Hz: Frequency (Hz) | left_K: Settling error (K) .2 | extrapolated_K: Extrapolated by (K) .2"
)


@answers("hrg.fit-frequency/1")
def fit_frequency(
    table: str,
    *more: str,
    order: Annotated[int, ORDER] = 3,
    reference_temperature: float = 0.0,
    resolution: Annotated[float | None, POSITIVE] = None,
    save: SaveModel = None,
    time_constant: Annotated[float, POSITIVE] = 3000.0,
    left: Annotated[float, POSITIVE] = 0.05,
) -> Result:
    """Fit a polynomial to frequency over temperature and invert it (HRG paper, equations 16 to 18, Table 2).

    Args:
        table: A CSV file with the columns temperature_degC,frequency_Hz, or a record: its settled parts (soaks) become
            the points; a hold that ends shortly before it settles is extrapolated along its exponential.
        more: More records of the same gyro.
        time_constant: Slowest time constant of the gyro in s, used to judge whether a record has settled; hrg fit
            thermal measures it. If the records show a longer one, that one is used.
        left: A soak counts as settled when the temperature is within this of its final value, in K.
        order: Order of the polynomial; the paper uses 3.
        reference_temperature: Temperature T0 in °C about which the polynomial is expanded.
        resolution: Resolution of the frequency readings in Hz; by default the last digit in the file.
    """
    T, f, step, sources, soaks = _read_points((table, *more), time_constant, left, order)
    read = ", ".join((table, *more))
    if pair := exchanged_readings(T, f, order):
        both = " and ".join(f"{f[k]:.10g} Hz at {T[k]:g} °C" for k in sorted(pair))
        raise InputError(
            f"{read}: {both} are exchanged: the other way round they lie on the curve of the other readings. Correct the rows."
        )
    odd, doubt = odd_reading(T, f, order), ""
    if odd is not None and abs(odd[1]) > DIGITS * step:
        k, away = odd
        doubt = f"{f[k]:.10g} Hz at {T[k]:g} °C is {away:+.3g} Hz from the curve of the other readings, as no noise is: correct it, or leave it out."
    with naming(read):
        try:
            study = study_table(T, f, order, reference_temperature, step if resolution is None else resolution)
        except CompensationError as error:
            raise CompensationError(doubt or str(error)) from error
    fit = study.fit
    keep_model(save_frequency(fit, sources, "hrg-workbench, hrg fit frequency"), save)
    rows = [row_of(soak, *SHOWN, record="path", start_s="start", end_s="end") for soak in soaks]
    slowest = max((soak.time_constant for soak in soaks), default=0.0)
    payload = {
        "table": table,
        **row_of(fit, "order", "reference_temperature_degC", "coefficients", "standard_errors"),
        "resolution_Hz": fit.resolution,
        **row_of(fit.regression, sum_of_squares_Hz2="sum_of_squares", leave_one_out_Hz="leave_one_out_rms"),
        **row_of(study, "calculated_degC", "error_degC", recommended_order="orders.recommended"),
        **({"soaks": rows, "time_constant_s": slowest} if soaks else {}),
    }
    low, high = fit.temperature_range_degC
    figures = [parts.fit_figure(study), parts.error_figure(study)]
    settled = bool(soaks) and resolution is None
    note = f"Judged with a time constant of {slowest / 60:.0f} min."
    return Result(
        payload,
        "Frequency over temperature",
        f"{len(f)} settled points of {read} from {low:.4g} to {high:.4g} °C, fitted with a {parts.name_order(fit.order)}.",
        [
            doubt and Sentence(doubt, "warning"),
            parts.facts(study),
            parts.order_sentence(study),
            Chapter("Settled parts", [Table("Settled parts of the records", rows, SOAKS, note)]),
            Chapter(
                "Fit and inverse", [parts.coefficients_table(study, settled), parts.inverse_table(study), *figures]
            ),
            Chapter("Order of the polynomial", parts.order_parts(study, settled)),
        ],
        sources=parts.SOURCES,
    )


def _read_points(
    paths: tuple[str, ...], time_constant: float, left: float, order: int
) -> tuple[Array, Array, float, tuple[ModelSource, ...], tuple[Soak, ...]]:
    """Return temperatures (°C), frequencies (Hz), their resolution (Hz), their sources, and the soaks where they are of records."""
    first = paths[0]
    soaks: tuple[Soak, ...] = ()
    sources: tuple[ModelSource, ...]
    if len(paths) == 1 and "time_s" not in read_header(first):
        data = read_frequency_table(first)
        T, f = data.values["temperature_degC"], data.values["frequency_Hz"]
        step, sources = reading_resolution(f), (ModelSource(Path(first).name, data.sha256, len(f)),)
    else:
        records = records_of_one_gyro([read_record(path) for path in paths], say)
        soaks = find_soaks(records, time_constant, left)
        advice = advise_hold(records, time_constant, left) if len(soaks) < order + 2 else ""
        T, f, step = settled_table(soaks, ", ".join(paths), advice)
        if len(soaks) < order + 2:
            raise InputError(
                f"{', '.join(paths)}: found {len(soaks)} settled parts; order {order} needs {order + 2}. {advice or 'Hold more temperatures.'}"
                " Raising --left accepts parts that are less settled; lowering --order needs fewer."
            )
        counts = Counter(soak.path for soak in soaks)
        of_soaks = [(record, counts[record.path]) for record in records if counts[record.path]]
        sources = tuple(ModelSource(Path(record.path).name, record.sha256, count) for record, count in of_soaks)
        shown = max(soak.time_constant for soak in soaks)
        if shown > 1.01 * time_constant:
            say(f"the records show a time constant of {shown / 60:.3g} min, used instead of {time_constant / 60:.3g}.")
    return T, f, step, sources, soaks
