"""Units that laboratory files use, by the column of the record that they become; each conversion in words and as code."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
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


def _times(factor: float, words: str) -> Unit:
    return Unit(lambda x: x * factor, words)


def _over(numerator: float, words: str) -> Unit:
    return Unit(lambda x: numerator / x, words, never_zero=True)


_SAME = Unit(lambda x: x, "x")
_TEMPERATURE = {
    "degC": _SAME,
    "K": Unit(lambda x: x - zero_Celsius, "x - 273.15"),
    "mdegC": _times(1e-3, "x / 1000"),
    "mK": Unit(lambda x: 1e-3 * x - zero_Celsius, "x / 1000 - 273.15"),
    "degF": Unit(lambda x: (x - 32) / 1.8, "(x - 32) / 1.8"),
}
_FREQUENCY = {
    "Hz": Unit(lambda x: x, "x", never_zero=True),
    "mHz": Unit(lambda x: 1e-3 * x, "x / 1000", never_zero=True),
    "kHz": Unit(lambda x: 1e3 * x, "1000 x", never_zero=True),
    "MHz": Unit(lambda x: 1e6 * x, "1e6 x", never_zero=True),
    "rad/s": Unit(lambda x: x / (2 * pi), "x / 2 pi", never_zero=True),
    "period-s": _over(1.0, "1 / x"),
    "period-ms": _over(1e3, "1000 / x"),
    "period-us": _over(1e6, "1e6 / x"),
    "period-counts": Unit(
        lambda x, clock, periods: periods * clock / x, "periods clock_Hz / x", ("clock_Hz", "periods"), never_zero=True
    ),
    "gate-counts": Unit(lambda x, gate: x / gate, "x / gate_s", ("gate_s",), never_zero=True),
    "ppm": Unit(lambda x, nominal: nominal * (1 + 1e-6 * x), "nominal_Hz (1 + x / 1e6)", ("nominal_Hz",)),
    "ppb": Unit(lambda x, nominal: nominal * (1 + 1e-9 * x), "nominal_Hz (1 + x / 1e9)", ("nominal_Hz",)),
}
_RATE_PER_H = {
    "deg/h": _SAME,
    "deg/s": _times(3600.0, "3600 x"),
    "mdeg/h": _times(1e-3, "x / 1000"),
    "mdeg/s": _times(3.6, "3.6 x"),
    "rad/s": _times(3600 * 180 / pi, "3600 (180 / pi) x"),
    "mrad/s": _times(3.6 * 180 / pi, "3.6 (180 / pi) x"),
    "urad/s": _times(3.6e-3 * 180 / pi, "0.0036 (180 / pi) x"),
    "arcsec/s": _SAME,
}
_RATE_PER_S = {
    "deg/s": _SAME,
    "mdeg/s": _times(1e-3, "x / 1000"),
    "deg/h": _times(1 / 3600, "x / 3600"),
    "rad/s": _times(180 / pi, "(180 / pi) x"),
    "mrad/s": _times(0.18 / pi, "(0.18 / pi) x"),
    "urad/s": _times(0.18e-3 / pi, "(0.00018 / pi) x"),
    "rpm": _times(6.0, "6 x"),
}
_VOLTAGE = {"V": _SAME, "mV": _times(1e-3, "x / 1000"), "uV": _times(1e-6, "x / 1e6"), "kV": _times(1e3, "1000 x")}
_ANGLE = {"deg": _SAME, "rad": _times(180 / pi, "(180 / pi) x"), "turns": _times(360.0, "360 x")}

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "days": 86400.0}

_BY_ENDING: Mapping[str, Mapping[str, Unit]] = {
    "_degC": _TEMPERATURE,
    "_Hz": _FREQUENCY,
    "_deg_per_h": _RATE_PER_H,
    "_deg_per_s": _RATE_PER_S,
    "_V": _VOLTAGE,
    "_deg": _ANGLE,
    "_counts": {"counts": _SAME},
    "_dBm": {"dBm": _SAME},
    "_dB": {"dB": _SAME},
    "_W": {"W": _SAME, "mW": _times(1e-3, "x / 1000"), "uW": _times(1e-6, "x / 1e6")},
    "time_s": {name: _times(size, "") for name, size in SECONDS.items()},
    "inverse_q": {
        "1/Q": _SAME,
        "Q": _over(1.0, "1 / x"),
        "ppm": _times(1e-6, "x / 1e6"),
        "ppb": _times(1e-9, "x / 1e9"),
    },
}
UNITS = "; ".join(", ".join(units) for ending, units in _BY_ENDING.items() if ending != "time_s")


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
