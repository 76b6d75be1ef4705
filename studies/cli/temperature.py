"""`hrg temperature`: the resonator's temperature from its own frequency."""

from studies.cli.output import Answer, answers

AVERAGE = 100.0  # s


@answers("hrg.temperature/1")
def temperature(model: str, run: str, /, *, out: str | None = None, report: str | None = None) -> Answer:
    """Turn the frequency of a record into the resonator's temperature (HRG paper, equation 18, Table 2 and Figure 5).

    No thermometer is needed: the resonator is its own. The record is written again with a column
    resonator_temperature_degC, over which 'hrg fit bias --over temperature' can compensate other outputs.

    Parameters
    ----------
    model : str
        A frequency model (TOML) that 'hrg fit frequency --save' wrote.
    run : str
        A record (CSV) with frequency_Hz.
    out : str
        Where the record with the temperature goes.
    report : str
        Write a page (HTML) with the temperature over time.
    """
    import numpy as np

    from studies.cli.output import say
    from studies.errors import InputError, naming
    from studies.files.writing import write_text
    from studies.models import read_model
    from studies.models.kinds.frequency import find_temperature, temperature_error
    from studies.record import read_record, write_record

    loaded = read_model(model)
    if loaded.kind != "frequency":
        raise InputError(
            f"{model}: a model of kind '{loaded.kind}'; one of kind 'frequency' is needed (hrg fit frequency)."
        )
    record = read_record(run)
    with naming(run):
        found = find_temperature(loaded, record["frequency_Hz"], run)
    known = np.isfinite(found)
    facts = {
        "rows": len(record),
        "rows_without_frequency": int(np.count_nonzero(~known)),
        "lowest_degC": float(found[known].min()),
        "highest_degC": float(found[known].max()),
        "curve_uncertainty_K": max(
            temperature_error(loaded, float(T)) for T in np.percentile(found[known], [0, 50, 100])
        ),
    }
    true = record.columns.get("resonator_temperature_degC")
    if true is not None:
        facts["rms_difference_from_simulated_K"] = float(np.sqrt(np.nanmean((found - true) ** 2)))
    if out is not None:
        write_record(record.with_columns({"resonator_temperature_degC": found}), out)
        say(f"record: {out}")
    if report is not None:
        from studies.reports.temperature import temperature_page

        write_text(report, temperature_page(record, found, run, model, facts))
        say(f"report: {report}")
    yield {"schema": "hrg.temperature/1", "model": model, "run": run, "out": out, **facts}
    print(
        f"{run}: the resonator went from {facts['lowest_degC']:.3f} to {facts['highest_degC']:.3f} °C;"
        f" the curve is certain to {facts['curve_uncertainty_K']:.2g} K (one standard deviation)."
    )
    if true is not None:
        print(
            f"The record's own, simulated temperature differs by {facts['rms_difference_from_simulated_K']:.2g} K rms."
        )
    if facts["rows_without_frequency"]:
        print(f"{facts['rows_without_frequency']} rows have no frequency and stay empty.")
