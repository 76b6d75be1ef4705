"""Results as a page: text (escaped), tables and figures in one HTML file that works without a network.

Long tables and chapters after the first `OPEN` are folded, on a phone wide tables stacked; paper has `PAPER_ROWS` rows of a table at most.
"""

import base64
import datetime
import platform
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from importlib.resources import files
from io import BytesIO
from typing import Any
from urllib.parse import quote

from markupsafe import Markup, escape

from studies.progress import told
from studies.results import Blocks, Chapter, Drawing, Facts, Figure, Part, Result, Sentence, Table
from studies.results.curves import read_curves

PACKAGES = ("numpy", "scipy", "sympy", "pandas", "pyvista", "trimesh")
OPEN = 5  # chapters; those that follow are folded
LONG_TABLE = 15  # rows; longer tables are folded, except in the first chapter, which is the answer
LONG_ANSWER = 40  # rows of a table in the first chapter
LONG_WORD = 15  # letters
DENSE = 8  # columns; tables of more stand closer
PAPER_ROWS = 40  # of a table; the others are on the screen only
CONTENTS_FROM = 4  # chapters
PHONE = 364.0  # px for a table on a phone
LONG_CELL = 20  # letters to which sentences in a cell are not narrowed


@dataclass(frozen=True)
class Cells:
    """A table of cells that are already text; `columns` carry quantity and unit; `sortable` by a click on a heading."""

    caption: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    sortable: bool = False


@dataclass(frozen=True)
class Picture:
    """An embedded picture with its caption and the words that stand for it where it cannot be seen."""

    data_uri: str
    caption: str
    alt: str
    curves: str = ""  # what it shows as JSON, to be read and enlarged by curves.js


@dataclass(frozen=True)
class Embedded:
    """Trusted HTML made by the workbench itself (never a user's text), such as an interactive view."""

    html: str
    caption: str = ""


Block = Sentence | Cells | Picture | Facts | Embedded
KINDS = {"text": Sentence, "cells": Cells, "picture": Picture, "facts": Facts, "embedded": Embedded}


def render_result(result: Result) -> str:
    """Return the page as HTML text."""
    return render_page(result.title, result.lead, result.chapters, result.sources)


def make_blocks(*parts: Part | Block) -> list[Block]:
    """Return what parts are on a page: tables as text, figures drawn."""
    return [block for part in parts for block in _blocks(part)]


def _blocks(part: Part | Block) -> Iterator[Block]:
    match part:
        case Figure():
            yield draw(part.draw(), part.caption, part.alt or part.caption)
        case Blocks():
            yield from part.make()
        case str() | None:
            if part:
                yield Sentence(part)
        case Table():
            if part.rows and part.where != "terminal":
                yield Cells(part.title, *part.cells("page"), part.note, part.sortable)
        case Sentence() | Facts():
            if part.where != "terminal":
                yield part
        case _:
            yield part


def render_page(title: str, lead: str, chapters: Sequence[Chapter], sources: Sequence[str] = ()) -> str:
    """Return the page as HTML text; chapters without anything to show are left out."""
    script = (files("studies.reports") / "templates" / "curves.js").read_text(encoding="utf-8")
    made = [(chapter.title, make_blocks(*chapter.parts)) for chapter in told(chapters, "chapters")]
    made = [(heading, blocks) for heading, blocks in made if blocks]
    return fill_template(
        "page.html",
        title=title,
        lead=lead,
        chapters=[(heading, blocks, k >= OPEN) for k, (heading, blocks) in enumerate(made)],
        contents=len(made) >= CONTENTS_FROM,
        script=script if any(isinstance(b, Picture) and b.curves for _, blocks in made for b in blocks) else "",
        long_table=LONG_TABLE,
        long_answer=LONG_ANSWER,
        dense=DENSE,
        paper_rows=PAPER_ROWS,
        sources=sources,
        provenance=_provenance(),
    )


def fill_template(name: str, **values: Any) -> str:
    """Return a template of the pages with its values, which are escaped."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters.update(typeset=typeset, prose=_prose, cell=_cell)
    environment.tests.update(kind=lambda block, kind: isinstance(block, KINDS[kind]), stacked=_stacked, worded=_worded)
    text = (files("studies.reports") / "templates" / name).read_text(encoding="utf-8")
    return environment.from_string(text).render(**values)


def typeset(text: str) -> str:
    """Return text with a minus sign before numbers that carry a unit, begin a range or follow a verb, and a space before per cent."""
    unit = r"°|ppm|mHz|Hz|mK|K\b|µ|%|dB|s\b|h\b|standard|to -?\d|…|±"
    text = re.sub(r"(?<=\de)([-−+]?)0+(?=\d)", r"\1", text)
    text = re.sub(rf"(?<![\w.)\]])-(?=\d[\d.]*(?:e[-+]?\d+)? ?(?:{unit}))", "−", text)
    text = re.sub(r"\b(is|then|not) -(?=\.?\d)", r"\1 −", text)
    return re.sub(r"(?<=\d)%", " %", re.sub(r"(?<=\de)-(?=\d)", "−", text))


def _prose(text: str) -> Markup:
    """Return a paragraph, escaped, with words between backticks as code."""
    parts = str(text).split("`")
    if len(parts) % 2 == 0:  # an odd backtick is a character like others
        parts = [str(text)]
    pieces = [f"<code>{escape(part)}</code>" if k % 2 else escape(typeset(part)) for k, part in enumerate(parts)]
    return Markup("".join(pieces))


def _cell(text: str) -> Markup:
    """Return a cell, escaped, with minus signs, also in exponents, where it begins as a number."""
    text = str(text)
    if re.match(r"[-+±<> ]*[.\d]", text):
        text = re.sub(r"(?<=\de)([-−+]?)0+(?=\d)", r"\1", text)
        text = re.sub(r"(?<![\w.)\]-])-(?=\.?\d)|(?<=\de)-(?=\d)", "−", text)
    shown = escape(re.sub(r"(?<=\d)%", " %", text))
    if re.fullmatch(r"[^:/][^:]*/[^:]*\.html", text):  # a page beside this one
        return Markup('<a href="{}">{}</a>').format(quote(text), shown)
    if max(map(len, text.split()), default=0) > LONG_WORD:
        # a long key of a card may be divided after its dots and underscores, so that its column fits the page
        return Markup(re.sub(r"(?<=\w[._])(?=[^\W\d])", "<wbr>", shown))
    return shown


def _worded(text: str) -> bool:
    """Return whether a cell is words, which may be divided, and not a number: 1/Q at some temperature is, and the digits of a hash."""
    return re.match(r"[^-−+.\d±<>]|\d+/[A-Z]|(?=\d*[a-f])[\da-f]{12}$", text) is not None


def _stacked(table: Cells) -> bool:
    """Return whether a table is too wide for a phone: the longest pieces that no line break divides, side by side."""

    def least(text: str) -> int:
        whole = re.match(r"[-+±<> ]*[.\d]", text) or len(text) <= 12
        longest = max(map(len, re.split(r"[\s._-]+", text)))
        return len(text) if whole else max(longest, LONG_CELL) if len(text) > 40 else longest

    columns = [
        max([least(str(row[k])) for row in table.rows] + [max(map(len, str(head).split()), default=0)])
        for k, head in enumerate(table.columns)
    ]
    return sum(10.0 + 7.4 * width for width in columns) > PHONE


def draw(figure: Drawing, caption: str, alt: str) -> Picture:
    """Embed a matplotlib figure as SVG, with the numbers of its curves."""
    import matplotlib as mpl

    buffer = BytesIO()
    with mpl.rc_context({"svg.hashsalt": caption}):
        figure.set_dpi(72)  # that of the picture, so that its curves lie where they are drawn
        figure.draw_without_rendering()
        figure.set_layout_engine("none")  # laid out once
        shown = figure.get_tightbbox().padded(0.1)
        figure.savefig(buffer, format="svg", bbox_inches=shown, metadata={"Date": None})
    curves = read_curves(figure, *shown.bounds)
    source = "data:image/svg+xml;base64," + base64.b64encode(buffer.getvalue()).decode()
    return Picture(source, caption, alt, curves)


def _provenance() -> str:
    packages = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    made = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC")
    return f"hrg-workbench {version('hrg-workbench')}, Python {platform.python_version()}, {packages}; made {made}."
