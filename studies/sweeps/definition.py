"""What a study is: its parameters, quantities, sampling, requirements and searches, checked and ready to run."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from studies.instrument.card import Instrument
from studies.instrument.units import unit_of
from studies.sweeps.expressions import Derived
from studies.sweeps.quantity import Column, Quantity

FREE = (
    "name",
    "note",
    "requirement",
    "search",
)  # keys that may change after the first run: no sampled result needs them
MOST_CASES = 20_000_000


@dataclass(frozen=True)
class StudyParameter:
    """What is varied, in the unit of its name; `nominal` is text where `values` are.

    A normal parameter that is not `bounded` has no ends: `low` and `high` are then three standard deviations away.
    """

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


@dataclass(frozen=True)
class Asked:
    """A quantity with its options, and the columns that it fills."""

    quantity: Quantity
    options: Mapping[str, Any]
    columns: tuple[Column, ...]


@dataclass(frozen=True)
class Sampling:
    """How designs are drawn."""

    method: str
    cases: int
    seed: int
    batch: int | None
    solver: str


@dataclass(frozen=True)
class Requirement:
    """Limits of a column; a `within` alone is about the nominal design's value."""

    column: str
    low: float | None
    high: float | None
    target: float | None
    within: float | None


@dataclass(frozen=True)
class Search:
    """A worst case of a column over the box, an inversion to target values, or the tolerances that a share of designs keep."""

    kind: str
    column: str = ""
    vary: tuple[str, ...] = ()
    targets: Mapping[str, float] = field(default_factory=dict)
    share: float = 0.0


@dataclass(frozen=True)
class Study:
    """A checked spec. `content` is the spec as data, `text` as its author wrote it, `folder` where it lies."""

    name: str
    note: str
    instrument: Instrument
    sampling: Sampling
    parameters: tuple[StudyParameter, ...]
    derived: tuple[Derived, ...]
    asked: tuple[Asked, ...]
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
        return tuple(asked.options["function"] for asked in self.asked if asked.quantity.name == "python")
