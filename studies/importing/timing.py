"""Which columns of a raw file tell the time, and how it is written there."""

import datetime
import itertools
import math
import re
from collections.abc import Mapping, Sequence

import numpy as np

from compensation.arrays import Array
from studies.importing.daylight import find_change
from studies.importing.heading import read_heading
from studies.importing.look import Look, is_stamp
from studies.importing.mapping import DURATIONS, EPOCHS
from studies.importing.meaning import find_meanings
from studies.importing.units import SECONDS, find_spelling
from studies.importing.words import plain

DATES = (
    *("%Y-%m-%d", "%Y/%m/%d", "%Y.%m.%d", "%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "%m-%d-%Y"),
    *("%d.%m.%y", "%d/%m/%y", "%m/%d/%y", "%d-%b-%Y", "%d %b %Y", "%d-%b-%y", "%b %d %Y", "%Y年%m月%d日"),
)
CLOCKS = (
    *("%H:%M:%S", "%H:%M:%S.%f", "%H:%M:%S:%f", "%H:%M", "%I:%M:%S %p", "%I:%M %p", "%Hh%Mm%Ss", "%Hh%Mm", "%Hh%M"),
    *("%H.%M.%S", "%H时%M分%S秒"),
)
STAMPS = (*map(" ".join, itertools.product(DATES, CLOCKS)), "%Y%m%d%H%M%S", *CLOCKS)


def _shape(form: str) -> re.Pattern[str]:
    """Return what a stamp of a form at least looks like; the others need not be parsed, which takes a hundred times as long."""
    if form.startswith("%Y"):  # read more freely than it is written
        return re.compile(r"\s*-.*|[\s+]*\d{4}.*", re.DOTALL)
    known = {"%b": r"[^\W\d]+\.?", "%p": r"[^\W\d]+\.?", " ": r"\s+"}
    parts = re.findall(r"%.|.", form)
    shape = "".join(known.get(one, r"\s*\d+" if one[0] == "%" else re.escape(one)) for one in parts)
    return re.compile(shape, re.IGNORECASE)


SHAPES = {form: _shape(form) for form in STAMPS}
TIME_WORDS = re.compile(r"time|epoch|unix|elapsed|date|clock|stamp|^t$|^ts\b|\bm?jd\b|julian|\btow\b|^x value$")
UNITLESS = "housing_temperature_degC"  # whose units no time has
YEARS = (12784, 25567)  # days from 1970 to 2005 and to 2040, between which a count since an epoch is likely
DAY = datetime.timedelta(days=1)
LIKELY_DAYS = 1000.0  # that a file lasts whose times look like days
USUAL_STEP = (1e-3, 3600.0)  # s between rows


def is_time(name: str, hint: str) -> bool:
    """Tell whether a heading names a time: by a word, or as t in a unit of time."""
    if read_heading(UNITLESS, hint).unit:
        return False
    short = re.split(r"[\s/]+", plain(name))
    symbol = name[:1] == "t" and short[:1] == ["t"] and len(short) <= 2 and read_heading("time_s", hint).unit
    return bool(TIME_WORDS.search(plain(name)) or symbol)


def find_time(look: Look, evenly: bool = False) -> tuple[list[str], str, str]:
    """Return the time columns, their format and doubts; `evenly`: the file states its step, and a column that merely rises is no time."""
    names, hints, numbers = look.names, look.hints, look.numbers
    # the head may come again
    cells = {name: [cell for cell in own if cell != name] for name, own in look.columns.items()}
    named = [name for name in names if is_time(name, hints[name])]
    named = [name for name in named if name != "T" or "t" not in names]
    stamps = [name for name in names if cells[name] and all(is_stamp(cell) for cell in cells[name] if cell)]
    stamped = [name for name in (named or stamps) if name in stamps][:2]
    if stamped:
        for columns in [stamped, stamped[:1], stamped[1:]] if len(stamped) > 1 else [stamped]:
            form, unsure = _find_stamp(columns, cells, " ".join(hints[name].lower() for name in columns))
            if form:
                more = _find_fraction(look)
                return [*columns, *more], f"{form} + {find_spelling('time_s', more[0])}" if more else form, unsure
        return stamped[:1], "iso", "no known form fits; write the pattern"
    meant = find_meanings(hints, numbers)  # a temperature that only rises is no clock
    rising = [name for name in names if rises(numbers[name]) and name not in meant]
    if not named and (evenly or not rising):
        return [], "", "no column is a time; by how many seconds do the rows lie apart?"
    time = next((name for name in named if name in rising or rises(numbers[name])), (named or rising)[0])
    unsure = "" if named else "no column is named time; the first increasing one was taken"
    values, stated = numbers[time], read_heading("time_s", hints[time])
    words = re.findall(r"[^\W\d_]+", hints[time])
    unit = stated.unit or next(filter(None, (find_spelling("time_s", word) for word in reversed(words))), "")
    if (epoch := find_epoch(plain(time), values, SECONDS.get(unit))) and stated.scale == 1.0:
        return [time], epoch[0], unsure or epoch[1]
    if stated.scale != 1.0 or stated.times != 1.0:
        unit, said = unit or "s", f"the name says '{stated.said}'"
        return [time], unit if stated.scale == 1.0 else f"{stated.scale!r} {unit}", said
    if unit:
        return [time], unit, unsure
    return [time], _likely_unit(values), unsure or "the name states no unit; chosen by the step between rows"


def _find_fraction(look: Look) -> list[str]:
    """Return a column of milliseconds or less within the second of the stamps beside it."""
    for name, numbers in look.numbers.items():
        size = SECONDS.get(find_spelling("time_s", plain(name)) or "", 1.0)
        if size < 1 and numbers and 0 <= min(numbers) < max(numbers) < 1 / size:
            return [name]
    return []


def find_epoch(name: str, values: Sequence[float], of: float | None) -> tuple[str, str] | None:
    """Return the count since an epoch that a name states, or that values look like, by counts of so many seconds (None: of any), and what must be checked; None where they are none."""
    first, last = (values[0], values[-1]) if values else (0.0, 0.0)
    fitting = {
        form: re.search(words, name) is not None
        for form, (size, begun, words) in EPOCHS.items()
        if of in (None, size)
        and YEARS[0] < (first - begun) * size / 86400.0 < YEARS[1]
        and (size < 86400.0 or (last - first < LIKELY_DAYS and any(value % 1 for value in values)))
    }
    if not fitting:
        return None
    best, *others = sorted(fitting, key=lambda form: not fitting[form])
    others = [form for form in others if form.startswith("unix") or not fitting[best]]  # GPS receivers log either
    doubt = " or ".join([f"the {'name says' if fitting[best] else 'values look like'} it", *others])
    return best, doubt if others or not fitting[best] else ""


def rises(values: Sequence[float]) -> bool:
    """Tell whether every number is above the one before it."""
    return len(values) > 2 and all(b > a for a, b in itertools.pairwise(values))


def _likely_unit(values: Sequence[float]) -> str:
    """Return s, or ms, us, ns where seconds would put the rows hours apart."""
    steps = sorted(b - a for a, b in itertools.pairwise(values))
    step = steps[len(steps) // 2] if steps else 1.0
    if USUAL_STEP[0] <= step <= USUAL_STEP[1]:
        return "s"
    return min(("s", "ms", "us", "ns"), key=lambda unit: abs(math.log10(max(step, 1e-300) * SECONDS[unit])))


def _find_stamp(columns: Sequence[str], cells: Mapping[str, list[str]], hint: str) -> tuple[str, str]:
    text = [stamp for row in zip(*(cells[name] for name in columns), strict=True) if (stamp := " ".join(row).strip())]
    near = [form for form, shape in SHAPES.items() if text and shape.fullmatch(text[0].replace(",", "."))]
    fitting = {form: times for form in near if parse_stamps(text[:1], form) and (times := parse_stamps(text, form))}
    elapsed = next((form for form, one in DURATIONS.items() if all(re.fullmatch(one, cell) for cell in text)), "")
    named = re.search("elapsed|duration|relative|run time|mm:ss", f"{hint} {plain(hint)}") is not None
    if elapsed and (named or not fitting):
        return elapsed, ""
    if not fitting:
        return ("iso", "") if parse_stamps(text, "iso") else ("", "")
    spans = {form: max(times) - min(times) for form, times in fitting.items()}
    # of two dates the one by which the run is shorter, or a missing hour that of a change of clocks
    best = min(fitting, key=lambda form: (spans[form], not find_change(*since_first(fitting[form]))))
    other = next((f for f in fitting if fitting[f] != fitting[best] and spans[f] < 2 * spans[best] + DAY), "")
    unsure = f"day and month could be exchanged; or '{other}'" if other else ""
    return best, unsure or ("no date: give 'start' to place the run in time" if best in CLOCKS else "")


def since_first(times: Sequence[datetime.datetime]) -> tuple[datetime.datetime, Array]:
    """Return the first of some times, and the seconds of all after it."""
    return times[0], np.array([(t - times[0]).total_seconds() for t in times])


def parse_stamps(text: Sequence[str], form: str) -> list[datetime.datetime]:
    """Return the times of stamps; none at all where one is not of the form."""
    import pandas as pd

    plain = pd.Series(text, dtype=str).str.replace(",", ".", regex=False)
    try:
        times = pd.to_datetime(plain, format="ISO8601" if form == "iso" else form, errors="coerce", utc=True)
    except ValueError:
        return []
    return [] if times.isna().any() else list(times.dt.tz_localize(None).dt.to_pydatetime())
