"""Contract of the command line: light start, exit statuses, one object on stdout, errors without traceback (real processes)."""

import json
import os
import subprocess
import sys
from importlib.metadata import version
from importlib.util import module_from_spec
from pathlib import Path
from random import Random

import pytest
import scipy

from studies.cli import COMMANDS, _Deferred, main

ROOT = Path(__file__).parents[2]
PARTS = [
    "linalg", "sparse", "special", "fft", "optimize", "signal", "stats", "ndimage", "integrate", "interpolate",
    "spatial", "constants",
]  # fmt: skip
HEAVY = ["pandas", "sympy", "matplotlib", "pyvista", "trimesh", "dask", "vtk", "jinja2", *(f"scipy.{p}" for p in PARTS)]


@pytest.mark.slow
def test_help_every_command_and_short_answers_start_without_the_heavy_packages(tmp_path):
    """One process: each line is what was loaded too much, for one number say: 0.1 to 0.5 s of processor time each.

    Fits and the diagnosis end early: the way that a command goes counts here, not how far.
    """
    noise, warm = Random(1), [10 * (1 - 0.9**k) for k in range(60)]  # plain: nothing to search for
    rows = [f"{60 * k},{20 + x:.4f},{4600 + 0.4 * x + noise.gauss(0, 0.01):.6f}" for k, x in enumerate(warm)]
    (tmp_path / "run.csv").write_text("\n".join(["time_s,housing_temperature_degC,frequency_Hz", *rows]) + "\n")
    code = f"""
import sys
from importlib import import_module
from studies.cli import COMMANDS, main

def loaded(step, *heavy, file=open("loaded", "w")):
    names = {{".".join(name.split(".")[:2]) for name in sys.modules}}
    print(step, sorted(names & set(heavy)), file=file, flush=True)

main(["--help"]), main(["fit", "--help"]), main(["cards"])
loaded("cards", "scipy", *{HEAVY!r})
for target, _ in COMMANDS.values():
    import_module(target.split(":")[0])
loaded("commands", *{HEAVY!r})
main(["modes", "free-dome"])
loaded("modes", *({{*{HEAVY!r}}} - {{"scipy.linalg", "scipy.sparse"}}))
import studies.calibration.fit, studies.inference.diagnosis as diagnosis
studies.calibration.fit.MOST_STEPS, diagnosis.BLOCKS, diagnosis.BLOCKS_OF_RUN = 1, 60, (60, 60)
for words in ("simulate free-dome run.csv --out out.csv", "calibrate free-dome run.csv", "diagnose run.csv"):
    loaded(main(words.split()), "scipy.signal", "scipy.stats", "pandas")
"""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, "-c", code], capture_output=True, cwd=tmp_path, env=environment, timeout=600)
    assert (tmp_path / "loaded").read_text().splitlines() == ["cards []", "commands []", "modes []", *["0 []"] * 3]


def test_what_scipy_says_of_its_functions_is_not_read_at_the_start_of_a_command():
    """SciPy edits that of hundreds of functions as it loads; what is edited here is empty, and in its form."""
    spec = _Deferred.find_spec("scipy._lib._docscrape", scipy._lib.__path__)
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    made = module.FunctionDoc(scipy.optimize.nnls)
    assert made["Parameters"] == []
    made["Notes"].append("edited")
    assert str(made).split("\n", 1)[1].split()[-1] == "edited"
    assert _Deferred.find_spec("scipy._lib._util", scipy._lib.__path__) is None


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_command_has_help_that_documents_json_and_names_its_schema(name, capsys):
    assert main([*name.split(), "--help"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "--json" in said
    assert "schema ?" not in said


def test_every_command_is_listed(capsys):
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    assert all(name.split()[0] in text for name in COMMANDS)


def test_a_foreign_package_of_our_name_is_status_3(tmp_path):
    (tmp_path / "thermal.py").write_text("")
    code = "import sys; sys.path.insert(0, sys.argv.pop(1)); from studies.cli import main; sys.exit(main(['cards']))"
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True, cwd=ROOT, timeout=600
    )
    assert done.returncode == 3
    assert "thermal" in done.stderr
    assert "uninstall" in done.stderr


def test_what_a_file_says_cannot_act_on_the_terminal(tmp_path, refuse):
    """An escape sequence in a card's name is refused; one in a column's name or an argument is spelled out."""
    card, table = tmp_path / "card.toml", tmp_path / "t.csv"
    card.write_text('schema = "hrg.card/1"\nname = "a\\u001b[2Jb"\n[resonator]\n')
    table.write_text("temperature_degC,\x1b[31mfrequency\n20,4432\n")
    for words in (["modes", str(card)], ["fit", "frequency", str(table)], ["modes", "\x1b]0;x"]):
        said = refuse(words)
        assert r"\x1b" in said
        assert "\x1b" not in said


def test_doctor_looks_for_the_package_of_the_cluster_and_not_for_a_program(capsys, monkeypatch):
    pytest.importorskip("distributed", reason="the extra 'cluster' (dask[distributed]) is not installed")
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr("shell.render.can_draw", lambda: (True, ""))
    main(["doctor", "--json"])
    (found,) = [one for one in json.loads(capsys.readouterr().out)["checks"] if one["name"] == "distributed"]
    assert found["found"] == version("distributed")
