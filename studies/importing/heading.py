"""What a heading states of the numbers below it: a unit, and quantity = scale × reading + offset in that unit."""

import functools
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studies.importing.units import find_spelling, split_nominal, units_of
from studies.importing.words import BRACKETED, PRINTED, plain

NUMBER = r"(?:1/\d+|\d+(?:[.,]\d+)?(?:e[+-]?\d+)?)"
RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻−", "0123456789--")
POWERS = re.compile(r"(?<![\d.])10\s*(?:\^|\*\*|(?=[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]))\s*([-+−⁻\d⁰¹²³⁴⁵⁶⁷⁸⁹]+)")
BEHIND = re.compile(rf"(?:\s+in|,|\s(?=\d\S*e[+-]?\d))\s*({NUMBER}(?:\s*[^\W\d][^\s\])]*)?)\s*$", re.IGNORECASE)
UNIT = re.compile(
    rf"(?:[x×*·]\s*)?({NUMBER})?\s*(.*?)(?:\s*(?:per|/)\s*(?:lsb|counts?|digits?|ticks?|bits?))?(?:\s*/\s*({NUMBER}))?",
    re.IGNORECASE,
)
"""A unit between numbers, as in "10 kHz", "1e-6", "0.001 deg/h per LSB", "deg/h/100"."""
MANY = {"k": 1e3, "thousand": 1e3, "thousands": 1e3, "m": 1e6, "mio": 1e6, "million": 1e6, "millions": 1e6}
"""Words that stand for a factor where a number has no unit."""
DESCRIBED: tuple[tuple[str, str], ...] = (
    (r"period.*count|count.*period", "period-counts"),
    (r"gate|counts?\b", "gate-counts"),
    (r"period.*(us|µs|μs)\b|(us|µs|μs)\b.*period", "period-us"),
    (r"period.*\bms\b", "period-ms"),
    (r"period", "period-s"),
    (r"1/q|\binv(erse)?\b", "1/Q"),
    (r"^q|q[ _-]*fact|quality", "Q"),
    (r"counts?\b", "counts"),
)
"""Units that are described rather than spelled; the first that fits is taken."""
NEGATED = re.compile(r"^\s*-1?\s*[x×*·]?\s*(?=[^\W\d]|$)|\b(?:inverted|negated|reversed|flipped)\b|[x×*·]\s*\(?-1\b(?![.e])", re.IGNORECASE)  # fmt: skip
DIVIDED = re.compile(
    rf"(?<!\b\d)(?<!\s)\s*(?:/|÷|\bdiv(?:ided)?\s*(?:by\b)?|\bprescal\w*|\bdivider)\s*[:=]?\s*({NUMBER})(?![\w.])",
    re.IGNORECASE,
)
TIMES = re.compile(rf"(?<=[^\s\[(])\s*(?:[×*·]|\bx)\s*({NUMBER})\b|(?<=\w)x({NUMBER})\b", re.IGNORECASE)
OFFSET = re.compile(
    r"(?:(?:^|\s)(?P<name>[^\W\d][\w ]*?[)\]]?)(?P<gap>\s*))?(?P<sign>[-+]|\bminus\b|\bplus\b|\babove\b|\brel\w*\.? to\b)(?P<wide>\s*)"
    r"(?P<number>\d+(?:[.,]\d+)?)\s*(?P<unit>[^\W\d]\w{0,3}|[°º]\s?[CFKС])?\s*(?=$|[)\]])",
    re.IGNORECASE,
)
HARMONICS: tuple[tuple[str, float], ...] = (
    (r"\b(second|2nd|2\.?) harmonic|\bharmonic 2\b|\bdoubled?\b|\btwice\b|\bdoppelt\w*", 2.0),
    (r"\b(third|3rd|3\.?) harmonic|\bharmonic 3\b|\btripled?\b", 3.0),
    (r"\bhalf|half\b|\bhalved\b|\bhalbe?\b", 0.5),
)
CHANNELS = 10  # numbers below it may be those of a sensor
HIGH = 300.0  # what is taken off a name without blanks is no number of a sensor


@dataclass(frozen=True)
class Stated:
    """Quantity = scale × reading + offset, in a unit (None: none is stated); `times` may multiply or divide; `said` names what states it; `strange`: brackets hold something else."""

    unit: str | None
    scale: float = 1.0
    offset: float = 0.0
    times: float = 1.0
    said: str = ""
    strange: bool = False

    def value(self, target: str, reading: float) -> float | None:
        """Return what a reading is in the unit of the record; None where nobody can say."""
        way = units_of(target)[self.unit or next(iter(units_of(target)))]
        x = self.scale * reading + self.offset
        known = not way.settings and self.times == 1 and not (way.never_zero and x == 0)
        return float(way.convert(np.array(x))) if known else None


@functools.lru_cache(maxsize=4096)
def read_heading(target: str, hint: str) -> Stated:
    """Return what a name, with what stands in its brackets and behind it, states of a column of the record, or of "time_s"."""
    units = units_of(target)
    if hint.strip().lower() == target.lower():
        return Stated(next(iter(units)))
    text = POWERS.sub(r"1e\1", hint.translate(PRINTED).replace("⁻¹", "^-1")).translate(RAISED).replace("_", " ")
    text = re.sub(r"\bq\s*\^?-1\b", "1/Q", text, flags=re.IGNORECASE)
    text = BEHIND.sub(r" [\1]", re.sub(r"[·*\s]*\b([a-z]+)\s*\^-1\b", r"/\1", text, flags=re.IGNORECASE))
    unit, factor, others = None, 1.0, []
    brackets = [content for content in re.findall(BRACKETED, text) if content != "-"]
    for content in reversed(brackets):
        last = [content.rpartition(" ")[2]] if not re.search(r"\d", content) else []
        pieces = [content, *(p for p in [*re.split(r";|,(?!\d)", content), *last] if p != content)]
        found = [one for p in pieces if (one := spell(target, p.strip())) and (one[0] or p is content)]
        if found and unit is None and factor == 1.0:
            unit, factor = found[0]
        else:
            others.append(content)
    (bare, *rest), scale, offset, times, said = _take(target, [re.sub(BRACKETED, " ", text), *others], unit)
    words = bare.split()
    if unit is None and (factor != 1.0 or not brackets or said):
        texts = [*(" ".join(words[k:]) for k in range(len(words))), bare.rpartition("/")[2].strip(), *rest]
        found = [one for one in (spell(target, text) for text in texts) if one and one[0]]
        unit, more = found[0] if found else (None, 1.0)
        factor *= more
    strange = bool(brackets) and unit is None and factor == 1.0 and not said
    if unit is None:
        described = f"{plain(hint)} {' '.join(others)} {text}".lower()
        unit = next((name for pattern, name in DESCRIBED if name in units and re.search(pattern, described)), None)
    said = [*said, *([f"{factor:g}"] if factor != 1.0 else [])]
    return Stated(unit, scale * factor, offset, times, " and ".join(said), strange and unit != "period-counts")


def spell(target: str, text: str) -> tuple[str | None, float] | None:
    """Return the unit that a text spells and the factor of its numbers; None where it spells none."""
    if unit := find_spelling(target, text):
        return unit, 1.0
    found = UNIT.fullmatch(text)
    number, rest, under = found.groups() if found else ("", text, "")
    many = MANY.get(rest.lower(), 0.0) if "Q" in units_of(target) else 0.0
    unit = find_spelling(target, split_nominal(rest)[0]) if rest else None
    if (rest and not (unit or many)) or (not rest and not re.search(r"[e./]|\d{3}", number or "", re.IGNORECASE)):
        return None  # a word, or the number of a channel
    return unit, (_number(number) if number else 1.0) * (many or 1.0) / (_number(under) if under else 1.0)


def _number(text: str) -> float:
    over, _, under = text.replace(",", ".").partition("/")
    return float(over) / float(under or 1)


def _take(target: str, texts: Sequence[str], unit: str | None) -> tuple[list[str], float, float, float, list[str]]:
    """Return what is left of texts without what they do to the quantity, and scale, offset, the factor that may go either way, and the words that say so."""
    scale, offset, times, said, left = 1.0, 0.0, 1.0, list[str](), list[str]()

    def cut(text: str, found: re.Match[str], word: str = "") -> str:
        said.append(word or found[0].strip())
        return f"{text[: found.start('sign') if word else found.start()]} {text[found.end() :]}"

    for text in texts:
        if (found := OFFSET.search(text)) and (taken := _offset(target, found, unit)) is not None:
            offset, text = taken, cut(text, found, found["sign"] + found["number"])
        if found := NEGATED.search(text):
            scale, text = -scale, cut(text, found)
        if found := DIVIDED.search(text):
            scale, text = scale * _number(found[1]), cut(text, found)
        if found := TIMES.search(text):
            n = _number(found[1] or found[2])
            if n >= CHANNELS or target.endswith("_Hz"):
                times, text = n, cut(text, found)
        if target.endswith("_Hz"):
            many = re.search(r"(?<![=\w.])(\d)[*·×]?f(?:\b|req)", text)
            words = [(one[0], n) for pattern, n in HARMONICS if (one := re.search(pattern, plain(text)))]
            for word, n in [(many[0], float(many[1]))] if many else words[:1]:
                scale /= n
                said.append(word)
        left.append(text.strip())
    return left, scale, offset, times, said


def _offset(target: str, found: re.Match[str], unit: str | None) -> float | None:
    """Return what must be added to a reading from which a name takes a number; None where the number is that of a sensor."""
    units, size = units_of(target), float(found["number"].replace(",", "."))
    kilo = "k" if target.endswith("_Hz") and (found["unit"] or "").lower() == "k" else ""
    own = find_spelling(target, kilo + "Hz" if kilo else found["unit"]) if found["unit"] else None
    name, apart = (found["name"] or "-").split()[-1], (found["gap"] and found["wide"]) or len(found["sign"]) > 1
    high = size >= HIGH and re.match("f", name, re.IGNORECASE)
    if target == "time_s" or (found["unit"] and own is None) or re.match(r"pt$|ntc$", name, re.IGNORECASE):
        return None
    if not own and ((size < CHANNELS and size % 1 == 0) or not (apart or high or len(name) == 1)):
        return None
    to, of = units[unit or next(iter(units))], units[own or unit or next(iter(units))]
    if to.settings or of.settings or "/ x" in to.words + of.words:
        return None
    zero, one, value = (float(way.convert(np.array(x))) for way, x in ((to, 0.0), (to, 1.0), (of, size)))
    return (value - zero) / (one - zero) * (-1.0 if found["sign"] in ("+", "plus") else 1.0)
