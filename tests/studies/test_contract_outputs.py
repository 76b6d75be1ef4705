"""Outputs never destroy inputs: every path that a command reads, directly or through a file, against every path that it writes."""

import shutil
from pathlib import Path

import pytest

from studies.cli import main
from studies.files.writing import write_text

INPUTS = Path(__file__).parents[1] / "golden" / "inputs"
MAPPED = """schema = "hrg.card/1"
name = "mapped"
[resonator]
shape = "hemisphere"
radius_mm = 15.0
thickness_mm = 0.9
[material]
name = "fused-silica"
[[imperfection.map]]
of = "outer"
file = "outer.csv"
"""
STUDY = """schema = "hrg.study/1"
name = "one"
card = "mapped.toml"
[sampling]
method = "grid"
[[parameter]]
name = "resonator.radius_mm"
values = [15.0]
[[quantity]]
name = "frequency"
theory = "shell"
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    shutil.copytree(INPUTS, tmp_path, dirs_exist_ok=True)
    (tmp_path / "mapped.toml").write_text(MAPPED)
    (tmp_path / "spec.toml").write_text(STUDY)
    for name in ("points.xyz", "scanned-outer.csv"):
        (tmp_path / name).write_text("no points: reading them would be work\n")
    (tmp_path / "scanned-inner.csv").write_text((tmp_path / "inner.csv").read_text())
    (tmp_path / "model.toml").write_text("")
    (tmp_path / "link.csv").symlink_to(tmp_path / "run1.csv")
    (tmp_path / "dangling.csv").symlink_to(tmp_path / "zz-inner.csv")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    "words",
    [
        "loss mapped.toml --report mapped.toml",
        "loss mapped.toml --report outer.csv",
        "simulate mapped.toml soak_20_1h --out outer.csv",
        "simulate hrg-30mm run1.csv --out run1.csv",
        "simulate hrg-30mm run1.csv --out link.csv",
        "simulate hrg-30mm run1.csv --out ../{name}/run1.csv",
        "scan free-dome inner.csv outer.csv --theory shell --map inner.csv",
        "scan free-dome none scanned-inner.csv --theory shell --save outer.csv --map outer.csv",
        "scan free-dome points.xyz --save zz.toml --map zz-inner.csv",
        "scan free-dome points.xyz --save zz.toml --map ./dangling.csv",
        "scan free-dome none scanned-outer.csv --save scanned.toml",
        "diagnose run1.csv --card mapped.toml --report outer.csv",
        "calibrate hrg-30mm run1.csv --save run1.csv",
        "import raw.csv --map map.toml --out map.toml",
        "import raw.csv --draft raw.csv",
        "mesh mapped.toml --out ./outer.csv",
        "fit cross-damping cross.csv --frequency 5000 --quality 20000 --save m.toml --report m.toml",
        "fit cross-damping cross.csv --frequency 5000 --quality 20000 --save m.toml --report ../{name}/m.toml",
        "study run spec.toml --out mapped.toml",
        "temperature model.toml settled.csv --out model.toml",
        "temperature model.toml settled.csv --out settled.csv",
        "compensate model.toml settled.csv --out settled.csv",
        "compensate model.toml --emit model.toml",
        "fit frequency table.csv --save table.csv",
    ],
)
def test_an_output_onto_an_input_or_another_output_is_refused_before_any_work(folder, words, capsys):
    before = contents(folder)
    assert main([word.replace("_", " ") if word[:4] == "soak" else word for word in words.format(name=folder.name).split()]) == 2  # fmt: skip
    assert contents(folder) == before
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.startswith("hrg: ")
    assert "points.xyz, line" not in told.err
    assert told.err.endswith((" choose another name.\n", " name two files.\n", " ends in .html.\n"))


@pytest.mark.slow
def test_the_folder_of_a_study_keeps_its_store_its_lock_and_what_its_spec_names(folder, capsys):
    assert main(["study", "run", "spec.toml", "--out", "study", "--workers", "1", "--quiet"]) == 0
    before = contents(folder)
    ways = (("export", "--out", ".csv"), ("report", "--report", ".html"))
    for command, option, kind in ways:
        for name in ("study/study.store", "study/lock", "mapped.toml", "outer.csv"):
            assert main(["study", command, "study", option, name]) == 2, name
            said = capsys.readouterr().err
            assert said.startswith(f"hrg: {option} {name}: ")
            assert "destroy" in said
        assert main(["study", command, "study", option, "spec.toml"]) == 2  # the spec, which the store does not know
        said = capsys.readouterr().err
        assert said.startswith(f"hrg: {option} spec.toml: ")
        assert f"ends in {kind}" in said
    assert contents(folder) == before
    for _ in range(2):  # a table of before may be written anew
        assert main(["study", "export", "study"]) == 0


@pytest.mark.parametrize("option", ["nowhere/out.csv", "outer.csv/out.csv"])
def test_the_folder_of_an_output_must_be_there(folder, option, refuse):
    assert "cannot be written" in refuse(["simulate", "hrg-30mm", "soak 20 1h", "--out", option])
    assert not (folder / "nowhere").exists()


def test_devices_may_be_given_twice(folder):
    assert main(["mesh", "free-dome", "--around", "8", "--out", "mesh.inp"]) == 0
    assert main(["mesh", "free-dome", "--around", "8", "--out", "mesh.inp"]) == 0
    words = "fit cross-damping cross.csv --frequency 5000 --quality 20000 --save /dev/null --report /dev/null"
    assert main(words.split()) == 0


def test_from_python_a_file_may_be_written_again(tmp_path):
    for text in ("a", "b"):
        write_text(tmp_path / "file.txt", text)
    assert (tmp_path / "file.txt").read_text() == "b"
