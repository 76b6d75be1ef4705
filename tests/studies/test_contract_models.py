"""Model files: what is saved is read back, what is broken is named, what is emitted compiles and agrees."""

import ctypes
import tomllib

import numpy as np
import pytest
from msgspec.structs import replace

from compensation.frequency import fit_frequency
from studies.cli import main
from studies.errors import InputError
from studies.models import Model, ModelSource, compensate, emit_c, format_model, make_part, read_model, write_model
from studies.models.kinds.frequency import evaluate, find_temperature, save_frequency
from studies.record import Record, read_record, write_record
from tests.compiled import compile_c
from thermal.lag import lag

T = np.linspace(-20, 40, 7)
F = 4424.9 + 0.3716 * T - 9.7e-4 * T**2 + 1.5e-5 * T**3 + 0.01 * np.cos(5 * T)


@pytest.fixture
def model():
    return save_frequency(fit_frequency(T, F), (ModelSource('a "b" */ ü.csv', "ab12", 7),), "test")


def test_a_saved_model_is_read_back_to_the_last_bit(model, tmp_path):
    write_model(model, tmp_path / "m.toml")
    again = read_model(tmp_path / "m.toml")
    assert (again.parts, again.validity, again.sources) == (model.parts, model.validity, model.sources)
    assert again.settings == model.settings
    assert again.part("frequency")["a1"] == model.parts[0].values[1]
    assert len((tmp_path / "m.toml").read_text().splitlines()) < 45


def test_frequency_c_code_agrees_with_the_fit(model, tmp_path):
    library = compile_c(emit_c(model), tmp_path)
    library.hrg_frequency.restype = library.hrg_temperature.restype = ctypes.c_double
    library.hrg_frequency.argtypes = [ctypes.c_double]
    library.hrg_temperature.argtypes = [ctypes.c_double, ctypes.POINTER(ctypes.c_int)]
    fit, ok = fit_frequency(T, F), ctypes.c_int()
    for t in (-22.9, -20.0, 3.3, 40.0, 42.9):
        assert library.hrg_frequency(t) == pytest.approx(float(fit.frequency(t, extrapolate=True)), rel=1e-14)
        f = float(fit.frequency(t, extrapolate=True))
        assert library.hrg_temperature(f, ctypes.byref(ok)) == pytest.approx(t, abs=1e-8)
        assert ok.value == 1
        assert find_temperature(model, np.array([f, np.nan]))[0] == pytest.approx(t, abs=1e-8)
    library.hrg_temperature(4500.0, ctypes.byref(ok))
    assert ok.value == 0


def test_compensation_takes_the_curve_out_and_refuses_to_extrapolate(model):
    fit = fit_frequency(T, F)
    time, housing = np.arange(5.0), np.array([-10.0, 0.0, 10.0, np.nan, 30.0])
    record = Record(
        {"time_s": time, "housing_temperature_degC": housing, "frequency_Hz": fit.frequency(20.0) + 0 * time}
    )
    out = compensate(model, record)["compensated_frequency_Hz"]
    expected = fit.frequency(20.0) - fit.frequency(np.nan_to_num(housing)) + fit.coefficients[0]
    assert out[[0, 1, 2, 4]] == pytest.approx(expected[[0, 1, 2, 4]], abs=1e-9)
    assert np.isnan(out[3])
    hot = record.with_columns({"housing_temperature_degC": housing + 20})
    with pytest.raises(InputError, match=r"from 10 to 50, outside -23 to 43 .*--extrapolate"):
        compensate(model, hot)
    assert np.isfinite(compensate(model, hot, extrapolate=True)["compensated_frequency_Hz"][0])
    with pytest.raises(InputError, match="already"):
        compensate(model, compensate(model, record))


def words_of(folder, model, columns):
    """What compensates a record of these columns by a model, both written to the folder."""
    write_model(model, folder / "m.toml")
    write_record(Record(columns), folder / "run.csv")
    return ["compensate", str(folder / "m.toml"), str(folder / "run.csv"), "--out", str(folder / "out.csv")]


def test_a_frequency_model_needs_no_housing_sensor(model, tmp_path, ask):
    true = np.array([-10.0, 5.0, 25.0])
    columns = {"time_s": np.arange(3.0), "frequency_Hz": evaluate(model, true) + 0.5}
    f0 = model.part("frequency")["f0"]
    for name in ("resonator_temperature_degC", "chamber_temperature_degC"):
        out = compensate(model, Record(columns | {name: true}))
        assert out["compensated_frequency_Hz"] == pytest.approx(f0 + 0.5, abs=1e-9)
    # Without any thermometer the frequency is its own: its temperature is all that the model can say.
    words = words_of(tmp_path, model, columns | {"frequency_Hz": evaluate(model, true)})
    assert ask(words)["added"] == ["resonator_temperature_degC"]
    out = read_record(tmp_path / "out.csv")
    assert out["resonator_temperature_degC"] == pytest.approx(true, abs=1e-6)
    assert "compensated_frequency_Hz" not in out


def test_a_record_too_short_for_its_stability_is_compensated_all_the_same(model, tmp_path, hear):
    housing = np.array([-10.0, 5.0, 25.0])
    columns = {"time_s": np.arange(3.0), "housing_temperature_degC": housing, "frequency_Hz": evaluate(model, housing)}
    words = words_of(tmp_path, model, columns)
    found, said = hear(words)
    assert "too few rows" in said
    assert found["columns"]["compensated_frequency_Hz"]["stability_after"] is None
    assert read_record(tmp_path / "out.csv")["compensated_frequency_Hz"] == pytest.approx(model.part("frequency")["f0"])


def test_a_short_record_is_judged_by_averages_of_a_tenth_of_it(model, tmp_path, ask):
    """100 s of a ramp: what 100 s averages gave was one number, whose standard deviation is 0, before and after."""
    time = np.arange(101.0)
    housing = 10.0 + 0.1 * time
    columns = {"time_s": time, "housing_temperature_degC": housing, "frequency_Hz": evaluate(model, housing)}
    words = words_of(tmp_path, model, columns)
    column = ask(words)["columns"]["compensated_frequency_Hz"]
    means = columns["frequency_Hz"][:100].reshape(10, 10).mean(1)
    assert column["averaging_s"] == 10.0
    assert column["stability_before"] == pytest.approx(means.std())
    assert column["stability_after"] < 1e-6 * column["stability_before"]


def test_a_measured_rate_is_judged_by_its_error(tmp_path, ask):
    """Steps of 100 °/s are no error: before, 0.1 °/s times the sine of the planted bias, after none of it."""
    time = np.arange(2000.0)
    shift, applied = 2 * np.sin(2 * np.pi * time / 2000), 100.0 * (time // 500 % 2)
    rate = applied + 0.05 * shift
    columns = {"time_s": time, "frequency_Hz": 4e3 + shift, "rate_deg_per_s": applied, "measured_rate_deg_per_s": rate}
    settings = {"variable": "frequency_Hz", "reference_frequency_Hz": 4e3, "rate_window_s": 20.0, "rate_lag_s": 0.0}
    part = make_part("bias", ("constant", "f"), (0.0, 0.05), ("deg/s", "deg/s/Hz"))
    ranges = {"frequency_Hz": (3990.0, 4010.0), "frequency_rate_Hz_per_s": (-1.0, 1.0)}
    model = Model(kind="bias", compensates="measured_rate_deg_per_s", settings=settings, parts=(part,), validity=ranges)
    words = words_of(tmp_path, model, columns)
    found = ask(words)["columns"]["compensated_measured_rate_deg_per_s"]
    assert found["stability_before"] == pytest.approx(0.1 / np.sqrt(2), rel=0.01)
    assert found["stability_after"] < 1e-3 * found["stability_before"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('schema = "hrg.model/1"', 'schema = "hrg.model/9"', "schema must be"),
        ("coefficients = [", "coefficients = [3,", "coefficients.0 must be a table, not 3"),
        ('name = "a1"', 'name = "f0"', "same name"),
        ('frequency_Hz"', "frequency_Hz", "not valid TOML"),
        ("rows = 7", f"rows = {'7' * 5000}", "not valid TOML: Exceeds the limit"),
        ("temperature_degC = [-23.0, 43.0]", "temperature_degC = [43.0, -23.0]", "must be below"),
        ("reference_temperature_degC = 0.0", "reference_temperature_degC = nan", "finite number"),
        ("[settings]", "[settings]\nfoo = 3", "settings.: unknown key 'foo'"),
        (
            "temperature_degC = [",
            "temperature_dgC = [0.0, 1.0]\ntemperature_degC = [",
            "did you mean 'temperature_degC'",
        ),
        ('"a1"', '"a7"', "the coefficients must be f0, a1, a2, a3, in this order"),
        ('unit = "Hz/degC"', 'unit = "mHz/degC"', "'a1' must be in Hz/degC, not mHz/degC"),
        (
            "[[source]]",
            '[[part]]\nname = "bias"\ncoefficients = [{name = "x", value = 1, unit = "1"}]\n[[source]]',
            "unknown name 'bias'",
        ),
    ],
)
def test_a_broken_file_is_refused_by_key(model, tmp_path, old, new, message):
    text = format_model(model)
    assert old in text
    text = text.replace(old, new, 1)
    (tmp_path / "m.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=message):
        read_model(tmp_path / "m.toml")


ROUGH = make_part("rough", ("null", "scale"), (0.0, 1.0), ("deg/s", "deg/s per deg/s"))
CURVES = [make_part(name, ("c0",), (1.0,), (unit,)) for name, unit in (("bias", "deg/s"), ("scale_over_rate", "deg/s"), ("scale_over_temperature", "1"))]  # fmt: skip
CROSS = {"calibration_temperature_degC": 20.0, "frequency_Hz": 5e3, "relative_damping": 1e-6, "g2": 1.0, "temperature_column": "housing_temperature_degC"}  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "settings", "parts", "ranges", "misspelled"),
    [
        ("bias", {"variable": "frequency_Hz", "reference_frequency_Hz": 4e3, "rate_window_s": 300.0, "rate_lag_s": 0.0},
         [make_part("bias", ("constant", "f", "fdot"), (1.0, 2.0, 3.0), ("deg/h", "deg/h/Hz", "deg/h/(Hz/s)"))],
         ("frequency_Hz", "frequency_rate_Hz_per_s"), "variable"),
        ("cross-damping", CROSS, [make_part("cross-damping", ("zeta_0", "zeta_1"), (1.0, 2.0), ("1", "1/degC"))],
         ("housing_temperature_degC",), "g2"),
        ("scale", {"temperature_column": "housing_temperature_degC", "sampling_s": 0.0}, [ROUGH, *CURVES],
         ("housing_temperature_degC", "measured_rate_deg_per_s"), "sampling_s"),
    ],
)  # fmt: skip
def test_every_kind_knows_its_settings_and_units(tmp_path, kind, settings, parts, ranges, misspelled):
    output = "measured_rate_deg_per_s" if kind == "scale" else "bias_deg_per_h"
    whole = Model(
        kind=kind, compensates=output, settings=settings, parts=tuple(parts), validity=dict.fromkeys(ranges, (0.0, 1.0))
    )
    path = tmp_path / "m.toml"
    write_model(whole, path)
    text = path.read_text(encoding="utf-8")
    assert read_model(path).parts == whole.parts
    path.write_text(text.replace("[settings]", f"[settings]\n{misspelled}x = 3"), encoding="utf-8")
    with pytest.raises(InputError, match=f"unknown key '{misspelled}x'; did you mean '{misspelled}'"):
        read_model(path)
    last = parts[-1].coefficients[-1]
    path.write_text(text.replace(f'unit = "{last.unit}"', 'unit = "ft"'), encoding="utf-8")
    with pytest.raises(InputError, match=r"must be in .*, not ft; convert its value"):
        read_model(path)


def test_an_unknown_kind_and_a_wrong_covariance_are_refused(model, tmp_path):
    content = format_model(model)
    tomllib.loads(content)
    (tmp_path / "m.toml").write_text(content.replace('kind = "frequency"', 'kind = "frequenzy"'), encoding="utf-8")
    with pytest.raises(InputError, match="unknown kind 'frequenzy'; did you mean 'frequency'"):
        compensate(read_model(tmp_path / "m.toml"), Record({"time_s": np.arange(2.0)}))
    start = content.index("covariance = [")
    (tmp_path / "m.toml").write_text(content[:start] + "covariance = [[1.0]]\n", encoding="utf-8")
    with pytest.raises(InputError, match="covariance must be 4 lists of 4 numbers"):
        read_model(tmp_path / "m.toml")


def test_coefficients_that_overflow_are_refused(model):
    part = model.parts[0]
    first, *others = part.coefficients
    broken = replace(model, parts=(replace(part, coefficients=(first, *(replace(c, value=1e308) for c in others))),))
    record = Record(
        {
            "time_s": np.arange(3.0),
            "housing_temperature_degC": np.array([-20.0, 10.0, 40.0]),
            "frequency_Hz": np.full(3, 4430.0),
        }
    )
    with np.errstate(over="ignore", invalid="ignore"), pytest.raises(InputError, match="infinite"):
        compensate(broken, record)


def test_a_frequency_model_of_another_column_is_refused(model):
    record = Record({"time_s": np.arange(3.0), "frequency_Hz": np.full(3, 4430.0)})
    with pytest.raises(InputError, match="compensates frequency_Hz"):
        compensate(replace(model, compensates="bias_deg_per_h"), record)


def test_a_frequency_that_lags_its_thermometer_is_told_as_such(model, tmp_path, capsys):
    """A moving record of the right gyro comes out worse; that is no other gyro."""
    time = np.arange(0.0, 20000.0, 20.0)
    housing = 10 + 25 * np.sin(time / 1500)
    late = lag(time, housing, 3000.0)
    columns = {"time_s": time, "housing_temperature_degC": housing, "frequency_Hz": evaluate(model, late)}
    assert main(words_of(tmp_path, model, columns)) == 0
    said = capsys.readouterr().err
    assert "compensated_frequency_Hz is worse than the record" in said
    assert "the resonator lags its thermometer" in said


@pytest.mark.parametrize("more", [[], ["--extrapolate"]])
def test_a_frequency_in_kilohertz_is_named(tmp_path, refuse, more):
    time = np.arange(2000.0)
    f = 4e3 + 2 * np.sin(2 * np.pi * time / 2000)
    settings = {"variable": "frequency_Hz", "reference_frequency_Hz": 4e3, "rate_window_s": 20.0, "rate_lag_s": 0.0}
    part = make_part("bias", ("constant", "f"), (0.0, 0.05), ("deg/h", "deg/h/Hz"))
    ranges = {"frequency_Hz": (3990.0, 4010.0), "frequency_rate_Hz_per_s": (-1.0, 1.0)}
    model = Model(kind="bias", compensates="bias_deg_per_h", settings=settings, parts=(part,), validity=ranges)
    words = words_of(tmp_path, model, {"time_s": time, "frequency_Hz": f / 1e3, "bias_deg_per_h": 0.05 * (f - 4e3)})
    assert "kHz? Then multiply the column by 1000" in refuse([*words, *more])
    assert not (tmp_path / "out.csv").exists()
