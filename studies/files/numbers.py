"""The numbers of a comma-separated table: a clean one fast, any other with care, and refused with the line that is wrong."""

import codecs
import csv
import hashlib
import io
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from studies.errors import InputError, numbered
from studies.files.reading import MOST_BYTES, PORTION, opened, read_bytes
from studies.progress import tell

Table: TypeAlias = dict[str, NDArray[np.float64]]

_SOMETHING = re.compile(rb"\S")
IMPORT = " 'hrg import' brings laboratory files with other names, units and notations into this form."
FEW = 400_000  # numbers that are read before pandas, which reads faster, is loaded
ROWS_AT_ONCE = 200_000  # rows that are parsed at once, so that a large table costs its numbers and little more


def parse_numbers(path: str | Path, start: int, names: list[str], first_line: int) -> tuple[Table, str]:
    """Return the columns of a table whose body starts at a place of the file, on its `first_line`, and the hash of the bytes."""
    if found := parse_fast(path, start, names):
        return found
    data = check_text(path, read_bytes(path))
    if not _SOMETHING.search(data, start):
        raise InputError(f"{path}: the table has a header but no rows; add one line per measurement.")
    return _parse_by_line(path, data[start:].decode(), names, first_line), hashlib.sha256(data).hexdigest()


def parse_fast(path: str | Path, start: int, names: Sequence[str]) -> tuple[Table, str] | None:
    """Parse a clean table quickly, never all of its text in memory; None when the careful way must decide."""
    table, done, sha256 = np.empty((len(names), 0)), 0, ""
    try:
        for rows, sha256, part in parse_portions(path, start, names):  # noqa: B007
            table = table if done else np.empty((len(names), rows))
            table[:, done : done + part.shape[1]] = part
            done += part.shape[1]
    except ValueError:
        return None
    return dict(zip(names, table, strict=True)), sha256


def parse_portions(
    path: str | Path, start: int, names: Sequence[str], separator: str = ",", decimal: str = ".", most: int = MOST_BYTES
) -> Iterator[tuple[int, str, NDArray[np.float64]]]:
    """Yield the number of all rows, the hash and the next rows (columns, rows) of a clean table; ValueError when the careful way must decide."""
    with opened(path, most) as file:
        if (found := _scan(file, start, len(names), separator, decimal)) is None:
            raise ValueError("not plain numbers")
        rows, body, sha256 = found
        file.seek(body)
        if rows * len(names) <= FEW and (separator, decimal) == (",", "."):
            lines = file.read().split()
            if len(lines) != rows or any(line.count(b",") != len(names) - 1 for line in lines):
                raise ValueError("uneven rows")
            cells = b",".join(lines).split(b",")
            yield rows, sha256, np.reshape([float(cell or b"nan") for cell in cells], (rows, -1)).T
            return
        import pandas as pd

        done = 0
        form: dict[str, Any] = {"sep": separator, "decimal": decimal, "names": list(names), "header": None}
        form |= {"keep_default_na": False, "na_values": [""], "skip_blank_lines": False, "index_col": False}
        with pd.read_csv(file, **form, dtype="float64", chunksize=ROWS_AT_ONCE) as parts:
            for part in parts:
                done += len(part)
                tell(f"reading {path}", done / rows)
                yield rows, sha256, part.to_numpy().T
        if done != rows:
            raise ValueError("uneven rows")


def _scan(file: IO[bytes], start: int, columns: int, separator: str, decimal: str) -> tuple[int, int, str] | None:
    """Return rows, place of the body and hash; None unless all rows have all columns and nothing but plain decimal numbers."""
    usual = f"0123456789eE+-\r\n{separator}{decimal}".encode()
    if file.read(len(codecs.BOM_UTF8)) != codecs.BOM_UTF8:
        file.seek(0)
    body = file.tell() + start
    sum_ = hashlib.sha256(file.read(start))
    rows = between = 0
    is_empty, last = True, b""
    while portion := file.read(PORTION):
        if portion.translate(None, usual):
            return None
        sum_.update(portion)
        rows += portion.count(b"\n")
        between += portion.count(separator.encode())
        is_empty = is_empty and not _SOMETHING.search(portion)
        last = portion
    rows += not last.endswith(b"\n")
    return None if is_empty or between != rows * (columns - 1) else (rows, body, sum_.hexdigest())


def _parse_by_line(path: str | Path, body: str, names: list[str], first_line: int) -> Table:
    rows: list[list[float]] = []
    reader = csv.reader(io.StringIO(body, newline=""))
    try:
        for cells in reader:
            number = first_line + reader.line_num - 1
            if not any(cell.strip() for cell in cells):
                if len(cells) > 1 or (cells and len(names) == 1):
                    rows.append([np.nan] * len(names))
                continue
            if cells[0].startswith("#"):
                raise InputError(
                    f"{path}, line {number}: comments are allowed only above the header; move it there, or split the file here if another begins."
                )
            if len(cells) != len(names):
                raise InputError(f"{path}, line {number}: {numbered(len(cells), 'value')} where the header has {len(names)} columns ({', '.join(names)}); decimal commas must become points.")  # fmt: skip
            if not rows and not any(is_number(cell.strip()) for cell in cells) and any(cells):
                raise InputError(f"{path}, line {number}: a line of units, as it seems: take it out, or let 'hrg import' read the file, which converts by them.")  # fmt: skip
            rows.append([_number(path, number, name, cell) for name, cell in zip(names, cells, strict=True)])
    except csv.Error as error:
        raise InputError(f"{path}, line {first_line + reader.line_num - 1}: {error}.") from None
    table = np.array(rows, dtype=float).reshape(-1, len(names))
    return {name: np.ascontiguousarray(table[:, k]) for k, name in enumerate(names)}


def check_text(path: str | Path, data: bytes) -> bytes:
    """Make sure that a file is UTF-8 text with something in it, and take its byte-order mark off."""
    data = data.removeprefix(codecs.BOM_UTF8)
    if b"\0" in data:
        raise InputError(f"{path}: not a text table (it holds zero bytes); export it as CSV in UTF-8.{IMPORT}")
    if not data.isascii():
        try:
            data.decode()
        except UnicodeDecodeError as error:
            line = data.count(b"\n", 0, error.start) + 1
            raise InputError(f"{path}, line {line}: not UTF-8 text; save the file as UTF-8 (CSV).{IMPORT}") from None
    if not _SOMETHING.search(data):
        raise InputError(f"{path}: the file is empty; it needs a header line and rows of numbers.")
    return data


def _number(path: str | Path, line: int, name: str, cell: str) -> float:
    text = cell.strip()
    if not text:
        return float("nan")
    if not is_number(text):
        raise InputError(f"{path}, line {line}: '{text}' in column '{name}' is not a number; correct it, or leave the cell empty where the value is missing.")  # fmt: skip
    return float(text)


def is_number(text: str) -> bool:
    """Tell whether the text is a finite decimal number (not 'nan', 'inf' or '1_000', which float() would take)."""
    try:
        value = float(text)
    except ValueError:
        return False
    return abs(value) != float("inf") and value == value and "_" not in text
