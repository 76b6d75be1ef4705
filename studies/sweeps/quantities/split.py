"""The split of a pair in Hz, by the imperfection and the electrodes of the card, and the azimuth of its slower mode."""

import math

from studies.sweeps.case import Case, Options
from studies.sweeps.quantity import HARMONIC, TEMPERATURE, Column, Number, Quantity, choice, mode_stem, mode_words

THEORY = choice(("solid", "shell"), "solid (three-dimensional) or shell (Naghdi)")
ORDER = choice(("first", "every"), "first order in the imperfection, or every order with the harmonics coupled")


def _columns(options: Options) -> tuple[Column, ...]:
    return (
        Column(mode_stem("split", options), "Hz", f"split, {mode_words(options)}"),
        Column(mode_stem("slow_axis", options), "°", f"azimuth of the slower mode, {mode_words(options)}"),
    )


def _evaluate(case: Case, options: Options) -> tuple[Number, ...]:
    from studies.splitting import SplitPair

    whole = SplitPair(case.instrument, case.mode(options), case.temperature(options))
    split = whole.of_every_order() if options["order"] == "every" else whole.split
    return Number(split.hertz), Number(math.degrees(split.slow_axis))


QUANTITY = Quantity(
    "split",
    "Frequency split of a pair and the azimuth of its slower mode.",
    {"harmonic": HARMONIC, "theory": THEORY, "order": ORDER, "temperature_degC": TEMPERATURE},
    _columns,
    _evaluate,
)
