"""Q of a mode from its loss budget, and the share that heat takes of its loss."""

from typing import Annotated

from studies.schema.keys import says
from studies.sweeps.case import Case
from studies.sweeps.quantities.loss import find_budget
from studies.sweeps.quantity import Column, ModeQuantity, Number


class QualityFactor(ModeQuantity, frozen=True, kw_only=True, tag="q"):
    """Q from the loss budget of the card: heat, bulk, surface, films, gas, activated losses and mount."""

    anchor: Annotated[bool, says("compute the anchor loss of a balanced mode, half a second per design")] = False

    def list_columns(self) -> tuple[Column, ...]:
        stem = self.stem("q")
        return (
            Column(stem, "1", f"Q, {self.words}"),
            Column(f"{stem}_thermoelastic_part", "1", f"thermoelastic share of 1/Q, {self.words}"),
        )

    def evaluate(self, case: Case) -> tuple[Number, ...]:
        budget = find_budget(case, self, self.anchor)
        total = float(budget.inverse_q[0])
        warm = sum(float(part.inverse_q[0]) for part in budget.parts if part.name == "thermoelastic")
        return Number(1 / total), Number(warm / total)
