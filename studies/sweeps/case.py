"""One design of a study: the instrument with its parameters set, and the modes that its quantities share."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from shell.constants import zero_Celsius
from studies.instrument.card import Instrument

if TYPE_CHECKING:
    from shell.levels import Theory
    from shell.modes import Mode


@dataclass
class Case:
    """A design to be evaluated.

    Attributes
    ----------
    instrument : the card with this design's parameters.
    parameters : every parameter of the study by name, in the unit of its name.
    """

    instrument: Instrument
    parameters: Mapping[str, Any]
    _solved: dict[tuple[int, str, float], "tuple[Mode, ...]"] = field(default_factory=dict, repr=False)

    def temperature(self, given: float | None) -> float:
        """Return the temperature in K that a quantity gives (°C), else the study's, or the card's reference."""
        if given is None:
            given = self.parameters.get("temperature_degC")
        return self.instrument.reference_temperature if given is None else float(given) + zero_Celsius

    def modes(self, harmonic: int, count: int, theory: "Theory", temperature: float) -> "tuple[Mode, ...]":
        """Return at least the `count` lowest modes at a uniform temperature (K), solved once for all quantities."""
        from shell.modes import solve_modes

        key = (harmonic, theory, temperature)
        if len(self._solved.get(key, ())) < count:
            resonator, elastic = self.instrument.at(temperature)
            self._solved[key] = solve_modes(resonator, elastic, harmonic, count, theory)
        return self._solved[key]
