"""Rayleigh's inextensional spherical shell in closed form: the readable reference beside the shell solver.

The mode u, v ∝ sin φ tanⁿ(φ/2), w ∝ −(n + cos φ) tanⁿ(φ/2) stretches nothing and only bends (HRG paper
eqs. (9), (10)), so its frequency is the ratio of two integrals (HRG paper eq. (13)). It ignores the free
edge's conditions: on a hemisphere the frequency is too high by about 11 % at h/R = 0.06, and the excess
falls only like √(h/R). `shell.derivation` derives every formula of this file.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import cos, pi, sin, tan

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shell.errors import ShellError


@dataclass(frozen=True)
class RayleighIntegrals:
    """The shape integrals I (bending), J (mass) and N (Coriolis) of HRG paper eqs. (12)–(14), all without unit."""

    I: float
    J: float
    N: float


@dataclass(frozen=True)
class RayleighLogDerivatives:
    """Derivatives of ln f: by ln E, ln rho, ln h and ln R (no unit), by nu itself and by phi_2 in 1/rad."""

    E: float
    nu: float
    rho: float
    h: float
    R: float
    phi_2: float


def rayleigh_frequency(
    n: int, E: ArrayLike, nu: ArrayLike, rho: ArrayLike, h: ArrayLike, R: ArrayLike, phi_1: float = 0.0,
    phi_2: float = pi / 2,
) -> NDArray[np.float64]:  # fmt: skip
    """Return the natural frequency of the inextensional mode of a spherical shell, lengths in m, angles in rad; all but n broadcast.

    HRG paper eq. (13): ω² = n²(n²−1)² E h² I / (3 (1+ν) ρ R⁴ J): it measures the shear modulus, E/(1+ν) = 2G. With an
    open pole (phi_1 > 0) a second mode, tan⁻ⁿ(φ/2), exists that this formula leaves out.
    """
    E, nu, rho, h, R = (np.asarray(value, dtype=float) for value in (E, nu, rho, h, R))
    for name, value in {"Young's modulus": E, "density": rho, "thickness": h, "radius": R}.items():
        if not np.all(np.isfinite(value) & (value > 0)):
            raise ShellError(f"{name} must be positive and finite everywhere.")
    if not np.all((nu > -1) & (nu < 0.5)):
        raise ShellError("Poisson's ratio must lie between -1 and 0.5 (exclusive) everywhere.")
    shape = rayleigh_integrals(n, phi_1, phi_2)
    omega = n * (n**2 - 1) * h / R**2 * np.sqrt(E * shape.I / (3 * (1 + nu) * rho * shape.J))
    return np.asarray(omega / (2 * pi))


def rayleigh_bryan_factor(n: int, phi_1: float = 0.0, phi_2: float = pi / 2) -> float:
    """Return the Bryan factor: the angle by which the wave lags behind the rotating shell, per angle of rotation.

    K = N / J = 2 ∫ sin³φ tan²ⁿ(φ/2) dφ / J (`shell.derivation.coriolis`); 0.27699 for n = 2 on the hemisphere.
    """
    shape = rayleigh_integrals(n, phi_1, phi_2)
    return shape.N / shape.J


def rayleigh_log_derivatives(n: int, nu: float, phi_1: float = 0.0, phi_2: float = pi / 2) -> RayleighLogDerivatives:
    """Return d ln f = ½ d ln E − ½ d ln ρ − dν/(2(1+ν)) + d ln h − 2 d ln R + ½ [i(φ₂)/I − j(φ₂)/J] dφ₂, i and j the integrands."""
    if not -1 < nu < 0.5:
        raise ShellError(f"Poisson's ratio must lie between -1 and 0.5 (exclusive), not {nu:g}.")
    shape = rayleigh_integrals(n, phi_1, phi_2)
    rim = (_bending(phi_2, n) / shape.I - _mass(phi_2, n) / shape.J) / 2
    return RayleighLogDerivatives(E=0.5, nu=-0.5 / (1 + nu), rho=-0.5, h=1.0, R=-2.0, phi_2=rim)


@lru_cache(maxsize=256)
def rayleigh_integrals(n: int, phi_1: float = 0.0, phi_2: float = pi / 2) -> RayleighIntegrals:
    """Return the shape integrals of the inextensional mode by adaptive quadrature, to about 13 digits.

    HRG paper eqs. (12)–(14): I = ∫ tan²ⁿ(φ/2) sin⁻³φ dφ, J = ∫ [(n + cos φ)² + 2 sin²φ] sin φ tan²ⁿ(φ/2) dφ,
    and N = 2 ∫ sin³φ tan²ⁿ(φ/2) dφ of the Coriolis energy.
    """
    from scipy.integrate import quad

    if int(n) != n or n < 2:
        raise ShellError(f"Rayleigh's mode needs a whole harmonic n of at least 2, not {n}; n = 0, 1 move rigidly.")
    if not 0 <= phi_1 < phi_2 < pi:
        raise ShellError(f"Polar angles must satisfy 0 <= phi_1 < phi_2 < pi, not phi_1 = {phi_1:g}, phi_2 = {phi_2:g} rad; a closed sphere has no inextensional mode.")  # fmt: skip
    values = []
    for integrand in (_bending, _mass, _coriolis):
        # full_output reports trouble in the result instead of as a warning; the error estimate is judged here.
        value, error, *_ = quad(integrand, phi_1, phi_2, args=(n,), epsabs=0, epsrel=1e-13, limit=200, full_output=1)
        if not value > 0:
            raise ShellError(f"The cap up to phi_2 = {phi_2:g} rad is too small for harmonic {n}: its mode vanishes.")
        if not error < 1e-9 * value:
            raise ShellError(f"A rim at phi_2 = {phi_2:.9g} rad closes the sphere: the mode's integrals diverge.")
        values.append(value)
    return RayleighIntegrals(*values)


def _bending(phi: float, n: int) -> float:
    return tan(phi / 2) ** (2 * n) / sin(phi) ** 3


def _mass(phi: float, n: int) -> float:
    return ((n + cos(phi)) ** 2 + 2 * sin(phi) ** 2) * sin(phi) * tan(phi / 2) ** (2 * n)


def _coriolis(phi: float, n: int) -> float:
    return 2 * sin(phi) ** 3 * tan(phi / 2) ** (2 * n)
