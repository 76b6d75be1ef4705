r"""The kernel of the solid cells of roots, corners and clamps: every strain is a sum of gradients of scalar functions.

Displacements a, b, c along r, θ, z vary as cos nθ, sin nθ, cos nθ (for n = 0, b as 1). With φ_r, φ_z and φ_0 = φ/r of a
function φ of the section,

    ε_r = a_r,  ε_θ = a_0 + n b_0,  ε_z = c_z,  γ_rθ = b_r - n a_0 - b_0,  γ_rz = a_z + c_r,  γ_θz = b_z - n c_0,

or ε_k = Σ S_kαc u_c,α. So the stiffness for any n, λ and G follows from the nine products ∫ φ_α ψ_β dV.
"""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from shell.errors import ShellError
from shell.kernel import PAIRS, energy_weights
from shell.quadrature import Array, Basis, gauss, hierarchic, nodal
from shell.sparse import Index

R, Z, ZERO = range(3)  # the gradients φ_r, φ_z, φ_0


@dataclass(frozen=True, eq=False)
class CellTable:
    """Gradients of the functions of solid cells at their quadrature points."""

    gradients: Array  # φ_r, φ_z, φ/r, (cells, 3, points, functions)
    radius: Array  # r of the points, m, (cells, points)
    volume: Array  # dr dz times r and the quadrature weights, (cells, 1, points)
    position: Array  # where on the meridian (0 ... 1) the material is to be taken, (cells, 1)
    n: int
    transverse_shear: float = 1.0
    plane_stress: bool = False

    def strains(self, unknowns: Array) -> Array:
        """Strain (cells, 1, 6, points) of cell unknowns (cells, functions x 3)."""
        count, _, points, functions = self.gradients.shape
        u = self.gradients @ unknowns.reshape(count, 1, functions, 3)
        flat = strain_of_gradients(self.n).reshape(6, 9) @ u.transpose(0, 1, 3, 2).reshape(count, 9, points)
        return np.asarray(flat[:, None])

    def displacements(self, unknowns: Array) -> Array:
        """Displacement (cells, 1, 3, points) of cell unknowns (cells, functions x 3)."""
        count, _, _, functions = self.gradients.shape
        over_r = np.swapaxes(self.gradients[:, ZERO] @ unknowns.reshape(count, functions, 3), 1, 2)
        return np.asarray((over_r * self.radius[:, None])[:, None])

    def products(self, signs: Array) -> Array:
        """∫ φ_α ψ_β dV, nine rows, and ∫ φ ψ dV, the last, of functions turned by their signs: (cells, 10, functions²)."""
        count, _, _, functions = self.gradients.shape
        weighted = self.gradients * (np.sqrt(self.volume)[..., None] * signs[:, None, None])
        found = np.empty((count, 10, functions, functions), weighted.dtype)
        np.matmul(
            np.swapaxes(weighted, 2, 3)[:, :, None],
            weighted[:, None],
            out=found[:, :9].reshape(count, 3, 3, functions, functions),
        )
        moved = weighted[:, ZERO] * self.radius[..., None]
        np.matmul(np.swapaxes(moved, 1, 2), moved, out=found[:, 9])
        return found.reshape(count, 10, functions**2)

    def loads(self, stress: Array, force: Array) -> Array:
        """∫ (σ : ε(φ) - f · φ) dV of all functions, (cells, functions, 3), for stress and force (cells, 1, 6 or 3, points)."""
        count, points = self.radius.shape
        dual = strain_of_gradients(self.n).reshape(6, 9).T @ (stress[:, 0] * self.volume)
        dual = dual.reshape(count, 3, 3, points)
        dual[:, ZERO] -= force[:, 0] * (self.volume * self.radius[:, None])
        return np.asarray((np.swapaxes(self.gradients, 2, 3) @ np.swapaxes(dual, 2, 3)).sum(axis=1))


@cache
def derivatives(n: int) -> Array:
    """D_ijαc (3, 3, 3, 3): ∂_i u_j, i and j along r, θ, z, from the gradient α of component c."""
    D = np.zeros((3, 3, 3, 3))
    D[0, :, R] = D[2, :, Z] = np.eye(3)
    D[1, :, ZERO] = [[-n, -1, 0], [1, n, 0], [0, 0, -n]]
    return D


@cache
def strain_of_gradients(n: int) -> Array:
    """S_kαc (6, 3, 3): strain k from the gradient α of component c."""
    D = derivatives(n)
    return np.array([D[i, j] if i == j else D[i, j] + D[j, i] for i, j in PAIRS])


@cache
def _laws(n: int) -> tuple[Array, Array]:
    """Factors of the nine products in the stiffness between components c and d, (9, 9): per unit λ and per unit G."""
    S = strain_of_gradients(n)
    trace = S[:3].sum(axis=0)
    dilation = np.einsum("ac,bd->cdab", trace, trace)
    shear = np.einsum("k,kac,kbd->cdab", energy_weights(), S, S)
    return dilation.reshape(9, 9), shear.reshape(9, 9)


def cell_stiffness(products: Array, lam: Array, G: Array, n: int) -> Array:
    """Stiffness of cells with λ and G (Pa), (cells,): (cells, size, size), unknowns ordered (function, component)."""
    dilation, shear = _laws(n)
    blocks = (lam[:, None, None] * dilation + G[:, None, None] * shear) @ products[:, :9]
    return _whole(blocks)


def cell_mass(products: Array) -> Array:
    """Mass of cells per unit density in the same order."""
    blocks = np.zeros((len(products), 9, products.shape[2]))
    blocks[:, ::4] = products[:, 9:]
    return _whole(blocks)


def _whole(blocks: Array) -> Array:
    """Matrices (cells, size, size) from blocks (cells, component², function²)."""
    functions = round(blocks.shape[2] ** 0.5)
    return np.asarray(blocks.reshape(len(blocks), -1).take(_places(functions), axis=1, mode="clip"))


@cache
def _places(functions: int) -> Index:
    function, component = np.divmod(np.arange(3 * functions), 3)
    return np.asarray((3 * component * functions + function)[:, None] * functions + component * functions**2 + function)


@cache
def in_order(degree: int) -> tuple[Index, Index]:
    """The two degrees i and j of every function φ_i(ξ) φ_j(η): those inside the cell first, then sides and corners."""
    i, j = (axis.ravel() for axis in np.meshgrid(np.arange(degree + 1), np.arange(degree + 1), indexing="ij"))
    order = np.argsort(np.minimum(i, j) < 2, kind="stable")
    return i[order], j[order]


@dataclass(frozen=True, eq=False)
class Reference:
    """The functions of a cell and those of its sides at points (ξ_i, η_j) of the reference square."""

    weights: Array  # of the points, (points,)
    along: Basis  # along, across: functions of the sides
    across: Basis
    value: Array  # value, by_xi, by_eta: of the functions of the cell, (points, functions)
    by_xi: Array
    by_eta: Array

    @classmethod
    def at(cls, xi: Array, eta: Array, weights: Array, degree: int, sides: int) -> "Reference":
        """At given points, for functions of one degree and sides of another."""
        one, two = hierarchic(degree, xi), hierarchic(degree, eta)
        i, j = in_order(degree)

        def product(f: Array, g: Array) -> Array:
            return np.asarray((f[:, None, i] * g[None, :, j]).reshape(-1, len(i)))

        return cls(
            weights.ravel(), nodal(sides, xi), nodal(sides, eta), product(one.values, two.values),
            product(one.slopes, two.values), product(one.values, two.slopes),
        )  # fmt: skip

    def chosen(self, functions: Index) -> "Reference":
        """The same with some of the functions."""
        cut = {name: getattr(self, name)[:, functions] for name in ("value", "by_xi", "by_eta")}
        return replace(self, **cut)


@cache
def at_gauss_points(degree: int, sides: int, count: int) -> Reference:
    """The reference cell at the points of a Gauss rule of `count` by `count`."""
    points, weights = gauss(count)
    return Reference.at(points, points, np.outer(weights, weights), degree, sides)


def tabulate_cells(grid: Array, place: Reference, n: int, position: float) -> CellTable:
    """Gradients in cells whose sides are polynomials through `grid` (2, cells, Lobatto ξ, η)."""
    along, across = place.along, place.across
    r = _interpolate(grid[0], along.values, across.values)
    r_xi, z_xi = (_interpolate(x, along.slopes, across.values) for x in grid)
    r_eta, z_eta = (_interpolate(x, along.values, across.slopes) for x in grid)
    det = r_xi * z_eta - r_eta * z_xi
    if not np.all(det * det[:, :1] > 0):
        raise ShellError(
            f"the root, corner or clamp at {100 * position:.3g} % of the meridian cannot be divided into cells that do not overlap: "
            "its faces meet too sharply for the thickness. Change the stem, its fillet, or the thickness there."
        )
    gradients = np.empty((len(r), 3, *place.value.shape))
    for to, (xi, eta) in enumerate(((z_eta, -z_xi), (-r_eta, r_xi))):
        np.multiply((xi / det)[..., None], place.by_xi, out=gradients[:, to])
        gradients[:, to] += (eta / det)[..., None] * place.by_eta
    np.divide(place.value, r[..., None], out=gradients[:, ZERO])
    return CellTable(gradients, r, (abs(det) * r * place.weights)[:, None], np.full((len(r), 1), position), n)


def _interpolate(grid: Array, along: Array, across: Array) -> Array:
    return np.asarray((along @ grid @ across.T).reshape(len(grid), -1))
