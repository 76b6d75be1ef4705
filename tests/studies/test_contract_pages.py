"""What a reader may rely on in every page: contents that lead somewhere, long parts folded, one way to write numbers."""

import re

import pytest

from studies.cli import main
from studies.reports.diagnosis import spell_parameter
from studies.reports.digits import plain, to_error, to_interval
from studies.results import Chapter, Sentence
from studies.results.page import Cells, render_page, typeset
from tests.golden.answers import HERE


def page(chapters, rows):
    table = Cells("Readings", ["Name", "Value"], [["<b>", "-1.5e-03"]] * rows, sortable=True)
    long = Sentence("word " * 1500)
    return render_page(
        "A page", "lead", [Chapter(f"Chapter {k}", [Sentence("short"), table, long]) for k in range(chapters)]
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
    assert "<td>−1.5e−3</td>" in text
    assert '<table aria-labelledby="table-1-2" class="sortable ">' in text


def test_numbers_with_units_are_typeset_and_words_for_a_command_are_not():
    assert typeset("from -20 °C, 17% of the span") == "from −20 °C, 17 % of the span"
    assert typeset("skew is then -0.2781, not -0.31 (4 times)") == "skew is then −0.2781, not −0.31 (4 times)"
    assert (
        typeset("hrg simulate card 'step 20 -10 5h' on 2026-11-22")
        == "hrg simulate card 'step 20 -10 5h' on 2026-11-22"
    )


def test_digits_follow_the_interval():
    """GUM 7.2.6: two digits of an uncertainty, and the value to the same place."""
    assert to_interval(1.2637e-8, -3.71e-4, 3.71e-4) == ["0.00000", "-0.00037", "0.00037"]
    assert to_interval(4425.14349, 4425.14061, 4425.14648) == ["4425.1435", "4425.1406", "4425.1465"]
    assert to_interval(1642.0, 488.8, 5515.0) == ["1600", "500", "5500"]
    assert to_error(-1.87584e-5, 2.5e-7) == ("-1.876e-5", "2.5e-7")
    assert to_error(-708.43, 11.0) == ("-708", "11")
    assert to_error(0.0238945, 1.5e-5) == ("0.023894", "0.000015")  # the double lies below the half
    assert [plain(x) for x in (720.0, 0.000123456, 12345.6, 1.2e-5, 0.0, None)] == [
        "720", "0.000123", "12346", "1.20e-5", "0", "—",
    ]  # fmt: skip


def test_parameters_have_units_that_people_use():
    assert spell_parameter("coefficient_deg_per_h_per_K_per_s") == ("coefficient (°/h per K/min)", 1.0 / 60.0)
    assert spell_parameter("second_time_constant_s") == ("second time constant (s)", 1.0)
    assert spell_parameter("initial_memory") == ("initial memory", 1.0)


def test_wide_tables_are_stacked_on_a_phone_and_long_ones_end_on_paper():
    wide = Cells("T", [f"Quantity {k}" for k in range(9)], [["1234.5678"] * 9] * 50)
    narrow = Cells("T", ["Name", "Value"], [["f", "1"]])
    text = render_page("A page", "lead", [Chapter("One", [wide, narrow, Sentence("run `step 20 -10 5h`")])])
    assert text.count('class="stack dense paged"') == 1
    assert text.count('data-head="Quantity 8"') == 50
    assert 'class="remark onpaper">40 of 50 rows' in text
    assert "<code>step 20 -10 5h</code>" in text
    sentence = "a fit over temperature needs at least two temperatures"
    said = Cells(
        "U",
        ["Command", "Gives", "Possible", "Missing"],
        [["1/Q", "values over temperature", "no", sentence], ["acceptance", "", "", ""]],
    )
    text = render_page("A page", "lead", [Chapter("One", [said])])
    assert 'class="stack ' in text  # a column of sentences is not narrowed to its longest word
    assert 'data-head="Missing"' in text
    assert 'data-head="Command"' not in text


@pytest.mark.parametrize(
    ("words", "once"),
    [
        pytest.param("loop hrg-30mm-loops", "phase and rate loops", marks=pytest.mark.slow),
        pytest.param(  # the mode that the sliders move
            "modes free-dome --harmonic 0 2 --theory shell", "bent into 4 lobes", marks=pytest.mark.slow
        ),
    ],
)
def test_a_page_says_of_what_its_numbers_are_and_says_it_once(words, once, tmp_path):
    page = tmp_path / "page.html"
    assert main([*words.split(), "--report", str(page)]) == 0
    assert page.read_text().count(once) == 1


@pytest.mark.parametrize(("name", "once"), [("loss", "1.46 times this loss"), ("trim", "thermal equilibrium")])
def test_a_golden_page_says_it_once(name, once):
    assert (HERE / "pages" / f"{name}.txt").read_text(encoding="utf-8").count(once) == 1
