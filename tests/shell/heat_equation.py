"""The heat equation in the wall of a shell, in all directions: the check of the heat flow through the wall alone."""

import mpmath
import numpy as np

from shell.assembly import sections
from shell.damping.heat import conduct_in_cells, mean_stress, solve_heat
from shell.kernel import shell_table
from shell.layout import Chain
from shell.quadrature import gauss, hierarchic, nodal
from shell.resonator import Resonator
from shell.solution import Solution
from shell.system import ShellGroup


def conduct(solution: Solution, resonator: Resonator, x: float, through: int = 24) -> float:
    """S(x) of the whole body with the heat flowing along the wall and around as well: the check of the fast form.

    Walls are laid out anew with polynomials of degree `through` across, whose points crowd towards the faces.
    """
    return sum(
        _conduct_in_shell(solution, resonator, k, x, through)
        if isinstance(group, ShellGroup)
        else conduct_in_cells(solution, k, x)
        for k, group in enumerate(solution.system.groups)
    )


def _conduct_in_shell(solution: Solution, resonator: Resonator, index: int, x: float, through: int) -> float:
    group, c = solution.system.groups[index], solution.constants[index]
    assert isinstance(group, ShellGroup)
    level, n, chain = solution.system.level, solution.system.n, group.chain
    xi, eta = gauss(level.along + 2), gauss(through + 2)
    section = sections(resonator, chain, *xi)
    table = shell_table(section, n, level.through, eta, nodal(level.along, xi[0]))
    stress = mean_stress(c, table.strains(solution.unknowns[index]))
    across, along = hierarchic(through, eta[0]), nodal(level.along, xi[0])
    zeta = section.thickness[..., None] / 2 * eta[0]
    A = 1 + section.curvature[..., None] * zeta
    rho = section.r[..., None] - section.tangent_z[..., None] * zeta
    drift = section.thickness_slope[..., None] / section.thickness[..., None] * eta[0]
    flat = np.einsum("sa,pb->spab", along.values, across.values).reshape(len(xi[0]), len(eta[0]), -1)
    by_xi = np.einsum("sa,pb->spab", along.slopes, across.values).reshape(flat.shape)
    by_eta = np.einsum("sa,pb->spab", along.values, across.slopes).reshape(flat.shape)
    g_s = (by_xi / section.ds[..., None, None] - drift[..., None] * by_eta) / A[..., None]
    g_z = 2 / section.thickness[..., None, None] * by_eta
    g_t = n * flat / rho[..., None]
    V = table.volume[..., None]
    stiffness = sum(np.einsum("espa,espb->eab", g * V, g) for g in (g_s, g_z, g_t))
    mass = np.einsum("espa,espb->eab", np.broadcast_to(flat, g_s.shape) * V, np.broadcast_to(flat, g_s.shape))
    load = np.einsum("esp,spa->ea", stress * table.volume, flat)
    numbers, size = _number_chain(chain, level.along, through + 1)
    return solve_heat(numbers, np.asarray(stiffness), mass, load, size, x, np.zeros(0, dtype=np.intp))


def _number_chain(chain: Chain, degree: int, width: int) -> tuple[np.ndarray, int]:
    nodes = degree * np.arange(len(chain.segments))[:, None] + np.arange(degree + 1)
    numbers = (nodes[:, :, None] * width + np.arange(width)).reshape(len(nodes), -1)
    return numbers, (degree * len(nodes) + 1) * width


def lifshitz_roukes(xi: float) -> float:
    """F(ξ) = 6/ξ² − (6/ξ³)(sinh ξ + sin ξ)/(cosh ξ + cos ξ) of a bent wall, in sixty digits."""
    with mpmath.workdps(60):
        x = mpmath.mpf(xi)
        return float(6 / x**2 - 6 / x**3 * (mpmath.sinh(x) + mpmath.sin(x)) / (mpmath.cosh(x) + mpmath.cos(x)))
