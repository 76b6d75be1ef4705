"""`hrg diagnose`: the JSON of the contract, and what it says of unusable or undecidable input."""

import numpy as np
import pytest

from studies.diagnosis.verdict import Cause, ResponseResult, Verdict
from studies.inference.verdict import next_step
from studies.record import Record, write_record
from studies.reports.diagnosis import headline
from tests.studies.diagnosis.bench import BACK, CYCLE, STAIRS, Bench


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    folder = tmp_path_factory.mktemp("campaign")
    records, paths = [], []
    for k, corners in enumerate((STAIRS, CYCLE, BACK)):
        bench = Bench(corners, sampling=40.0, seed=11 + k)
        x, noise = bench.gyro() - 20.0, bench.rng.standard_normal((2, bench.time.size))
        bias = 0.5 * k + 0.02 * x - 1e-4 * x**2 + 60.0 * bench.rate + 0.1 * noise[0]
        loss = 2e-7 * (1.0 + 1e-3 * x + 1e-5 * x**2 + 0.01 * noise[1])
        columns = {"frequency_Hz": bench.frequency(0.01), "bias_deg_per_h": bias, "inverse_q": loss}
        records.append(bench.record(k + 1, **columns))
        paths.append(str(folder / f"run{k + 1}.csv"))
        write_record(records[-1], paths[-1])
    return records, paths


def save(tmp_path, columns, name="run.csv", **notes):
    path = tmp_path / name
    write_record(Record({key: np.asarray(value, dtype=float) for key, value in columns.items()}, **notes), path)
    return path


def columns_of(record):
    return {key: values.copy() for key, values in record.columns.items()}


def test_two_gyros_are_refused(campaign, refuse, tmp_path):
    records, _ = campaign
    other = columns_of(records[1])
    other["frequency_Hz"] *= 1.2
    one, two = save(tmp_path, columns_of(records[0]), "a.csv"), save(tmp_path, other, "b.csv")
    assert "different gyros" in refuse(["diagnose", one, two, "--json"])
    save(tmp_path, columns_of(records[0]), "a.csv", instrument="one")
    save(tmp_path, columns_of(records[1]), "b.csv", instrument="two")
    assert "'two'" in refuse(["diagnose", one, two])


@pytest.mark.parametrize(
    ("column", "factor", "words"),
    [
        ("frequency_Hz", 1e-3, "another unit"),
        ("inverse_q", 1e9, "inverse_q"),
        ("bias_deg_per_h", 1000.0, "as in m°/h. Divide the column by 1000"),
    ],
)
def test_units_off_by_a_thousand_are_named(campaign, refuse, tmp_path, column, factor, words):
    records, _ = campaign
    wrong = columns_of(records[1])
    wrong[column] *= factor
    said = refuse(["diagnose", save(tmp_path, columns_of(records[0]), "a.csv"), save(tmp_path, wrong, "b.csv")])
    assert words in said
    assert "b.csv" in said


UNUSABLE = {
    "no thermometer": (lambda c: c.pop("housing_temperature_degC"), "housing_temperature_degC"),
    "no response": (lambda c: [c.pop(name) for name in ("frequency_Hz", "bias_deg_per_h", "inverse_q")], "frequency_Hz"),
    "two rows": (lambda c: c.update({k: v[:2] for k, v in c.items()}), "too little for a diagnosis: frequency_Hz: "),
    "ten rows": (lambda c: c.update({k: v[:10] for k, v in c.items()}), "too little for a diagnosis: frequency_Hz: "),
    "nothing moves": (
        lambda c: [c.pop("bias_deg_per_h"), c.pop("inverse_q"), c.update(frequency_Hz=np.full(c["time_s"].shape, 5000.0))],
        "frequency_Hz: constant. Record more digits",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", UNUSABLE)
def test_a_record_that_tells_nothing_is_refused(campaign, refuse, tmp_path, kind):
    columns, (spoil, words) = columns_of(campaign[0][0]), UNUSABLE[kind]
    spoil(columns)
    assert words in refuse(["diagnose", save(tmp_path, columns)])
    refuse(["diagnose"])


@pytest.mark.slow
def test_a_poor_record_is_said_to_be_what_it_is(campaign, ask, tmp_path):
    """An hour is missing, the frequency is constant, 1/Q and every second bias are not there, and the file is given twice."""
    poor = columns_of(campaign[0][0])
    time = poor["time_s"]
    poor["frequency_Hz"][:], poor["inverse_q"][:], poor["bias_deg_per_h"][::2] = 5000.0, np.nan, np.nan
    poor = {key: values[(time < 9000) | (time > 12600)] for key, values in poor.items()}
    found = ask(["diagnose", save(tmp_path, poor, "a.csv"), save(tmp_path, poor, "b.csv")])
    assert any("repeats" in note for note in found["notes"])
    assert found["responses"]["frequency_Hz"]["remark"] == "constant"
    assert found["responses"]["inverse_q"]["remark"] == "every value is missing"
    assert found["responses"]["bias_deg_per_h"]["noise"] > 0


@pytest.mark.slow
def test_constant_temperature_is_adequate_and_says_what_cannot_show(ask, tmp_path):
    rng = np.random.default_rng(5)
    time = np.arange(0.0, 20000.0, 20.0)
    columns = {
        "time_s": time,
        "housing_temperature_degC": 20.0 + 0.003 * rng.standard_normal(time.size),
        "frequency_Hz": 5000.0 + 0.01 * rng.standard_normal(time.size),
    }
    found = ask(["diagnose", save(tmp_path, columns)])
    assert found["verdict"] == "adequate"  # nothing beyond noise, and what could not show is said
    assert "K only" in found["responses"]["frequency_Hz"]["remark"]


@pytest.mark.parametrize("kind", ["run", "table"])
def test_temperatures_beyond_the_material_law_are_named(campaign, refuse, tmp_path, kind):
    """The law of the card ends at -60 degrees: nothing is extrapolated in silence."""
    if kind == "run":
        cold = columns_of(campaign[0][0])
        cold["housing_temperature_degC"] = cold["housing_temperature_degC"] - 60.0
    else:
        cold = {"temperature_degC": np.linspace(-90.0, 20.0, 8), "frequency_Hz": np.linspace(4400.0, 4432.0, 8)}
    assert "outside the range" in refuse(["diagnose", save(tmp_path, cold), "--card", "hrg-30mm"])


@pytest.mark.parametrize(
    ("left", "end"),
    [("structure", "Still left: structure in temperature in the bias."), ("none", "(probability 0.80).")],
)
def test_the_headline_says_what_the_causes_leave(left, end):
    cause = Cause("jump", "bias_deg_per_h", 0.8, (), {}, 50.0)
    result = ResponseResult("explained", 0.1, (1.0, 1.0), (0.2, 0.2), left, "temperature", 40.0, 0.95)
    assert headline(Verdict("explained", (cause,), {"bias_deg_per_h": result}, None, ())).endswith(end)


@pytest.mark.parametrize(("verdict", "has"), [("unexplained", "has"), ("not-identifiable", "may have")])
def test_structure_in_a_drive_names_its_column_and_has_a_next_experiment(verdict, has):
    result = ResponseResult(verdict, 0.1, (1.0, 1.0), None, "none", "electrode_bias_V", 20.0)
    said = next_step((), {"inverse_q": result}, {})
    assert said is not None
    assert said.startswith(f"The 1/Q {has} structure in electrode_bias_V that no known effect explains: repeat a run")
    adequate = ResponseResult("adequate", 0.1, (1.0, 1.0), None, "none")
    assert next_step((), {"inverse_q": adequate}, {}) is None
