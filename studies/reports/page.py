"""A report page: blocks of text, tables and figures rendered into one self-contained HTML file.

All text is escaped by the template; figures are embedded, so the page works without a network.
"""

import base64
import datetime
import platform
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from importlib.resources import files
from io import BytesIO
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PACKAGES = ("numpy", "scipy", "sympy", "pandas", "pyvista", "trimesh")


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
    return environment.from_string(template).render(
        title=title, lead=lead, chapters=chapters, sources=sources, provenance=_provenance()
    )


def draw(figure: "Figure", caption: str, alt: str) -> Picture:
    """Embed a matplotlib figure as SVG."""
    import matplotlib as mpl

    buffer = BytesIO()
    with mpl.rc_context({"svg.hashsalt": caption}):
        figure.savefig(buffer, format="svg", bbox_inches="tight", metadata={"Date": None})
    return Picture(_data_uri("image/svg+xml", buffer.getvalue()), caption, alt)


def _data_uri(kind: str, data: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


def _provenance() -> str:
    packages = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    made = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC")
    return f"hrg-workbench {version('hrg-workbench')}, Python {platform.python_version()}, {packages}; made {made}."
