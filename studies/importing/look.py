"""A first look at a raw file: its encoding, separator, decimal sign, and where the table begins; or the channels of a group."""

import codecs
import contextlib
import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import cast

from studies.errors import InputError
from studies.importing.channels import Group, is_container, open_channels, sort_groups
from studies.importing.heading import spell
from studies.importing.meaning import looks_likely
from studies.importing.notation import Notation, find_notation, is_number, unit_of
from studies.importing.raw import check_text, name_columns, split_line, unpacked
from studies.importing.sheets import EXCEL, read_sheets
from studies.importing.units import is_unit, units_of
from studies.importing.words import ENGLISH

SEEN = 2000  # lines that are looked at
HEAD = 1 << 24  # bytes
FOOT = 50  # last lines
HEADING = 20_000  # characters in which words are looked for that tell the code page
PAGES = ("cp1252", "cp1251", "gb18030", "cp932", "cp1250", "cp850")
WORDS = (*(pattern for _, pattern in ENGLISH), "[°µ℃]")
STAMP = re.compile(
    r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}|\d+:\d{2}|\d+([. ]|d | days?, )\d{1,2}:\d{2}:|\d{4}年|\d{1,2}时|\d{1,2}h\d{1,2}(m|$)|\d{1,2}[- .]+[a-z]{3}[- .]+\d{2,4}\b|\d{8}T\d{4}"
    r"|(19|20)\d\d(0[1-9]|1[0-2])(0[1-9]|[12]\d|3[01])([01]\d|2[0-3])([0-5]\d){2}(\.\d+)?$",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Look:
    """What a first look at one raw file finds; `header` is None where no line names the columns, encoding and separator are those of a text."""

    encoding: str
    separator: str
    rows: list[list[str]]
    header: int | None
    data: int
    notation: Notation = field(default_factory=Notation)
    group: Group | None = None
    last: int | None = None  # line of the data, where others stand below it
    sheet: str = ""
    others: tuple[str, ...] = ()  # further sheets

    @cached_property
    def names(self) -> list[str]:
        """The columns' names, their places where a name is missing; a repeated one gets its place."""
        return name_columns([""] * len(self.rows[self.data]) if self.header is None else self.rows[self.header])

    @property
    def body(self) -> list[list[str]]:
        """The rows of the table that hold something, but a remark alone."""
        return [row for row in self.rows[self.data :] if any(map(str.strip, row)) and not _is_remark(row)]

    @property
    def above(self) -> list[str]:
        """The lines above the table."""
        return [" ".join(row) for row in self.rows[: self.data if self.header is None else self.header]]

    @property
    def remarks(self) -> list[str]:
        """Words that stand alone on a row of the table."""
        return [row[0].strip() for row in self.rows[self.data :] if _is_remark(row) and row[0].strip()[:1] != "#"]

    @cached_property
    def columns(self) -> dict[str, list[str]]:
        """The cells of every column."""
        body = self.body
        return {name: [row[k].strip() if k < len(row) else "" for row in body] for k, name in enumerate(self.names)}

    @cached_property
    def numbers(self) -> dict[str, list[float]]:
        """The numbers of every column."""
        read = self.notation.number
        return {name: [n for cell in cells if (n := read(cell)) is not None] for name, cells in self.columns.items()}

    @cached_property
    def hints(self) -> dict[str, str]:
        """Name and unit of every column: of the line of units below the names, else what all its numbers have behind them."""
        below = self.header is not None and self.data > self.header + 1
        units = self.rows[self.header + 1] if below and self.header is not None else []
        units = [*units, *[""] * len(self.names)]
        found = {}
        for (name, cells), unit in zip(self.columns.items(), units, strict=False):
            behind = {unit_of(cell) for cell in cells if is_number(cell)}
            stated = unit or (f"[{behind.pop()}]" if len(behind) == 1 and "" not in behind else "")
            found[name] = f"{name} {stated}".strip()
        return found


def look_at(path: str) -> Look:
    """Find encoding, separator, header, first row and notation of a raw file; of a workbook, on the sheet with most numbers."""
    if is_container(path):
        with open_channels(path) as channels:
            return look_at_group(sort_groups(channels)[0])
    if Path(path).suffix.lower() in EXCEL:
        looks = {name: _find_table(rows[:SEEN], rows[-FOOT:], len(rows)) for name, rows in read_sheets(path)}
        if any(looks.values()):
            most = max(looks, key=lambda name: sum(map(len, look.numbers.values())) if (look := looks[name]) else -1)
            return replace(cast(Look, looks[most]), sheet=most, others=tuple(name for name in looks if name != most))
        where, mend = f" on any of its sheets {', '.join(looks)}", 'write the map by hand, with sheet = "…"'
    else:
        with unpacked(path) as raw:
            data = raw.read(HEAD)
        encoding, text = _decode(path, data)
        lines = text.split("\n")
        separator = _find_separator(lines[:SEEN])
        rows, end = ([_split(line, separator) for line in part] for part in (lines[:SEEN], lines[-FOOT:]))
        if found := _find_table(rows, end, len(lines) if len(data) < HEAD else 0):
            hints = found.hints
            notation = find_notation(found.columns, lambda name, numbers: looks_likely(hints[name], numbers))
            return replace(found, encoding=encoding, separator=separator, notation=notation)
        where, mend = "", "write the map by hand"
    raise InputError(f"{path}: no table with rows of two numbers or more was found{where}; {mend}.")


def _find_table(rows: list[list[str]], end: Sequence[Sequence[str]], total: int) -> Look | None:
    """Find the table among the first rows of a file, and where it ends among its last; None where there is none."""
    filled = max((k + 1 for row in rows for k, cell in enumerate(row) if cell.strip()), default=0)
    rows = [row[:filled] for row in rows]  # a spreadsheet writes separators of empty columns behind the last one
    numeric = [sum(map(_is_reading, row)) for row in rows]
    width = max(
        (len(row) for row, count in zip(rows, numeric, strict=True) if 2 * count >= len(row) and count), default=0
    )
    likely = [bool(count and 2 * count >= width) for count in numeric]
    if not any(likely) or width < 2:
        return None
    kinds = [tuple(map(_is_reading, row)) for row in rows]
    usual, _ = Counter(kind for kind, own in zip(kinds, likely, strict=True) if own).most_common(1)[0]
    first = kinds.index(usual)
    while first and likely[first - 1]:
        first -= 1
    named = [k for k in range(first) if sum(bool(cell.strip()) for cell in rows[k]) >= max(1, width - 1)]
    # of two lines with a cell for every column the second one holds the units
    header = named[-2] if len(named) > 1 and _is_unit_line(rows[named[-1]]) else named[-1] if named else None
    last = _last_line(rows[first], end, total)
    return Look("", "", rows[:last], header, first, last=last)


def _is_remark(row: Sequence[str]) -> bool:
    """Tell whether a row holds words in its first cell alone, or behind a #."""
    first, *others = [cell.strip() for cell in row] or [""]
    filled = list(filter(None, others))
    words = not filled or (first[:1] == "#" and not all(map(_is_reading, filled)))
    return first != "" and words and not _is_reading(first)


def _last_line(first: Sequence[str], end: Sequence[Sequence[str]], total: int) -> int | None:
    """Return the line after which a file has words where its first row has a reading; None where it ends with readings."""
    place = next(k for k, cell in enumerate(first) if _is_reading(cell))
    below = [row[place].strip() if place < len(row) else "" for row in end]
    kept = max((k + 1 for k, cell in enumerate(below) if _is_reading(cell)), default=0)
    return total - len(end) + kept if total and kept and any(below[kept:]) else None


def look_at_group(group: Group) -> Look:
    """Look at the first values of the channels of a group as at a table of text."""
    columns = [channel.read(0, min(SEEN, channel.rows)).tolist() for channel in group.channels.values()]
    rows = [["" if x != x else repr(x) for x in row] for row in zip(*columns, strict=True)]
    units = [f"[{channel.unit}]" if channel.unit else "" for channel in group.channels.values()]
    return Look("", "", [list(group.channels), units, *rows], 0, 2, group=group)


def _is_unit_line(row: Sequence[str]) -> bool:
    """Tell whether the cells look like units: short, or in brackets."""
    cells = [cell.strip() for cell in row if cell.strip()]
    return bool(cells) and all(re.fullmatch(r"[\[(].*[\])]|-|1", cell) or is_unit(cell) for cell in cells)


def _decode(path: str, data: bytes) -> tuple[str, str]:
    """Return the code page of a text, of those that can be the one by which its head has most words that are known, and the text in whole lines."""

    def read(page: str) -> str:
        decoder = codecs.getincrementaldecoder("utf-8-sig" if page == "utf-8" else page)()
        return decoder.decode(data, final=len(data) < HEAD)

    known: dict[str, int] = {}
    for page in ("utf-16",) if data[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) else ("utf-8", *PAGES):
        with contextlib.suppress(UnicodeError):
            words = (one[0] for pattern in WORDS for one in re.finditer(pattern, read(page)[:HEADING].lower()))
            known[page] = sum(not word.isascii() for word in words)
            if page.startswith("utf"):
                break
    best = max(known, key=lambda page: known[page], default="latin-1")
    best = best if known.get(best) or best in ("utf-8", "utf-16", "cp1252") else "latin-1"
    text = check_text(path, read(best)).replace("\r\n", "\n").replace("\r", "\n")
    return best, text if len(data) < HEAD else text[: text.rfind("\n") + 1]


def _find_separator(lines: Sequence[str]) -> str:
    """Return the separator that splits most lines into the same number of cells."""
    filled = [line for line in lines if line.strip()]
    best, score = ",", (0.0, 0)
    for name in (";", "tab", "|", ",", "space"):
        widths = [len(_split(line, name)) for line in filled]
        usual = max(set(widths), key=widths.count) if widths else 1
        if usual > 1 and (found := (round(widths.count(usual) / len(widths), 1), name in (";", "tab", "|"))) > score:
            best, score = name, found
    return best


def _split(line: str, separator: str) -> list[str]:
    try:
        return split_line(line, separator)
    except csv.Error:
        return [line]


def _is_reading(cell: str) -> bool:
    return is_number(cell) or is_stamp(cell)


def is_stamp(cell: str) -> bool:
    """Tell whether a cell looks like a date or a time of day."""
    return STAMP.match(cell.strip()) is not None


STATED = r"[^\d\n]{0,30}(\d[\d.,]*(?:e[+-]?\d+)?\s*[a-zµ]+)\b(?!\s*\^?-1)"
NOMINAL = re.compile(rf"(?:nominal|nenn|\bf_?0\b|reference|cent(?:re|er)){STATED}", re.IGNORECASE)
PERIOD = re.compile(rf"(?:sampl\w*|abtast\w*|log\w*|interval\w*|period\w*|\bdt\b){STATED}", re.IGNORECASE)
RATE = re.compile(rf"(?:sampl\w*|abtast\w*|log\w*|rate){STATED}", re.IGNORECASE)


def find_nominal(lines: Sequence[str]) -> float | None:
    """Return the nominal frequency (Hz) that a line states, such as "f nominal = 4546 Hz"; None where none does."""
    return _first(NOMINAL, "frequency_Hz", lines)


def find_period(lines: Sequence[str]) -> float | None:
    """Return the seconds between rows that a line states, such as "sample period 10 s" or "sampling rate: 50 Hz"."""
    rate = _first(RATE, "frequency_Hz", lines)
    return _first(PERIOD, "time_s", lines) or (1 / rate if rate else None)


def _first(pattern: re.Pattern[str], target: str, lines: Sequence[str]) -> float | None:
    for found in (found for line in lines for found in pattern.finditer(line)):
        unit, factor = spell(target, found[1]) or (None, 1.0)
        if unit is not None:
            return float(units_of(target)[unit].convert(factor))
    return None
