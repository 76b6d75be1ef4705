"""`hrg fit bias` and `hrg compensate` from record files to model, C source, page and compensated record."""

import ctypes
import re

import numpy as np
import pytest
import scipy

from studies.cli import main
from studies.models import compensate, emit_c, read_model
from studies.record import Record, read_record, write_record
from tests.compiled import compile_c

TIME = np.arange(0.0, 18000.0, 5.0)


def make_record(seed, cooling=True, spoil=None):
    """Frequency after a step of temperature; bias with a planted f and ḟ term, white noise 0.4 deg/h."""
    rng = np.random.default_rng(seed)
    response = 1 - (3000 * np.exp(-TIME / 3000) - 900 * np.exp(-TIME / 900)) / 2100
    change = 17.0 * (response if not cooling else -response) + (0.0 if cooling else -17.0)
    rate = np.gradient(change, TIME)
    columns = {
        "time_s": TIME,
        "frequency_Hz": 4433.0 + change + 0.003 * rng.normal(size=TIME.size),
        "bias_deg_per_h": 1.0 + 0.3 * change - 500 * rate + 0.4 * rng.normal(size=TIME.size),
    }
    if spoil:
        spoil(columns)
    return Record(columns)


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bias")
    for k in range(3):
        write_record(make_record(k, cooling=k != 1), folder / f"run{k}.csv")
    arguments = [str(folder / f"run{k}.csv") for k in range(3)]
    options = {"save": "m.toml", "report": "page.html"}
    for name, file in options.items():
        arguments += [f"--{name}", str(folder / file)]
    assert main(["fit", "bias", *arguments]) == 0
    return folder


def test_the_saved_model_holds_the_planted_coefficients(calibrated):
    model = read_model(calibrated / "m.toml")
    part = model.part("bias")
    assert part.names == ("constant", "f", "fdot")
    errors = dict(zip(part.names, part.standard_errors, strict=True))
    assert abs(part["f"] - 0.3) < 4 * errors["f"]
    assert abs(part["fdot"] + 500) < 4 * errors["fdot"]
    assert [source.rows for source in model.sources] == [TIME.size] * 3
    assert model.settings["rate_lag_s"] == 0.0


def test_a_compensated_record_is_flat_and_complete(calibrated, tmp_path, ask):
    out = tmp_path / "out.csv"
    payload = ask(["compensate", calibrated / "m.toml", calibrated / "run1.csv", "--out", out])
    column = payload["columns"]["compensated_bias_deg_per_h"]
    assert column["rows_not_compensated"] == 0
    assert column["stability_before"] > 1.0
    assert column["stability_after"] < 0.13  # white noise alone: 0.4/√20 = 0.089
    again = read_record(out)
    assert again["bias_deg_per_h"] == pytest.approx(read_record(calibrated / "run1.csv")["bias_deg_per_h"], abs=1e-12)


@pytest.fixture(scope="module")
def causal(calibrated):
    runs = [str(calibrated / f"run{k}.csv") for k in range(3)]
    assert main(["fit", "bias", *runs, "--causal", "--save", str(calibrated / "causal.toml")]) == 0
    return read_model(calibrated / "causal.toml")


def compiled(source, folder):
    """Return the emitted source as a library, after its own test has passed."""
    library = compile_c(source, folder, " 0 differ")
    library.hrg_compensate.restype = library.hrg_bias.restype = ctypes.c_double
    return library


def run_c(library, time, output, value):
    """Feed a record to the emitted code, sample by sample; NaN where it says that it is not ready."""
    state, ok, number = ctypes.create_string_buffer(1 << 16), ctypes.c_int(), ctypes.c_double
    library.hrg_bias_reset(state)
    found = np.full(time.size, np.nan)
    for k in range(time.size):
        result = library.hrg_compensate(state, number(time[k]), number(output[k]), number(value[k]), ctypes.byref(ok))
        found[k] = result if ok.value else np.nan
    return found


@pytest.mark.parametrize("spacing", ["even", "uneven with holes", "slower than a block"])
def test_the_c_code_computes_what_the_causal_model_computes(calibrated, causal, tmp_path, spacing):
    """Sample by sample through a whole record; the two were 3.7e-4 °/h apart when only one of them averaged."""
    record = read_record(calibrated / "run1.csv")
    time, f, output = record["time_s"], record["frequency_Hz"].copy(), record["bias_deg_per_h"]
    rows = {"even": slice(None), "slower than a block": slice(None, None, 7)}.get(spacing, slice(None))
    time, f, output = time[rows], f[rows], output[rows]
    if spacing == "uneven with holes":
        time = time + np.random.default_rng(1).uniform(-2, 2, time.size)
        f[40:60], f[1000:1200] = np.nan, np.nan
    expected = compensate(causal, Record({"time_s": time, "frequency_Hz": f, "bias_deg_per_h": output}))
    found = run_c(compiled(emit_c(causal), tmp_path), time, output, f)
    assert np.array_equal(np.isnan(found), np.isnan(expected["compensated_bias_deg_per_h"]))
    assert np.mean(np.isfinite(found)) > 0.9
    np.testing.assert_allclose(found, expected["compensated_bias_deg_per_h"], atol=1e-9, rtol=0)


def make_thermometer_gyro(seed, cooling, loop=1.5, lag=200.0):
    """A gyro without a measured frequency: bias of second order in the temperature behind a lag, and of its loop."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 28800.0, 10.0)
    T = np.interp(
        time,
        [0, 3000, 12000, 16000, 25000, 28800],
        [20, 20, 60, 60, -20, -20] if cooling else [-20, -20, 60, 60, 10, 10],
    )
    inner = np.empty_like(T)
    inner[0] = T[0]
    for k in range(1, T.size):  # own integrator: implicit Euler
        inner[k] = (inner[k - 1] + 10.0 / lag * T[k]) / (1 + 10.0 / lag)
    back = np.empty_like(T)
    back[0] = inner[0]
    for k in range(1, T.size):
        back[k] = np.clip(back[k - 1], inner[k] - 4.0, inner[k] + 4.0)
    bias = 30 - 2.0 * (inner - 20) + 0.03 * (inner - 20) ** 2 + loop * (back - inner) + 1.5 * rng.normal(size=T.size)
    return Record(
        {"time_s": time, "housing_temperature_degC": T + 0.01 * rng.normal(size=T.size), "bias_deg_per_h": bias}
    )


def make_cycled_gyro(seed, lag, width, start):
    """Bias 5 + 0.3 x + 0.01 x², x = y − 10 °C, of a temperature y behind a lag and a backlash, which does not start in its middle."""
    rng, time, own = np.random.default_rng(seed), np.arange(0.0, 18000.0, 10.0), 1 if seed % 2 else -1
    knots = [0, 600, 3600, 5400, 8400, 10200, 13200, 15000, 18000]
    chamber = 5 + 20 * own * np.array([1, 1, -1, -1, 1, 1, -1, -1, 1])
    T = scipy.signal.lfilter([1 - 0.98], [1, -0.98], np.interp(time, knots, chamber), zi=[0.98 * chamber[0]])[0]
    inner, back = T.copy(), T + start * own * width
    for k in range(1, T.size):
        if lag:
            inner[k] = inner[k - 1] + (1 - np.exp(-10.0 / lag)) * (0.5 * (T[k] + T[k - 1]) - inner[k - 1])
        back[k] = np.clip(back[k - 1], inner[k] - width, inner[k] + width)
    bias = truth(back) + rng.normal(size=T.size)
    return Record(
        {"time_s": time, "housing_temperature_degC": T + 0.01 * rng.normal(size=T.size), "bias_deg_per_h": bias}
    )


def truth(inner):
    return 5 + 0.3 * (inner - 10) + 0.01 * (inner - 10) ** 2


@pytest.mark.slow
@pytest.mark.parametrize(("lag", "width", "start"), [(700.0, 0.0, 0.0), (0.0, 2.0, 1.0)])
def test_a_lag_and_a_play_between_the_points_of_a_grid_leave_the_static_curve_alone(tmp_path, ask, lag, width, start):
    """Both come back; soaks, which the lag of a grid misses by 1.7 °/h, are known as well as the noise lets them be."""
    names = [str(tmp_path / f"r{k}.csv") for k in range(3)]
    for k, name in enumerate(names):
        write_record(make_cycled_gyro(k, lag, width, start), name)
    answer = ask(["fit", "bias", *names, "--save", tmp_path / "m.toml"])
    found = {"lag_s": ("lag_90_s", lag), "play_half_width_degC": ("play_half_width_90_degC", width)}
    for key, (ends, planted) in found.items():
        assert (answer[key] > 0) == (answer[ends] is not None) == (planted > 0)
        if planted:
            low, high = answer[ends]
            assert low < answer[key] < high < low + 0.2 * planted
            assert abs(answer[key] - planted) < 1.5 * (high - low)  # five standard deviations
    time = np.arange(0.0, 36000.0, 10.0)
    T = np.interp(time, [0, 9000, 10000, 18000, 19000, 27000, 28000, 36000], [25, 25, 15, 15, 5, 5, -5, -5])
    rest = Record({"time_s": time, "housing_temperature_degC": T, "bias_deg_per_h": np.zeros_like(T)})
    predicted = -compensate(read_model(tmp_path / "m.toml"), rest)["compensated_bias_deg_per_h"]
    for soak in (17500.0, 26500.0, 35500.0):
        row = int(soak / 10)
        assert predicted[row] == pytest.approx(truth(T[row] + width), abs=0.2)


@pytest.mark.slow
def test_a_gyro_without_a_frequency_is_fitted_over_its_temperature(tmp_path, ask):
    """Law, lag and loop planted by another integrator; judged on an unseen run by what noise leaves: 1.5/√10."""
    names = []
    for k in range(4):
        write_record(make_thermometer_gyro(k, cooling=k % 2 == 0), tmp_path / f"r{k}.csv")
        names.append(str(tmp_path / f"r{k}.csv"))
    model = str(tmp_path / "m.toml")
    payload = ask(["fit", "bias", *names[:3], "--causal", "--save", model, "--report", tmp_path / "p.html"])
    assert payload["over"] == "housing_temperature_degC"
    assert 100 <= payload["lag_s"] <= 500
    assert payload["play_half_width_degC"] > 0
    assert payload["methods"]["guarded"]["held_out"]["gain"] > 20
    assert main(["compensate", model, names[3], "--out", str(tmp_path / "o.csv"), "--extrapolate"]) == 0
    after = read_record(tmp_path / "o.csv")["compensated_bias_deg_per_h"]
    after = after[np.isfinite(after)][60:]
    assert np.std(after[: after.size // 10 * 10].reshape(-1, 10).mean(axis=1)) < 1.5
    fitted = read_model(model)
    record = read_record(names[3])
    found = run_c(
        compiled(emit_c(fitted), tmp_path),
        record["time_s"],
        record["bias_deg_per_h"],
        record["housing_temperature_degC"],
    )
    expected = compensate(fitted, record, extrapolate=True)["compensated_bias_deg_per_h"]
    both = np.isfinite(found)
    np.testing.assert_allclose(found[both], expected[both], atol=1e-8, rtol=0)


def test_a_short_run_is_fitted_without_an_allan_deviation(tmp_path, hear):
    """Twenty-five rows are enough for a law of first order; what they cannot give is left out, and said."""
    rng, time = np.random.default_rng(3), np.arange(25) * 100.0
    f = 4430 + 3 * time / time[-1]
    bias = 2 + 5 * (f - 4430) + 0.1 * rng.normal(size=25)
    write_record(Record({"time_s": time, "frequency_Hz": f, "bias_deg_per_h": bias}), tmp_path / "r.csv")
    payload, said = hear(["fit", "bias", tmp_path / "r.csv", "--report", tmp_path / "p.html"])
    assert payload["allan"] is None
    assert payload["methods"]["guarded"]["coefficients"][1] == pytest.approx(5, abs=0.5)
    assert "The data are short: 2" in said


def test_a_rate_output_is_fitted_in_its_own_unit(tmp_path, capsys):
    def spoil(columns):
        columns["measured_rate_deg_per_s"] = columns.pop("bias_deg_per_h") / 3600
        columns["measured_rate_deg_per_s"][100:110] = np.nan

    record = make_record(6, spoil=spoil)
    write_record(record, tmp_path / "run.csv")
    model, out = str(tmp_path / "m.toml"), tmp_path / "o.csv"
    assert main(["fit", "bias", str(tmp_path / "run.csv"), "--save", model]) == 0
    part = read_model(model).part("bias")
    assert part["f"] == pytest.approx(0.3 / 3600, rel=0.05)
    assert part.units[1] == "deg/s/Hz"
    assert main(["compensate", model, str(tmp_path / "run.csv"), "--out", str(out), "--json"]) == 0
    after = read_record(out)["compensated_measured_rate_deg_per_s"]
    assert np.flatnonzero(np.isnan(after)).tolist() == list(range(100, 110))


def test_the_page_says_where_its_coefficients_are_read_and_the_range_that_is_enforced(calibrated):
    """In °/√h and °/h/√h the line of N is read at one hour, that of K at three; the saved model refuses what lies outside its range."""
    from tests.golden.answers import _Text

    reader = _Text()
    reader.feed((calibrated / "page.html").read_text(encoding="utf-8"))
    page = " ".join(reader.lines)
    assert "N is the value at τ = 1 h" in page
    assert "K the value at τ = 3 h" in page
    said = re.search(r"Valid from ([\d.]+) to ([\d.]+) Hz", page)
    assert said is not None
    assert [float(end) for end in said.groups()] == pytest.approx(
        read_model(calibrated / "m.toml").range_of("frequency_Hz"), rel=1e-6
    )


def test_one_cooling_run_is_not_applied_to_a_warming_one(calibrated, tmp_path, refuse):
    run, warming, model = (str(calibrated / n) for n in ("run0.csv", "run1.csv", "one.toml"))
    assert main(["fit", "bias", run, "--causal", "--save", model]) == 0
    assert read_model(model).settings["rate_lag_s"] == 150.0
    out = str(tmp_path / "c.csv")
    assert "frequency_rate_Hz_per_s runs from" in refuse(["compensate", model, warming, "--out", out])
    assert not (tmp_path / "c.csv").exists()
    assert main(["compensate", model, warming, "--out", out, "--extrapolate"]) == 0
    assert main(["compensate", model, run, "--out", out]) == 0  # its own run lies inside


def test_gaps_missing_values_and_spikes_do_not_harm(tmp_path, ask):
    def spoil(columns):
        columns["bias_deg_per_h"][[500, 900]] = 1e4, -1e4
        columns["frequency_Hz"][700:720] = np.nan
        for name in columns:
            columns[name] = np.delete(columns[name], slice(1500, 1900))

    write_record(make_record(4, spoil=spoil), tmp_path / "run.csv")
    model = str(tmp_path / "m.toml")
    payload = ask(["fit", "bias", str(tmp_path / "run.csv"), "--save", model])
    assert (payload["spikes"], payload["missing"]) == (2, 20)
    assert payload["methods"]["guarded"]["coefficients"][1] == pytest.approx(0.3, abs=0.02)
    assert main(["compensate", model, str(tmp_path / "run.csv"), "--out", str(tmp_path / "o.csv")]) == 0


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda c: c.pop("frequency_Hz"), "housing_temperature_degC"),
        (lambda c: c.pop("bias_deg_per_h"), "no column bias_deg_per_h or measured_rate_deg_per_s"),
        (lambda c: c.update(frequency_Hz=np.full(TIME.size, 4433.0)), "frequency is constant"),
        (lambda c: c.update(frequency_Hz=-c["frequency_Hz"]), "is not a possible reading (allowed: 1e-06 to 1e+12)"),
        (lambda c: c.update(frequency_Hz=c["frequency_Hz"] / 1000), "is it in kHz"),
        (lambda c: c.update(rate_deg_per_s=np.full(TIME.size, 10.0)), "runs at rest"),
        (lambda c: c.update({k: v[:9] for k, v in c.items()}), "of which a run needs 3 or more"),
        (lambda c: c.update(frequency_Hz=np.full(TIME.size, np.nan)), "only 0 rows"),
    ],
)
def test_unusable_records_are_refused_with_their_file(spoil, message, tmp_path, refuse):
    write_record(make_record(5, spoil=spoil), tmp_path / "run.csv")
    error = refuse(["fit", "bias", str(tmp_path / "run.csv"), "--save", str(tmp_path / "m.toml")])
    assert message in error
    assert not (tmp_path / "m.toml").exists()


def test_compensate_says_what_it_needs(calibrated, tmp_path, refuse):
    model, run = str(calibrated / "m.toml"), str(calibrated / "run0.csv")
    assert main(["compensate", model]) == 2
    assert "--out" in refuse(["compensate", model, run])
    assert main(["compensate", model, "--emit", str(tmp_path / "m.c")]) == 0
    text = (calibrated / "m.toml").read_text(encoding="utf-8").replace('"fdot"', '"fdott"')
    (tmp_path / "bad.toml").write_text(text, encoding="utf-8")
    assert "unknown term 'fdott'; did you mean 'fdot'" in refuse(
        ["compensate", str(tmp_path / "bad.toml"), run, "--out", str(tmp_path / "o.csv")]
    )


def test_every_run_is_drawn():
    """Four runs are four pairs of pictures."""
    from studies.fits.bias import study_bias
    from studies.reports.bias import runs_figure

    study = study_bias([make_record(k, cooling=k % 2 == 0) for k in range(4)])
    figure = runs_figure(study, "guarded").draw()
    assert [axes.get_title() for axes in figure.axes if axes.get_title()] == [f"run {k}" for k in range(1, 5)]


def test_a_compensation_of_the_opposite_sign_is_refused(calibrated, tmp_path, capsys):
    """The model's terms with their signs turned double the error that they should take away."""
    run, out = calibrated / "run0.csv", tmp_path / "out.csv"
    assert main(["compensate", str(calibrated / "m.toml"), str(run), "--out", str(out)]) == 0
    assert "worse" not in capsys.readouterr().err
    flipped = tmp_path / "flipped.csv"
    record = read_record(run)
    write_record(record.with_columns({"bias_deg_per_h": -record["bias_deg_per_h"]}), flipped)
    out.unlink()
    assert main(["compensate", str(calibrated / "m.toml"), str(flipped), "--out", str(out)]) == 2
    assert "bias_deg_per_h has the opposite sign: the correction brings" in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize(("factor", "unit"), [(1 / 3600, "°/s"), (24.0, "°/day"), (1000.0, "m°/h"), (0.3, "")])
def test_a_model_applied_to_a_bias_in_another_unit_is_refused_with_the_factor(
    calibrated, tmp_path, capsys, factor, unit
):
    """The run it was fitted to, in °/s: 'worse than the record' once, and the output written; in °/day nothing was said. A gyro of a third of the bias is no other unit."""
    record, out, other = read_record(calibrated / "run0.csv"), tmp_path / "out.csv", tmp_path / "other.csv"
    write_record(record.with_columns({"bias_deg_per_h": factor * record["bias_deg_per_h"]}), other)
    status = main(["compensate", str(calibrated / "m.toml"), str(other), "--out", str(out)])
    said = capsys.readouterr().err
    assert (status, out.exists()) == ((2, False) if unit else (0, True))
    mend = f"Multiply the column by {1 / factor:.6g}" if factor < 1 else f"Divide the column by {factor:.6g}"
    assert (f"bias_deg_per_h is in {unit}:" in said and mend in said) == bool(unit)


def test_a_record_in_hours_is_not_compensated(calibrated, tmp_path, refuse):
    """'time' has 1 row, it said."""
    record, hours = read_record(calibrated / "run0.csv"), tmp_path / "hours.csv"
    warm = 20.0 + 40.0 * np.sin(record["time_s"] / 3000.0)
    write_record(record.with_columns({"time_s": record["time_s"] / 3600.0, "housing_temperature_degC": warm}), hours)
    said = refuse(["compensate", str(calibrated / "m.toml"), str(hours), "--out", str(tmp_path / "out.csv")])
    assert "is it in minutes or hours" in said


@pytest.mark.parametrize(("factor", "unit"), [(1 / 3600, "°/s"), (24.0, "°/day"), (np.pi / 648000, "rad/s")])
@pytest.mark.parametrize("count", [2, 3])
def test_a_run_in_another_unit_is_refused(tmp_path, refuse, factor, unit, count):
    """One of three in °/day once left no term, and a model that removed the mean."""
    runs = [str(tmp_path / f"{k}.csv") for k in range(count)]
    for k, path in enumerate(runs):
        record = make_record(k, cooling=k != 1)
        write_record(
            record.with_columns({"bias_deg_per_h": record["bias_deg_per_h"] * (factor if k == 1 else 1.0)}), path
        )
    said = refuse(["fit", "bias", *runs])
    assert f"hrg: {runs[1]}: bias_deg_per_h scatters and changes" in said
    mend = f"Multiply the column by {1 / factor:.6g}" if factor < 1 else f"Divide the column by {factor:.6g}"
    assert f"as in {unit}. {mend}" in said


@pytest.mark.parametrize(("by", "said"), [(1800.0, "read 0.5 h later"), (-3600.0, "read 1 h earlier"), (0.0, "")])
def test_a_frequency_of_another_clock_is_doubted(calibrated, tmp_path, capsys, by, said):
    run = read_record(calibrated / "run1.csv")
    late = np.interp(run["time_s"] - by, run["time_s"], run["frequency_Hz"])
    write_record(run.with_columns({"frequency_Hz": late}), tmp_path / "run.csv")
    assert (
        main(["compensate", *map(str, (calibrated / "m.toml", tmp_path / "run.csv", "--out", tmp_path / "o.csv"))]) == 0
    )
    told = capsys.readouterr().err
    assert ("by another clock" in told, said in told) == (bool(by), True)
