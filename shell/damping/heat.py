"""Heat in a vibrating body: the constants of its material, the stress that warms it, and the heat equation on a mode,

    i x θ - ∇²θ = i x t,

in all directions of the meridional section and around, with insulated surfaces.

With t = tr σ and x = ω C/k, the part of θ in quadrature with t is what makes loss: S = ∫ t Im θ dV.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from shell.blocks import number_functions
from shell.elastic import Constants
from shell.errors import ShellError
from shell.quadrature import Array
from shell.solution import Solution
from shell.sparse import assemble_elements
from shell.system import SolidGroup


@dataclass(frozen=True)
class Heat:
    """Thermal constants of a material: expansion α (1/K), capacity C = ρ c (J/(m³ K)), conductivity k (W/(m K))."""

    expansion: float
    capacity: float
    conductivity: float

    def __post_init__(self) -> None:
        if not (self.capacity > 0 and self.conductivity > 0):
            raise ShellError("heat capacity and conductivity must be positive.")


def mean_stress(c: Constants, strain: Array) -> Array:
    """Trace of the stress, Pa: E/(1 - 2ν) tr ε, in plane stress E/(1 - ν) (ε_1 + ε_2)."""
    if c.plane_stress:
        return np.asarray((c.E / (1 - c.nu))[..., None] * (strain[:, :, 0] + strain[:, :, 1]))
    return np.asarray((c.E / (1 - 2 * c.nu))[..., None] * np.add.reduce(strain[:, :, :3], axis=2))


def conduct_in_cells(solution: Solution, index: int, x: float) -> float:
    """S(x) of one solid part, heat flowing in all directions within it; a boundary layer thinner than the cells is left out."""
    group, c = solution.system.solids[index], solution.constants[index]
    mesh, table, n = group.mesh, group.table, solution.system.n
    numbers, signs, size = number_functions(mesh, mesh.grid.shape[2] - 1)
    functions = numbers.shape[1]
    products = group.products.reshape(len(numbers), 10, functions, functions)
    stiffness = products[:, 0] + products[:, 4] + n**2 * products[:, 8]
    value = table.gradients[:, 2] * table.radius[..., None] * signs[:, None]
    stress = mean_stress(c, solution.strain[index])[:, 0]
    load = np.einsum("cp,cpf->cf", stress * table.volume[:, 0], value)
    return solve_heat(numbers, stiffness, products[:, 9], load, size, x, _on_axis(solution, group, size))


def _on_axis(solution: Solution, group: SolidGroup, size: int) -> np.ndarray:
    """Functions that live on the axis, where a temperature that varies as cos nθ vanishes."""
    if solution.system.n == 0:
        return np.zeros(0, dtype=np.intp)
    mesh, axis = group.mesh, group.boundary.on_axis
    inside = mesh.grid.shape[2] - 2
    edges = np.flatnonzero(mesh.between(axis))
    return np.concatenate([np.flatnonzero(axis), (len(axis) + inside * edges[:, None] + np.arange(inside)).ravel()])


def solve_heat(
    numbers: np.ndarray, stiffness: Array, mass: Array, load: Array, size: int, x: float, held: np.ndarray
) -> float:
    """S = Im ∫ t θ of (i x M + K) θ = i x t."""
    free = np.setdiff1d(np.arange(size), held)
    matrix = assemble_elements(numbers, stiffness + 1j * x * mass, size)
    right = np.zeros(size)
    np.add.at(right, numbers.ravel(), load.ravel())
    theta = scipy.sparse.linalg.splu(scipy.sparse.csc_matrix(matrix[:, free][free])).solve(1j * x * right[free])
    return float(np.imag(right[free] @ theta))
