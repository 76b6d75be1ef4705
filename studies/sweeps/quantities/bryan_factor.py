"""The Bryan (precession) factor of a mode: pattern rotation over rotation of the case."""

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
    return (Column(mode_stem("bryan_factor", options), "1", f"Bryan factor, {mode_words(options)}"),)


def _evaluate(case: Case, options: Options) -> tuple[Number, ...]:
    return (Number(case.mode(options).bryan_factor),)


QUANTITY = Quantity(
    "bryan-factor",
    "Precession of the standing wave per angle of rotation.",
    {"harmonic": HARMONIC, "index": INDEX, "theory": THEORY, "temperature_degC": TEMPERATURE},
    _columns,
    _evaluate,
)
