"""A first map for raw files: notation, time, columns and units guessed from names and cells, and every guess marked."""

import itertools
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from studies.errors import InputError
from studies.importing.look import Look, as_number, is_stamp, look_at
from studies.importing.mapping import SCHEMA, SECONDS, TABLE_TARGETS, load_map
from studies.importing.meaning import Meaning, find_meanings, find_unit
from studies.importing.offset import estimate_offset
from studies.importing.units import units_of

MOST_SETTLED = 500  # rows of a table of settled readings
STAMPS = (
    "%Y-%m-%d %H:%M:%S",
    "%Y-%m-%d %H:%M:%S.%f",
    "%Y/%m/%d %H:%M:%S",
    "%Y/%m/%d %H:%M:%S.%f",
    "%d.%m.%Y %H:%M:%S",
    "%d.%m.%Y %H:%M:%S.%f",
    "%d.%m.%Y %H:%M",
    "%d/%m/%Y %H:%M:%S",
    "%d/%m/%Y %H:%M:%S.%f",
    "%m/%d/%Y %H:%M:%S",
    "%m/%d/%Y %H:%M:%S.%f",
    "%m/%d/%Y %I:%M:%S %p",
    "%d.%m.%y %H:%M:%S",
    "%d/%m/%y %H:%M:%S",
    "%m/%d/%y %H:%M:%S",
    "%H:%M:%S",
    "%H:%M:%S.%f",
)
TIME_WORDS = r"time|zeit|date|datum|clock|stamp|uhr|^t$|^t\s*[ _/\[(]\s*[mµun]?s\b"
UNIX_BY_SIZE = ((1e9, "unix-s"), (1e12, "unix-ms"), (1e15, "unix-us"), (1e18, "unix-ns"))
USUAL_STEP = (1e-3, 3600.0)  # s between rows


@dataclass(frozen=True)
class Draft:
    """The text of a map, the columns of the record that it fills, raw columns without a meaning, and what was noticed."""

    text: str
    mapped: tuple[str, ...]
    left_over: tuple[str, ...]
    notes: tuple[str, ...] = ()


def draft_map(paths: Sequence[str]) -> Draft:
    """Draft the map of one or more raw files.

    Raises
    ------
    InputError
        A file has no table of numbers that could be found.
    """
    head = [
        "# A draft: compare every line with the file before relying on it; CHECK marks guesses.",
        f'schema = "{SCHEMA}"',
        '# instrument = "..."',
        '# source = "..."',
    ]
    if len(paths) == 1 and (table := _draft_table(paths[0])) is not None:
        return Draft("\n".join([*head, 'target = "table"', "", *table]) + "\n", TABLE_TARGETS, ())
    head.append("# step_s = 1.0    # a regular time grid; without it the times of the first file")
    files: list[list[str]] = []
    mapped: list[str] = []
    left_over: list[str] = []
    for path in paths:
        written, found, others = _draft_file(path, mapped)
        files.append(written)
        mapped += found
        left_over += others
    notes = _find_offsets(paths, head, files) if len(paths) > 1 else []
    text = "\n".join([*head, *(line for written in files for line in ("", *written))])
    return Draft(text + "\n", tuple(dict.fromkeys(mapped)), tuple(left_over), tuple(notes))


def _find_offsets(paths: Sequence[str], head: Sequence[str], files: list[list[str]]) -> list[str]:
    """Offer the offset between the first file's clock and each other's, where their columns share enough."""
    import tempfile
    from pathlib import Path

    from studies.importing.join import read_series, shift_between

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "map.toml"
        file.write_text("\n".join([*head, *(line for written in files for line in written)]), encoding="utf-8")
        try:
            series = [read_series(p, m) for p, m in zip(paths, load_map(file).files, strict=True)]
            shifts = [shift_between(series[0], other) for other in series]
        except InputError:  # the draft is not complete yet: nothing can be compared
            return []
    notes, base = [], series[0]
    for written, path, other, shift in zip(files[1:], paths[1:], series[1:], shifts[1:], strict=True):
        found = [
            (offset, one, two)
            for (one, _), y1 in base.columns.items()
            for (two, _), y2 in other.columns.items()
            if (offset := estimate_offset(base.time, y1, other.time + shift, y2)) is not None
        ]
        if not found:
            continue
        offset, one, two = max(found, key=lambda item: item[0].correlation)
        said = f"{offset.value:.3g} s (90 %: {offset.low:.3g} to {offset.high:.3g} s)"
        place = next(k for k, line in enumerate(written) if line.startswith("# clock_offset_s"))
        written[place : place + 1] = [
            f"# {two} here follows {one} of the first file best with {said}, correlation {offset.correlation:.4f};",
            "# a real lag between two places looks the same: take it only if both show one thing.",
            f"# clock_offset_s = {offset.value:.4g}    # CHECK: added to this file's times",
        ]
        notes.append(f"{path}: its clock seems to need {said}, from {two} against {one}; see the draft.")
    return notes


def _draft_table(path: str) -> list[str] | None:
    """Draft a table of settled readings: a file without a time, with one temperature and one frequency."""
    look = look_at(path)
    if look.header is None or any(re.search(TIME_WORDS, name.lower()) for name in look.names):
        return None
    body = look.rows[look.data :]
    if any(is_stamp(cell) for row in body[:5] for cell in row):
        return None
    hints = {name: f"{name} {unit}".strip() for name, unit in zip(look.names, look.units, strict=True)}
    by_target = {meaning.target: name for name, meaning in find_meanings(hints).items()}
    temperature = by_target.get("housing_temperature_degC") or by_target.get("chamber_temperature_degC")
    if temperature is None or "frequency_Hz" not in by_target or len(body) > MOST_SETTLED:
        return None
    lines = _describe_notation(path, look)
    for name, target in ((temperature, "temperature_degC"), (by_target["frequency_Hz"], "frequency_Hz")):
        place = look.names.index(name)
        cells = [row[place] for row in body if place < len(row)]
        numbers = [n for cell in cells if (n := as_number(cell, look.decimal)) is not None]
        lines += ["", *_draft_column(name, Meaning(target), hints[name], numbers)]
    return lines


def _describe_notation(path: str, look: Look) -> list[str]:
    lines = ["[[file]]", f"# {_comment(path)}"]
    if not look.excel:
        lines += [
            f"separator = {_quote(look.separator)}",
            f'decimal = "{look.decimal}"',
            f'encoding = "{look.encoding}"',
        ]
    header = 0 if look.header is None else look.header + 1
    return [*lines, f"header_line = {header}", f"data_line = {look.data + 1}"]


def _draft_file(path: str, taken: Sequence[str]) -> tuple[list[str], list[str], list[str]]:
    look = look_at(path)
    names = look.names
    body = [row for row in look.rows[look.data :] if any(cell.strip() for cell in row)]
    cells = {name: [row[k].strip() if k < len(row) else "" for row in body] for k, name in enumerate(names)}
    hints = {name: f"{name} {unit}".strip() for name, unit in zip(names, look.units, strict=True)}
    numbers = {name: [n for c in cells[name] if (n := as_number(c, look.decimal)) is not None] for name in names}
    time, form, unsure = _find_time(names, cells, hints, numbers, look.decimal)
    lines = _describe_notation(path, look)
    markers = _find_markers(names, cells, time, look.decimal)
    if markers:
        lines.append(
            f"missing = [{', '.join(_quote(marker) for marker in markers)}]    # CHECK: these cells mean 'no value'"
        )
    if time:
        lines.append(f"time = {_quote(time[0]) if len(time) == 1 else '[' + ', '.join(map(_quote, time)) + ']'}")
        lines.append(f"time_format = {_quote(form)}{f'    # CHECK: {unsure}' if unsure else ''}")
    else:
        lines.append(f"sample_period_s = 1.0    # CHECK: {unsure}")
    joined = [" ".join(stamp) for stamp in zip(*(cells[name] for name in time), strict=True)]
    if len(set(joined)) < len(joined):
        lines.append('repeated_times = "spread"    # CHECK: some times repeat; "first" keeps one row of each')
    lines.append("# clock_offset_s = 0.0    # added to this file's times: positive when its clock is behind")
    usable = {name: hints[name] for name in names if name not in time and numbers[name]}
    meanings = find_meanings(usable, taken) if look.header is not None else _guess_meanings(usable, numbers)
    others = [name for name in names if name not in time and name not in meanings]
    for name in names:
        if name in others:
            lines += ["", f"# no meaning found for the column {_quote(name)}"]
        elif name in meanings:
            guessed = "    # CHECK: guessed from its values" if look.header is None else ""
            lines += ["", *_draft_column(name, meanings[name], hints[name], numbers[name], guessed)]
    return lines, [meaning.target for meaning in meanings.values()], others


def _guess_meanings(hints: Mapping[str, str], numbers: Mapping[str, Sequence[float]]) -> dict[str, Meaning]:
    """Guess columns without a name by their values: a frequency is large and hardly changes, a temperature is moderate."""
    found: dict[str, Meaning] = {}
    for name in hints:
        ordered = sorted(numbers[name])
        low, middle, high = ordered[0], ordered[len(ordered) // 2], ordered[-1]
        targets = [meaning.target for meaning in found.values()]
        if middle > 900 and high - low < 0.05 * middle and "frequency_Hz" not in targets:
            found[name] = Meaning("frequency_Hz")
        elif -80 < low <= high < 150 and high - low > 0.2 and middle > 5 and "housing_temperature_degC" not in targets:
            found[name] = Meaning("housing_temperature_degC")
    return found


def _draft_column(name: str, meaning: Meaning, hint: str, numbers: Sequence[float], remark: str = "") -> list[str]:
    target = meaning.target
    units, stated = units_of(target), find_unit(target, hint)
    unit = stated or next(iter(units))
    remark = remark or ("" if stated else "    # CHECK: the name states no unit")
    middle = sorted(numbers)[len(numbers) // 2]
    lines = [f"from = {_quote(name)}", f'to = "{target}"']
    if target.endswith("_degC") and unit == "degC" and 200 < middle < 500:
        unit, remark = "K", "    # CHECK: the values look like kelvin"
    lines.append(f'unit = "{unit}"{remark}')
    if target.endswith("_degC") and abs(middle) >= 500:
        lines += [
            "scale = 1.0     # CHECK: the values look like raw counts; reading × scale + offset is the temperature",
            "offset = 0.0    # CHECK",
        ]
    lines += [f"{key} = 1.0    # CHECK: {_SETTING_WORDS[key]}" for key in units[unit].settings]
    if meaning.axis:
        lines.append(f'axis = "{meaning.axis}"')
    return ["[[file.column]]", *lines]


_SETTING_WORDS = {
    "clock_Hz": "frequency of the clock that is counted",
    "periods": "number of periods in which it is counted",
    "gate_s": "length of the gate in which periods are counted",
    "nominal_Hz": "frequency from which the reading is counted",
}


def _find_time(
    names: Sequence[str],
    cells: Mapping[str, list[str]],
    hints: Mapping[str, str],
    numbers: Mapping[str, Sequence[float]],
    decimal: str,
) -> tuple[list[str], str, str]:
    """Return the time columns, their format, and what is doubtful about it; no columns where the rows have no time."""
    named = [name for name in names if re.search(TIME_WORDS, name.lower())]
    stamps = [name for name in names if cells[name] and all(is_stamp(cell) for cell in cells[name] if cell)]
    stamped = [name for name in (named or stamps) if name in stamps][:2]
    if stamped:
        for columns in [stamped, stamped[:1], stamped[1:]] if len(stamped) > 1 else [stamped]:
            form, unsure = _find_stamp(columns, cells, decimal)
            if form:
                return list(columns), form, unsure
        return stamped[:1], "iso", "no known form fits; write the pattern"
    rising = [name for name in names if _rises(numbers[name])]
    if not named and not rising:
        return [], "", "no column is a time; by how many seconds do the rows lie apart?"
    time = named[0] if named else rising[0]
    unsure = "" if named else "no column is named time; the first that only rises was taken"
    values = numbers[time]
    first = values[0] if values else 0.0
    for size, form in UNIX_BY_SIZE:
        if size <= first < 4 * size:
            return [time], form, unsure
    hint = hints[time].lower()
    for pattern, form in (
        (r"\bms\b|milli|_ms\b", "ms"),
        (r"\b(us|µs|μs)\b|micro|_us\b", "us"),
        (r"\bns\b|nano|_ns\b", "ns"),
        (r"\bmin", "min"),
        (r"\b(h|hours?|std)\b", "h"),
        (r"\bdays?\b", "days"),
    ):
        if re.search(pattern, hint):
            return [time], form, unsure
    if 40000 < first < 60000 and first % 1:
        return [time], "excel-days", "the values look like Excel's days"
    if re.search(r"_s\b|\bs\b|sec|sek", hint):
        return [time], "s", unsure
    return [time], _likely_unit(values), unsure or "the name states no unit; chosen by the step between rows"


def _rises(values: Sequence[float]) -> bool:
    return len(values) > 2 and all(b > a for a, b in itertools.pairwise(values))


def _likely_unit(values: Sequence[float]) -> str:
    """Return s, or ms, us, ns where seconds would put the rows hours apart."""
    steps = sorted(b - a for a, b in itertools.pairwise(values))
    step = steps[len(steps) // 2] if steps else 1.0
    if USUAL_STEP[0] <= step <= USUAL_STEP[1]:
        return "s"
    return min(("s", "ms", "us", "ns"), key=lambda unit: abs(math.log10(max(step, 1e-300) * SECONDS[unit])))


def _find_stamp(columns: Sequence[str], cells: Mapping[str, list[str]], decimal: str) -> tuple[str, str]:
    import pandas as pd

    text = pd.Series([" ".join(stamp) for stamp in zip(*(cells[name] for name in columns), strict=True)], dtype=str)
    text = text[text.str.strip() != ""]
    text = text.str.replace(",", ".", regex=False) if decimal == "," else text
    fitting = [form for form in STAMPS if _fits(text, form)]
    if not fitting:
        return ("iso", "") if _fits(text, "ISO8601") else ("", "")
    unsure = "day and month could be exchanged" if len(fitting) > 1 and "/" in fitting[0] else ""
    if fitting[0].startswith("%H"):
        unsure = "no date: give 'start' to place the run in time"
    return fitting[0], unsure


def _fits(text: "object", form: str) -> bool:
    import pandas as pd

    try:
        return bool(len(text)) and bool(pd.to_datetime(text, format=form, errors="coerce", utc=True).notna().all())  # type: ignore[arg-type, call-overload]
    except ValueError:
        return False


def _find_markers(names: Sequence[str], cells: Mapping[str, list[str]], time: Sequence[str], decimal: str) -> list[str]:
    """Return texts that stand in columns of numbers."""
    markers: list[str] = []
    for name in names:
        words = [cell for cell in cells[name] if cell and as_number(cell, decimal) is None]
        if name not in time and 0 < 2 * len(words) < len(cells[name]):
            markers += [word for word in dict.fromkeys(words) if word not in markers]
    return markers[:20]


def _quote(text: str) -> str:
    """Return a TOML basic string."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return (
        '"'
        + "".join(
            c if c.isprintable() else f"\\u{ord(c):04x}" if ord(c) < 65536 else f"\\U{ord(c):08x}" for c in escaped
        )
        + '"'
    )


def _comment(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text)
