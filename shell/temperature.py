"""The resonator's frequency over temperature and the parts of its slope (HRG paper eq. 15).

A free resonator of one material expands evenly: f(T) is f(E(T), nu(T), rho(T)) of the undeformed shape over the growth
of its lengths, whatever theory gives f. Its slope has five parts,

    d ln f/dT = ½ E'/E + (∂ ln f/∂nu) nu' − ½ rho'/rho + (∂ ln f/∂ ln h) h'/h + (∂ ln f/∂ ln r) r'/r ,

with ∂ ln f/∂ ln h + ∂ ln f/∂ ln r = −1 and h'/h = r'/r = alpha.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shell.elastic import Elastic
from shell.materials import Material

if TYPE_CHECKING:
    from shell.levels import Theory
    from shell.resonator import Resonator


@dataclass(frozen=True)
class FrequencyGradient:
    """A frequency (Hz) at the reference geometry and its derivatives ∂ ln f by nu and by ln h (1)."""

    frequency: float
    nu: float
    h: float


Model = Callable[[Elastic], FrequencyGradient]


@dataclass(frozen=True)
class TemperatureCoefficient:
    """The relative slope of the frequency at one temperature, its parts and its uncertainty, all in 1/K.

    Attributes
    ----------
    temperature : float, K
    frequency : float, Hz
    E, nu, rho, h, r : float, 1/K
        What each quantity's own change with temperature contributes.
    uncertainty : float, 1/K
        One standard deviation, from the uncertainties that the material law states.
    """

    temperature: float
    frequency: float
    E: float
    nu: float
    rho: float
    h: float
    r: float
    uncertainty: float

    @property
    def total(self) -> float:
        """The slope d ln f / dT, in 1/K."""
        return self.E + self.nu + self.rho + self.h + self.r


def mode_model(resonator: "Resonator", harmonic: int = 2, theory: "Theory" = "solid") -> Model:
    """Return f of the lowest mode of a harmonic, by the solver or by Rayleigh's closed form."""
    from shell.curves import Arc
    from shell.modes import solve_modes
    from shell.rayleigh import rayleigh_log_derivatives

    dome = resonator.segments[0]

    def model(elastic: Elastic) -> FrequencyGradient:
        mode = solve_modes(resonator, elastic, harmonic, theory=theory)[0]
        if theory == "rayleigh" and isinstance(dome, Arc):
            slopes = rayleigh_log_derivatives(harmonic, elastic.nu, dome.first_angle, dome.last_angle)
            return FrequencyGradient(mode.frequency, slopes.nu, slopes.h)
        return FrequencyGradient(mode.frequency, mode.sensitivities.nu, mode.sensitivities.thickness)

    return model


def over_poisson_ratio(model: Model, lowest: float, highest: float, nodes: int = 4) -> Model:
    """Return a model that solves at a few Poisson ratios only and interpolates between them.

    By dimensions f = √(E/ρ) Φ(nu): E and ρ need no solve, and Φ is smooth over the small change of nu with temperature.
    """
    from scipy.interpolate import BarycentricInterpolator

    x = np.cos((2 * np.arange(nodes) + 1) * np.pi / (2 * nodes))
    ratios = (lowest + highest) / 2 + (highest - lowest) / 2 * x
    solved = [model(Elastic(1.0, float(nu), 1.0)) for nu in ratios]
    table = BarycentricInterpolator(ratios, np.array([(np.log(s.frequency), s.nu, s.h) for s in solved]))

    def interpolated(elastic: Elastic) -> FrequencyGradient:
        log_shape, by_nu, by_h = table(elastic.nu)
        return FrequencyGradient(float(np.exp(log_shape) * np.sqrt(elastic.E / elastic.rho)), float(by_nu), float(by_h))

    return interpolated


def frequency_over_temperature(
    model: Model, material: Material, reference: float, temperatures: ArrayLike
) -> NDArray[np.float64]:
    """Return f(T) in Hz (HRG paper eq. 15) at uniform temperatures of the resonator.

    Parameters
    ----------
    model : callable
        Elastic -> FrequencyGradient at the reference geometry.
    material : Material
        Its laws give E, nu, rho and the growth of lengths.
    reference : float, K
        Temperature at which the geometry holds.
    temperatures : array_like, K

    Raises
    ------
    ShellError
        A temperature outside the material's range.
    """
    T = material.check(np.atleast_1d(temperatures))
    model = _spread(model, material, T)
    undeformed = np.array([model(material.elastic(float(x))).frequency for x in T])
    return np.asarray(undeformed / material.growth(T, reference))


def temperature_coefficients(
    model: Model, material: Material, reference: float, temperatures: ArrayLike
) -> list[TemperatureCoefficient]:
    """Return the slope of the frequency, its five parts and its uncertainty at each temperature (K)."""
    T = material.check(np.atleast_1d(temperatures))
    model = _spread(model, material, T)
    return [_coefficient(model, material, reference, float(x)) for x in T]


def _spread(model: Model, material: Material, T: NDArray[np.float64]) -> Model:
    """Interpolate over the Poisson ratios of many temperatures; a few, or one ratio, are solved as they are."""
    nu = material.value("poisson_ratio", T)
    if T.size < 4:
        return model
    if np.ptp(nu) == 0:
        solved = model(Elastic(1.0, float(nu[0]), 1.0))
        return lambda elastic: replace(solved, frequency=solved.frequency * float(np.sqrt(elastic.E / elastic.rho)))
    return over_poisson_ratio(model, float(nu.min()), float(nu.max()))


def _coefficient(model: Model, material: Material, reference: float, T: float) -> TemperatureCoefficient:
    gradient = model(material.elastic(T))
    frequency = gradient.frequency / float(material.growth(T, reference))
    parts = _parts(gradient, material, T)
    # How far the slope moves when one number of the law moves by its standard uncertainty. The gradient itself hardly
    # depends on the law, so it is kept: no further solve.
    moves = [
        sum(_parts(gradient, material.with_number(p, n, _number(material, p, n) + sign * u), T))
        for p, n, u in material.uncertain_numbers()
        if p in ("shear_modulus", "youngs_modulus", "poisson_ratio", "density", "expansion")
        for sign in (1, -1)
    ]
    steps = np.array(moves).reshape(-1, 2)
    uncertainty = float(np.sqrt((((steps[:, 0] - steps[:, 1]) / 2) ** 2).sum()))
    return TemperatureCoefficient(T, frequency, *parts, uncertainty=uncertainty)


def _parts(gradient: FrequencyGradient, material: Material, T: float) -> tuple[float, float, float, float, float]:
    """Return the parts from E, nu, rho, h and r, in 1/K."""
    alpha = float(material.value("expansion", T))
    return (
        0.5 * material.log_slope("youngs_modulus", T),
        gradient.nu * material.slope("poisson_ratio", T),
        -0.5 * material.log_slope("density", T),
        gradient.h * alpha,
        (-1 - gradient.h) * alpha,
    )


def _number(material: Material, name: str, number: str) -> float:
    return float(material.properties[name].numbers[number])
