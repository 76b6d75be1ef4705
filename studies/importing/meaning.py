"""What a laboratory's column means: columns of the record bid for it, by the words of its name and a unit that fits or forbids."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from studies.importing.units import TARGETS, find_spelling, split_nominal, units_of

BIDS: tuple[tuple[str, str, int], ...] = (
    # (pattern in the lower-case name, column of the record, weight)
    (r"chamber|kammer|oven|ofen|bath\b|box|set ?point|soll|ambient|umgebung|\bair\b", "chamber_temperature_degC", 6),
    (r"housing|geh(ä|ae)use|\bcase\b|t[ _]case|body|\bdut\b|device", "housing_temperature_degC", 6),
    (r"temp|pt ?100\b|pt ?1000\b|thermo|ntc\b|\bt[ _]?(h|housing|\d)?$|^t\b", "housing_temperature_degC", 3),
    (r"temp|pt ?100\b|pt ?1000\b|thermo|ntc\b", "chamber_temperature_degC", 1),
    (r"(ref\w*|external|counter|gps)[ _]*(freq|f\b)|(freq\w*|\bf)[ _]*(ref|external|counter|gps)", "reference_frequency_Hz", 6),
    (r"counter|period|gate", "reference_frequency_Hz", 1),
    (r"freq|\bf[ _]?(0|res|drive|n?2)?\b", "frequency_Hz", 4),
    (r"period|gate", "frequency_Hz", 3),
    (r"freq", "reference_frequency_Hz", 2),
    (r"applied|table|command\w*[ _]*rate|stimulus|turntable", "rate_deg_per_s", 6),
    (r"bias|zero[ _-]*rate|drift|\bzro", "bias_deg_per_h", 5),
    (r"rate|omega|gyr|\b[gw][xyz]\b", "measured_rate_deg_per_s", 4),
    (r"1/q|inv\w*[ _]*q|^q\b|q[ _-]*fact", "inverse_q", 5),
    (r"quad", "quadrature_V", 5),
    (r"drive|amplitude|ampl", "drive_amplitude_V", 4),
    (r"electrode|polari[sz]|trim", "electrode_bias_V", 5),
    (r"pattern|azimuth|theta", "pattern_angle_deg", 5),
    (r"counts?\b|\badc\b|\braw\b", "output_counts", 2),
    (r"(?=.*pick ?-?off)(?=.*(\bx\b|cos|\b1\b|\ba\b))", "pickoff_cos_V", 6),
    (r"(?=.*pick ?-?off)(?=.*(\by\b|sin|\b2\b|\bb\b))", "pickoff_sin_V", 6),
)  # fmt: skip
MEASURED, APPLIED = "measured_rate_deg_per_s", "rate_deg_per_s"
TURNS = r"meas|mess|gyr|sens|out|ausg|omega"
"""Words of a rate that was measured; without them it may be the table's."""
FITTING_UNIT = 2
OWN_NAME = 100
"""Weight of a column's name in a record."""
UNIT_WORDS: tuple[tuple[str, str], ...] = (
    (r"period.*count|count.*period", "period-counts"),
    (r"gate|counts?\b", "gate-counts"),
    (r"period.*(us|µs|μs)\b|(us|µs|μs)\b.*period", "period-us"),
    (r"period.*\bms\b", "period-ms"),
    (r"period", "period-s"),
    (r"1/q|inv", "1/Q"),
    (r"^q|q[ _-]*fact", "Q"),
    (r"counts?\b", "counts"),
)
"""Units that are described rather than spelled; the first that fits is taken."""
RAISED = str.maketrans({**dict(zip("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-", strict=True)), "−": "-"})
POWERS = re.compile(r"\b10\s*(?:\^|\*\*|(?=[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]))\s*([-+−⁻\d⁰¹²³⁴⁵⁶⁷⁸⁹]+)")
_NUMBER = r"(1/\d+|\d+(?:\.\d+)?(?:e[+-]?\d+)?)"
NUMBER = re.compile(rf"\s*(?:[x×*·]\s*)?{_NUMBER}\s*(?=$|[^\W\d]|°)", re.IGNORECASE)
"""A number at the beginning of a unit."""
BEHIND = re.compile(
    rf"(?:\s*/|\s+in|,|\s(?=\d\S*e[+-]?\d))\s*({_NUMBER[1:-1]}(?:\s*[^\W\d][^\s\])]*)?)\s*$", re.IGNORECASE
)
TIMES = re.compile(r"(?<=[^\s\[(])\s*[x×*·]\s*(?:\d+(?:\.\d+)?e[+-]?\d+|0\.0*1|1000*)\b", re.IGNORECASE)
MANY = {"k": 1e3, "thousand": 1e3, "thousands": 1e3, "m": 1e6, "mio": 1e6, "million": 1e6, "millions": 1e6}
"""Words that stand for a factor where a number has no unit."""
BRACKETED = r"[\[(]\s*([^\])]{1,24}?)\s*[\])]"
AXIS = re.compile(r"^(.*?)([xyz])((?:[^a-z].*)?)$", re.IGNORECASE)


@dataclass(frozen=True)
class Meaning:
    """What a raw column becomes: a column of the record, the axis ("" where there is only one), what it would be if that were free, and what it may be as well."""

    target: str
    axis: str = ""
    rather: str = ""
    perhaps: str = ""


def find_meanings(hints: Mapping[str, str], taken: Sequence[str] = (), group: str = "") -> dict[str, Meaning]:
    """Return the meaning of every column for which one is found, from `hints` of name and unit; `taken` are filled by other files.

    The name of their `group` says which temperature a column is of.
    """
    axes = _find_axes(hints)
    bids = sorted(
        (-weight, place, name, target)
        for place, (name, hint) in enumerate(hints.items())
        if name not in axes
        for target, weight in _bids(hint, group.lower()).items()
    )
    first = {name: target for _, _, name, target in reversed(bids)}
    found = {name: Meaning("measured_rate_deg_per_s", axis) for name, axis in axes.items()}
    filled = {*taken, *(meaning.target for meaning in found.values())}
    for _, _, name, target in bids:
        if name not in found and target not in filled:
            found[name] = Meaning(target, rather=first[name] if first[name] != target else "")
            filled.add(target)
    for name, meaning in found.items():
        if meaning == Meaning(MEASURED) and APPLIED not in filled and not re.search(TURNS, hints[name].lower()):
            found[name] = Meaning(MEASURED, perhaps=APPLIED)
    return {name: found[name] for name in hints if name in found}


def find_unit(target: str, hint: str) -> str | None:
    """Return the unit that a name states, of those from which the column can be made."""
    return read_unit(target, hint)[0]


def read_unit(target: str, hint: str) -> tuple[str | None, float]:
    """Return the unit that a name states, and the factor before it, as in "[1e6]", "(10 kHz)" or "/ 1e-9"; 0 of one that may go either way, as in "x1e6"."""
    units = units_of(target)
    if hint.strip().lower() == target.lower():
        return next(iter(units)), 1.0
    hint = BEHIND.sub(r" [\1]", POWERS.sub(r"1e\1", hint).translate(RAISED))
    either_way = TIMES.search(hint)
    hint = hint if either_way is None else hint[: either_way.start()] + hint[either_way.end() :]
    stated = re.findall(BRACKETED, hint)[-1:]
    bare = re.sub(BRACKETED, " ", hint).strip()
    words = re.split(r"[\s_]+", bare)
    number = NUMBER.match(stated[0]) if stated else None
    text = stated[0][number.end() :] if stated and number else "".join(stated)
    many = MANY if "Q" in units else {}
    if number and not text and not re.search(r"[e./]|\d{3}", number[1], re.IGNORECASE):
        number, text = None, stated[0]  # that of a channel
    factor = _value(number[1]) if number else many.get(text.lower(), 1.0)
    if factor != 1.0 and text.lower() in ("", *many):
        hint, stated, factor = bare, [], factor * (many.get(text.lower(), 1.0) if number else 1.0)
    texts = [text] if stated else [*(" ".join(words[k:]) for k in range(len(words))), bare.rpartition("/")[2]]
    spelled = next(filter(None, (find_spelling(target, split_nominal(one)[0]) for one in texts)), None)
    described = (unit for pattern, unit in UNIT_WORDS if unit in units and re.search(pattern, hint.lower()))
    unit = spelled or next(described, None)
    return unit, 0.0 if either_way is not None else 1.0 if stated and spelled is None else factor


def _value(number: str) -> float:
    over, _, under = number.partition("/")
    return float(over) / float(under or 1)


def _bids(hint: str, group: str = "") -> dict[str, int]:
    name = re.sub(r"[\[(][^\])]*[\])]", " ", hint).lower().replace("_", " ").replace(".", " ")
    exact = next((column for column in TARGETS if name.split() == column.lower().split("_")), None)
    if exact is not None:
        return {exact: OWN_NAME}
    bids: dict[str, int] = {}
    for pattern, target, weight in BIDS:
        if not re.search(pattern, name):
            continue
        fits = _unit_fits(target, hint)
        if fits is not False:
            bids[target] = max(bids.get(target, 0), weight + (FITTING_UNIT if fits else 0))
    told = BIDS[:2] if bids and all(target.endswith("_degC") for target in bids) else ()
    return {target: weight for pattern, target, weight in told if re.search(pattern, group)} or bids


def _unit_fits(target: str, hint: str) -> bool | None:
    """Tell whether the stated unit can belong to a column of the record; None where none is stated."""
    stated = re.findall(BRACKETED, hint)
    if stated:
        unit, factor = read_unit(target, hint)
        return find_unit(target, f"[{stated[-1]}]") is not None or unit == "period-counts" or factor != 1.0
    return True if find_unit(target, hint) is not None else None


def _find_axes(hints: Mapping[str, str]) -> dict[str, str]:
    """Return the axis of columns that come as x, y and z of one rate."""
    groups: dict[tuple[str, str], dict[str, str]] = {}
    for name, hint in hints.items():
        parts = AXIS.match(name)
        if parts and "measured_rate_deg_per_s" in _bids(hint):
            groups.setdefault((parts[1].lower(), parts[3].lower()), {})[parts[2].lower()] = name
    whole = [group for group in groups.values() if set(group) == {"x", "y", "z"}]
    return {name: axis for axis, name in whole[0].items()} if whole else {}
