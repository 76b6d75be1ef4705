"""The results of a study as files: a CSV with the unit of every column beside it."""

import csv
import io
import json
from pathlib import Path
from typing import TYPE_CHECKING

from studies.files.writing import write_text

if TYPE_CHECKING:
    from studies.sweeps.results import Results


def export_results(results: "Results", path: str | Path) -> Path:
    """Write the table as CSV and, beside it, `NAME.units.json`; floats keep every digit.

    Returns
    -------
    Path
        Of the file with the units.
    """
    table = results.table()
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table.columns)
    for row in table.itertuples(index=False, name=None):
        writer.writerow([_spell(cell) for cell in row])
    write_text(path, text.getvalue())
    beside = Path(path).with_suffix(".units.json")
    write_text(beside, json.dumps(table.attrs, indent=2, ensure_ascii=False) + "\n")
    return beside


def _spell(cell: object) -> object:
    """Write floats with every digit, and texts so that a spreadsheet does not take them for formulas."""
    if isinstance(cell, float):
        return "" if cell != cell else repr(cell)
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(("=", "+", "-", "@", "\t")) else cell
