"""Comma-separated tables of numbers, read fast and refused with the line that is wrong; `#` begins a comment, empty cells are missing."""

import codecs
import csv
import hashlib
import io
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from studies.errors import InputError, nearest
from studies.files.parquet import is_parquet, read_comments_and_names, read_table
from studies.files.reading import MOST_BYTES, PORTION, opened, read_bytes
from studies.progress import tell

if TYPE_CHECKING:
    from pandas import DataFrame

Table: TypeAlias = dict[str, NDArray[np.float64]]

LARGEST = 1e20  # no reading of an instrument, time or count is larger; what is larger would overflow in its powers
_SOMETHING = re.compile(rb"\S")
IMPORT = " 'hrg import' brings laboratory files with other names, units and notations into this form."
HEAD = 1 << 20  # bytes in which comments and header are looked for first
FEW = 400_000  # numbers that are read before pandas, which reads faster, is loaded
ROWS_AT_ONCE = 200_000  # rows that are parsed at once, so that a large table costs its numbers and little more


@dataclass(frozen=True)
class Columns:
    """The columns of one file under the names of its header, its comments, and the hash of its bytes."""

    path: str
    values: Mapping[str, NDArray[np.float64]]
    comments: tuple[str, ...] = ()
    sha256: str = ""
    first_line: int = field(default=2, repr=False)

    def line(self, row: int) -> int:
        """Return the line of the file on which a row (from 0) stands, when no empty line comes before it."""
        return self.first_line + row

    def place(self, row: int) -> str:
        """Return file and line of a row, for a message."""
        return f"{self.path}, line {self.line(row)}"

    def refuse(self, wrong: NDArray[np.bool_], words: str | Callable[[int], str]) -> None:
        """Refuse the first row that is wrong, by its line, and say why."""
        if wrong.any():
            row = int(wrong.argmax())
            raise InputError(f"{self.place(row)}: {words if isinstance(words, str) else words(row)}")

    def require(self, names: Collection[str], what: str) -> None:
        """Refuse an empty cell in columns of which every value is needed."""
        for name in names:
            self.refuse(self.values[name] != self.values[name], f"{name} is empty; {what} needs every value.")

    def check_order(self, name: str, words: str | Callable[[int], str]) -> None:
        """Refuse a column that does not increase from row to row."""
        values = self.values[name]
        wrong = values != values
        wrong[1:] |= ~(values[1:] > values[:-1])
        self.refuse(wrong, words)


def read_columns(
    path: "str | Path | DataFrame",
    known: Collection[str],
    required: Collection[str] = (),
    prefixes: Collection[str] = (),
) -> Columns:
    """Read a table of numbers whose columns are `known` or begin with one of the prefixes, and have the required ones."""
    if not isinstance(path, str | Path):
        columns = _take_frame(path)
        _check_names(columns.path, list(columns.values), 0, known, required, prefixes)
        _check_size(columns)
        return columns
    if is_parquet(path):
        comments, header = read_comments_and_names(path)
        _check_names(path, header, 0, known, required, prefixes)
        values, sha256 = read_table(path)
        columns = Columns(str(path), values, comments, sha256, first_line=1)
        _check_size(columns)
        return columns
    comments, header, header_line, start = _read_head(path)
    names = _check_names(path, header, header_line, known, required, prefixes)
    values, sha256 = parse_fast(path, start, names) or _parse_with_care(path, start, names, header_line + 1)
    columns = Columns(str(path), values, comments, sha256, header_line + 1)
    _check_size(columns)
    return columns


def _names_of(frame: "DataFrame") -> list[str]:
    """Return the column names of a table of pandas; refuse what is none."""
    if not hasattr(frame, "to_numpy") or not hasattr(frame, "attrs"):
        raise InputError(f"{frame!r:.60}: give a path, a record or a table of pandas, not {type(frame).__name__}.")
    return [str(name) for name in frame.columns]


def _take_frame(frame: "DataFrame") -> Columns:
    """Return the columns of a table of pandas, with the comment lines in its `attrs`."""
    names = _names_of(frame)
    path = str(frame.attrs.get("path") or "table")
    try:
        numbers = frame.to_numpy(float, na_value=float("nan")).T
    except (TypeError, ValueError) as error:
        raise InputError(f"{path}: the table has cells that are no numbers ({error}).") from None
    named = dict(zip(names, numbers, strict=True))
    return Columns(path, named, tuple(frame.attrs.get("comments", ())), first_line=1)


def read_header(path: "str | Path | DataFrame") -> list[str]:
    """Return the column names of a table without reading its numbers."""
    if not isinstance(path, str | Path):
        return _names_of(path)
    if is_parquet(path):
        return read_comments_and_names(path)[1]
    _, header, _, _ = _read_head(path)
    return [name.strip() for name in header]


def _read_head(path: str | Path) -> tuple[tuple[str, ...], list[str], int, int]:
    head = read_bytes(path, first=HEAD)
    if len(head) == HEAD:  # whole lines only
        try:
            return _split_head(path, _check_text(path, head[: head.rfind(b"\n") + 1]))
        except InputError:
            head = read_bytes(path)
    return _split_head(path, _check_text(path, head))


def _check_text(path: str | Path, data: bytes) -> bytes:
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


def _split_head(path: str | Path, data: bytes) -> tuple[tuple[str, ...], list[str], int, int]:
    """Return the comments, the header's cells, the header's line number, and where the body starts."""
    comments: list[str] = []
    position = 0
    for number, raw in enumerate(io.BytesIO(data), start=1):
        position += len(raw)
        line = raw.decode().strip("\r\n")
        if line.startswith("#"):
            comments.append(line[1:].strip())
        elif line.strip():
            return tuple(comments), _split_header(path, line, number), number, position
    raise InputError(f"{path}: there are only comments; a header line and rows of numbers are missing.")


def _split_header(path: str | Path, line: str, number: int) -> list[str]:
    if "\r" in line:
        raise InputError(f"{path}, line {number}: a bare carriage return; save the file with line feeds.")
    try:
        return next(csv.reader([line]))
    except csv.Error as error:
        raise InputError(f"{path}, line {number}: the header cannot be read ({error}).") from None


def _check_names(
    path: str | Path, header: list[str], header_line: int, known: Collection[str], required: Collection[str],
    prefixes: Collection[str],
) -> list[str]:  # fmt: skip
    names = [name.strip() for name in header]
    where = f"{path}, line {header_line}" if header_line else str(path)
    if len(names) == 1 and (";" in names[0] or "\t" in names[0]):
        raise InputError(f"{where}: the columns are not separated by commas: write commas and decimal points; 'hrg import' does so for a record or a table of settled readings.")  # fmt: skip
    if names[0].startswith(("schema =", "schema=")):
        raise InputError(f"{path}: a TOML file, not a table (CSV); exchange it for the file with the readings.")
    if all(_is_number(name) for name in names):
        raise InputError(f"{where}: a header line with the column names is missing; add {','.join(required)}.")
    counts = Counter(names)
    for name in names:
        if counts[name] > 1:
            raise InputError(f"{where}: the column '{name}' appears twice; remove one.")
        if name == "time_s" and name not in known:
            raise InputError(
                f"{where}: this is a record (it has time_s), but a table of settled points is needed ({', '.join(required)}); 'hrg fit frequency' makes one from a record."
            )
        if name not in known and not any(name.startswith(prefix) for prefix in prefixes):
            raise InputError(f"{where}: unknown column '{name}'{nearest(name, known)}{IMPORT}")
    for name in required:
        if name not in counts:
            raise InputError(f"{where}: the column '{name}' is missing; the header has {', '.join(names)}.{IMPORT}")
    return names


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
            cells = b",".join(file.read().split()).split(b",")
            yield rows, sha256, np.reshape([float(cell or b"nan") for cell in cells], (rows, -1)).T
            return
        import pandas as pd

        done = 0
        with pd.read_csv(
            file,
            sep=separator,
            decimal=decimal,
            names=list(names),
            header=None,
            dtype="float64",
            keep_default_na=False,
            na_values=[""],
            skip_blank_lines=False,
            index_col=False,
            chunksize=ROWS_AT_ONCE,
        ) as parts:
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


def _parse_with_care(path: str | Path, start: int, names: list[str], first_line: int) -> tuple[Table, str]:
    data = _check_text(path, read_bytes(path))
    if not _SOMETHING.search(data, start):
        raise InputError(f"{path}: the table has a header but no rows; add one line per measurement.")
    return _parse_by_line(path, data[start:].decode(), names, first_line), hashlib.sha256(data).hexdigest()


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
                raise InputError(f"{path}, line {number}: {len(cells)} values where the header has {len(names)} columns ({', '.join(names)}); decimal commas must become points.")  # fmt: skip
            rows.append([_number(path, number, name, cell) for name, cell in zip(names, cells, strict=True)])
    except csv.Error as error:
        raise InputError(f"{path}, line {first_line + reader.line_num - 1}: {error}.") from None
    table = np.array(rows, dtype=float).reshape(-1, len(names))
    return {name: np.ascontiguousarray(table[:, k]) for k, name in enumerate(names)}


def _check_size(columns: Columns) -> None:
    for name, values in columns.values.items():
        large = np.abs(values) > LARGEST
        columns.refuse(large, lambda row: f"{name} = {values[row]:g} is not a possible reading; correct it.")  # noqa: B023


def _number(path: str | Path, line: int, name: str, cell: str) -> float:
    text = cell.strip()
    if not text:
        return float("nan")
    if not _is_number(text):
        raise InputError(f"{path}, line {line}: '{text}' in column '{name}' is not a number; correct it, or leave the cell empty where the value is missing.")  # fmt: skip
    return float(text)


def _is_number(text: str) -> bool:
    """Tell whether the text is a finite decimal number (not 'nan', 'inf' or '1_000', which float() would take)."""
    try:
        value = float(text)
    except ValueError:
        return False
    return abs(value) != float("inf") and value == value and "_" not in text
