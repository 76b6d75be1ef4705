"""The split of a pair in Hz, by the imperfection and the electrodes of the card, and the azimuth of its slower mode."""

import math
from typing import Annotated, Literal

from studies.schema.keys import says
from studies.sweeps.case import Case
from studies.sweeps.quantity import Column, ModeQuantity, Number


class Split(ModeQuantity, frozen=True, kw_only=True, tag="split"):
    """Frequency split of a pair and the azimuth of its slower mode."""

    theory: Annotated[Literal["solid", "shell"], says("solid (three-dimensional) or shell (Naghdi)")] = "solid"
    order: Annotated[Literal["first", "every"], says("first order in the imperfection, or every order with the harmonics coupled")] = "first"  # fmt: skip

    def list_columns(self) -> tuple[Column, ...]:
        return (
            Column(self.stem("split"), "Hz", f"split, {self.words}"),
            Column(self.stem("slow_axis"), "°", f"azimuth of the slower mode, {self.words}"),
        )

    def evaluate(self, case: Case) -> tuple[Number, ...]:
        from studies.resonator.splitting import SplitPair

        T = case.temperature(self.temperature_degC)
        whole = SplitPair(case.instrument, self.mode(case), T)
        split = whole.of_every_order() if self.order == "every" else whole.split
        return Number(split.hertz), Number(math.degrees(split.slow_axis))
