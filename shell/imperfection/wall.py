r"""What an imperfect wall has more than the perfect one: layers on its faces, a strip on its edge, a change of its material.

The displacements of the perfect wall, polynomials in the distance ζ from its middle surface, are taken as they are in all of
the imperfect one, so that its energies differ by those of what is there more (or less) alone,

    δK = ∫_layers σ : ε dV + ∫ δσ : ε dV,   δM = ∫_layers ρ u · u dV + ∫ δρ u · u dV,

a layer from the perfect face to the true one. Nothing cancels, and δK never exceeds a share of K, whatever the waves around.
The strains are those of the shell (shell.kernel), at any height:

    ε_s = (u_s + κ w)/A,  ε_θ = (v_θ + t_r u + n_r w)/ρ,  ε_ζ = w_ζ,
    γ_sθ = v_s/A + (u_θ - t_r v)/ρ,  γ_sζ = u_ζ + (w_s - κ u)/A,  γ_θζ = v_ζ + (w_θ - n_r v)/ρ.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shell.imperfection.field import Field, values_around
from shell.kernel import Section, energy_weights
from shell.quadrature import Array, gauss, legendre
from shell.solution import Constants

HEIGHTS = 2  # of a layer: a Gauss rule, exact to the third power of the height


@dataclass(frozen=True, eq=False)
class Around:
    """How harmonics go around: of each k the mode that starts as cos kθ and the one that starts as sin kθ, (2 harmonics, θ).

    Attributes
    ----------
    order : k of every row, (rows, 1).
    cosine : of u and w, cos kθ or sin kθ. sine : of v, sin kθ or -cos kθ.
    """

    order: Array
    cosine: Array
    sine: Array


def go_around(harmonics: Sequence[int], theta: Array) -> Around:
    """Of harmonics at azimuths."""
    turned = np.multiply.outer(np.asarray(harmonics, dtype=float), theta)
    c, s = np.cos(turned), np.sin(turned)
    rows = (2 * len(harmonics), theta.size)
    order = np.repeat(np.asarray(harmonics, dtype=float), 2)[:, None]
    return Around(order, np.stack([c, s], axis=1).reshape(rows), np.stack([s, -c], axis=1).reshape(rows))


@dataclass(frozen=True, eq=False)
class Wall:
    """Points of what is there more, (stations, heights, θ) or what broadcasts to it, of a run of elements.

    Attributes
    ----------
    elements : which elements of the group these are.
    along : (2, stations of an element, functions) values and ξ-derivatives. ds : ds/dξ, (elements, stations of an element).
    through : of u, v, w: Legendre modes at the heights and their ζ-derivatives, (2, modes, stations, heights, θ).
    drift : h'η/2 of the perfect wall: ∂_s at constant ζ is ∂_s - drift ∂_ζ.
    per_A, per_rho : 1/(1 + κ ζ) and 1/ρ. t_r, n_r, kappa : of the middle surface.
    lam, G, rho : λ, G and ρ times volume. weights : of the strains in the energy.
    """

    elements: slice
    along: Array
    ds: Array
    through: tuple[Array, Array, Array]
    drift: Array
    per_A: Array
    per_rho: Array
    t_r: Array
    n_r: Array
    kappa: Array
    lam: Array
    G: Array
    rho: Array
    weights: Array

    def move(self, unknowns: Array, around: Around) -> tuple[Array, Array]:
        """Strains (6, ...) and displacements (3, ...) of element unknowns (rows, elements, size) that go around so."""
        (U, U_s, U_t, U_z), (V, V_s, V_t, V_z), (W, W_s, W_t, W_z) = self._jets(unknowns, around)
        A, rho = self.per_A, self.per_rho
        strain = [
            (U_s + self.kappa * W) * A,
            (V_t + self.t_r * U + self.n_r * W) * rho,
            W_z,
            V_s * A + (U_t - self.t_r * V) * rho,
            U_z + (W_s - self.kappa * U) * A,
            V_z + (W_t - self.n_r * V) * rho,
        ]
        return np.array(strain), np.array([U, V, W])

    def stress(self, strain: Array) -> Array:
        """Stresses times volume, (6, ...)."""
        found = self.weights[:, None, None, None] * self.G * strain
        found[:3] += self.lam * (strain[0] + strain[1] + strain[2])
        return np.asarray(found)

    def pull(self, stress: Array, force: Array, around: Around, elements: int) -> Array:
        """∫ (σ : ε - f · u) of stresses and forces times volume, on the unknowns (rows, elements, functions x modes)."""
        s, t, z, st, sz, tz = stress
        A, rho = self.per_A, self.per_rho
        s, st, sz, t_A, st_rho, tz_rho = s * A, st * A, sz * A, t * rho, st * rho, tz * rho
        by_value = (
            self.t_r * t_A - self.kappa * sz - force[0],
            -self.t_r * st_rho - self.n_r * tz_rho - force[1],
            self.kappa * s + self.n_r * t_A - force[2],
        )
        by_s, by_theta, by_zeta = (s, st, sz), (st_rho, t_A, tz_rho), (sz, tz, z)
        loads = []
        for part, (value, slope) in enumerate(_turns(around)):
            P, P_z = self.through[part]
            height = by_zeta[part] - self.drift * by_s[part]
            at = np.stack([(P * by_value[part] + P_z * height).sum(axis=2), (P * by_theta[part]).sum(axis=2)])
            along_s = (P * by_s[part]).sum(axis=2) @ value.T
            loads.append((at[0] @ value.T + at[1] @ slope.T, along_s))
        by_value_, by_s_ = (np.moveaxis(np.concatenate(kind), 2, 0) for kind in zip(*loads, strict=True))
        rows, modes, _ = by_value_.shape
        shape = (rows, modes, *self.ds.shape)
        found = np.zeros((rows, elements, self.along.shape[2], modes))
        found[:, self.elements] = np.einsum("sf,rmes->refm", self.along[0], by_value_.reshape(shape), optimize=True)
        found[:, self.elements] += np.einsum(
            "sf,rmes->refm", self.along[1], by_s_.reshape(shape) / self.ds, optimize=True
        )
        return found.reshape(rows, elements, -1)

    def _jets(self, unknowns: Array, around: Around) -> list[tuple[Array, Array, Array, Array]]:
        """Of u, v, w: values and derivatives by s, θ and ζ."""
        rows = len(unknowns)
        amplitudes = unknowns[:, self.elements].reshape(rows, len(self.ds), self.along.shape[2], -1)
        value, slope = self.along[0] @ amplitudes, (self.along[1] @ amplitudes) / self.ds[..., None]
        value, slope = (np.moveaxis(one.reshape(rows, self.ds.size, -1), 0, 2) for one in (value, slope))
        found, first = [], 0
        for (P, P_z), (going, turning) in zip(self.through, _turns(around), strict=True):
            here = slice(first, first := first + len(P))
            of_value, of_slope = (np.moveaxis(one[:, here], 1, 0) for one in (value, slope))
            q, q_s, q_t = (
                (one @ wave)[:, :, None] for one, wave in ((of_value, going), (of_slope, going), (of_value, turning))
            )
            up = (P_z * q).sum(axis=0)
            found.append(((P * q).sum(axis=0), (P * q_s).sum(axis=0) - self.drift * up, (P * q_t).sum(axis=0), up))
        return found


def _turns(around: Around) -> list[tuple[Array, Array]]:
    """Of u, v, w: how they go around and the derivative of that."""
    cosine = around.cosine, -around.order * around.sine
    return [cosine, (around.sine, around.order * around.cosine), cosine]


@dataclass(frozen=True, eq=False)
class Stretch:
    """Elements of a chain: their section, material, functions along and orders through, and the azimuths."""

    section: Section
    constants: Constants
    elements: slice
    along: Array
    orders: tuple[int, int, int]
    transverse: float
    theta: Array

    def layers(
        self, faces: tuple[Field | None, Field | None], waves: tuple[int, ...], stiff: Array, heavy: Array
    ) -> Wall:
        """What the faces stand out of the perfect wall, m; stiff, heavy : 1 + changes of E and of ρ, (stations, 1, θ)."""
        points, weights = gauss(HEIGHTS)
        eta, height = [], []
        for sign, face in ((-1, faces[0]), (1, faces[1])):
            if face is not None:
                out = self._around(face, waves)
                eta.append(sign * (1 + out * (1 + points[:, None]) / self._thickness))
                height.append(out * weights[:, None] / 2)
        return self._wall(np.concatenate(eta, axis=1), np.concatenate(height, axis=1), stiff, heavy)

    def change(self, stiff: Array, heavy: Array) -> Wall:
        """A change of E and of ρ, relative, (stations, 1, θ)."""
        points, weights = gauss(max(self.orders) + 2)
        return self._wall(points[None, :, None], self._thickness / 2 * weights[:, None], stiff, heavy)

    def strip(self, width: Array) -> Wall:
        """On the edge at the one station, m wide, (θ,)."""
        points, weights = gauss(max(self.orders) + 2)
        one = np.ones((1, 1, 1))
        return self._wall(points[None, :, None], self._thickness / 2 * weights[:, None], one, one, width)

    def around(self, field: Field | None, waves: tuple[int, ...]) -> Array:
        """Values of a field, (stations, 1, θ); zeros for none."""
        if field is None:
            return np.zeros((self.section.position.size, 1, self.theta.size))
        return self._around(field, waves)

    def _around(self, field: Field, waves: tuple[int, ...]) -> Array:
        orders = [m for m in field.orders if m in waves]
        return values_around(field, orders, self.section.position.ravel(), self.theta)[0][:, None]

    @property
    def _thickness(self) -> Array:
        return _tall(self.section.thickness)

    def _wall(self, eta: Array, height: Array, stiff: Array, heavy: Array, width: Array | None = None) -> Wall:
        place, h = self.section, self._thickness
        zeta = eta * h / 2
        t_r, n_r, kappa = _tall(place.tangent_r), _tall(-place.tangent_z), _tall(place.curvature)
        A, rho = 1 + kappa * zeta, _tall(place.r) + n_r * zeta
        share = _tall(place.weight * place.ds) if width is None else width
        volume = share * height * A * rho * (2 * np.pi / self.theta.size)
        lam, G = (_tall(one) for one in self.constants.lame)
        return Wall(
            self.elements,
            self.along,
            place.ds,
            tuple(_modes(order, eta, 2 / h) for order in self.orders),  # type: ignore[arg-type]
            _tall(place.thickness_slope) * eta / 2,
            1 / A,
            1 / rho,
            t_r,
            n_r,
            kappa,
            lam * stiff * volume,
            G * stiff * volume,
            _tall(self.constants.rho) * heavy * volume,
            energy_weights(self.transverse),
        )


def _tall(values: Array) -> Array:
    """Values at stations, (stations, 1, 1)."""
    return np.asarray(values.reshape(-1, 1, 1))


def _modes(order: int, eta: Array, steepness: Array) -> Array:
    """Legendre modes at heights and their ζ-derivatives, (2, modes, *heights)."""
    basis = legendre(order, eta.ravel())
    values, slopes = (np.moveaxis(one.reshape(*eta.shape, -1), -1, 0) for one in (basis.values, basis.slopes))
    return np.stack(np.broadcast_arrays(values, slopes * steepness))
