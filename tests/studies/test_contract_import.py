"""Laboratory files into records: known signals written in the notations of real loggers come back exactly."""

import datetime
import json
import sys

import numpy as np
import pytest

from studies.cli import main
from studies.errors import InputError, MissingEnvironment
from studies.importing.draft import draft_map
from studies.importing.join import import_record, resample
from studies.importing.mapping import load_map
from studies.importing.units import TARGETS, units_of
from studies.record import read_record, write_record

START = datetime.datetime(2026, 1, 31, 23, 58)


def signal(t):
    temperature = 20 + 5 * np.sin(t / 100)
    return temperature, 4430 + 0.35 * (temperature - 20)


def write_logger(path, t, encoding="cp1252"):
    """A German logger: preamble, names, a line of units, `;`, decimal commas, date and time apart, `---` for a lost value."""
    temperature, frequency = signal(t)
    lines = ["Messung Prüfling 7", "Kommentar: Kammertest", "Datum;Uhrzeit;T Gehäuse;Frequenz;Bemerkung", ";;°C;Hz;"]
    for k, seconds in enumerate(t):
        stamp = START + datetime.timedelta(seconds=float(seconds))
        reading = "---" if k == 5 else f"{temperature[k]:.4f}".replace(".", ",")
        counted = f"{frequency[k]:.5f}".replace(".", ",")
        lines.append(f"{stamp:%d.%m.%Y;%H:%M:%S};{reading};{counted};ok")
    path.write_text("\n".join(lines) + "\n", encoding=encoding)


def write_counter(path, t):
    """A counter of its own: milliseconds since its start, counts of a 10 MHz clock in 1000 periods."""
    _, frequency = signal(t)
    rows = [f"{(s - t[0]) * 1000:.0f}\t{1000 * 10e6 / f:.3f}" for s, f in zip(t, frequency, strict=True)]
    path.write_text("time [ms]\tperiod counts\n" + "\n".join(rows) + "\n")


def hrg_import(*words):
    return main(["import", *(str(word) for word in words)])


def test_a_drafted_map_reads_a_german_logger(tmp_path, capsys):
    raw, out, run = tmp_path / "raw.csv", tmp_path / "map.toml", tmp_path / "run.csv"
    t = np.arange(0.0, 300.0)
    write_logger(raw, t)
    assert hrg_import(raw, "--draft", out) == 0
    assert "Left over: Bemerkung" in capsys.readouterr().err
    assert hrg_import(raw, "--map", out, "--out", run, "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["schema"], told["rows"], told["start"]) == ("hrg.import/1", 300, START.isoformat())
    record = read_record(run)
    temperature, frequency = signal(t)
    known = np.arange(300) != 5
    assert np.allclose(record["time_s"], t)
    assert np.allclose(record["housing_temperature_degC"][known], temperature[known], atol=5.1e-5)
    assert np.isnan(record["housing_temperature_degC"][5])
    assert np.allclose(record["frequency_Hz"], frequency, atol=5.1e-6)
    assert record.start == START  # over midnight and the end of a month
    assert any("1 of 300 values missing" in note for note in record.comments)
    assert record.comments == tuple(told["notes"])


def test_a_draft_is_not_overwritten_and_a_file_without_numbers_is_refused(tmp_path, capsys):
    raw, out = tmp_path / "raw.csv", tmp_path / "map.toml"
    raw.write_text("time,f\n0,1\n1,2\n")
    out.write_text("mine")
    assert hrg_import(raw, "--draft", out) == 2
    assert out.read_text() == "mine"
    raw.write_text("Dear all,\nplease find nothing here.\n")
    assert hrg_import(raw, "--draft", tmp_path / "other.toml") == 2
    assert not (tmp_path / "other.toml").exists()
    assert "Traceback" not in capsys.readouterr().err


MAP = """
schema = "hrg.map/1"
instrument = "unit 7"
[[file]]
separator = ";"
decimal = ","
encoding = "cp1252"
header_line = 3
data_line = 5
missing = ["---"]
time = ["Datum", "Uhrzeit"]
time_format = "%d.%m.%Y %H:%M:%S"
[[file.column]]
from = "T Gehäuse"
to = "housing_temperature_degC"
unit = "degC"
[[file]]
separator = "tab"
time = "time [ms]"
time_format = "ms"
start = {start}
clock_offset_s = {offset}
clock_rate_ppm = {rate}
[[file.column]]
from = "period counts"
to = "frequency_Hz"
unit = "period-counts"
clock_Hz = 10e6
periods = 1000
"""


def test_unsynchronised_loggers_are_joined_on_their_clocks(tmp_path):
    """The counter starts 50 s early, its clock is 7 s behind and runs 200 ppm fast: all of it is undone."""
    one, two = tmp_path / "one.csv", tmp_path / "two.txt"
    t = np.arange(0.0, 400.0)
    write_logger(one, t)
    true = np.arange(-50.0, 300.0, 0.5)
    _, frequency = signal(true)
    shown = (true - true[0]) * (1 + 200e-6)
    rows = [f"{1000 * s:.3f}\t{1e10 / f:.3f}" for s, f in zip(shown, frequency, strict=True)]
    two.write_text("time [ms]\tperiod counts\n" + "\n".join(rows) + "\n")
    path = tmp_path / "map.toml"
    behind = START - datetime.timedelta(seconds=50 + 7)
    path.write_text(MAP.format(start=behind.isoformat(), offset=7.0, rate=200.0))
    record = import_record([str(one), str(two)], load_map(path))
    inside = t < 299
    assert np.allclose(record["frequency_Hz"][inside], signal(t)[1][inside], atol=2e-6)
    assert np.isnan(record["frequency_Hz"][t > 300]).all()  # nothing is extrapolated
    path.write_text(MAP.format(start=behind.isoformat(), offset=0.0, rate=200.0))
    wrong = import_record([str(one), str(two)], load_map(path))
    assert np.nanmax(abs(wrong["frequency_Hz"] - signal(t)[1])[inside]) > 0.05  # the offset matters
    saved = tmp_path / "run.csv"
    write_record(record, saved)
    assert read_record(saved).instrument == "unit 7"
    text = "\n".join(read_record(saved).comments)
    assert "7 s added to its times" in text
    assert "200 ppm fast" in text
    assert "periods clock_Hz / x" in text


def test_a_clock_without_a_date_needs_start(tmp_path):
    one, two = tmp_path / "one.csv", tmp_path / "two.txt"
    write_logger(one, np.arange(0.0, 20.0))
    write_counter(two, np.arange(0.0, 20.0))
    path = tmp_path / "map.toml"
    text = MAP.format(start="2026-01-31T23:58:00", offset=0.0, rate=0.0)
    path.write_text(text.replace("start = 2026-01-31T23:58:00\n", ""))
    with pytest.raises(InputError, match="say when its clock was started"):
        import_record([str(one), str(two)], load_map(path))
    path.write_text(text.replace("23:58:00", "12:00:00"))
    with pytest.raises(InputError, match="lies wholly before"):
        import_record([str(one), str(two)], load_map(path))


def simple(tmp_path, rows, extra="", column="", header="t,x"):
    raw, path = tmp_path / "raw.csv", tmp_path / "map.toml"
    raw.write_text(header + "\n" + "\n".join(rows) + "\n")
    path.write_text(
        f'schema = "hrg.map/1"\n[[file]]\ntime = "t"\n{extra or "time_format = " + chr(34) + "s" + chr(34)}\n'
        f'[[file.column]]\nfrom = "x"\n{column or "to = " + chr(34) + "frequency_Hz" + chr(34) + chr(10) + "unit = " + chr(34) + "Hz" + chr(34)}\n'
    )
    return import_record([str(raw)], load_map(path))


@pytest.mark.parametrize(
    ("form", "stamps"),
    [
        ("s", ["5", "6.5", "8"]),
        ("min", ["0", "0.025", "0.05"]),
        ("unix-s", ["1769903880", "1769903881.5", "1769903883"]),
        ("unix-ms", ["1769903880000", "1769903881500", "1769903883000"]),
        ("excel-days", ["46053.998611111111", "46053.998628472222", "46053.998645833333"]),
        ("iso", ["2026-01-31T23:58:00Z", "2026-02-01 00:58:01.5+01:00", "2026-01-31T23:58:03Z"]),
        ("%m/%d/%Y %I:%M:%S %p", ["01/31/2026 11:59:58 PM", "02/01/2026 12:00:00 AM", "02/01/2026 12:00:01 AM"]),
        ("%H:%M:%S.%f", ["23:59:59.0", "00:00:00.5", "00:00:02.0"]),
    ],
)
def test_every_way_of_writing_time(tmp_path, form, stamps):
    record = simple(tmp_path, [f"{stamp},{k}" for k, stamp in enumerate(stamps)], f'time_format = "{form}"')
    expected = [0, 2, 3] if "%p" in form else [0, 1.5, 3]
    assert np.allclose(record["time_s"], expected, atol=2e-6)


def test_times_that_repeat_or_go_back(tmp_path):
    rows = ["0,1", "0,2", "1,3", "1,4", "2,5"]
    with pytest.raises(InputError, match="repeated_times"):
        simple(tmp_path, rows)
    spread = simple(tmp_path, rows, 'time_format = "s"\nrepeated_times = "spread"')
    assert spread["time_s"].tolist() == [0, 0.5, 1, 1.5, 2]
    first = simple(tmp_path, rows, 'time_format = "s"\nrepeated_times = "first"')
    assert first["frequency_Hz"].tolist() == [1, 3, 5]
    with pytest.raises(InputError, match=r"line 4: the time goes back by 1 s"):
        simple(tmp_path, ["0,1", "1,2", "0,3"])


@pytest.mark.parametrize("target", TARGETS)
def test_every_unit_of_every_column_is_right(target):
    """Independent check: the same physical value written in each unit."""
    same = {
        "degC": 25.0, "K": 298.15, "degF": 77.0,
        "Hz": 4430.0, "kHz": 4.43, "MHz": 4.43e-3, "rad/s": 4430.0 * 2 * np.pi,
        "period-s": 1 / 4430.0, "period-ms": 1e3 / 4430.0, "period-us": 1e6 / 4430.0,
        "period-counts": 1000 * 10e6 / 4430.0, "gate-counts": 44300.0,
        "deg/h": 15.0, "arcsec/s": 15.0, "deg/s": 15.0 / 3600, "mdeg/s": 15.0 / 3.6, "rad/s of rate": np.deg2rad(15.0) / 3600,
        "rpm": 15.0 / 3600 / 6, "V": 0.25, "mV": 250.0, "uV": 250e3, "kV": 0.25e-3,
        "deg": 45.0, "rad": np.pi / 4, "turns": 0.125, "counts": 17.0, "1/Q": 1e-7, "Q": 1e7, "ppm": 0.1,
    }  # fmt: skip
    settings = {"clock_Hz": 10e6, "periods": 1000.0, "gate_s": 10.0}
    found = []
    for name, unit in units_of(target).items():
        key = "rad/s of rate" if name == "rad/s" and "deg_per" in target else name
        found.append(float(unit.convert(np.array([same[key]]), *(settings[s] for s in unit.settings))[0]))
    assert np.allclose(found, found[0], rtol=1e-12)


def test_sign_scale_and_offset(tmp_path):
    column = 'to = "bias_deg_per_h"\nunit = "deg/s"\nscale = 2.0\noffset = 1.0\nsign = -1'
    record = simple(tmp_path, ["0,0.5", "1,1"], column=column)
    assert record["bias_deg_per_h"].tolist() == [-7200.0, -10800.0]
    assert any("sign turned" in note and "x × 2.0 + 1.0" in note for note in record.comments)


def test_resampling_keeps_gaps_and_never_extrapolates():
    t, grid = np.array([0.0, 1, 2, 10, 11]), np.arange(-1.0, 13, 0.5)
    values = t**2
    linear = resample(t, values, grid, "linear", 3.0)
    assert np.isnan(linear[(grid < 0) | ((grid > 2) & (grid < 10)) | (grid > 11)]).all()
    assert linear[grid == 1.5] == 2.5
    mean = resample(np.arange(0, 10, 0.1), np.arange(0, 10, 0.1), np.arange(0.0, 10), "mean", 1.0)
    assert mean[5] == pytest.approx(np.arange(4.5, 5.5, 0.1).mean())
    assert np.isnan(resample(t, values, grid, "nearest", 1.0)[grid == 6]).all()
    assert resample(t, values, grid, "previous", 1.0)[grid == 6] == 4.0
    assert np.isnan(resample(t, np.full(5, np.nan), grid, "linear", 3.0)).all()


def test_a_regular_grid(tmp_path):
    raw, path = tmp_path / "raw.csv", tmp_path / "map.toml"
    raw.write_text("t,x\n" + "".join(f"{0.1 * k:.1f},{k}\n" for k in range(101)))
    text = 'schema = "hrg.map/1"\nstep_s = 1.0\n[[file]]\ntime = "t"\ntime_format = "s"\n[[file.column]]\nfrom = "x"\nto = "output_counts"\nunit = "counts"\nresample = "mean"\n'
    path.write_text(text)
    record = import_record([str(raw)], load_map(path))
    assert record["time_s"].tolist() == list(range(11))
    assert record["output_counts"][3] == pytest.approx(29.5)  # of 25 ... 34
    path.write_text(text.replace("1.0", "1e-9"))
    with pytest.raises(InputError, match="rows"):
        import_record([str(raw)], load_map(path))


@pytest.mark.parametrize(
    ("change", "part"),
    [
        (("T Gehäuse", "T Gehaeuse"), "did you mean 'T Gehäuse'"),
        (('decimal = ","', 'decimal = "."'), "is not a number"),
        (('separator = ";"', 'separator = ","'), "check separator"),
        (('encoding = "cp1252"', 'encoding = "utf-8"'), "cp1252 is common"),
        (('missing = ["---"]', "missing = []"), "line 10: '---'"),
        (('unit = "degC"', 'unit = "K"'), "check unit"),
        (('unit = "degC"', 'unit = "C"'), "known: K, degC, degF"),
        (("housing_temperature_degC", "housing_temp_degC"), "did you mean 'housing_temperature_degC'"),
        (("%d.%m.%Y", "%m.%d.%Y"), "is not a time"),
        (("data_line = 5", "data_line = 3"), "must follow"),
        (("data_line = 5", "data_line = 5000"), "no rows"),
        (("header_line = 3", "header_line = 1"), "check separator"),
        (("[[file]]\n", '[[file]]\nclock = "slow"\n'), "unknown key 'clock'"),
    ],
)
def test_errors_name_the_place_and_the_mend(tmp_path, capsys, change, part):
    raw, path = tmp_path / "raw.csv", tmp_path / "map.toml"
    write_logger(raw, np.arange(0.0, 20.0))
    only_first = MAP.format(start="2026-01-31T23:58:00", offset=0, rate=0).split('[[file]]\nseparator = "tab"')[0]
    path.write_text(only_first.replace(*change, 1))
    assert hrg_import(raw, "--map", path, "--out", tmp_path / "run.csv") == 2
    message = capsys.readouterr().err
    assert part in message
    assert "Traceback" not in message
    assert not (tmp_path / "run.csv").exists()


def test_excel_without_openpyxl_says_how_to_get_it(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    book = tmp_path / "raw.xlsx"
    book.write_bytes(b"PK\x03\x04")
    with pytest.raises(MissingEnvironment, match="hrg-workbench\\[excel\\]"):
        draft_map([str(book)])
    assert hrg_import(book, "--draft", tmp_path / "map.toml") == 3
    assert "Traceback" not in capsys.readouterr().err


def test_an_excel_workbook(tmp_path):
    openpyxl = pytest.importorskip("openpyxl", reason="the optional extra 'excel' is not installed")
    book = openpyxl.Workbook()
    book.active.append(["time", "Temp (K)", "freq Hz"])
    for k in range(5):
        book.active.append([START + datetime.timedelta(seconds=2 * k), 293.15 + k, None if k == 2 else 4430.25 + k])
    raw, path = tmp_path / "raw.xlsx", tmp_path / "map.toml"
    book.save(raw)
    path.write_text(draft_map([str(raw)]).text)
    record = import_record([str(raw)], load_map(path))
    assert record["time_s"].tolist() == [0, 2, 4, 6, 8]
    assert np.allclose(record["housing_temperature_degC"], 20 + np.arange(5.0))
    assert np.isnan(record["frequency_Hz"][2])
    assert record.start == START
    raw.write_bytes(raw.read_bytes()[:200])
    with pytest.raises(InputError, match="not an Excel workbook"):
        import_record([str(raw)], load_map(path))
