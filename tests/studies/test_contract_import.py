"""Laboratory files into records: known signals written in the notations of real loggers come back exactly."""

import datetime
import json
import re
import sys
import tomllib
from zoneinfo import ZoneInfo

import numpy as np
import pytest

from studies.cli import main
from studies.errors import InputError, MissingEnvironment
from studies.files import numbers, stored
from studies.importing import clock, look, raw
from studies.importing.draft import draft_map
from studies.importing.join import import_records
from studies.importing.mapping import load_map
from studies.importing.raw import NotPlain, read_plain, read_raw
from studies.importing.resampling import resample
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
    assert "Unmapped columns: Bemerkung" in capsys.readouterr().out
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


@pytest.mark.parametrize(
    ("head", "row", "tail"),
    [
        ("Date,Temp,F", "{d:.8f},{T:.4f},{f:.5f}", ""),
        ("time_s,housing_temperature_degC,frequency_Hz,,", "{t:g},{T:.4f},{f:.5f},,", ",,,,\n,,,,\n"),
        ("time_s,housing_temperature_degC,frequency_Hz", '{t:g},"{T:.4f}","{f:.5f}"', ""),
    ],
    ids=["serial days of Excel", "empty columns behind the last", "decimal commas in quotes"],
)
def test_what_a_spreadsheet_writes_is_drafted_rightly(tmp_path, head, row, tail):
    """Days were taken for seconds, a header of empty cells for none, quoted numbers for text."""
    t = np.arange(0.0, 6000.0, 60.0)
    T, f = signal(t)
    rows = [row.format(d=45717.0 + a / 86400.0, t=a, T=b, f=c) for a, b, c in zip(t, T, f, strict=True)]
    if '"' in row:
        rows = [line.replace(".", ",") for line in rows]
    record = draft_and_import(table(tmp_path, head, [*rows, tail]), tmp_path)
    assert record["time_s"] == pytest.approx(t, abs=1e-3)
    assert record["frequency_Hz"] == pytest.approx(f, abs=1e-5)


def test_several_gyros_in_one_file_are_told_apart_from_rows_within_a_second(tmp_path):
    """Two gyros were joined to a saw-tooth of 120 Hz; a counter of the rows within each second is none of them."""
    raw = tmp_path / "raw.csv"
    names = "time_s,housing_temperature_degC,frequency_Hz"
    both = [f"{gyro},{t},{20 + 0.01 * t},{4430.0 + (gyro == 'B')}" for t in range(50) for gyro in "AB"]
    raw.write_text("\n".join([f"gyro,{names}", *both, ""]))
    with pytest.raises(InputError, match=r"once for every value of 'gyro' \(A, B\): these are several gyros"):
        draft_map([str(raw)])
    raw.write_text(
        "\n".join([f"n,{names}", *(f"{n},{t},{20 + 0.01 * t},4430.{n}" for t in range(50) for n in range(5)), ""])
    )
    assert 'repeated_times = "spread"' in draft_map([str(raw)]).text


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
    record = import_records([str(one), str(two)], load_map(path))[""]
    inside = t < 299
    assert np.allclose(record["frequency_Hz"][inside], signal(t)[1][inside], atol=2e-6)
    assert np.isnan(record["frequency_Hz"][t > 300]).all()  # nothing is extrapolated
    path.write_text(MAP.format(start=behind.isoformat(), offset=0.0, rate=200.0))
    wrong = import_records([str(one), str(two)], load_map(path))[""]
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
    with pytest.raises(InputError, match="give the time at which it started"):
        import_records([str(one), str(two)], load_map(path))[""]
    path.write_text(text.replace("23:58:00", "12:00:00"))
    with pytest.raises(InputError, match="is entirely before"):
        import_records([str(one), str(two)], load_map(path))[""]


def simple(tmp_path, rows, extra="", column="", header="t,x"):
    raw, path = tmp_path / "raw.csv", tmp_path / "map.toml"
    raw.write_text(header + "\n" + "\n".join(rows) + "\n")
    path.write_text(
        f'schema = "hrg.map/1"\n[[file]]\ntime = "t"\n{extra or "time_format = " + chr(34) + "s" + chr(34)}\n'
        f'[[file.column]]\nfrom = "x"\n{column or "to = " + chr(34) + "frequency_Hz" + chr(34) + chr(10) + "unit = " + chr(34) + "Hz" + chr(34)}\n'
    )
    return import_records([str(raw)], load_map(path))[""]


@pytest.mark.parametrize(
    ("form", "stamps"),
    [
        ("s", ["5", "6.5", "8"]),
        ("min", ["0", "0.025", "0.05"]),
        ("0.5 s", ["0", "3", "6"]),
        ("h:mm:ss", ["26:59:58.5", "1.03:00:00", "1 day, 3:00:01.5"]),
        ("mm:ss", ["75:59.25", "76:00.75", "76:02,25"]),
        ("gps-s", ["1126259462", "1126259463.5", "1126259465"]),
        ("unix-s", ["1769903880", "1769903881.5", "1769903883"]),
        ("unix-ms", ["1769903880000", "1769903881500", "1769903883000"]),
        ("excel-days", ["46053.998611111111", "46053.998628472222", "46053.998645833333"]),
        ("iso", ["2026-01-31T23:58:00Z", "2026-02-01 00:58:01.5+01:00", "2026-01-31T23:58:03Z"]),
        ("%m/%d/%Y %I:%M:%S %p", ["01/31/2026 11:59:58 PM", "02/01/2026 12:00:00 AM", "02/01/2026 12:00:01 AM"]),
        ("%H:%M:%S.%f", ["23:59:59.0", "00:00:00.5", "00:00:02.0"]),
    ],
)
def test_every_way_of_writing_time(tmp_path, form, stamps):
    record = simple(
        tmp_path,
        [f'"{stamp}",{k}' if "," in stamp else f"{stamp},{k}" for k, stamp in enumerate(stamps)],
        f'time_format = "{form}"',
    )
    expected = [0, 2, 3] if "%p" in form else [0, 1.5, 3]
    assert np.allclose(record["time_s"], expected, atol=2e-6)


@pytest.mark.parametrize(
    ("form", "count", "start"),
    [
        ("gps-s", "1126259462", "2015-09-14T09:50:45+00:00"),  # GW150914, Abbott et al., PRL 116 (2016) 061102
        ("mjd", "51544.5", "2000-01-01T12:00:00+00:00"),  # the epoch J2000.0
        ("jd", "2451545.0", "2000-01-01T12:00:00+00:00"),
        ("ntp-s", "2208988800", "1970-01-01T00:00:00+00:00"),  # RFC 5905
        ("labview-s", "2082844800", "1970-01-01T00:00:00+00:00"),
        ("matlab-days", "730486.25", "2000-01-01T06:00:00"),  # MathWorks: datenum(2000,1,1) = 730486
        ("excel-days", "36526.25", "2000-01-01T06:00:00"),
    ],
)
def test_published_epochs(tmp_path, form, count, start):
    later = f"{float(count) + (1 if form.endswith('-s') else 1 / 86400):.9f}"
    record = simple(tmp_path, [f"{count},1", f"{later},2"], f'time_format = "{form}"')
    assert record.start.isoformat() == start
    assert record["time_s"] == pytest.approx([0, 1], abs=1e-4)


@pytest.mark.parametrize(
    ("name", "first", "step", "form", "checked"),
    [
        ("GPS time (s)", 1.4567e9, 10, "gps-s", True),  # or Unix seconds of 2016
        ("GPS time (s)", 1.05e9, 10, "gps-s", False),
        ("LabVIEW time", 3.85e9, 10, "labview-s", False),
        ("Time", 3.85e9, 10, "labview-s", True),
        ("Time [s]", 1.7567e9, 10, "unix-s", True),
        ("unix time", 1.7567e9, 10, "unix-s", False),
        ("ts_ms", 1.7725e12, 1e4, "unix-ms", True),
        ("datenum", 740044.34375, 1e-4, "matlab-days", False),
        ("MJD", 61102.34375, 1e-4, "mjd", False),
        ("JD", 2461102.84375, 1e-4, "jd", False),
        ("Time (s)", 45000.5, 10, "s", False),  # half a day into a run
    ],
)
def test_a_count_since_an_epoch_is_named_or_asked_for(tmp_path, name, first, step, form, checked):
    """GPS and LabVIEW seconds began in 2016 and 2092, a day of MATLAB lasted a second, all without a word."""
    rows = [f"{first + step * k:.10f},{20 + k / 8},{4432 + k / 8}" for k in range(30)]
    text = draft_map([str(table(tmp_path, f"{name},temp [°C],freq [Hz]", rows))]).text
    (line,) = (line for line in text.splitlines() if line.startswith("time_format"))
    assert line.startswith(f'time_format = "{form}"')
    assert ("CHECK" in line) == checked


def test_times_that_repeat_or_go_back(tmp_path):
    rows = ["0,1", "0,2", "1,3", "1,4", "2,5"]
    with pytest.raises(InputError, match="repeated_times"):
        simple(tmp_path, rows)
    spread = simple(tmp_path, rows, 'time_format = "s"\nrepeated_times = "spread"')
    assert spread["time_s"].tolist() == [0, 0.5, 1, 1.5, 2]
    first = simple(tmp_path, rows, 'time_format = "s"\nrepeated_times = "first"')
    assert first["frequency_Hz"].tolist() == [1, 3, 5]
    with pytest.raises(InputError, match=r"line 4: the time goes backwards \(by up to 1 s"):
        simple(tmp_path, ["0,1", "1,2", "0,3"])
    with pytest.raises(InputError, match=r"changed to winter time, give 'timezone' in that \[\[file\]\]"):
        simple(tmp_path, ["2026-10-25 02:59,1", "2026-10-25 02:00,2"], 'time_format = "iso"')


@pytest.mark.parametrize("target", TARGETS)
def test_every_unit_of_every_column_is_right(target):
    """Independent check: the same physical value written in each unit."""
    same = {
        "degC": 25.0, "mdegC": 25e3, "K": 298.15, "degF": 77.0,
        "Hz": 4430.0, "kHz": 4.43, "MHz": 4.43e-3, "rad/s": 4430.0 * 2 * np.pi,
        "period-s": 1 / 4430.0, "period-ms": 1e3 / 4430.0, "period-us": 1e6 / 4430.0,
        "period-counts": 1000 * 10e6 / 4430.0, "gate-counts": 44300.0,
        "deg/h": 15.0, "arcsec/s": 15.0, "deg/s": 15.0 / 3600, "mdeg/s": 15.0 / 3.6, "rad/s of rate": np.deg2rad(15.0) / 3600,
        "mdeg/h": 15e3, "mrad/s": np.deg2rad(15.0) / 3.6, "urad/s": np.deg2rad(15.0) / 3.6e-3, "mK": 298150.0, "mHz": 4430e3,
        "rpm": 15.0 / 3600 / 6, "V": 0.25, "mV": 250.0, "uV": 250e3, "kV": 0.25e-3,
        "deg": 45.0, "rad": np.pi / 4, "turns": 0.125, "counts": 17.0, "1/Q": 1e-7, "Q": 1e7, "dBm": -7.0, "dB": -7.0, "W": 2e-4, "mW": 0.2, "uW": 200.0,
        "ppm": 0.1 if target == "inverse_q" else 1e6 * (4430.0 / 4400.0 - 1),
        "ppb": 100.0 if target == "inverse_q" else 1e9 * (4430.0 / 4400.0 - 1),
    }  # fmt: skip
    settings = {"clock_Hz": 10e6, "periods": 1000.0, "gate_s": 10.0, "nominal_Hz": 4400.0}
    found = []
    for name, unit in units_of(target).items():
        key = "rad/s of rate" if name == "rad/s" and "deg_per" in target else name
        found.append(float(unit.convert(np.array([same[key]]), *(settings[s] for s in unit.settings))[0]))
    assert np.allclose(found, found[0], rtol=1e-12)


def test_sign_scale_and_offset(tmp_path):
    column = 'to = "bias_deg_per_h"\nunit = "deg/s"\nscale = 2.0\noffset = 1.0\nsign = -1'
    record = simple(tmp_path, ["0,0.5", "1,1"], column=column)
    assert record["bias_deg_per_h"].tolist() == [-7200.0, -10800.0]
    assert any("sign reversed" in note and "x × 2.0 + 1.0" in note for note in record.comments)


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
    record = import_records([str(raw)], load_map(path))[""]
    assert record["time_s"].tolist() == list(range(11))
    assert record["output_counts"][3] == pytest.approx(29.5)  # of 25 ... 34
    path.write_text(text.replace("1.0", "1e-9"))
    with pytest.raises(InputError, match="rows"):
        import_records([str(raw)], load_map(path))[""]


@pytest.mark.parametrize(
    ("change", "part"),
    [
        (("T Gehäuse", "T Gehaeuse"), "did you mean 'T Gehäuse'"),
        (('decimal = ","', 'decimal = "."'), "is not a number"),
        (('separator = ";"', 'separator = ","'), "check separator"),
        (('encoding = "cp1252"', 'encoding = "utf-8"'), "cp1252 is common"),
        (('missing = ["---"]', "missing = []"), "line 10: '---'"),
        (('unit = "degC"', 'unit = "K"'), "check its unit"),
        (('unit = "degC"', 'unit = "warm"'), "known: K, degC, degF, mK, mdegC"),
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
    assert not (tmp_path / "run.csv").exists()


def test_excel_without_openpyxl_says_how_to_get_it(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    book = tmp_path / "raw.xlsx"
    book.write_bytes(b"PK\x03\x04")
    with pytest.raises(MissingEnvironment, match="hrg-workbench\\[excel\\]"):
        draft_map([str(book)])
    assert hrg_import(book, "--draft", tmp_path / "map.toml") == 3
    assert "Traceback" not in capsys.readouterr().err


def test_a_workbook_that_begins_with_a_cover_is_read_on_the_sheet_of_its_table(tmp_path):
    openpyxl = pytest.importorskip("openpyxl", reason="the optional extra 'excel' is not installed")
    book = openpyxl.Workbook()
    book.active.title = "Info"
    book.active.append(["serial", 17])
    for row in (["time_s", "frequency [Hz]", "T [°C]"], *([10 * k, 4400 + k / 8, 20.5 + k] for k in range(20))):
        (book["Daten"] if len(book.sheetnames) > 1 else book.create_sheet("Daten")).append(row)
    book.save(tmp_path / "raw.xlsx")
    record = draft_and_import(tmp_path / "raw.xlsx", tmp_path)
    assert record["frequency_Hz"].tolist() == [4400 + k / 8 for k in range(20)]
    assert '# CHECK: the others need a [[file]] each, with sheet = one of "Info"' in (tmp_path / "map.toml").read_text()
    book["Info"].delete_rows(1)
    book.remove(book["Daten"])
    book.create_sheet("Notes")
    book.save(tmp_path / "raw.xlsx")
    with pytest.raises(InputError, match='any of its sheets Info, Notes; write the map by hand, with sheet = "…"'):
        draft_map([str(tmp_path / "raw.xlsx")])


def test_an_excel_workbook(tmp_path):
    openpyxl = pytest.importorskip("openpyxl", reason="the optional extra 'excel' is not installed")
    book = openpyxl.Workbook()
    book.active.append(["time", "Temp (K)", "freq Hz"])
    for k in range(5):
        book.active.append([START + datetime.timedelta(seconds=2 * k), 293.15 + k, None if k == 2 else 4430.25 + k])
    raw, path = tmp_path / "raw.xlsx", tmp_path / "map.toml"
    book.create_sheet("afternoon").append([1.0])
    book.save(raw)
    path.write_text(draft_map([str(raw)]).text)
    assert 'the others need a [[file]] each, with sheet = one of "afternoon"' in path.read_text()
    record = import_records([str(raw)], load_map(path))[""]
    assert record["time_s"].tolist() == [0, 2, 4, 6, 8]
    assert np.allclose(record["housing_temperature_degC"], 20 + np.arange(5.0))
    assert np.isnan(record["frequency_Hz"][2])
    assert record.start == START
    raw.write_bytes(raw.read_bytes()[:200])
    with pytest.raises(InputError, match="not an Excel workbook"):
        import_records([str(raw)], load_map(path))[""]


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (
            ("time_s", "Temp. chamber", "PT100 housing", "f0"),
            ("chamber_temperature_degC", "housing_temperature_degC", "frequency_Hz"),
        ),
        (("time_s", "temp", "temp chamber"), ("housing_temperature_degC", "chamber_temperature_degC")),
        (("t / s", "f0 / kHz", "T [K]"), ("frequency_Hz", "housing_temperature_degC")),
        (("time_s", "mag1x [T]", "mag temp [T]", "temperature"), (None, None, "housing_temperature_degC")),
        (("time_s", "ref freq", "frequency"), ("reference_frequency_Hz", "frequency_Hz")),
        (("time_s", "acc x (m/s^2)", "rate [deg/s]"), (None, "measured_rate_deg_per_s")),
    ],
)
def test_the_best_fitting_column_wins_whatever_the_order(tmp_path, names, expected):
    values = np.random.default_rng(0).uniform(20, 30, (30, len(names) - 1))
    rows = [",".join([f"{k}", *(f"{v:.4f}" for v in row)]) for k, row in enumerate(values)]
    (tmp_path / "raw.csv").write_text(",".join(names) + "\n" + "\n".join(rows) + "\n")
    content = tomllib.loads(draft_map([str(tmp_path / "raw.csv")]).text)
    found = {column["from"]: column["to"] for column in content["file"][0].get("column", [])}
    assert tuple(found.get(name) for name in names[1:]) == expected


def table(folder, head, rows, name="raw.csv"):
    (folder / name).write_text("\n".join([*([head] if head else []), *rows, ""]), encoding="utf-8")
    return folder / name


@pytest.mark.parametrize(
    ("head", "doubted"),
    [("t/s,Drehrate [°/s]", True), ("t/s,gyro rate [°/s]", False), ("t/s,table rate [°/s],rate [°/s]", False)],
)
def test_a_rate_of_which_nothing_says_that_it_is_measured_is_to_be_checked(tmp_path, head, doubted):
    rows = [",".join(["{0}.0", "1.5", "1.5"][: head.count(",") + 1]).format(k) for k in range(20)]
    said = "# CHECK: or rate_deg_per_s, if it is the applied rate"
    assert (said in draft_map([str(table(tmp_path, head, rows))]).text) == doubted


def draft_and_import(path, folder, *edits):
    text = draft_map([str(path)]).text
    for old, new in edits:
        assert old in text
        text = text.replace(old, new)
    (folder / "map.toml").write_text(text)
    return import_records([str(path)], load_map(folder / "map.toml"))[""]


def test_rows_without_a_time_have_a_sample_period(tmp_path):
    rng = np.random.default_rng(1)
    rows = [f"{20 + rng.normal():.4f};{4432 + rng.normal():.4f}" for _ in range(50)]
    raw = table(tmp_path, "temp [°C];freq [Hz]", rows)
    (tmp_path / "map.toml").write_text(
        'schema = "hrg.map/1"\n[[file]]\nseparator = ";"\nsample_period_s = 0.25\n'
        '[[file.column]]\nfrom = "freq [Hz]"\nto = "frequency_Hz"\nunit = "Hz"\n'
    )
    record = import_records([str(raw)], load_map(tmp_path / "map.toml"))[""]
    assert record["time_s"] == pytest.approx(0.25 * np.arange(50))


def test_points_between_thousands_are_drafted_and_read(tmp_path):
    """4.432,07 is 4432.07; without a comma 4.432 is read by the map, as 4432."""
    rows = [f"{k};4.43{k % 10},{k:02d};{20 + k}" for k in range(30)]
    raw = table(tmp_path, "t [s];freq [Hz];temp [degC]", [*rows, "30;4.439;50"])
    record = draft_and_import(raw, tmp_path)
    assert record["frequency_Hz"] == pytest.approx([*(4430 + k % 10 + k / 100 for k in range(30)), 4439.0])
    with pytest.raises(InputError, match=r"'4.430,00' in column 'freq \[Hz\]' is not a number .*thousands = ''"):
        draft_and_import(raw, tmp_path, ('thousands = "."\n', ""))


def test_a_draft_marks_a_second_temperature_and_rows_written_twice(tmp_path):
    rows = [f"{t},{25 - t / 100},{26 - t / 100},{4432 + t / 1000}" for t in range(40)]
    raw = table(tmp_path, "time,temp,temp,freq", [",°C,°C,Hz", *rows[:20], rows[19], *rows[20:]])
    lines = draft_map([str(raw)]).text.splitlines()
    (line,) = (line for line in lines if "chamber_temperature_degC" in line)
    assert "CHECK" in line
    assert not any("CHECK" in line for line in lines if '"housing_temperature_degC"' in line)
    assert 'repeated_times = "first"    # CHECK: some rows stand there twice' in lines


@pytest.mark.parametrize(("form", "factor"), [("unix-s", 1), ("unix-ms", 1e3), ("unix-us", 1e6), ("unix-ns", 1e9)])
def test_times_since_1970_are_told_by_their_size(tmp_path, form, factor):
    stamps = [int((1627342541 + 11 * k) * factor) for k in range(30)]
    rows = [f"{stamp},{20 + k / 10}" for k, stamp in enumerate(stamps)]
    record = draft_and_import(table(tmp_path, "time,temp", rows), tmp_path)
    assert f'"{form}"' in (tmp_path / "map.toml").read_text()
    assert record["time_s"] == pytest.approx(11.0 * np.arange(30), abs=1e-5)
    assert record.start == datetime.datetime(2021, 7, 26, 23, 35, 41, tzinfo=datetime.UTC)


def test_a_span_of_a_lifetime_is_no_run(tmp_path):
    rows = [f"{256551281491968 + 505629 * k},{20 + k / 10}" for k in range(9000)]
    with pytest.raises(InputError, match=r"span 144 years, too long for one run.*'us' \(4.55e\+03 s\)"):
        draft_and_import(table(tmp_path, "timestamp,temp", rows), tmp_path, ('"us"', '"s"'))


def test_overloads_of_an_instrument_are_missing_values(tmp_path):
    rows = [f"{k},{9.9e37 if k in (3, 4) else 4432 + k / 10}" for k in range(40)]
    record = draft_and_import(table(tmp_path, "time_s,freq [Hz]", rows), tmp_path)
    assert np.flatnonzero(np.isnan(record["frequency_Hz"])).tolist() == [3, 4]
    assert any("2 readings of 'freq [Hz]' are an instrument's overload" in note for note in record.comments)


def test_gaps_are_reported(tmp_path):
    rows = [f"{k + (500 if k > 20 else 0)},{20 + k / 10}" for k in range(40)]
    said = "\n".join(draft_and_import(table(tmp_path, "time_s,temp", rows), tmp_path).comments)
    assert re.search(r"1 gap longer than 10 s.*the longest of 501 s after 20 s", said)


def test_a_table_of_settled_readings(tmp_path, ask):
    """Table 1 of the HRG paper as a laboratory might write it goes through to its cubic."""
    readings = (4416.97, 4421.05, 4424.90, 4428.56, 4432.07, 4435.56, 4439.20)
    raw = table(
        tmp_path, "Temperature [K];f0 / kHz", [f"{253.15 + 10 * k};{f / 1e3:.5f}" for k, f in enumerate(readings)]
    )
    assert hrg_import(raw, "--draft", tmp_path / "map.toml") == 0
    assert hrg_import(raw, "--map", tmp_path / "map.toml", "--out", tmp_path / "table.csv") == 0
    found = ask(["fit", "frequency", str(tmp_path / "table.csv")])["coefficients"]
    assert found == pytest.approx([4424.90095, 0.3715556, -9.70238e-4, 1.527778e-5], rel=1e-5)


def offset_of(draft):
    (line,) = [line for line in draft.text.splitlines() if line.startswith("# clock_offset_s") and "CHECK" in line]
    return float(line.split("=")[1].split("#")[0])


@pytest.mark.parametrize("offset", [-37.0, 3.0, 420.0])
def test_the_offset_of_a_second_clock_is_offered(tmp_path, offset):
    """Both loggers saw one temperature; the second one's clock is behind by the offset."""
    rng = np.random.default_rng(5)
    t = np.arange(0.0, 7200.0, 5.0)

    def temperature(at):
        return 20 + 15 * np.sin(at / 900) + 4 * np.sin(at / 251)

    one = [f"{x},{temperature(x) + 0.05 * rng.normal():.4f}" for x in t]
    two = [
        f"{x},{temperature(x + offset) + 0.05 * rng.normal():.4f},{4432 + temperature(x + offset) / 3:.4f}"
        for x in t[::2]
    ]
    table(tmp_path, "time_s,temp housing", one, "one.csv")
    table(tmp_path, "time_s,temp chamber,freq [Hz]", two, "two.csv")
    draft = draft_map([str(tmp_path / "one.csv"), str(tmp_path / "two.csv")])
    assert offset_of(draft) == pytest.approx(offset, abs=0.5)
    assert "its clock seems to be off" in draft.notes[0]


def test_two_sensors_of_one_step_tell_the_offset_of_their_clocks(tmp_path):
    """A settling that is later looks like one that is larger, unless both columns are in one unit; the record takes one sensor."""
    rng = np.random.default_rng(6)
    t = np.arange(0.0, 18000.0, 10.0)

    def temperature(at):
        return np.where(at < 300, 25.0, -20 + 45 * (0.7 * np.exp(-(at - 300) / 400) + 0.3 * np.exp(-(at - 300) / 2200)))

    one = temperature(t) + 0.03 * rng.normal(size=t.size)
    two = temperature(t - 37) + 0.03 * rng.normal(size=t.size)
    table(tmp_path, "time_s,housing sensor A", (f"{a},{b:.2f}" for a, b in zip(t, one, strict=True)), "one.csv")
    rows = (f"{a},{rng.normal():.4f},{b:.2f}" for a, b in zip(t, two, strict=True))
    table(tmp_path, "time_s,bias [deg/h],housing sensor B", rows, "two.csv")
    draft = draft_map([str(tmp_path / "one.csv"), str(tmp_path / "two.csv")])
    (said,) = draft.notes
    value, low, high = (
        float(x) for x in re.findall(r"-?\d+\.?\d*(?:e[+-]?\d+)?(?= s|to| to)", said.split("add")[1])[:3]
    )
    assert low <= -37 <= high
    assert value == pytest.approx(-37, abs=2)
    assert high - low < 6
    assert "'housing sensor B' against 'housing sensor A'" in said


def test_what_a_file_states_above_its_table_fills_the_draft(tmp_path):
    rows = [f"{20 + k / 10:.1f}|{k / 100}|{k / 1e4}|{-k / 1e4}|{k / 2e4}" for k in range(30)]
    head = (
        "# f nominal = 4.546 kHz; sampling interval 10 s\nT_imu [m°C]|freq dev [ppm]|gx [rad/s]|gy [rad/s]|gz [rad/s]"
    )
    (file,) = tomllib.loads(draft_map([str(table(tmp_path, head, rows))]).text)["file"]
    assert (file["separator"], file["sample_period_s"]) == ("|", 10.0)
    temperature, frequency, *axes = file["column"]
    assert temperature["unit"] == "mdegC"
    assert frequency["nominal_Hz"] == 4546.0
    assert [axis["axis"] for axis in axes] == ["x", "y", "z"]


def test_a_number_that_nobody_stated_is_asked_for(tmp_path):
    """A nominal frequency of 1 Hz would pass for a result; a file without names gets a form for what was not understood."""
    rows = [f"{10 * k},{20 + k / 10},{k / 100}" for k in range(30)]
    with pytest.raises(InputError, match="nominal_Hz"):
        draft_and_import(table(tmp_path, "time_s,temp,freq dev [ppm]", rows), tmp_path)
    assert '# from = "column 3"\n# to = "..."' in draft_map([str(table(tmp_path, "", rows))]).text


def test_names_and_units_on_two_lines_of_a_table(tmp_path):
    rows = "".join(f"03/02/2026 11:00:{k:02d} AM,{20 + k / 10},{4432 + k / 10},{k / 10},\n" for k in range(30))
    (tmp_path / "raw.csv").write_text(f"Run 17,HRG,,,\nTime,Housing,Freq,ZRO,\n,degC,Hz,deg/h,\n{rows}")
    draft = draft_map([str(tmp_path / "raw.csv")])
    (file,) = tomllib.loads(draft.text)["file"]
    assert [(c["from"], c["unit"]) for c in file["column"]] == [("Housing", "degC"), ("Freq", "Hz"), ("ZRO", "deg/h")]
    assert draft.left_over == ()


@pytest.mark.parametrize(
    ("header", "value", "part"),
    [
        ("bias_deg_per_h", "1e19", "is not a possible reading"),
        ("frequency_Hz", "-3", "is not a possible reading"),
        ("inverse_q", "0.2", "allowed: -0.001 to 0.01"),  # Q = 5
    ],
)
def test_what_the_reader_refuses_is_not_imported(tmp_path, header, value, part):
    """The import refuses, with the line, what a record may not hold; the reader refuses the same."""
    rows = "".join(f"{k},{value if k == 4 else 0.005}\n" for k in range(9))
    (tmp_path / "raw.csv").write_text(f"time_s,{header}\n{rows}")
    with pytest.raises(InputError, match=rf"line 6.*{part}"):
        read_record(tmp_path / "raw.csv")
    (tmp_path / "map.toml").write_text(
        f'schema = "hrg.map/1"\n[[file]]\ntime = "time_s"\ntime_format = "s"\n[[file.column]]\nfrom = "{header}"\n'
        f'to = "{header}"\nunit = "{next(iter(units_of(header)))}"\n'
    )
    with pytest.raises(InputError, match=rf"line 6.*{part}"):
        import_records([str(tmp_path / "raw.csv")], load_map(tmp_path / "map.toml"))


def test_columns_of_one_quantity_tell_the_offset_before_others(tmp_path):
    """In a periodic run the frequency, late and of either sign, fits a false offset as well as the temperature fits the true one."""
    x = 5.0 * np.arange(2400)

    def wave(t):
        return 15.0 * np.sin(t / 900.0)

    first = (f"{t:.0f},{25 - wave(t):.4f}" for t in x)
    second = (f"{t - 7:.0f},{4432 - 0.35 * wave(t - 300):.5f},{25 - wave(t):.4f}" for t in x)
    a = table(tmp_path, "time_s,housing temperature", first, "a.csv")
    b = table(tmp_path, "time_s,frequency_Hz,chamber temp", second, "b.csv")
    assert offset_of(draft_map([str(a), str(b)])) == pytest.approx(7.0, abs=0.5)


@pytest.mark.parametrize(
    ("target", "unit", "reading", "value"),
    [
        ("bias_deg_per_h", "°/s", 2.0, 7200.0),
        ("bias_deg_per_h", "°/h", 2.0, 2.0),
        ("bias_deg_per_h", "mdps", 2.0, 7.2),
        ("bias_deg_per_h", "deg_per_h", 2.0, 2.0),
        ("bias_deg_per_h", "degrees per second", 2.0, 7200.0),
        ("measured_rate_deg_per_s", "m°/s", 2.0, 0.002),
        ("housing_temperature_degC", "°C", 25.0, 25.0),
        ("housing_temperature_degC", "deg F", 77.0, 25.0),
        ("quadrature_V", "µV", 5.0, 5e-6),
        ("pattern_angle_deg", "°", 45.0, 45.0),
        ("frequency_Hz", "ppm of 4400 Hz", 10.0, 4400.044),
        ("frequency_Hz", "ppm of 8 kHz", 10.0, 8000.08),
        ("frequency_Hz", "mHz", 4e6, 4000.0),
    ],
)
def test_units_as_people_write_them(tmp_path, target, unit, reading, value):
    record = simple(tmp_path, [f"0,{reading}", f"1,{reading}"], column=f'to = "{target}"\nunit = "{unit}"')
    assert record[target] == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    ("name", "drafted"),
    [
        ("f [ppm of 8 kHz]", 'unit = "ppm"\nnominal_Hz = 8000.0'),
        ("frequency [mHz]", 'unit = "mHz"'),
        ("bias [mdeg/h]", 'unit = "mdeg/h"'),
        ("rate [µrad/s]", 'unit = "urad/s"'),
        ("Temperature [mK]", 'unit = "mK"'),
        ("rate [nrad/s]", '# to = "..."\n# unit'),  # a size that nobody knows is no rad/s
        ("1/Q (ppb)", 'unit = "ppb"'),
        ("f/kHz", 'unit = "kHz"'),
        ("T/°C", 'unit = "degC"'),
        ("Q x1e6", 'unit = "Q"\nscale = 1000000.0    # CHECK'),  # the other way no Q, 1/Q or frequency is possible
        ("1/Q ×10^9", 'unit = "1/Q"\nscale = 1e-09    # CHECK'),
        ("f [Hz*1000]", 'unit = "Hz"\nscale = 1000.0    # CHECK'),
        (
            "rate x1000 [°/s]",
            "unit = \"deg/s\"\nscale = 0.0    # CHECK: the name says 'x1000': the quantity is 0.001 or 1000",
        ),  # 0 is refused
        ("Temp [2]", '# to = "..."\n# unit'),  # of a channel
        ("frequency [Hz] 2", 'unit = "Hz"\n'),
    ],
)
def test_a_draft_takes_the_unit_in_brackets_with_its_prefix(tmp_path, name, drafted):
    (tmp_path / "a.csv").write_text(f"time_s,{name}\n" + "".join(f"{k},{3 + k % 7}.5\n" for k in range(30)))
    assert drafted in draft_map([str(tmp_path / "a.csv")]).text


@pytest.mark.parametrize(
    ("name", "column", "value"),
    [
        *((name, "inverse_q", 1 / 3.5e6) for name in ("Q [1e6]", "Q (×10^6)", "Q / 1e6", "Q in 1e6", "Q [Mio]", "Q 1e6")),
        *((name, "inverse_q", 3.5e-9) for name in ("1/Q [1e-9]", "1/Q (10⁻⁹)", "1/Q / 10^-9", "1/Q [ppb]")),
        ("f [10 kHz]", "frequency_Hz", 35e3), ("f / 1e3 Hz", "frequency_Hz", 3500.0), ("bias [0.01 °/h]", "bias_deg_per_h", 0.035),
        ("T [100 K]", "housing_temperature_degC", 350 - 273.15), ("drive amplitude (100 mV)", "drive_amplitude_V", 0.35),
        *((name, "frequency_Hz", 7.0) for name in ("Frequency (f/2) [Hz]", "f_div2_Hz", "fhalf (Hz)", "f0/2 [Hz]")),
        *((name, "frequency_Hz", 1.75) for name in ("2f (Hz)", "freq_2f", "second harmonic freq (Hz)", "Frequenz (doppelte) [Hz]")),
        ("Drive frequency / 4 [Hz]", "frequency_Hz", 14.0), ("Freq (prescaler 10) [Hz]", "frequency_Hz", 35.0),
        *((name, "inverse_q", 1 / 3.5e6) for name in ("Q x10^6", "Q_1e6")), ("Q^-1 (1e-6)", "inverse_q", 3.5e-6),
        *((name, "bias_deg_per_h", -3.5) for name in ("-Bias (deg/h)", "Bias inverted (deg/h)", "\u2212Bias [°/h]")),
        ("Bias (deg/h/100)", "bias_deg_per_h", 0.035), ("Bias (LSB, 0.001 deg/h per LSB)", "bias_deg_per_h", 0.0035),
        *((name, "housing_temperature_degC", 23.5) for name in ("T case - 20 (°C)", "Tcase minus 20 °C", "Tcase [°C] (above 20 °C)", "T-293.15 K (°C)")),
        ("-(f - 4400) [Hz]", "frequency_Hz", 4396.5), ("f - 4.4 kHz [mHz]", "frequency_Hz", 4400.0035),
        ("Temp-1 (°C)", "housing_temperature_degC", 3.5), ("Temp - 2 [°C]", "housing_temperature_degC", 3.5),  # sensors
    ],
)  # fmt: skip
def test_a_heading_states_factor_offset_and_sign(tmp_path, name, column, value):
    """Each was the reading itself without a word, a frequency by a factor of 2 and 1/Q = 0.3, or nothing: the value follows from the heading."""
    raw = table(tmp_path, f"time_s;{name}", (f"{k};3.5" for k in range(30)))
    assert draft_and_import(raw, tmp_path)[column][0] == pytest.approx(value, rel=1e-12)
    assert all(
        "CHECK" in line for line in (tmp_path / "map.toml").read_text().splitlines() if re.match("scale|offset", line)
    )


@pytest.mark.parametrize(
    ("name", "form"),
    [("t[min]", "min"), ("t / min", "min"), ("t_min", "min"), ("time_min", "min"), ("t (h)", "h"), ("time_hours", "h"), ("T_h", ""),
     ("Time (0.1 s)", "0.1 s"), ("Time [10 ms]", "10.0 ms"), ("t [1/32768 s]", "3.0517578125e-05 s"), ("Время, мин", "min"), ("Zeit (0,1 s)", "0.1 s")],
)  # fmt: skip
def test_a_time_in_minutes_or_hours_is_seen_by_its_name(tmp_path, name, form):
    """Else a run becomes a table of settled readings, or its minutes seconds; `T_h` is a housing."""
    rows = (f"{k},{20 + k % 7},{4600 + k / 8},1" for k in range(30))
    draft = draft_map([str(table(tmp_path, f'"{name}",temp,freq [Hz],x', rows))])
    drafted = tomllib.loads(draft.text)
    assert drafted["file"][0].get("time_format", "") == form
    assert ("target" in drafted) == (not form)
    assert set(draft.left_over) == ({"x"} if form else {"x", "temp"})


def test_a_head_that_is_written_again_is_no_reading(tmp_path):
    head, rows = "time [s],temp [°C]", [f"{k},{20 + k / 10}" for k in range(9)]
    raw = table(tmp_path, head, [*rows[:5], head, *rows[5:]])
    assert draft_and_import(raw, tmp_path)["time_s"].tolist() == list(range(9))


def test_a_head_written_again_between_stamps_and_a_reading_that_stands_for_none(tmp_path):
    """With the head among them stamps were taken for seconds, and -999 for a temperature."""
    head = "Date,Time,Housing Temp (degC)"
    rows = [f"03/28/2026,12:30:{15 * k:02d} AM,{-999 if k == 2 else 20 + k / 10}" for k in range(4)]
    record = draft_and_import(table(tmp_path, head, [*rows[:3], head, *rows[3:]]), tmp_path)
    assert record["time_s"].tolist() == [0, 15, 30, 45]
    assert np.isnan(record["housing_temperature_degC"]).tolist() == [False, False, True, False]


def test_a_column_that_rises_and_has_a_meaning_is_no_clock(tmp_path):
    (tmp_path / "a.csv").write_text("freq [Hz],quad [V]\n" + "".join(f"{4600 + k / 8},{k % 7}\n" for k in range(30)))
    text = draft_map([str(tmp_path / "a.csv")]).text
    assert "sample_period_s = 0.0    # CHECK" in text
    assert 'to = "frequency_Hz"' in text


@pytest.mark.parametrize(
    ("target", "unit", "part"),
    [
        ("quadrature_V", "MV", "'MV' is unknown"),
        ("bias_deg_per_h", "°/min", "'°/min' is unknown"),
        ("frequency_Hz", "ppm of f0", "nominal_Hz"),
    ],
)
def test_a_unit_that_could_mean_another_size_is_refused(tmp_path, target, unit, part):
    with pytest.raises(InputError, match=part):
        simple(tmp_path, ["0,1", "1,2"], column=f'to = "{target}"\nunit = "{unit}"')


def write_days(tmp_path, clock, rows, form="%H:%M:%S"):
    """Files of a logger that begins a new one at midnight: `rows` are times in s since START's day began."""
    day = START.replace(hour=0, minute=0)
    files = []
    for number in sorted({int(t // 86400) for t in rows}):
        own = [t for t in rows if int(t // 86400) == number]
        text = "".join(f"{day + datetime.timedelta(seconds=t):{clock}},{20 + t / 86400:.6f}\n" for t in own)
        files.append(tmp_path / f"day{number}.csv")
        files[-1].write_text("clock,T housing [°C]\n" + text)
    return files


@pytest.mark.parametrize("clock", ["%H:%M:%S", "%Y-%m-%d %H:%M:%S"])
def test_days_that_were_rotated_at_midnight_are_one_record(tmp_path, capsys, clock):
    """Three days of a row a minute, the first begun at 22:00; one file a day, drafted and imported together."""
    rows = [60.0 * k for k in range(22 * 60, 60 * 60)]
    files = write_days(tmp_path, clock, rows)
    draft, run = tmp_path / "map.toml", tmp_path / "run.csv"
    assert hrg_import(*files, "--draft", draft) == 0
    assert tomllib.loads(draft.read_text())["file"][0]["parts"] == len(files) == 3
    offered = draft.read_text().replace('# timezone = "', 'timezone = "')
    assert tomllib.loads(offered)["file"][0]["timezone"] == "Europe/Berlin"
    assert hrg_import(*files, "--map", draft, "--out", run) == 0, capsys.readouterr().err
    record = read_record(run)
    assert np.allclose(record["time_s"], np.array(rows) - rows[0])
    assert np.allclose(record["housing_temperature_degC"], 20 + np.array(rows) / 86400, atol=1e-6)
    assert all(path.name in "".join(record.comments) for path in files)


def test_a_fault_in_a_later_day_is_named_by_its_own_file_and_line(tmp_path, capsys):
    files = write_days(tmp_path, "%Y-%m-%d %H:%M:%S", [3600.0 * k for k in range(60)])
    draft = tmp_path / "map.toml"
    hrg_import(*files, "--draft", draft)
    lines = files[1].read_text().splitlines()
    files[1].write_text("\n".join([*lines[:4], lines[4].replace(",", ",warm"), *lines[5:]]) + "\n")
    capsys.readouterr()
    assert hrg_import(*files, "--map", draft, "--out", tmp_path / "run.csv") == 2
    assert f"{files[1]}, line 5" in capsys.readouterr().err
    assert hrg_import(files[2], files[0], files[0], "--map", draft, "--out", tmp_path / "run.csv") == 2
    assert "in the order of their times" in capsys.readouterr().err


def test_two_loggers_of_one_kind_that_ran_together_stay_two_files(tmp_path):
    for name in ("one.csv", "two.csv"):
        write_counter(tmp_path / name, np.arange(0.0, 50.0))
    draft = draft_map([str(tmp_path / "one.csv"), str(tmp_path / "two.csv")])
    assert [file.get("parts") for file in tomllib.loads(draft.text)["file"]] == [None, None]


def local_log(tmp_path, moments, zone="Europe/Berlin", extra=""):
    """A logger that writes local time; `moments` are UTC."""
    import zoneinfo

    stamps = [moment.astimezone(zoneinfo.ZoneInfo(zone)).strftime("%Y-%m-%d %H:%M:%S") for moment in moments]
    form = f'time_format = "%Y-%m-%d %H:%M:%S"\ntimezone = "{zone}"{extra}'
    return simple(tmp_path, [f"{stamp},{4430 + k}" for k, stamp in enumerate(stamps)], form)


@pytest.mark.parametrize(
    ("begin", "minutes", "step"),
    [
        ((2026, 10, 24, 22, 0), 600, 10),  # through the whole change to winter time
        ((2026, 10, 25, 0, 20), 200, 10),  # begins in the first pass of the hour
        ((2026, 10, 25, 1, 20), 200, 10),  # begins in the second pass
        ((2026, 10, 24, 22, 0), 150, 10),  # ends in the first pass
        ((2026, 10, 24, 22, 0), 220, 10),  # ends in the second pass
        ((2026, 3, 28, 22, 0), 600, 10),  # the change to summer time: no hour is missing
    ],
)
def test_a_clock_change_takes_and_adds_no_time(tmp_path, begin, minutes, step):
    start = datetime.datetime(*begin, tzinfo=datetime.UTC)
    true = np.arange(0.0, 60.0 * minutes, 60.0 * step)
    record = local_log(tmp_path, [start + datetime.timedelta(seconds=t) for t in true])
    assert record["time_s"].tolist() == true.tolist()
    assert record.start == start


def test_a_time_that_no_clock_showed_is_named(tmp_path):
    form = 'time_format = "%Y-%m-%d %H:%M:%S"\ntimezone = "Europe/Berlin"'
    with pytest.raises(InputError, match=r"line 3: this time does not exist in Europe/Berlin"):
        simple(tmp_path, ["2026-03-29 01:59:00,1", "2026-03-29 02:30:00,2", "2026-03-29 03:30:00,3"], form)
    with pytest.raises(InputError, match="timezone"):
        simple(tmp_path, ["2026-10-25 02:59:00,1", "2026-10-25 02:00:00,2"], 'time_format = "%Y-%m-%d %H:%M:%S"')


def test_dropouts_are_left_empty_counted_and_marked(tmp_path, capsys):
    """A counter that loses its signal writes 0: twice for one row, once for three, and an hour has no rows at all."""
    from studies.reports.columns import find_gaps

    t = [10.0 * k for k in range(1000) if not 500 <= k < 860]
    lost = {100, 200, 201, 202, 900}
    raw, path, run = tmp_path / "raw.csv", tmp_path / "map.toml", tmp_path / "run.csv"
    raw.write_text("time_s,frequency Hz\n" + "".join(f"{s},{0 if s / 10 in lost else 4430.5}\n" for s in t))
    assert hrg_import(raw, "--draft", path) == 0
    assert hrg_import(raw, "--map", path, "--out", run, "--report", tmp_path / "page.html") == 0
    said = capsys.readouterr().out
    assert "5 readings of 'frequency Hz' are 0, a dropout: left empty" in said
    record = read_record(run)
    assert np.count_nonzero(np.isnan(record["frequency_Hz"])) == 5
    assert np.nanmin(record["frequency_Hz"]) == 4430.5
    expected = [[990, 1010], [1990, 2030], [4990, 8600], [8990, 9010]]
    assert find_gaps(record["time_s"], record["frequency_Hz"]).tolist() == expected
    page = (tmp_path / "page.html").read_text()
    assert "Longest gap (s)" in page
    assert "3610" in page
    raw.write_text("time_s,frequency_Hz\n0,4430\n1,0\n")
    with pytest.raises(InputError, match=r"line 3.*is not a possible reading"):
        read_record(raw)


@pytest.mark.parametrize(("separator", "decimal"), [(",", "."), ("tab", "."), (";", ",")])
def test_plain_numbers_are_read_as_numbers_and_equal_to_the_last_digit_what_is_read_as_text(
    tmp_path, separator, decimal
):
    rng, raw, written = np.random.default_rng(3), tmp_path / "raw.txt", tmp_path / "map.toml"
    table = np.column_stack([np.arange(500.0), 20 + rng.normal(size=500), 4430 + 1e-9 * rng.normal(size=500)])
    between = {"tab": "\t"}.get(separator, separator)
    cells = [[repr(float(value)).replace(".", decimal) for value in row] for row in table]
    cells[7][1], cells[9][1], cells[11][2] = "", "-999", "9,9E37".replace(",", decimal)
    raw.write_text("\n".join(between.join(row) for row in [["t", "T", "f"], *cells]) + "\n")
    written.write_text(
        f'schema = "hrg.map/1"\n[[file]]\nseparator = "{separator}"\ndecimal = "{decimal}"\nmissing = ["-999"]\n'
        'time = "t"\ntime_format = "s"\n[[file.column]]\nfrom = "f"\nto = "frequency_Hz"\nunit = "Hz"\n'
    )
    (file,) = load_map(written).files
    plain, text = (next(one)[1] for one in (read_plain(raw, file), read_raw(raw, file)))
    assert (plain.part, plain.rows) == (text.part, text.rows)
    for name in ("t", "T", "f"):
        np.testing.assert_array_equal(plain.numbers(name), text.numbers(name))
        assert plain.overloads[name] == text.overloads[name] == (name == "f")
    raw.write_text(raw.read_text() + between.join(["500", "see note", "1"]) + "\n")
    with pytest.raises(NotPlain):
        list(read_plain(raw, file))


@pytest.mark.slow
def test_portions_change_nothing(tmp_path, monkeypatch):
    """Stamps of summer and winter time, repeated times, and a counter brought onto them: whole, and 7 rows at a time."""
    begin = datetime.datetime(2026, 10, 25, 0, 30, tzinfo=datetime.UTC)
    zone = ZoneInfo("Europe/Berlin")
    stamps = [(begin + datetime.timedelta(seconds=20.0 * (k // 2))).astimezone(zone) for k in range(300)]
    rows = [f"{stamp:%Y-%m-%d %H:%M:%S},{20 + k / 100}" for k, stamp in enumerate(stamps)]
    (tmp_path / "one.csv").write_text("t,T\n" + "\n".join(rows) + "\n")
    rows = [f"{7.0 * k},{4430 + k / 1e3 if k % 50 > 9 else ''}" for k in range(450)]
    (tmp_path / "two.csv").write_text("t,f\n" + "\n".join(rows) + "\n")
    column = "[[file.column]]\nfrom = '{}'\nto = '{}'\nunit = '{}'\n"
    found = []
    for how in ("linear", "mean", "nearest", "previous"):
        (tmp_path / "map.toml").write_text(
            'schema = "hrg.map/1"\n[[file]]\ntime = "t"\ntime_format = "iso"\ntimezone = "Europe/Berlin"\nrepeated_times = "spread"\n'
            + column.format("T", "housing_temperature_degC", "degC")
            + '[[file]]\ntime = "t"\ntime_format = "s"\nstart = 2026-10-25T00:20:00Z\n'
            + column.format("f", "frequency_Hz", "Hz")
            + f'resample = "{how}"\n'
        )
        paths, loaded = [str(tmp_path / "one.csv"), str(tmp_path / "two.csv")], load_map(tmp_path / "map.toml")
        whole = import_records(paths, loaded)[""]
        with monkeypatch.context() as patch:
            for module in (clock, stored, numbers):
                patch.setattr(module, "ROWS_AT_ONCE" if module is numbers else "PORTION", 7)
            patch.setattr(raw, "CELLS_AT_ONCE", 21)
            patch.setattr(numbers, "FEW", 4)
            found.append((whole, import_records(paths, loaded)[""]))
    for whole, parts in found:
        assert np.ptp(np.diff(whole["time_s"])) < 1e-6
        assert whole.comments == parts.comments
        for name in whole.columns:
            np.testing.assert_allclose(parts[name], whole[name], rtol=1e-14, atol=0)


@pytest.mark.parametrize("rows", [300, 2500])
def test_lines_below_the_table_and_a_row_written_twice_in_a_repeated_hour(tmp_path, rows):
    """A day on which clocks went back: the times of an hour stand twice in the file, and one row really does."""
    begin = datetime.datetime(2025, 10, 26, 2, 50, tzinfo=ZoneInfo("Europe/Berlin")).timestamp()
    stamps = [datetime.datetime.fromtimestamp(begin + 10 * k, ZoneInfo("Europe/Berlin")) for k in range(rows)]
    body = [f"{s:%d.%m.%Y %H:%M:%S};{4430 + k % 30},5;{68 + k % 9},5" for k, s in enumerate(stamps)]
    body.insert(5, body[4])
    below = ["Ende der Messung;;", "Mittelwert;4444,5;71,2", ""]
    raw = tmp_path / "raw.csv"
    raw.write_text("\n".join(["Zeit;Frequenz [Hz];Gehäuse (F)", *body, *below]), encoding="utf-8")
    record = draft_and_import(raw, tmp_path, ("# timezone", "timezone"))
    assert record["time_s"].tolist() == [10.0 * k for k in range(rows)]
    assert record["housing_temperature_degC"] == pytest.approx([(36.5 + k % 9) / 1.8 for k in range(rows)])


def test_a_temperature_that_rises_is_no_time_and_local_stamps_of_the_file_may_have_a_zone(tmp_path):
    h5py, pandas = pytest.importorskip("h5py"), pytest.importorskip("pandas")
    with h5py.File(tmp_path / "lab.h5", "w") as file:
        file["T"], file["time"], file["f"] = 293.15 + np.arange(50.0), 60.0 * np.arange(50), 4432.0 + np.arange(50)
        file["T"].attrs["unit"], file["f"].attrs["unit"] = "K", "Hz"
    record = draft_and_import(tmp_path / "lab.h5", tmp_path)
    assert record["time_s"].tolist() == [60.0 * k for k in range(50)]
    assert record["housing_temperature_degC"] == pytest.approx(20.0 + np.arange(50))
    pytest.importorskip("pyarrow")
    local = pandas.date_range("2026-03-29 00:30", periods=50, freq="10min", tz="Europe/Berlin").tz_localize(None)
    pandas.DataFrame({"when": local, "frequency_Hz": 4432.0 + np.arange(50), "T_housing_F": 32.0 + 1.8 * np.arange(50)}).to_parquet(tmp_path / "lab.parquet")  # fmt: skip
    record = draft_and_import(tmp_path / "lab.parquet", tmp_path, ("# timezone", "timezone"))
    assert record["time_s"].tolist() == pytest.approx(600.0 * np.arange(50))
    assert record["housing_temperature_degC"] == pytest.approx(np.arange(50.0))


def test_the_group_of_a_temperature_says_whose_it_is(tmp_path):
    h5py = pytest.importorskip("h5py")
    t = np.arange(50.0)
    columns = {"chamber": ("T", 20 + 0.02 * t), "gyro": ("f", 4432 + t % 7), "housing": ("T", 20 + 0.01 * t)}
    with h5py.File(tmp_path / "lab.h5", "w") as file:
        for group, (name, values) in columns.items():
            file[f"{group}/t"], file[f"{group}/{name}"] = t, values
    record = draft_and_import(tmp_path / "lab.h5", tmp_path)
    assert record["chamber_temperature_degC"] == pytest.approx(20 + 0.02 * t)
    assert record["housing_temperature_degC"] == pytest.approx(20 + 0.01 * t)


def test_lines_below_the_table_of_one_of_several_files_end_no_other(tmp_path):
    for name, begin, below in (("a.csv", 0, "end;;\n"), ("b.csv", 300, "")):
        lines = [f"{begin + k};{4432 + k % 7};{20 + k % 5}" for k in range(300)]
        (tmp_path / name).write_text("\n".join(["time_s;frequency_Hz;T (C)", *lines, below]))
    assert "last_line" not in draft_map([str(tmp_path / name) for name in ("a.csv", "b.csv")]).text


def planted(folder, head, cells):
    """A table of `;` and 40 rows of text, and what its draft says behind CHECK."""
    path = table(folder, head, (";".join(cells(k)) for k in range(40)))
    record = draft_and_import(path, folder)
    said = [line.partition("CHECK: ")[2] for line in (folder / "map.toml").read_text().splitlines()]
    return record, [line for line in said if line]


def german(value, digits):
    return f"{value:,.{digits}f}".translate(str.maketrans(",.", ".,"))


@pytest.mark.parametrize(
    ("frequency", "temperature", "step", "said"),
    [
        (lambda f: german(f, 3), lambda T: german(T, 1), 0.125, None),  # 4.400,125 shows both signs
        (lambda f: german(f, 0), lambda T: german(T, 1), 1, "'4.400' is read as 4400, not as 4.4"),
        (lambda f: german(f, 0), lambda T: f"{T:.0f}", 1, "'4.400' is read as 4400, not as 4.4"),  # no comma at all
        (lambda f: f"{f:,.0f}", lambda T: f"{T:.1f}", 1, "'4,400' is read as 4400, not as 4.4"),
        (lambda f: f"{f:,.0f}", lambda T: f"{T:.0f}", 1, "'4,400' is read as 4400, not as 4.4"),
        (lambda f: f"{f:,.3f}".replace(",", "\u202f"), lambda T: f"{T:.0f}", 0.125, None),  # a narrow blank
        (lambda f: f"{f:.3f}", lambda T: f"{T:.3f}", 0.125, None),  # 20.000 beside 4400.125
    ],
)
def test_planted_signs_of_numbers_are_told_by_all_cells(tmp_path, frequency, temperature, step, said):
    """4.400 was read as 4.4 Hz, without a word."""
    record, checks = planted(
        tmp_path,
        "t [s];freq [Hz];temp [°C]",
        lambda k: (str(10 * k), frequency(4400 + step * k), temperature(20.0 + k)),
    )
    assert [check for check in checks if "is read as" in check] == ([said] if said else [])
    assert record["frequency_Hz"].tolist() == [4400 + step * k for k in range(40)]
    assert record["housing_temperature_degC"].tolist() == [20.0 + k for k in range(40)]


def test_planted_times_beyond_a_thousand_seconds(tmp_path):
    """990, 1.000, 1.010 rise as thousands only; three decimals that could be thousands, and nothing else, are asked for."""
    head = "t [s];freq [Hz]"
    record, checks = planted(tmp_path, head, lambda k: (german(10.0 * k + 800, 0), german(4400 + k / 10, 1)))
    assert record["time_s"].tolist() == [10.0 * k for k in range(40)]
    assert not checks
    record, checks = planted(tmp_path, "t [s];quad", lambda k: (str(10 * k), f"{1 + k / 1e3:.3f}"))
    assert record["quadrature_V"][2] == 1.002
    assert "'1.000' is read as 1; if '.' parts thousands, write decimal = ',', thousands = '.'" in checks


@pytest.mark.parametrize(
    ("signs", "cell", "read"),
    [
        ('decimal = ","\nthousands = "."', "4.400,5", 4400.5),
        ('decimal = ","\nthousands = "."', "4.400", 4400.0),
        ('decimal = ","\nthousands = "."', "20.5", None),  # was 205
        ('decimal = ","', "20.5", 20.5),
        ('decimal = ","', "4.400", None),  # was 4.4
        ('decimal = ","', "4400,5 Hz", 4400.5),
        ("", "4.4e3Hz", 4400.0),
        ("", "4.4 kHz", None),
        ("", "\u22124400.5", -4400.5),
    ],
)
def test_a_cell_that_the_map_does_not_describe_is_refused_by_its_line(tmp_path, signs, cell, read):
    sign = "sign = -1\n" if read and read < 0 else ""
    column = f'{sign}to = "frequency_Hz"\nunit = "Hz"'
    rows = [f"{k};{cell}" for k in range(3)]
    extra = f'separator = ";"\ntime_format = "s"\n{signs}'
    if read is None:
        with pytest.raises(InputError, match=r"line 2: '.*' in column 'x' is not a number in the unit of the map"):
            simple(tmp_path, rows, extra, column, "t;x")
    else:
        assert simple(tmp_path, rows, extra, column, "t;x")["frequency_Hz"].tolist() == [abs(read)] * 3


@pytest.mark.parametrize(
    ("names", "expected", "said"),
    [
        (("f-4400",), ("frequency_Hz",), "the name says '-4400'"),
        (("Frequency deviation",), (None,), "its name says 'deviation', so nothing was made of it"),
        (("freq error",), (None,), "its name says 'error', so nothing was made of it"),
        (("bias sd",), (None,), "its name says 'sd', so nothing was made of it"),
        (("Sampling frequency",), (None,), "its name says 'sampling', so nothing was made of it"),
        (("sample",), (None,), "its name says 'sample', so nothing was made of it"),
        (("Frequenzabweichung [Hz]", "Frequenz [Hz]"), (None, "frequency_Hz"), "its name says 'deviation', so nothing was made of it"),
        (("laser temp", "chamber temp", "resonator temperature"), (None, "chamber_temperature_degC", "housing_temperature_degC"), "its name says 'laser'"),
        (("Temp ref", "T"), (None, "housing_temperature_degC"), "its name says 'ref'"),
        (("Temp ref",), ("housing_temperature_degC",), "its name says 'ref'"),
        (("T_gyro", "freq"), ("housing_temperature_degC", None), ""),  # once a rate
        (("temp board", "T_case [°C]"), (None, "housing_temperature_degC"), "its name says 'board'"),
        (("chamber setpoint", "chamber actual"), (None, "chamber_temperature_degC"), "its name says 'setpoint'"),
        (("chamber pressure", "chamber"), (None, "chamber_temperature_degC"), "its name says 'pressure'"),
        (("temp 1", "temp 2", "temp 3"), ("housing_temperature_degC", "chamber_temperature_degC", None), "or 'temp 3', which fits as well"),
        (("frequency",), ("frequency_Hz",), "its values are unusual for that"),
    ],
)  # fmt: skip
def test_planted_headings_are_taken_for_what_they_say(tmp_path, names, expected, said):
    """Each was the wrong quantity without a word: the first candidate won, whatever else its name said."""
    values = 20 + 5 * np.sin(np.arange(40) / 9)
    readings = [values - 20.5 if name == "f-4400" else values for name in names]
    rows = [",".join([f"{10 * k}", *(f"{own[k]:.4f}" for own in readings)]) for k in range(40)]
    text = draft_map([str(table(tmp_path, ",".join(["time_s", *names]), rows))]).text
    found = {column["from"]: column for column in tomllib.loads(text)["file"][0].get("column", [])}
    wanted = [(name, target) for name, target in zip(names, expected, strict=True) if name != "freq"]
    assert [(name, found.get(name, {}).get("to")) for name, _ in wanted] == wanted
    assert any(said in line for line in text.splitlines() if "CHECK" in line)
    if "f-4400" in found:
        assert found["f-4400"]["offset"] == 4400.0


def test_of_two_columns_of_one_name_the_one_with_the_values_is_taken(tmp_path):
    rows = (f"{k},{0.1 * (k % 7):.1f},{4400 + k / 10:.1f}" for k in range(40))
    record = draft_and_import(table(tmp_path, "time_s,freq 1 [Hz],freq 2 [Hz]", rows), tmp_path)
    assert record["frequency_Hz"][0] == 4400


@pytest.mark.parametrize(
    ("begin", "step", "zone", "leap"),
    [
        ((2026, 3, 28, 22), 600, "Europe/Berlin", "after 2026-03-29 01:50:00 comes 03:00:00, an hour more"),
        ((2026, 3, 28, 22), 3600, "Europe/London", "after 2026-03-29 00:00:00 comes 02:00:00, an hour more"),
        ((2026, 3, 8, 5), 1, "America/New_York", "after 2026-03-08 01:59:59 comes 03:00:00, an hour more"),
        ((2026, 10, 24, 22), 3600, "Europe/Berlin", "after 2026-10-25 02:00:00 comes 02:00:00, an hour less"),
        ((2026, 10, 24, 22), 600, "Europe/Berlin", "after 2026-10-25 02:50:00 comes 02:00:00, an hour less"),
        ((2026, 5, 1, 22), 600, "Europe/Berlin", ""),
        ((2026, 3, 28, 22), 600, "Etc/GMT-1", ""),
    ],
)
def test_planted_changes_of_clocks_are_said(tmp_path, capsys, begin, step, zone, leap):
    """Local stamps through a night in which clocks change: the draft and the import say it, and the zone that they name mends it."""
    start = datetime.datetime(*begin, tzinfo=datetime.UTC)
    count = 40 if step == 3600 else 60 if step == 600 else 7210
    moments = [(start + datetime.timedelta(seconds=step * k)).astimezone(ZoneInfo(zone)) for k in range(count)]
    raw, out, run = (tmp_path / name for name in ("raw.csv", "map.toml", "run.csv"))
    table(tmp_path, "time,frequency [Hz]", (f"{at:%Y-%m-%d %H:%M:%S},{4400 + k / 1e4}" for k, at in enumerate(moments)))
    assert hrg_import(raw, "--draft", out) == 0
    text = out.read_text()
    if step > 1:  # the draft looks at the first rows only
        assert ("CHECK: " + leap in text) if leap else "clocks change then" not in text
    assert hrg_import(raw, "--map", out, "--out", run) == (2 if step == 600 and "less" in leap else 0)
    said = capsys.readouterr()
    assert (leap in said.out if step != 600 or "more" in leap else "give 'timezone'" in said.err) if leap else "CHECK: after" not in said.out  # fmt: skip
    if leap:
        out.write_text(re.sub('# timezone = ".*?"', f'timezone = "{zone}"', text))
        assert hrg_import(raw, "--map", out, "--out", run) == 0
        assert read_record(run)["time_s"].tolist() == [float(step * k) for k in range(count)]
        assert "clocks change then" not in capsys.readouterr().out


def test_a_packed_table_is_read_as_the_table(tmp_path):
    import gzip

    text = "time_s,frequency [Hz],T [°C]\n" + "".join(f"{k},{4400 + k / 8},{20 + k / 4}\n" for k in range(50))
    (tmp_path / "raw.csv.gz").write_bytes(gzip.compress(text.encode()))
    record = draft_and_import(tmp_path / "raw.csv.gz", tmp_path)
    assert record["frequency_Hz"].tolist() == [4400 + k / 8 for k in range(50)]
    (tmp_path / "raw.csv.gz").write_bytes(gzip.compress(text.encode())[:-40])
    with pytest.raises(InputError, match=r"raw\.csv\.gz: cannot be unpacked by gzip"):
        draft_map([str(tmp_path / "raw.csv.gz")])


@pytest.mark.parametrize(
    ("stamp", "form", "said"),
    [
        ("{:%Y-%m-%dT%H:%M:%S},5", "iso", ""),
        ("{:%d.%m.%Y %H:%M:%S},5", "%d.%m.%Y %H:%M:%S.%f", ""),
        ("{:%d/%m/%Y %H:%M:%S}", "%d/%m/%Y %H:%M:%S", "day and month could be exchanged; or '%m/%d/%Y %H:%M:%S'"),
        ("{:%d-%m-%Y %I:%M:%S %p}", "%d-%m-%Y %I:%M:%S %p", "day and month could be exchanged"),
        ("{:%d.%m.%Y %Hh%Mm%Ss}", "%d.%m.%Y %Hh%Mm%Ss", ""),
        ("{:%Hh%Mm%Ss}", "%Hh%Mm%Ss", "no date"),
        ("{:%d-%b-%Y %H:%M:%S}", "%d-%b-%Y %H:%M:%S", ""),
        ("{:%Y%m%d%H%M%S}", "%Y%m%d%H%M%S", ""),  # once seconds, of 37 and 77 s
        ("{:%Y%m%dT%H%M%S}", "iso", ""),
    ],
)
def test_planted_stamps_are_read_or_asked_for(tmp_path, stamp, form, said):
    begin = datetime.datetime(2026, 3, 1, 10)
    record, checks = planted(
        tmp_path,
        "time;frequency [Hz]",
        lambda k: (stamp.format(begin + datetime.timedelta(seconds=37 * k)), f"{4400 + k / 10}"),
    )
    assert record["time_s"].tolist() == [37.0 * k for k in range(40)]
    assert f'time_format = "{form}"' in (tmp_path / "map.toml").read_text()
    assert [said in check for check in checks] == [True] * bool(said)
    if "%Y" in stamp:
        assert record.start == begin + datetime.timedelta(seconds=0.5 if ",5" in stamp else 0)


def test_days_that_pass_midnight_tell_day_from_month(tmp_path):
    """01/03 and 02/03 lie a day apart by one order, a month by the other."""
    begin = datetime.datetime(2026, 3, 1, 23, 50)
    record, checks = planted(
        tmp_path,
        "time;frequency [Hz]",
        lambda k: (f"{begin + datetime.timedelta(hours=2 * k):%m/%d/%Y %H:%M}", f"{4400 + k / 10}"),
    )
    assert record.start == begin
    assert record["time_s"].tolist() == [7200.0 * k for k in range(40)]
    assert not checks


def test_units_and_a_printed_minus_in_cells_are_read(tmp_path):
    record, checks = planted(
        tmp_path,
        "Zeit;Frequenz;Temperatur",
        lambda k: (f"{2 * k} min", f"{4400 + k},5 Hz", f"\u2212{20 + k},25 °C"),
    )
    assert record["time_s"][3] == 360
    assert record["frequency_Hz"][3] == 4403.5
    assert record["housing_temperature_degC"][3] == -23.25
    assert not checks


@pytest.mark.parametrize(
    ("encoding", "names"),
    [
        ("utf-8", "Temps (s);Température boîtier (°C);Fréquence (Hz);Dérive (°/h)"),
        ("cp1252", "Temps (s);Température boîtier (°C);Fréquence (Hz);Dérive (°/h)"),
        ("cp1252", "Zeit [s];Gehäusetemperatur [°C];Frequenz [Hz];Nullpunkt [°/h]"),
        ("cp850", "Zeit [s];Gehäusetemperatur [°C];Frequenz [Hz];Drift Prüfling [°/h]"),
        ("utf-8", "Tiempo (s);Temperatura carcasa (°C);Frecuencia (Hz);Deriva (°/h)"),
        ("cp1251", "Время, с;Температура корпуса, °С;Частота, Гц;Скорость дрейфа, град/ч"),
        ("gb18030", "时间(s);壳体温度(℃);谐振频率(Hz);零偏(°/h)"),
        ("cp932", "時間[s];筐体温度[℃];周波数[Hz];バイアス[deg/h]"),
        ("utf-8", "Aika (s);Kotelo (°C);Taajuus (Hz);Ryömintä (°/h)"),  # by their units
    ],
)
def test_headings_of_other_languages_and_code_pages(tmp_path, encoding, names):
    (tmp_path / "raw.csv").write_bytes("\n".join([names, *(f"{10 * k};{20 + k / 8};{4432 + k / 8};{2 + k / 8}" for k in range(40)), ""]).encode(encoding))  # fmt: skip
    record = draft_and_import(tmp_path / "raw.csv", tmp_path)
    for name, first in (("housing_temperature_degC", 20), ("frequency_Hz", 4432), ("bias_deg_per_h", 2)):
        assert record[name] == pytest.approx(first + np.arange(40) / 8)
    text = (tmp_path / "map.toml").read_text()
    assert f'encoding = "{encoding}"' in text
    assert ("its name hardly says so" in text) == ("Aika" in names)
    assert ("CHECK: by the words" in text) == (encoding not in ("utf-8", "cp1252"))


def test_a_draft_that_recognises_no_column_says_what_to_do(tmp_path, capsys):
    raw = table(tmp_path, "zeit_s,alpha,beta", (f"{k},{k % 7},{k % 5}" for k in range(30)))
    assert hrg_import(raw, "--draft", tmp_path / "map.toml") == 0
    assert "No column was recognised. Next: in the map, take the # off" in capsys.readouterr().out
    assert hrg_import(raw, "--map", tmp_path / "map.toml", "--out", tmp_path / "run.csv") == 2
    assert "take the # off the blocks" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("stamp", "remark"),
    [
        (lambda k: f"{10 * k}", "# door opened, by AK, twice, at once"),
        (lambda k: f"{10 * k}", "*** alarm acknowledged ***"),
        (lambda k: f"2026-03-03 08:{k // 6:02d}:{k % 6}0", "# door opened"),
        (lambda k: f"2026-03-03 08:{k // 6:02d}:{k % 6}0", "*** alarm ***"),
    ],
)
def test_remarks_between_rows_are_left_out_and_told(tmp_path, stamp, remark):
    rows = [f"{stamp(k)},{20 + k / 8},{4432 + k / 8}" for k in range(40)]
    record = draft_and_import(table(tmp_path, "time,T_case (°C),f (Hz)", [*rows[:9], remark, *rows[9:]]), tmp_path)
    assert record["time_s"].tolist() == [10.0 * k for k in range(40)]
    assert any("1 row without a time left out" in note and "line 11" in note for note in record.comments)


def test_a_label_that_begins_with_a_hash_is_no_remark(tmp_path):
    rows = [f"#{k},{10 * k},{4432 + k / 8}" for k in range(40)]
    record = draft_and_import(table(tmp_path, "row,time_s,f (Hz)", [*rows[:9], "# door", *rows[9:]]), tmp_path)
    assert record["time_s"].tolist() == [10.0 * k for k in range(40)]


def test_impossible_readings_are_dropped_where_the_map_says_so(tmp_path):
    """An open thermocouple reads 850 °C; the refusal names the key."""
    rows = [f"{k},{850 if k in (4, 5) else 20 + k / 8}" for k in range(40)]
    raw = table(tmp_path, "time_s,T_case (°C)", rows)
    with pytest.raises(InputError, match=r"line 6, .* = 850 is not a possible reading .* drop = \['impossible'\]"):
        draft_and_import(raw, tmp_path)
    record = draft_and_import(raw, tmp_path, ('unit = "degC"', 'unit = "degC"\ndrop = ["impossible"]'))
    assert np.flatnonzero(np.isnan(record["housing_temperature_degC"])).tolist() == [4, 5]
    assert any("2 readings of 'T_case (°C)' are impossible: left empty" in note for note in record.comments)


def test_a_remark_between_rows_of_a_workbook_is_left_out_as_in_a_text(tmp_path):
    openpyxl = pytest.importorskip("openpyxl", reason="the optional extra 'excel' is not installed")
    rows = [["time_s", "frequency [Hz]", "T [°C]"], *([10 * k, 4400 + k / 8, 20.5 + k] for k in range(20))]
    rows.insert(9, ["# door opened", None, None])
    book = openpyxl.Workbook()
    for row in rows:
        book.active.append(row)
    book.save(tmp_path / "raw.xlsx")
    (tmp_path / "raw.csv").write_text("\n".join(",".join("" if x is None else str(x) for x in row) for row in rows))
    for name in ("raw.xlsx", "raw.csv"):
        record = draft_and_import(tmp_path / name, tmp_path)
        assert record["time_s"].tolist() == [10.0 * k for k in range(20)]
        assert any(
            f"1 row without a time left out (first: {tmp_path / name}, line 10)" in one for one in record.comments
        )


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-8", "gb18030"])
def test_a_long_text_is_drafted_from_its_first_bytes_whatever_letter_they_end_in(tmp_path, monkeypatch, encoding):
    raw = tmp_path / "raw.csv"
    rows = [f"{k};{20 + k / 8};好" for k in range(100)]
    raw.write_text(
        "\ufeff" * (encoding == "utf-16-le") + "\n".join(["time [s];温度 [°C];备注", *rows]), encoding=encoding
    )
    for most in range(600, 610):
        monkeypatch.setattr(look, "HEAD", most)
        assert draft_map([str(raw)]).mapped == ("housing_temperature_degC",)


def test_a_quote_that_does_not_end_hides_no_rows(tmp_path):
    raw = tmp_path / "raw.csv"
    raw.write_text("time [s],T [°C],note\n" + "".join(f"{k},{20 + k / 8},{chr(34) * (k == 9)}ok\n" for k in range(20)))
    with pytest.raises(InputError, match=r"line 21: cannot be split .*; correct its quotes"):
        draft_and_import(raw, tmp_path)


def test_a_workbook_with_a_date_and_a_time_of_day_in_two_columns(tmp_path):
    openpyxl = pytest.importorskip("openpyxl", reason="the optional extra 'excel' is not installed")
    book = openpyxl.Workbook()
    book.active.append(["Date", "Time", "T_case (°C)"])
    moments = [START + datetime.timedelta(seconds=10 * k) for k in range(40)]  # over midnight
    for k, moment in enumerate(moments):
        book.active.append([moment.date(), moment.time(), 20 + k / 8])
    book.save(tmp_path / "raw.xlsx")
    record = draft_and_import(tmp_path / "raw.xlsx", tmp_path)
    assert (record.start, record["time_s"].tolist()) == (START, [10.0 * k for k in range(40)])


@pytest.mark.parametrize(
    ("name", "cell"),
    [
        ("Elapsed (h:mm:ss)", lambda s: f"{s // 3600}:{s // 60 % 60:02d}:{s % 60:02d}"),
        ("Time", lambda s: f"{s // 86400}.{s // 3600 % 24:02d}:{s // 60 % 60:02d}:{s % 60:02d}"),
        ("Elapsed (mm:ss.0)", lambda s: f"{s // 60}:{s % 60:04.1f}"),
        ("Laufzeit", lambda s: str(datetime.timedelta(seconds=s))),
    ],
)
def test_an_elapsed_time_passes_a_day(tmp_path, name, cell):
    record = draft_and_import(table(tmp_path, f"{name};f (Hz)", (f"{cell(3600 * k)};{4432 + k / 8}" for k in range(40))), tmp_path)  # fmt: skip
    assert record["time_s"].tolist() == [3600.0 * k for k in range(40)]
    assert record.start is None


def test_numbers_in_a_header_are_no_table(tmp_path):
    """LabVIEW's .lvm states the samples, dates and steps of its channels above them, in the columns of the table."""
    head = ["Separator\tTab", "Samples\t40\t40", "Date\t2026/03/03\t2026/03/03", "X0\t0.0E+0\t0.0E+0", "***End_of_Header***\t\t", "X_Value\tCase temperature\tFrequency"]  # fmt: skip
    record = draft_and_import(table(tmp_path, "", [*head, *(f"{10 * k}\t{20 + k / 8}\t{4432 + k / 8}" for k in range(40))]), tmp_path)  # fmt: skip
    assert record["time_s"].tolist() == [10.0 * k for k in range(40)]
    assert record["frequency_Hz"][0] == 4432


def test_a_missing_hour_tells_day_from_month(tmp_path):
    """03/08 is the day of March on which clocks in New York skip an hour, not one of August."""
    begin = datetime.datetime(2026, 3, 8, 5, 30, tzinfo=datetime.UTC)
    stamps = [(begin + datetime.timedelta(minutes=k)).astimezone(ZoneInfo("America/New_York")) for k in range(200)]
    draft = draft_map([str(table(tmp_path, "time,f (Hz)", (f"{at:%m/%d/%Y %H:%M},{4432 + k / 8}" for k, at in enumerate(stamps))))])  # fmt: skip
    assert 'time_format = "%m/%d/%Y %H:%M"' in draft.text
    assert '# timezone = "America/New_York"' in draft.text


def test_milliseconds_in_a_column_of_their_own(tmp_path):
    """Without leading zeros 55 ms was read as 0.55 s by %f, or left unused and the rows of a second spread."""
    at = [55 * k for k in range(40)]
    rows = [f"2026-03-03;08:00:{ms // 1000:02d};{ms % 1000};{4432 + k / 8}" for k, ms in enumerate(at)]
    raw = table(tmp_path, "Date;Time;ms;f (Hz)", rows)
    assert draft_and_import(raw, tmp_path)["time_s"] == pytest.approx(np.array(at) / 1e3, abs=1e-9)
    with pytest.raises(InputError, match=r"%f takes 55 for 0\.55; of a column of its own write '\+ ms'"):
        draft_and_import(raw, tmp_path, (" + ms", " %f"))
