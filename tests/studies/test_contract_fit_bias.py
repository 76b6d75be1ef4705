"""`hrg fit bias` and `hrg compensate` from record files to model, C source, page and compensated record."""

import ctypes
import json
import shutil
import subprocess

import numpy as np
import pytest

from studies.cli import main
from studies.models import emit_c, read_model
from studies.record import Record, read_record, write_record

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
    options = {"save": "m.toml", "emit": "m.c", "report": "page.html"}
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


def test_a_compensated_record_is_flat_and_complete(calibrated, tmp_path, capsys):
    out = tmp_path / "out.csv"
    assert (
        main(["compensate", str(calibrated / "m.toml"), str(calibrated / "run1.csv"), "--out", str(out), "--json"]) == 0
    )
    payload = json.loads(capsys.readouterr().out)
    column = payload["columns"]["compensated_bias_deg_per_h"]
    assert column["rows_not_compensated"] == 0
    assert column["stability_before"] > 1.0
    assert column["stability_after"] < 0.13  # white noise alone: 0.4/√20 = 0.089
    again = read_record(out)
    assert again["bias_deg_per_h"] == pytest.approx(read_record(calibrated / "run1.csv")["bias_deg_per_h"], abs=1e-12)


def test_the_c_code_agrees_with_the_model(calibrated, tmp_path):
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler on this machine")
    source = (calibrated / "m.c").read_text(encoding="utf-8")
    assert source == emit_c(read_model(calibrated / "m.toml"))
    (tmp_path / "m.c").write_text(source, encoding="utf-8")
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-shared", "-fPIC"]
    subprocess.run([compiler, *flags, "m.c", "-o", "m.so", "-lm"], cwd=tmp_path, check=True)
    library = ctypes.CDLL(str(tmp_path / "m.so"))
    for name in ("hrg_rate", "hrg_bias", "hrg_compensate"):
        getattr(library, name).restype = ctypes.c_double
    number, array = ctypes.c_double, ctypes.c_double * 31
    part, reference = read_model(calibrated / "m.toml").part("bias"), read_model(calibrated / "m.toml").settings
    f, rate = 4425.5, -1.3e-3
    expected = part["constant"] + part["f"] * (f - reference["reference_frequency_Hz"]) + part["fdot"] * rate
    assert library.hrg_bias(number(f), number(rate)) == pytest.approx(expected, rel=1e-14)
    line = array(*(4425.0 - 2e-3 * 10 * k for k in range(31)))
    assert library.hrg_rate(line, 31, number(10.0)) == pytest.approx(-2e-3, rel=1e-9)
    ok = ctypes.c_int()
    assert library.hrg_compensate(number(3.0), number(f), number(rate), ctypes.byref(ok)) == pytest.approx(3 - expected)
    assert ok.value == 1
    library.hrg_compensate(number(3.0), number(4500.0), number(rate), ctypes.byref(ok))
    assert ok.value == 0


def test_json_is_one_object_with_both_methods(calibrated, capsys):
    assert main(["fit", "bias", *(str(calibrated / f"run{k}.csv") for k in range(3)), "--json"]) == 0
    payload = json.loads(capsys.readouterr().out)
    assert payload["schema"] == "hrg.fit-bias/1"
    assert set(payload["methods"]) == {"guarded", "paper"}
    guarded = payload["methods"]["guarded"]
    assert guarded["terms"] == ["constant", "f", "fdot"]
    assert [step["term"] for step in guarded["path"]]
    assert guarded["held_out"]["of"] == "runs"
    assert guarded["held_out"]["gain"] > 5
    assert payload["allan"]["before"]["N"] == pytest.approx(0.4 * np.sqrt(5.0), rel=0.05)


def test_golden_keys_of_the_schema(calibrated, capsys):
    """The keys that scripts rely on; regenerate by reading `_payload` when the schema's number changes."""
    assert main(["fit", "bias", str(calibrated / "run0.csv"), "--json"]) == 0
    payload = json.loads(capsys.readouterr().out)
    top = {"schema", "data", "output", "method", "rows", "missing", "spikes", "rate_lag_s", "methods", "allan"}
    assert set(payload) == top
    judged = payload["methods"]["guarded"]
    assert set(judged) == {
        "reference_frequency_Hz", "terms", "coefficients", "standard_errors", "naive_standard_errors", "theta", "path",
        "training", "held_out",
    }  # fmt: skip
    assert set(judged["path"][0]) == {"added", "term", "F", "p_value", "bic"}
    assert set(judged["training"]) == {"before", "after", "gain"}
    assert set(payload["allan"]) == {"step_s", "before", "after"}


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


def test_the_page_is_whole_and_escapes_names(calibrated, tmp_path):
    page = (calibrated / "page.html").read_text(encoding="utf-8")
    assert page.count("<svg") + page.count("data:image") >= 2
    shutil.copy(calibrated / "run0.csv", tmp_path / "<b>run.csv")
    assert main(["fit", "bias", str(tmp_path / "<b>run.csv"), "--report", str(tmp_path / "p.html")]) == 0
    assert "<b>run" not in (tmp_path / "p.html").read_text(encoding="utf-8")


def test_one_cooling_run_is_not_applied_to_a_warming_one(calibrated, tmp_path, capsys):
    run, warming, model = (str(calibrated / n) for n in ("run0.csv", "run1.csv", "one.toml"))
    assert main(["fit", "bias", run, "--causal", "--save", model]) == 0
    assert read_model(model).settings["rate_lag_s"] == 150.0
    out = str(tmp_path / "c.csv")
    assert main(["compensate", model, warming, "--out", out]) == 2
    assert "frequency_rate_Hz_per_s runs from" in capsys.readouterr().err
    assert not (tmp_path / "c.csv").exists()
    assert main(["compensate", model, warming, "--out", out, "--extrapolate"]) == 0
    assert main(["compensate", model, run, "--out", out]) == 0  # its own run lies inside


def test_gaps_missing_values_and_spikes_do_not_harm(tmp_path, capsys):
    def spoil(columns):
        columns["bias_deg_per_h"][[500, 900]] = 1e4, -1e4
        columns["frequency_Hz"][700:720] = np.nan
        for name in columns:
            columns[name] = np.delete(columns[name], slice(1500, 1900))

    write_record(make_record(4, spoil=spoil), tmp_path / "run.csv")
    model = str(tmp_path / "m.toml")
    assert main(["fit", "bias", str(tmp_path / "run.csv"), "--save", model, "--json"]) == 0
    payload = json.loads(capsys.readouterr().out)
    assert (payload["spikes"], payload["missing"]) == (2, 20)
    assert payload["methods"]["guarded"]["coefficients"][1] == pytest.approx(0.3, abs=0.02)
    assert main(["compensate", model, str(tmp_path / "run.csv"), "--out", str(tmp_path / "o.csv")]) == 0


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda c: c.pop("frequency_Hz"), "frequency_Hz' is missing"),
        (lambda c: c.pop("bias_deg_per_h"), "bias_deg_per_h or measured_rate_deg_per_s is missing"),
        (lambda c: c.update(frequency_Hz=np.full(TIME.size, 4433.0)), "frequency is constant"),
        (lambda c: c.update(frequency_Hz=-c["frequency_Hz"]), "must be positive"),
        (lambda c: c.update(frequency_Hz=c["frequency_Hz"] / 1000), "is it in kHz"),
        (lambda c: c.update(rate_deg_per_s=np.full(TIME.size, 10.0)), "runs at rest"),
        (lambda c: c.update({k: v[:200] for k, v in c.items()}), "record longer"),
        (lambda c: c.update(frequency_Hz=np.full(TIME.size, np.nan)), "only 0 rows"),
    ],
)
def test_unusable_records_are_refused_with_their_file(spoil, message, tmp_path, capsys):
    write_record(make_record(5, spoil=spoil), tmp_path / "run.csv")
    assert main(["fit", "bias", str(tmp_path / "run.csv"), "--save", str(tmp_path / "m.toml")]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert not (tmp_path / "m.toml").exists()


def test_compensate_says_what_it_needs(calibrated, tmp_path, capsys):
    model, run = str(calibrated / "m.toml"), str(calibrated / "run0.csv")
    assert main(["compensate", model]) == 2
    assert main(["compensate", model, run]) == 2
    assert "--out" in capsys.readouterr().err
    assert main(["compensate", model, "--emit", str(tmp_path / "m.c")]) == 0
    text = (calibrated / "m.toml").read_text(encoding="utf-8").replace('"fdot"', '"fdott"')
    (tmp_path / "bad.toml").write_text(text, encoding="utf-8")
    assert main(["compensate", str(tmp_path / "bad.toml"), run, "--out", str(tmp_path / "o.csv")]) == 2
    assert "unknown term 'fdott'; did you mean 'fdot'" in capsys.readouterr().err
