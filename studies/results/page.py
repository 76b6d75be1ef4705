"""Results as a page: one self-contained HTML file."""

from collections.abc import Iterator, Sequence

from studies.reports import page
from studies.results import Blocks, Facts, Figure, Part, Result, Sentence, Table


def render_result(result: Result) -> str:
    """Return the page as HTML text."""
    chapters = [page.Chapter(chapter.title, make_blocks(*chapter.parts)) for chapter in result.chapters]
    return page.render_page(result.title, result.lead, [one for one in chapters if one.blocks], result.sources)


def make_blocks(*parts: Part) -> Sequence[page.Block]:
    """Return parts as blocks of a page."""
    return [block for part in parts for block in _blocks(part)]


def _blocks(part: Part) -> Iterator[page.Block]:
    match part:
        case Figure():
            yield page.draw(part.draw(), part.caption, part.alt or part.caption)
        case Blocks():
            yield from part.make()
        case _ if part.where == "terminal":
            return
        case Table() if part.rows:
            headings, rows = part.cells("page")
            yield page.Table(part.title, headings, rows, part.note, part.sortable)
        case Facts():
            yield page.Facts(part.facts)
        case Sentence():
            yield page.Text(part.text, part.kind)
