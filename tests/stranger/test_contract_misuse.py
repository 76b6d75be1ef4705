"""What a user who misunderstands is told, and what stays whole: files of this test's own making."""

import numpy as np
import pytest

from studies.cli import main
from tests.tables import write_columns


def _frequency(T):
    return 4424.7 + 0.352 * T - 6.1e-4 * T**2 + 8.0e-6 * T**3


@pytest.fixture
def model(tmp_path):
    T = np.array([-40.0, -25.0, -10.0, 5.0, 20.0, 35.0, 50.0, 65.0])
    table = write_columns(tmp_path / "table.csv", {"temperature_degC": T, "frequency_Hz": _frequency(T)})
    assert main(["fit", "frequency", table, "--save", str(tmp_path / "model.toml")]) == 0
    return str(tmp_path / "model.toml")


def test_a_glitch_costs_its_own_row_alone(model, tmp_path, capsys):
    T = 20.0 + np.arange(120.0) / 20
    f = _frequency(T)
    f[30], f[50] = 5000.0, np.nan
    run, out = (
        write_columns(tmp_path / "run.csv", {"time_s": 30.0 * np.arange(120), "frequency_Hz": f}),
        tmp_path / "out.csv",
    )
    assert main(["compensate", model, run, "--out", str(out)]) == 2
    assert not out.exists()
    assert main(["compensate", model, run, "--out", str(out), "--extrapolate"]) == 0
    assert "2 rows stay empty" in capsys.readouterr().out
    found = np.genfromtxt(out, delimiter=",", names=True)["resonator_temperature_degC"]
    assert np.flatnonzero(np.isnan(found)).tolist() == [30, 50]
    assert np.nanmax(np.abs(found - T)) < 1e-4


def test_a_record_without_any_frequency_is_refused(model, tmp_path, refuse):
    run = write_columns(tmp_path / "run.csv", {"time_s": np.arange(9.0), "frequency_Hz": np.full(9, np.nan)})
    for command in ("compensate", "temperature"):
        assert "'frequency_Hz' has no value" in refuse([command, model, run, "--out", str(tmp_path / "out.csv")])
    assert not (tmp_path / "out.csv").exists()
