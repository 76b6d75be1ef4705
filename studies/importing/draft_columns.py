"""The entry of one column in a draft of a map: what it means, its unit, and what must be checked."""

import math
import re
from collections.abc import Mapping, Sequence

from studies.importing.heading import read_heading
from studies.importing.look import Look
from studies.importing.mapping import ColumnMap
from studies.importing.meaning import Meaning, read_reading, say_qualified
from studies.importing.notation import Notation, is_number
from studies.importing.units import split_nominal, units_of
from studies.importing.words import BRACKETED
from studies.schema.keys import spell_value
from studies.schema.reference import list_keys


def guess_meanings(hints: Mapping[str, str], numbers: Mapping[str, Sequence[float]]) -> dict[str, Meaning]:
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


def draft_column(
    name: str, meaning: Meaning, hint: str, numbers: Sequence[float], remark: str = "", nominal: float | None = None
) -> list[str]:
    """Return the entry of a column with a meaning, and what must be checked in it."""
    target, stated = meaning.target, read_reading(meaning.target, hint, numbers)
    units, unit = units_of(target), stated.unit or next(iter(units_of(target)))
    remark = remark or ("" if stated.unit else "the name states no unit")
    middle = sorted(numbers)[len(numbers) // 2]
    lines = [f"from = {spell_value(name)}", f'to = "{target}"{check(meaning.doubt)}']
    if target.endswith("_degC") and stated.unit is None and 200 < stated.scale * middle < 500:
        unit, remark = "K", "the values look like kelvin"
    lines.append(f'unit = "{unit}"{check(remark)}')
    said = f"the name says '{stated.said}'"
    if stated.scale != 1.0:
        n = read_heading(target, hint).times
        either = "" if stated.scale else f": the quantity is {1 / n:g} or {n:g} times the reading"
        lines.append(f"scale = {stated.scale!r}{check(said + either)}")
    elif target.endswith("_degC") and abs(middle) >= 500:
        lines.append(f"scale = 1.0{check('raw counts? The temperature is reading × scale + offset')}")
        lines.append(f"offset = 0.0{check('of raw counts')}")
    if stated.offset:
        lines.append(f"offset = {stated.offset:.10g}{check(said)}")
    for key in units[unit].settings:
        nominal = next((f for one in re.findall(BRACKETED, hint) if (f := split_nominal(one)[1])), nominal)
        value, said = (nominal, "stated in the file; ") if key == "nominal_Hz" and nominal is not None else (0.0, "")
        lines.append(f"{key} = {value!r}{check(said + _MEANINGS[key])}")
    if meaning.axis:
        lines.append(f'axis = "{meaning.axis}"')
    return ["[[file.column]]", *lines]


def draft_unknown(name: str, numbers: Sequence[float], hint: str) -> list[str]:
    """Leave a form to fill for a column without a meaning."""
    qualified = say_qualified(hint)
    span = f"{min(numbers):.6g} to {max(numbers):.6g}; " if numbers else ""
    return [
        f"# unknown column: {spell_value(name)}",
        *([f"# CHECK: {comment_of(qualified)}, so nothing was made of it"] if qualified else []),
        f"# {span}if it belongs to the record:",
        "# [[file.column]]",
        f"# from = {spell_value(name)}",
        '# to = "..."',
        '# unit = "..."',
    ]


_MEANINGS = {row["key"]: row["meaning"] for row in list_keys(ColumnMap)}
SENTINELS = (999.0, 9999.0, 99999.0)  # sizes of readings that loggers write for none


def find_markers(look: Look, time: Sequence[str]) -> list[str]:
    """Return texts that stand in columns of numbers; of the time its own name alone, where the head is written again."""
    markers: list[str] = []
    for name, cells in look.columns.items():
        words = [cell for cell in cells if cell and not is_number(cell)]
        words = [name] * words.count(name) if name in time else [*words, *_sentinels(cells, look.notation)]
        if 0 < 2 * len(words) < len(cells):
            markers += [word for word in dict.fromkeys(words) if word not in markers]
    return markers[:20]


def _sentinels(cells: Sequence[str], notation: Notation) -> list[str]:
    """Return cells such as -999 or 9999 in a column whose other readings do not come near."""
    numbers = [(cell, abs(number)) for cell in cells if (number := notation.number(cell)) is not None]
    usual = max((size for _, size in numbers if size not in SENTINELS), default=math.inf)
    return [cell for cell, size in numbers if size in SENTINELS and size > 2 * usual]


def check(doubt: str) -> str:
    """Return a doubt as it stands behind a line; nothing without one."""
    return f"    # CHECK: {comment_of(doubt)}" if doubt else ""


def comment_of(text: str) -> str:
    """Return somebody's text as it may stand behind a #."""
    return "".join(c if c.isprintable() else " " for c in text)
