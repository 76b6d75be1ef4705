"""Mutated files: cards, records, tables, profiles, maps, raw files, models and studies, thousands of them, never harm.

The mutations follow the grammar of the formats (keys, values, cells, headers, notation), so most of them get past the
parser. Whatever a reader is given, it accepts it or raises one of the errors that a user can mend; nothing is evaluated,
nothing hangs, and no text of a file stands unescaped in a page.
"""

import json
import signal
import tomllib
import traceback
import warnings
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import tomli_w

from compensation.frequency import fit_frequency
from studies.acceptance.limits import SCHEMA as LIMITS_SCHEMA
from studies.acceptance.limits import Limits
from studies.cli import main
from studies.cli.measured_splits import read_scan
from studies.errors import UNUSABLE_INPUT, MissingEnvironment
from studies.files.clouds import read_cloud
from studies.importing.draft import draft_map
from studies.importing.join import import_records
from studies.importing.mapping import load_map
from studies.instrument.card import load_card, shipped_cards
from studies.models import ModelSource, compensate, emit_c, read_model, write_model
from studies.models.kinds.frequency import save_frequency
from studies.record import read_frequency_table, read_profile, read_record
from studies.schema.reader import read_file
from studies.simulation.chamber import load_drive
from studies.sweeps.spec import read_study, shipped_specs

ALLOWED = (*UNUSABLE_INPUT, MissingEnvironment)
CASES = 80  # mutated files of each format
LONGEST = 120  # seconds until a reader counts as hanging, also on a busy machine
PAYLOAD = "<script>alert(1)</script>"
T = np.array([-20.0, -10, 0, 10, 20, 30, 40])
F = np.array([4417.02, 4421.09, 4424.89, 4428.55, 4432.06, 4435.55, 4439.19])


def odd_values(rng, flag):
    """Values that a key of a TOML file may wrongly hold."""
    values = [
        "", PAYLOAD, f"__import__('pathlib').Path({str(flag)!r}).touch()", f"!!python/object/apply:os.system ['touch {flag}']",
        "../../etc/passwd", "a" * 5000, "Ω‮\x07\x1b[31m", "{{ 7 * 7 }}", "${HOME}", "%n%s%x", "nan", "1e400", "1_000", "١٢",
        0, -1, 1, -0.0, 1e-320, 1e308, -1e308, float("nan"), float("inf"), 10**30, 2**63, True, False,
        [], [[]], [1, "x"], [[0.0, 1.0]], [[1.0, 1.0], [0.0, 1.0]], [[0.0, 1.0], [1.0, -1.0]], {}, {"a": {"b": {}}}, [{}],
    ]  # fmt: skip
    return values[rng.integers(len(values))]


def places(content, path=()):
    """Every key or list place of a TOML document."""
    pairs = content.items() if isinstance(content, dict) else enumerate(content)
    for key, value in pairs:
        yield (*path, key)
        if isinstance(value, dict | list):
            yield from places(value, (*path, key))


def mutate_content(content, rng, flag):
    """Change one to three places of a parsed document: value, type, name, presence, scale."""
    content = tomllib.loads(tomli_w.dumps(content))
    for _ in range(rng.integers(1, 4)):
        every = list(places(content))
        if not every:
            break
        *path, key = every[rng.integers(len(every))]
        parent = content
        for step in path:
            parent = parent[step]
        kind = rng.integers(7)
        if kind <= 2:
            parent[key] = odd_values(rng, flag)
        elif kind == 3 and isinstance(parent[key], int | float):
            parent[key] = parent[key] * float(10.0 ** rng.integers(-12, 12)) * rng.choice([-1, 1])
        elif kind == 4:
            parent.pop(key)
        elif kind == 5 and isinstance(parent, dict):
            parent[str(key) + rng.choice(["x", "_mm", " ", ".", "​"])] = parent.pop(key)
        elif isinstance(parent, dict):
            parent[rng.choice(["extra", "schema", "__class__", "name", PAYLOAD])] = odd_values(rng, flag)
    return content


def mutate_text(text, rng):
    """Change the notation: lines, brackets, quotes, encodings, ends."""
    lines = text.split("\n")
    k = int(rng.integers(len(lines)))
    kind = rng.integers(12)
    if kind == 0:
        del lines[k]
    elif kind == 1:
        lines.insert(k, lines[int(rng.integers(len(lines)))])
    elif kind == 2:
        lines[k] = lines[k][: len(lines[k]) // 2]
    elif kind == 3:
        lines[k] += rng.choice(['"', "[", "]", "=", "#", "\t", "\\", "'''", "{"])
    elif kind == 4:
        lines = lines[:k]
    elif kind == 5:
        lines.insert(k, "a = " + "[" * 3000)
    elif kind == 6:
        lines.insert(k, rng.choice(["\x00", "\x0c", "\ufeff", "\u2028", "=cmd|' /C calc'!A0", PAYLOAD]))
    joined = rng.choice(["\n", "\n", "\n", "\r\n", "\r"]).join(lines)
    encoding = rng.choice(["utf-8", "utf-8", "utf-8", "utf-8-sig", "utf-16", "latin-1"])
    data = joined.encode(encoding, errors="replace")
    if kind == 7 and data:
        at = int(rng.integers(len(data)))
        data = data[:at] + bytes(rng.integers(0, 256, 3, dtype=np.uint8)) + data[at + 3 :]
    return data


def mutate_table(text, rng, flag):
    """Change cells, columns, names and notation of a table of numbers."""
    lines = text.split("\n")
    first = next(k for k, line in enumerate(lines) if not line.startswith("#"))
    for _ in range(rng.integers(1, 4)):
        row = int(rng.integers(first, len(lines)))
        cells = lines[row].split(",")
        k = int(rng.integers(len(cells)))
        kind = rng.integers(9)
        if kind <= 2:
            odd = ["", " ", "nan", "inf", "-inf", "1e400", "1_0", "0x10", "1,5", "--", "١٢", '"', '"1', "=1+1", PAYLOAD, "1e-320",
                   "1" * 400, f"__import__('pathlib').Path({str(flag)!r}).touch()", "-0", "+3", "1e5", "True", "300", "-300"]  # fmt: skip
            cells[k] = odd[rng.integers(len(odd))]
        elif kind == 3:
            cells.insert(k, "1")
        elif kind == 4:
            cells.pop(k)
        elif kind == 5:
            cells[k], cells[0] = cells[0], cells[k]
        elif kind == 6:
            lines.insert(row, lines[row])
        elif kind == 7:
            lines.insert(
                row, rng.choice(["", "# late", "# start: yesterday", "# resolution frequency_Hz: -1", ",,,,", ";;"])
            )
        lines[row] = rng.choice([",", ",", ",", ",", ";", "\t"]).join(cells)
    return "\n".join(lines)


@contextmanager
def limited(seconds):
    """Turn a hang into a failure."""

    def stop(*_):
        raise AssertionError(f"still running after {seconds} s")

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def check(read, path, case, harmed):
    """Read a mutated file: accepted, or an error of the allowed kinds with a message; anything else is kept in `harmed`."""
    try:
        with limited(LONGEST), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            read(path)
    except ALLOWED as error:
        if not str(error).strip():
            harmed.setdefault("an error without a message", case)
        return 0
    except (SystemExit, Exception) as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        fault = f"{type(error).__name__}: {str(error)[:120]} ({Path(place.filename).name}:{place.lineno})"
        harmed.setdefault(fault, f"{case}: {path.read_bytes()[:300]!r}")
        return 0
    return 1


def record_text():
    t = np.arange(0, 60, 2.0)
    rows = [f"{s:.1f},{20 + 0.1 * s:.3f},{4430 + 0.03 * s:.4f},{0.2 * s:.3f}" for s in t]
    head = "# instrument: unit 7\n# start: 2026-01-31T12:00:00\n# resolution frequency_Hz: 0.0001\n"
    return head + "time_s,housing_temperature_degC,frequency_Hz,bias_deg_per_h\n" + "\n".join(rows) + "\n"


def table_text():
    return "temperature_degC,frequency_Hz\n" + "\n".join(f"{a:g},{b:.2f}" for a, b in zip(T, F, strict=True)) + "\n"


def raw_text(*columns):
    """A logger's file, with further columns of hostile names."""
    rows = [f"31.01.2026,12:00:{k:02d},{20 + 0.1 * k:.2f},{4430 + k / 100:.3f}{',1' * len(columns)}" for k in range(30)]
    return ",".join(["Messung 7\nDatum,Zeit,T Kammer [°C],Frequenz [Hz]", *columns]) + "\n" + "\n".join(rows) + "\n"


def draft(path):
    """Draft a map of a raw file; whatever it holds, the map is TOML."""
    text = draft_map([str(path)]).text
    assert tomllib.loads(text)["schema"] == "hrg.map/1"
    path.with_suffix(".toml").write_text(text, encoding="utf-8")
    return load_map(path.with_suffix(".toml"))


def through_a_map(path):
    """Import a raw file through the map of what it was."""
    whole = path.with_name("whole.csv")
    whole.write_text(raw_text(), encoding="utf-8")
    import_records([str(path)], draft(whole))


def read_all_of_a_model(path):
    model = read_model(path)
    emit_c(model)
    record = path.parent / "record.csv"
    record.write_text(record_text())
    compensate(model, read_record(record), extrapolate=True)


INPUTS = Path(__file__).parents[1] / "golden" / "inputs"


def documents(tmp_path):
    """Valid TOML documents of every format, by name, with their reader; `busy.toml` is a card with most tables."""
    cards = [*shipped_cards().values(), INPUTS / "busy.toml", INPUTS / "wave.toml"]
    found = [(f"card {path.stem}", path.read_text(), load_card) for path in cards]
    model = tmp_path / "model.toml"
    write_model(save_frequency(fit_frequency(T, F), (ModelSource("a.csv", "ab12", 7),), "test"), model)
    found.append(("model", model.read_text(), read_all_of_a_model))
    raw = tmp_path / "raw.csv"
    raw.write_text(raw_text(), encoding="utf-8")
    found.append(("map", draft_map([str(raw)]).text, lambda path: import_records([str(raw)], load_map(path))[""]))
    found.append(("limits", (INPUTS / "limits.toml").read_text(), lambda path: read_file(path, Limits, LIMITS_SCHEMA)))
    return found + [(f"study {name}", path.read_text(), read_study) for name, path in shipped_specs().items()]


def grid_text():
    rows = [f"{x:.1f}," + ",".join(f"{np.cos(4 * k * np.pi / 6):.3f}" for k in range(12)) for x in (0.2, 0.6, 1.0)]
    return "position," + ",".join(str(30 * k) for k in range(12)) + "\n" + "\n".join(rows) + "\n"


def points_text():
    return "".join(f"{14 * np.cos(a):.4f},{14 * np.sin(a):.4f},{a:.4f}\n" for a in np.linspace(0, 6, 30))


SCAN = {"schema": "hrg.scan/1", "splits": [{"harmonic": 2, "split_Hz": {"value": 0.1, "low": 0.05, "high": 0.2}, "slow_axis_deg": {"value": 3.0}}]}  # fmt: skip
TABLES = {
    "grid of departures": (grid_text, read_cloud),
    "points": (points_text, read_cloud),
    "record": (record_text, read_record),
    "steady-state table": (table_text, read_frequency_table),
    "profile": (lambda: "time_s,chamber_temperature_degC\n0,20\n60,20\n600,-10\n", read_profile),
    "raw file": (raw_text, draft),
    "raw file of hostile names": (
        lambda: raw_text('Freq"uenz', "Freq\\uenz", "Freq]uenz\x07", "F\x1b#", "F = 1"),
        draft,
    ),
    "raw file through a map": (raw_text, through_a_map),
}


@pytest.mark.slow
def test_mutated_toml_files_never_harm(tmp_path):
    flag = tmp_path / "evaluated"
    accepted, harmed = {}, {}
    for name, text, read in documents(tmp_path):
        read_ok = tmp_path / "valid.toml"
        read_ok.write_text(text)
        if name != "map":
            assert check(read, read_ok, f"{name}, unchanged", harmed), harmed
        rng = np.random.default_rng(sum(name.encode()))
        content = tomllib.loads(text)
        count = 0
        for case in range(CASES if "study" not in name and "card" not in name else CASES // 2):
            path = tmp_path / "mutated.toml"
            changed = tomli_w.dumps(mutate_content(content, rng, flag)) if rng.random() < 0.75 else text
            path.write_bytes(mutate_text(changed, rng) if rng.random() < 0.35 or changed == text else changed.encode())
            count += check(read, path, f"{name} {case}", harmed)
        accepted[name] = count
    assert not harmed
    assert not flag.exists()
    assert all(accepted.values())  # some mutations are harmless


@pytest.mark.slow
@pytest.mark.parametrize("name", TABLES)
def test_mutated_tables_never_harm(tmp_path, name):
    write, read = TABLES[name]
    flag, path = tmp_path / "evaluated", tmp_path / "mutated.csv"
    rng = np.random.default_rng(sum(name.encode()))
    accepted, harmed = 0, {}
    for case in range(CASES):
        text = mutate_table(write(), rng, flag)
        path.write_bytes(mutate_text(text, rng) if rng.random() < 0.4 else text.encode())
        accepted += check(read, path, f"{name} {case}", harmed)
    assert not harmed
    assert not flag.exists()
    assert accepted  # some mutations are harmless
    assert accepted < CASES or read is draft  # and some refused; any table of numbers can be drafted


@pytest.mark.slow
def test_mutated_cards_through_the_whole_solver(tmp_path, capsys):
    """Cards with changed dimensions, solved by the command line: a result or one plain sentence."""
    rng = np.random.default_rng(11)
    content = tomllib.loads(shipped_cards()["free-dome"].read_text())
    statuses = []
    for _ in range(12):
        changed = tomllib.loads(tomli_w.dumps(content))
        table = changed["resonator"]
        for key in rng.choice([k for k, v in table.items() if isinstance(v, float)], 2):
            table[key] = float(table[key] * rng.choice([1e-3, 0.1, 0.7, 0.9, 1.1, 1.5, 3.0]))
        path = tmp_path / "card.toml"
        path.write_text(tomli_w.dumps(changed))
        with limited(LONGEST), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            statuses.append(main(["modes", str(path), "--theory", "shell", "--tolerance", "0.01"]))
        told = capsys.readouterr()
        assert statuses[-1] in (0, 2), told.err
        assert "Traceback" not in told.err
        assert "nan" not in told.out.lower()
    assert len(set(statuses)) == 2


def test_mutated_splits_of_a_scan_never_harm(tmp_path):
    rng, path, harmed, accepted = np.random.default_rng(23), tmp_path / "scan.json", {}, 0
    for case in range(CASES):
        text = json.dumps(mutate_content(SCAN, rng, tmp_path / "evaluated"))
        path.write_bytes(mutate_text(text, rng) if rng.random() < 0.3 else text.encode())
        accepted += check(lambda file: read_scan(str(file), (2,)), path, f"scan {case}", harmed)
    path.write_text("[" * 100_000)
    accepted += check(lambda file: read_scan(str(file), (2,)), path, "nested deeply", harmed)
    assert not harmed
    assert 0 < accepted < CASES


@pytest.mark.parametrize("ending", ["stl", "ply"])
def test_broken_meshes_are_one_sentence(tmp_path, ending, capfd):
    path = tmp_path / f"face.{ending}"
    for text in (
        "solid x\nfacet normal 0 0 1\nvertex 1\nendsolid",
        "ply\nformat ascii 1.0\nelement vertex 9\nend_header\n1",
    ):
        path.write_text(text)
        assert main(["scan", "free-dome", str(path)]) == 2
        told = capfd.readouterr().err
        assert "Traceback" not in told
        assert told.count("\n") <= 2


def test_a_long_profile_in_words_is_no_file_name():
    """Words of more letters than a file's name may have."""
    words = " then ".join(["soak 20 1h", "step 20 30 1h", "step 30 20 1h"] * 20)
    assert load_drive(words).end == pytest.approx(60 * 3600)


def test_text_of_cards_is_escaped_in_the_page_of_their_modes(tmp_path, monkeypatch):
    """The only elements are the workbench's own, as many as in the page of a harmless card; its scripts hold the card's data."""
    monkeypatch.setattr("shell.render._run_child", lambda *_: None)  # no pictures: they hold no text
    hostile = 'x</script><script>alert(1)</script><img src=x onerror="alert(2)">{{7*7}}'
    content = tomllib.loads(shipped_cards()["free-dome"].read_text()) | {"name": hostile, "note": hostile}
    (tmp_path / "card.toml").write_text(tomli_w.dumps(content))
    pages = []
    for card in ("free-dome", str(tmp_path / "card.toml")):
        assert main(["render", card, "--out", str(tmp_path / "page.html"), "--theory", "shell"]) == 0
        pages.append((tmp_path / "page.html").read_text())
    assert not [needle for needle in ("<script>alert", "<img src=x") if needle in pages[1]]
    assert "&lt;script&gt;alert(1)" in pages[1]
    for tag in ("<script", "<img", "</script"):
        assert pages[0].count(tag) == pages[1].count(tag)
