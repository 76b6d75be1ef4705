"""The Bryan (precession) factor of a mode: pattern rotation over rotation of the case."""

from studies.sweeps.case import Case
from studies.sweeps.quantity import Column, Number, OvertoneQuantity


class BryanFactor(OvertoneQuantity, frozen=True, kw_only=True, tag="bryan-factor"):
    """Precession of the standing wave per angle of rotation."""

    def list_columns(self) -> tuple[Column, ...]:
        return (Column(self.stem("bryan_factor"), "1", f"Bryan factor, {self.words}"),)

    def evaluate(self, case: Case) -> tuple[Number, ...]:
        return (Number(self.mode(case).bryan_factor),)
