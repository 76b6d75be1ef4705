"""The heat equation on a mode, in all directions of the meridional section and around: i x θ - ∇²θ = i x t, insulated surfaces.

With t = tr σ and x = ω C/k, the part of θ in quadrature with t is what makes loss: S = ∫ t Im θ dV.
"""

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix
from scipy.sparse.linalg import splu

from shell.assembly import sections
from shell.blocks import number_functions
from shell.damping.heat import mean_stress
from shell.errors import ShellError
from shell.kernel import shell_table
from shell.layout import Chain
from shell.quadrature import Array, gauss, hierarchic, legendre, nodal
from shell.resonator import Resonator
from shell.solution import Solution
from shell.system import ShellGroup, SolidGroup


def conduct_in_cells(solution: Solution, index: int, x: float) -> float:
    """S(x) of one solid part, heat flowing in all directions within it; the functions are those of its displacements.

    A boundary layer thinner than the cells is left out: its share is of the order of its width over theirs.
    """
    group, c = solution.system.groups[index], solution.constants[index]
    if not isinstance(group, SolidGroup):
        raise ShellError("only a solid part has cells.")
    mesh, table, n = group.place.mesh, group.table, solution.system.n
    numbers, signs, size = number_functions(mesh, mesh.grid.shape[2] - 1)
    functions = numbers.shape[1]
    products = group.products.reshape(len(numbers), 10, functions, functions)
    stiffness = products[:, 0] + products[:, 4] + n**2 * products[:, 8]
    value = table.gradients[:, 2] * table.radius[..., None] * signs[:, None]
    stress = mean_stress(c, solution.strain[index])[:, 0]
    load = np.einsum("cp,cpf->cf", stress * table.volume[:, 0], value)
    return _solve(numbers, stiffness, products[:, 9], load, size, x, _on_axis(solution, group, size))


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
    level, n, chain = solution.system.level, solution.system.n, group.place.chain
    xi, eta = gauss(level.along + 2), gauss(through + 2)
    section = sections(resonator, chain, *xi)
    u, v, w = (legendre(order, eta[0]) for order in level.through)
    table = shell_table(section, n, (u, v, w), eta, nodal(level.along, xi[0]))
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
    return _solve(numbers, np.asarray(stiffness), mass, load, size, x, np.zeros(0, dtype=np.intp))


def _number_chain(chain: Chain, degree: int, width: int) -> tuple[np.ndarray, int]:
    nodes = degree * np.arange(len(chain.segments))[:, None] + np.arange(degree + 1)
    numbers = (nodes[:, :, None] * width + np.arange(width)).reshape(len(nodes), -1)
    return numbers, (degree * len(nodes) + 1) * width


def _on_axis(solution: Solution, group: SolidGroup, size: int) -> np.ndarray:
    """Functions that live on the axis, where a temperature that varies as cos nθ vanishes."""
    if solution.system.n == 0:
        return np.zeros(0, dtype=np.intp)
    mesh, axis = group.place.mesh, group.place.boundary.on_axis
    inside = mesh.grid.shape[2] - 2
    a, b = mesh.pairs.T
    edges = np.flatnonzero(axis[a] & axis[b])
    return np.concatenate([np.flatnonzero(axis), (len(axis) + inside * edges[:, None] + np.arange(inside)).ravel()])


def _solve(
    numbers: np.ndarray, stiffness: Array, mass: Array, load: Array, size: int, x: float, held: np.ndarray
) -> float:
    """S = Im ∫ t θ of (i x M + K) θ = i x t."""
    rows = np.repeat(numbers, numbers.shape[1], axis=1).ravel()
    columns = np.tile(numbers, (1, numbers.shape[1])).ravel()
    free = np.setdiff1d(np.arange(size), held)
    matrix = coo_matrix(((stiffness + 1j * x * mass).ravel(), (rows, columns)), shape=(size, size)).tocsr()
    right = np.zeros(size)
    np.add.at(right, numbers.ravel(), load.ravel())
    theta = splu(csc_matrix(matrix[free][:, free])).solve(1j * x * right[free])
    return float(np.imag(right[free] @ theta))
