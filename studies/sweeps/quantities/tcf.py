"""The temperature coefficient of frequency, d ln f/dT, and its parts from E, ν, ρ, h and r (HRG paper eq. 15)."""

from studies.resonator.law import check_slope_known, law_of
from studies.sweeps.case import Case
from studies.sweeps.quantity import Column, ModeQuantity, Number

PARTS = ("E", "nu", "rho", "h", "r")
STEEPEST = 10.0  # error of a solve's slopes of ln f, by ν or ln h, over its error of f; 2 to 3 were seen


class TemperatureCoefficient(ModeQuantity, frozen=True, kw_only=True, tag="tcf"):
    """Relative slope of the frequency over temperature and its five parts."""

    def list_columns(self) -> tuple[Column, ...]:
        stem, words = self.stem("tcf"), f"TCF, {self.words}"
        parts = [Column(f"{stem}_{part}", "ppm/°C", f"{words}, part of {part}") for part in PARTS]
        return (Column(stem, "ppm/°C", words), *parts)

    def evaluate(self, case: Case) -> tuple[Number, ...]:
        check_slope_known(case.instrument)
        T = case.temperature(self.temperature_degC)
        case.require_lowest(self.harmonic, self.theory, T)
        law = law_of(case.instrument, T, T, self.theory, self.harmonic)
        found, level = law.parts(T), STEEPEST * law.solver_error
        if self.theory == "rayleigh":  # closed: what it lacks is bending, as shell theory has it
            bent = law_of(case.instrument, T, T, "shell", self.harmonic).parts(T)
            both = [(getattr(found, part), getattr(bent, part)) for part in ("total", *PARTS)]
            return tuple(Number(1e6 * float(own), 1e6 * abs(float(own - other))) for own, other in both)
        of_nu = level * abs(float(law.material.slope("poisson_ratio", T)))
        of_h = level * abs(float(law.material.value("expansion", T)))
        # the parts of h and r add up to −alpha whatever the slope by h
        values = (found.total, *(getattr(found, part) for part in PARTS))
        errors = (of_nu, 0.0, of_nu, 0.0, of_h, of_h)
        return tuple(Number(1e6 * float(value), 1e6 * error) for value, error in zip(values, errors, strict=True))
