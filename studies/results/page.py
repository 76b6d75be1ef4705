"""Results as a page: one self-contained HTML file."""

from collections.abc import Iterator

from studies.reports import page
from studies.results import Blocks, Facts, Figure, Part, Result, Sentence, Table


def render_result(result: Result) -> str:
    """Return the page as HTML text."""
    chapters = [
        page.Chapter(chapter.title, [b for part in chapter.parts for b in _blocks(part)]) for chapter in result.chapters
    ]
    return page.render_page(result.title, result.lead, [one for one in chapters if one.blocks], result.sources)


def _blocks(part: Part) -> Iterator[page.Block]:
    match part:
        case Figure():
            yield page.draw(part.draw(), part.caption, part.alt or part.caption)
        case Blocks():
            yield from part.make()
        case _ if part.where == "terminal":
            return
        case Table() if part.rows:
            headings, rows = part.cells()
            yield page.Table(part.title, headings, rows, part.note, part.sortable)
        case Facts():
            yield page.Facts(part.facts)
        case Sentence():
            yield page.Text(part.text, part.kind)
