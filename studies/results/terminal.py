"""Results on a terminal: tables whose numbers are aligned and never broken, facts and sentences between them."""

import sys
import textwrap
from collections.abc import Sequence

from studies.files.given import printable
from studies.results import Facts, Part, Result, Sentence, Table

SHORT_WORD = 10  # characters; longer words, such as file names, may be folded inside
NUMBERS = "-−+.0123456789±—"  # a cell that begins with one of these is a number


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
        case Sentence() if part.where != "page":
            print(printable(part.text))


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[object]], note: str = "") -> None:
    """Print a table with numbers aligned to the right; floats must already be formatted text.

    On a narrow terminal columns of text and headings fold, numbers never: where they alone are too wide, lines run over.
    """
    from rich.cells import cell_len
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(
        title=Text(printable(title)),
        title_justify="left",
        caption=Text(printable(note)) if note else None,
        caption_justify="left",
        header_style="bold",
    )
    console = Console(width=None if sys.stdout.isatty() else 160)
    cells = [["" if cell is None else printable(str(cell)) for cell in row] for row in rows]
    headings, numeric, widths, least = [], [], [], []
    for k, column in enumerate(map(printable, columns)):
        inside = [row[k] for row in cells]
        numeric.append(bool(rows) and all(map(_looks_numeric, inside)))
        if numeric[-1]:
            least.append(max(map(len, (*inside, *column.split(" ")))))
            headings.append("\n".join(textwrap.wrap(column, least[-1], break_long_words=False, break_on_hyphens=False)))
            widths.append(least[-1])
        else:
            words = [word for cell in (*inside, column) for word in cell.split()]
            least.append(max((len(w) for w in words if _looks_numeric(w) or len(w) <= SHORT_WORD), default=1))
            headings.append(column)
            widths.append(max((cell_len(line) for cell in (*inside, column) for line in cell.splitlines()), default=1))
    frame = 3 * len(columns) + 1
    while sum(widths) + frame > console.width and any(w > low for w, low in zip(widths, least, strict=True)):
        widest = max((k for k in range(len(widths)) if widths[k] > least[k]), key=lambda k: widths[k])
        widths[widest] -= 1
    for heading, number, width in zip(headings, numeric, widths, strict=True):
        table.add_column(Text(heading), justify="right" if number else "left", width=width, overflow="fold")
    for row in cells:
        table.add_row(*map(Text, row))
    console.width = max(console.width, sum(widths) + frame)
    console.print(table)


def _looks_numeric(cell: str) -> bool:
    return cell[:1] in NUMBERS if cell else True
