"""`hrg reproduce`: the papers' tables and figures from their data."""

from dataclasses import replace
from typing import TYPE_CHECKING

from studies.cli.output import answers, dump_json
from studies.files.writing import check_folder, write_numbers, write_text
from studies.progress import Told
from studies.results import Result

if TYPE_CHECKING:
    from studies.reports.reproduce import Reproduction

GYROS = 12


@answers("hrg.reproduce/1", page=False)
def reproduce(*, out: str = "report") -> Result:
    """Recompute the tables and figures of the papers and compare them with first-principles predictions.

    Writes report.html, summary.json, table1.csv and table2.csv.

    Args:
        out: Folder for the files; created if it does not exist.
    """
    from studies.reports.reproduce import reproduce_result
    from studies.results.page import render_result

    folder = check_folder(out)
    parts = _reproduce()
    study, result = parts.study, reproduce_result(parts)
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


def _reproduce() -> "Reproduction":
    from studies.diagnosis.table import diagnose_table
    from studies.instrument.card import load_card
    from studies.papers import bias_twin, hrg
    from studies.papers.settling import study_settling
    from studies.reports.gyro_papers import reproduce_gyro_papers
    from studies.reports.reproduce import Reproduction

    told = Told("reproduction")
    told("modes over temperature and a first diagnosis of Table 1", 0.0)
    instrument = load_card(hrg.CARD)
    study = hrg.study_table(*hrg.printed_table1(), resolution=hrg.RESOLUTION)
    physics = hrg.compare_physics(study, instrument)
    diagnosis = diagnose_table(str(hrg.table1_path()))
    told("settling after a temperature step (figure 3)", 0.1)
    settling = study_settling(instrument)
    told(f"{GYROS} virtual gyros: bias compensation (figure 6)", 0.2)
    twins = [bias_twin.study_twin(seed) for seed in range(GYROS)]
    told("the CVG and BVG papers", 0.5)
    chapters, summary = reproduce_gyro_papers(GYROS)
    told("writing the page", 0.9)
    return Reproduction(study, physics, diagnosis, settling, twins, chapters, summary)
