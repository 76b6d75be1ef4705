"""Excel sheets as rows of text."""

import datetime
import importlib
from collections.abc import Iterator
from pathlib import Path

from studies.errors import InputError, MissingEnvironment, nearest
from studies.files.given import shorten

EXCEL = (".xlsx", ".xlsm")
MIDNIGHT = datetime.time()
MOST_CELLS = 20_000_000


def read_sheets(path: str | Path, sheet: str = "") -> Iterator[tuple[str, list[list[str]]]]:
    """Yield name and rows of the sheets of a workbook, or of one of them, as text: dates in ISO 8601, numbers with all their digits."""
    try:
        openpyxl = importlib.import_module("openpyxl")
    except ImportError:
        raise MissingEnvironment(
            f"{path}: reading Excel needs openpyxl: pip install 'hrg-workbench[excel]', or export the sheet as CSV."
        ) from None
    try:
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
        if sheet and sheet not in book.sheetnames:
            raise InputError(f"{path}: there is no sheet '{sheet}'{nearest(sheet, book.sheetnames)}")
        for page in [book[sheet]] if sheet else book.worksheets:
            if (page.max_row or 0) * (page.max_column or 0) > MOST_CELLS:
                raise InputError(
                    f"{path}: its sheet '{page.title}' extends to row {page.max_row}, column {page.max_column}, more than the limit of {MOST_CELLS:,}"
                    " cells. Delete cells far from the table, or export the sheet as CSV."
                )
            rows = list(page.iter_rows(values_only=True))
            clocks = {
                k
                for row in rows
                for k, x in enumerate(row)
                if isinstance(x, datetime.datetime) and x.time() != MIDNIGHT
            }
            yield page.title, [[_cell_text(value, k in clocks) for k, value in enumerate(row)] for row in rows]
    except InputError:
        raise
    except Exception as error:  # openpyxl lets errors of zip, XML and its own through, also while it reads
        raise InputError(f"{path}: not an Excel workbook that can be read ({shorten(str(error))}).") from None


def _cell_text(value: object, clock: bool) -> str:
    """Return a cell as text; a column of dates alone, which openpyxl gives as midnights, without the time of day."""
    value = value.date() if isinstance(value, datetime.datetime) and not clock else value
    return "" if value is None else str(value)
