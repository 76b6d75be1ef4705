"""`hrg fit frequency`: f(T) and its inverse from a steady-state table."""


def fit_frequency(
    table: str,
    *,
    order: int = 3,
    reference_temperature: float = 0.0,
    resolution: float | None = None,
    save: str | None = None,
    report: str | None = None,
    json: bool = False,
) -> int:
    """Fit the frequency over temperature by a polynomial and invert it (HRG paper, equations 16 to 18, Table 2).

    Parameters
    ----------
    table : str
        A CSV file with the columns temperature_degC,frequency_Hz.
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
    json : bool
        Print one JSON object (schema hrg.fit-frequency/1) instead of tables.
    """
    from studies.cli.output import print_json, print_table, say
    from studies.errors import naming
    from studies.files.writing import write_text
    from studies.papers.hrg import study_table
    from studies.record import read_frequency_table, reading_resolution
    from studies.reports import frequency as page

    data = read_frequency_table(table)
    T, f = data.values["temperature_degC"], data.values["frequency_Hz"]
    step = resolution if resolution is not None else reading_resolution(f)
    with naming(table):
        study = study_table(T, f, order, reference_temperature, step)
    if save is not None:
        from pathlib import Path

        from studies.models import Source, write_model
        from studies.models.kinds.frequency import save_frequency

        source = Source(Path(table).name, data.sha256, len(f))
        write_model(save_frequency(study.fit, (source,), "hrg-workbench, hrg fit frequency"), save)
        say(f"model: {save}")
    if report is not None:
        write_text(report, page.frequency_page(study, table))
        say(f"report: {report}")
    fit = study.fit
    if json:
        print_json(
            {
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
            }
        )
        return 0
    for block in (page.coefficients_table(study), page.inverse_table(study), page.order_table(study)):
        print_table(block.caption, block.columns, block.rows, block.note)
    print(page.order_sentence(study))
    return 0
