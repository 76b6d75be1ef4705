"""What a study is: its parameters, quantities, sampling, requirements and searches, checked and ready to run."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from studies.instrument.card import Instrument
from studies.instrument.units import unit_of
from studies.sweeps.expressions import Derived
from studies.sweeps.keys import Requirement, Sampling, Search
from studies.sweeps.quantity import Column, Quantity

FREE = ("name", "note", "requirement", "search")
"""Keys that may change after the first run: no sampled result needs them."""


@dataclass(frozen=True)
class StudyParameter:
    """What is varied, in the unit of its name; `low` and `high` of a normal one without bounds are three standard deviations away."""

    name: str
    nominal: float | str
    low: float
    high: float
    distribution: str = "uniform"
    standard_deviation: float | None = None
    values: tuple[Any, ...] = ()
    count: int | None = None
    bounded: bool = True

    @property
    def unit(self) -> str:
        """The unit that the name carries, or "1"."""
        return unit_of(self.name)

    @property
    def normal(self) -> Any:
        """What a normal one is drawn from (scipy), cut off at its ends where it has any."""
        from scipy.stats import norm, truncnorm

        middle, stated = float(self.nominal), self.standard_deviation or 0.0
        if not self.bounded:
            return norm(middle, stated)
        return truncnorm((self.low - middle) / stated, (self.high - middle) / stated, middle, stated)

    @property
    def drawn_deviation(self) -> float:
        """Standard deviation of what is drawn of a normal one: less than the stated where its ends cut it off."""
        return float(self.normal.std())


@dataclass(frozen=True)
class Study:
    """A checked spec. `content` is the spec as data, `text` as its author wrote it, `folder` where it lies."""

    name: str
    note: str
    instrument: Instrument
    sampling: Sampling
    parameters: tuple[StudyParameter, ...]
    derived: tuple[Derived, ...]
    asked: tuple[Quantity, ...]
    requirements: tuple[Requirement, ...]
    searches: tuple[Search, ...]
    content: Mapping[str, Any] = field(repr=False)
    text: str = field(repr=False)
    folder: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the parameters."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def columns(self) -> tuple[Column, ...]:
        """The columns of results, in order."""
        return tuple(column for asked in self.asked for column in asked.columns)

    @property
    def functions(self) -> tuple[str, ...]:
        """User functions that the study asks for."""
        return tuple(asked.options["function"] for asked in self.asked if asked.name == "python")
