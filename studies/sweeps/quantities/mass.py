"""The mass of the resonator, shell with root and stem, and the height of its centre."""

from studies.sweeps.case import Case
from studies.sweeps.quantity import Column, Number, Quantity


class Mass(Quantity, frozen=True, kw_only=True, tag="mass"):
    """Mass of the resonator, its stem included, and the height of its centre of mass."""

    def list_columns(self) -> tuple[Column, ...]:
        return Column("mass", "g", "mass"), Column("center", "mm", "height of the centre of mass")

    def evaluate(self, case: Case) -> tuple[Number, ...]:
        from shell.inertia import weigh

        resonator, elastic = case.instrument.at(case.instrument.reference_temperature)
        found = weigh(resonator, elastic.rho)
        return Number(1e3 * found.mass), Number(1e3 * found.center)
