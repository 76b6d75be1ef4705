"""`hrg reproduce`: the papers' tables and figures from their data."""

from dataclasses import replace

from studies.cli.output import answers, dump_json
from studies.files.writing import check_folder, write_numbers, write_text
from studies.results import Result


@answers("hrg.reproduce/1", page=False)
def reproduce(*, out: str = "report") -> Result:
    """Recompute the tables and figures of the papers and compare them with first-principles predictions.

    Writes report.html, summary.json, table1.csv and table2.csv.

    Args:
        out: Folder for the files; created if it does not exist.
    """
    from studies.reports.reproduce import reproduce_papers
    from studies.results.page import render_result

    folder = check_folder(out)
    study, result = reproduce_papers()
    T, f = study.temperature_degC, study.frequency
    fitted = {"temperature_degC": T, "frequency_Hz": f, "cubic_Hz": study.fit.frequency(T)}
    write_numbers(folder / "table1.csv", fitted, ".10g")
    found = {"calculated_temperature_degC": study.calculated_degC, "error_degC": study.error_degC}
    write_numbers(folder / "table2.csv", {"frequency_Hz": f, "actual_temperature_degC": T, **found}, ".10g")
    write_text(folder / "summary.json", dump_json(result.payload))
    write_text(folder / "report.html", render_result(result))
    sensitivity = result.payload["sensitivity_ppm_per_degC"]
    told = (
        f"slope at 20 °C: measured {sensitivity['measured']:.1f}, predicted {sensitivity['simulated']:.1f} ± {sensitivity['uncertainty']:.1f} ppm/°C; largest temperature error in Table 2"
        f" {max(abs(study.error_degC)):.3f} °C.\nreport: {folder / 'report.html'}\n"
    )
    return replace(result, printed=told)
