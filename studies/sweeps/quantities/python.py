"""A user's function "package.module:name" or "file.py:name", (instrument, parameters) -> number, only with --allow-python."""

from typing import Annotated

from studies.schema.keys import number, says
from studies.sweeps.case import Case
from studies.sweeps.quantity import Column, Number, Quantity


class Python(Quantity, frozen=True, kw_only=True, tag="python"):
    """A user's own function (instrument, parameters) -> number; needs --allow-python."""

    function: Annotated[
        str,
        says(
            '"package.module:name" or "file.py:name" beside the spec: (instrument, {name of parameter: value}) -> number',
            example="mine.py:area",
        ),
    ]
    unit: Annotated[str, says("of the value that it returns")] = "1"
    time_limit_s: Annotated[float, number("time limit of one design", above=0.0)] = 30.0

    def __post_init__(self) -> None:
        module, colon, name = self.function.rpartition(":")
        if not (colon and module and name.isidentifier()):
            raise ValueError(f'function = \'{self.function}\' must be "package.module:name" or "file.py:name".')

    def list_columns(self) -> tuple[Column, ...]:
        name = self.function.rpartition(":")[2]
        return (Column(name, self.unit, name.replace("_", " ")),)

    def evaluate(self, case: Case) -> tuple[Number, ...]:
        from studies.sweeps.child import ask

        return (Number(ask(self.function, self.time_limit_s, case)),)
