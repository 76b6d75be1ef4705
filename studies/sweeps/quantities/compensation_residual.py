"""What a polynomial compensation leaves of the frequency over temperature (HRG paper eqs. 16-18, Table 2)."""

from typing import Annotated

import numpy as np

from shell.constants import zero_Celsius
from studies.schema.keys import number
from studies.sweeps.case import Case
from studies.sweeps.quantity import Column, HarmonicQuantity, Number


class CompensationResidual(HarmonicQuantity, frozen=True, kw_only=True, tag="compensation-residual"):
    """Rms residual and largest temperature error of a polynomial in T over a range."""

    from_degC: Annotated[float, number("lowest temperature")] = -20.0
    to_degC: Annotated[float, number("highest temperature")] = 40.0
    points: Annotated[int, number("settled temperatures, evenly spaced", least=3, most=101)] = 7
    order: Annotated[int, number("of the polynomial", least=1, most=9)] = 3

    def __post_init__(self) -> None:
        if not self.to_degC > self.from_degC or self.points <= self.order + 1:
            needs = f"compensation-residual needs from_degC < to_degC and more than {self.order + 1} points"
            raise ValueError(f"{needs}, not {self.from_degC:g} to {self.to_degC:g} °C with {self.points}.")

    def list_columns(self) -> tuple[Column, ...]:
        words = f"polynomial of order {self.order}, {self.words}"
        return (
            Column(self.stem("compensation_residual"), "Hz", f"rms residual of a {words}"),
            Column(self.stem("compensation_error"), "°C", f"largest temperature error of a {words}"),
        )

    def evaluate(self, case: Case) -> tuple[Number, ...]:
        from compensation.frequency import fit_frequency

        T = np.linspace(self.from_degC, self.to_degC, self.points)
        f = np.array([case.modes(self.harmonic, 1, self.theory, x + zero_Celsius)[0].frequency for x in T])
        fit = fit_frequency(T, f, self.order, float(np.mean(T)))
        residual, error = np.sqrt(np.mean(fit.regression.residuals**2)), np.abs(fit.temperature(f) - T).max()
        return Number(float(residual)), Number(float(error))
