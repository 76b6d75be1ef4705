"""Tables of numbers under the names of their columns: comma-separated, Parquet or of pandas; `#` begins a comment, empty cells are missing."""

import csv
import io
from collections import Counter
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from studies.errors import InputError, nearest
from studies.files.numbers import IMPORT, check_text, is_number, parse_numbers
from studies.files.parquet import is_parquet, read_comments_and_names, read_table
from studies.files.reading import read_bytes

if TYPE_CHECKING:
    from pandas import DataFrame

LARGEST = 1e20  # no reading of an instrument, time or count is larger; what is larger would overflow in its powers
HEAD = 1 << 20  # bytes in which comments and header are looked for first


@dataclass(frozen=True)
class Columns:
    """The columns of one file under the names of its header, its comments, and the hash of its bytes."""

    path: str
    values: Mapping[str, NDArray[np.float64]]
    sha256: str = ""
    comments: tuple[str, ...] = ()
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
    elif is_parquet(path):
        comments, header = read_comments_and_names(path)
        _check_names(path, header, 0, known, required, prefixes)
        columns = Columns(str(path), *read_table(path), comments, first_line=1)
    else:
        comments, header, header_line, start = _read_head(path)
        names = _check_names(path, header, header_line, known, required, prefixes)
        columns = Columns(str(path), *parse_numbers(path, start, names, header_line + 1), comments, header_line + 1)
    for name, values in columns.values.items():
        large = np.abs(values) > LARGEST
        columns.refuse(large, lambda row: f"{name} = {values[row]:g} is not a possible reading; correct it.")  # noqa: B023
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
    return Columns(path, named, "", tuple(frame.attrs.get("comments", ())), first_line=1)


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
            return _split_head(path, check_text(path, head[: head.rfind(b"\n") + 1]))
        except InputError:
            head = read_bytes(path)
    return _split_head(path, check_text(path, head))


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
    if all(is_number(name) for name in names):
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
