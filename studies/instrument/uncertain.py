"""Numbers of a card with their uncertainty.

    mount_conductance_W_per_K = 0.0118                                      # as uncertain as the key's documentation says
    mount_conductance_W_per_K = { value = 0.0118, relative_sd = 0.3 }       # standard deviation as a part of the value
    mount_conductance_W_per_K = { value = 0.0118, sd = 0.003 }              # in the unit of the key; 0: exact
    mount_conductance_W_per_K = { value = 0.0118, low = 0.008, high = 0.02 }

`low` and `high` are always hard bounds, within those of the key. With them and neither `sd` nor `relative_sd`, every value
between them counts alike, and the standard deviation is that of an even distribution, (high − low)/√12. A number that
cannot be negative and is not 0 is `logarithmic`: its logarithm is normal, with the standard deviation sd/value.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce
from typing import TYPE_CHECKING, Annotated, Any

from studies.errors import InputError
from studies.instrument.keys import Keys, Path, bounds, find, holds_number, number, priors
from studies.instrument.mending import read_keys, spell_place
from studies.instrument.units import unit_of

if TYPE_CHECKING:
    import numpy as np

LONGEST_DRAW = 10_000


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
    """A number of a card that is not known exactly, in the card's own unit.

    Attributes
    ----------
    name : str
        The card's key, dotted: "thermal.mount_conductance_W_per_K", "effect.0.weight".
    value, sd, low, high : float
        Most probable value, standard deviation and hard bounds, in the unit of the key.
    logarithmic : bool
        The logarithm is normal, with the standard deviation sd/value; else the number itself is.
    unit : str
    """

    name: str
    value: float
    sd: float
    low: float = -math.inf
    high: float = math.inf
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


def split_spreads(raw: Any, keys: Any, where: str) -> tuple[Any, dict[Path, Spread]]:
    """Return a table with plain numbers in the place of those with uncertainties, and these by their paths.

    `keys` is the class of the table: a mapping is a number with its uncertainty where the class has a number.
    """
    return _split(raw, keys, raw, where, ())


def _split(raw: Any, keys: Any, table: Any, where: str, path: Path) -> tuple[Any, dict[Path, Spread]]:
    if isinstance(raw, Mapping):
        if set(raw) & set(SPREAD_KEYS) and holds_number(find(keys, path, table)):
            place = spell_place(where, path)
            spread = read_keys(raw, Spread, place)
            if spread.value == 0 and spread.relative_sd:
                raise InputError(f"{place}: a part of 0 is 0; give sd instead of relative_sd.")
            return spread.value, {path: spread}
        pairs = {key: _split(value, keys, table, where, (*path, key)) for key, value in raw.items()}
        return {key: bare for key, (bare, _) in pairs.items()}, _joined(found for _, found in pairs.values())
    if isinstance(raw, list):
        parts = [_split(value, keys, table, where, (*path, place)) for place, value in enumerate(raw)]
        return [bare for bare, _ in parts], _joined(found for _, found in parts)
    return raw, {}


def gather_uncertain(
    name: str, bare: Any, part: Any, keys: Any, spreads: Mapping[Path, Spread], where: str
) -> list[UncertainValue]:
    """Return the uncertain numbers of a table: those that the card states, and those that its keys document.

    Parameters
    ----------
    name : of the table, with the place in an array of tables: "thermal", "effect.0".
    bare, part : its plain content, and the same read into its class.
    """
    found = {}
    for path, spread in spreads.items():
        low, high = bounds(find(keys, path, bare))
        _check_ends(spread, low, high, spell_place(where, path))
        if spread.width > 0:
            key = ".".join(str(word) for word in path)
            found[key] = _make(f"{name}.{key}", spread, low, high)
    for path, prior in priors(keys, bare):
        value = reduce(lambda one, word: one[word] if isinstance(word, int) else getattr(one, word), path, part)
        if path not in spreads and value is not None:
            spread, key = Spread(value=value, **prior), ".".join(str(word) for word in path)
            if spread.width > 0:
                found[key] = _make(f"{name}.{key}", spread, *bounds(find(keys, path, bare)))
    return list(found.values())


def _make(name: str, spread: Spread, low: float, high: float) -> UncertainValue:
    ends = (low if spread.low is None else spread.low, high if spread.high is None else spread.high)
    logarithmic = low >= 0.0 and spread.value > 0.0
    return UncertainValue(name, spread.value, spread.width, *ends, logarithmic, unit_of(name))


def _check_ends(spread: Spread, low: float, high: float, place: str) -> None:
    for name, end in (("low", spread.low), ("high", spread.high)):
        if end is not None and not low <= end <= high:
            raise InputError(
                f"{place}: {name} = {end:g} lies beyond {low if end < low else high:g}, which the key allows."
            )


def _joined(parts: Any) -> dict[Path, Spread]:
    return {path: spread for part in parts for path, spread in part.items()}
