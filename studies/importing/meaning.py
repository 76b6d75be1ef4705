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
BRACKETED = r"[\[(]\s*([^\])]{1,24}?)\s*[\])]"
AXIS = re.compile(r"^(.*?)([xyz])((?:[^a-z].*)?)$", re.IGNORECASE)


@dataclass(frozen=True)
class Meaning:
    """What a raw column becomes: a column of the record, the axis ("" where there is only one), and what it would be if that were free."""

    target: str
    axis: str = ""
    rather: str = ""


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
    return {name: found[name] for name in hints if name in found}


def find_unit(target: str, hint: str) -> str | None:
    """Return the unit that a name states, of those from which the column can be made."""
    units = units_of(target)
    if hint.strip().lower() == target.lower():
        return next(iter(units))
    stated = re.findall(BRACKETED, hint)
    words = re.split(r"[\s_]+", re.sub(BRACKETED, " ", hint).strip())
    texts = stated[-1:] or [" ".join(words[k:]) for k in range(len(words))]
    spelled = (find_spelling(target, split_nominal(text)[0]) for text in texts)
    described = (unit for pattern, unit in UNIT_WORDS if unit in units and re.search(pattern, hint.lower()))
    return next(filter(None, (*spelled, *described)), None)


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
        return find_unit(target, f"[{stated[-1]}]") is not None or find_unit(target, hint.lower()) == "period-counts"
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
