"""Files of other laboratories and programs: read to the last digit, damaged ones refused in a sentence, nothing unpickled."""

import datetime
import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from studies.cli import main
from studies.record import Record, read_record, write_record

FORMATS = {"parquet": "parquet", "mat": "mat", "tdms": "tdms", "mf4": "mf4", "hdf5": "h5"}
LIBRARIES = {"parquet": "pyarrow.parquet", "tdms": "nptdms", "mf4": "asammdf", "hdf5": "h5py"}


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def record():
    rng = np.random.default_rng(7)
    n = 400
    time = np.cumsum(rng.uniform(0.5, 1.5, n))
    housing = 20 + 10 * rng.standard_normal(n)
    frequency = 4432 + rng.standard_normal(n)
    frequency[[3, 50]] = np.nan
    columns = {
        "time_s": time - time[0], "housing_temperature_degC": housing, "frequency_Hz": frequency,
        "bias_deg_per_h": rng.standard_normal(n), "inverse_q": 1e-7 + 1e-9 * rng.standard_normal(n), "quadrature_V": rng.standard_normal(n),
        "pattern_angle_deg": 360 * rng.uniform(size=n), "output_counts": rng.integers(0, 2**20, n).astype(float),
        "measured_rate_deg_per_s": rng.standard_normal(n),
    }  # fmt: skip
    return Record(columns, instrument="hrg-30mm", source="a test")


def imported(name):
    """The record of a file by the map that is drafted of it."""
    Path("map.toml").unlink(missing_ok=True)
    assert main(["import", name, "--draft", "map.toml"]) == 0
    assert main(["import", name, "--map", "map.toml", "--out", "run_of_it.csv"]) == 0
    return read_record("run_of_it.csv")


def same(one, two):
    return all(np.array_equal(one.columns[key], two.columns[key], equal_nan=True) for key in one.columns)


@pytest.mark.parametrize("kind", FORMATS)
def test_contract_a_record_comes_back_from_every_format_to_the_last_digit(kind, record):
    write_record(record, "run.csv")
    out = f"run.{FORMATS[kind]}"
    assert main(["export", "run.csv", "--to", kind, "--out", out]) == 0
    back = imported(out)
    assert set(back.columns) == set(record.columns)
    assert same(record, back)


@pytest.mark.parametrize("kind", ["mat", "tdms", "hdf5", "mf4"])
def test_contract_the_start_of_a_record_comes_back_as_is_said(kind, record, capsys):
    """A file without a dated clock loses it, once without a word; what the map then needs is told."""
    moment = datetime.datetime(2026, 3, 3, 8, 0, 5, tzinfo=datetime.UTC)
    write_record(replace(record, start=moment), "run.csv")
    out = f"run.{FORMATS[kind]}"
    assert main(["export", "run.csv", "--to", kind, "--out", out]) == 0
    told = re.search(r"from the map: (start = \S+?)\.\s", capsys.readouterr().out)
    assert (told is None) == (kind == "mf4")
    assert main(["import", out, "--draft", "map.toml"]) == 0
    if told:
        text = Path("map.toml").read_text(encoding="utf-8")
        Path("map.toml").write_text(text.replace("[[file]]", f"[[file]]\n{told[1]}", 1), encoding="utf-8")
    assert main(["import", out, "--map", "map.toml", "--out", "back.csv"]) == 0
    assert read_record("back.csv").start == moment


def test_contract_a_parquet_record_is_accepted_where_a_csv_is(record, capsys):
    write_record(record, "run.parquet")
    again = read_record("run.parquet")
    assert same(record, again)
    assert (again.instrument, again.source) == (record.instrument, record.source)
    assert main(["export", "run.parquet", "--to", "csv", "--out", "run.csv"]) == 0
    assert same(record, read_record("run.csv"))
    capsys.readouterr()
    assert main(["show", "run.parquet", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["records"][0]["rows"] == len(record)


def tdms(path, **groups):
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(path) as writer:
        for group, channels in groups.items():
            writer.write_segment([nptdms.ChannelObject(group, *channel) for channel in channels])


def test_contract_channels_of_two_rates_are_averaged_onto_the_slow_clock():
    fast, slow = np.arange(1000.0), np.linspace(20, 30, 100)
    start = {"wf_start_time": np.datetime64("2026-03-01T12:00:00"), "wf_start_offset": 0.0}
    tdms(
        "run.tdms",
        Fast=[("f res", 4000 + fast, {"unit_string": "Hz", "wf_increment": 0.1, **start})],
        Slow=[("T housing", slow + 273.15, {"unit_string": "K", "wf_increment": 1.0, **start})],
    )
    run, text = imported("run.tdms"), Path("map.toml").read_text()
    assert "same_file = true" in text
    assert "[Hz]: 1000 rows, 0.1 s apart" in text
    assert run["housing_temperature_degC"] == pytest.approx(slow, abs=1e-9)
    # a mean takes the samples from half a step before to half a step after
    assert run["frequency_Hz"][1:-1] == pytest.approx(4000 + 10 * np.arange(1, 99) - 0.5)
    assert run.start.isoformat() == "2026-03-01T12:00:00+00:00"
    assert any("resampled: mean" in note for note in run.comments)


def test_contract_time_stamps_are_the_clock_of_their_group():
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    stamps = np.datetime64("2026-03-01T12:00:00.5", "us") + np.arange(0, 5_000_000, 500_000).astype("timedelta64[us]")
    housing = np.linspace(20, 21, 10)
    tdms("a.tdms", G=[("when", stamps), ("T housing", housing, {"unit_string": "degC"})])
    parquet.write_table(arrow.table({"when": arrow.array(stamps), "T housing": housing}), "a.parquet")
    zoned = arrow.array(stamps).cast(arrow.timestamp("us", tz="UTC"))
    parquet.write_table(arrow.table({"when": zoned, "T housing": housing}), "b.parquet")
    wave = {"wf_increment": 0.5, "wf_start_offset": 0.5, "wf_start_time": stamps[0] - np.timedelta64(500, "ms")}
    tdms("b.tdms", G=[("T housing", housing, wave)])
    for name, start in (("a.tdms", "+00:00"), ("a.parquet", ""), ("b.parquet", "+00:00"), ("b.tdms", "+00:00")):
        run = imported(name)
        assert 'time_format = "own"' in Path("map.toml").read_text()
        assert run["time_s"] == pytest.approx(np.arange(10) / 2, abs=1e-9)
        assert run.start.isoformat() == f"2026-03-01T12:00:00.500000{start}"


def test_contract_a_channel_without_a_clock_asks_for_one(refuse):
    tdms("run.tdms", G=[("f", 4000 + np.cos(np.arange(50.0)), {"unit_string": "Hz"})])
    assert main(["import", "run.tdms", "--draft", "map.toml"]) == 0
    assert "sample_period_s = 0.0    # CHECK" in Path("map.toml").read_text()
    own = re.sub("sample_period_s.*", 'time_format = "own"', Path("map.toml").read_text())
    Path("map.toml").write_text(own)
    assert "'f' has no clock of its own" in refuse(["import", "run.tdms", "--map", "map.toml", "--out", "run.csv"])
    Path("map.toml").write_text(own.replace('group = "G"', 'group = "g"'))
    assert "no group 'g'" in refuse(["import", "run.tdms", "--map", "map.toml", "--out", "run.csv"])


@pytest.mark.slow
@pytest.mark.parametrize("kind", FORMATS)
def test_contract_damaged_files_are_refused_in_a_sentence(kind, record, capfd):
    write_record(record, "run.csv")
    name = f"run.{FORMATS[kind]}"
    assert main(["export", "run.csv", "--to", kind, "--out", name]) == 0
    assert main(["import", name, "--draft", "map.toml"]) == 0
    whole = Path(name).read_bytes()
    capfd.readouterr()
    for size in (0, 3, 40, len(whole) // 3, len(whole) - 20):
        Path(name).write_bytes(whole[:size])
        Path("draft.toml").unlink(missing_ok=True)
        assert main(["import", name, "--draft", "draft.toml"]) == 2, size
        assert main(["import", name, "--map", "map.toml", "--out", "back.csv"]) == 2, size
        err = capfd.readouterr().err
        assert err.count("\n") == 2, err
        assert name in err
    rng = np.random.default_rng(1)
    for _ in range(0 if kind == "hdf5" else 10):  # a sentence or an answer, never a fault of the program
        bad = bytearray(whole)
        for place in rng.integers(0, len(bad), 30):
            bad[place] ^= 0xFF
        Path(name).write_bytes(bytes(bad))
        assert main(["import", name, "--map", "map.toml", "--out", "back.csv"]) in (0, 2)
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.parametrize("probe", ["while True: pass", "import os; os.abort()"], ids=["hangs", "crashes"])
def test_contract_a_file_on_which_the_hdf5_library_hangs_or_crashes_is_refused(probe, tmp_path, monkeypatch, capsys):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "bad.h5", "w") as file:
        file["f"] = np.arange(9.0)
    monkeypatch.setattr("studies.importing.formats.PROBE", probe)
    monkeypatch.setattr("studies.importing.formats.PATIENCE", 0.3)
    assert main(["import", str(tmp_path / "bad.h5"), "--draft", str(tmp_path / "map.toml")]) == 2
    assert (
        "bad.h5: damaged, so that the HDF5 library hangs or crashes on it; copy or export it again."
        in capsys.readouterr().err
    )


@pytest.mark.parametrize("kind", LIBRARIES)
def test_contract_a_missing_library_names_the_extra(kind, monkeypatch, capsys, record):
    Path(f"run.{FORMATS[kind]}").write_bytes(b"something")
    monkeypatch.setitem(sys.modules, LIBRARIES[kind], None)
    assert main(["import", f"run.{FORMATS[kind]}", "--draft", "map.toml"]) == 3
    assert "hrg-workbench[formats]" in capsys.readouterr().err
    write_record(record, "run.csv")
    assert main(["export", "run.csv", "--to", kind, "--out", f"out.{FORMATS[kind]}"]) == 3
    assert not Path(f"out.{FORMATS[kind]}").exists()


def test_contract_objects_are_never_opened(refuse):
    from scipy.io import savemat

    h5py = pytest.importorskip("h5py")
    with h5py.File("run.h5", "w") as file:
        file.create_dataset("words", data=["a", "b"], dtype=h5py.string_dtype())
    assert "holds objects" in refuse(["import", "run.h5", "--draft", "map.toml"])
    savemat("run.mat", {"c": np.array(["x", 1.0], dtype=object)})
    assert "holds objects" in refuse(["import", "run.mat", "--draft", "map.toml"])


def test_contract_a_class_of_matlab_is_refused_by_name(monkeypatch, refuse):
    from scipy.io import loadmat, savemat
    from scipy.io.matlab import MatlabOpaque

    savemat("run.mat", {"t": np.arange(9.0), "T_housing": np.linspace(20, 21, 9)})
    opaque = np.zeros(1, dtype=[("s0", "O"), ("arr", "O")]).view(MatlabOpaque)
    monkeypatch.setattr("scipy.io.loadmat", lambda *given, **named: {**loadmat(*given, **named), "when": opaque})
    assert main(["import", "run.mat", "--draft", "map.toml"]) == 0
    named = Path("map.toml").read_text().replace('time = "t"', 'time = "when"')
    Path("map.toml").write_text(named)
    assert "'when' is of a class that only MATLAB reads" in refuse(
        ["import", "run.mat", "--map", "map.toml", "--out", "run.csv"]
    )


def test_contract_a_matlab_7_3_file_and_matrices_are_channels():
    h5py = pytest.importorskip("h5py")
    time, housing = np.arange(30.0), np.linspace(20, 21, 30)
    with h5py.File("run.mat", "w", userblock_size=512) as file:
        for name, data in (("t", time[None, :]), ("T_housing", housing[:, None]), ("fs", np.array([[2.0]]))):
            file.create_dataset(name, data=data).attrs["MATLAB_class"] = np.bytes_("double")
    raw = bytearray(Path("run.mat").read_bytes())
    raw[:19] = b"MATLAB 7.3 MAT-file"
    Path("run.mat").write_bytes(bytes(raw))
    assert imported("run.mat")["housing_temperature_degC"] == pytest.approx(housing, rel=1e-15)


MAP = """schema = "hrg.map/1"
[[file]]
time = "t"
time_format = "s"
[[file.column]]
from = "f"
to = "frequency_Hz"
unit = "Hz"
"""


def raw(path, time, values):
    Path(path).write_text(
        "t,f\n" + "".join(f"{t!r},{v!r}\n" for t, v in zip(time.tolist(), values.tolist(), strict=True))
    )


def test_contract_files_that_overlap_are_joined_where_they_agree(capsys, refuse):
    Path("map.toml").write_text(MAP)
    time = np.arange(100.0)
    f = 4000 + np.round(np.random.default_rng(0).standard_normal(100), 6)
    raw("one.csv", time[:60], f[:60])
    raw("two.csv", time[50:], f[50:])
    assert main(["import", "one.csv", "two.csv", "--map", "map.toml", "--out", "run.csv"]) == 0
    assert "10 rows from two.csv, line 2 on repeat the file before: left out" in capsys.readouterr().out
    run = read_record("run.csv")
    assert np.array_equal(run["time_s"], time)
    assert np.array_equal(run["frequency_Hz"], f)
    raw("two.csv", time[50:], f[50:] + 1e-3)
    assert main(["import", "one.csv", "two.csv", "--map", "map.toml", "--out", "run.csv"]) == 2
    assert "overlaps the one before it by 9 s, and they differ there" in capsys.readouterr().err
    assert "in the order of their times" in refuse(
        ["import", "two.csv", "one.csv", "--map", "map.toml", "--out", "run.csv"]
    )


def test_contract_doubtful_readings_are_offered_as_missing_and_never_changed(capsys):
    f = 4000 + np.round(np.random.default_rng(0).standard_normal(300), 6)
    f[100], f[200:230] = 4100.0, f[200]
    raw("one.csv", np.arange(300.0), f)
    Path("map.toml").write_text(MAP)
    assert main(["import", "one.csv", "--map", "map.toml", "--out", "run.csv"]) == 0
    said = capsys.readouterr().out
    assert "spikes: 1, left as they are (drop = ['spikes'] makes them missing)" in said
    assert "readings of a sensor that is stuck: 30, left as they are" in said
    assert np.array_equal(read_record("run.csv")["frequency_Hz"], f)
    Path("map.toml").write_text(MAP + 'drop = ["spikes", "stuck"]\n')
    assert main(["import", "one.csv", "--map", "map.toml", "--out", "run.csv"]) == 0
    kept = read_record("run.csv")["frequency_Hz"]
    assert np.isnan(kept).sum() == 31
    assert "spikes: 1, made missing" in capsys.readouterr().out


def test_contract_a_long_csv_is_written_in_portions_and_reads_back_to_the_last_digit(record, tmp_path, monkeypatch):
    pytest.importorskip("pyarrow")
    monkeypatch.setattr("studies.files.writing._spell", None)  # none of it goes the slow way
    monkeypatch.setattr("studies.files.writing.MANY", 3)
    write_record(record, tmp_path / "long.csv")
    assert same(record, read_record(tmp_path / "long.csv"))


def test_a_raw_decay_of_a_laboratory_is_fitted(tmp_path, ask):
    """Two pick-offs in TDMS: drafted, imported, fitted as from a text."""
    nptdms = pytest.importorskip("nptdms")
    t = np.arange(40_000) / 5e3
    x, y = (np.exp(-t / 1.5) * np.cos(2 * np.pi * f * t) for f in (900.0, 902.0))
    noise = 1e-3 * np.random.default_rng(2).standard_normal((2, t.size))
    clock = {"wf_increment": 2e-4, "wf_start_offset": 0.0, "unit_string": "V"}
    raw, draft, run = tmp_path / "decay.tdms", tmp_path / "map.toml", tmp_path / "run.parquet"
    with nptdms.TdmsWriter(raw) as writer:
        channels = zip(("X pickoff", "Y pickoff"), np.add((x, y), noise), strict=True)
        writer.write_segment([nptdms.ChannelObject("scope", name, values, clock) for name, values in channels])
    assert ask(["import", str(raw), "--draft", str(draft)])["mapped"] == ["pickoff_cos_V", "pickoff_sin_V"]
    ask(["import", str(raw), "--map", str(draft), "--out", str(run)])
    (decay,) = ask(["fit", "ringdown", str(run)])["decays"]
    found = {one["name"]: one for one in decay["estimates"]}
    assert found["frequency_1_Hz"]["value"] == pytest.approx(902.0, abs=1e-3)
    assert found["decay_time_s"]["low"] <= 1.5 <= found["decay_time_s"]["high"]
