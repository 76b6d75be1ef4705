"""One design of a study: the instrument with its parameters set, and the modes that its quantities share."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from math import inf
from typing import TYPE_CHECKING, Any

from shell.constants import zero_Celsius
from studies.errors import InputError
from studies.instrument.card import Instrument

if TYPE_CHECKING:
    from shell.elastic import Elastic
    from shell.layout import Theory
    from shell.modes import Mode
    from shell.resonator import Resonator

TOLERANCE = 1e-5  # relative error of a frequency


@dataclass
class Case:
    """A design to be evaluated."""

    instrument: Instrument  # the card with this design's parameters
    parameters: Mapping[str, Any]  # every parameter of the study by name, in the unit of its name
    # the instrument of other parameters, and the design from which a search follows modes by their shapes: None where
    # they have their names by their order
    build: "Callable[[Mapping[str, Any]], Instrument] | None" = None
    start: Mapping[str, Any] | None = None
    # of a harmonic and theory the number of modes and the tolerance that suffice for all quantities
    wanted: "Mapping[tuple[int, str], tuple[int, float]]" = field(default_factory=dict)
    _solved: dict[tuple[int, str, float], tuple[float, "tuple[Mode, ...]"]] = field(default_factory=dict, repr=False)
    _named: "dict[tuple[int, int, str, float], Mode]" = field(default_factory=dict, repr=False)

    def temperature(self, given: float | None) -> float:
        """Return the temperature in K that a quantity gives (°C), else the study's, or the card's reference."""
        if given is None:
            given = self.parameters.get("temperature_degC")
        return self.instrument.reference_temperature if given is None else float(given) + zero_Celsius

    def modes(
        self, harmonic: int, count: int, theory: "Theory", temperature: float, tolerance: float = TOLERANCE
    ) -> "tuple[Mode, ...]":
        """Return at least the `count` lowest modes at a uniform temperature (K), solved once for all quantities."""
        from shell.modes import solve_modes

        key = (harmonic, theory, temperature)
        within, found = self._solved.get(key, (inf, ()))
        if len(found) < count or within > tolerance:
            most, finest = self.wanted.get((harmonic, theory), (count, tolerance))
            count, tolerance = max(count, most), min(tolerance, finest)
            resonator, elastic = self.instrument.at(temperature)
            found = solve_modes(resonator, elastic, harmonic, count, theory, tolerance)
            self._solved[key] = tolerance, found
        return found

    def mode(self, harmonic: int, index: int, theory: "Theory", temperature: float) -> "Mode":
        """Return one mode of a harmonic: by its order, or the one that the start's becomes on the way to this design."""
        key = harmonic, index, theory, temperature
        if key in self._named:
            return self._named[key]
        if self.start is None or theory == "rayleigh":  # whose closed form has one mode of a harmonic
            return self.modes(harmonic, index + 1, theory, temperature)[index]
        from shell.following import follow

        def solve(place: float, count: int) -> "tuple[Mode, ...]":
            if place == 1.0:
                return self.modes(harmonic, count, theory, temperature)
            return _solve_once(*self._on_the_way(place).at(temperature), harmonic, count, theory)

        self._named[key] = follow(solve, solve(0.0, index + 1)[index])
        return self._named[key]

    def _on_the_way(self, place: float) -> Instrument:
        """Return the instrument at a place 0 ... 1 between the start and this design."""
        assert self.build is not None
        assert self.start is not None
        start = self.start
        return self.build(
            {
                name: value if isinstance(value, str) else start[name] + place * (value - start[name])
                for name, value in self.parameters.items()
            }
        )

    def require_lowest(self, harmonic: int, theory: "Theory", temperature: float) -> "Mode | None":
        """Return the followed mode; refuse a design in which another has come below it: what is asked is of the lowest."""
        if self.start is None:
            return None
        found = self.mode(harmonic, 0, theory, temperature)
        if found.index:
            raise InputError(f"the mode n = {harmonic} of the start is no longer the lowest but number {found.index + 1}.")  # fmt: skip
        return found


@lru_cache(maxsize=32)
def _solve_once(
    resonator: "Resonator", elastic: "Elastic", harmonic: int, count: int, theory: "Theory"
) -> "tuple[Mode, ...]":
    """Modes of a design that many others are held against."""
    from shell.modes import solve_modes

    return solve_modes(resonator, elastic, harmonic, count, theory)
