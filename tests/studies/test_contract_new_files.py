"""`hrg card new` and `hrg study new`: what they write is valid, complete and never written over something."""

import tomllib

import pytest

from studies.cli import main
from studies.instrument.card import load_card, shipped_cards
from studies.instrument.registry import card_tables
from studies.sweeps.spec import read_study, shipped_specs


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


@pytest.mark.parametrize("like", sorted(shipped_specs()))
def test_a_new_study_is_valid_with_another_card(tmp_path, like):
    assert main(["study", "new", str(tmp_path / "s.toml"), "--like", like, "--card", "free-dome"]) == 0
    assert read_study(tmp_path / "s.toml").instrument.name == "free-dome"
    text = (tmp_path / "s.toml").read_text(encoding="utf-8")
    for heading in ("# [[derived]]", "# [[requirement]]", "# [[search]]", "# [sampling]"):
        assert heading in text


def test_nothing_is_overwritten(tmp_path, capsys):
    path = tmp_path / "mine.toml"
    path.write_text("mine")
    for words in (["card", "new"], ["study", "new"]):
        assert main([*words, str(path)]) == 2
    assert path.read_text() == "mine"
    assert "exists and is not overwritten" in capsys.readouterr().err
    assert main(["card", "new", str(tmp_path / "x.toml"), "--like", "nothing"]) == 2
    assert not (tmp_path / "x.toml").exists()
