r"""What an imperfect wall has more than the perfect one: layers on its faces, a strip on its edge, a change of its material.

The displacements of the perfect wall, polynomials in the distance ζ from its middle surface, are taken as they are in all of
the imperfect one, so that its energies differ by those of what is there more (or less) alone,

    δK = ∫_layers σ : ε dV + ∫ δσ : ε dV,   δM = ∫_layers ρ u · u dV + ∫ δρ u · u dV,

a layer from the perfect face to the true one. Nothing cancels, and δK never exceeds a share of K, whatever the waves around.
The heights t_j in a layer are the same all around, and the departure d tells how much of it belongs to each of them,

    ∫_0^d f(t) dt = Σ_j w_j(d) f(t_j),   w_j(d) = ∫_0^d l_j(t) dt,   l_j Lagrange's polynomials on the t_j,

so that the waves of a vector meet those of the imperfection in the weights alone. The strains are those of the shell (shell.kernel), at any height:

    ε_s = (u_s + κ w)/A,  ε_θ = (k v + t_r u + n_r w)/ρ,  ε_ζ = w_ζ,
    γ_sθ = v_s/A - (k u + t_r v)/ρ,  γ_sζ = u_ζ + (w_s - κ u)/A,  γ_θζ = v_ζ - (k w + n_r v)/ρ.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, log

import numpy as np

from shell.elastic import Constants
from shell.imperfection.field import Field, values_around
from shell.kernel import Section, energy_weights
from shell.quadrature import Array, gauss, legendre

HEIGHTS = 4  # of a layer, at most: exact to the third power of the height
MISSED = 1e-8  # what fewer heights may miss: of k of them a layer d of a wall h misses less than (d/h)^k


@dataclass(frozen=True, eq=False)
class Around:
    """How harmonics go around: of each k the mode that starts as cos kθ and the one that starts as sin kθ, (2 harmonics, θ)."""

    order: Array  # k of every row, (rows, 1)
    cosine: Array  # of u and w, cos kθ or sin kθ
    sine: Array  # of v, sin kθ or -cos kθ


def go_around(harmonics: Sequence[int], theta: Array) -> Around:
    """Of harmonics at azimuths."""
    turned = np.multiply.outer(np.asarray(harmonics, dtype=float), theta)
    c, s = np.cos(turned), np.sin(turned)
    rows = (2 * len(harmonics), theta.size)
    order = np.repeat(np.asarray(harmonics, dtype=float), 2)[:, None]
    return Around(order, np.stack([c, s], axis=1).reshape(rows), np.stack([s, -c], axis=1).reshape(rows))


@dataclass(frozen=True, eq=False)
class Wall:
    """Points of what is there more, (stations, heights), of a run of elements."""

    elements: slice  # which elements of the chain these are
    along: Array  # (2, stations of an element, functions) values and ξ-derivatives
    ds: Array  # ds/dξ, (stations, 1, 1)
    # of u, v, w: Legendre modes at the heights and their ζ-derivatives, (2, stations, heights, modes)
    through: tuple[Array, ...]
    # h'η/2 of the perfect wall: ∂_s at constant ζ is ∂_s - drift ∂_ζ, (stations, heights, 1, 1) like those that follow
    drift: Array
    per_A: Array  # per_A, per_rho: 1/(1 + κ ζ) and 1/ρ
    per_rho: Array
    t_r: Array  # t_r, n_r, kappa: of the middle surface
    n_r: Array
    kappa: Array
    lam: Array  # lam, G, rho: λ, G and ρ
    G: Array
    rho: Array
    weights: Array  # of the strains in the energy
    stiff: Array  # stiff, heavy: volumes that count for the stiffness and for the mass, (stations, heights, 1, θ)
    heavy: Array

    def respond(self, plain: Array, around: Around) -> tuple[Array, Array]:
        """δK and δM times unknowns of these elements in the layout of `Together.plain`, which go around so."""
        A, rho, kappa, t_r, n_r = self.per_A, self.per_rho, self.kappa, self.t_r, self.n_r
        k, cosine, sine = around.order[:, 0], around.cosine, around.sine
        (u, u_s, u_z), (v, v_s, v_z), (w, w_s, w_z) = self._jets(plain)
        s, t, z = (u_s + kappa * w) * A, (k * v + t_r * u + n_r * w) * rho, w_z
        trace = self.lam * (s + t + z)
        st, sz, tz = v_s * A - (k * u + t_r * v) * rho, u_z + (w_s - kappa * u) * A, v_z - (k * w + n_r * v) * rho
        G = [weight * self.G for weight in self.weights]
        s, t, z, sz = (
            _weigh(e, self.stiff, cosine) for e in (G[0] * s + trace, G[1] * t + trace, G[2] * z + trace, G[4] * sz)
        )
        st, tz = (_weigh(e, self.stiff, sine) for e in (G[3] * st, G[5] * tz))
        s, st, sz_A, t, st_rho, tz_rho = s * A, st * A, sz * A, t * rho, st * rho, tz * rho
        by_value = (
            t_r * t - kappa * sz_A - k * st_rho,
            k * t - t_r * st_rho - n_r * tz_rho,
            kappa * s + n_r * t - k * tz_rho,
        )
        by_s, by_zeta = (s, st, sz_A), (sz, tz, z)
        moved = [_weigh(self.rho * one, self.heavy, turn) for one, turn in ((u, cosine), (v, sine), (w, cosine))]
        values, slopes, masses = [], [], []
        for (P, P_z), value, slope, steep, mass in zip(self.through, by_value, by_s, by_zeta, moved, strict=True):
            values.append(_on_modes(P, value) + _on_modes(P_z, steep - self.drift * slope))
            slopes.append(_on_modes(P, slope))
            masses.append(_on_modes(P, mass))
        stiff = self._along(0, values, plain) + self._along(1, slopes, plain)
        return stiff, self._along(0, masses, plain)

    def _along(self, order: int, loads: Sequence[Array], plain: Array) -> Array:
        """Loads of u, v, w at the stations (stations, modes, columns) on the elements' unknowns."""
        whole = np.concatenate(loads, axis=1)
        if order:
            whole /= self.ds
        stations = self.along.shape[1]
        whole = whole.reshape(-1, stations, *whole.shape[1:]).transpose(2, 0, 1, 3)
        return np.asarray(self.along[order].T @ whole).reshape(plain.shape)

    def _jets(self, plain: Array) -> list[tuple[Array, Array, Array]]:
        """Of u, v, w: values and derivatives by s and ζ, (stations, heights, vectors, 2 harmonics)."""
        amplitudes = plain.reshape(*plain.shape[:3], -1)
        value, slope = (
            (one @ amplitudes).transpose(1, 2, 0, 3).reshape(len(self.ds), len(plain), -1) for one in self.along
        )
        slope = slope / self.ds
        found, first = [], 0
        for P, P_z in self.through:
            here = np.s_[:, first : (first := first + P.shape[-1])]
            q, q_s, q_z = (
                (P_ @ one[here]).reshape(*P.shape[:2], plain.shape[3], -1)
                for P_, one in ((P, value), (P, slope), (P_z, value))
            )
            found.append((q, q_s - self.drift * q_z, q_z))
        return found


def _weigh(field: Array, volumes: Array, turn: Array) -> Array:
    """∫ of amplitudes (stations, heights, vectors, 2 harmonics) times volumes, on the same waves."""
    at = (field.reshape(-1, len(turn)) @ turn).reshape(*field.shape[:3], -1)
    at *= volumes
    return np.asarray(at.reshape(-1, turn.shape[1]) @ turn.T).reshape(field.shape)


def _on_modes(P: Array, loads: Array) -> Array:
    """Loads at the heights on the modes, (stations, modes, columns)."""
    return np.asarray(np.swapaxes(P, 1, 2) @ loads.reshape(*loads.shape[:2], -1))


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

    def layers(self, faces: tuple[Field, Field], waves: tuple[int, ...], stiff: Array, heavy: Array) -> list[Wall]:
        """What the faces at η = -1 and 1 stand out of the perfect wall, m; stiff, heavy : 1 + changes of E and of ρ, (stations, 1, θ)."""
        eta, volumes = [], []
        for sign, face in ((-1, faces[0]), (1, faces[1])):
            out = self.values(face, waves)
            reach = float(np.abs(out).max())
            if reach > 0:
                thin = min(0.1, reach / float(self._thickness.min()))
                count = min(HEIGHTS, ceil(log(MISSED) / log(thin)))
                nodes, powers = gauss(count)[0], np.arange(1, count + 1)[:, None]
                # ∫_0^x of Lagrange's polynomials on the nodes, (stations, nodes, θ)
                shares = np.linalg.inv(np.vander(nodes, increasing=True)).T @ ((out / reach) ** powers / powers)
                eta.append(sign * (1 + 2 * reach / self._thickness * nodes))
                volumes.append(self._share * reach * shares)
        if not eta:
            return []
        volume = np.concatenate(volumes, axis=1)
        return [self._wall(np.concatenate(eta, axis=1), volume * stiff, volume * heavy)]

    def change(self, stiff: Array, heavy: Array) -> Wall:
        """A change of E and of ρ, relative, (stations, 1, θ)."""
        points, weights = gauss(max(self.orders) + 2)
        volume = self._share * (self._thickness / 2 * weights)[:, :, None]
        return self._wall(np.tile(points, (len(self._thickness), 1)), volume * stiff, volume * heavy)

    def strip(self, width: Array) -> Wall:
        """On the edge at the one station, m wide, (θ,)."""
        points, weights = gauss(max(self.orders) + 2)
        volume = width * (self._thickness / 2 * weights)[:, :, None]
        return self._wall(points[None], volume, volume)

    def values(self, field: Field, waves: tuple[int, ...]) -> Array:
        """Values of a field, (stations, 1, θ)."""
        orders = [m for m in field.orders if m in waves]
        return values_around(field, orders, self.section.position.ravel(), self.theta)[:, None]

    @property
    def _thickness(self) -> Array:
        return self.section.thickness.reshape(-1, 1)

    @property
    def _share(self) -> Array:
        """Of the meridian, (stations, 1, 1)."""
        return (self.section.weight * self.section.ds).reshape(-1, 1, 1)

    def _wall(self, eta: Array, stiff: Array, heavy: Array) -> Wall:
        """At heights (stations, heights) with areas times lengths along, (stations, heights, θ), not yet those around."""
        place, h = self.section, self._thickness
        t_r, n_r, kappa, r, slope = (
            one.reshape(-1, 1)
            for one in (place.tangent_r, -place.tangent_z, place.curvature, place.r, place.thickness_slope)
        )
        A, rho = 1 + kappa * eta * h / 2, r + n_r * eta * h / 2
        around = (A * rho * (2 * np.pi / self.theta.size))[:, :, None]
        lam, G = self.constants.lame
        modes: dict[int, Array] = {}  # at the heights, with their ζ-derivatives, (2, stations, heights, modes)
        for order in set(self.orders):
            basis = legendre(order, eta.ravel())
            values, slopes = (one.reshape(*eta.shape, -1) for one in (basis.values, basis.slopes))
            modes[order] = np.stack([values, slopes * (2 / h)[:, :, None]])
        return Wall(
            self.elements,
            self.along,
            place.ds.reshape(-1, 1, 1),
            tuple(modes[order] for order in self.orders),
            drift=_wide(slope * eta / 2),
            per_A=_wide(1 / A),
            per_rho=_wide(1 / rho),
            t_r=_wide(t_r),
            n_r=_wide(n_r),
            kappa=_wide(kappa),
            lam=_wide(lam.reshape(-1, 1)),
            G=_wide(G.reshape(-1, 1)),
            rho=_wide(self.constants.rho.reshape(-1, 1)),
            weights=energy_weights(self.transverse),
            stiff=(stiff * around)[:, :, None],
            heavy=(heavy * around)[:, :, None],
        )


def _wide(values: Array) -> Array:
    """Values (stations, heights) for all vectors and harmonics."""
    return values[:, :, None, None]
