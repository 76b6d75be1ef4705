"""What a reader may rely on in every page: contents that lead somewhere, long parts folded, one way to write numbers."""

import re

from studies.reports.page import Chapter, Table, Text, render_page, typeset


def page(chapters, rows):
    table = Table("Readings", ["Name", "Value"], [["<b>", "-1.5e-03"]] * rows, sortable=True)
    long = Text("word " * 1500)
    return render_page(
        "A page", "lead", [Chapter(f"Chapter {k}", [Text("short"), table, long]) for k in range(chapters)]
    )


def test_contents_lead_to_every_chapter_when_there_are_more_than_three():
    assert "<nav" not in page(3, 2)
    text = page(5, 2)
    links = re.findall(r'<li><a href="#([^"]+)">', text)
    assert len(links) == 5
    assert all(text.count(f'id="{link}"') == 1 for link in links)


def test_chapters_far_down_and_long_tables_are_folded_but_the_answer_is_not():
    text = page(8, 20)
    first, _, rest = text.partition('id="chapter-2"')
    assert '<details class="table long">' not in first
    assert '<details class="table long">' in rest
    chapters = re.findall(r'(<details class="chapter">|<h2 id="chapter-\d">)', text)
    folded = [one.startswith("<details") for one in chapters]
    assert folded == sorted(folded)  # once folded, all that follow
    assert not any(folded[:2])
    assert folded[-1]
    assert text.count("<details") == text.count("</details>")


def test_cells_are_escaped_sortable_and_have_minus_signs():
    text = page(1, 2)
    assert "&lt;b&gt;" in text
    assert "<td>−1.5e−03</td>" in text
    assert '<table aria-labelledby="table-1-2" class="sortable ">' in text


def test_numbers_with_units_are_typeset_and_words_for_a_command_are_not():
    assert typeset("from -20 °C, 17% of the span") == "from −20 °C, 17 % of the span"
    assert (
        typeset("hrg simulate card 'step 20 -10 5h' on 2026-11-22")
        == "hrg simulate card 'step 20 -10 5h' on 2026-11-22"
    )
