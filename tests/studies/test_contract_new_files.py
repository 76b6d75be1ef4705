"""`hrg card new`, `hrg study new` and `hrg design new`: what they write is valid, complete and never written over something."""

import tomllib
from pathlib import Path

import pytest

import shell
from studies.cli import main
from studies.design.task import read_task
from studies.instrument.card import load_card, shipped_cards
from studies.instrument.registry import card_tables
from studies.sweeps.parameters import set_parameters
from studies.sweeps.spec import read_study, shipped_specs

POLYNOMIAL = 'schema = "hrg.card/1"\nname = "fitted"\n[law]\nf0_Hz = 4432.0\n'


@pytest.mark.parametrize("like", sorted(shipped_cards()))
def test_a_new_card_is_its_model_under_another_name(tmp_path, like):
    path = tmp_path / "mine.toml"
    assert main(["card", "new", str(path), "--like", like, "--name", 'my "own"']) == 0
    card, model = load_card(path), load_card(like)
    assert card.name == 'my "own"'
    assert (card.resonator, card.material.name) == (model.resonator, model.material.name)
    text = path.read_text(encoding="utf-8")
    for table in set(card_tables()) - {"posterior"}:  # which is written by a calibration
        assert any(f"[{form}" in text for form in (f"{table}]", f"[{table}]", f"{table}.", f"[{table}."))


def test_the_lines_of_the_forms_can_be_set(tmp_path):
    """Every single `key = value` line of the [bias], [noise] and [loss] forms holds when its # is removed."""
    path = tmp_path / "mine.toml"
    assert main(["card", "new", str(path)]) == 0
    lines = path.read_text(encoding="utf-8").splitlines()
    headings = [line for line in lines if line.startswith("# [") and not line.startswith("# [[")]
    assert len(headings) == len({line.partition("]")[0] for line in headings}), "TOML opens a table once"
    tried = 0
    for table in ("bias", "noise", "loss"):
        start = lines.index(next(line for line in lines if line.startswith(f"# [{table}]")))
        for line in lines[start + 1 :]:
            if line.startswith("# ["):
                break
            if " = " in line and "…" not in line:
                text = f"{chr(10).join(one for one in lines if not one.startswith('#'))}\n[{table}]\n{line[2:]}\n"
                tomllib.loads(text)
                (tmp_path / "one.toml").write_text(text, encoding="utf-8")
                load_card(tmp_path / "one.toml")
                tried += 1
    assert tried > 15


@pytest.mark.parametrize("words", [["card", "new"], ["study", "new"], ["design", "new"]])
def test_every_commented_line_is_toml(tmp_path, words):
    """All forms uncommented, each table as a document of its own, parse; the lines come from the declarations."""
    path = tmp_path / "mine.toml"
    assert main([*words, str(path)]) == 0
    lines = [line[2:] for line in path.read_text(encoding="utf-8").splitlines() if line.startswith("# ") or line == "#"]
    first = next(k for k, line in enumerate(lines) if line.startswith(("[", "schema")))
    for block in "\n".join(lines[first:]).split("\n\n"):
        assert tomllib.loads(block)


@pytest.mark.parametrize("like", sorted(shipped_specs()))
def test_a_new_study_is_valid_with_another_card(tmp_path, like):
    assert main(["study", "new", str(tmp_path / "s.toml"), "--like", like, "--card", "free-dome"]) == 0
    assert read_study(tmp_path / "s.toml").instrument.name == "free-dome"
    text = (tmp_path / "s.toml").read_text(encoding="utf-8")
    for heading in ("# [[derived]]", "# [[requirement]]", "# [[search]]", "# [sampling]"):
        assert heading in text


@pytest.mark.parametrize("card", sorted(shipped_cards()))
def test_a_new_task_is_of_the_card_that_it_names(tmp_path, card):
    """Every card, whether it has a stem and a radius or not: the first design is the card itself."""
    path = tmp_path / "t.toml"
    assert main(["design", "new", str(path), "--card", card]) == 0
    task, model = read_task(path), load_card(card)
    assert set_parameters(model, task.named(task.start)).resonator == model.resonator


@pytest.mark.parametrize(
    ("words", "card", "said"),
    [
        *((words, "birdbath-5mm", "has no parameter 'resonator.radius_mm'") for words in (
            "design new x.toml --like dome-8khz", "study new x.toml --like dimension-tolerance")),
        *((words, "fitted.toml", "this needs a card with [resonator] and [material]") for words in (
            "design new x.toml", "study new x.toml", "study run dimension-tolerance --dry-run")),
    ],
)  # fmt: skip
def test_what_does_not_fit_a_card_is_not_written(tmp_path, refuse, monkeypatch, words, card, said):
    monkeypatch.chdir(tmp_path)
    Path("fitted.toml").write_text(POLYNOMIAL)
    assert said in refuse([*words.split(), "--card", card])
    assert not Path("x.toml").exists()


def test_nothing_is_overwritten(tmp_path, capsys):
    path = tmp_path / "mine.toml"
    path.write_text("mine")
    for words in (["card", "new"], ["study", "new"]):
        assert main([*words, str(path)]) == 2
    assert path.read_text() == "mine"
    assert "already exists and is not overwritten" in capsys.readouterr().err
    assert main(["card", "new", str(tmp_path / "x.toml"), "--like", "nothing"]) == 2
    assert not (tmp_path / "x.toml").exists()


DOTTED = """schema = "hrg.card/1"
name = "dotted"
note = '''two
lines [with] brackets'''
resonator.shape = "hemisphere"
resonator.radius_mm = 15.0
resonator.thickness_mm = [[0.0, 0.95], [1.0, 0.85]]
resonator.support = "stem"
resonator.stem = { radius_mm = 2.5, end_mm = -5.0, side = "inner", fillet_mm = 0.5 }
material = { name = "house-silica", file = "house.toml" }
"""
INLINE = """schema = "hrg.card/1"
name = "inline"
resonator = { shape = "hemisphere", radius_mm = 15.0, thickness_mm = 0.9 }
material = { name = "fused-silica" }
"""


@pytest.mark.parametrize("text", [DOTTED, INLINE])
def test_a_new_card_is_its_model_however_that_is_written(tmp_path, text):
    """Dotted keys, inline tables, notes of several lines; a file that the model names is found from the new card's folder."""
    model = tmp_path / "models" / "model.toml"
    model.parent.mkdir()
    (tmp_path / "new").mkdir()
    silica = (Path(shell.__file__).parent / "materials.toml").read_text(encoding="utf-8")
    (model.parent / "house.toml").write_text(silica.replace("[fused-silica", "[house-silica"), encoding="utf-8")
    model.write_text(text, encoding="utf-8")
    assert main(["card", "new", str(tmp_path / "new" / "mine.toml"), "--like", str(model)]) == 0
    mine, like = load_card(tmp_path / "new" / "mine.toml"), load_card(model)
    assert mine.name == "mine"
    assert (mine.resonator, mine.material.value("density", 293.15)) == (
        like.resonator, like.material.value("density", 293.15),
    )  # fmt: skip


PROFILE = INLINE.replace("0.9", "[[0.0, 0.95], [0.5, 0.95], [1.0, 0.85]]")


def test_a_tolerance_of_a_profile_moves_all_of_it_from_its_mean(tmp_path):
    """The mean of a wall of 0.95 mm that thins to 0.85 over its second half is 0.925."""
    (tmp_path / "mine.toml").write_text(PROFILE)
    path = tmp_path / "s.toml"
    assert main(["study", "new", str(path), "--like", "dimension-tolerance", "--card", "mine.toml"]) == 0
    study = read_study(path)
    wall = study.parameters[0]
    assert (wall.name, wall.nominal) == ("resonator.thickness_mm", pytest.approx(0.925, rel=1e-15))
    thicker = set_parameters(study.instrument, {wall.name: 0.935})
    assert [h for _, h in thicker.resonator.thickness] == pytest.approx([0.96e-3, 0.96e-3, 0.86e-3], rel=1e-13)


def test_a_shipped_study_that_does_not_fit_a_card_is_named_by_its_name(tmp_path, refuse):
    bare = 'schema = "hrg.card/1"\nname = "line"\n[resonator]\nshape = "meridian"\nthickness_mm = 0.5\n[material]\nname = "fused-silica"\n'
    segment = '[[resonator.segment]]\nkind = "line"\nfrom_mm = [10.0, 0.0]\nto_mm = [10.0, 20.0]\n'
    (tmp_path / "line.toml").write_text(bare + segment)
    said = refuse(["study", "run", "dimension-tolerance", "--card", str(tmp_path / "line.toml"), "--dry-run"])
    assert "the shipped study 'dimension-tolerance'" in said
    assert "templates" not in said


@pytest.mark.parametrize(("like", "command"), [("free-dome", "modes"), ("fitted.toml", "cards")])
def test_the_command_named_after_a_new_card_takes_it(tmp_path, capsys, like, command):
    (tmp_path / "fitted.toml").write_text(POLYNOMIAL)
    path = tmp_path / "mine.toml"
    assert main(["card", "new", str(path), "--like", str(tmp_path / like) if like.endswith(".toml") else like]) == 0
    assert f"then run: hrg {command} {path}" in capsys.readouterr().err
    assert main([command, str(path)]) == 0
