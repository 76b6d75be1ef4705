"""Split of a pair per micrometre of one wave around of the wall, a face or the rim."""

from typing import Annotated, Literal, TypeAlias, get_args

from studies.schema.keys import number, says
from studies.sweeps.case import Case
from studies.sweeps.quantity import Column, ModeQuantity, Number

AMPLITUDE = 1.0  # µm
Surface: TypeAlias = Literal["wall", "outer", "inner", "offset", "rim"]
SURFACES = get_args(Surface)


class SplitPerWave(ModeQuantity, frozen=True, kw_only=True, tag="split-per-wave"):
    """Split by a wave of 1 µm: order 2n splits by itself, order n by its square, others only together."""

    theory: Annotated[Literal["solid", "shell"], says("solid (three-dimensional) or shell (Naghdi)")] = "solid"
    of: Annotated[Surface, says("surface with the wave")] = "wall"
    order: Annotated[int, number("crests around; 2n splits by itself", least=1, most=40)] = 4

    def list_columns(self) -> tuple[Column, ...]:
        words = f"split per µm of wave {self.order} of the {self.of}, {self.words}"
        return (Column(f"{self.stem('split')}_{self.of}_{self.order}", "Hz/µm", words),)

    def evaluate(self, case: Case) -> tuple[Number, ...]:
        """Return the split of the design with this wave and no other imperfection."""
        from studies.resonator.splitting import SplitPair

        T = case.temperature(self.temperature_degC)
        wave = {"of": self.of, "order": self.order, "amplitude_um": AMPLITUDE}
        alone = case.instrument.with_table("imperfection", {"wave": [wave]})
        whole = SplitPair(alone, self.mode(case), T)
        split = whole.imperfection if self.order == 2 * self.harmonic else whole.of_every_order()
        return (Number(split.hertz / AMPLITUDE),)
