"""`hrg fit scale`: bias and scale of a bell-shaped gyro, step by step."""

from studies.cli.output import Answer, answers


@answers("hrg.fit-scale/1")
def fit_scale(
    *data: str,
    cutoff: float = 1.0,
    order: int = 50,
    no_filter: bool = False,
    save: str | None = None,
    report: str | None = None,
) -> Answer:
    """Fit null, bias over temperature, scale over rate and over temperature (BVG paper, equations 32 to 36).

    Three records, in any order, each with time_s, rate_deg_per_s (the applied rate), a temperature, and
    output_counts or measured_rate_deg_per_s: several rates at one temperature; at rest over temperature;
    at one rate over temperature. A fourth one at rest and then at one rate, at one temperature (the paper's five minutes of rest
    and +100 °/s), gives the rough null and scale (33); without it they come from the run of several rates.

    Parameters
    ----------
    data : str
        The records (CSV).
    cutoff : float
        Cut-off of the FIR filter in Hz; below half the output rate.
    order : int
        Order of the FIR filter; the paper takes 50.
    no_filter : bool
        Leave the FIR filter out: gaps are then allowed.
    save : str
        Write the model (TOML), for hrg compensate.
    report : str
        Write a page (HTML).
    """
    import dataclasses

    from studies.cli.output import print_table, say
    from studies.errors import InputError
    from studies.files.writing import write_text
    from studies.models import source_of, write_model
    from studies.models.kinds.scale import save_scale
    from studies.record import read_record
    from studies.reports import bell as page
    from studies.scale import study_scale

    if not data:
        raise InputError(
            "name three records (CSV): several rates, at rest over temperature, one rate over temperature; and, if there is one,"
            " a run at rest and then at one rate."
        )
    records = [read_record(path) for path in data]
    study = study_scale(records, None if no_filter else cutoff, order)
    sources = tuple(source_of(record) for record in records)
    model = save_scale(study.chain, study.output, study.temperature_column, sources, "hrg-workbench, hrg fit scale")
    if save is not None:
        write_model(model, save)
        say(f"model: {save}")
    if study.left_out:
        say(f"{study.left_out} rows with an empty cell or an outlier were left out.")
    if study.rough_run:
        say("rough null and scale: from the run at rest and then at one rate.")
    if study.averaged:
        say("long runs were averaged in blocks for the fit; the held-out error is that of the blocks.")
    if report is not None:
        write_text(report, page.scale_page(study, ", ".join(data)))
        say(f"report: {report}")
    yield {
        "schema": "hrg.fit-scale/1",
        "records": list(data),
        "output": study.output,
        "temperature": study.temperature_column,
        "parts": {
            part.name: {
                name: {"value": value, "standard_error": error, "unit": unit}
                for name, value, error, unit in zip(
                    part.names, part.values, part.standard_errors, part.units, strict=True
                )
            }
            for part in model.parts
        },
        "steps": [dataclasses.asdict(figures) for figures in study.figures],
        "error_before_deg_per_s": study.error_before,
        "error_held_out_deg_per_s": study.error_held_out,
        "filter_delay_s": study.chain.delay,
        "rows_left_out": study.left_out,
    }
    for block in (
        page.coefficients_table(study.chain, study.output),
        page.steps_table(study.figures, "After each step"),
    ):
        print_table(block.caption, block.columns, block.rows, block.note)
    print(
        f"Rate error on blocks left out of the fit: {study.error_before:.4f} °/s rough,"
        f" {study.error_held_out:.4f} °/s compensated (before the filter)."
    )
