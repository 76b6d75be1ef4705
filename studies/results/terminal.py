"""Results on a terminal: tables whose numbers are aligned and never broken, facts and sentences between them."""

import os
import shutil
import sys
import textwrap
from collections.abc import Iterator, Sequence
from itertools import repeat, zip_longest
from unicodedata import combining, east_asian_width

from studies.files.given import printable
from studies.results import Facts, Part, Result, Sentence, Table

SHORT_WORD = 10  # characters; longer words, such as file names, may be folded inside
NUMBERS = "-−+.0123456789±—"  # a cell that begins with one of these is a number
PAPER = 160  # columns where the output is no terminal
NARROW = 60  # columns that a note takes below a narrower table
FRAME = ("┏━┳┓", "┃", "┡━╇┩", "│", "└─┴┘")  # above, beside and below the headings, beside and below the rows
PLAIN = ("+-++", "|", "+=++", "|", "+-++")


def print_result(result: Result) -> None:
    """Print what people read of a result."""
    if result.printed is not None:
        sys.stdout.write(result.printed)
        return
    for chapter in result.chapters:
        for part in chapter.parts:
            _print(part)


def _print(part: Part) -> None:
    match part:
        case Table() if part.rows and part.where != "page":
            headings, rows = part.cells("terminal")
            print_table(part.title, headings, rows, part.note)
        case Facts() if part.where != "page":
            for label, value, remark in part.facts:
                print(printable(f"{label}: {value}" + (f" ({remark})" if remark else "")))
        case str() if part:
            print(printable(part))
        case Sentence() if part.where != "page":
            print(printable(part.text).replace("`", '"'))  # words to copy


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[object]], note: str = "") -> None:
    """Print a table, numbers (as text) aligned to the right; a narrow terminal folds headings and columns of text, never numbers."""
    room = shutil.get_terminal_size().columns if sys.stdout.isatty() else PAPER
    cells = [["" if cell is None else printable(str(cell)) for cell in row] for row in rows]
    headings = [printable(column) for column in columns]
    numeric, shortest, widths = [], [], []
    for heading, inside in zip(headings, zip(*cells, strict=True) if cells else repeat(()), strict=False):
        numeric.append(bool(inside) and all(map(_looks_numeric, inside)))
        words = [*inside, *heading.split()] if numeric[-1] else " ".join((*inside, heading)).split()
        whole = [word for word in words if numeric[-1] or len(word) <= SHORT_WORD or _looks_numeric(word)]
        lines = "\n".join((*inside, heading)).splitlines()
        shortest.append(max(map(_width, whole), default=1))
        widths.append(shortest[-1] if numeric[-1] else max(map(_width, lines), default=1))
    while sum(widths) + 3 * len(widths) + 1 > room and widths != shortest:
        widest = max((k for k in range(len(widths)) if widths[k] > shortest[k]), key=lambda k: widths[k])
        widths[widest] -= 1
    frame = FRAME if (sys.stdout.encoding or "").lower().startswith("utf") else PLAIN
    bold = "\x1b[1m{}\x1b[0m" if sys.stdout.isatty() and "NO_COLOR" not in os.environ else "{}"
    top = [_fold(heading, width) for heading, width in zip(headings, widths, strict=True)]
    top = [[""] * (max(map(len, top)) - len(cell)) + cell for cell in top]
    below = [[_fold(cell, width) for cell, width in zip(row, widths, strict=True)] for row in cells]
    lines = [*_fold(printable(title), room), _rule(frame[0], widths)]
    lines += [*_row(top, widths, numeric, frame[1], bold), _rule(frame[2], widths)]
    lines += [line for row in below for line in _row(row, widths, numeric, frame[3])]
    lines.append(_rule(frame[4], widths))
    wide = max(_width(lines[-1]), min(room, NARROW))
    print("\n".join([*lines, *(_fold(printable(note), wide) if note else ())]))


def _rule(corners: str, widths: Sequence[int]) -> str:
    return corners[0] + corners[2].join(corners[1] * (width + 2) for width in widths) + corners[3]


def _row(
    cells: Sequence[Sequence[str]], widths: Sequence[int], numeric: Sequence[bool], bar: str, style: str = "{}"
) -> Iterator[str]:
    for parts in zip_longest(*cells, fillvalue=""):
        padded = []
        for part, width, number in zip(parts, widths, numeric, strict=True):
            space = " " * (width - _width(part))
            padded.append(f" {space}{style.format(part)} " if number else f" {style.format(part)}{space} ")
        yield bar + bar.join(padded) + bar


def _fold(text: str, width: int) -> list[str]:
    """Return text in lines of at most `width` columns; only a word that is longer is broken."""
    lines: list[str] = []
    for line in text.splitlines() or [""]:
        lines += [line] if _width(line) <= width else textwrap.wrap(line, width, break_on_hyphens=False)
    return lines


def _width(text: str) -> int:
    """Return the columns that text takes: two for East Asian wide characters, none for combining marks."""
    if text.isascii():
        return len(text)
    return sum(0 if combining(one) else 2 if east_asian_width(one) in "WF" else 1 for one in text)


def _looks_numeric(cell: str) -> bool:
    return cell[:1] in NUMBERS if cell else True
