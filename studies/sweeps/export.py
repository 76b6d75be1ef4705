"""The results of a study as files: a CSV, written some thousand cases at a time, with the unit of every column beside it."""

import csv
import io
import json
from pathlib import Path
from typing import TYPE_CHECKING

from studies.files.writing import write_text, written_whole

if TYPE_CHECKING:
    from studies.sweeps.results import Results


def export_results(results: "Results", path: str | Path) -> Path:
    """Write the table as CSV and, beside it, `NAME.units.json`, whose path is returned; floats keep every digit."""
    with written_whole(path) as file:
        text = io.TextIOWrapper(file, "utf-8", newline="")
        csv.writer(text, lineterminator="\n").writerow(map(_harmless, results.header))
        for frame in results.frames():
            for name in frame.select_dtypes(exclude="number"):
                frame[name] = frame[name].map(_harmless)
            frame.to_csv(text, header=False, index=False, lineterminator="\n")
        text.flush()
        text.detach()
    beside = Path(path).with_suffix(".units.json")
    attributes = {"study": results.study.name, "units": results.units}
    write_text(beside, json.dumps(attributes, indent=2, ensure_ascii=False) + "\n")
    return beside


def _harmless(cell: str) -> str:
    """Return a text that no spreadsheet takes for a formula."""
    return f"'{cell}" if cell.startswith(("=", "+", "-", "@", "\t")) else cell
