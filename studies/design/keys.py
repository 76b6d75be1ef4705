"""Keys of a design task, `schema = "hrg.design/1"`: what is free, what is wanted, what must hold; columns as in a study's results."""

from typing import Annotated, Literal

from studies.schema.keys import Keys, number, says
from studies.sweeps.expressions import Derived
from studies.sweeps.keys import AnyQuantity, Requirement

SCHEMA = "hrg.design/1"


class Free(Keys, frozen=True, kw_only=True):
    """What the optimiser chooses, in the unit of its name."""

    name: Annotated[str, says("a number of the card", example="resonator.thickness_mm")]
    low: Annotated[float, number("lowest value", example=0.6)]
    high: Annotated[float, number("highest value", example=1.8)]
    start: Annotated[float, number("first design; the card's value unless given", example=0.9)] | None = None
    step: Annotated[float, number("the answer is a multiple of this", above=0.0, example=0.001)] | None = None

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise ValueError(f"'{self.name}': low must be below high, not {self.low:g} and {self.high:g}.")
        if self.start is not None and not self.low <= self.start <= self.high:
            raise ValueError(f"'{self.name}': start = {self.start:g} lies outside {self.low:g} to {self.high:g}.")
        if self.step is not None and self.step > self.high - self.low:
            raise ValueError(f"'{self.name}': no step of {self.step:g} fits between {self.low:g} and {self.high:g}.")


class Objective(Keys, frozen=True, kw_only=True):
    """What is to be as small, as large or as near to a target as can be; several give a front."""

    column: Annotated[str, says("of the results", example="inverse_q_n2_mount")]
    goal: Annotated[Literal["least", "greatest", "target"], says("target: as near to it as can be")] = "least"
    target: Annotated[float, number("of goal = 'target'", example=0.0)] | None = None
    weight: Annotated[float, number("of several, in the compromise that becomes the best design", above=0.0)] = 1.0

    def __post_init__(self) -> None:
        if (self.goal == "target") != (self.target is not None):
            raise ValueError(f"'{self.column}': target = ... and goal = 'target' belong together.")


class Tolerance(Keys, frozen=True, kw_only=True):
    """How far a number of the card, free or not, may be off in manufacture."""

    name: Annotated[str, says("a number of the card", example="resonator.thickness_mm")]
    tolerance: Annotated[float, number("± this", above=0.0, example=0.002)] | None = None
    standard_deviation: Annotated[float, number("instead", above=0.0, example=0.001)] | None = None

    def __post_init__(self) -> None:
        if (self.tolerance is None) == (self.standard_deviation is None):
            raise ValueError(f"'{self.name}': give tolerance, or standard_deviation.")

    @property
    def sd(self) -> float:
        """Standard deviation; of ± tolerance that of an even distribution."""
        return self.standard_deviation or (self.tolerance or 0.0) / 3**0.5

    @property
    def most(self) -> float:
        """How far off at most: three standard deviations where only one is given."""
        return self.tolerance or 3 * (self.standard_deviation or 0.0)


class Margin(Keys, frozen=True, kw_only=True):
    """What the constraints keep in hand for the tolerances."""

    kind: Annotated[
        Literal["worst-case", "probability"],
        says("every constraint holds at the worst corner, or with a probability of its own; both to first order"),
    ]
    share: Annotated[float, number("of kind = 'probability'", least=0.5, below=1.0)] = 0.95


class SearchKeys(Keys, frozen=True, kw_only=True):
    """How long and from where the search goes."""

    seed: Annotated[int, number("of the designs drawn first", least=0, most=2**63 - 1)] = 0
    starts: Annotated[int, number("regions in which it searches locally", least=1, most=100)] = 3
    evaluations: Annotated[int, number("full solves, at most, about", least=10, most=10**6)] = 600
    front: Annotated[int, number("designs on the front between those best in one objective", least=1, most=200)] = 5


class DesignKeys(Keys, frozen=True, kw_only=True):
    """A whole task."""

    schema: Annotated[Literal["hrg.design/1"], says("kind of file")] = "hrg.design/1"
    name: Annotated[str, says("the file's unless given", example="8 kHz dome")] = ""
    note: Annotated[str, says("free text")] = ""
    card: Annotated[str, says("a shipped card, or the path of one beside this file", example="hrg-30mm")]
    fixed: (
        Annotated[dict[str, float | str], says("other values of the card", example={"loss.unbalance_mg": 2.0})] | None
    ) = None
    search: Annotated[SearchKeys, says("effort and start of the search")] = SearchKeys()
    margin: Annotated[Margin, says("margin of the constraints for tolerances")] | None = None
    parameter: Annotated[tuple[Free, ...], says("free parameters; one or more")] = ()
    derived: Annotated[tuple[Derived, ...], says("lengths tied to free parameters by formulas")] = ()
    quantity: Annotated[tuple[AnyQuantity, ...], says("quantities with keys other than the defaults")] = ()
    objective: Annotated[tuple[Objective, ...], says("objectives; one or more")] = ()
    constraint: Annotated[tuple[Requirement, ...], says("what must hold")] = ()
    tolerance: Annotated[tuple[Tolerance, ...], says("tolerances")] = ()
