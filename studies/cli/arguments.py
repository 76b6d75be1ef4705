"""Arguments that several commands share."""

from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter
from cyclopts.validators import Number
from numpy.typing import NDArray

from shell.constants import zero_Celsius
from studies.errors import InputError

Array = NDArray[np.float64]

CARD = "Path of a card, or the name of one that ships (hrg cards)."
REFERENCE = "Temperature in °C; the card's reference temperature unless given."
Card = Annotated[str, Parameter(help=CARD)]
Temperature = Annotated[float | None, Parameter(help=REFERENCE, show_default=False)]
Theory = Annotated[Literal["solid", "shell"], Parameter(help="solid (three-dimensional) or shell (Naghdi).")]
Harmonic = Annotated[int, Parameter(help="Circumferential harmonic n.")]
Seed = Annotated[int, Parameter(help="Seed of the random numbers.", validator=Number(gte=0))]
FromDegC = Annotated[float, Parameter(name="--from", help="Lowest temperature in °C.")]
ToDegC = Annotated[float, Parameter(name="--to", help="Highest temperature in °C.")]
Step = Annotated[float, Parameter(help="Step in °C.")]
Confidence = Annotated[float, Parameter(help="Confidence level of the intervals.")]
SaveModel = Annotated[str | None, Parameter(help="Write the model (TOML) for hrg compensate.")]
EmitC = Annotated[str | None, Parameter(help="Write the model as C99 source for firmware.")]
Folder = Annotated[str, Parameter(help="Folder of the study (hrg study run --out).")]
MOST_TEMPERATURES = 10_000


def lay_temperatures(from_degC: float, to_degC: float, step: float) -> Array:
    """Return the temperatures (K) of --from, --to and --step."""
    asked = f"--from {from_degC:g} --to {to_degC:g} --step {step:g}"
    if not step > 0 or not to_degC >= from_degC:
        raise InputError(f"{asked}: the step must be positive and --to not below --from.")
    if not (to_degC - from_degC) / step < MOST_TEMPERATURES:
        raise InputError(f"{asked}: more than {MOST_TEMPERATURES} temperatures; take a longer step.")
    return np.arange(from_degC, to_degC + 1e-9 * step, step) + zero_Celsius
