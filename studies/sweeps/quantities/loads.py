"""What accelerations do to a design: shift of the frequency, largest stress, tilt of the rim."""

from typing import Annotated

from studies.schema.keys import number
from studies.sweeps.case import Case
from studies.sweeps.quantity import Column, Number, Quantity, Temperature


class LoadsOfDesign(Quantity, frozen=True, kw_only=True, tag="loads"):
    """Shift of the frequency by 1 g along the axis, tilt of the rim by 1 g across it, stress under a shock in the worse direction."""

    harmonic: Annotated[int, number("circumferential harmonic n", least=2, most=100)] = 2
    temperature_degC: Temperature | None = None
    shock_g: Annotated[float, number("acceleration for which the stress is given", above=0.0)] = 100.0

    def list_columns(self) -> tuple[Column, ...]:
        n = self.harmonic
        return (
            Column(f"acceleration_shift_n{n}", "ppb/g", f"shift by an acceleration along the axis, n = {n}"),
            Column("rim_tilt", "µrad/g", "tilt of the rim by an acceleration across the axis"),
            Column("shock_stress", "MPa", f"largest stress at {self.shock_g:g} g along or across the axis"),
        )

    def evaluate(self, case: Case) -> tuple[Number, ...]:
        from shell.loads import Kind, Loads
        from studies.resonator.loads import STANDARD_GRAVITY

        T = case.temperature(self.temperature_degC)
        loads = Loads(case.mode(self.harmonic, 0, "solid", T), case.instrument.at(T)[1])
        shock = self.shock_g * STANDARD_GRAVITY
        directions: tuple[dict[Kind, float], ...] = ({"axial": shock}, {"axial": -shock}, {"lateral": shock})
        stresses = [*(loads.peak(one).worst for one in directions), loads.beam(shock, 0.0), loads.beam(0.0, shock)]
        shift, tilt = loads.shift("axial"), abs(loads.sag({"lateral": 1.0}).tilt)
        found = 1e9 * STANDARD_GRAVITY * shift, 1e6 * STANDARD_GRAVITY * tilt, 1e-6 * max(stresses)
        return tuple(Number(one) for one in found)
