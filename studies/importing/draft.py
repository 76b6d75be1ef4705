"""A first map for raw files: notation, time, columns and units guessed from names and cells, and every guess marked."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from studies.importing.look import as_number, is_stamp, look_at
from studies.importing.mapping import SCHEMA
from studies.importing.units import units_of

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
    "%H:%M:%S",
    "%H:%M:%S.%f",
)
TARGET_WORDS: tuple[tuple[str, str], ...] = (
    # (pattern in the lower-case column name, column of the record); the first that fits counts
    (r"chamber|kammer|oven|set ?point|soll|ambient", "chamber_temperature_degC"),
    (r"housing|geh(ä|ae)use|case|pt ?100\b|temp|(^|[^a-z])t[ _]?(case|h|1)?($|[^a-z])", "housing_temperature_degC"),
    (r"ref\w*[ _]*freq|freq\w*[ _]*ref|external|counter|gps", "reference_frequency_Hz"),
    (r"freq|period|gate|\bf\b|\bf[ _](res|drive)", "frequency_Hz"),
    (r"freq|period|gate", "reference_frequency_Hz"),
    (r"applied|table|command\w*[ _]*rate|stimulus", "rate_deg_per_s"),
    (r"bias|zero[ _-]*rate|drift|zro", "bias_deg_per_h"),
    (r"rate|omega|gyro", "measured_rate_deg_per_s"),
    (r"1/q|inv\w*[ _]*q|^q\b|q[ _-]*fact", "inverse_q"),
    (r"quad", "quadrature_V"),
    (r"drive|amplitude|ampl", "drive_amplitude_V"),
    (r"electrode|polari[sz]|trim", "electrode_bias_V"),
    (r"pattern|azimuth|theta", "pattern_angle_deg"),
    (r"counts?\b|adc|raw", "output_counts"),
)
TIME_WORDS = r"time|zeit|date|datum|clock|stamp|uhr|^t$|^t[ _\[(]s"
UNIT_WORDS: tuple[tuple[str, str], ...] = (
    (r"kelvin|(^|[^a-z])k($|[^a-z])", "K"),
    (r"°\s*f|deg ?f\b|fahrenheit", "degF"),
    (r"°\s*c|deg ?c\b|celsius|(^|[^a-z])c($|[^a-z])", "degC"),
    (r"mhz", "MHz"),
    (r"khz", "kHz"),
    (r"period.*count|count.*period", "period-counts"),
    (r"gate|counts?\b", "gate-counts"),
    (r"period.*(us|µs|μs)\b|(us|µs|μs)\b.*period", "period-us"),
    (r"period.*\bms\b", "period-ms"),
    (r"period", "period-s"),
    (r"rad/s", "rad/s"),
    (r"\bhz", "Hz"),
    (r"mdeg/s|mdps|m°/s", "mdeg/s"),
    (r"(deg|°)[ _]?(/|per)[ _]?h|dph", "deg/h"),
    (r"(deg|°)[ _]?(/|per)[ _]?s|dps", "deg/s"),
    (r"rpm", "rpm"),
    (r"arcsec", "arcsec/s"),
    (r"\bmv\b", "mV"),
    (r"\b(uv|µv|μv)\b", "uV"),
    (r"\bkv\b", "kV"),
    (r"\bv\b|volt", "V"),
    (r"\brad\b", "rad"),
    (r"1/q|inv", "1/Q"),
    (r"^q|q[ _-]*fact", "Q"),
)


@dataclass(frozen=True)
class Draft:
    """The text of a map, the columns of the record that it fills, and raw columns for which no meaning was found."""

    text: str
    mapped: tuple[str, ...]
    left_over: tuple[str, ...]


def draft_map(paths: Sequence[str]) -> Draft:
    """Draft the map of one or more raw files.

    Raises
    ------
    InputError
        A file has no table of numbers that could be found.
    """
    lines = [
        "# A draft: compare every line with the file before relying on it; CHECK marks guesses.",
        f'schema = "{SCHEMA}"',
        '# instrument = "..."',
        '# source = "..."',
        "# step_s = 1.0    # a regular time grid; without it the times of the first file",
    ]
    mapped: list[str] = []
    left_over: list[str] = []
    for path in paths:
        written, found, others = _draft_file(path, mapped)
        lines += ["", *written]
        mapped += found
        left_over += others
    return Draft("\n".join(lines) + "\n", tuple(mapped), tuple(left_over))


def _draft_file(path: str, taken: Sequence[str]) -> tuple[list[str], list[str], list[str]]:
    look = look_at(path)
    names = [" ".join(cell.split()) or f"column {k}" for k, cell in enumerate(look.rows[look.header], 1)]
    names = [f"{name} #{k}" if name in names[: k - 1] else name for k, name in enumerate(names, 1)]
    units = look.rows[look.header + 1] if look.data > look.header + 1 else [""] * len(names)
    body = [row for row in look.rows[look.data :] if any(cell.strip() for cell in row)]
    cells = {name: [row[k].strip() if k < len(row) else "" for row in body] for k, name in enumerate(names)}
    hints = {name: f"{name} {unit}" for name, unit in zip(names, [*units, *[""] * len(names)], strict=False)}
    time, form, unsure = _find_time(names, cells, hints, look.decimal)
    lines = ["[[file]]", f"# {_comment(path)}"]
    if not look.excel:
        lines += [
            f"separator = {_quote(look.separator)}",
            f'decimal = "{look.decimal}"',
            f'encoding = "{look.encoding}"',
        ]
    lines += [f"header_line = {look.header + 1}", f"data_line = {look.data + 1}"]
    markers = _find_markers(names, cells, time, look.decimal)
    if markers:
        lines.append(
            f"missing = [{', '.join(_quote(marker) for marker in markers)}]    # CHECK: these cells mean 'no value'"
        )
    lines.append(f"time = {_quote(time[0]) if len(time) == 1 else '[' + ', '.join(map(_quote, time)) + ']'}")
    lines.append(f"time_format = {_quote(form)}{f'    # CHECK: {unsure}' if unsure else ''}")
    joined = [" ".join(stamp) for stamp in zip(*(cells[name] for name in time), strict=True)]
    if len(set(joined)) < len(joined):
        lines.append('repeated_times = "spread"    # CHECK: some times repeat; "first" keeps one row of each')
    lines.append("# clock_offset_s = 0.0    # added to this file's times: positive when its clock is behind")
    found: list[str] = []
    others: list[str] = []
    for name in names:
        if name in time:
            continue
        target = _find_target(hints[name], [*taken, *found])
        if target is None or not any(as_number(cell, look.decimal) is not None for cell in cells[name]):
            others.append(name)
            lines += ["", f"# no meaning found for the column {_quote(name)}"]
            continue
        found.append(target)
        lines += [
            "",
            *_draft_column(
                name, target, hints[name], [n for c in cells[name] if (n := as_number(c, look.decimal)) is not None]
            ),
        ]
    return lines, found, others


def _draft_column(name: str, target: str, hint: str, numbers: Sequence[float]) -> list[str]:
    units = units_of(target)
    guessed = next((unit for pattern, unit in UNIT_WORDS if unit in units and re.search(pattern, hint.lower())), None)
    unit, remark = guessed or next(iter(units)), "" if guessed else "    # CHECK: the name states no unit"
    middle = sorted(numbers)[len(numbers) // 2]
    if target.endswith("_degC") and unit == "degC" and 200 < middle < 500:
        unit, remark = "K", "    # CHECK: the values look like kelvin"
    lines = ["[[file.column]]", f"from = {_quote(name)}", f'to = "{target}"', f'unit = "{unit}"{remark}']
    lines += [f"{key} = 1.0    # CHECK: {_SETTING_WORDS[key]}" for key in units[unit].settings]
    return lines


_SETTING_WORDS = {
    "clock_Hz": "frequency of the clock that is counted",
    "periods": "number of periods in which it is counted",
    "gate_s": "length of the gate in which periods are counted",
}


def _find_time(
    names: Sequence[str], cells: dict[str, list[str]], hints: dict[str, str], decimal: str
) -> tuple[list[str], str, str]:
    """Return the time columns, their format, and what is doubtful about it."""
    named = [name for name in names if re.search(TIME_WORDS, name.lower())]
    stamps = [name for name in names if cells[name] and all(is_stamp(cell) for cell in cells[name] if cell)]
    stamped = [name for name in (named or stamps) if name in stamps][:2]
    if stamped:
        for columns in [stamped, stamped[:1], stamped[1:]] if len(stamped) > 1 else [stamped]:
            form, unsure = _find_stamp(columns, cells, decimal)
            if form:
                return list(columns), form, unsure
        return stamped[:1], "iso", "no known form fits; write the pattern"
    time = named[0] if named else names[0]
    unsure = "" if named else "no column is named time; the first was taken"
    numbers = [n for cell in cells[time] if (n := as_number(cell, decimal)) is not None]
    first = numbers[0] if numbers else 0.0
    if 1e9 < first < 4e9:
        return [time], "unix-s", unsure
    if 1e12 < first < 4e12:
        return [time], "unix-ms", unsure
    hint = hints[time].lower()
    for pattern, form in (
        (r"\bms\b|milli", "ms"),
        (r"\b(us|µs|μs)\b|micro", "us"),
        (r"\bmin", "min"),
        (r"\b(h|hours?|std)\b", "h"),
        (r"\bdays?\b", "days"),
    ):
        if re.search(pattern, hint):
            return [time], form, unsure
    if 40000 < first < 60000 and first % 1:
        return [time], "excel-days", "the values look like Excel's days"
    return [time], "s", unsure or ("" if re.search(r"_s\b|\bs\b|sec|sek", hint) else "the name states no unit")


def _find_stamp(columns: Sequence[str], cells: dict[str, list[str]], decimal: str) -> tuple[str, str]:
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


def _find_markers(names: Sequence[str], cells: dict[str, list[str]], time: Sequence[str], decimal: str) -> list[str]:
    """Return texts that stand in columns of numbers."""
    markers: list[str] = []
    for name in names:
        words = [cell for cell in cells[name] if cell and as_number(cell, decimal) is None]
        if name not in time and 0 < 2 * len(words) < len(cells[name]):
            markers += [word for word in dict.fromkeys(words) if word not in markers]
    return markers[:20]


def _find_target(hint: str, taken: Sequence[str]) -> str | None:
    lowered = hint.lower().replace("_", " ")
    return next(
        (target for pattern, target in TARGET_WORDS if target not in taken and re.search(pattern, lowered)), None
    )


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
