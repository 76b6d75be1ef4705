"""Answers of commands: declared once, shown as text on a terminal, as one JSON object and as a page.

A command returns a `Result`: the object for programs (`payload`), and what people read of it, in reading order: facts, sentences,
tables, figures. A `Table` shows rows of the payload: a `Column` names the key that it shows, its heading, unit and digits, so that a
column is added in one place.
"""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import reduce
from math import isfinite
from typing import Any, Literal

from studies.reports.digits import plain, short_exponent, to_error, to_interval

Key = str | Callable[[Any], Any]
Head = str | Sequence["Column | str"]  # of a table; a text is (a part of) it: see `columns`
Drawing = Any  # a matplotlib figure, by a name that does not load matplotlib
Where = Literal["everywhere", "page", "terminal"]


@dataclass(frozen=True)
class Column:
    """One quantity of a table."""

    key: Key  # of a row: a key, an attribute, several and places in a list ("split.slow_Hz"), or what makes it; absent: an empty cell
    heading: str  # what people read above it, with the unit
    unit: str = ""
    form: str = ""  # such as ".4f" or "+.3g"; without one `digits` significant digits, without exponent where it can be
    digits: int = 4
    error: str = ""  # key of its standard error: the value to the second digit of the error, with ± and the error
    # keys of the ends of its interval, shown as "low … high" instead of the value, to the second digit of `error` or, with digits=0, of
    # the width; `within`: the value itself to the second digit of the width
    interval: tuple[str, str] | None = None
    within: tuple[str, str] | None = None
    scale: float = 1.0  # what the row has times this is shown, for example 1e6 for ppm
    spell: Callable[[str], str] = str  # makes a text a name for people, such as `display_name` for a key of a card
    where: Where = "everywhere"

    @property
    def title(self) -> str:
        """Heading and unit."""
        return f"{self.heading} ({self.unit})" if self.unit else self.heading

    def write(self, row: Any) -> str:
        """Return the cell of a row: here a number becomes text; what is exact has no interval."""
        value, error = find(row, self.key), find(row, self.error) if self.error else None
        ends = [find(row, key) for key in self.interval or self.within or ()]
        if self.interval and ends[0] == ends[1]:
            return ""
        if ends and (self.within or not self.digits):
            numbers = [value if self.within else ends[0], *ends]
            if all(isinstance(one, float | int) for one in numbers):
                shown, low, high = to_interval(*(float(one) * self.scale for one in numbers))
                return shown if self.within else f"{low} … {high}"
        if self.interval:
            low, high = (to_error(x * self.scale, error * self.scale)[0] if error else self._number(x) for x in ends)
            return f"{low} … {high}" if low else ""
        if error and isfinite(error) and isinstance(value, float | int):
            return " ± ".join(to_error(value * self.scale, error * self.scale))
        return self._number(value)

    def _number(self, value: object) -> str:
        if value is None or isinstance(value, str):
            return self.spell(value) if value else ""
        if isinstance(value, list | tuple):
            return ", ".join(map(str, value))
        if not isinstance(value, float | int) or isinstance(value, bool):
            return str(value)
        if isinstance(value, int) and not self.form and self.scale == 1.0:
            return str(value)
        shown = value * self.scale
        text = format(shown, self.form) if self.form and isfinite(shown) else plain(shown, self.digits)
        if not text.strip("-0."):
            text = text.replace("-", "+" if self.form.startswith("+") else "")
        return short_exponent(text)


HEAD = re.compile(
    r"""(?P<key>\S+) (?:\ in\ (?P<from>\S+)\ …\ (?P<to>\S+)|\ …\ (?P<end>\S+))? (?:\ ±\ (?P<error>\S+))?
    :\ (?P<title>.*?) (?:\ ×(?P<scale>\S+))? (?:\ (?P<form>\+?g|\+?\.\d+[aefg]|\.(?P<digits>\d+)))?""",
    re.VERBOSE,
)


def columns(head: str) -> list[Column]:
    """Return the columns of the head of a table, which | parts: "harmonic: n | frequency_Hz: f (Hz) .4f | slope ± slope_sd: slope (ppm/°C)".

    A column says what its cells show, a colon, what stands above them, and if it must be a factor (×1e6) and a format: .4f as in
    Python, .4 for so many significant digits. Besides a key there may be: value ± error; low … high, an interval, with .0 to the second digit
    of its width; and value in low … high, the value alone to the second digit of that. A heading alone, such as At bound,
    is the column of the key that it spells.
    """
    found = []
    for one in head.split(" | "):
        if not (match := HEAD.fullmatch(one)):
            assert one.replace(" ", "").isidentifier(), f"not a column: {one}"
            found.append(Column(one.lower().replace(" ", "_"), one))
            continue
        said = match.groupdict()
        form = "" if said["digits"] else said["form"] or ""
        interval = (said["key"], said["end"]) if said["end"] else None
        within = (said["from"], said["to"]) if said["from"] else None
        digits, scale = int(said["digits"] or 4), float(said["scale"] or 1)
        found.append(Column(said["key"], said["title"], "", form, digits, said["error"] or "", interval, within, scale))
    return found


def find(row: Any, key: Key) -> Any:
    """Return what a row has under a key; None where it has none."""
    value = key(row) if callable(key) else reduce(_step, key.split("."), row)
    return value.item() if hasattr(value, "item") else value


def _step(value: Any, key: str) -> Any:
    if isinstance(value, Mapping):
        return value.get(key)
    return None if value is None else value[int(key)] if key.isdigit() else getattr(value, key)


def rows_of(columns: Mapping[str, Iterable[Any]]) -> list[dict[str, Any]]:
    """Return rows of data that stand as columns, such as {"time_s": array, ...}."""
    plain_columns = [list(values.tolist() if hasattr(values, "tolist") else values) for values in columns.values()]
    return [dict(zip(columns, row, strict=True)) for row in zip(*plain_columns, strict=True)]


def row_of(found: Any, *keys: str, **named: str | tuple[str, float]) -> dict[str, Any]:
    """Return a row of what an object has: attributes by their own names, others under new ones (q="fit.quality", low="interval.0", f_mHz=("f", 1e3)).

    A part that has fields, such as an interval, becomes a row of its own. Of nothing (None) it has every key, and None.
    """
    row = {}
    for name, key in (dict(zip(keys, keys, strict=True)) | named).items():
        path, factor = key if isinstance(key, tuple) else (key, 1.0)
        row[name] = _times(factor, reduce(_step, path.split("."), found))
    return row


def _times(factor: float, value: Any) -> Any:
    if is_dataclass(value):
        return {one.name: _times(factor, getattr(value, one.name)) for one in fields(value)}
    return value if value is None or factor == 1.0 else factor * value


@dataclass(frozen=True)
class Table:
    """Rows, of the payload or of any objects, as people see them; without rows it is not shown, and neither is a column of which no row has anything."""

    title: str
    rows: Sequence[Any]
    columns: Head
    note: str = ""
    where: Where = "everywhere"
    sortable: bool = False

    def cells(self, where: Where = "everywhere") -> tuple[list[str], list[list[str]]]:
        """Return headings and rows of text, in the terminal or on the page."""
        given = [self.columns] if isinstance(self.columns, str) else self.columns
        head = [column for part in given for column in (columns(part) if isinstance(part, str) else [part])]
        seen = [column for column in head if column.where in ("everywhere", where)]
        written = [(column.title, [column.write(row) for row in self.rows]) for column in seen]
        shown = [(title, cells) for title, cells in written if any(cells)]
        return [title for title, _ in shown], [list(row) for row in zip(*(cells for _, cells in shown), strict=True)]


Fact = tuple[str, str, str]
"""Label, value, remark."""


@dataclass(frozen=True)
class Facts:
    """A few numbers that carry the answer."""

    facts: Sequence[Fact]
    where: Where = "everywhere"


@dataclass(frozen=True)
class Sentence:
    """What is said: plain, lead, note, warning, or source for text that keeps its lines."""

    text: str
    kind: str = "plain"
    where: Where = "everywhere"


@dataclass(frozen=True)
class Figure:
    """A picture of the page, drawn only when the page is written; `alt` stands for it where it cannot be seen."""

    draw: Callable[[], Drawing]
    caption: str
    alt: str = ""


@dataclass(frozen=True)
class Blocks:
    """Ready blocks of the page (`studies.results.page`), such as a view of modes to turn; made only when the page is written."""

    make: Callable[[], Sequence[Any]]


Part = Table | Facts | Sentence | Figure | Blocks | str | None
"""What people read; a text is a plain sentence, and what is empty or None is left out."""


@dataclass(frozen=True)
class Chapter:
    """A heading of the page and what stands under it; the terminal shows the parts without it."""

    title: str
    parts: Sequence[Part]


@dataclass(frozen=True)
class Result:
    """What a command answers."""

    payload: dict[str, Any]  # the object for programs, with its `schema`; a key `report` gets the path of the page
    title: str  # of the page: a name, and one sentence of what it shows
    lead: str = ""
    # what people read, in reading order; parts before the first chapter stand under "Results"
    parts: Sequence[Chapter | Part] = ()
    status: int = 0  # the exit status, where it is not 0
    printed: str | None = None  # what the terminal shows instead of the parts, such as code or LaTeX
    sources: Sequence[str] = ()
    page: "Callable[[], Result] | None" = None  # what the page shows instead, made only when it is written

    @property
    def chapters(self) -> list[Chapter]:
        """The parts by chapter."""
        loose = [part for part in self.parts if part and not isinstance(part, Chapter)]
        return [*([Chapter("Results", loose)] if loose else []), *(p for p in self.parts if isinstance(p, Chapter))]
