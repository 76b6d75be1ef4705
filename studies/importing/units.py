"""Units that laboratory files use, by the column of the record that they become; each conversion in words and as code."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import pi

from compensation.arrays import Array
from shell.constants import zero_Celsius
from studies.record import COLUMNS, DECAYS


@dataclass(frozen=True)
class Unit:
    """How a reading x becomes a value of the record: `settings` are further keys of the map, `never_zero` says that 0 is no value."""

    convert: "Callable[..., Array]"
    words: str
    settings: tuple[str, ...] = ()
    never_zero: bool = False


def _scaled(factors: Mapping[str, float], never_zero: bool = False) -> dict[str, Unit]:
    """Return units of which each is a factor times that of the record."""
    words = {name: "x" if factor == 1 else f"{factor:.10g} x" for name, factor in factors.items()}
    return {name: Unit(lambda x, by=by: by * x, words[name], never_zero=never_zero) for name, by in factors.items()}


def _over(numerator: float) -> Unit:
    return Unit(lambda x: numerator / x, f"{numerator:g} / x", never_zero=True)


_PER_H = {
    **{"deg/h": 1.0, "deg/s": 3600.0, "mdeg/h": 1e-3, "mdeg/s": 3.6, "arcsec/s": 1.0},
    **{"rad/s": 3600 * 180 / pi, "mrad/s": 3.6 * 180 / pi, "urad/s": 3.6e-3 * 180 / pi},
}
_PER_S = ("deg/s", "mdeg/s", "deg/h", "rad/s", "mrad/s", "urad/s")
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "days": 86400.0}

_BY_ENDING: Mapping[str, Mapping[str, Unit]] = {
    "_degC": {
        "degC": Unit(lambda x: x, "x"),
        "K": Unit(lambda x: x - zero_Celsius, "x - 273.15"),
        "mdegC": Unit(lambda x: 1e-3 * x, "x / 1000"),
        "mK": Unit(lambda x: 1e-3 * x - zero_Celsius, "x / 1000 - 273.15"),
        "degF": Unit(lambda x: (x - 32) / 1.8, "(x - 32) / 1.8"),
    },
    "_Hz": {
        **_scaled({"Hz": 1.0, "mHz": 1e-3, "kHz": 1e3, "MHz": 1e6, "rad/s": 1 / (2 * pi)}, never_zero=True),
        **{"period-s": _over(1.0), "period-ms": _over(1e3), "period-us": _over(1e6)},
        "period-counts": Unit(
            lambda x, clock, periods: periods * clock / x, "periods clock_Hz / x", ("clock_Hz", "periods"), True
        ),
        "gate-counts": Unit(lambda x, gate: x / gate, "x / gate_s", ("gate_s",), True),
        "ppm": Unit(lambda x, nominal: nominal * (1 + 1e-6 * x), "nominal_Hz (1 + x / 1e6)", ("nominal_Hz",)),
        "ppb": Unit(lambda x, nominal: nominal * (1 + 1e-9 * x), "nominal_Hz (1 + x / 1e9)", ("nominal_Hz",)),
    },
    "_deg_per_h": _scaled(_PER_H),
    "_deg_per_s": _scaled({**{name: _PER_H[name] / 3600 for name in _PER_S}, "rpm": 6.0}),
    "_V": _scaled({"V": 1.0, "mV": 1e-3, "uV": 1e-6, "kV": 1e3}),
    "_deg": _scaled({"deg": 1.0, "rad": 180 / pi, "turns": 360.0}),
    **{f"_{name}": _scaled({name: 1.0}) for name in ("counts", "dBm", "dB")},
    "_W": _scaled({"W": 1.0, "mW": 1e-3, "uW": 1e-6}),
    "time_s": _scaled(SECONDS),
    "inverse_q": {**_scaled({"1/Q": 1.0, "ppm": 1e-6, "ppb": 1e-9}), "Q": _over(1.0)},
}
UNITS = "; ".join(", ".join(units) for ending, units in _BY_ENDING.items() if ending != "time_s")


@lru_cache
def is_unit(text: str) -> bool:
    """Tell whether a text is a unit of a record's columns or of times."""
    return any(find_spelling(ending, text) for ending in _BY_ENDING)


def units_of(column: str) -> Mapping[str, Unit]:
    """Return the units from which a column of the record can be made; the first one is its own."""
    return next(units for ending, units in _BY_ENDING.items() if column.endswith(ending))


_CYRILLIC = str.maketrans("СКГВцкградмсчине", "CKHVzkgradmshine")  # the letters of °С, К, Гц, В, град/ч, мс, мин
_SPELLINGS = (
    (r"^(m|milli|u|µ|μ|micro|n|nano)?(s|se[ck]\w*|秒)$", r"\1s"),
    *(
        (r"^mins?$|^minut\w*$|^分$", "min"),
        (r"^(hours?|hrs?|std|stunden?|小时|時間)$", "h"),
        (r"^(d|days?|tage?)$", "days"),
    ),
    (r"nano", "n"),
    *((r"(?<=/)秒", "s"), (r"(?<=/)(小时|时)", "h")),
    (r"degrees?|gradi?|度|°|º", "deg"),
    (r"℃|(deg)?celsius|(?-i:^C$)", "degC"),
    (r"℉|(deg)?fahrenheit|(?-i:^F$)", "degF"),
    (r"kelvin", "K"),
    (r"µ|μ|micro", "u"),
    (r"milli", "m"),
    (r"kilo", "k"),
    (r"hertz", "Hz"),
    (r"volts?", "V"),
    (r"radians?", "rad"),
    (r"dp(?=[sh]$)", "deg/"),
    (r"per(?!iod)", "/"),
    (r"(?<=/)sec(onds?)?$", "s"),
    (r"(?<=/)(hours?|hr)$", "h"),
    (r"^(turn|rev|revolutions?)$", "turns"),
)
_NOMINAL = re.compile(r"(pp[mb])\s+of\s+(.*?)\s*(k?)(?:hz)?", re.IGNORECASE)


def find_spelling(column: str, text: str) -> str | None:
    """Return the unit that a text such as "°/s", "mdps" or "deg_per_h" spells, in any case but for m and M, or None."""
    units = units_of(column)
    if text in units:
        return text
    plain = re.sub(r"[\s_]", "", text).translate(_CYRILLIC)
    plain = plain.lower() if column == "time_s" else plain
    for pattern, word in _SPELLINGS:
        plain = re.sub(pattern, word, plain, flags=re.IGNORECASE)
    return next((u for u in units if u.casefold() == plain.casefold() and (u[0] == plain[0] or u[0] not in "mM")), None)


def split_nominal(text: str) -> tuple[str, float | None]:
    """Return the unit and the nominal frequency (Hz) of "ppm of 4432.07 Hz" or "of 8 kHz"; other texts as they are, without one."""
    found = _NOMINAL.fullmatch(text.strip())
    if not found:
        return text, None
    try:
        return found[1].lower(), float(found[2]) * (1e3 if found[3] else 1.0)
    except ValueError:  # "ppm of f0": nominal_Hz must say it
        return found[1].lower(), None


TARGETS = (*(name for name in COLUMNS if name != "time_s"), *DECAYS)
