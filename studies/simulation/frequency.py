"""The frequency over the resonator's temperature, even or not: where `shell` and `thermal` meet.

For an even temperature f(T) = g(ν) √(E/ρ) / growth, exactly, for every theory: only the factor g needs the solver, and
it is smooth in ν. For a field along the meridian, to first order in its unevenness,

    δ ln f = ∫ (½ e E'/E − ½ k ρ'/ρ + n ν' − e α) (T(s) − T_ref) ds,

e, k, n the mode's densities of elastic and kinetic energy and of ∂ ln f/∂ν (`shell.modes.Mode.along`). The expansion is
spread like the elastic energy; it is 0.5 of 80 ppm/°C in silica. T_ref is the mean weighed with the elastic energy,
the resonator's temperature: then nothing is divided by the whole slope, which vanishes in an Elinvar alloy.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.typing import NDArray

from shell.errors import ShellError

if TYPE_CHECKING:
    from shell.modes import Mode
    from shell.solution import AlongMeridian
    from studies.instrument.card import Instrument

Array = NDArray[np.float64]
Theory = Literal["solid", "shell"]
DEGREE = 14  # of f(T) between the ends of its range
HARMONIC = 2


@dataclass(frozen=True)
class FrequencyModel:
    """Frequency of the drive mode (n = 2) over temperature.

    Attributes
    ----------
    lowest, highest : float, K
    polynomial : ln f over temperature, between these
    bryan_factor : float
    position, elastic, sensitivity : arrays
        The mode's stations (0 … 1 of the meridian), their shares of the elastic energy, and what each contributes to
        d ln f/dT (1/K).
    solver_error, interpolation_error : float
        Relative, of the solver against its theory and of this model against the solver.
    """

    lowest: float
    highest: float
    polynomial: Chebyshev
    bryan_factor: float
    position: Array
    elastic: Array
    sensitivity: Array
    solver_error: float
    interpolation_error: float

    def frequency(self, temperature: Array) -> Array:
        """Frequency (Hz) at even temperatures (K)."""
        T = np.asarray(temperature, dtype=float)
        if T.size and not (T.min() >= self.lowest - 1e-6 and T.max() <= self.highest + 1e-6):
            raise ShellError(
                f"the resonator reaches {T.min() - 273.15:.2f} to {T.max() - 273.15:.2f} °C, but its frequency is "
                f"known from {self.lowest - 273.15:.2f} to {self.highest - 273.15:.2f} °C only."
            )
        return np.asarray(np.exp(self.polynomial(T)))


def build_frequency_model(
    instrument: "Instrument", lowest: float, highest: float, theory: Theory = "solid"
) -> FrequencyModel:
    """Solve the mode at a few Poisson ratios and build f(T) from `lowest` to `highest` (K)."""
    material, T0 = instrument.material, instrument.reference_temperature
    lowest, highest = max(lowest, material.lowest), min(highest, material.highest)
    material.check([lowest, highest])
    factor, error, mode, interpolation = _shape_factor(instrument, lowest, highest, theory)

    def logarithm(T: Array) -> Array:
        nu, E, rho = (material.value(name, T) for name in ("poisson_ratio", "youngs_modulus", "density"))
        return np.asarray(np.log(factor(nu) * np.sqrt(E / rho) / material.growth(T, T0)))

    polynomial = Chebyshev.interpolate(logarithm, DEGREE, domain=[lowest, highest])
    between = np.linspace(lowest, highest, 5 * DEGREE)
    interpolation += float(np.abs(polynomial(between) - logarithm(between)).max())
    return FrequencyModel(
        lowest=lowest,
        highest=highest,
        polynomial=polynomial,
        bryan_factor=mode.bryan_factor,
        position=mode.along.position,
        elastic=mode.along.elastic,
        sensitivity=_sensitivity(instrument, mode.along),
        solver_error=error,
        interpolation_error=interpolation,
    )


def _shape_factor(
    instrument: "Instrument", lowest: float, highest: float, theory: Theory
) -> tuple[Callable[[Array], Array], float, "Mode", float]:
    """Return g(ν), the solver's error, the mode at the reference temperature, and the error of g in between."""
    from shell.elastic import Elastic
    from shell.modes import solve_modes

    material, resonator = instrument.material, instrument.resonator
    reference = material.elastic(instrument.reference_temperature)
    speed = np.sqrt(reference.E / reference.rho)

    def solve(nu: float) -> "Mode":
        return solve_modes(resonator, Elastic(reference.E, nu, reference.rho), harmonic=HARMONIC, theory=theory)[0]

    mode = solve(reference.nu)
    nus = material.value("poisson_ratio", np.linspace(lowest, highest, 41))
    ends = np.array([min(nus.min(), reference.nu), max(nus.max(), reference.nu)])
    if np.ptp(ends) < 1e-9:
        return lambda nu: np.full(np.shape(nu), mode.frequency / speed), mode.relative_error_estimate, mode, 0.0
    found = [solve(float(nu)) for nu in (*ends, ends.mean())]
    parabola = Chebyshev.fit([*ends, ends.mean()], [m.frequency / speed for m in found], 2, domain=ends)
    error = max(m.relative_error_estimate for m in (mode, *found))
    unseen = abs(float(parabola(reference.nu)) * speed / mode.frequency - 1)
    return parabola, error, mode, unseen


def _sensitivity(instrument: "Instrument", along: "AlongMeridian") -> Array:
    """Return what every station of the mode contributes to d ln f/dT (1/K)."""
    material, T0 = instrument.material, instrument.reference_temperature
    alpha = float(material.value("expansion", T0))
    return np.asarray(
        along.elastic * (0.5 * material.log_slope("youngs_modulus", T0) - alpha)
        - 0.5 * along.kinetic * material.log_slope("density", T0)
        + along.nu * material.slope("poisson_ratio", T0)
    )
