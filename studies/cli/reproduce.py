"""`hrg reproduce`: the papers' tables and figures from their data."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray


def reproduce(*, out: str = "report", json: bool = False) -> int:
    """Recompute the HRG paper's Table 1, Table 2 and figures 4 and 5, beside what first principles predict.

    Writes report.html, summary.json, table1.csv and table2.csv.

    Parameters
    ----------
    out : str
        Folder for the files; made when it does not exist.
    json : bool
        Print the content of summary.json on standard output.
    """
    from pathlib import Path

    from studies.cli.output import dump_json, print_json, say
    from studies.files.writing import check_folder, write_text
    from studies.instrument.card import load_card
    from studies.papers import hrg
    from studies.reports.mode_picture import mode_blocks
    from studies.reports.reproduce import reproduce_page, summarise

    folder = check_folder(out)
    T, f = hrg.printed_table1()
    study = hrg.study_table(T, f, resolution=hrg.RESOLUTION)
    say("solving the shell modes of the card over temperature ...")
    instrument = load_card(hrg.CARD)
    physics = hrg.compare_physics(study, instrument)
    summary = summarise(study, physics)
    say("drawing the page ...")
    page = reproduce_page(study, physics, [], mode_blocks(instrument))
    write_text(
        folder / "table1.csv", _csv(("temperature_degC", "frequency_Hz", "cubic_Hz"), (T, f, study.fit.frequency(T)))
    )
    names = ("frequency_Hz", "actual_temperature_degC", "calculated_temperature_degC", "error_degC")
    write_text(folder / "table2.csv", _csv(names, (f, T, study.calculated_degC, study.error_degC)))
    write_text(folder / "summary.json", dump_json(summary))
    write_text(folder / "report.html", page)
    if json:
        print_json(summary)
    else:
        sensitivity = summary["sensitivity_ppm_per_degC"]
        print(
            f"slope at 20 °C: measured {sensitivity['measured']:.1f}, predicted {sensitivity['simulated']:.1f}"
            f" ± {sensitivity['uncertainty']:.1f} ppm/°C; Table 2 reproduced, largest error"
            f" {max(abs(study.error_degC)):.3f} °C."
        )
        print(f"report: {Path(folder, 'report.html')}")
    return 0


def _csv(names: "Sequence[str]", columns: "Sequence[NDArray[np.float64]]") -> str:
    rows = "\n".join(",".join(f"{float(x):.10g}" for x in row) for row in zip(*columns, strict=True))
    return f"{','.join(names)}\n{rows}\n"
