"""Contract of the command line: light start, exit statuses, one object on stdout, errors without traceback (real processes)."""

import json
import os
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

from studies.cli import COMMANDS, main

ROOT = Path(__file__).parents[2]
PARTS = (
    "linalg",
    "sparse",
    "special",
    "fft",
    "optimize",
    "signal",
    "stats",
    "ndimage",
    "integrate",
    "interpolate",
    "spatial",
)
HEAVY = (
    "pandas",
    "sympy",
    "matplotlib",
    "pyvista",
    "trimesh",
    "dask",
    "vtk",
    "jinja2",
    *(f"scipy.{part}" for part in PARTS),
)


def hrg(*words: str, cwd: Path = ROOT) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", "from studies.cli import run; run()", *words]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "120"}
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, env=environment, timeout=300)


def test_help_every_command_and_short_answers_start_without_the_heavy_packages():
    """One process: each line is what was loaded too much after the help, all modules of commands, `cards` and `modes`."""
    code = f"""
import sys
from importlib import import_module
from studies.cli import COMMANDS, main

def loaded(step, *allowed):
    known = [".".join(name.split(".")[:2]) for name in sys.modules if name.startswith("scipy.")]
    print(step, sorted({{n for n in (*known, *sys.modules) if n in {HEAVY!r} and n not in allowed}}), file=sys.stderr)

main(["--help"]), main(["fit", "--help"])
loaded("help")
for target, _ in COMMANDS.values():
    import_module(target.split(":")[0])
loaded("commands")
main(["cards"])
loaded("cards")
main(["modes", "free-dome"])
loaded("modes", "scipy.linalg", "scipy.sparse")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, timeout=600)
    assert done.stderr.splitlines() == ["help []", "commands []", "cards []", "modes []"]


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_command_has_help_that_documents_json_and_names_its_schema(name, capsys):
    assert main([*name.split(), "--help"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "--json" in said
    assert "schema ?" not in said


def test_every_command_is_listed(capsys):
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    for name in COMMANDS:
        assert name.split()[0] in text


def test_an_error_of_a_real_process_is_status_2_without_traceback():
    done = hrg("tcf", "none.toml")
    assert (done.returncode, done.stdout) == (2, "")
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["nonsense"], "nonsense"),
        (["tcf"], "CARD is missing"),
        (["tcf", "hrg-30m"], "hrg-30mm"),
        (["tcf", "none.toml"], "no such file"),
        (["tcf", "hrg-30mm", "--from", "-300", "--theory", "shell"], "outside the range"),
        (["tcf", "hrg-30mm", "--step", "0"], "step"),
        (["modes", "hrg-30mm", "--count", "0"], "count"),
        (["modes", "free-dome", "--spin", "nan"], "--spin"),
        (["modes", "free-dome", "--amplitude", "-1"], "--amplitude"),
        (["modes", "free-dome", "--amplitude", "1", "--harmonic", "1"], "--amplitude"),
        (["modes", "free-dome", "--spin", "100", "--theory", "shell"], "--spin"),
        (["materials", "fused-silca"], "fused-silica"),
        (["fit", "frequency", "none.csv"], "no such file"),
        (["fit", "frequency", "studies/papers/hrg_table1.csv", "--order", "7"], "order"),
        (["reproduce", "--out", "README.md/sub"], "cannot be written"),
    ],
)
def test_unusable_input_is_one_plain_message_and_status_2(words, part, capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    assert main(words) == 2
    out, err = capsys.readouterr()
    assert part in err
    assert "Traceback" not in err
    assert out == ""


def test_debug_shows_the_traceback(capsys):
    assert main(["tcf", "none.toml", "--debug"]) == 2
    assert "Traceback" in capsys.readouterr().err


def test_spin_parts_the_waves_of_a_pair_by_bryan(capsys):
    assert main(["modes", "free-dome", "--harmonic", "0", "2", "--spin", "360", "--json"]) == 0
    axial, pair = json.loads(capsys.readouterr().out)["modes"]
    spin = pair["spin"]
    assert "spin" not in axial
    assert spin["upper_wave_Hz"] - spin["lower_wave_Hz"] == pytest.approx(2 * 2 * pair["bryan_factor"], rel=1e-9)
    mean = (spin["upper_wave_Hz"] + spin["lower_wave_Hz"]) / 2
    assert mean - pair["frequency_Hz"] == pytest.approx(1e-6 * spin["shift_ppm"] * pair["frequency_Hz"], rel=1e-3)


def test_the_shift_by_amplitude_has_two_parts_and_goes_with_its_square(capsys):
    found = []
    for amplitude in ("1", "2"):
        assert main(["modes", "free-dome", "--amplitude", amplitude, "--json"]) == 0
        found.append(json.loads(capsys.readouterr().out)["modes"][0]["amplitude"])
    one, two = found
    assert two["shift_ppb"] == pytest.approx(4 * one["shift_ppb"], rel=1e-9)
    assert one["shift_ppb"] == pytest.approx(one["static_ppb"] + one["inertial_ppb"], rel=1e-9)


def test_a_foreign_package_of_our_name_is_status_3(tmp_path):
    (tmp_path / "thermal.py").write_text("")
    code = "import sys; sys.path.insert(0, sys.argv.pop(1)); from studies.cli import main; sys.exit(main(['cards']))"
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True, cwd=ROOT, timeout=600
    )
    assert done.returncode == 3
    assert "thermal" in done.stderr
    assert "uninstall" in done.stderr


def test_fit_frequency_writes_page_and_model_whole(tmp_path):
    table, page, model = ROOT / "studies/papers/hrg_table1.csv", tmp_path / "p.html", tmp_path / "m.toml"
    assert main(["fit", "frequency", str(table), "--report", str(page), "--save", str(model)]) == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["m.toml", "p.html"]
    text = page.read_text(encoding="utf-8")
    assert "quartic is significantly better" in text
    assert "http://" not in text.replace("http://www.w3.org", "")
    assert text.count("data:image/svg+xml;base64") == 3


def test_text_of_users_is_escaped_in_a_page(tmp_path):
    table = tmp_path / "<script>alert(1)<"
    table.write_text((ROOT / "studies/papers/hrg_table1.csv").read_text(encoding="utf-8"), encoding="utf-8")
    assert main(["fit", "frequency", str(table), "--report", str(tmp_path / "p.html")]) == 0
    assert "<script>alert" not in (tmp_path / "p.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("rows", "part"),
    [
        ("0,4424.9\n0,4424.9\n0,4424.9\n0,4424.9\n0,4424.9\n", "constant"),
        ("0,4424.9\n10,4428.5\n", "different values"),
        ("0,4424\n10,4424\n20,4424\n30,4424\n40,4424\n50,4424\n", "constant"),
        ("0,4424\n10,4430\n20,4432\n30,4430\n40,4424\n50,4414\n", "turning point"),
    ],
)
def test_unusable_tables_are_refused(tmp_path, rows, part, capsys):
    path = tmp_path / "t.csv"
    path.write_text("temperature_degC,frequency_Hz\n" + rows)
    assert main(["fit", "frequency", str(path)]) == 2
    assert part in capsys.readouterr().err


@pytest.mark.parametrize("number", ["inf", "nan", "-1e308", "1e16"])
@pytest.mark.parametrize(
    "words",
    [
        ["modes", "free-dome", "--amplitude"],
        ["tcf", "free-dome", "--step"],
        ["loop", "hrg-30mm-loops", "--rate"],
        ["simulate", "free-dome", "step 20 -10 5h", "--out", "run.csv", "--row"],
    ],
)
def test_no_argument_is_infinite_or_near_it(words, number, capsys):
    assert main([*words, number]) == 2
    assert "must be a finite number" in capsys.readouterr().err


def test_what_a_file_says_cannot_act_on_the_terminal(tmp_path, capsys):
    """An escape sequence in a card's name is refused; one in a column's name or an argument is spelled out."""
    card, table = tmp_path / "card.toml", tmp_path / "t.csv"
    card.write_text('schema = "hrg.card/1"\nname = "a\\u001b[2Jb"\n[resonator]\n')
    table.write_text("temperature_degC,\x1b[31mfrequency\n20,4432\n")
    for words in (["modes", str(card)], ["fit", "frequency", str(table)], ["modes", "\x1b]0;x"]):
        assert main(words) == 2
        said = capsys.readouterr().err
        assert r"\x1b" in said
        assert "\x1b" not in said


@pytest.mark.slow
def test_doctor_looks_for_the_package_of_the_cluster_and_not_for_a_program(capsys, monkeypatch):
    pytest.importorskip("distributed", reason="the extra 'cluster' (dask[distributed]) is not installed")
    monkeypatch.setenv("PATH", "")
    main(["doctor", "--json"])
    (found,) = [one for one in json.loads(capsys.readouterr().out)["checks"] if one["name"] == "distributed"]
    assert found["found"] == version("distributed")


def test_a_profile_without_quotes_is_told_where_they_stand(capsys):
    assert main(["thermal", "hrg-30mm", "step", "20", "-10", "5h"]) == 2
    said = capsys.readouterr().err
    assert '"step 20 -10 5h"' in said
    assert "Unused" not in said
    assert main(["modes", "free-dome", "3"]) == 2
    assert "too many arguments" in capsys.readouterr().err
