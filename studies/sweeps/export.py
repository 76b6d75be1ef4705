"""The results of a study as files: a CSV, written some thousand cases at a time, with the unit of every column beside it."""

import csv
import io
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from studies.files.writing import write_text, written_whole

if TYPE_CHECKING:
    from studies.sweeps.results import Chunk, Results


def export_results(results: "Results", path: str | Path) -> Path:
    """Write the table as CSV and, beside it, `NAME.units.json`; floats keep every digit.

    Returns
    -------
    Path
        Of the file with the units.
    """
    units = results.units
    with written_whole(path) as file:
        text = io.TextIOWrapper(file, "utf-8", newline="")
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(map(_harmless, [*units, "status", "remark"]))
        for chunk in results.chunks():
            writer.writerows(zip(*_columns(chunk, results.judged), strict=True))
        text.flush()
        text.detach()
    beside = Path(path).with_suffix(".units.json")
    attributes = {"study": results.study.name, "units": units}
    write_text(beside, json.dumps(attributes, indent=2, ensure_ascii=False) + "\n")
    return beside


def _columns(chunk: "Chunk", judged: list[bool]) -> list[list[Any]]:
    columns = [_cells(values) for values in chunk.parameters.values()]
    for values, errors, known in zip(chunk.values.T, chunk.errors.T, judged, strict=True):
        columns += [_cells(values), _cells(errors)] if known else [_cells(values)]
    status, remarks = ["ok"] * len(chunk.values), [""] * len(chunk.values)
    for row, (found, text) in chunk.remarks.items():
        status[row], remarks[row] = "ok" if found == "ok" else "failed", _harmless(text)
    return [*columns, status, remarks]


def _cells(values: NDArray[Any]) -> list[Any]:
    """Return cells: floats with every digit, nothing for NaN, texts that no spreadsheet takes for a formula."""
    cells: list[Any] = values.tolist()
    if values.dtype.kind != "f":
        return [_harmless(cell) for cell in cells]
    for place in np.flatnonzero(np.isnan(values)).tolist():
        cells[place] = ""
    return cells


def _harmless(text: str) -> str:
    return f"'{text}" if text.startswith(("=", "+", "-", "@", "\t")) else text
