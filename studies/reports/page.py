"""A report page: blocks of text, tables and figures rendered into one self-contained HTML file.

All text is escaped by the template; figures are embedded, so the page works without a network. What would make a page
long is folded: tables of many rows, and the chapters that begin below `OPEN_HEIGHT`. On paper everything is unfolded.
"""

import base64
import datetime
import platform
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from importlib.resources import files
from io import BytesIO
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PACKAGES = ("numpy", "scipy", "sympy", "pandas", "pyvista", "trimesh")
OPEN_HEIGHT = 4600  # px at a width of 1280: chapters that would end below are folded
LONG_TABLE = 15  # rows; longer tables are folded, except in the first chapter, which is the answer
LONG_ANSWER = 40  # rows of a table in the first chapter
CONTENTS_FROM = 4  # chapters


@dataclass(frozen=True)
class Text:
    """A paragraph; `kind` is plain, lead, note, warning, or source for text that keeps its lines."""

    text: str
    kind: str = "plain"
    block: str = field(default="text", init=False)


@dataclass(frozen=True)
class Table:
    """A table of cells that are already text; `columns` carry quantity and unit; `sortable` by a click on a heading."""

    caption: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    sortable: bool = False
    block: str = field(default="table", init=False)


@dataclass(frozen=True)
class Picture:
    """An embedded picture with its caption and the words that stand for it where it cannot be seen."""

    data_uri: str
    caption: str
    alt: str
    height: float = 400.0  # px, roughly
    block: str = field(default="picture", init=False)


@dataclass(frozen=True)
class Facts:
    """A few numbers that carry the page: (label, value, remark)."""

    facts: Sequence[tuple[str, str, str]]
    block: str = field(default="facts", init=False)


@dataclass(frozen=True)
class Embedded:
    """Trusted HTML made by the workbench itself (never a user's text), such as an interactive view."""

    html: str
    caption: str = ""
    block: str = field(default="embedded", init=False)


Block = Text | Table | Picture | Facts | Embedded


@dataclass(frozen=True)
class Chapter:
    """A heading and its blocks."""

    title: str
    blocks: Sequence[Block]


def render_page(title: str, lead: str, chapters: Sequence[Chapter], sources: Sequence[str] = ()) -> str:
    """Return the page as HTML text."""
    from jinja2 import Environment, StrictUndefined

    template = (files("studies.reports") / "templates" / "page.html").read_text(encoding="utf-8")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters.update(typeset=typeset, typeset_cell=_typeset_cell)
    return environment.from_string(template).render(
        title=title,
        lead=lead,
        chapters=list(zip(chapters, _folded(chapters), strict=True)),
        contents=len(chapters) >= CONTENTS_FROM,
        long_table=LONG_TABLE,
        long_answer=LONG_ANSWER,
        sources=sources,
        provenance=_provenance(),
    )


def typeset(text: str) -> str:
    """Return text with a minus sign before numbers that carry a unit, and a space before the per cent sign."""
    text = re.sub(r"(?<![\w.)\]])-(?=\d[\d.]*(?:e[-+]?\d+)? ?(?:°|ppm|mHz|Hz|mK|K\b|µ|%|s\b|h\b))", "−", text)
    return re.sub(r"(?<=\d)%", " %", text)


def _typeset_cell(text: str) -> str:
    """Return a cell with minus signs, also in exponents, where it begins as a number."""
    text = str(text)
    if re.match(r"[-+±<> ]*[.\d]", text):
        text = re.sub(r"(?<![\w.)\]-])-(?=\.?\d)|(?<=\de)-(?=\d)", "−", text)
    return re.sub(r"(?<=\d)%", " %", text)


def _folded(chapters: Sequence[Chapter]) -> list[bool]:
    """Return which chapters are folded: from the first on that would end below `OPEN_HEIGHT`, never the first two."""
    reached = 260.0 + 26 * len(chapters)
    folded: list[bool] = []
    for k, chapter in enumerate(chapters):
        reached += 80 + sum(_height(block, k == 0) for block in chapter.blocks)
        folded.append((k > 1 and reached > OPEN_HEIGHT) or any(folded))
    return folded


def _height(block: "Block", answer: bool) -> float:
    """Return about how many pixels a block is high at a width of 1280 px."""
    if isinstance(block, Text):
        lines = len(block.text.splitlines()) if block.kind == "source" else 1 + len(block.text) / 95
        return 25 * lines + 25
    if isinstance(block, Table):
        if len(block.rows) > (LONG_ANSWER if answer else LONG_TABLE):
            return 60
        share = 110 / max(1, len(block.columns))
        lines = sum(1 + max((len(str(cell)) // max(28.0, share) for cell in row), default=0) for row in block.rows)
        return 100 + 33 * lines + len(block.note) / 4
    if isinstance(block, Picture):
        return block.height + 70
    return 110.0 * (1 + len(block.facts) // 5) if isinstance(block, Facts) else 700


def draw(figure: "Figure", caption: str, alt: str) -> Picture:
    """Embed a matplotlib figure as SVG."""
    import matplotlib as mpl

    buffer = BytesIO()
    with mpl.rc_context({"svg.hashsalt": caption}):
        figure.savefig(buffer, format="svg", bbox_inches="tight", metadata={"Date": None})
    height = 96 * float(figure.get_figheight())
    return Picture(_data_uri("image/svg+xml", buffer.getvalue()), caption, alt, height)


def _data_uri(kind: str, data: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


def _provenance() -> str:
    packages = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    made = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC")
    return f"hrg-workbench {version('hrg-workbench')}, Python {platform.python_version()}, {packages}; made {made}."
