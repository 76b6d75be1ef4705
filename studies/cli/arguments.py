"""Arguments that several commands share: what they are, and within which limits."""

from collections.abc import Callable, Sequence
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from shell.constants import zero_Celsius
from studies.errors import InputError, naming
from studies.files.given import refuse_unsound

if TYPE_CHECKING:
    from compensation.arrays import Array
    from shell.elastic import Elastic
    from shell.resonator import Resonator
    from studies.instrument.card import Instrument


def numbers(good: Callable[[Any], bool], words: str, **more: Any) -> Parameter:
    """Declare an argument whose number, or every one of them, must be as `words` say."""

    def check(_: Any, value: Any) -> None:
        for one in value if isinstance(value, tuple) else (value,):
            if one is not None and not good(one):
                raise InputError(f"{one:g}: must be {words}.")

    return Parameter(validator=(refuse_unsound, check), **more)


MANY = Parameter(consume_multiple=True)
COUNT = numbers(lambda one: one >= 1, "at least 1")
WHOLE = numbers(lambda one: one >= 0, "0 or above")
POSITIVE = numbers(lambda one: 0 < one < inf, "positive")
ORDER = numbers(lambda one: 1 <= one <= 9, "1 to 9")  # of a polynomial over temperature
FRACTION = numbers(lambda one: 0 < one < 1, "between 0 and 1")

CARD = "Path of a card, or the name of a built-in one (hrg cards)."
REFERENCE = "Temperature in °C; the card's reference temperature unless given."
PROFILE = (
    "A CSV file (time_s,chamber_temperature_degC, linear between its rows), or words in quotes with temperatures in °C, durations as"
    ' 5h, 30min or 90s, and rates in K/min: "soak T DURATION", "step FROM TO DURATION", "ramp FROM TO RATE", "staircase FROM TO STEP'
    ' HOLD", "cycle START FIRST SECOND RATE HOLD COUNT", joined by "then"; for example "step 20 -10 5h then ramp -10 40 1". The gyro'
    " starts settled at the first temperature."
)
Course = Annotated[str, Parameter(help=PROFILE)]
Card = Annotated[str, Parameter(help=CARD)]
Files = Annotated[str, Parameter(required=True)]  # one or more
Records = Annotated[Files, Parameter(help="The records (CSV).")]
Run = Annotated[str, Parameter(help="The record (CSV).")]
Out = Annotated[str, Parameter(help="File to write.")]
Temperature = Annotated[float | None, Parameter(help=REFERENCE, show_default=False)]
Theory = Annotated[Literal["solid", "shell"], Parameter(help="solid (three-dimensional) or shell (Naghdi).")]
ANY_THEORY = "solid (three-dimensional), shell (Naghdi) or rayleigh (closed form, hemisphere of constant thickness)."
AnyTheory = Annotated[Literal["solid", "shell", "rayleigh"], Parameter(help=ANY_THEORY)]
Harmonic = Annotated[int, Parameter(help="Circumferential harmonic n.")]
Seed = Annotated[int, WHOLE, Parameter(help="Seed of the random numbers.")]
FromDegC = Annotated[float, Parameter(name="--from", help="Lowest temperature in °C.")]
ToDegC = Annotated[float, Parameter(name="--to", help="Highest temperature in °C.")]
Step = Annotated[float, Parameter(help="Step in °C.")]
Confidence = Annotated[float, FRACTION, Parameter(help="Confidence level of the intervals.")]
Workers = Annotated[int | None, COUNT, Parameter(help="Processes on this machine; default: one per core.")]
Quiet = Annotated[bool, Parameter(help="Show no progress.")]
SaveModel = Annotated[str | None, Parameter(help="Write the model (TOML) for hrg compensate.")]
Folder = Annotated[str, Parameter(help="Folder of the study (hrg study run --out).")]
MOST_TEMPERATURES = 10_000


def open_card(card: str, temperature: float | None) -> "tuple[Instrument, float]":
    """Return the instrument of a card, and the temperature (K) of --temperature or the card's own."""
    from studies.instrument.card import load_card

    instrument = load_card(card)
    return instrument, instrument.reference_temperature if temperature is None else temperature + zero_Celsius


def open_given(card: str | None, save: str | None = None) -> "Instrument | None":
    """Return the instrument of --card where it is given; --save writes that card with what was found."""
    from studies.instrument.card import load_card

    if save is not None and card is None:
        raise InputError("--save writes a card with the values found; name the card to start from by --card.")
    return load_card(card) if card else None


def open_resonator(card: str, temperature: float | None) -> "tuple[Instrument, float, Resonator, Elastic]":
    """Return the same, and the resonator and the elastic constants at that temperature."""
    instrument, T = open_card(card, temperature)
    with naming(instrument.path):
        return instrument, T, *instrument.at(T)


def ending_of(out: str, kinds: Sequence[str], option: str = "--out") -> str:
    """Return the ending of --out or another option, which chooses the kind of file."""
    kind = Path(out).suffix.lower()
    if kind not in kinds:
        raise InputError(f"{option} {out}: the ending must be one of {', '.join(kinds)}.")
    if Path(out).is_dir():
        raise InputError(f"{option} {out}: is a folder; give the name of a file.")
    return kind


def lay_temperatures(from_degC: float, to_degC: float, step: float) -> "Array":
    """Return the temperatures (K) of --from, --to and --step, --to among them."""
    import numpy as np

    asked = f"--from {from_degC:g} --to {to_degC:g} --step {step:g}"
    if not step > 0 or not to_degC >= from_degC:
        raise InputError(f"{asked}: the step must be positive and --to not below --from.")
    if not (to_degC - from_degC) / step < MOST_TEMPERATURES:
        raise InputError(f"{asked}: more than {MOST_TEMPERATURES} temperatures; take a longer step.")
    laid = np.arange(from_degC, to_degC - 1e-9 * step, step)
    return np.append(laid, to_degC) + zero_Celsius
