"""The frequency of a mode in Hz, with the solver's error estimate."""

from studies.sweeps.case import Case
from studies.sweeps.quantity import Column, Number, OvertoneQuantity


class Frequency(OvertoneQuantity, frozen=True, kw_only=True, tag="frequency"):
    """Frequency of a mode, without the stress from the [mount], which tcf includes."""

    def list_columns(self) -> tuple[Column, ...]:
        return (Column(self.stem("frequency"), "Hz", f"frequency, {self.words}"),)

    def evaluate(self, case: Case) -> tuple[Number, ...]:
        mode = self.mode(case)
        return (Number(mode.frequency, mode.frequency * mode.relative_error_estimate),)
