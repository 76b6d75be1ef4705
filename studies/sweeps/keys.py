"""Keys of a study's spec, `schema = "hrg.study/1"`: what is varied, how it is sampled, what is computed."""

from math import inf
from typing import TYPE_CHECKING, Annotated, Literal, Union

import msgspec

from studies.schema.keys import Keys, number, says
from studies.sweeps.expressions import Derived
from studies.sweeps.quantities import library
from studies.sweeps.quantity import Quantity

if TYPE_CHECKING:
    AnyQuantity = Quantity
else:
    AnyQuantity = Union[tuple(library().values())]  # noqa: UP007

SCHEMA = "hrg.study/1"
MOST_CASES = 20_000_000
MOST_CORNERS = 6  # parameters up to which every corner of a box is looked at
DRAWN = ("latin-hypercube", "sobol", "sensitivity")
POWERS = ("sobol", "sensitivity")


Cases = Annotated[
    int, number("of latin-hypercube, sobol and sensitivity; of the last two a power of two", least=1, most=MOST_CASES, example=1024)
]  # fmt: skip
Distribution = Annotated[
    Literal["uniform", "normal", "triangular", "log-uniform"], says("uniform unless given", example="normal")
]


class Sampling(Keys, frozen=True, kw_only=True):
    """How designs are drawn."""

    method: Annotated[
        Literal["grid", "list", "latin-hypercube", "sobol", "sensitivity", "one-at-a-time"],
        says("grid: all combinations; sensitivity: for Sobol indices; one-at-a-time: for slopes", example="sobol"),
    ]
    stated_cases: Cases | None = msgspec.field(name="cases", default=None)
    seed: Annotated[int, number("of what is drawn", least=0, most=2**63 - 1)] = 0
    batch: Annotated[int, number("cases computed and kept together; 8, or 16384 of a family", least=1, most=10**6, example=8)] | None = None  # fmt: skip
    solver: Annotated[Literal["auto", "full", "family"], says("family: interpolated between full solves, with its error; full: every design by the solver")] = "auto"  # fmt: skip

    def __post_init__(self) -> None:
        if self.method not in DRAWN and self.stated_cases is not None:
            raise ValueError(f"method = '{self.method}' takes the number of cases from the values; remove cases.")
        if self.method in DRAWN and self.stated_cases is None:
            raise ValueError("the key 'cases' is missing; add it.")
        if self.method in POWERS and self.cases & (self.cases - 1):
            power = 1 << self.cases.bit_length()
            raise ValueError(f"with method = '{self.method}' cases must be a power of two, such as {power // 2} or {power}, not {self.cases}.")  # fmt: skip

    @property
    def cases(self) -> int:
        """Number of cases that are drawn; 0 where the values say it."""
        return self.stated_cases or 0


class ParameterKeys(Keys, frozen=True, kw_only=True):
    """What is varied, in the unit of its name."""

    name: Annotated[str, says("a key of the card, temperature_degC, or user.NAME for your function", example="resonator.thickness_mm")]  # fmt: skip
    tolerance: Annotated[float, number("nominal ± tolerance", above=0.0, example=0.005)] | None = None
    low: Annotated[float, number("instead of tolerance", example=0.85)] | None = None
    high: Annotated[float, number("with low", example=0.95)] | None = None
    values: Annotated[tuple[float | str, ...], says("instead, of grid and list", least=1, example=[0.85, 0.9, 0.95])] | None = None  # fmt: skip
    nominal: Annotated[float | str, says("the card's value unless given", example=0.9)] | None = None
    stated_distribution: Distribution | None = msgspec.field(name="distribution", default=None)
    standard_deviation: Annotated[float, number("of a normal one", above=0.0, example=0.002)] | None = None
    count: Annotated[int, number("points of a grid from low to high", least=2, most=10**6, example=11)] | None = None

    def __post_init__(self) -> None:
        if self.values is not None:
            single = ("low", "high", "tolerance", "count", "stated_distribution", "standard_deviation")
            for key in single:
                if getattr(self, key) is not None:
                    raise ValueError(f"'{self.name}': give values or {key.removeprefix('stated_')}, not both.")
            if len({isinstance(value, str) for value in self.values}) > 1:
                raise ValueError(f"'{self.name}': values must be all numbers or all texts.")
            return
        if self.tolerance is not None and (self.low is not None or self.high is not None):
            raise ValueError(f"'{self.name}': give tolerance, or low and high, not both.")
        if self.distribution == "normal" and self.standard_deviation is None:
            raise ValueError(f"'{self.name}': the key 'standard_deviation' is missing; add it.")
        if self.distribution != "normal" and self.standard_deviation is not None:
            raise ValueError(f"'{self.name}': standard_deviation is only for distribution = 'normal'.")
        if isinstance(self.nominal, str):
            raise ValueError(f"'{self.name}': nominal = '{self.nominal}' is text; give values, or a number.")

    @property
    def distribution(self) -> str:
        """The distribution between the ends."""
        return self.stated_distribution or "uniform"


class Requirement(Keys, frozen=True, kw_only=True):
    """Limits of a column, asked of the yield; a `within` alone is about the nominal design's value."""

    column: Annotated[str, says("of the results", example="frequency_n2_Hz")]
    within: Annotated[float, number("of target", above=0.0, example=0.5)] | None = None
    target: Annotated[float, number("the nominal design's value unless given", example=4432.07)] | None = None
    low: Annotated[float, number("instead of within", example=4431.0)] | None = None
    high: Annotated[float, number("instead of within", example=4433.0)] | None = None

    def __post_init__(self) -> None:
        ends = self.low is not None or self.high is not None
        if self.within is None and not ends:
            raise ValueError("give within (and target), or low and/or high.")
        if (self.within is None and self.target is not None) or (self.within is not None and ends):
            raise ValueError("give either target and within, or low and/or high.")
        if self.low is not None and self.high is not None and not self.low < self.high:
            raise ValueError(f"low must be below high for '{self.column}', not {self.low:g} and {self.high:g}.")

    @property
    def is_relative(self) -> bool:
        """Whether the limits are about the nominal design's value, and share its error."""
        return self.within is not None and self.target is None

    def limits(self, nominal: float) -> tuple[float, float]:
        """Return the lowest and the highest value, infinite where an end is open; `nominal`: the nominal design's value."""
        if self.within is None:
            return -inf if self.low is None else self.low, inf if self.high is None else self.high
        target = nominal if self.target is None else self.target
        return target - self.within, target + self.within


class Search(Keys, frozen=True, kw_only=True, tag_field="kind"):
    """What is looked for after the sampled cases."""

    @property
    def kind(self) -> str:
        """What is looked for."""
        return str(self.__struct_config__.tag)


class WorstCase(Search, frozen=True, kw_only=True, tag="worst-case"):
    """The extremes of a column over the box of all parameters."""

    column: Annotated[str, says("of the results", example="frequency_n2_Hz")]


class ToleranceSearch(Search, frozen=True, kw_only=True, tag="tolerance"):
    """How much wider or narrower all tolerances are with which a share of designs meets the requirements."""

    share: Annotated[float, number("of the designs", above=0.0, below=1.0, example=0.95)]
    vary: Annotated[tuple[str, ...], says("these parameters alone; all unless given")] = ()


class StudyKeys(Keys, frozen=True, kw_only=True):
    """A whole spec."""

    schema: Annotated[Literal["hrg.study/1"], says("kind of file")] = "hrg.study/1"
    name: Annotated[str, says("the file's unless given", example="thickness and radius tolerance")] = ""
    note: Annotated[str, says("free text")] = ""
    card: Annotated[str, says("a shipped card, or the path of one beside this file", example="hrg-30mm")]
    sampling: Annotated[Sampling, says("how designs are drawn")]
    parameter: Annotated[tuple[ParameterKeys, ...], says("what is varied")] = ()
    derived: Annotated[tuple[Derived, ...], says("parameters derived by formulas")] = ()
    quantity: Annotated[tuple[AnyQuantity, ...], says("quantities to compute; one or more")] = ()
    requirement: Annotated[tuple[Requirement, ...], says("limits; they may change without a new computation")] = ()
    search: Annotated[tuple[WorstCase | ToleranceSearch, ...], says("searches after the sampled cases")] = ()
