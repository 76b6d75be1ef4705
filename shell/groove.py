r"""Change of a pair's split by a real cut: the removed material, and the stress relieved beside it.

A cut takes the volume Ω off the mode u. Beside it the wall moves by v, which makes the new surface free of traction; tested
with u, the equations of the cut body give (T = ∫ ρ u² dV, λ = ω²)

    T δλ = -∫_Ω (σ : ε - λ ρ u²) dV - E,   E = ∫_rest σ(v) : ε(v) dV = f·v,   f = ∫_Ω (σ : ε(φ) - λ ρ u·φ) dV.

The first term is Hadamard's, exact for shallow, wide cuts. E, never negative, is what a narrow cut relieves: that of an edge
crack, to the second order of its depth. It is solved by statics for the wall from the cut to half way to its equal on the next
antinode, in quadratic hexahedra graded towards the cut's edges; u, σ are those of the mode. cos nθ and sin nθ about the cut's
mirror plane are solved apart; the split is half the difference of their δλ/λ.
"""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import scipy
from numpy.typing import NDArray

from shell.cross_section import cut
from shell.elastic import COSINE
from shell.errors import ShellError, mm
from shell.imperfection import Pair
from shell.kernel import TENSOR, energy_weights
from shell.quadrature import Array, at_gauss, gauss, nodal
from shell.resonator import Resonator
from shell.sparse import Index, assemble_elements, dissect, factor_symmetric

Face: TypeAlias = Literal["edge", "inner", "outer"]
REACH = {"edge": 16.0, "inner": 4.0, "outer": 4.0}  # wall thicknesses of the piece along the meridian
LARGEST = 8.0  # elements over the wall
GROWTH = 3.0  # of elements away from the cut's edges
FIRST = 0.3  # first element over the smallest half-dimension of the cut
SHALLOW = 0.01  # depth over the wall, below which E, then small, needs no finer ones
RELIEF_ERROR = 0.03
"""Standard error of E: 1 % off a face, up to 3.3 % too little off an edge (tests/reference/grooves.csv)."""
NORMAL = [2, 4, 5]  # stresses on a face


@dataclass(frozen=True)
class Groove:
    """A cut with sharp corners off the rim's edge, through the wall, or off a face, at a position 0 ... 1; lengths in m at the middle surface."""

    face: Face
    position: float
    width: float
    length: float
    depth: float


@dataclass(frozen=True)
class GrooveSplit:
    """Effect of one cut at the azimuth 0 on a pair, (f_cos - f_sin)/f by `layer` and stress `relief`; `mass` in kg, standard `error`."""

    mass: float
    layer: float
    relief: float
    error: float

    @property
    def wave(self) -> float:
        """Change of (f_cos - f_sin)/f."""
        return self.layer + self.relief


@dataclass(frozen=True, eq=False)
class _Grid:
    """Knots along s (m), θ (rad, from the mirror plane) and η (-1 ... 1), and which cells the cut takes, (s, θ, η)."""

    s: Array
    theta: Array
    eta: Array
    gone: NDArray[np.bool_]
    is_rim: bool


def solve_groove(pair: Pair, groove: Groove) -> GrooveSplit:
    """The change of the split by one cut."""
    resonator = pair.resonator
    grid = _lay_grid(resonator, groove, pair.mode.harmonic)
    nodes = _Nodes(resonator, grid)
    E = []
    material = cut(resonator, pair.solution.system, groove.position, np.zeros(1))
    c = pair.solution.constants[material.group]
    lam, G, rho = (float(np.mean(x[material.element])) for x in (*c.lame, c.rho))
    loads, layers, volume = _loads(pair, grid, nodes, lam, G, rho, groove.face)
    norm = 2 * np.pi * pair.scale
    layer = -(layers[0] - layers[1]) / norm
    turn = nodes.turn
    K = turn.T @ nodes.stiffness(lam, G) @ turn
    for kind in (0, 1):
        free = nodes.free(kind)
        load = (turn.T @ loads[kind])[free]
        answer = factor_symmetric(K[free][:, free], is_ordered=True)(load)
        E.append(2 * float(load @ answer))  # the other half of the piece
    error = RELIEF_ERROR * (E[0] + E[1]) / norm
    return GrooveSplit(rho * volume, layer, -(E[0] - E[1]) / norm, error)


def _lay_grid(resonator: Resonator, groove: Groove, n: int) -> _Grid:
    end = resonator.length
    place = resonator.at([groove.position * end])
    h, r = float(place.thickness[0]), float(place.r[0])
    if groove.face == "edge":
        one, two, deep = end - groove.depth, end, 2.0
    else:
        two = min(groove.position * end + groove.length / 2, end)
        one, deep = two - groove.length, 2 * groove.depth / h
        upper = resonator.height_of(groove.face) > 0
        if not 0 < deep < 2:
            raise ShellError(f"a cut of {mm(groove.depth)} goes through the wall of {mm(h)}.")
    if one <= 0 or not groove.depth > 0:
        raise ShellError(f"a cut of {mm(groove.length)} does not lie on the meridian.")
    at_rim = end - two < 1e-9 * end
    if not groove.width < np.pi * r / n:
        raise ShellError(f"a cut of {mm(groove.width)} is wider than half a wave of n = {n}.")
    far, side, coarse = REACH[groove.face] * h, groove.width / 2, LARGEST * h
    over, left = max(groove.depth, SHALLOW * h), h - groove.depth if deep < 2 else h
    fine = FIRST * min(over, (two - one) / (1 if at_rim else 2), side, left)
    start = max(one - far, 1e-3 * end)
    s = _beside(one, _graded(one - start, fine, 0, coarse), _graded(two - one, fine, not at_rim))
    last = min(end, two + far)
    is_rim = last > end - 0.3 * h
    if not at_rim:
        s = np.append(s, two + _graded((end if is_rim else last) - two, fine, 0, coarse)[1:])
    theta = _beside(side, _graded(side, fine, 0, coarse), _graded(r * np.pi / (2 * n) - side, fine, 0, coarse)) / r
    if deep == 2:
        eta = np.linspace(-1, 1, 4)
    else:
        eta = _beside(1 - deep, _graded(2 - deep, fine * 2 / h, 0), _graded(deep, fine * 2 / h, 0))
        eta = eta if upper else -eta[::-1]
    middle = [np.convolve(x, [0.5, 0.5], "valid") for x in (s, theta, eta)]
    along, around = (middle[0] > one) & (middle[0] < two), middle[1] < side / r
    through = np.ones(len(eta) - 1, dtype=bool)
    if deep < 2:
        through = middle[2] > 1 - deep if upper else middle[2] < deep - 1
    gone = along[:, None, None] & around[:, None] & through
    return _Grid(s, theta, eta, gone, is_rim or at_rim)


def _beside(place: float, below: Array, above: Array) -> Array:
    """Knots on both sides of a place, from their distances to it."""
    return np.concatenate([(place - below)[::-1], (place + above)[1:]])


def _graded(length: float, fine: float, both: bool | int, largest: float = np.inf) -> Array:
    """Knots 0 ... length whose steps grow from 0 (and from the other end)."""
    if both:
        half = _graded(length / 2, fine, False, largest)
        return np.concatenate([half, length - half[-2::-1]])
    steps, total = [min(fine, length)], min(fine, length)
    while total < length * (1 - 1e-9):
        steps.append(min(steps[-1] * GROWTH, largest))
        total += steps[-1]
    return np.concatenate([[0.0], np.cumsum(steps)]) * length / total


class _Nodes:
    """Nodes and elements of a grid, in Cartesian components."""

    def __init__(self, resonator: Resonator, grid: _Grid) -> None:
        knots = [np.interp(np.arange(2 * len(x) - 1) / 2, np.arange(len(x)), x) for x in (grid.s, grid.theta, grid.eta)]
        shape = tuple(len(x) for x in knots)
        self.shape, number = shape, np.arange(np.prod(shape)).reshape(shape)
        self.elements = np.lib.stride_tricks.sliding_window_view(number, (3, 3, 3))[::2, ::2, ::2].reshape(-1, 27)
        self.gone = grid.gone.ravel()
        rho, z = (np.broadcast_to(one[:, None], shape) for one in resonator.at(knots[0]).at_heights(knots[2]))
        theta = knots[1][None, :, None]
        self.points = np.stack([rho * np.cos(theta), rho * np.sin(theta), z], axis=-1).reshape(-1, 3)
        used, held = np.zeros(number.size, dtype=bool), np.zeros(shape, dtype=bool)
        used[self.elements[~self.gone].ravel()] = True
        held[0], held[-1] = True, not grid.is_rim
        self.moving = used & ~held.ravel()
        ends = np.zeros((2, *shape), dtype=bool)
        ends[0, :, 0] = ends[1, :, -1] = True
        self.ends = ends.reshape(2, -1)
        self.theta = np.broadcast_to(theta, shape).ravel()

    def free(self, kind: int) -> Index:
        """Unknowns, three a node along the radius, circle and axis, of cos nθ (0) or sin nθ (1), between its mirror planes, dissected."""
        free = np.repeat(self.moving[:, None], 3, axis=1)
        even, odd = self.ends[::-1] if kind else self.ends
        free[even, 1] = False
        free[np.ix_(odd, [0, 2])] = False
        found = np.flatnonzero(free)
        return found[dissect(np.stack(np.unravel_index(found // 3, self.shape), axis=1))]

    @property
    def turn(self) -> "scipy.sparse.csc_matrix":
        """Cartesian components from those along the radius, circle and axis."""
        c, s, one = np.cos(self.theta), np.sin(self.theta), np.ones_like(self.theta)
        k = 3 * np.arange(len(c))
        rows, columns = np.concatenate([k, k, k + 1, k + 1, k + 2]), np.concatenate([k, k + 1, k, k + 1, k + 2])
        return scipy.sparse.csc_matrix((np.concatenate([c, -s, s, c, one]), (rows, columns)))

    def slopes(self, which: Index) -> tuple[Array, Array]:
        """∂φ_f/∂x_i of the functions of elements, (elements, points, 3, 27), and volumes (elements, points)."""
        line, w = at_gauss(nodal, 2, 3), gauss(3)[1]
        parts = [
            np.einsum("ai,bj,ck->abcijk", *(line.slopes if axis == d else line.values for axis in range(3)))
            for d in range(3)
        ]
        D = np.stack([part.reshape(27, 27) for part in parts], axis=1)  # points, 3, functions
        X = self.points[self.elements[which]]
        J = np.einsum("pdf,efx->epdx", D, X)
        volume = abs(np.linalg.det(J)) * np.einsum("a,b,c->abc", w, w, w).ravel()
        return np.linalg.solve(J, np.broadcast_to(D, (len(X), *D.shape))), volume

    def stiffness(self, lam: float, G: float) -> "scipy.sparse.csc_matrix":
        """Of what is left, ∫ λ ∂_i φ_f ∂_j φ_g + G (∂_j φ_f ∂_i φ_g + δ_ij ∂_k φ_f ∂_k φ_g) dV between φ_f along i and φ_g along j."""
        slopes, volume = self.slopes(np.flatnonzero(~self.gone))
        size = len(slopes)
        flat = slopes.reshape(size, 27, 81)
        products = (np.swapaxes(flat * volume[..., None], 1, 2) @ flat).reshape(size, 3, 27, 3, 27)  # i, f, j, g
        K = lam * products + G * np.swapaxes(products, 1, 3)
        for i in range(3):
            K[:, i, :, i] += G * np.einsum("ekfkg->efg", products)
        unknowns = (3 * self.elements[~self.gone][:, None] + np.arange(3)[:, None]).reshape(size, 81)
        return assemble_elements(unknowns, K, 3 * len(self.points))


def _loads(
    pair: Pair, grid: _Grid, nodes: _Nodes, lam: float, G: float, rho: float, face: Face
) -> tuple[Array, Array, float]:
    """The forces f of both modes, ∫_Ω (σ : ε - λ ρ u²) of both, and the volume, of the whole cut.

    The modes leave a traction of 1e-3 of the stress on a face that is free: it is taken off, or a wide, shallow cut would seem to be pulled.
    """
    resonator, solution, n = pair.resonator, pair.solution, pair.mode.harmonic
    values, x = at_gauss(nodal, 2, 3).values, gauss(3)[0]
    functions = np.einsum("ai,bj,ck->abcijk", values, values, values).reshape(3, 3, 3, 27)
    gone = np.flatnonzero(nodes.gone)
    slopes, volume = nodes.slopes(gone)
    slopes, weight = slopes.reshape(-1, 3, 3, 3, 3, 27), volume.reshape(-1, 3, 3, 3)  # elements, points along s, θ, η

    def points(knots: Array, cell: Index) -> Array:
        return np.asarray((knots[cell, None] * (1 - x) + knots[cell + 1, None] * (1 + x)) / 2)

    s, theta, eta = map(points, (grid.s, grid.theta, grid.eta), np.unravel_index(gone, grid.gone.shape))
    stations, at_s = np.unique(s, return_inverse=True)
    heights, at_eta = np.unique(eta, return_inverse=True)
    if face != "edge":
        heights = np.append(heights, resonator.height_of(face))  # the free face, last
    cuts = [cut(resonator, solution.system, min(one / resonator.length, 1.0), heights) for one in stations]
    e, d = (np.array([getattr(one, name)(solution.unknowns) for one in cuts]) for name in ("strains", "displacements"))
    stress = G * energy_weights()[:, None] * e
    stress[:, :3] += lam * e[:, :3].sum(axis=1, keepdims=True)
    if face != "edge":
        stress[:, NORMAL] -= stress[:, NORMAL, -1:]
    at = at_s.reshape(-1, 3, 1, 1), at_eta.reshape(-1, 1, 1, 3)
    stress, e, d = (np.moveaxis(field, 1, -1)[at] for field in (stress, e, d))
    place, zero, one = resonator.at(stations), np.zeros(len(stations)), np.ones(len(stations))
    t_r, t_z, cosine, sine, none = place.tangent_r, place.tangent_z, np.cos(theta), np.sin(theta), np.zeros(theta.shape)
    section = np.moveaxis(
        np.array([[t_r, zero, t_z], [zero, one, zero], [-t_z, zero, t_r]]), 2, 0
    )  # s, θ, ζ in r, θ, z
    around = np.array([[cosine, sine, none], [-sine, cosine, none], [none, none, none + 1]])  # these in x, y, z
    Q = section[at[0]] @ np.moveaxis(around, (2, 3), (0, 1))[:, None, :, None]
    loads, layers = np.zeros((2, 3 * len(nodes.points))), np.zeros(2)
    c, s = (wave(n * theta)[:, None, :, None, None] for wave in (np.cos, np.sin))
    for kind, (even, odd) in enumerate(((c, s), (s, -c))):
        factor = np.where(np.isin(np.arange(6), COSINE), even, odd)
        moved = d * np.where([True, False, True], even, odd)
        energy = (stress * e * factor**2).sum(axis=-1) - solution.eigenvalue * rho * (moved**2).sum(axis=-1)
        layers[kind] = 2 * float(np.sum(energy * weight))
        turned = np.swapaxes(Q, -1, -2) @ (stress * factor)[..., TENSOR] @ Q
        force = solution.eigenvalue * rho * (moved[..., None, :] @ Q)[..., 0, :]
        push = np.einsum("eabcij,eabcjf,eabc->efi", turned, slopes, weight, optimize=True)
        push -= np.einsum("eabci,abcf,eabc->efi", force, functions, weight, optimize=True)
        np.add.at(loads[kind], 3 * nodes.elements[gone][:, :, None] + np.arange(3), push)
    return loads, layers, 2 * float(volume.sum())
