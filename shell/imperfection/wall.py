r"""Strains in a wall that is not a body of revolution, on the unperturbed shell's own coordinates (s, θ, ζ).

The faces lie at ζ = m(s, θ) ± h(s, θ)/2, so a point of the reference η in -1 ... 1 lies at ζ = m + η h/2 and, for
any function of (s, θ, η),

    ∂_ζ = (2/h) ∂_η,   ∂_s|ζ = ∂_s - ζ_s ∂_ζ,   ∂_θ|ζ = ∂_θ - ζ_θ ∂_ζ,

with which the strains of the shell (shell.kernel) hold without approximation, whatever the size of the imperfection:

    ε_s = (u_s + κ w)/A,  ε_θ = (v_θ + t_r u + n_r w)/ρ,  ε_ζ = w_ζ,
    γ_sθ = v_s/A + (u_θ - t_r v)/ρ,  γ_sζ = u_ζ + (w_s - κ u)/A,  γ_θζ = v_ζ + (w_θ - n_r v)/ρ.
"""

from dataclasses import dataclass

import numpy as np

from shell.imperfection.field import Field, values_around
from shell.kernel import Section, energy_weights
from shell.quadrature import Array, Basis, legendre
from shell.solution import Constants

JETS = 9  # u, u_s, u_η, then the same of v and w


@dataclass(frozen=True)
class Part:
    """One harmonic of a displacement: k, and whether it is the mode that starts as cos kθ (0) or as sin kθ (1)."""

    harmonic: int
    turned: int

    def around(self, theta: Array) -> tuple[Array, Array]:
        """The factors of u and w and of v, (cos kθ, sin kθ) or (sin kθ, -cos kθ)."""
        c, s = np.cos(self.harmonic * theta), np.sin(self.harmonic * theta)
        return (s, -c) if self.turned else (c, s)


@dataclass(frozen=True, eq=False)
class Wall:
    """Points of the wall, (elements, stations, heights), at azimuths θ: geometry and material, (points, θ) each.

    Attributes
    ----------
    elements : which elements of the group these are.
    along : (2, stations, functions) values and ξ-derivatives. through : Legendre modes of u, v, w at the heights.
    ds : ds/dξ of the stations, (elements, stations).
    """

    elements: slice
    along: Array
    through: tuple[Basis, Basis, Basis]
    ds: Array
    theta: Array
    t_r: Array
    n_r: Array
    kappa: Array
    per_A: Array
    per_rho: Array
    per_half: Array
    zeta_s: Array
    zeta_theta: Array
    volume: Array
    lam: Array
    G: Array
    rho: Array
    weights: Array

    def jets(self, unknowns: Array) -> Array:
        """u, v, w with their derivatives by s (at constant η) and by η, (9, points), of unknowns (elements, size)."""
        amplitudes = unknowns[self.elements].reshape(len(self.ds), self.along.shape[2], -1)
        value, slope = self.along[0] @ amplitudes, (self.along[1] @ amplitudes) / self.ds[..., None]
        found, first = [], 0
        for basis in self.through:
            here = slice(first, first := first + basis.values.shape[1])
            found += [
                value[..., here] @ basis.values.T,
                slope[..., here] @ basis.values.T,
                value[..., here] @ basis.slopes.T,
            ]
        return np.array(found).reshape(JETS, -1)

    def loads(self, duals: Array, shape: tuple[int, ...]) -> Array:
        """The transpose of `jets`: loads (elements, functions, amplitudes) of the whole group, shaped so."""
        duals = duals.reshape(JETS, *self.ds.shape, -1)
        value, slope = [], []
        for k, basis in enumerate(self.through):
            by_value, by_s, by_eta = duals[3 * k : 3 * k + 3]
            value.append(by_value @ basis.values + by_eta @ basis.slopes)
            slope.append(by_s @ basis.values / self.ds[..., None])
        found = np.zeros(shape)
        found[self.elements] = np.einsum("sf,esm->efm", self.along[0], np.concatenate(value, axis=-1)) + np.einsum(
            "sf,esm->efm", self.along[1], np.concatenate(slope, axis=-1)
        )
        return found

    def move(self, jets: Array, part: Part) -> tuple[Array, Array]:
        """Strains (6, points, θ) and displacements (3, points, θ)."""
        C, S = part.around(self.theta)
        k = part.harmonic
        u, u_s, u_e, v, v_s, v_e, w, w_s, w_e = jets[..., None]
        uC, vS, wC = u * C, v * S, w * C
        u_z, v_z, w_z = (u_e * C) * self.per_half, (v_e * S) * self.per_half, (w_e * C) * self.per_half
        A, rho, z_s, z_t = self.per_A, self.per_rho, self.zeta_s, self.zeta_theta
        strain = np.empty((6, *vS.shape))
        strain[0] = (u_s * C - z_s * u_z + self.kappa * wC) * A
        strain[1] = (v * (k * C) - z_t * v_z + self.t_r * uC + self.n_r * wC) * rho
        strain[2] = w_z
        strain[3] = (v_s * S - z_s * v_z) * A - (u * (k * S) + z_t * u_z + self.t_r * vS) * rho
        strain[4] = u_z + (w_s * C - z_s * w_z - self.kappa * uC) * A
        strain[5] = v_z - (w * (k * S) + z_t * w_z + self.n_r * vS) * rho
        return strain, np.stack([uC, vS, wC])

    def stress(self, strain: Array) -> Array:
        """Stresses times the volume of each point, (6, points, θ)."""
        found = self.weights[:, None, None] * (self.G * self.volume) * strain
        found[:3] += self.lam * self.volume * (strain[0] + strain[1] + strain[2])
        return np.asarray(found)

    def pull(self, stress: Array, force: Array, parts: list[Part]) -> list[Array]:
        """Loads on the jets (9, points) of every part: ∫ (σ : ε - f · u) of stresses and forces times volume."""
        S_1, S_2, S_3, S_4, S_5, S_6 = stress
        A, rho = self.per_A, self.per_rho
        by_value = [
            self.t_r * rho * S_2 - self.kappa * A * S_5 - force[0],
            -(self.t_r * S_4 + self.n_r * S_6) * rho - force[1],
            self.kappa * A * S_1 + self.n_r * rho * S_2 - force[2],
        ]
        by_s = [A * S_1, A * S_4, A * S_5]
        by_theta = [rho * S_4, rho * S_2, rho * S_6]
        by_zeta = [S_5, S_6, S_3]
        by_eta = [
            (z - self.zeta_s * s - self.zeta_theta * t) * self.per_half
            for z, s, t in zip(by_zeta, by_s, by_theta, strict=True)
        ]
        found = []
        for part in parts:
            C, S = part.around(self.theta)
            k = part.harmonic
            rows = []
            for component, (one, other) in enumerate(((C, -k * S), (S, k * C), (C, -k * S))):
                rows += [
                    by_value[component] @ one + by_theta[component] @ other,
                    by_s[component] @ one,
                    by_eta[component] @ one,
                ]
            found.append(np.array(rows))
        return found


def deform(
    section: Section,
    constants: Constants,
    elements: slice,
    along: Array,
    eta: tuple[Array, Array],
    orders: tuple[int, int, int],
    faces: tuple[Field | None, Field | None],
    density: Field | None,
    modulus: Field | None,
    waves: tuple[int, ...],
    theta: Array,
    transverse: float,
    width: Array | None = None,
) -> Wall:
    """The wall at stations, deformed.

    Parameters
    ----------
    section, constants, elements, along, orders : of the elements.
    eta : heights and their weights.
    faces : how far the inner and the outer face stand out, m.
    density, modulus : relative.
    waves : the orders of the fields that count.
    theta : azimuths, equal steps.
    transverse : Naghdi's shear correction.
    width : of a strip along the stations, m, (θ,), instead of the stations' own share of the meridian.
    """
    points, weights = eta
    x = section.position
    stations = x.shape[1]
    inner, outer = (_values(field, waves, x, theta) for field in faces)
    h = section.thickness[..., None] + inner[0] + outer[0]
    middle, middle_t = (outer[0] - inner[0]) / 2, (outer[1] - inner[1]) / 2
    D = _derivative(stations) if stations > 1 else np.zeros((1, 1))
    h_s = section.thickness_slope[..., None] + np.einsum("ij,ejq->eiq", D, inner[0] + outer[0]) / section.ds[..., None]
    middle_s = np.einsum("ij,ejq->eiq", D, middle) / section.ds[..., None]
    h_t = inner[1] + outer[1]

    def at_heights(field: Array, slope: Array) -> Array:
        return np.asarray((field[:, :, None] + points[:, None] * slope[:, :, None] / 2).reshape(-1, theta.size))

    def tall(values: Array) -> Array:
        full = np.broadcast_to(values[:, :, None], (*x.shape, len(points)))
        return full.reshape(-1, 1)

    def broad(values: Array) -> Array:
        full = np.broadcast_to(values[:, :, None], (*x.shape, len(points), theta.size))
        return full.reshape(-1, theta.size)

    zeta, half = at_heights(middle, h), broad(h / 2)
    t_r, n_r, kappa = tall(section.tangent_r), tall(-section.tangent_z), tall(section.curvature)
    A, rho = 1 + kappa * zeta, tall(section.r) + n_r * zeta
    lam, G = constants.lame
    stiff, heavy = 1 + broad(_values(modulus, waves, x, theta)[0]), 1 + broad(_values(density, waves, x, theta)[0])
    share = broad((section.weight * section.ds)[..., None] if width is None else np.broadcast_to(width, h.shape))
    across = np.broadcast_to(weights[:, None], (*x.shape, len(points), 1)).reshape(-1, 1)
    u, v, w = (legendre(order, points) for order in orders)
    return Wall(
        elements,
        along,
        (u, v, w),
        section.ds,
        theta,
        t_r,
        n_r,
        kappa,
        1 / A,
        1 / rho,
        1 / half,
        at_heights(middle_s, h_s),
        at_heights(middle_t, h_t),
        share * across * A * rho * half * (2 * np.pi / theta.size),
        tall(lam) * stiff,
        tall(G) * stiff,
        tall(constants.rho) * heavy,
        energy_weights(transverse),
    )


def _values(field: Field | None, waves: tuple[int, ...], x: Array, theta: Array) -> tuple[Array, Array]:
    if field is None:
        zero = np.zeros((*x.shape, theta.size))
        return zero, zero
    return values_around(field, [m for m in field.orders if m in waves], x, theta)


def _derivative(count: int) -> Array:
    """Derivatives at the points of a Gauss rule of the polynomial through values there."""
    modes = legendre(count - 1, np.polynomial.legendre.leggauss(count)[0])
    return np.asarray(modes.slopes @ np.linalg.inv(modes.values))
