"""The names that packages offer from Python: each is there, imported only when used, and does what the command does."""

import importlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import compensation
import compensation.derivation
import shell
import shell.derivation
import studies
import studies.papers
import thermal
from studies.cli import main
from studies.record import read_record

PACKAGES = {
    "shell": shell,
    "thermal": thermal,
    "compensation": compensation,
    "studies": studies,
    "shell.derivation": shell.derivation,
    "compensation.derivation": compensation.derivation,
}


@pytest.mark.parametrize("package", PACKAGES)
def test_every_name_is_there_and_listed(package):
    module = PACKAGES[package]
    assert 5 < len(module.__all__) < 25
    for name in module.__all__:
        assert getattr(module, name).__name__ == name
    assert set(module.__all__) <= set(dir(module))


def test_packages_import_nothing_heavy():
    code = f"import {', '.join(PACKAGES)}, sys; print([m for m in ('numpy', 'scipy', 'sympy', 'pyvista', 'matplotlib') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_simulate_is_the_command(tmp_path):
    record = studies.simulate("hrg-30mm", "step 20 -10 1h", row=10, seed=3)
    assert (
        main(["simulate", "hrg-30mm", "step 20 -10 1h", "--row", "10", "--seed", "3", "--out", str(tmp_path / "r.csv")])
        == 0
    )
    for name, values in read_record(tmp_path / "r.csv").columns.items():
        assert np.array_equal(values, record[name])


def test_records_show_themselves_shortly_and_as_tables_and_pictures():
    record = studies.simulate(studies.load_card("free-dome"), "step 20 -10 1h", row=10)
    assert repr(record) == (
        "Record(free-dome, 361 rows over 1 h: time_s, chamber_temperature_degC, housing_temperature_degC,"
        " resonator_temperature_degC, frequency_Hz, bias_deg_per_h, inverse_q)"
    )
    frame = record.to_frame()
    assert frame.shape == (361, 7)
    assert frame.attrs["instrument"] == "free-dome"
    assert len(record.plot().axes) == 6
    assert "<table" in record._repr_html_()


@pytest.mark.slow
def test_results_show_themselves_shortly_and_as_tables(tmp_path):
    table = str(Path(studies.papers.__file__).parent / "hrg_table1.csv")
    comparison = studies.compare(["free-dome", "hrg-30mm"])
    calibration = studies.calibrate("hrg-30mm", [table])
    spec = {"schema": "hrg.study/1", "name": "s", "card": "free-dome", "sampling": {"method": "grid"}}
    spec |= {
        "parameter": [{"name": "resonator.radius_mm", "values": [15.0]}],
        "quantity": [{"name": "frequency", "theory": "shell"}],
    }
    study = studies.run_study(spec, out=tmp_path / "s", workers=1)
    shown = (
        (comparison, "Comparison(free-dome, hrg-30mm:"),
        (calibration, "Calibration(hrg-30mm: "),
        (studies.diagnose([table]), "TableDiagnosis(not-identifiable: "),
        (study, "Results(s: 1 of 1 cases, 0 failed)"),
    )
    for one, begins in shown:
        assert repr(one).startswith(begins)
        assert len(repr(one)) < 400
        assert len(one.to_frame()) > 0
        assert "<table" in one._repr_html_()
    for one in (calibration, shown[2][0], study):
        assert one.plot().axes
    (mode,) = shell.solve_modes(shell.hemisphere(radius=15e-3, thickness=0.9e-3), shell.Elastic(72.7e9, 0.17, 2203.0))
    assert repr(mode).startswith("Mode(n = 2, ")
    assert len(repr(mode)) < 120
    assert len(mode.plot().axes) == 1
    assert comparison.to_frame().loc["frequency, n = 2", "hrg-30mm"] == pytest.approx(4432.09, abs=0.1)


def test_a_module_that_is_no_name_is_still_a_module():
    assert importlib.import_module("shell.modes").solve_modes is shell.solve_modes
    with pytest.raises(AttributeError):
        _ = shell.no_such_name
