"""A first map for raw files: notation, time, columns and units guessed from names and cells, and every guess marked."""

import itertools
import re
import statistics
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace

from studies.errors import InputError
from studies.files.given import shorten
from studies.importing.channels import is_container, open_channels, sort_groups
from studies.importing.daylight import find_change
from studies.importing.draft_columns import check, comment_of, draft_column, draft_unknown, find_markers, guess_meanings
from studies.importing.heading import read_heading
from studies.importing.join import read_series, shift_between
from studies.importing.look import Look, find_nominal, find_period, is_stamp, look_at, look_at_group
from studies.importing.mapping import SCHEMA, TABLE_TARGETS, FileMap, ImportMap
from studies.importing.meaning import find_meanings
from studies.importing.notation import is_number
from studies.importing.offset import estimate_offset
from studies.importing.resampling import ClockedFile
from studies.importing.timing import find_time, is_time, parse_stamps, rises, since_first
from studies.schema.keys import spell_value
from studies.schema.reader import read_keys

JUMPS = 20.0  # times that rows of one time lie farther apart than those of neighbouring times
MOST_DEVICES = 50  # that one file may hold
DEVICE_WORDS = r"gyro|device|serial|channel|axis|sensor|unit|\bid\b|gerät|kanal"
SEEN = 1_000_000  # rows of a file whose clock is compared
MOST_SETTLED = 500  # rows of a table of settled readings


@dataclass(frozen=True)
class Draft:
    """The text of a map, the columns of the record that it fills, raw columns without a meaning, and what was noticed."""

    text: str
    mapped: tuple[str, ...]
    left_over: tuple[str, ...]
    notes: tuple[str, ...] = ()


def draft_map(paths: Sequence[str]) -> Draft:
    """Draft the map of one or more raw files."""
    head = [
        "# A draft: compare every line with the file before relying on it; CHECK marks guesses.",
        f'schema = "{SCHEMA}"',
        '# instrument = "..."',
        '# source = "..."',
    ]
    if len(paths) == 1 and not is_container(paths[0]) and (table := _draft_table(paths[0])) is not None:
        lines, unused = table
        doubt = "    # CHECK: no column is named as a time, so these are settled readings" if unused else ""
        return Draft("\n".join([*head, f'target = "table"{doubt}', "", *lines]) + "\n", TABLE_TARGETS, unused)
    head.append("# step_s = 1.0    # a regular time grid; without it the times of the first file")
    files: list[list[str]] = []
    mapped: list[str] = []
    left_over: list[str] = []
    groups = _group(paths)
    for group in groups:
        begun = False
        for look in _look_at_all(group[0]):
            written, found, others = _draft_look(group[0], look, mapped)
            if begun:
                written.insert(2, "same_file = true")
            elif len(group) > 1:
                written = [line for line in written if not line.startswith("last_line")]
                written.insert(
                    2, f"parts = {len(group)}    # CHECK: consecutive files: {', '.join(map(comment_of, group))}"
                )
            begun = begun or bool(found)
            files.append(written if found or look.group is None else [f"# {line}".rstrip() for line in written])
            mapped += found
            left_over += others
    notes = _find_offsets([group[0] for group in groups], files) if len(groups) > 1 else []
    text = "\n".join([*head, *(line for written in files for line in ("", *written))])
    return Draft(text + "\n", tuple(dict.fromkeys(mapped)), tuple(left_over), tuple(notes))


def _look_at_all(path: str) -> list[Look]:
    """Look at a table, or at every group of a file of channels, slow ones first: theirs are the times of the record."""
    if not is_container(path):
        return [look_at(path)]
    with open_channels(path) as channels:
        return [look_at_group(group) for group in sorted(sort_groups(channels), key=lambda group: group.rows)]


def _group(paths: Sequence[str]) -> list[list[str]]:
    """Put files that continue one another into one group: the same columns, and times that go on."""
    groups: list[list[str]] = []
    for path in paths:
        if groups and look_at(path).names == look_at(groups[-1][0]).names and _continues([groups[-1][-1], path]):
            groups[-1].append(path)
        else:
            groups.append([path])
    return groups


def _continues(paths: Sequence[str]) -> bool:
    """Tell whether the times of one file go on in the other; what the draft leaves to be filled matters to no time."""
    draft = [
        line.replace("= 0.0    # CHECK", "= 1.0    # CHECK") for line in _draft_look(paths[0], look_at(paths[0]), ())[0]
    ]
    try:
        file = _load_text(draft)
        return file.sample_period is None and bool(read_series(paths, file))
    except InputError:
        return False


def _load_text(lines: Sequence[str]) -> FileMap:
    text = "\n".join([f'schema = "{SCHEMA}"', *lines])
    return read_keys(tomllib.loads(text), ImportMap, "draft").files[0]


def _find_offsets(paths: Sequence[str], files: list[list[str]]) -> list[str]:
    """Offer the offset between the first file's clock and each other's, where their columns share enough."""
    try:
        series = [read_series([path], _load_text(_draft_look(path, look_at(path), ())[0])) for path in paths]
        shifts = [shift_between(series[0], other) for other in series]
    except InputError:  # the draft is not complete yet: nothing can be compared
        return []
    notes, base = [], series[0]
    for written, path, other, shift in zip(files[1:], paths[1:], series[1:], shifts[1:], strict=True):
        t1, t2 = base.time.thin(SEEN), other.time.thin(SEEN) + shift
        found = [
            (offset, one, two)
            for (one, _), y1 in base.columns.items()
            for (two, _), y2 in other.columns.items()
            if (offset := estimate_offset(t1, y1.thin(SEEN), t2, y2.thin(SEEN), _one_unit(one, two))) is not None
        ]
        if not found:
            continue
        # two columns of one quantity before others, which may lag; of pairs that agree alike, the one with the sharpest offset
        found = [item for item in found if _one_unit(item[1], item[2])] or found
        best = max(item[0].correlation for item in found)
        alike = [item for item in found if 1 - item[0].correlation < 3 * (1 - best) + 1e-3]
        offset, one, two = min(alike, key=lambda item: item[0].high - item[0].low)
        said = f"{offset.value:.2f} s (90 %: {offset.low:.2f} to {offset.high:.2f} s)"
        ours, theirs = _source_of(base, one), _source_of(other, two)
        place = next(k for k, line in enumerate(written) if line.startswith("# clock_offset_s"))
        written[place : place + 1] = [
            f"# {comment_of(theirs)} here follows {comment_of(ours)} of the first file best with an offset of",
            f"# {said}, correlation {offset.correlation:.4f};",
            "# a thermal lag between two places looks the same: use it only if both sensors are at one place.",
            f"# clock_offset_s = {offset.value:.2f}    # CHECK: added to this file's times",
        ]
        notes.append(f"{path}: its clock seems to be off: add {said}, by {theirs} against {ours}; see the draft.")
    return notes


def _source_of(series: ClockedFile, target: str) -> str:
    return next(f"'{column.source}'" for column in series.file.columns if column.target == target)


def _one_unit(one: str, two: str) -> bool:
    return one.endswith("_degC") and two.endswith("_degC")


def _draft_table(path: str) -> tuple[list[str], tuple[str, ...]] | None:
    look = look_at(path)
    if look.header is None:
        return None
    hints, numbers, body, above = look.hints, look.numbers, look.body, look.above
    meanings = find_meanings(hints, numbers)
    clocks = (name for name in hints if rises(numbers[name]) and name not in meanings)
    if any(read_heading("time_s", hints[name]).unit for name in clocks) or any(map(is_time, hints, hints.values())):
        return None
    if any(is_stamp(cell) for row in body[:5] for cell in row) or find_period(above) is not None:
        return None
    by_target = {meaning.target: name for name, meaning in meanings.items()}
    temperature = by_target.get("housing_temperature_degC") or by_target.get("chamber_temperature_degC")
    if temperature is None or "frequency_Hz" not in by_target or len(body) > MOST_SETTLED:
        return None
    lines = _describe_notation(path, look)
    for name, target in ((temperature, "temperature_degC"), (by_target["frequency_Hz"], "frequency_Hz")):
        meaning = replace(meanings[name], target=target)
        lines += ["", *draft_column(name, meaning, hints[name], numbers[name], nominal=find_nominal([*above, name]))]
    return lines, tuple(name for name in look.names if name not in (temperature, by_target["frequency_Hz"]))


def _describe_notation(path: str, look: Look) -> list[str]:
    lines = ["[[file]]", f"# {comment_of(path)}"]
    if look.group is not None:
        named, clock = look.group, look.group.clock
        units = ", ".join(f"{name} [{c.unit}]" if c.unit else name for name, c in named.channels.items())
        about = f", {clock.step!r} s apart" if clock and clock.step else ", with their own clock" if clock else ""
        said = [f"# {comment_of(units)}: {named.rows} rows{about}"]
        return [*lines, *([f"group = {spell_value(named.name)}"] if named.name else []), *said]
    if look.encoding:
        notation = look.notation
        usual = look.encoding in ("utf-8", "utf-16", "cp1252")
        lines += [
            f"separator = {spell_value(look.separator)}",
            f'decimal = "{notation.decimal}"{check(notation.doubt)}',
            f'encoding = "{look.encoding}"{check("" if usual else "by the words that it makes of the headings")}',
        ]
        lines += [f'thousands = "{notation.thousands}"'] if notation.thousands else []
    elif look.others:
        lines += [
            f"# CHECK: the others need a [[file]] each, with sheet = one of {', '.join(map(spell_value, look.others))}",
            f"sheet = {spell_value(look.sheet)}",
        ]
    header = 0 if look.header is None else look.header + 1
    end = [f"last_line = {look.last}    # CHECK: below it stands no reading"] if look.last else []
    return [*lines, f"header_line = {header}", f"data_line = {look.data + 1}", *end]


def _draft_look(path: str, look: Look, taken: Sequence[str]) -> tuple[list[str], list[str], list[str]]:
    names, above, cells, hints, numbers = look.names, look.above, look.columns, look.hints, look.numbers
    period = find_period([*above, *names])
    own = look.group.clock if look.group is not None else None
    time, form, unsure = ([], "", "") if own is not None else find_time(look, evenly=period is not None)
    lines = _describe_notation(path, look)
    markers = [*find_markers(look, time), *dict.fromkeys(look.remarks)]
    if markers:
        lines.append(f"missing = {spell_value(markers)}    # CHECK: these cells mean 'no value'")
    if time:
        lines.append(f"time = {spell_value(time[0] if len(time) == 1 else time)}")
        lines.append(f"time_format = {spell_value(form)}{check(unsure)}")
    elif own is not None:
        lines.append('time_format = "own"    # the clock of the file itself')
    else:
        stated = "the lines above the table say so" if period else unsure
        lines.append(f"sample_period_s = {period or 0.0!r}{check(stated)}")
    joined = [" ".join(stamp) for stamp in zip(*(cells[name] for name in time), strict=True)]
    whole = [stamp.rpartition(" ")[0] if " + " in form else stamp for stamp in joined]
    stamped = time and (form == "iso" or ("%" in form and "%z" not in form))
    if stamped or (own is not None and own.start is not None and own.start.tzinfo is None):
        times = parse_stamps([stamp for stamp in whole if stamp.strip()], form.partition(" + ")[0]) if stamped else []
        change = find_change(*since_first(times)) if times else None
        zone, doubt = (change[0], f"; CHECK: {change[1]}") if change else ("Europe/Berlin", "")
        lines.append(f'# timezone = "{zone}"    # of local times that change between summer and winter{doubt}')
    if len(set(joined)) < len(joined):
        several = next((name for name in names if name not in time and _tells_devices(name, joined, cells[name])), None)
        if several is not None:
            raise InputError(
                f"{path}: each time stands there once for every value of '{shorten(several)}'"
                f" ({shorten(', '.join(dict.fromkeys(cells[several])))}): these are several gyros or channels. Write a file for each of them."
            )
        if odd := next((name for name in names if name not in time and _alternates(joined, numbers[name])), None):
            raise InputError(
                f"{path}: each time stands there {len(joined) // len(set(joined))} times, and '{shorten(odd)}' jumps from row to row but hardly"
                " changes from one time to the next: these are several gyros or channels. Write a file for each of them."
            )
        rows = zip(joined, zip(*cells.values(), strict=True), strict=True)
        copies = [one[1] == two[1] for one, two in itertools.pairwise(rows) if one[0] == two[0]]
        if copies:
            same = "first", "some rows stand there twice"
            kept, why = same if all(copies) else ("spread", "some times repeat; 'first' keeps one row")
            lines.append(f'repeated_times = "{kept}"{check(why)}')
    lines.append("# clock_offset_s = 0.0    # added to this file's times: positive when its clock is behind")
    usable = {name: hints[name] for name in names if name not in time and numbers[name]}
    group = look.group.name if look.group is not None else ""
    meanings = (
        find_meanings(usable, numbers, taken, group) if look.header is not None else guess_meanings(usable, numbers)
    )
    others = [name for name in names if name not in time and name not in meanings and any(cells[name])]
    for name in names:
        if name in others:
            lines += ["", *draft_unknown(name, numbers[name], hints[name])]
        elif name in meanings:
            guessed = "guessed from its values" if look.header is None else ""
            nominal = find_nominal([*above, name])
            drafted = draft_column(name, meanings[name], hints[name], numbers[name], guessed, nominal)
            if look.group is not None and taken:
                drafted.append('resample = "mean"    # onto the times of the first [[file]]')
            lines += ["", *drafted]
    return lines, [meaning.target for meaning in meanings.values()], others


def _tells_devices(name: str, times: Sequence[str], cells: Sequence[str]) -> bool:
    """Tell whether a column of a few words makes repeated times single: those of one gyro, or channel, each; a counter within a second is none."""
    few = 1 < len(set(cells)) <= MOST_DEVICES and len(times) > 2 * len(set(cells))
    named = re.search(DEVICE_WORDS, name.lower()) or not all(is_number(cell) for cell in cells)
    return bool(few and named) and len(set(zip(times, cells, strict=True))) == len(times)


def _alternates(times: Sequence[str], numbers: Sequence[float]) -> bool:
    """Tell whether the rows of one time lie far apart in a column in which each place within a time goes on smoothly."""
    many = len(times) // len(set(times))
    even = len(times) >= 4 * many and all(times[k] == times[k - k % many] for k in range(len(times)))
    if not even or len(numbers) != len(times) or len(set(numbers)) <= many:  # a counter within each time
        return False
    apart, on = ([abs(b - a) for a, b in zip(numbers, numbers[step:], strict=False)] for step in (1, many))
    return statistics.median(apart) > JUMPS * statistics.median(on)
