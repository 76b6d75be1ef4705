"""FMUs in FMPy, what the archive holds, and what is said of a card that cannot be carried or of a missing compiler."""

import shutil
import subprocess
import zipfile
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from compensation.applied_rate import AppliedRate
from studies.cli import main
from studies.instrument.card import load_card
from studies.simulation.drive import drive_by_profile, rows_of
from studies.simulation.virtual_gyro import simulate_run
from studies.twin import fmu as fmus
from studies.twin.plan import idle_input, plan_twin
from tests.studies.twin.building import needs_compiler
from thermal.profile import Profile

COLUMNS = ["housing_temperature_degC", "resonator_temperature_degC", "frequency_Hz", "bias_deg_per_h", "inverse_q"]
TIME, LEVEL = np.array([0.0, 600.0, 2400.0, 5400.0]), np.array([20.0, 20.0, 35.0, 35.0])


def simulate_fmpy(path, start, *more):
    fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed; it is in the extra 'test'")
    pytest.importorskip("lxml")
    slopes = np.append(np.diff(LEVEL) / np.diff(TIME), 0.0)
    rows = np.arange(0.0, TIME[-1] + 1, 1.0)
    slope = slopes[np.minimum(np.searchsorted(TIME, rows, side="right") - 1, 2)]
    given = {"chamber_temperature_degC": np.interp(rows, TIME, LEVEL), "chamber_temperature_slope_K_per_s": slope}
    given = {"time": rows, **given, "rate_deg_per_s": np.full(rows.size, 0.01)}
    inputs = np.rec.fromarrays([*given.values()], names=[*given])
    with zipfile.ZipFile(path) as archive:
        text = archive.read("modelDescription.xml").decode()
    options = {"input": inputs, "output": [*COLUMNS, "measured_rate_deg_per_s", *more], "start_values": start}
    options |= {"stop_time": TIME[-1], "step_size": 1.0, "output_interval": 1.0}
    return fmpy.simulate_fmu(str(path), validate=True, fmi_type="CoSimulation", **options), text


def driven(rate=0.0):
    """What the FMU is given, as the drive of a simulation, at a rate in °/s."""
    profile = Profile(TIME, LEVEL + 273.15)
    drive = drive_by_profile(profile, rows_of(profile, 1.0))
    return replace(drive, rate=AppliedRate.of(np.radians(rate), drive.time)) if rate else drive


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_limits_fmu_in_fmpy(version, tmp_path):
    """The official description is valid, and the FMU's outputs are the simulation's to 1e-9, with a parameter of the card changed."""
    path = tmp_path / "twin.fmu"
    assert main(["twin", "hrg-30mm-loops", "--fmu", str(path), "--fmi", version]) == 0
    assert path.stat().st_size < 1e6
    moved = {"thermal.mount_conductance_W_per_K": 0.02, "bias.damping_anisotropy": 0.02}
    found, text = simulate_fmpy(path, {"noise": False, **moved})
    instrument = load_card("hrg-30mm-loops").with_values(moved)
    drive = driven(0.01)
    run = simulate_run(instrument, drive, noise=False)
    expected = dict(run.prediction.columns) | {"housing_temperature_degC": run.prediction.housing - 273.15}
    assert found["time"].size == drive.time.size
    for name in COLUMNS:
        assert np.abs(found[name] - expected[name]).max() < 1e-9 * np.abs(expected[name]).max(), name
    assert 'unit="W/K"' in text
    assert 'unit="1" min="0.0" max="1.0" start="0.03"' in text  # of the emissivity, as in the card
    with pytest.raises(Exception, match="ExitInitializationMode failed"):
        simulate_fmpy(path, {"thermal.film_emissivity": -1.0})


CHECKERS = [("fmuCheck.linux64", "2.0", ["-h", "1", "-s", "600"]), *(
    ("fmusim", version, ["--interface-type", "cs", "--stop-time", "600", "--output-interval", "1", "--output-file", "out.csv"])
    for version in ("2.0", "3.0")
)]  # fmt: skip
"""The FMI project's own: FMUChecker 2.0.4 and fmusim of the Reference FMUs; neither is a package, both are built from source."""


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize("mode", ["force-rebalance", "whole-angle"])
@pytest.mark.parametrize(("checker", "version", "words"), CHECKERS, ids=lambda one: one if isinstance(one, str) else "")
def test_contract_official_checkers(checker, version, words, mode, tmp_path):
    """No error and no warning, and every row is there."""
    if (program := shutil.which(checker)) is None:
        pytest.skip(f"{checker} is not on the path")
    path = tmp_path / "twin.fmu"
    assert fmus.write_fmu(plan_twin(load_card("hrg-30mm-loops").with_table("loop", {"mode": mode})), path, version)
    done = subprocess.run([program, *words, path], cwd=tmp_path, capture_output=True, text=True, check=False)
    said = done.stdout + done.stderr
    assert done.returncode == 0, said
    if checker == "fmusim":
        assert "rror" not in said
        assert len((tmp_path / "out.csv").read_text().splitlines()) == 602
    else:
        assert "0 Warning(s)" in said
        assert "0 Error(s)" in said


@needs_compiler
@pytest.mark.slow
def test_contract_fmu_draws_by_its_seed(tmp_path):
    """Noise is on by default; a seed repeats its run."""
    path = tmp_path / "twin.fmu"
    fmus.write_fmu(plan_twin(load_card("free-dome")), path, "3.0")
    one, again, other = (simulate_fmpy(path, {"seed": seed})[0]["frequency_Hz"] for seed in (1, 1, 2))
    assert np.array_equal(one, again)
    assert 0.5 < np.std(one - other) / (2e-3 * np.sqrt(2)) < 2.0


def _names_of_inputs(path):
    with zipfile.ZipFile(path) as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    return [one.get("name") for one in root.iter() if one.get("causality") == "input"]


@pytest.mark.parametrize("boundary", ["chamber", "housing"])
def test_contract_the_inputs_that_are_told_are_those_of_the_fmu(tmp_path, ask, boundary, monkeypatch):
    monkeypatch.setattr(fmus, "compiler", lambda: None)  # the description is read, and nothing run
    path = tmp_path / "twin.fmu"
    told = ask(["twin", "hrg-30mm", "--fmu", path, "--boundary", boundary])["inputs"]
    assert [one["name"] for one in told] == _names_of_inputs(path)
    source = ask(["twin", "hrg-30mm", "--c", tmp_path / "c", "--boundary", boundary])
    assert source["inputs"][0]["name"] == f"{boundary}_temperature_degC"


def test_contract_without_compiler(tmp_path, monkeypatch, capsys, ask):
    """The FMU then has its sources only, and the command says so."""
    monkeypatch.setattr(fmus, "compiler", lambda: None)
    path = tmp_path / "twin.fmu"
    assert ask(["twin", "free-dome", "--fmu", path])["compiled"] is False
    assert main(["twin", "free-dome", "--fmu", str(path)]) == 0
    assert "no C compiler" in " ".join(capsys.readouterr().out.split())
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
    assert not [name for name in names if name.startswith("binaries")]
    assert {"modelDescription.xml", "sources/fmi.c", "sources/card.c", "sources/buildDescription.xml"} <= set(names)


def test_contract_failure_keeps_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "twin.fmu"
    path.write_text("old")
    monkeypatch.setattr(fmus, "compiler", lambda: None)
    monkeypatch.setattr(
        zipfile.ZipFile, "writestr", lambda *_, **__: (_ for _ in ()).throw(OSError(28, "No space left on device"))
    )
    assert main(["twin", "free-dome", "--fmu", str(path)]) == 2
    assert path.read_text() == "old"
    assert [one.name for one in tmp_path.iterdir()] == ["twin.fmu"]


@pytest.mark.slow
@needs_compiler
def test_limits_turning_wave_in_fmpy(tmp_path):
    """Whole angle at a rate, the precession commanded by an input in place of the card's, and a parameter changed."""
    path = tmp_path / "twin.fmu"
    loop = {"mode": "whole-angle", "self_precession_deg_per_s": 0.1, "pickoff_gain_ratio": 0.01}
    instrument = load_card("hrg-30mm-loops").with_table("loop", loop)
    plan = plan_twin(instrument)
    assert idle_input(plan) == "commanded_pattern_angle_deg"
    fmus.write_fmu(plan, path, "3.0")
    start = {"noise": False, "loop.drive_gain_ratio": -0.02, "commanded_precession_deg_per_s": 0.3}
    found, _ = simulate_fmpy(path, start, "pattern_angle_deg")
    drive = driven(0.01)
    moved = {"loop.drive_gain_ratio": -0.02, "loop.self_precession_deg_per_s": 0.3}
    expected = simulate_run(instrument.with_values(moved), drive, noise=False).prediction.columns
    assert np.abs(found["pattern_angle_deg"] - expected["pattern_angle_deg"]).max() < 1e-9 * 1620
    bias = expected["bias_deg_per_h"]
    assert np.abs(found["bias_deg_per_h"][1:] - bias[:-1]).max() < 1e-9 * np.abs(bias).max()


@pytest.mark.slow
@needs_compiler
def test_limits_fmu_of_a_card_that_ages(tmp_path):
    """An effect with a date goes on from it where `start_s` says when the run begins; a card without dates has no such parameter."""
    path, since, moment = tmp_path / "twin.fmu", "2026-03-01T12:00:00+00:00", 1772712000.0  # four days later
    drift = {"name": "clock-drift", "drift_Hz_per_day": 0.5, "since": since}
    instrument = load_card("free-dome").with_table("effect", [drift])
    fmus.write_fmu(plan_twin(instrument), path, "3.0")
    drive = driven()
    for start, moved in (({}, 0.0), ({"start_s": moment}, 2.0)):
        found, text = simulate_fmpy(path, {"noise": False, **start})
        run = simulate_run(instrument, replace(drive, moment=start.get("start_s")), noise=False)
        expected = run.prediction.columns["frequency_Hz"]
        assert np.abs(found["frequency_Hz"] - expected).max() < 1e-9 * expected.max()
        assert expected[-1] - 0.5 * TIME[-1] / 86400 - moved == pytest.approx(
            simulate_run(instrument.with_table("effect", []), drive, noise=False).prediction.columns["frequency_Hz"][-1]
        )
    assert '"start_s"' in text
    assert "start_s" not in fmus.describe(plan_twin(load_card("free-dome")), "3.0", "name", "token")


@pytest.mark.slow
@needs_compiler
def test_contract_strange_names(tmp_path):
    """A card's name can hold what would end a text of C, a comment or an attribute; the FMU compiles and its description is XML."""
    path = tmp_path / "twin.fmu"
    strange = replace(load_card("free-dome"), name='a"\\ */ ??/ %s <b> é \x07\n#define x')
    assert fmus.write_fmu(plan_twin(strange), path, "2.0")
    with zipfile.ZipFile(path) as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    assert "%s <b> é" in root.get("modelName")
