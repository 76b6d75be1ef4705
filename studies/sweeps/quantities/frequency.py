"""The frequency of a mode in Hz, with the solver's error estimate."""

from studies.sweeps.case import Case, Options
from studies.sweeps.quantity import (
    HARMONIC,
    INDEX,
    TEMPERATURE,
    THEORY,
    Column,
    Number,
    Quantity,
    mode_stem,
    mode_words,
)


def _columns(options: Options) -> tuple[Column, ...]:
    return (Column(mode_stem("frequency", options), "Hz", f"frequency, {mode_words(options)}"),)


def _evaluate(case: Case, options: Options) -> tuple[Number, ...]:
    mode = case.mode(options)
    return (Number(mode.frequency, mode.frequency * mode.relative_error_estimate),)


QUANTITY = Quantity(
    "frequency",
    "Frequency of a mode; without the stress of a [mount], which is in `tcf`.",
    {"harmonic": HARMONIC, "index": INDEX, "theory": THEORY, "temperature_degC": TEMPERATURE},
    _columns,
    _evaluate,
)
