"""The frequency law of an instrument: what a simulation, a diagnosis, a study and a page take f(T) from."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from shell.law import FrequencyLaw
    from shell.levels import Theory
    from studies.instrument.card import Instrument


def law_of(
    instrument: "Instrument", lowest: float, highest: float, theory: "Theory" = "solid", harmonic: int = 2
) -> "FrequencyLaw":
    """Build the frequency law of an instrument between two temperatures (K), within its material's range."""
    from shell.law import build_law

    T0 = instrument.reference_temperature
    return build_law(instrument.resonator, instrument.material, T0, lowest, highest, theory, harmonic)
