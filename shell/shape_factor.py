"""The shape factor Φ(ν) = f/√(E/ρ) of one mode of one resonator: the part of a frequency law that needs the solver."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.polynomial.chebyshev import chebfit, chebpts1

from shell.curves import Arc
from shell.elastic import Elastic
from shell.material import Material
from shell.modes import Mode
from shell.property import coefficient_names, powers
from shell.quadrature import Array
from shell.rayleigh import rayleigh_log_derivatives
from shell.resonator import Resonator

NODES = (6, 8, 12)  # Poisson's ratios tried, until the error is small enough
CLOSE = 1e-8  # wanted error of ln Φ between them
REACH = 5.0  # standard deviations of Poisson's ratio that are covered beside the law's own range
WIDEST = 0.04  # and not more than this


@dataclass(frozen=True, eq=False)
class ShapeFactor:
    """ln Φ(ν), Φ = f/√(E/ρ) at the reference geometry in 1/m, through full solves at a few Poisson's ratios."""

    resonator: Resonator  # of the solves
    lowest: float  # lowest, highest: the Poisson's ratios between which it holds
    highest: float
    logarithm: Chebyshev  # polynomial of ln Φ in ν
    modes: tuple[Mode, ...]  # the solves, at Chebyshev points
    ratios: Array  # (k,) array, their Poisson's ratios
    error: float  # relative, of Φ between them
    solver_error: float  # relative, the largest of the solves against the exact solution of their theory

    @cached_property
    def by_nu(self) -> Chebyshev:
        """∂ ln f/∂ν at constant E, over ν."""
        return self.logarithm.deriv()

    @cached_property
    def by_thickness(self) -> Chebyshev:
        """∂ ln f/∂ ln h over ν."""
        slopes = [_slopes(mode, self.resonator, float(nu))[1] for mode, nu in zip(self.modes, self.ratios, strict=True)]
        return _through(slopes, *(self.logarithm.domain if len(slopes) == 1 else (self.lowest, self.highest)))


def ratios_to_cover(material: Material, T: Array, nu: float) -> tuple[float, float]:
    """Return the Poisson's ratios between which Φ is needed for a material at temperatures (K), `nu` and its prior among them."""
    own = np.append(material.value("poisson_ratio", T), nu)
    reach = min(REACH * _ratio_spread(material, T), WIDEST)
    return max(float(own.min()) - reach, -0.99), min(float(own.max()) + reach, 0.499)


def _ratio_spread(material: Material, T: Array) -> float:
    """Return the largest standard deviation of ν by the material's prior."""
    open_ones = dict(zip(material.prior.names, material.prior.sd, strict=True))

    def spread(name: str) -> Array:
        x = powers(T - material.reference)
        terms = [open_ones.get(f"{name}.{c}", 0.0) * power for c, power in zip(coefficient_names(name), x, strict=True)]
        return np.asarray(np.linalg.norm(terms, axis=0))

    if "poisson_ratio" in material.properties:
        return float(spread("poisson_ratio").max())
    both = np.hypot(spread("youngs_modulus"), spread("shear_modulus"))
    return float(((1 + material.value("poisson_ratio", T)) * both).max())


def interpolate_shape(
    unseen: Mode, resonator: Resonator, elastic: Elastic, low: float, high: float, solve: Callable[[Elastic], Mode]
) -> ShapeFactor:
    """Interpolate ln Φ; its error is the larger of the last coefficient and what it misses of a mode that it does not use."""
    speed = 0.5 * np.log(elastic.E / elastic.rho)
    for count in NODES:
        ratios = (low + high) / 2 + (high - low) / 2 * chebpts1(count)
        modes = tuple(solve(replace(elastic, nu=float(nu))) for nu in ratios)
        polynomial = _through([np.log(mode.frequency) - speed for mode in modes], low, high)
        missed = abs(float(polynomial(elastic.nu)) + speed - np.log(unseen.frequency))
        error = max(missed, abs(float(polynomial.coef[-1])))
        if error <= CLOSE:
            break
    solver = max(mode.relative_error_estimate for mode in (unseen, *modes))
    return ShapeFactor(resonator, low, high, polynomial, modes, ratios, error, solver)


def shape_of(mode: Mode, resonator: Resonator, elastic: Elastic) -> ShapeFactor:
    """Φ about a single solve."""
    value = float(np.log(mode.frequency) - 0.5 * np.log(elastic.E / elastic.rho))
    line = Chebyshev([value, _slopes(mode, resonator, elastic.nu)[0]], domain=[elastic.nu - 1, elastic.nu + 1])
    return ShapeFactor(
        resonator, elastic.nu, elastic.nu, line, (mode,), np.array([elastic.nu]), 0.0, mode.relative_error_estimate
    )


def _through(values: Sequence[float], low: float, high: float) -> Chebyshev:
    """Return the polynomial through values at the Chebyshev points of a range."""
    points = chebpts1(len(values))
    return Chebyshev(chebfit(points, values, len(values) - 1), domain=[low, high])


def _slopes(mode: Mode, resonator: Resonator, nu: float) -> tuple[float, float]:
    """Return ∂ ln f/∂ν and ∂ ln f/∂ ln h of a solved mode."""
    dome = resonator.segments[0]
    if mode.theory == "rayleigh" and isinstance(dome, Arc):
        closed = rayleigh_log_derivatives(mode.harmonic, nu, dome.first_angle, dome.last_angle)
        return closed.nu, closed.h
    return mode.sensitivities.nu, mode.sensitivities.thickness
