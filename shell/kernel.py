"""The kernel of the shell: strains of displacements that vary as cos nθ and sin nθ, in the meridional section.

Every element is a product of polynomials along a first direction ξ (the meridian) and a second one η (the thickness).
At each *station* ξ_i the strain at the points η_j is a linear function of the *section amplitudes* and of their
derivatives along ξ. This table of strains is all the mechanics there is: energies, matrices, and stresses follow from it.
Displacements u, v, w lie along tangent, circumference and normal; the solid cells of roots and corners (shell.cells) have
the same strains in cylindrical components.

Components of strain, in order: three normal strains, then the engineering shears 12, 13, 23, where the axes 1, 2, 3 are
(s, θ, ζ) in the shell and (r, θ, z) in a cell.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shell.points import MiddleSurface
from shell.quadrature import Array, Basis, legendre

SHEAR_CORRECTION = 5 / 6
Orders = tuple[int, int, int]
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # of the axes, in the order of strains
NO_STRESS, NO_FORCE = np.zeros((1, 1, 6, 1)), np.zeros((1, 1, 3, 1))  # everywhere; see `StrainTable.loads`
TENSOR = np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2]])  # places of the components in that order


@dataclass(frozen=True, eq=False)
class StrainTable:
    """Strains at the quadrature points of elements, per unit of their section amplitudes."""

    strain: Array  # (elements, stations, 6, points, 2, amplitudes); the axis of length 2 is value and ξ-derivative
    displacement: Array  # (elements, stations, 3, points, amplitudes)
    # (elements, stations, points), dr dz times r and the quadrature weights (times π it is a volume in m³)
    volume: Array
    along: Array  # (2, stations, functions), the polynomials along ξ and their derivatives
    position: Array  # (elements, stations), where on the meridian (0 ... 1) the material is to be taken
    transverse_shear: float = 1.0
    plane_stress: bool = False

    def strains(self, unknowns: Array) -> Array:
        """Strain (elements, stations, 6, points) of element unknowns (elements, size)."""
        elements, stations, _, points = self.strain.shape[:4]
        amplitudes = unknowns.reshape(elements, self.along.shape[2], -1)
        jets = np.moveaxis(self.along @ amplitudes[:, None], 1, 2).reshape(elements, stations, -1, 1)
        flat = self.strain.reshape(elements, stations, 6 * points, -1)
        return np.asarray((flat @ jets).reshape(elements, stations, 6, points))

    def displacements(self, unknowns: Array) -> Array:
        """Displacement (elements, stations, 3, points) of element unknowns (elements, size)."""
        amplitudes = self.along[0] @ unknowns.reshape(len(unknowns), self.along.shape[2], -1)
        return np.asarray((self.displacement @ amplitudes[:, :, None, :, None])[..., 0])

    def loads(self, stress: Array, force: Array) -> Array:
        """∫ (σ : ε(φ) - f · φ) dV of all functions (elements, functions, amplitudes), for stress and force at the points."""
        elements, stations, _, points = self.strain.shape[:4]
        volume = self.volume[:, :, None]
        strain = self.strain.reshape(elements, stations, 6 * points, -1)
        moved = self.displacement.reshape(elements, stations, 3 * points, -1)
        jets = (stress * volume).reshape(elements, stations, 1, -1) @ strain
        jets = jets.reshape(elements, stations, 2, -1)
        jets[:, :, 0] -= ((force * volume).reshape(elements, stations, 1, -1) @ moved)[:, :, 0]
        return np.asarray(np.einsum("dsf,esdm->efm", self.along, jets))


@dataclass(frozen=True, eq=False)
class Section(MiddleSurface):
    """The middle surface at stations: arrays (elements, stations) and the factor ds/dξ."""

    ds: Array
    weight: Array


def shell_table(section: Section, n: int, through: Orders, eta: tuple[Array, Array], along: Basis) -> StrainTable:
    """Strains of a shell of revolution in its own frame, without approximation in z/R: normal ∂_i u_i, shear ∂_i u_j + ∂_j u_i.

    u, w vary as cos nθ, v as sin nθ (for n = 0, v as 1). `section` and the polynomials `along` are at the stations, `eta` are
    thickness points on [-1, 1] with weights, `through` the degrees of the Legendre modes of u, v, w.
    """
    points, weights = eta
    H, A_rho = shell_gradients(section, n, through, points)
    strain = np.stack([H[:, :, i, j] if i == j else H[:, :, i, j] + H[:, :, j, i] for i, j in PAIRS], axis=2)
    share = section.ds * section.thickness / 2 * section.weight
    volume = A_rho * share[..., None] * weights
    moved = np.stack([f[:, 0] for f in _jets(section, through, points)[0]])
    displacement = np.broadcast_to(moved, (*section.r.shape, *moved.shape))
    naghdi = through[2] == 0
    functions, transverse = np.stack([along.values, along.slopes]), SHEAR_CORRECTION if naghdi else 1.0
    return StrainTable(strain, displacement, volume, functions, section.position, transverse, naghdi)


def shell_gradients(section: Section, n: int, through: Orders, points: Array) -> tuple[Array, Array]:
    """Rows ∂_s, ∂_θ, ∂_ζ of u, v, w at heights η, (elements, stations, 3, 3, points, 2, amplitudes), and A ρ there.

    With ζ = η h/2, A = 1 + κ ζ and ρ = r + ζ n_r (the radius of the point), subscripts for derivatives:

    (u_s + κ w)/A, v_s/A, (w_s - κ u)/A;  -(n u + t_r v)/ρ, (n v + t_r u + n_r w)/ρ, -(n w + n_r v)/ρ;  u_ζ, v_ζ, w_ζ.

    Where the thickness varies, the derivative at constant ζ is ∂_s - (h'/h) η ∂_η.
    """
    t_r, kappa, n_r = _tall(section.tangent_r), _tall(section.curvature), _tall(section.normal_r)
    zeta = _tall(section.thickness) * points[:, None, None] / 2
    A, rho = 1 + kappa * zeta, _tall(section.r) + n_r * zeta
    (u, v, w), (u_s, v_s, w_s), by_zeta = _jets(section, through, points)
    rows = (
        ((u_s + kappa * w) / A, v_s / A, (w_s - kappa * u) / A),
        (-(n * u + t_r * v) / rho, (n * v + t_r * u + n_r * w) / rho, -(n * w + n_r * v) / rho),
        by_zeta,
    )
    flat = np.stack(np.broadcast_arrays(*(one for row in rows for one in row)), axis=2)
    return flat.reshape(*flat.shape[:2], 3, 3, *flat.shape[3:]), (A * rho)[..., 0, 0]


def strains_by_order(table: StrainTable, section: Section, points: Array) -> Array:
    """Derivative of a table's strains by n, in which they are linear, per unit of the amplitudes, (elements, stations, 6, points, amplitudes)."""
    (u, v, w), still = table.displacement[0, 0], 0 * table.displacement[0, 0, 0]
    rho = _tall(section.r)[..., 0] + _tall(section.normal_r * section.thickness / 2)[..., 0] * points[:, None]
    return np.stack([still, v, still, -u, still, -w]) / rho[:, :, None]


def lame(E: Array, nu: Array, plane_stress: bool) -> tuple[Array, Array]:
    """Lamé's λ and G; in plane stress λ is replaced by 2 G λ/(λ + 2 G) = E ν/(1 - ν²)."""
    G = E / (2 * (1 + nu))
    if plane_stress:
        return E * nu / (1 - nu**2), G
    return E * nu / ((1 + nu) * (1 - 2 * nu)), G


def lame_slopes(E: Array, nu: Array, plane_stress: bool) -> tuple[Array, Array]:
    """Derivatives of `lame` by ν at constant E."""
    by_nu = -E / (2 * (1 + nu) ** 2)
    if plane_stress:
        return E * (1 + nu**2) / (1 - nu**2) ** 2, by_nu
    return E * (1 + 2 * nu**2) / ((1 + nu) * (1 - 2 * nu)) ** 2, by_nu


def energy_weights(transverse: float = 1.0) -> Array:
    """Weights g_c of the shear modulus: 2 U = ∫ λ (ε_1 + ε_2 + ε_3)² + G Σ g_c ε_c²; Naghdi's transverse shear counts less."""
    return np.array([2.0, 2.0, 2.0, 1.0, transverse, transverse])


def station_stiffness(table: StrainTable) -> tuple[Array, Array]:
    """Energy of each station's section amplitudes per unit λ and per unit G: (elements, stations, 2m, 2m) each."""
    shape = table.strain.shape
    flat = table.strain.reshape(*shape[:4], -1)
    root = np.sqrt(table.volume)[:, :, None, :, None]
    trace = (flat[:, :, 0] + flat[:, :, 1] + flat[:, :, 2]) * root[:, :, 0]
    sheared = flat * (root * np.sqrt(energy_weights(table.transverse_shear))[:, None, None])
    sheared = sheared.reshape(*shape[:2], -1, flat.shape[-1])
    return np.swapaxes(trace, -1, -2) @ trace, np.swapaxes(sheared, -1, -2) @ sheared


def station_mass(table: StrainTable) -> Array:
    """Kinetic energy of each station's section amplitudes per unit density: (elements, stations, m, m)."""
    shape = table.displacement.shape
    moved = (table.displacement * np.sqrt(table.volume)[:, :, None, :, None]).reshape(*shape[:2], -1, shape[-1])
    return np.asarray(np.swapaxes(moved, -1, -2) @ moved)


def integrate(stations: Array, along: Array) -> Array:
    """Sum the stations of each element into its matrix: (elements, size, size), unknowns ordered (function, amplitude).

    `along` has the values of the functions, and for a stiffness their ξ-derivatives.
    """
    elements, count, width, _ = stations.shape
    kinds, _, functions = along.shape
    m = width // kinds
    pairs = np.einsum("dia,eib->abide", along, along).reshape(functions**2, -1)
    inner = (
        stations.reshape(elements, count, kinds, m, kinds, m).transpose(0, 1, 2, 4, 3, 5).reshape(elements, -1, m * m)
    )
    blocks = (pairs @ inner).reshape(elements, functions, functions, m, m).transpose(0, 1, 3, 2, 4)
    return np.asarray(blocks.reshape(elements, functions * m, functions * m))


def _tall(per_station: Array) -> NDArray[np.float64]:
    """Give an array (elements, stations) the axes point, jet and amplitude."""
    return per_station[..., None, None, None]


def _jets(section: Section, through: Orders, points: Array) -> tuple[list[Array], list[Array], list[Array]]:
    """The three displacements, their s- and their ζ-derivatives as rows (point, jet, amplitude)."""
    h, slope, ds = (_tall(a) for a in (section.thickness, section.thickness_slope, section.ds))
    total, start = sum(through) + 3, 0
    drift = slope / h * points[:, None, None]
    found: tuple[list[Array], list[Array], list[Array]] = ([], [], [])
    basis = legendre(max(through), points)
    for order in through:
        value, d_eta, d_xi = (np.zeros((len(points), 2, total)) for _ in range(3))
        columns = slice(start, start := start + order + 1)
        value[:, 0, columns] = d_xi[:, 1, columns] = basis.values[:, : order + 1]
        d_eta[:, 0, columns] = basis.slopes[:, : order + 1]
        for kind, one in zip(found, (value, d_xi / ds - drift * d_eta, 2 / h * d_eta), strict=True):
            kind.append(one)
    return found
