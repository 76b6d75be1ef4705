"""Arguments that several commands share."""

from typing import Annotated

import numpy as np
from cyclopts import Parameter
from cyclopts.validators import Number
from numpy.typing import NDArray

from shell.constants import zero_Celsius
from studies.errors import InputError

Array = NDArray[np.float64]

Seed = Annotated[int, Parameter(validator=Number(gte=0))]
"""Of random draws: a whole number from 0 up."""
FromDegC = Annotated[float, Parameter(name="--from")]
ToDegC = Annotated[float, Parameter(name="--to")]
MOST_TEMPERATURES = 10_000


def lay_temperatures(from_degC: float, to_degC: float, step: float) -> Array:
    """Return the temperatures (K) of --from, --to and --step."""
    asked = f"--from {from_degC:g} --to {to_degC:g} --step {step:g}"
    if not step > 0 or not to_degC >= from_degC:
        raise InputError(f"{asked}: the step must be positive and --to not below --from.")
    if not (to_degC - from_degC) / step < MOST_TEMPERATURES:
        raise InputError(f"{asked}: more than {MOST_TEMPERATURES} temperatures; take a longer step.")
    return np.arange(from_degC, to_degC + 1e-9 * step, step) + zero_Celsius
