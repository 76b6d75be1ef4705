"""How far the nearest other mode is from a mode, in Hz: parasitic modes close by couple under vibration."""

from typing import Annotated

from shell.separation import nearest_mode
from studies.schema.keys import number
from studies.sweeps.case import Case
from studies.sweeps.quantity import Column, ModeQuantity, Number


class ModeSeparation(ModeQuantity, frozen=True, kw_only=True, tag="mode-separation"):
    """Signed distance of the nearest other mode, among harmonics 0 ... `highest`, and its harmonic."""

    highest: Annotated[int, number("highest harmonic that is searched", least=0, most=20)] = 4
    each: Annotated[int, number("modes of each harmonic that are solved at least", least=1, most=10)] = 2

    def list_columns(self) -> tuple[Column, ...]:
        """Return the columns of the distance and of the other mode's harmonic."""
        stem = self.stem("separation")
        return (
            Column(stem, "Hz", f"distance of the nearest other mode from {self.words}"),
            Column(f"{stem}_nearest_harmonic", "1", f"harmonic of the mode nearest to {self.words}"),
        )

    def evaluate(self, case: Case) -> tuple[Number, ...]:
        """Return distance and harmonic."""
        at = case.temperature(self.temperature_degC)
        own = case.modes(self.harmonic, 1, self.theory, at)[0]
        nearest = nearest_mode(
            lambda n, count: case.modes(n, count, self.theory, at), own, range(self.highest + 1), self.each
        )
        error = sum(mode.frequency * mode.relative_error_estimate for mode in (own, nearest))
        return (Number(nearest.frequency - own.frequency, error), Number(float(nearest.harmonic), 0.0))


QUANTITY = ModeSeparation
