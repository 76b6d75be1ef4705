"""Contract of an answer that is declared once: what its columns write, and what text, JSON and page make of it."""

import inspect
import json
from fractions import Fraction
from importlib import import_module

import pytest

from studies.cli import COMMANDS
from studies.cli.output import answers, dump_json
from studies.results import Blocks, Chapter, Column, Facts, Figure, Result, Sentence, Table, columns, rows_of
from studies.results.page import render_result
from studies.results.terminal import print_result

WITHOUT_REPORT = {
    # commands that have no --report, and why
    "study report": "writes a page of its own",
    "reproduce": "writes a page of its own",
    "study export": "computes nothing",
    "export": "computes nothing",
    "card new": "computes nothing",
    "study new": "computes nothing",
    "design new": "computes nothing",
    "fleet": "writes a page of each device and of the lot",
}
ROW = {"a": 1.23456789, "sd": 0.0234, "low": 1e-7, "high": 3.0e6, "in": {"list": [1.0, -0.0004]}, "n": 2, "name": "x"}


@pytest.mark.parametrize(
    ("column", "text"),
    [
        (Column("a", "a"), "1.235"),
        (Column("a", "a", form="+.2f"), "+1.23"),
        (Column("a", "a", error="sd"), "1.235 ± 0.023"),
        (Column("a", "a", scale=1e3, digits=2), "1235"),
        (Column("a", "a", interval=("low", "high")), "1.000e-7 … 3.000e6"),
        (Column("in.list.1", "b", form="+.2f"), "+0.00"),
        (Column("n", "n"), "2"),
        (Column("name", "name"), "x"),
        (Column("gone.deeper", "none"), ""),
        (Column("a", "a", error="gone"), "1.235"),
        (Column(lambda row: row["a"] + row["n"], "a function"), "3.235"),
    ],
)
def test_a_number_becomes_text_in_one_place(column, text):
    assert column.write(ROW) == text


@pytest.mark.parametrize(
    ("head", "column"),
    [
        ("a: f (Hz) ×1e3 +.3g", Column("a", "f", "Hz", "+.3g", scale=1e3)),
        ("in.list.1: no. 2 .2", Column("in.list.1", "no. 2", digits=2)),
        ("a ± sd: a", Column("a", "a", error="sd")),
        ("low … high ± sd: 90 % interval", Column("low", "90 % interval", interval=("low", "high"), error="sd")),
        ("low … high: 90 % interval .0", Column("low", "90 % interval", interval=("low", "high"), digits=0)),
        ("a in low … high: a", Column("a", "a", within=("low", "high"))),
        ("At bound", Column("at_bound", "At bound")),
        ("n: ", Column("n", "")),
    ],
)
def test_a_head_declares_its_columns(head, column):
    (found,) = columns(head)
    assert (found.title, found.write(ROW)) == (column.title, column.write(ROW))
    assert len(columns(f"{head} | name")) == 2


def test_a_head_with_an_error_is_no_column():
    with pytest.raises(AssertionError, match="frequency"):
        columns("harmonic: n | frequency_Hz f (Hz)")


def test_a_row_may_be_any_object():
    assert Column("denominator", "a").write(Fraction(3, 4)) == "4"
    assert Column("1.denominator", "a").write((0, Fraction(3, 4))) == "4"


def answer(drawn):
    rows = rows_of({"x": [1.0, 2.0], "y": ["<b>", None], "z": [None, None]})
    columns = [Column("x", "x", "mm"), Column("y", "y"), Column("z", "never seen")]
    return Result(
        {"schema": "hrg.test/1", "rows": rows, "nothing": float("nan")},
        "A <title>",
        "What it is.",
        [
            Facts([("Length", "2 mm", "roughly")]),
            Table("Readings", rows, columns, "a note"),
            Table("Nothing", [], columns),
            Sentence("only here", where="terminal"),
            Chapter("Empty", [Table("Nothing", [], columns)]),
            Chapter("More", [Sentence("only there", where="page"), Blocks(lambda: drawn.append(1) or [])]),
        ],
    )


def test_text_json_and_page_are_made_of_one_declaration(capsys):
    drawn = []
    result = answer(drawn)
    print_result(result)
    told = capsys.readouterr().out
    assert "Length: 2 mm (roughly)" in told
    assert "(mm)" in told
    assert "only here" in told
    for absent in ("Nothing", "never seen", "only there", "Empty"):
        assert absent not in told
    assert not drawn  # pictures are made for the page only
    assert json.loads(dump_json(result.payload))["rows"][0] == {"x": 1.0, "y": "<b>", "z": None}
    page = render_result(result)
    assert drawn
    assert "A &lt;title&gt;" in page
    assert "&lt;b&gt;" in page
    assert "only there" in page
    for absent in ("only here", ">Empty<", "never seen"):
        assert absent not in page


def test_a_command_gets_its_options_and_its_status(tmp_path, capsys):
    @answers("hrg.test/1")
    def command(name: str = "") -> Result:
        return Result({"schema": "hrg.test/1", "name": name}, "T", printed=f"{name}\n", status=4)

    assert list(inspect.signature(command).parameters) == ["name", "report", "json"]
    assert command("a") == 4
    assert capsys.readouterr().out == "a\n"
    assert command("a", json=True, report=str(tmp_path / "p.html")) == 4
    assert json.loads(capsys.readouterr().out)["name"] == "a"
    assert (tmp_path / "p.html").exists()


def test_a_figure_is_embedded(drawn):
    from studies.reports import style

    def draw():
        with style.figure() as (made, axis):
            axis.plot([0, 1], [0, 1])
            return made

    assert "data:image/svg+xml;base64,PD94" in render_result(Result({}, "T", "l", [Figure(draw, "A line.")]))


@pytest.mark.parametrize("name", sorted(set(COMMANDS) - set(WITHOUT_REPORT)))
def test_every_command_that_computes_writes_a_page(name):
    module, function = COMMANDS[name][0].split(":")
    assert "report" in inspect.signature(getattr(import_module(module), function)).parameters
