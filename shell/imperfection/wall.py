r"""What an imperfect wall has more than the perfect one: layers on its faces, a strip on its edge, a change of its material.

The displacements of the perfect wall, polynomials in the distance ζ from its middle surface, are taken as they are in all of
the imperfect one, so that its energies differ by those of what is there more (or less) alone,

    δK = ∫_layers σ : ε dV + ∫ δσ : ε dV,   δM = ∫_layers ρ u · u dV + ∫ δρ u · u dV,

a layer from the perfect face to the true one. Nothing cancels, and δK never exceeds a share of K, whatever the waves around.
The heights t_j in a layer are the same all around, and the departure d tells how much of it belongs to each of them,

    ∫_0^d f(t) dt = Σ_j w_j(d) f(t_j),   w_j(d) = ∫_0^d l_j(t) dt,   l_j Lagrange's polynomials on the t_j,

so that the waves of a vector meet those of the imperfection in the weights alone. The strains are those of the shell (shell.kernel) at any
height, in which the harmonic k is a factor, ε = (S_0 + k S_1) q.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, log

import numpy as np

from shell.elastic import COSINE, SINE, Constants
from shell.imperfection.field import Field, values_around
from shell.kernel import Section, energy_weights, shell_table, strains_by_order
from shell.quadrature import Array, Basis, gauss

HEIGHTS = 4  # of a layer, at most: exact to the third power of the height
MISSED = 1e-8  # what fewer heights may miss: of k of them a layer d of a wall h misses less than (d/h)^k
ALONG, AROUND = [0, 2], [1]  # displacements that vary as cos kθ and as sin kθ


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
    # strains, those that vary as cos kθ first, per unit of the section amplitudes, of their ξ-derivatives, and of k times the amplitudes,
    # (stations, 6 heights, 3 amplitudes)
    strain: Array
    moved: Array  # displacements likewise per unit of the section amplitudes, (3 heights, amplitudes)
    lam: Array  # λ, (stations, 1, 1, 1, 1) as ρ; G : times the weights of the strains in the energy, (stations, 6, 1, 1, 1)
    G: Array
    rho: Array
    stiff: Array  # stiff, heavy: volumes that count for the stiffness and for the mass, (stations, 1, heights, 1, θ)
    heavy: Array

    def respond(self, plain: Array, around: Around) -> tuple[Array, Array]:
        """δK and δM times unknowns of these elements in the layout of `Together.plain`, which go around so."""
        k = np.tile(around.order[:, 0], plain.shape[3])
        amplitudes = plain.reshape(*plain.shape[:3], -1)
        value, slope = ((one @ amplitudes).transpose(1, 2, 0, 3).reshape(-1, len(plain), len(k)) for one in self.along)
        shape = (self.stiff.shape[2], plain.shape[3], len(around.order))  # heights, vectors, 2 harmonics
        strain = (self.strain @ np.concatenate([value, slope, k * value], axis=1)).reshape(-1, 6, *shape)
        stress, force = self.G * strain, self.rho * (self.moved @ value).reshape(-1, 3, *shape)
        stress[:, :3] += self.lam * strain[:, :3].sum(axis=1, keepdims=True)
        for field, volumes, split in ((stress, self.stiff, len(COSINE)), (force, self.heavy, len(ALONG))):
            for part, turn in ((field[:, :split], around.cosine), (field[:, split:], around.sine)):
                _weigh(part, volumes, turn)
        loads = np.swapaxes(self.strain, 1, 2) @ stress.reshape(len(value), -1, len(k))
        by_value, by_slope, by_order = np.split(loads, 3, axis=1)
        stiff = self._along(0, by_value + k * by_order, plain) + self._along(1, by_slope, plain)
        return stiff, self._along(0, self.moved.T @ force.reshape(len(value), -1, len(k)), plain)

    def _along(self, order: int, loads: Array, plain: Array) -> Array:
        """Loads on the section amplitudes (stations, amplitudes, columns) on the elements' unknowns."""
        stations = self.along.shape[1]
        by_element = loads.reshape(-1, stations, *loads.shape[1:]).transpose(2, 0, 1, 3)
        return np.asarray(self.along[order].T @ by_element).reshape(plain.shape)


def _weigh(field: Array, volumes: Array, turn: Array) -> None:
    """∫ of amplitudes (stations, components, heights, vectors, 2 harmonics) times volumes, on the same waves, in place."""
    at = (field.reshape(-1, len(turn)) @ turn).reshape(*field.shape[:-1], -1)
    at *= volumes
    field[:] = (at.reshape(-1, turn.shape[1]) @ turn.T).reshape(field.shape)


@dataclass(frozen=True, eq=False)
class Stretch:
    """Elements of a chain: their section, material, functions along and orders through, and the azimuths."""

    section: Section
    constants: Constants
    elements: slice
    along: Basis
    orders: tuple[int, int, int]
    theta: Array

    def layers(self, faces: tuple[Field, Field], waves: tuple[int, ...], stiff: Array, heavy: Array) -> list[Wall]:
        """What the faces at η = -1 and 1 stand out of the perfect wall, m; stiff, heavy : 1 + changes of E and of ρ, (stations, 1, θ)."""
        eta, shares = [], []
        for sign, face in ((-1, faces[0]), (1, faces[1])):
            out = self.values(face, waves) / (self.section.thickness.reshape(-1, 1, 1) / 2)
            reach = float(np.abs(out).max())
            if reach > 0:
                count = min(HEIGHTS, ceil(log(MISSED) / log(min(0.1, reach / 2))))
                nodes, powers = gauss(count)[0], np.arange(1, count + 1)[:, None]
                # ∫_0^x of Lagrange's polynomials on the nodes, (stations, nodes, θ)
                lagrange = np.linalg.inv(np.vander(nodes, increasing=True)).T
                shares.append(reach * (lagrange @ ((out / reach) ** powers / powers)))
                eta.append(sign * (1 + reach * nodes))
        if not eta:
            return []
        share = np.concatenate(shares, axis=1)
        return [self._wall(np.concatenate(eta), share * stiff, share * heavy)]

    def change(self, stiff: Array, heavy: Array) -> Wall:
        """A change of E and of ρ, relative, (stations, 1, θ)."""
        eta, weights = gauss(max(self.orders) + 2)
        return self._wall(eta, weights[:, None] * stiff, weights[:, None] * heavy)

    def values(self, field: Field, waves: tuple[int, ...]) -> Array:
        """Values of a field, (stations, 1, θ)."""
        orders = [m for m in field.orders if m in waves]
        return values_around(field, orders, self.section.position.ravel(), self.theta)[:, None]

    def _wall(self, eta: Array, stiff: Array, heavy: Array) -> Wall:
        """At heights η, of which so much counts for the stiffness and for the mass, dη, (stations, heights, θ)."""
        still = shell_table(self.section, 0, self.orders, (eta, np.ones(len(eta))), self.along)
        stations, amplitudes = self.section.r.size, still.displacement.shape[-1]
        parts = still.strain, strains_by_order(still, self.section, eta)
        ordered = [np.reshape(one[:, :, COSINE + SINE], (stations, 6 * len(eta), -1)) for one in parts]
        volume = still.volume.reshape(stations, 1, -1, 1, 1) * (2 * np.pi / self.theta.size)
        lam, G, rho = (one.reshape(-1, 1, 1, 1, 1) for one in (*self.constants.lame, self.constants.rho))
        return Wall(
            self.elements, still.along, np.concatenate(ordered, axis=2),
            still.displacement[0, 0, ALONG + AROUND].reshape(-1, amplitudes),
            lam, G * energy_weights(still.transverse_shear)[COSINE + SINE, None, None, None], rho,
            volume * stiff[:, None, :, None], volume * heavy[:, None, :, None],
        )  # fmt: skip
