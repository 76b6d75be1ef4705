"""`hrg fit frequency`: f(T) and its inverse from a steady-state table, or from the settled parts of records.

With --json one object, schema `hrg.fit-frequency/1`; from records it has besides `soaks`: `[{record, start_s, end_s,
temperature_degC, frequency_Hz, error_Hz, left_K, extrapolated_K}]`, `left_K` what may be left of the change, `extrapolated_K` by how
much the end of a hold was extrapolated along its exponential (0 where it had settled), and `time_constant_s` of the slowest.
"""

from typing import TYPE_CHECKING

from studies.cli.output import Answer, answers

if TYPE_CHECKING:
    from studies.settled import Soak


@answers("hrg.fit-frequency/1")
def fit_frequency(
    table: str,
    *more: str,
    order: int = 3,
    reference_temperature: float = 0.0,
    resolution: float | None = None,
    save: str | None = None,
    report: str | None = None,
    time_constant: float = 3000.0,
    left: float = 0.05,
) -> Answer:
    """Fit the frequency over temperature by a polynomial and invert it (HRG paper, equations 16 to 18, Table 2).

    Parameters
    ----------
    table : str
        A CSV file with the columns temperature_degC,frequency_Hz; or a record, whose settled parts (soaks) are found and become
        such a table. A hold that ends a little before it has settled is extrapolated along its own exponential.
    more : str
        Further records of the same device.
    time_constant : float
        Slowest time constant of the gyro in s, from which follows how settled a record is; hrg fit thermal measures it. A longer
        one that the records show takes its place.
    left : float
        Departure from the settled temperature, in K, within which a record counts as settled.
    order : int
        Order of the polynomial; the paper takes 3.
    reference_temperature : float
        Temperature T0 in °C about which the coefficients are given.
    resolution : float
        Step of the frequency readings in Hz; by default the last digit that stands in the file.
    save : str
        Write the model (TOML), for hrg compensate.
    report : str
        Write a page (HTML).
    """
    from studies.cli.output import print_table, say
    from studies.errors import naming
    from studies.files.columns import read_header
    from studies.files.writing import write_text
    from studies.papers.hrg import study_table
    from studies.record import read_frequency_table, reading_resolution
    from studies.reports import frequency as page

    soaks: tuple[Soak, ...] = ()
    shown = time_constant
    if more or "time_s" in read_header(table):
        from studies.plausible import records_of_one_gyro
        from studies.record import read_record
        from studies.settled import advise_hold, find_soaks, settled_table

        records = records_of_one_gyro([read_record(path) for path in (table, *more)], say)
        soaks = find_soaks(records, time_constant, left)
        T, f, step = settled_table(soaks, table, advise_hold(records, time_constant, left) if len(soaks) < 2 else "")
        sha256 = records[0].sha256
        shown = max(soak.time_constant for soak in soaks)
        if shown > time_constant:
            say(
                f"the records show a time constant of {shown / 60:.0f} min; it takes the place of {time_constant / 60:.0f} min."
            )
        for soak in soaks:
            what = "extrapolated" if soak.extrapolated_K else "settled"
            how = (
                f"{soak.extrapolated_K:.2g} K beyond its last reading, with a time constant of {soak.time_constant / 60:.0f} min"
                if soak.extrapolated_K
                else f"at most {soak.left_K:.2g} K left to settle"
            )
            say(
                f"{what}: {soak.path}, {soak.start:.0f} to {soak.end:.0f} s: {soak.temperature_degC:.3f} °C,"
                f" {soak.frequency_Hz:.5f} Hz ± {soak.error_Hz:.1g}; {how}."
            )
    else:
        data = read_frequency_table(table)
        T, f, sha256 = data.values["temperature_degC"], data.values["frequency_Hz"], data.sha256
        step = reading_resolution(f)
    step = resolution if resolution is not None else step
    with naming(table):
        study = study_table(T, f, order, reference_temperature, step)
    if save is not None:
        from pathlib import Path

        from studies.models import ModelSource, write_model
        from studies.models.kinds.frequency import save_frequency

        source = ModelSource(Path(table).name, sha256, len(f))
        write_model(save_frequency(study.fit, (source,), "hrg-workbench, hrg fit frequency"), save)
        say(f"model: {save}")
    if report is not None:
        write_text(report, page.frequency_page(study, table))
        say(f"report: {report}")
    fit = study.fit
    yield {
        "schema": "hrg.fit-frequency/1",
        "table": table,
        "order": fit.order,
        "reference_temperature_degC": fit.reference_temperature_degC,
        "coefficients": fit.coefficients,
        "standard_errors": fit.standard_errors,
        "resolution_Hz": fit.resolution,
        "sum_of_squares_Hz2": fit.sum_of_squares,
        "leave_one_out_Hz": fit.leave_one_out_rms,
        "calculated_degC": study.calculated_degC,
        "error_degC": study.error_degC,
        "recommended_order": study.orders.recommended,
        **({"soaks": [_describe(soak) for soak in soaks], "time_constant_s": shown} if soaks else {}),
    }
    for block in (page.coefficients_table(study), page.inverse_table(study), page.order_table(study)):
        print_table(block.caption, block.columns, block.rows, block.note)
    print(page.order_sentence(study))


def _describe(soak: "Soak") -> dict[str, str | float]:
    return {
        "record": soak.path,
        "start_s": soak.start,
        "end_s": soak.end,
        "temperature_degC": soak.temperature_degC,
        "frequency_Hz": soak.frequency_Hz,
        "error_Hz": soak.error_Hz,
        "left_K": soak.left_K,
        "extrapolated_K": soak.extrapolated_K,
    }
