"""A card's frequency over temperature, continued beyond its range, for steady-state tables."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from studies.effects.states import FloatArray
from studies.law import law_of

if TYPE_CHECKING:
    from studies.instrument.card import Instrument

Law = Callable[[FloatArray], FloatArray]
"""A card's frequency over temperature, K; its scale does not matter."""


def relative_law(instrument: "Instrument", measured: FloatArray) -> Law:
    """Return the card's frequency over temperature (K), continued beyond its range for the trial states of a fit.

    Raises
    ------
    ShellError
        If a measured temperature, K, lies outside the law's range.
    """
    material = instrument.material
    material.check(measured)
    law = law_of(instrument)

    def frequency(temperature: FloatArray) -> FloatArray:
        return law.frequency(temperature, extrapolate=True)

    return frequency
