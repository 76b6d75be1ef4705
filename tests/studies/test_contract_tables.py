"""Contract: a file that is not a record, a table or a profile is refused with its line or column, and nothing is guessed."""

import datetime
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studies.errors import InputError
from studies.files import columns, numbers
from studies.files.writing import written_whole
from studies.record import Record, read_frequency_table, read_profile, read_record, reading_resolution, write_record

RECORD = "time_s,frequency_Hz\n"
TABLE = "temperature_degC,frequency_Hz\n"
BAD = [
    # (reader, content, words that the message must hold)
    (read_record, b"", ["empty"]),
    (read_record, b"   \n\n", ["empty"]),
    (read_record, b"# only a comment\n", ["header"]),
    (read_record, RECORD.encode(), ["no rows"]),
    (read_record, b"frequency_Hz\n1\n", ["'time_s'", "missing"]),
    (read_record, b"time_s,frequncy_Hz\n0,1\n", ["line 1", "'frequncy_Hz'", "frequency_Hz"]),
    (read_record, b"time_s,frequency_Hz,frequency_Hz\n0,1,1\n", ["twice"]),
    (read_record, b"time_s;frequency_Hz\n0;1\n", ["commas", "hrg import"]),
    (read_record, b"0,4432.07\n1,4432.08\n", ["header"]),
    (read_record, b"time_s,frequency_Hz\n0,1\n1,abc\n", ["line 3", "'abc'", "frequency_Hz"]),
    (read_record, b"time_s,frequency_Hz\n0,1\n1,nan\n", ["line 3", "'nan'"]),
    (read_record, b"time_s,frequency_Hz\n0,1\n1,inf\n", ["line 3", "'inf'"]),
    (read_record, b"time_s,frequency_Hz\n0,1_0\n", ["line 2"]),
    (read_record, b"time_s,bias_deg_per_h\n0,1\n1,-1e21\n", ["line 3", "is not a possible reading"]),
    (read_record, b"time_s,bias_deg_per_h\n0,1\n1,1e400\n", ["line 3", "is not a possible reading"]),
    (read_record, b"time_s,frequency_Hz\n0,1,5\n", ["line 2", "3 values", "2 columns"]),
    (read_record, b"time_s,frequency_Hz\n0,4432,07\n", ["decimal commas"]),
    (read_record, b"time_s,frequency_Hz,inverse_q\n0,1,1\n1,21\n2,1,1,5\n", ["line 3", "2 values", "3 columns"]),
    (read_record, b"time_s,frequency_Hz\n0,1\n0,2\n", ["line 3", "does not increase"]),
    (read_record, b"time_s,frequency_Hz\n,1\n", ["line 2", "time_s is empty"]),
    (read_record, b"time_s,frequency_Hz\n0,1\n# late\n1,2\n", ["line 3", "above the header"]),
    (read_record, b"time_s,housing_temperature_degC\n0,293.15\n", ["line 2", "kelvin", "273.15"]),
    (read_record, b"temperature_degC,frequency_Hz\n1,2\n", ["steady-state table"]),
    (read_record, b"# start: yesterday\ntime_s,frequency_Hz\n0,1\n", ["start", "ISO 8601"]),
    (read_record, b"# resolution frequency: 0.01\ntime_s,frequency_Hz\n0,1\n", ["resolution", "frequency_Hz"]),
    (read_record, b"# resolution frequency_Hz: zero\ntime_s,frequency_Hz\n0,1\n", ["number"]),
    (read_record, "time_s,frequency_Hz\n0,1\n".encode("utf-16"), ["zero bytes"]),
    (read_record, b"time_s,frequency_Hz\n0,1\n\xff\xfe", ["line 3", "UTF-8"]),
    (read_frequency_table, b"temperature_degC\n1\n", ["'frequency_Hz'", "missing"]),
    (read_frequency_table, b"temperature_degC,frequency_Hz\n1,\n", ["line 2", "frequency_Hz is empty"]),
    (read_frequency_table, b"temperature_degC,frequency_Hz\n293.15,4432\n", ["kelvin"]),
    (read_frequency_table, b"temperature_degC,frequency_Hz\n20,-4432\n", ["line 2", "possible"]),
    (read_frequency_table, b"temperature_degC,frequency_Hz\n20,4.43207\n", ["line 2", "kHz", "1000"]),
    (read_profile, b"time_s,chamber_temperature_degC\n0,20\n0,30\n", ["line 3", "does not increase"]),
    (read_profile, b"time_s,temperature\n0,20\n", ["'temperature'"]),
]


@pytest.mark.parametrize(("reader", "content", "words"), BAD)
def test_bad_file_is_refused_by_name_line_and_mend(tmp_path, reader, content, words):
    path = tmp_path / "run.csv"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        reader(path)
    message = str(caught.value)
    assert str(path) in message
    for word in words:
        assert word in message
    assert "\n" not in message


def test_missing_file_and_folder_are_named(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_record(tmp_path / "none.csv")
    with pytest.raises(InputError, match="folder"):
        read_record(tmp_path)


def test_empty_cells_are_missing_values(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("time_s,frequency_Hz,bias_deg_per_h\n0,4432.1,\n1,,0.5\n")
    record = read_record(path)
    assert np.isnan(record["bias_deg_per_h"][0])
    assert np.isnan(record["frequency_Hz"][1])
    with pytest.raises(InputError, match="'inverse_q' is missing"):
        record["inverse_q"]


def test_notes_of_a_record_are_read(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(
        "# free words\n# instrument: gyro 7\n# start: 2026-01-31T12:00:00\n# resolution frequency_Hz: 0.01\n"
        "time_s,frequency_Hz\n0,4432.1\n"
    )
    record = read_record(path)
    assert record.instrument == "gyro 7"
    assert record.start == datetime.datetime(2026, 1, 31, 12)
    assert record.resolution == {"frequency_Hz": 0.01}
    assert record.comments == ("free words",)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    values=st.lists(st.one_of(st.none(), st.floats(-1e10, 1e10, width=64)), min_size=1, max_size=30),
    note=st.text(
        st.characters(codec="utf-8", exclude_characters="\r\n\0", exclude_categories=["Cs", "Zl", "Zp", "Cc"])
    ),
)
def test_record_survives_writing_and_reading_to_the_last_bit(tmp_path_factory, values, note):
    path = tmp_path_factory.mktemp("round") / "run.csv"
    bias = np.array([np.nan if v is None else v for v in values])
    record = Record({"time_s": np.arange(len(values)) / 7, "bias_deg_per_h": bias}, source=note)
    write_record(record, path)
    back = read_record(path)
    np.testing.assert_array_equal(back["time_s"], record["time_s"])
    np.testing.assert_array_equal(back["bias_deg_per_h"], bias)
    assert back.source == " ".join(note.split())


def test_quick_and_careful_parsers_agree(tmp_path):
    rng = np.random.default_rng(7)
    rows = [f"{k},{4432 + x!r}" for k, x in enumerate(rng.normal(size=200).tolist())]
    quick, careful = tmp_path / "quick.csv", tmp_path / "careful.csv"
    quick.write_text(RECORD + "\n".join(rows) + "\n")
    careful.write_text(RECORD + "\n".join([*rows[:-1], rows[-1].replace(",", ", ")]) + "\n")
    np.testing.assert_array_equal(read_record(quick)["frequency_Hz"], read_record(careful)["frequency_Hz"])


def test_resolution_is_the_last_digit_that_any_reading_shows():
    assert reading_resolution(np.array([4416.97, 4421.05, 4424.9])) == 0.01
    assert reading_resolution(np.array([4416.0, 4421.0])) == 1.0
    full = reading_resolution(np.array([4.41697, 4.4320699999999995]))  # all digits of a double
    assert full == pytest.approx(2.0**-52 * 4.43207, rel=1e-6, abs=0.0)


def test_a_file_that_fails_halfway_leaves_nothing(tmp_path):
    target = tmp_path / "out.csv"
    target.write_text("old")

    def fail() -> None:
        with written_whole(target) as file:
            file.write(b"half")
            raise RuntimeError("stopped")

    with pytest.raises(RuntimeError):
        fail()
    assert target.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["out.csv"]


def test_a_large_table_costs_its_numbers_not_its_text(tmp_path, monkeypatch):
    path, rows = tmp_path / "run.csv", 60_000
    write_record(Record({"time_s": np.arange(rows) / 7, "frequency_Hz": 4432 + np.sin(np.arange(rows))}, ""), path)
    monkeypatch.setattr(numbers, "FEW", 0)
    whole = read_record(path)
    monkeypatch.setattr(columns, "HEAD", 1 << 12)
    for name, value in {"ROWS_AT_ONCE": 5003, "PORTION": 1 << 16}.items():
        monkeypatch.setattr(numbers, name, value)
    tracemalloc.start()
    try:
        parts = read_record(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    for name, values in whole.columns.items():
        np.testing.assert_array_equal(parts[name], values)
    assert peak < 1.8 * 16 * rows < path.stat().st_size
