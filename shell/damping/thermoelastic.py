"""Thermoelastic loss of a mode: compression warms the wall, and heat flows through it.

The mode's mean stress tr σ warms the material against its surroundings by θ = -(α T/C) tr σ (C = ρ c). With the heat
flowing by k, in one period,

    1/Q = (α² T/C) S(ω C/k) / ∫ σ : ε dV,   S(x) = Σ_j a_j² x d_j/(x² + d_j²),

a_j being the parts of tr σ on the eigenfunctions of -∇² (insulated surfaces) and d_j their eigenvalues. With only the heat
flow through a wall of thickness h they are cosines, d_j = (jπ/h)², and for tr σ linear through the wall this is

    1/Q = P (E α² T/C) F(ξ),   P = ∫ (tr σ)² dV / (E ∫ σ : ε dV),
    F(ξ) = 6/ξ² - (6/ξ³)(sinh ξ + sin ξ)/(cosh ξ + cos ξ),   ξ = h √(ω C/(2 k))

(Lifshitz and Roukes, Phys. Rev. B 61 (2000) 5600). A beam has P = 1, a plate strip (1 + ν)/(1 - ν); in an inextensional mode
of a shell κ_φ + κ_θ = 0, and a bare dome warms only near its free edge.
"""

from functools import lru_cache

import numpy as np
import scipy

from shell.damping.heat import conduct_in_cells, mean_stress
from shell.quadrature import Array, legendre
from shell.solution import Solution, total
from shell.system import ShellGroup

MOST_PARTS = 40_000  # of the heat across a wall
NODES = 9  # thicknesses at which the heat flow through a wall of varying thickness is computed


def trace_share(solution: Solution) -> float:
    """P = ∫ (tr σ)² dV / (E ∫ σ : ε dV): 1 in a bent beam, (1 + ν)/(1 - ν) in a plate bent to a cylinder, 0 in pure shear."""
    squares = [
        mean_stress(c, e) ** 2 / c.E[..., None] * group.table.volume
        for group, c, e in zip(solution.system.groups, solution.constants, solution.strain, strict=True)
    ]
    return total(squares) / total(solution.elastic)


def heat_flow(solution: Solution, x: float) -> float:
    """S(x) of a mode, x = ω C/k in 1/m²: Pa² m³ per π, to be divided by ∫ σ : ε dV/π."""
    return sum(
        _through_wall(solution, k, x) if isinstance(group, ShellGroup) else conduct_in_cells(solution, k, x)
        for k, group in enumerate(solution.system.groups)
    )


def _through_wall(solution: Solution, index: int, x: float) -> float:
    """S(x) of a chain of shell elements, heat flowing along the normal only."""
    group, c = solution.system.chains[index], solution.constants[index]
    stress = mean_stress(c, solution.strain[index])
    eta, weights = np.polynomial.legendre.leggauss(stress.shape[2])
    degree = len(eta) - 1
    modes = legendre(degree, eta).values * weights[:, None] * (np.arange(degree + 1) + 0.5)
    moments = stress @ modes
    h = group.section.thickness
    volume = np.add.reduce(group.table.volume, axis=2)
    low, high = float(h.min()), float(h.max())
    if high - low < 1e-12 * high:
        return float(np.einsum("es,esl,lm,esm->", volume, moments, _wall(degree, high, x), moments))
    from scipy.interpolate import BarycentricInterpolator

    nodes = np.cos((2 * np.arange(NODES) + 1) * np.pi / (2 * NODES))
    logs = np.log(low * high) / 2 + np.log(high / low) / 2 * nodes
    table = BarycentricInterpolator(logs, np.array([_wall(degree, float(np.exp(one)), x) for one in logs]))
    matrices = table(np.log(h).ravel()).reshape(*h.shape, degree + 1, degree + 1)
    return float(np.einsum("es,esl,eslm,esm->", volume, moments, matrices, moments))


def _wall(degree: int, h: float, x: float) -> Array:
    """Σ_j c_j^l c_j^m x d_j/(x² + d_j²) of Legendre polynomials across a wall, (degree + 1)².

    c_j^l = (1/√2) ∫ P_l(η) cos(jπ (η + 1)/2) dη = √2 cos((j - l) π/2) j_l(jπ/2), which vanishes where j and l differ in parity.
    """
    count = int(min(max(60, 30 * h * np.sqrt(x / 2)), MOST_PARTS))
    parts = _parts(degree, 1 << (count - 1).bit_length())[:, :count]
    d = (np.arange(1, count + 1) * np.pi / h) ** 2
    return np.asarray((parts * (x * d / (x**2 + d**2))) @ parts.T)


@lru_cache(maxsize=16)
def _parts(degree: int, count: int) -> Array:
    """c_j^l of `_wall`, (degree + 1, count): the same for every wall."""
    j = np.arange(1, count + 1)
    return np.array(
        [
            np.sqrt(2) * np.cos((j - l) * np.pi / 2) * scipy.special.spherical_jn(l, j * np.pi / 2)
            for l in range(degree + 1)
        ]
    )
