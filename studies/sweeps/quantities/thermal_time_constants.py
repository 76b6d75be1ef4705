"""The slowest time constants of the heat path from the chamber to the shell, and of shell and stem alone."""

from typing import Annotated

from studies.schema.keys import number
from studies.sweeps.case import Case
from studies.sweeps.quantity import Column, Number, Quantity, Temperature


class ThermalTimeConstants(Quantity, frozen=True, kw_only=True, tag="thermal-time-constants"):
    """Slowest time constants of the heat path, linearised at one temperature."""

    count: Annotated[int, number("how many of the whole heat path", least=1, most=10)] = 2
    temperature_degC: Temperature | None = None

    def list_columns(self) -> tuple[Column, ...]:
        numbers = range(1, self.count + 1)
        path = [Column(f"time_constant_{k}", "s", f"time constant {k} of the heat path") for k in numbers]
        return (*path, Column("time_constant_shell", "s", "slowest time constant of shell and stem alone"))

    def evaluate(self, case: Case) -> tuple[Number, ...]:
        from studies.simulation.heat_path import build_network, build_shell_and_stem
        from thermal.relaxation import find_relaxation

        T = case.temperature(self.temperature_degC)
        path = find_relaxation(build_network(case.instrument), T).time_constants[: self.count]
        alone = find_relaxation(build_shell_and_stem(case.instrument), T).time_constants[0]
        return tuple(Number(float(tau)) for tau in (*path, alone))
