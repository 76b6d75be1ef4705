"""What a laboratory's column means: columns of the record bid for it, by the words of its name and a unit that fits or forbids."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from studies.importing.heading import Stated, read_heading
from studies.importing.units import TARGETS
from studies.importing.words import plain

BIDS: tuple[tuple[str, str, int], ...] = (
    # (pattern in the lower-case name, column of the record, weight)
    (r"chamber|oven|\bbath\b|\bbox|set ?point|\bt set\b|ambient|\bair\b", "chamber_temperature_degC", 6),
    (r"housing|\bcase\b|\bbody|\bdut\b|\bdevice", "housing_temperature_degC", 6),
    (r"^(?=.*temp|t\b).*(reson|\b(gyro|hrg|sample|sensor)\b)", "housing_temperature_degC", 5),
    (r"temp|pt ?100\b|pt ?1000\b|thermo|ntc\b|\brtd|\bt ?(h|housing|\d)?$|^t\b", "housing_temperature_degC", 3),
    (r"temp|pt ?100\b|pt ?1000\b|thermo|ntc\b", "chamber_temperature_degC", 1),
    (r"(\bref\w*|external|counter|gps) *(freq|f\b)|(freq\w*|\bf) *(ref|external|counter|gps)", "reference_frequency_Hz", 6),
    (r"counter|period|gate", "reference_frequency_Hz", 1),
    (r"freq|\b\d?f ?(0|res|drive|n?2|half|div ?\d+)?\b", "frequency_Hz", 4),
    (r"period|gate", "frequency_Hz", 3),
    (r"freq", "reference_frequency_Hz", 2),
    (r"applied|\btable|command\w* *rate|stimulus|turntable", "rate_deg_per_s", 6),
    (r"bias|zero[ -]*rate|drift|\bzro", "bias_deg_per_h", 5),
    (r"rate|omega|ω|gyr|\b[gw][xyz]\b", "measured_rate_deg_per_s", 4),
    (r"1/q|\binv\w* *q|^q\b|\bq[ -]*fact|quality", "inverse_q", 5),
    (r"quad", "quadrature_V", 5),
    (r"\bdrive|\bampl", "drive_amplitude_V", 4),
    (r"electrode|polari[sz]|\btrim", "electrode_bias_V", 5),
    (r"pattern|azimuth|\btheta", "pattern_angle_deg", 5),
    (r"counts?\b|\badc\b|\braw\b", "output_counts", 2),
    (r"(?=.*pick ?-?off)(?=.*(\bx\b|cos|\b1\b|\ba\b))", "pickoff_cos_V", 6),
    (r"(?=.*pick ?-?off)(?=.*(\by\b|sin|\b2\b|\bb\b))", "pickoff_sin_V", 6),
)  # fmt: skip
KINDS = re.compile(r"(temp|thermo|^t\b)|freq")
"""Words that leave only columns of one kind; of two the last one says what a column is."""
QUALIFIERS: tuple[tuple[str, int, str], ...] = (
    # (pattern in the lower-case name, what it takes off the weight, columns that it says nothing against)
    (r"\b(sd|std|sigma|σ|var(iance)?|unc|adev|allan|psd|snr|noise)\b|stabil|uncert|st\w* ?(dev|abw)|streuung|unsicherheit|rausch|toleran|±", 99, ""),
    (r"\berr(ors?)?\b|fehler|residu", 99, "quad"),
    (r"deviation|\bdev\b|\bdelta|[δ∆]|\brise\b|\babove\b|\brel\w*\.? to\b|\bdiff|\bshift|detun|\bminus\b|\bf\w* ?- ?f\w{0,3}\b|\boffset|\bdrift|\bchange\b|änderung", 99, "bias"),
    (r"sampling|\bsample(?!.*temp)|abtast|acqui|\blogging|\bbaud|\b(data|update|refresh|scan|frame) rate|\bodr\b", 99, ""),
    (r"\bgain|coeff|\bgradient|\bslope|\btc[fb]?\b|\bramp|(heat|cool)ing|\bstatus|\bflags?\b|\bvalid|\balarm|\block\b(?![ -]?in)|\b(id|nr|no|index|serial|number)$", 99, ""),
    (r"pressure|druck|humid|feucht|\brh\b|\bdew|\bflow|\bfan\b|\bspeed|\bdoor|va[ck]uum|(\bcurrent|\bstrom)\b(?!.*(temp|freq))|leistung|\baccel", 99, ""),
    (r"laser|\broom|\blab\b|labor|logger|\b(c|m)pu\b|\b(mcu|fpga)\b|\bpump|supply|netzteil|heater|cooler|\b[ot]cxo|\bclock\b|modulat|dither|\bbeat\b|corner|cut ?off|bandwidth|inlet|outlet", 4, ""),
    (r"\bref(erence)?\b|cold junction", 2, "^ref"),
    (r"\bboard|\bpcb|\basic\b|electronic|elektronik|\b(min|max)(imum|imal)?\b|\bpeak|\brms\b|\bfit(ted)?\b|\bmodel|predict|simul|\bcalc|theor|compens|\bcorr|nominal|\btarget", 2, ""),
    (r"set ?p(oin)?t|\bcommand|\bset\b", 2, "^rate|drive|electrode"),
)  # fmt: skip
LIKELY = {"frequency_Hz": (300.0, 1e6), "_degC": (-120.0, 200.0), "_deg_per_h": (-1e3, 1e3), "inverse_q": (1e-10, 1e-2)}
"""What columns usually hold, by the end of their names."""
BY_UNIT = 1
"""Weight of a unit without a word that is known, of these columns where their values are usual."""
BY_UNITS = ("frequency_Hz", "housing_temperature_degC", "bias_deg_per_h")
UNLIKELY = 2
"""What values that a column hardly has take off its weight."""
CLOSE = 1
"""Weights that differ by no more leave a choice in doubt."""
MEASURED, APPLIED = "measured_rate_deg_per_s", "rate_deg_per_s"
TURNS = r"meas|mess|gyr|sens|out|ausg|omega"
"""Words of a rate that was measured; without them it may be the table's."""
FITTING_UNIT = 2
OWN_NAME = 100
"""Weight of a column's name in a record."""
AXIS = re.compile(r"^(.*?)([xyz])((?:[^a-z].*)?)$", re.IGNORECASE)


@dataclass(frozen=True)
class Meaning:
    """What a raw column becomes: a column of the record, the axis ("" where there is only one), and what must be checked."""

    target: str
    axis: str = ""
    doubt: str = ""


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
        likely = is_likely(target, read_heading(target, hints[name]), numbers[name])
        doubts = (
            own[best] > own[target] and f"by its name {best}, which another column fills",
            rate and f"or {APPLIED}, if it is the applied rate",
            close and f"or {', '.join(map(repr, close))}, which fits as well",
            own[target] < OWN_NAME and say_qualified(hints[name], target),
            likely is False and "its values are unusual for that",
            own[target] <= BY_UNIT and "its name hardly says so",
        )
        found[name] = Meaning(target, doubt="; ".join(str(doubt) for doubt in doubts if doubt))
    return {name: found[name] for name in hints if name in found}


def say_qualified(hint: str, target: str = "") -> str:
    """Return that a name has words by which it is another quantity than its noun; "" where it has none."""
    found = next((word for _, word in _qualify(plain(hint), target, hint)), "")
    return f"its name says '{found}'" if found else ""


def _qualify(name: str, target: str, hint: str) -> Iterator[tuple[int, str]]:
    """Yield what qualifiers take off the weight of a name for a column, with the word that says so."""
    stated = read_heading(target or "frequency_Hz", hint)
    deviation = stated.offset != 0.0 or (target.endswith("_Hz") and stated.unit in ("ppm", "ppb"))
    for pattern, cost, but in QUALIFIERS:
        found = re.search(pattern, name)
        if found and not (but and re.search(but, target)) and not (deviation and "deviation" in pattern):
            yield cost, found[0].strip()


def is_likely(target: str, stated: Stated, numbers: Sequence[float]) -> bool | None:
    """Tell whether numbers are usual in a column of the record; None where nobody can say."""
    low, high = next((ends for ending, ends in LIKELY.items() if target.endswith(ending)), (-np.inf, np.inf))
    if low == -np.inf or not numbers:
        return None
    middle = sorted(numbers)[len(numbers) // 2]
    if stated.unit is None and target.endswith("_degC"):  # kelvin, or raw counts
        return low <= stated.scale * middle < 500 or None
    value = stated.value(target, middle)
    return None if value is None else low <= value <= high


def read_reading(target: str, hint: str, numbers: Sequence[float]) -> Stated:
    """Return what a heading states, where the numbers decide whether a factor multiplies or divides; scale 0 where they do not."""
    stated = read_heading(target, hint)
    ways = [replace(stated, times=1.0, scale=stated.scale * by) for by in (stated.times, 1 / stated.times)]
    likely = [way for way in ways if is_likely(target, way, numbers)]
    return stated if stated.times == 1.0 else likely[0] if len(likely) == 1 else replace(ways[0], scale=0.0)


def looks_likely(hint: str, numbers: Sequence[float]) -> bool | None:
    """Tell whether numbers are usual in the column that a name stands for."""
    bids = _bids(hint)
    best = max(bids, key=lambda one: bids[one]) if bids else ""
    return is_likely(best, read_heading(best, hint), numbers) if bids else None


def _weigh(hint: str, numbers: Sequence[float], group: str) -> dict[str, int]:
    """Return how well a name, its unit and its numbers fit columns of the record."""
    known = _bids(hint, group.lower())
    likely = {target: is_likely(target, read_heading(target, hint), numbers) for target in known or BY_UNITS}
    if not known:  # words that nobody knows, above usual numbers in the unit of a quantity
        return {t: BY_UNIT for t in BY_UNITS if likely[t] and read_heading(t, hint).unit and not say_qualified(hint, t)}
    return {
        target: weight - (UNLIKELY if weight < OWN_NAME and likely[target] is False else 0)
        for target, weight in known.items()
    }


def _bids(hint: str, group: str = "") -> dict[str, int]:
    bare = re.sub(r"[\[(][^\])]*[\])]", " ", hint).lower().replace(".", " ").replace("_", " ").split()
    exact = next((column for column in TARGETS if bare == column.lower().split("_")), None)
    if exact is not None:
        return {exact: OWN_NAME}
    name, bids = plain(hint), dict[str, int]()
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
    stated = read_heading(target, hint)
    return False if stated.strange else True if stated.unit or stated.scale != 1.0 else None


def _find_axes(hints: Mapping[str, str]) -> dict[str, str]:
    """Return the axis of columns that come as x, y and z of one rate."""
    groups: dict[tuple[str, str], dict[str, str]] = {}
    for name, hint in hints.items():
        parts = AXIS.match(name)
        if parts and _bids(hint).get(MEASURED, 0) > 0:
            groups.setdefault((parts[1].lower(), parts[3].lower()), {})[parts[2].lower()] = name
    whole = [group for group in groups.values() if set(group) == {"x", "y", "z"}]
    return {name: axis for axis, name in whole[0].items()} if whole else {}
