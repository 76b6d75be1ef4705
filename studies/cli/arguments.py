"""Arguments that several commands share."""

from typing import Annotated

from cyclopts import Parameter
from cyclopts.validators import Number

Seed = Annotated[int, Parameter(validator=Number(gte=0))]
"""Of random draws: a whole number from 0 up."""
