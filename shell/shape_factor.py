"""The shape factor Φ(ν) = f/√(E/ρ) of one mode of one resonator: the part of a frequency law that needs the solver."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.polynomial.chebyshev import chebfit, chebpts1

from shell.curves import Arc
from shell.elastic import Elastic
from shell.modes import Mode
from shell.quadrature import Array
from shell.rayleigh import rayleigh_log_derivatives
from shell.resonator import Resonator

NODES = (6, 8, 12)  # Poisson's ratios tried, until the error is small enough
CLOSE = 1e-8  # wanted error of ln Φ between them


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
