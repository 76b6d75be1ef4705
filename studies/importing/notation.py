"""How a file writes numbers: decimal and thousands signs, decided by all of its cells, and a unit behind the number."""

import functools
import itertools
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from studies.importing.units import is_unit
from studies.importing.words import PRINTED

EXPONENT = r"(?:[eE][+-]?\d{1,2})?"
SHAPE = re.compile(rf"([+-]?(?:\d+(?:[.,' ]\d+)*[.,]?|[.,]\d+){EXPONENT})(?:\s*((?:[^\W\d]|[°º℃℉])\D{{0,11}}))?")
SMOOTHER = 0.9  # of the way that readings go up and down, over their range


@dataclass(frozen=True)
class Notation:
    """The signs of numbers, and what must be checked in them."""

    decimal: str = "."
    thousands: str = ""
    doubt: str = ""

    def number(self, cell: str) -> float | None:
        """Return the number that a cell holds, with a unit behind it or without; None where it holds something else."""
        found = read_number(cell, self.decimal, self.thousands)
        return found[0] if found and (not found[1] or is_unit(found[1])) else None


@functools.lru_cache
def pattern_of(decimal: str, thousands: str) -> re.Pattern[str]:
    """Return the pattern of a number that is written by two signs."""
    whole = rf"(?:\d{{1,3}}(?:{re.escape(thousands)}\d{{3}})+|\d+)" if thousands else r"\d+"
    return re.compile(rf"[+-]?(?:{whole}(?:[{decimal}]\d*)?|[{decimal}]\d+){EXPONENT}")


def read_number(cell: str, decimal: str, thousands: str) -> tuple[float, str] | None:
    """Return the number of a cell and what stands behind it; among decimal commas a point that can part no thousands is decimal too."""
    found = _match(cell)
    if not found:
        return None
    number, unit = found[1], found[2] or ""
    if decimal == "," and "," not in number and thousands != "." and not _is_grouped(number, "."):
        decimal = "."
    if not pattern_of(decimal, thousands).fullmatch(number):
        return None
    return float((number.replace(thousands, "") if thousands else number).replace(decimal, ".")), unit


def unit_of(cell: str) -> str:
    """Return the unit behind a number, "" where there is none."""
    found = _match(cell)
    return found[2] if found and found[2] and is_unit(found[2]) else ""


def is_number(cell: str) -> bool:
    """Tell whether a cell looks like a number, by whatever signs."""
    found = _match(cell)
    return found is not None and (not found[2] or is_unit(found[2]))


def _match(cell: str) -> re.Match[str] | None:
    return SHAPE.fullmatch(cell.strip().translate(PRINTED))


def find_notation(
    columns: Mapping[str, Sequence[str]], is_likely: Callable[[str, Sequence[float]], bool | None]
) -> Notation:
    """Decide by all cells which sign is decimal and which parts thousands; `is_likely` tells of a column's numbers.

    4.400,12 shows both, 20,5 the decimal one. 4.400 shows neither: other cells decide, then which reading runs smoother,
    then which one the column can have.
    """
    decimals, groups, doubtful = set[str](), set[str](), dict[str, dict[str, str]]()
    for name, cells in columns.items():
        for cell in cells:
            found = _match(cell)
            decimal, thousands, either = _show(found[1]) if found else ("", "", "")
            decimals |= {decimal} - {""}
            groups |= {thousands} - {""}
            if either:
                doubtful.setdefault(either, {}).setdefault(name, cell.strip())
    for sign, names in doubtful.items():
        other = "," if sign == "." else "."
        if sign in decimals or sign in groups:
            continue
        as_decimal, as_thousands = Notation(sign), Notation(other, sign)
        votes = sum(_vote(columns[name], as_decimal, as_thousands, name, is_likely) for name in names)
        example = next(iter(names.values()))
        if other in decimals or votes > 0:
            likelier = "" if votes >= 0 else ", though that is likelier"
            doubt = f"'{example}' is read as {as_thousands.number(example):.10g}, not as {as_decimal.number(example):.10g}{likelier}"
            return Notation(other, sign, doubt)
        if not votes and not decimals | groups:
            doubt = f"'{example}' is read as {as_decimal.number(example):.10g}; if '{sign}' parts thousands, write decimal = '{other}', thousands = '{sign}'"
            return Notation(sign, "", doubt)
        decimals |= {sign}
    decimal = next((sign for sign in ",." if sign in decimals), "," if "." in groups else ".")
    return Notation(decimal, next((sign for sign in sorted(groups - decimals)), ""))


def _show(number: str) -> tuple[str, str, str]:
    """Return the decimal sign, the sign between thousands, and one that could be either, that a number shows."""
    signs = re.findall("[.,' ]", number)
    if not signs:
        return "", "", ""
    last, whole = signs[-1], number.rpartition(signs[-1])[0]
    if len(set(signs)) == 2 and signs.count(last) == 1:
        return (last, signs[0], "") if _is_grouped(whole, signs[0]) and last in ".," else ("", "", "")
    if len(signs) > 1 or last not in ".,":
        return "", last if _is_grouped(number, last) else "", ""
    return ("", "", last) if _is_grouped(number, last) else (last, "", "")


def _is_grouped(number: str, sign: str) -> bool:
    return re.fullmatch(rf"[+-]?[1-9]\d{{0,2}}(?:[{sign}]\d{{3}})+", number) is not None


def _vote(
    cells: Sequence[str],
    as_decimal: Notation,
    as_thousands: Notation,
    name: str,
    is_likely: Callable[[str, Sequence[float]], bool | None],
) -> int:
    """Return 1 where the numbers of a column speak for thousands, -1 for decimals, 0 for neither."""
    ways, likely = [], []
    for notation in (as_decimal, as_thousands):
        numbers = [n for cell in cells if (n := notation.number(cell)) is not None]
        span = max(numbers) - min(numbers)
        ways.append(sum(abs(b - a) for a, b in itertools.pairwise(numbers)) / span if span else 1.0)
        likely.append(is_likely(name, numbers) is True)
    smoother = (ways[1] < SMOOTHER * ways[0]) - (ways[0] < SMOOTHER * ways[1])
    return smoother or int(likely[1]) - int(likely[0])
