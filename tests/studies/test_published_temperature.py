"""`hrg temperature`: the HRG paper's Table 2 from its Table 1, a simulated run's own temperature, bad input named."""

import numpy as np
import pytest

from studies.cli import main
from studies.papers import hrg
from studies.record import read_record

TABLE1 = "studies/papers/hrg_table1.csv"
TABLE2 = [-19.976, -10.058, -0.003, 10.071, 20.011, 29.924, 40.031]  # HRG paper, Table 2, calculated (theory: checked)


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "f.toml"
    assert main(["fit", "frequency", TABLE1, "--save", str(path)]) == 0
    return str(path)


@pytest.mark.slow
def test_a_simulated_resonator_is_its_own_thermometer(tmp_path, ask):
    """The curve is fitted to settled points of the same virtual gyro; the ramp in between is then read from f alone."""
    soak = "time_s,chamber_temperature_degC\n0,-20\n9000,-20\n9001,40\n70000,40\n70001,-20\n"
    (tmp_path / "p.csv").write_text(soak.replace("70001,-20\n", "90000,10\n"))
    assert main(["simulate", "hrg-30mm", str(tmp_path / "p.csv"), "--row", "20", "--out", str(tmp_path / "r.csv")]) == 0
    record = read_record(tmp_path / "r.csv")
    T, f = record["resonator_temperature_degC"], record["frequency_Hz"]
    points = [int(np.argmin(np.abs(T - x))) for x in (-19.9, -10, 0, 10, 20, 30, 39.9)]
    table = "temperature_degC,frequency_Hz\n" + "".join(f"{T[k]},{f[k]}\n" for k in points)
    (tmp_path / "table.csv").write_text(table)
    assert main(["fit", "frequency", str(tmp_path / "table.csv"), "--save", str(tmp_path / "m.toml")]) == 0
    out = ["--out", tmp_path / "o.csv", "--report", tmp_path / "o.html"]
    payload = ask(["temperature", tmp_path / "m.toml", tmp_path / "r.csv", *out])
    assert payload["schema"] == "hrg.temperature/1"
    assert payload["rms_difference_from_simulated_K"] < 0.05  # of 60 K; the unevenness of the shell while it cools
    assert "<svg" in (tmp_path / "o.html").read_text() or "data:image" in (tmp_path / "o.html").read_text()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time_s,frequency_Hz\n0,4430\n1,4600\n", "outside 4415"),
        ("time_s,bias_deg_per_h\n0,1\n1,2\n", "'frequency_Hz' is missing"),
        ("time_s,frequency_Hz\n0,\n1,\n", "has no value"),
    ],
)
def test_what_cannot_be_read_is_named(model, tmp_path, refuse, text, message):
    (tmp_path / "run.csv").write_text(text)
    assert message in refuse(["temperature", model, str(tmp_path / "run.csv"), "--out", str(tmp_path / "o.csv")])
    assert not (tmp_path / "o.csv").exists()


def test_a_curve_that_turns_round_is_not_inverted(tmp_path, capsys):
    T = np.arange(-20.0, 41.0, 10.0)
    rows = "".join(f"{t},{4430 - 0.01 * (t - 10) ** 2}\n" for t in T)
    (tmp_path / "t.csv").write_text("temperature_degC,frequency_Hz\n" + rows)
    assert main(["fit", "frequency", str(tmp_path / "t.csv"), "--order", "2", "--save", str(tmp_path / "m.toml")]) in (
        0,
        2,
    )
    if (tmp_path / "m.toml").exists():
        (tmp_path / "r.csv").write_text("time_s,frequency_Hz\n0,4428\n1,4429\n")
        assert main(["temperature", str(tmp_path / "m.toml"), str(tmp_path / "r.csv"), "--json"]) == 2
    assert "turning point" in capsys.readouterr().err


def test_a_model_of_another_gyro_is_doubted(model, tmp_path, capsys):
    """The record's own temperature is 5 K off what the model reads, a hundred times the uncertainty of its curve."""
    path = tmp_path / "r.csv"
    rows = "".join(f"{10 * k},4432.07,25.0\n" for k in range(20))
    path.write_text("time_s,frequency_Hz,resonator_temperature_degC\n" + rows)
    assert main(["temperature", model, str(path), "--out", str(tmp_path / "o.csv")]) == 0
    assert "times the uncertainty of the curve: is the model of this gyro?" in capsys.readouterr().out


T, F = hrg.printed_table1()
STUDY = hrg.study_table(T, F, resolution=hrg.RESOLUTION)


def test_local_slopes_have_their_published_values():
    """Theory sheet: slopes between neighbours over the local frequency, each ± 0.09 from rounding."""
    np.testing.assert_allclose(STUDY.local_slope_ppm, [92.3, 87.0, 82.7, 79.2, 78.7, 82.0], atol=0.06)
    assert float(STUDY.fit.slope_ppm(20.0)) == pytest.approx(79.2, abs=0.05)
    assert float(STUDY.fit.slope_ppm(0.0)) == pytest.approx(84.0, abs=0.05)


@pytest.mark.parametrize(("f", "mistake"), [(F, 54.0), (4400 + 0.3 * T - 1e-4 * T**2, 1.0)])
def test_planted_a_mistyped_reading_is_named_by_its_row(tmp_path, capsys, f, mistake):
    """The printed table with two digits exchanged had a curve that turns, and no row to look at; 1 Hz of an exact table was not noticed."""
    rows = "".join(
        f"{a:g},{b:.2f}\n" for a, b in zip(T, f + np.where(np.arange(T.size) == 3, mistake, 0.0), strict=True)
    )
    (tmp_path / "t.csv").write_text(f"temperature_degC,frequency_Hz\n{rows}")
    assert main(["fit", "frequency", str(tmp_path / "t.csv")]) == (2 if mistake > 2 else 0)
    said = " ".join("".join(capsys.readouterr()).split())
    assert f"{f[3] + mistake:.2f} Hz at {T[3]:g} °C is {mistake:+.0f} Hz from the curve" in said
