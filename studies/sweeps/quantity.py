"""What a study can ask of a design: the form in which every file of `quantities/` describes its quantity."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import nan
from typing import Any, NamedTuple

from studies.errors import InputError
from studies.files.toml import TomlTable, check_number
from studies.sweeps.case import Case, Options

SUFFIXES = {"Hz": "_Hz", "ppm/°C": "_ppm_per_degC", "°C": "_degC", "s": "_s", "°": "_deg", "1": ""}


class Number(NamedTuple):
    """A computed value and the estimate of its own numerical error, in the column's unit; NaN where there is none."""

    value: float
    error: float = nan


@dataclass(frozen=True)
class Column:
    """One column of results: `stem` is its name without the unit's suffix, `label` what people read."""

    stem: str
    unit: str
    label: str

    @property
    def name(self) -> str:
        """The name in tables, with the unit that it carries."""
        return self.stem + SUFFIXES.get(self.unit, f"_{self.unit}")


@dataclass(frozen=True)
class Option:
    """One key of a `[[quantity]]` table: what it means and how it is read and checked."""

    meaning: str
    read: Callable[[TomlTable, str], Any]


@dataclass(frozen=True)
class Quantity:
    """A quantity that a study can compute for every design.

    Attributes
    ----------
    name : what a spec calls it.
    summary : one sentence.
    options : its keys in a spec.
    columns : options -> the columns that it fills.
    evaluate : (case, options) -> one Number for every column.
    """

    name: str
    summary: str
    options: Mapping[str, Option]
    columns: Callable[[Options], Sequence[Column]]
    evaluate: Callable[["Case", Options], Sequence[Number]]


def whole(default: int, meaning: str, least: int = 0, most: int = 100) -> Option:
    """Return an option that is a whole number."""

    def read(section: TomlTable, key: str) -> int:
        value = section.raw(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
            raise InputError(f"{section.where}: {key} must be a whole number from {least} to {most}, not {value!r}.")
        return value

    return Option(meaning, read)


def number(default: float | None, meaning: str, **bounds: float) -> Option:
    """Return an option that is a number; without a default it may be left out (None)."""

    def read(section: TomlTable, key: str) -> float | None:
        if default is None and key not in section:
            return None
        return check_number(section.raw(key, default), f"{section.where}: {key}", **bounds)

    return Option(meaning, read)


def choice(choices: Sequence[str], meaning: str) -> Option:
    """Return an option that is one of a few words, the first unless given."""
    return Option(meaning, lambda section, key: section.text(key, choices[0], choices))


HARMONIC = whole(2, "circumferential harmonic n")
INDEX = whole(0, "0 for the lowest mode of the harmonic", most=20)
THEORY = choice(("solid", "shell", "rayleigh"), "solid (three-dimensional), shell (Naghdi) or rayleigh (closed form)")
TEMPERATURE = number(None, "temperature in °C; the parameter temperature_degC, else the card's reference, unless given")


def mode_stem(what: str, options: Options) -> str:
    """Return such as frequency_n2, or frequency_n2_1 for a higher mode."""
    index = options.get("index", 0)
    return f"{what}_n{options['harmonic']}" + (f"_{index}" if index else "")


def mode_words(options: Options) -> str:
    """Return such as "n = 2", or "n = 2, mode 1" for a higher mode."""
    index = options.get("index", 0)
    return f"n = {options['harmonic']}" + (f", mode {index}" if index else "")
