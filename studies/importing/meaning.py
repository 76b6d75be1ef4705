"""What a laboratory's column means: columns of the record bid for it, by the words of its name and a unit that fits or forbids."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from studies.importing.notation import PRINTED
from studies.importing.units import TARGETS, find_spelling, split_nominal, units_of

BIDS: tuple[tuple[str, str, int], ...] = (
    # (pattern in the lower-case name, column of the record, weight)
    (r"chamber|kammer|oven|ofen|\bbath\b|\bbox|set ?point|soll|\bt set\b|ambient|umgebung|\bair\b", "chamber_temperature_degC", 6),
    (r"housing|geh(ä|ae)use|\bcase\b|\bt case|\bbody|\bdut\b|\bdevice", "housing_temperature_degC", 6),
    (r"^(?=.*temp|t\b).*(reson|\b(gyro|hrg|sample|sensor)\b)", "housing_temperature_degC", 5),
    (r"temp|pt ?100\b|pt ?1000\b|thermo|ntc\b|\brtd|\bt ?(h|housing|\d)?$|^t\b", "housing_temperature_degC", 3),
    (r"temp|pt ?100\b|pt ?1000\b|thermo|ntc\b", "chamber_temperature_degC", 1),
    (r"(\bref\w*|external|counter|gps) *(freq|f\b)|(freq\w*|\bf) *(ref|external|counter|gps)", "reference_frequency_Hz", 6),
    (r"counter|period|gate", "reference_frequency_Hz", 1),
    (r"fre(q|k)|\bf ?(0|res|drive|n?2)?\b", "frequency_Hz", 4),
    (r"period|gate", "frequency_Hz", 3),
    (r"fre(q|k)", "reference_frequency_Hz", 2),
    (r"applied|\btable|command\w* *rate|stimulus|turntable", "rate_deg_per_s", 6),
    (r"bias|zero[ -]*rate|drift|\bzro", "bias_deg_per_h", 5),
    (r"rate|omega|gyr|\b[gw][xyz]\b", "measured_rate_deg_per_s", 4),
    (r"1/q|\binv\w* *q|^q\b|\bq[ -]*fact", "inverse_q", 5),
    (r"quad", "quadrature_V", 5),
    (r"\bdrive|\bampl", "drive_amplitude_V", 4),
    (r"electrode|polari[sz]|\btrim", "electrode_bias_V", 5),
    (r"pattern|azimuth|\btheta", "pattern_angle_deg", 5),
    (r"counts?\b|\badc\b|\braw\b", "output_counts", 2),
    (r"(?=.*pick ?-?off)(?=.*(\bx\b|cos|\b1\b|\ba\b))", "pickoff_cos_V", 6),
    (r"(?=.*pick ?-?off)(?=.*(\by\b|sin|\b2\b|\bb\b))", "pickoff_sin_V", 6),
)  # fmt: skip
KINDS = re.compile(r"(temp|thermo|^t\b)|fre[qk]")
"""Words that leave only columns of one kind; of two the last one says what a column is."""
QUALIFIERS: tuple[tuple[str, int, str], ...] = (
    # (pattern in the lower-case name, what it takes off the weight, columns that it says nothing against)
    (r"\b(sd|std|sigma|σ|var(iance)?|unc|adev|allan|psd|snr|noise)\b|stabil|uncert|st\w* ?(dev|abw)|streuung|unsicherheit|rausch|toleran|±", 99, ""),
    (r"\berr(ors?)?\b|fehler|residu", 99, "quad"),
    (r"deviation|\bdev\b|abweich|\bdelta|[δ∆]|\bdiff|\bshift|detun|\bminus\b|\bf\w* ?- ?f\w{0,3}\b|\boffset|\bdrift|\bchange\b|änderung", 99, "bias"),
    (r"sampling|\bsample(?!.*temp)|abtast|acqui|\blogging|\bbaud|\b(data|update|refresh|scan|frame) rate|\bodr\b", 99, ""),
    (r"\bgain|coeff|\bgradient|\bslope|\btc[fb]?\b|\bramp|(heat|cool)ing|\bstatus|\bflags?\b|\bvalid|\balarm|\block\b(?![ -]?in)|\b(id|nr|no|index|serial|number)$", 99, ""),
    (r"pressure|druck|humid|feucht|\brh\b|\bdew|\bflow|\bfan\b|\bspeed|\bdoor|va[ck]uum|(\bcurrent|\bstrom)\b(?!.*(temp|freq))|leistung|\baccel", 99, ""),
    (r"laser|\broom|\blab\b|labor|logger|\b(c|m)pu\b|\b(mcu|fpga)\b|\bpump|supply|netzteil|heater|cooler|\b[ot]cxo|\bclock\b|modulat|dither|\bbeat\b|corner|cut ?off|bandwidth|inlet|outlet", 4, ""),
    (r"\bref(erence|erenz)?\b|cold junction", 2, "^ref"),
    (r"\bboard|\bpcb|\basic\b|electronic|elektronik|\b(min|max)(imum|imal)?\b|\bpeak|\brms\b|\bfit(ted)?\b|\bmodel|predict|simul|\bcalc|theor|compens|\bcorr|nominal|\btarget", 2, ""),
    (r"set ?p(oin)?t|soll|\bcommand|\bset\b", 2, "^rate|drive|electrode"),
)  # fmt: skip
LIKELY = {"frequency_Hz": (300.0, 1e6), "_degC": (-120.0, 200.0)}
"""What columns usually hold, by the end of their names."""
UNLIKELY = 2
"""What values that a column hardly has take off its weight."""
CLOSE = 1
"""Weights that differ by no more leave a choice in doubt."""
BASE = re.compile(r"\bf\w{0,8}(?:\s*\[\w+\])?\s*(?:-|minus)\s*(\d+(?:\.\d+)?)\s*(k?)(?:hz)?")
"""A frequency from which another is counted, as in "f-4400"."""
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
    """What a raw column becomes: a column of the record, the axis ("" where there is only one), what must be checked, and from which frequency it counts (Hz)."""

    target: str
    axis: str = ""
    doubt: str = ""
    base: float = 0.0


def find_meanings(
    hints: Mapping[str, str], numbers: Mapping[str, Sequence[float]], taken: Sequence[str] = (), group: str = ""
) -> dict[str, Meaning]:
    """Return the meaning of every column for which one is found, from `hints` of name and unit and from its numbers; `taken` are filled by other files.

    The name of their `group` says which temperature a column is of.
    """
    axes = _find_axes(hints)
    weights = {name: _weigh(hint, numbers[name], group) for name, hint in hints.items() if name not in axes}
    still = {name: len(set(numbers[name])) == 1 for name in hints}
    bids = sorted(
        ((weight, name, target) for name, own in weights.items() for target, weight in own.items() if weight > 0),
        key=lambda bid: (-bid[0], still[bid[1]]),
    )
    found = {name: Meaning(MEASURED, axis) for name, axis in axes.items()}
    filled = {*taken, *(meaning.target for meaning in found.values())}
    for _, name, target in bids:
        if name not in found and target not in filled:
            found[name] = Meaning(target)
            filled.add(target)
    for name in set(found) - set(axes):
        target, own = found[name].target, weights[name]
        best = max(own, key=lambda one: own[one])
        close = [
            other
            for weight, other, one in bids
            if one == target and other not in found and weight >= own[target] - CLOSE and own[target] < OWN_NAME
        ]
        rate = target == MEASURED and APPLIED not in filled and not re.search(TURNS, hints[name].lower())
        likely = is_likely(target, hints[name], numbers[name])
        base = find_base(hints[name]) if target == "frequency_Hz" and likely is not True else 0.0
        doubts = (
            own[best] > own[target] and f"by its name {best}, which another column fills",
            rate and f"or {APPLIED}, if it is the applied rate",
            close and f"or {', '.join(map(repr, close))}, which fits as well",
            own[target] < OWN_NAME and say_qualified(hints[name], target),
            not base and likely is False and "its values are unusual for that",
        )
        found[name] = Meaning(target, doubt="; ".join(str(doubt) for doubt in doubts if doubt), base=base)
    return {name: found[name] for name in hints if name in found}


def find_base(hint: str) -> float:
    """Return the frequency (Hz) that a name such as "f-4400" takes off another; 0 where there is none."""
    found = BASE.search(hint.translate(PRINTED).lower())
    base = float(found[1]) * (1e3 if found[2] else 1.0) if found else 0.0
    return base if base >= LIKELY["frequency_Hz"][0] else 0.0


def say_qualified(hint: str, target: str = "") -> str:
    """Return that a name has words by which it is another quantity than its noun; "" where it has none."""
    found = next((word for _, word in _qualify(_plain(hint), target, hint)), "")
    return f"its name says '{found}'" if found else ""


def _qualify(name: str, target: str, hint: str) -> Iterator[tuple[int, str]]:
    """Yield what qualifiers take off the weight of a name for a column, with the word that says so."""
    deviation = target.endswith("_Hz") and (read_unit(target, hint)[0] in ("ppm", "ppb") or find_base(hint) > 0)
    for pattern, cost, but in QUALIFIERS:
        found = re.search(pattern, name)
        if found and not (but and re.search(but, target)) and not (deviation and "deviation" in pattern):
            yield cost, found[0].strip()


def is_likely(target: str, hint: str, numbers: Sequence[float]) -> bool | None:
    """Tell whether numbers are usual in a column of the record; None where nobody can say."""
    unit, factor = read_unit(target, hint)
    low, high = next((ends for ending, ends in LIKELY.items() if target.endswith(ending)), (-np.inf, np.inf))
    if low == -np.inf or not numbers or factor == 0:
        return None
    middle = factor * sorted(numbers)[len(numbers) // 2]
    if unit is None and target.endswith("_degC"):  # kelvin, or raw counts
        return low <= middle < 500 or None
    way = units_of(target)[unit or next(iter(units_of(target)))]
    if way.settings or (way.never_zero and middle == 0):
        return None if way.settings else False
    return bool(low <= way.convert(np.array(middle)) <= high)


def looks_likely(hint: str, numbers: Sequence[float]) -> bool | None:
    """Tell whether numbers are usual in the column that a name stands for."""
    bids = _bids(hint)
    return is_likely(max(bids, key=lambda one: bids[one]), hint, numbers) if bids else None


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


def _plain(hint: str) -> str:
    """Return a name in small letters without what stands in brackets, its words apart."""
    name = re.sub(r"[\[(][^\])]*[\])]", " ", hint.translate(PRINTED))
    return re.sub(r"(?<=[a-z])(?=[A-Z][a-z])|[_.]", " ", name).lower()


def _weigh(hint: str, numbers: Sequence[float], group: str) -> dict[str, int]:
    """Return how well a name, its unit and its numbers fit columns of the record."""
    return {
        target: weight - (UNLIKELY if weight < OWN_NAME and is_likely(target, hint, numbers) is False else 0)
        for target, weight in _bids(hint, group.lower()).items()
    }


def _bids(hint: str, group: str = "") -> dict[str, int]:
    bare = re.sub(r"[\[(][^\])]*[\])]", " ", hint).lower().replace(".", " ").replace("_", " ").split()
    exact = next((column for column in TARGETS if bare == column.lower().split("_")), None)
    if exact is not None:
        return {exact: OWN_NAME}
    name, bids = _plain(hint), dict[str, int]()
    kind = [("_degC" if found[1] else "_Hz") for found in KINDS.finditer(name)][-1:]
    for pattern, target, weight in BIDS:
        if not re.search(pattern, name) or not target.endswith(tuple(kind) or ""):
            continue
        fits = _unit_fits(target, hint)
        if fits is not False:
            weight += (FITTING_UNIT if fits else 0) - sum(cost for cost, _ in _qualify(name, target, hint))
            bids[target] = max(bids.get(target, weight), weight)
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
        if parts and _bids(hint).get(MEASURED, 0) > 0:
            groups.setdefault((parts[1].lower(), parts[3].lower()), {})[parts[2].lower()] = name
    whole = [group for group in groups.values() if set(group) == {"x", "y", "z"}]
    return {name: axis for axis, name in whole[0].items()} if whole else {}
