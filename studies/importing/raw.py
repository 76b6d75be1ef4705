"""Raw tables: text of any separator and encoding, or Excel sheets, as cells of text with the lines that they stand on."""

import codecs
import contextlib
import csv
import gzip
import io
import itertools
import re
import warnings
import zlib
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, cast

import msgspec
import numpy as np

from compensation.arrays import Array
from studies.errors import InputError, nearest, numbered
from studies.files.given import shorten
from studies.files.numbers import ROWS_AT_ONCE, parse_portions
from studies.files.reading import ANY_SIZE, PORTION, digest, opened
from studies.importing.mapping import SEPARATORS, FileMap
from studies.importing.notation import pattern_of, read_number
from studies.importing.sheets import EXCEL, read_sheets
from studies.importing.tables import ParsedTable, Part, RawTable
from studies.importing.units import find_spelling

if TYPE_CHECKING:
    import pandas as pd

OVERFLOW = "(beyond the header)"
PACKED = ".gz"


class NotPlain(Exception):
    """A text that holds more than plain numbers: its cells must be looked at as text."""


@dataclass(frozen=True)
class TextTable(RawTable):
    """Rows of a table whose cells are all text."""

    cells: "pd.DataFrame"
    file: FileMap

    def joined(self, columns: Sequence[str]) -> "pd.Series[str]":
        """Return several columns joined by a blank, such as a date and a time of day; nothing where one is marked as missing."""
        parts = [self.text(column) for column in columns]
        text = parts[0]
        for part in parts[1:]:
            text = text + " " + part
        marked = np.any([part.isin(self.missing) for part in parts], axis=0)
        text = text.str.strip()
        return text.mask(marked | text.isin(self.missing), "")

    def text(self, column: str) -> "pd.Series[str]":
        """Return the cells of one column without the blanks around them."""
        return self.cells[column].str.strip()

    def read(self, column: str) -> Array:
        """Return a column as numbers, NaN where a cell is empty; anything else is an error that names the line."""
        import pandas as pd

        text, decimal, thousands = self.text(column), self.file.decimal, self.file.thousands
        empty = np.asarray(text.isin(["", *self.missing]))
        plain = text
        if decimal == "," or thousands:  # a point may part thousands
            plain = plain.where(plain.str.fullmatch(pattern_of(decimal, thousands)))
            plain = plain.str.replace(thousands, "", regex=False) if thousands else plain
            plain = plain.str.replace(decimal, ".", regex=False)
        values = pd.to_numeric(plain.mask(empty, "nan"), errors="coerce").to_numpy(dtype=float, copy=True)
        careful = np.flatnonzero(np.isnan(values) & ~empty).tolist()
        for row, cell in zip(careful, text.to_numpy()[careful], strict=True):
            found = read_number(cell, decimal, thousands)
            if found is None or not self._is_stated(column, found[1]):
                raise InputError(
                    f"{self.place(row)}: '{shorten(cell)}' in column '{column}' is not a"
                    f" number in the unit of the map (decimal = '{decimal}', thousands = '{thousands}'); where it marks a missing value, add it to 'missing' in the map; lines below the table are left out with last_line."
                )
            values[row] = found[0]
        return values

    def _is_stated(self, column: str, unit: str) -> bool:
        """Tell whether what stands behind a number is the unit that the map states."""
        if not unit or (column in self.file.time and find_spelling("time_s", unit) == self.file.time_format):
            return True
        units = [(one.target, one.unit) for one in self.file.columns if one.source == column]
        return bool(units) and all(find_spelling(target, unit) == stated for target, stated in units)


def read_text(paths: Sequence[str | Path], file: FileMap, plain: bool = True) -> Generator[RawTable]:
    """Yield the rows of text files that continue one another, a portion at a time; NotPlain where numbers alone do not tell them."""
    names: list[str] = []
    for path in paths:
        for own, table in read_plain(path, file) if plain else read_raw(path, file):
            if names and own != names:
                raise InputError(f"{path}: has other columns than {paths[0]}; give it its own [[file]] table.")
            for name in file.sources if not names else ():
                if name not in own:
                    raise InputError(f"{path}: there is no column '{name}'{nearest(name, own)}")
            names = own
            yield table


def read_plain(path: str | Path, file: FileMap) -> Iterator[tuple[list[str], RawTable]]:
    """Yield the columns' names and the next rows of a text of plain numbers; NotPlain where cells must be looked at as text."""
    simple = file.encoding == "utf-8" and file.separator != "space" and file.last_line is None and not file.thousands
    if not simple or Path(path).suffix.lower() in (*EXCEL, PACKED) or (file.time and file.count is None):
        raise NotPlain
    with opened(path, ANY_SIZE) as raw:
        head = list(itertools.islice(raw, file.data_line))
    if b"".join(head).startswith(codecs.BOM_UTF8):
        raise NotPlain
    try:
        names = _head(path, _split_lines(path, b"".join(head).decode(), file), file)
        begin, done, part = sum(map(len, head[: file.data_line - 1])), 0, None
        for _, sha256, table in parse_portions(path, begin, names, SEPARATORS[file.separator], file.decimal, ANY_SIZE):
            part = part or Part(str(path), sha256, file.data_line)
            columns = dict(zip(names, table, strict=True))
            yield names, ParsedTable(part, file.missing, done, table.shape[1], columns)
            done += table.shape[1]
    except (ValueError, InputError):
        raise NotPlain from None


def read_raw(path: str | Path, file: FileMap) -> Iterator[tuple[list[str], RawTable]]:
    """Yield the columns' names and the next rows of one raw file, as its map describes it, with cells of text."""
    import pandas as pd

    part = Part(str(path), digest(path, ANY_SIZE), file.data_line)
    if Path(path).suffix.lower() in EXCEL:
        _, lines = next(read_sheets(path, file.sheet))
        names, rows = _head(path, lines, file), lines[file.data_line - 1 : file.last_line]
        if not rows:
            raise _no_rows(path, file)
        width = len(names) + 1
        if any(any(row[width - 1 :]) for row in rows):
            raise InputError(f"{path}: some rows of the sheet are longer than its header (line {file.header_line}).")
        filled = [(row + [""] * width)[:width] for row in rows]
        cells = pd.DataFrame(filled, columns=[*names, OVERFLOW], dtype=str)
        yield names, TextTable(part, file.missing, 0, len(cells), cells, msgspec.structs.replace(file, decimal="."))
        return
    with unpacked(path) as raw:
        if not raw.read(PORTION).strip():
            raise InputError(f"{path}: the file is empty.")
        raw.seek(0)
        text = io.TextIOWrapper(raw, "utf-8-sig" if file.encoding == "utf-8" else file.encoding)
        try:
            body = _Body(path, text, list(itertools.islice(text, file.data_line)), file)
            lines = _split_lines(path, body.head, file)
            names = _head(path, lines, file)
            # a spreadsheet writes separators of empty columns behind the last one
            if file.header_line and file.separator != "space" and not lines[-1][-1].strip():
                body.padding = re.compile(f"{re.escape(SEPARATORS[file.separator])}+$", re.MULTILINE)
            for cells in _parse_text(path, body, file, names):
                yield names, TextTable(part, file.missing, int(cells.index[0]), len(cells), cells, file)
        except UnicodeError:
            raise _wrong_encoding(path, file.encoding) from None


@contextlib.contextmanager
def unpacked(path: str | Path) -> Iterator[BinaryIO]:
    """Open a raw file for reading, through gzip where its name ends so."""
    with opened(path, ANY_SIZE) as raw:
        if Path(path).suffix.lower() != PACKED:
            yield raw
            return
        try:
            yield cast(BinaryIO, gzip.GzipFile(fileobj=raw))
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            raise InputError(f"{path}: cannot be unpacked by gzip ({shorten(str(error))}); pack it again.") from None


def _no_rows(path: str | Path, file: FileMap) -> InputError:
    return InputError(f"{path}: there are no rows from line {file.data_line} on (data_line in the map).")


def _wrong_encoding(path: str | Path, encoding: str) -> InputError:
    """Return what is wrong with a text that is not of this encoding, with the line where lines can be told."""
    if encoding == "utf-8":
        with unpacked(path) as raw:
            for number, line in enumerate(raw, 1):
                try:
                    line.decode()
                except UnicodeDecodeError:
                    path = f"{path}, line {number}"
                    break
    return InputError(f"{path}: not {encoding} text; set 'encoding' in the map (cp1252 is common).")


def _checked(path: str | Path, part: str) -> str:
    if "\0" in part:
        raise InputError(
            f"{path}: not a text table (it holds zero bytes); is it UTF-16, packed (unpack it) or a binary file?"
        )
    return part


def read_filled(path: str | Path, most: int) -> bytes:
    """Read a file that must exist and hold something, or its first lines."""
    with unpacked(path) as raw:
        data = raw.read(most)
    if not data.strip():
        raise InputError(f"{path}: the file is empty.")
    return data if len(data) < most else data[: data.rfind(b"\n") + 1]


def decode(path: str | Path, data: bytes, encoding: str) -> str:
    """Return the text of a file; a byte that the encoding does not know is an error that names its line."""
    try:
        text = data.decode("utf-8-sig" if encoding == "utf-8" else encoding)
    except UnicodeError:
        raise _wrong_encoding(path, encoding) from None
    return _checked(path, text).replace("\r\n", "\n").replace("\r", "\n")


def _split_lines(path: str | Path, text: str, file: FileMap) -> list[list[str]]:
    """Return the cells of the lines down to the header; of the first line of data where there is none."""
    count = file.header_line or file.data_line
    try:
        return [split_line(line, file.separator) for line in text.split("\n", count)[:count]]
    except csv.Error as error:
        raise InputError(f"{path}, line {file.header_line}: the header cannot be read ({error}).") from None


def split_line(line: str, separator: str) -> list[str]:
    """Return the cells of a line, by the name of a separator."""
    return line.split() if separator == "space" else next(csv.reader([line], delimiter=SEPARATORS[separator]), [])


def _head(path: str | Path, lines: Sequence[Sequence[str]], file: FileMap) -> list[str]:
    if len(lines) < file.header_line:
        raise InputError(
            f"{path}: has {numbered(len(lines), 'line')}, but header_line is {file.header_line} in the map."
        )
    if file.header_line == 0:
        width = len(lines[file.data_line - 1]) if len(lines) >= file.data_line else 0
        if not width:
            raise _no_rows(path, file)
        return [f"column {place}" for place in range(1, width + 1)]
    cells = list(lines[file.header_line - 1])
    while cells and not cells[-1].strip():
        cells.pop()
    if not cells:
        raise InputError(f"{path}, line {file.header_line}: the header line is empty; set header_line in the map.")
    return name_columns(cells)


def name_columns(cells: Sequence[str]) -> list[str]:
    """Return the names of columns from the cells of a header; a repeated name gets its number, a nameless column its place."""
    names: list[str] = []
    for place, cell in enumerate(cells, 1):
        wanted = " ".join(cell.split()) or f"column {place}"
        names.append(f"{wanted} #{place}" if wanted in [*names, OVERFLOW] else wanted)
    return names


class _Body:
    """The rows of a text as a file that gives some whole lines at a time."""

    padding: re.Pattern[str] | None = None

    def __init__(self, path: str | Path, text: io.TextIOWrapper, head: list[str], file: FileMap) -> None:
        self.path, self.text = path, text
        self.head, self.first = _checked(path, "".join(head)), "".join(head[file.data_line - 1 :])

    def __iter__(self) -> Iterator[str]:
        return iter(self.read, "")

    def read(self, _: int = -1) -> str:
        """The next lines, as many as there are at hand."""
        part, self.first = self.first or self.text.read(PORTION), ""
        part += self.text.readline() if part and not part.endswith("\n") else ""
        part = _checked(self.path, part)
        return self.padding.sub("", part) if self.padding else part


def _parse_text(path: str | Path, body: _Body, file: FileMap, names: list[str]) -> "Iterator[pd.DataFrame]":
    """Yield the cells of the next rows."""
    import pandas as pd

    rows = None if file.last_line is None else file.last_line - file.data_line + 1
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)
            with pd.read_csv(
                body,  # type: ignore[call-overload]
                sep=SEPARATORS[file.separator],
                header=None,
                names=[*names, OVERFLOW],
                dtype=str,
                na_filter=False,
                skip_blank_lines=False,
                index_col=False,
                nrows=rows,
                chunksize=ROWS_AT_ONCE,
            ) as parts:
                for cells in parts:
                    cells = cells.fillna("")
                    if not len(cells) or (cells.index[-1] < ROWS_AT_ONCE - 1 and not cells.to_numpy().any()):
                        raise _no_rows(path, file)
                    remark = cells[names[0]].str.startswith("#")
                    if file.sample_period is None and remark.any():  # it becomes a row without a time
                        if names[0] not in file.sources:
                            remark &= (cells.iloc[:, 1:] == "").all(axis=1)
                        cells[remark] = ""
                    longer = cells.index[cells[OVERFLOW].str.strip() != ""]
                    if len(longer):
                        line = file.data_line + int(longer[0])
                        raise InputError(
                            f"{path}, line {line}: more values than the {len(names)} columns of the header; check separator and decimal in the map."
                        )
                    yield cells
    except pd.errors.EmptyDataError:
        raise _no_rows(path, file) from None
    except (pd.errors.ParserError, pd.errors.ParserWarning) as error:
        raise InputError(
            f"{path}: the rows from line {file.data_line} on do not fit the {len(names)} columns of the header"
            f" ({shorten(str(error))}); check separator and decimal in the map."
        ) from None
