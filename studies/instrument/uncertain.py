"""Numbers of a card with their uncertainty.

    mount_conductance_W_per_K = 0.0118                                      # as uncertain as the key's documentation says
    mount_conductance_W_per_K = { value = 0.0118, relative_sd = 0.3 }       # standard deviation as a part of the value
    mount_conductance_W_per_K = { value = 0.0118, sd = 0.003 }              # in the unit of the key; 0: exact
    mount_conductance_W_per_K = { value = 0.0118, low = 0.008, high = 0.02 }

`low` and `high` are always hard bounds, within those of the key. With them and neither `sd` nor `relative_sd`, every value
between them counts alike, and the standard deviation is that of an even distribution, (high − low)/√12. A number that
cannot be negative and is not 0 is `logarithmic`: its logarithm is normal, with the standard deviation sd/value; beyond ten times
the value, where that would say nothing of any decade, the number itself is normal and cut off at 0.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
from msgspec import inspect

from studies.errors import InputError
from studies.files.given import is_sound
from studies.instrument.units import unit_of
from studies.schema.keys import Keys, Path, bounds, describe, number, priors
from studies.schema.reader import read_keys

if TYPE_CHECKING:
    import numpy as np

LONGEST_DRAW = 10_000
WIDEST = 10.0  # sd over value, of a number whose logarithm is normal


class Spread(Keys, frozen=True, kw_only=True):
    """A number with its uncertainty, as a card writes it."""

    value: float
    sd: Annotated[float, number(least=0.0)] | None = None
    relative_sd: Annotated[float, number(least=0.0)] | None = None
    low: float | None = None
    high: float | None = None

    def __post_init__(self) -> None:
        low, high = self.low, self.high
        if self.sd is not None and self.relative_sd is not None:
            raise ValueError("give sd or relative_sd, not both.")
        if self.sd is None and self.relative_sd is None and (low is None or high is None):
            raise ValueError("its uncertainty is missing; give sd, relative_sd, or low and high.")
        if low is not None and high is not None and not low < high:
            raise ValueError(f"low must be below high, not {low:g} and {high:g}.")
        if (low is not None and self.value < low) or (high is not None and self.value > high):
            raise ValueError(f"value = {self.value:g} lies outside low and high; correct one of them.")

    @property
    def width(self) -> float:
        """Standard deviation in the unit of the key."""
        if self.sd is not None:
            return self.sd
        if self.relative_sd is not None:
            return self.relative_sd * abs(self.value)
        assert self.low is not None
        assert self.high is not None
        return (self.high - self.low) / math.sqrt(12.0)


SPREAD_KEYS = Spread.__struct_fields__


@dataclass(frozen=True)
class UncertainValue:
    """A number of a card that is not known exactly, in the card's own unit."""

    name: str  # the card's key, dotted: "thermal.mount_conductance_W_per_K", "effect.0.weight"
    # value, sd, low, high: Most probable value, standard deviation and hard bounds, in the unit of the key.
    value: float
    sd: float
    low: float = -math.inf
    high: float = math.inf
    # The logarithm is normal, with the standard deviation sd/value; else the number itself is.
    logarithmic: bool = False
    unit: str = "1"

    def draw(self, generator: "np.random.Generator") -> float:
        """Draw a value from the prior, between the bounds."""
        for _ in range(LONGEST_DRAW):
            step = float(generator.standard_normal())
            drawn = (
                self.value * math.exp(step * self.sd / self.value) if self.logarithmic else self.value + step * self.sd
            )
            if self.low <= drawn <= self.high:
                return drawn
        return self.value


def is_spread(raw: Any) -> bool:
    """Return whether a value of a card is a number with its uncertainty."""
    return isinstance(raw, Mapping) and "value" in raw and 1 < len(raw) and set(raw) <= set(SPREAD_KEYS)


@dataclass(frozen=True)
class Given:
    """A table as it was read, and the numbers whose uncertainty it states, by their places."""

    keys: Any  # the class of its keys, filled
    raw: Any
    kind: Any  # the class, or the union of classes that a tag tells apart
    name: str
    stated: Mapping[Path, UncertainValue]

    @property
    def uncertain(self) -> list[UncertainValue]:
        """Its numbers that are not exact: stated so, or by the documentation of their keys."""
        documented = []
        for path, node in priors(describe(self.kind), self.raw):
            value = reduce(
                lambda one, word: one[word] if isinstance(word, int) else getattr(one, word), path, self.keys
            )
            if path not in self.stated and value is not None:
                documented.append(_make(self.name, path, Spread(value=value, **(node.extra or {})), *bounds(node)))
        return [one for one in (*self.stated.values(), *documented) if one.sd > 0]


def read_uncertain(raw: Any, kind: Any, where: str, name: str) -> Given:
    """Read a table of a card into its class."""
    stated: dict[Path, UncertainValue] = {}

    def take(raw: Mapping[str, Any], path: Path, node: inspect.Type, place: str) -> Any:
        if not set(raw) & set(SPREAD_KEYS):
            return raw
        spread = _read_spread(raw, place)
        if spread.value == 0 and spread.relative_sd:
            raise InputError(f"{place}: a relative uncertainty of 0 is 0; give sd instead of relative_sd.")
        low, high = bounds(node)
        for word, end in (("low", spread.low), ("high", spread.high)):
            if end is not None and not low <= end <= high:
                raise InputError(f"{place}: {word} = {end:g} lies beyond {low if end < low else high:g} of the key.")
        stated[path] = _make(name, path, spread, low, high)
        return spread.value

    return Given(read_keys(raw, kind, where, take), raw, kind, name, stated)


def _read_spread(raw: Mapping[str, Any], place: str) -> Spread:
    """Read a number with its uncertainty, of which a calibration reads thousands: by msgspec itself, and where it finds a fault by what has words for it."""
    try:
        spread = msgspec.convert(raw, Spread)
    except msgspec.ValidationError:
        return read_keys(raw, Spread, place)
    return spread if all(map(is_sound, raw.values())) else read_keys(raw, Spread, place)


def _make(table: str, path: Path, spread: Spread, low: float, high: float) -> UncertainValue:
    name = ".".join(map(str, (table, *path)))
    ends = (low if spread.low is None else spread.low, high if spread.high is None else spread.high)
    logarithmic = low >= 0.0 and spread.value > 0.0 and spread.width <= WIDEST * spread.value
    return UncertainValue(name, spread.value, spread.width, *ends, logarithmic, unit_of(name))
