"""Raw tables: text of any separator and encoding, or Excel sheets, as cells of text with the lines that they stand on."""

import codecs
import contextlib
import csv
import gzip
import io
import itertools
import zlib
from collections.abc import Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, cast

import msgspec
import numpy as np

from compensation.arrays import Array
from studies.errors import InputError, nearest, numbered
from studies.files.given import shorten
from studies.files.numbers import parse_portions
from studies.files.reading import ANY_SIZE, PORTION, digest, opened
from studies.importing.mapping import SEPARATORS, FileMap
from studies.importing.notation import pattern_of, read_number
from studies.importing.sheets import EXCEL, read_sheets
from studies.importing.tables import ParsedTable, Part, RawTable
from studies.importing.units import find_spelling

if TYPE_CHECKING:
    import pandas as pd

PACKED = ".gz"
CELLS_AT_ONCE = 400_000  # of text


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
        names = _head(path, _split_head(path, [line.decode() for line in head], file), file)
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
    part = Part(str(path), digest(path, ANY_SIZE), file.data_line)
    if Path(path).suffix.lower() in EXCEL:
        _, sheet = next(read_sheets(path, file.sheet))
        yield from _read_rows(part, sheet, sheet[file.data_line - 1 :], msgspec.structs.replace(file, decimal="."))
        return
    with unpacked(path) as raw:
        text = io.TextIOWrapper(raw, "utf-8-sig" if file.encoding == "utf-8" else file.encoding)
        lines = (check_text(path, line) for line in text)
        try:
            head = list(itertools.islice(lines, file.data_line))
            rows = split_lines(itertools.chain(head[file.data_line - 1 :], lines), file.separator, strict=True)
            yield from _read_rows(part, _split_head(path, head, file), rows, file)
        except UnicodeError:
            raise _wrong_encoding(path, file.encoding) from None
        except csv.Error as error:
            line = file.data_line - 1 + rows.line_num
            raise InputError(f"{path}, line {line}: cannot be split ({error}); correct its quotes, or the separator in the map.") from None  # fmt: skip


def _read_rows(
    part: Part, head: Sequence[Sequence[str]], rows: Iterable[list[str]], file: FileMap
) -> Iterator[tuple[list[str], RawTable]]:
    """Yield the columns' names of a head, and the rows below it a portion at a time; a remark becomes an empty row, without a time."""
    import pandas as pd

    path, names, at = part.path, _head(part.path, head, file), 0
    width, untimed = len(names), file.sample_period is not None
    rows = itertools.islice(rows, None if file.last_line is None else file.last_line - file.data_line + 1)
    while block := list(itertools.islice(rows, max(CELLS_AT_ONCE // width, 1))):
        for k, row in enumerate(block):
            if len(row) == width and row[0][:1] != "#":
                continue
            if row and row[0][:1] == "#" and not untimed and (names[0] in file.sources or not any(row[1:])):
                row = []
            if any(map(str.strip, row[width:])):
                raise InputError(
                    f"{path}, {part.row_name} {file.data_line + at + k}: more values than the {width} columns of the header; check separator,"
                    " header_line and decimal in the map."
                )
            block[k] = (row + [""] * width)[:width]
        if not at and not any(map(any, block)):
            break
        cells = pd.DataFrame(block, columns=names, dtype=str)
        yield names, TextTable(part, file.missing, at, len(block), cells, file)
        at += len(block)
    if not at:
        raise _no_rows(path, file)


@contextlib.contextmanager
def unpacked(path: str | Path) -> Iterator[BinaryIO]:
    """Open a raw file that holds something for reading, through gzip where its name ends so."""
    with opened(path, ANY_SIZE) as raw:
        file = cast(BinaryIO, gzip.GzipFile(fileobj=raw) if Path(path).suffix.lower() == PACKED else raw)
        try:
            if not file.read(PORTION).strip():
                raise InputError(f"{path}: the file is empty.")
            file.seek(0)
            yield file
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


def check_text(path: str | Path, part: str) -> str:
    """Return a part of a text; refuse what is none."""
    if "\0" in part:
        raise InputError(
            f"{path}: not a text table (it holds zero bytes); is it UTF-16, packed (unpack it) or a binary file?"
        )
    return part


def _split_head(path: str | Path, lines: Sequence[str], file: FileMap) -> list[list[str]]:
    """Return the cells of the lines down to the header; of the first line of data where there is none."""
    try:
        return [split_line(line, file.separator) for line in lines[: file.header_line or file.data_line]]
    except csv.Error as error:
        raise InputError(f"{path}, line {file.header_line}: the header cannot be read ({error}).") from None


def split_line(line: str, separator: str) -> list[str]:
    """Return the cells of a line, by the name of a separator."""
    return next(split_lines([line], separator), [])


def split_lines(lines: Iterable[str], separator: str, strict: bool = False) -> Any:
    """Return the reader of the cells in lines; one in quotes may go on in the next line, and ends somewhere if `strict`."""
    single = (" ".join(line.split()) for line in lines) if separator == "space" else lines
    return csv.reader(single, delimiter=SEPARATORS[separator], strict=strict)


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
        names.append(f"{wanted} #{place}" if wanted in names else wanted)
    return names
