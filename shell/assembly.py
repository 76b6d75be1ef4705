"""From a resonator to element matrices: unknowns, poles, clamps, and the ties between shell and solid blocks."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np
from scipy.sparse import csr_matrix

from shell.blocks import Mesh, Solid, Tie, constrain, mesh_solid, number_unknowns, surface_sides, tabulate
from shell.constraints import Index, Rows
from shell.corner import find_kinks, lay_clamped_edge, lay_clamped_face, lay_corner
from shell.eigen import Pattern, find_pattern
from shell.errors import ShellError
from shell.kernel import (
    Orders,
    Section,
    StrainTable,
    pair_mass,
    pair_stiffness,
    shell_table,
    station_mass,
    station_stiffness,
)
from shell.layout import Chain, End, lay_chain
from shell.meridian import Resonator
from shell.quadrature import Array, gauss, legendre, nodal
from shell.root import lay_root

Theory = Literal["solid", "shell", "rayleigh"]


@dataclass(frozen=True)
class Level:
    """Polynomial orders: (u, v, w) through the thickness, along the meridian, in blocks; rings around sharp corners."""

    through: Orders
    along: int
    block: int
    rings: int
    split: int = 1


PORTION = 16  # elements integrated at a time
TINY = 160  # unknowns of a dense matrix
SMALL = 0.5  # length over radius of a small element
_SOLID = ((5, 3), (6, 5), (8, 7), (10, 9), (12, 11))  # degree of blocks, rings around sharp corners
LEVELS: dict[str, tuple[Level, ...]] = {
    "solid": tuple(
        Level(through, along, *solid, split)
        for through, along, solid, split in zip(
            ((3, 3, 3), (5, 5, 4), (7, 7, 6), (9, 9, 8), (11, 11, 10)),
            (9, 12, 16, 20, 20),
            _SOLID,
            (1, 1, 1, 1, 2),
            strict=True,
        )
    ),
    "shell": tuple(
        Level((1, 1, 0), along, *solid, split)
        for along, solid, split in zip((8, 12, 16, 20, 20), _SOLID, (1, 1, 1, 1, 2), strict=True)
    ),
}


@dataclass(frozen=True, eq=False)
class ShellPart:
    """Where the elements of a chain lie: the chain, its sections at the stations, its ends."""

    chain: Chain
    section: Section


@dataclass(frozen=True, eq=False)
class SolidPart:
    """Where the cells of a solid part lie, and which of their sides (cell, side) are free or held surface."""

    mesh: Mesh
    surface: tuple[tuple[int, int], ...]


@dataclass(frozen=True, eq=False)
class Group:
    """Elements of one kind: their strain table, their unknowns with orientation signs, where they lie."""

    table: StrainTable
    unknowns: Index
    signs: Array
    place: ShellPart | SolidPart
    anchors: tuple[tuple[int, int], ...] = ()

    def matrices(self, integrate: Callable[[Array, Array], Array], stations: Array, first: int) -> Array:
        """Integrals over the elements from `first` on of their station matrices, in the unknowns that are solved for.

        In the small elements at a free edge these are the values at the inner node and differences from them: `anchors`
        are such (element, node). Else the layers' stiff shear would drown the bending as (R/h)³ instead of (R/h)².
        """
        found = integrate(stations, self.table.along)
        for element, node in self.anchors:
            if first <= element < first + len(stations):
                along = self.table.along.copy()
                along[0, :, node], along[1, :, node] = 1.0, 0.0
                found[element - first] = integrate(stations[[element - first]], along)[0]
        return found

    def spread(self, raw: Array) -> Array:
        """Unknowns (elements, size) of the plain basis."""
        unknowns = raw[self.unknowns]
        if isinstance(self.place, SolidPart):
            unknowns *= self.signs.reshape(self.signs.shape + (1,) * (raw.ndim - 1))
        for element, node in self.anchors:
            amplitudes = unknowns[element].reshape(self.table.along.shape[2], -1)
            inner = amplitudes[node].copy()
            amplitudes += inner
            amplitudes[node] = inner
        return np.asarray(unknowns)

    def gather(self, amplitudes: Array, raw: Array) -> None:
        """The way back for a shell: write `amplitudes` (elements, functions, amplitudes, columns) to the raw unknowns."""
        for element, node in self.anchors:
            inner = amplitudes[element, node].copy()
            amplitudes[element] -= inner
            amplitudes[element, node] = inner
        raw[self.unknowns] = amplitudes.reshape(*self.unknowns.shape, -1)


@dataclass(frozen=True, eq=False)
class System:
    """Every element of a resonator at one harmonic and level, with the constraints between raw and free unknowns.

    raw = constraint @ free. Matrices come per unit λ, G, ρ, so that a new material or temperature costs no geometry.
    """

    groups: tuple[Group, ...]
    constraint: csr_matrix
    rigid_motions: int
    n: int
    level: Level

    @cached_property
    def free(self) -> Index:
        """The raw unknown that each free one is: the first of those that follow it."""
        columns = self.constraint.tocsc()
        return np.asarray(columns.indices[columns.indptr[:-1]], dtype=np.intp)

    @property
    def pattern(self) -> Pattern:
        """The elements' free unknowns."""
        return self._elements[0]

    @property
    def maps(self) -> list["ToFree"]:
        """From the unknowns of every element to its free ones, in the order of `pattern`."""
        return self._elements[1]

    _maps = maps

    @cached_property
    def _elements(self) -> tuple[Pattern, list["ToFree"]]:
        counts = np.diff(self.constraint.indptr)
        column = np.full(len(counts), -1, dtype=np.intp)
        column[counts == 1] = self.constraint.indices[self.constraint.indptr[:-1][counts == 1]]
        follows = counts > 0
        follows[self.free] = False
        maps: list[ToFree] = []
        for group in self.groups:
            columns, tied = column[group.unknowns], np.any(follows[group.unknowns], axis=1)
            for members, own, signs, general in zip(group.unknowns, columns, group.signs, tied, strict=True):
                kept = np.flatnonzero(own >= 0)
                maps.append(self._free(members, signs) if general else ToFree(own[kept], kept, signs[kept]))
        pattern = find_pattern([at.free for at in maps], self.constraint.shape[1])
        return pattern, [at.reordered(order) for at, order in zip(maps, pattern.order, strict=True)]

    @property
    def is_small(self) -> bool:
        """Whether the matrices are worth keeping: below 24 MB."""
        return sum(len(at.free) ** 2 for at in self.maps) < 1e6

    @property
    def is_tiny(self) -> bool:
        """Whether one dense matrix costs less than the elements one by one."""
        return len(self.groups) == 1 and self.constraint.shape[1] <= TINY

    @cached_property
    def units(self) -> list[Array]:
        """Element matrices on free unknowns per unit λ, G and ρ, (3, size, size) each, the same material everywhere."""
        found: list[Array] = []
        for group, first, part, maps in self._portions():
            trace, shear = station_stiffness(part)
            kinds = (
                group.matrices(pair_stiffness, trace, first),
                group.matrices(pair_stiffness, shear, first),
                group.matrices(pair_mass, station_mass(part), first),
            )
            found += [at.collect(element) for *element, at in zip(*kinds, maps, strict=True)]
        return found

    @cached_property
    def whole(self) -> tuple[Pattern, list[Array]]:
        """The units of all elements as of one, of a small shell without solid parts: fewer and larger products."""
        size = self.pattern.size
        merged = np.zeros((3, size, size))
        for members, kinds in zip(self.pattern.unknowns, self.units, strict=True):
            merged[:, members[:, None], members] += kinds
        return find_pattern([np.arange(size)], size), [merged]

    def varying(self, lam: list[Array], G: list[Array], rho: list[Array]) -> tuple[list[Array], list[Array]]:
        """Stiffness and mass of every element with λ, G, ρ given at the stations of every group."""
        K: list[Array] = []
        M: list[Array] = []
        fields = iter(
            [
                (a[k : k + PORTION], b[k : k + PORTION], c[k : k + PORTION])
                for a, b, c in zip(lam, G, rho, strict=True)
                for k in range(0, len(a), PORTION)
            ]
        )
        for group, first, part, maps in self._portions():
            lam_there, G_there, rho_there = (field[..., None, None] for field in next(fields))
            trace, shear = station_stiffness(part)
            trace *= lam_there
            trace += G_there * shear
            stiffness = group.matrices(pair_stiffness, trace, first)
            mass = group.matrices(pair_mass, rho_there * station_mass(part), first)
            for k, m, at in zip(stiffness, mass, maps, strict=True):
                K.append(at.collect([k])[0])
                M.append(at.collect([m])[0])
        return K, M

    def _portions(self) -> Iterator[tuple[Group, int, StrainTable, list["ToFree"]]]:
        """A few elements at a time, so that the passing arrays stay small."""
        done = 0
        for group in self.groups:
            for k in range(0, len(group.unknowns), PORTION):
                part = group.table.part(slice(k, k + PORTION))
                count = len(part.volume)
                yield group, k, part, self.maps[done : done + count]
                done += count

    def spread(self, free: Array) -> list[Array]:
        """Element unknowns (elements, size) of every group from the free unknowns of one vector."""
        raw = self.constraint @ free
        return [group.spread(raw) for group in self.groups]

    def _free(self, members: Index, signs: Array) -> "ToFree":
        rows = self.constraint[members]
        free = np.unique(rows.indices).astype(np.intp)
        return ToFree(free, None, signs[:, None] * rows[:, free].toarray())


@dataclass(frozen=True, eq=False)
class ToFree:
    """From an element's unknowns to free ones: a choice with signs, or (kept None) a full matrix of factors."""

    free: Index
    kept: Index | None
    factors: Array

    def reordered(self, order: Index) -> "ToFree":
        """The same with the free unknowns in another order."""
        if self.kept is None:
            return ToFree(self.free[order], None, self.factors[:, order])
        return ToFree(self.free[order], self.kept[order], self.factors[order])

    def restrict(self, matrix: Array) -> Array:
        """The element's matrix on the free unknowns."""
        if self.kept is None:
            return np.asarray(self.factors.T @ matrix @ self.factors)
        return self._signed(matrix[self.kept[:, None], self.kept])

    def collect(self, pairs: list[Array]) -> Array:
        """Some matrices on the free unknowns from their integrals (functions², amplitudes²), (kinds, free, free)."""
        functions, m = (round(x**0.5) for x in pairs[0].shape)
        local = np.arange(functions * m) if self.kept is None else self.kept
        function, amplitude = np.divmod(local, m)
        rows, columns = (function * functions * m + amplitude) * m, function * m * m + amplitude
        where = rows[:, None] + columns
        found = np.empty((len(pairs), *where.shape))
        for matrix, integrals in zip(found, pairs, strict=True):
            integrals.ravel().take(where, out=matrix, mode="clip")  # this mode takes without a copy
        if self.kept is None:
            return np.asarray(self.factors.T @ found @ self.factors)
        return self._signed(found)

    def _signed(self, matrices: Array) -> Array:
        if np.any(self.factors < 0):
            matrices *= self.factors
            matrices *= self.factors[:, None]
        return matrices


@dataclass(frozen=True, eq=False)
class Layout:
    """Chains of shell elements, the solid parts, and for each solid part the (chain, end) that it ties."""

    chains: tuple[Chain, ...]
    solids: tuple[tuple[Solid, tuple[tuple[int, int], ...]], ...]


@lru_cache(maxsize=6)
def build_system(resonator: Resonator, n: int, theory: Theory, level: Level) -> System:
    """Lay out, number and tabulate a resonator; cached, since only the material changes with temperature."""
    layout = lay_resonator(resonator, n, level)
    groups: list[Group] = []
    rows = Rows()
    ends: dict[tuple[int, int], Tie] = {}
    size = 0
    for k, chain in enumerate(layout.chains):
        group, inner_rows, size = _shell_group(resonator, chain, n, level, size)
        groups.append(group)
        rows.extend(inner_rows)
        for side in (0, 1):
            ends[k, side] = _chain_end(resonator, chain, group, side, level.through)
            _hold_end(rows, chain.ends[side], ends[k, side], n)
    for solid, tied in layout.solids:
        mesh = mesh_solid(solid, level.block)
        ties = tuple(ends[at] for at in tied)
        rows.extend(constrain(mesh, solid, ties, level.block, n, size))
        numbers, signs, size = number_unknowns(mesh, level.block, size)
        place = SolidPart(mesh, surface_sides(mesh, ties))
        groups.append(Group(tabulate(mesh, solid, level.block, n), numbers, signs, place))
    held = resonator.support != "free"
    return System(tuple(groups), rows.matrix(size), 0 if held or n > 1 else 2, n, level)


def lay_resonator(resonator: Resonator, n: int, level: Level) -> Layout:
    """Divide the section: a solid root or clamped face first, then chains of shell with a solid corner at every kink."""
    start, first = 0.0, _free_or_pole(resonator.starts_on_axis)
    stop, last = resonator.length, _free_or_pole(resonator.ends_on_axis)
    solids: list[tuple[Solid, tuple[tuple[int, int], ...]]] = []
    kinks = find_kinks(resonator)
    whole_section = max(level.through) > 1  # a Naghdi shell is clamped as a line and has no singular corners there
    if resonator.support == "stem":
        root, start = lay_root(resonator, level.rings, n)
    elif resonator.support == "clamped-face":
        root, start = lay_clamped_face(resonator, level.rings)
    elif resonator.support == "clamped-pole" and whole_section:
        root, start = lay_clamped_edge(resonator, False, level.rings)
    if start:
        solids.append((root, ((0, 0),)))
        first = "tied"
    elif resonator.support == "clamped-pole":
        first = "clamped"
    if resonator.support == "clamped-rim":
        last = "clamped"
        if whole_section:
            rim, stop = lay_clamped_edge(resonator, True, level.rings)
            solids.append((rim, ((len(kinks), 1),)))
            last = "tied"
    chains: list[Chain] = []
    for joint in kinks:
        corner, (before, after) = lay_corner(resonator, joint, level.rings)
        if not before > start:
            raise ShellError("two solid corners or clamps of the meridian overlap: lengthen the segment between them.")
        chains.append(lay_chain(resonator, start, before, (first, "tied"), n, level.split))
        solids.append((corner, ((len(chains) - 1, 1), (len(chains), 0))))
        start, first = after, "tied"
    if not stop > start:
        raise ShellError("the clamps or corners of the meridian overlap: lengthen its last segment.")
    chains.append(lay_chain(resonator, start, stop, (first, last), n, level.split))
    return Layout(tuple(chains), tuple(solids))


def _free_or_pole(on_axis: bool) -> End:
    return "pole" if on_axis else "free"


def _shell_group(resonator: Resonator, chain: Chain, n: int, level: Level, start: int) -> tuple[Group, Rows, int]:
    """Tabulate one chain and number its unknowns, (node, amplitude) from `start`; see `_anchor` for the rows."""
    p, orders = level.along, level.through
    xi, weights = gauss(p + 2)
    eta = gauss(max(orders) + 2)
    section = _sections(resonator, chain, xi, weights)
    u, v, w = (legendre(order, eta[0]) for order in orders)
    table = shell_table(section, n, (u, v, w), eta, nodal(p, xi))
    elements, m = len(chain.segments), sum(orders) + 3
    nodes = p * np.arange(elements)[:, None] + np.arange(p + 1)
    unknowns = start + (nodes[:, :, None] * m + np.arange(m)).reshape(elements, -1)
    anchors, rows, fresh = _anchor(resonator, chain, unknowns, m, start + (elements * p + 1) * m)
    group = Group(table, unknowns, np.ones(unknowns.shape), ShellPart(chain, section), anchors)
    return group, rows, fresh


def _anchor(
    resonator: Resonator, chain: Chain, unknowns: Index, m: int, fresh: int
) -> tuple[tuple[tuple[int, int], ...], Rows, int]:
    """Choose the small elements at free edges that are solved in differences from their inner node.

    From the inside out, the inner node of the next one is the sum of the differences so far: it gets numbers of its own
    (from `fresh` on, changed in `unknowns`) and rows that say so. Returns the elements, the rows, and the next number.
    """
    elements = len(chain.segments)
    small = np.diff(chain.breaks) < SMALL * resonator.size
    anchors: list[tuple[int, int]] = []
    rows = Rows()
    for end, outwards in zip(chain.ends, (-1, 1), strict=True):
        if end != "free":
            continue
        edge = 0 if outwards < 0 else elements - 1
        most = elements // 2 if chain.ends == ("free", "free") else elements - 1
        run = [edge - outwards * k for k in range(most)]
        run = run[: next((k for k, element in enumerate(run) if not small[element]), most)]
        inner, outer = (slice(-m, None), slice(0, m)) if outwards < 0 else (slice(0, m), slice(-m, None))
        above: list[Index] = []  # what the outer end of the element before is the sum of
        for element in reversed(run):
            anchors.append((element, 0 if outwards > 0 else unknowns.shape[1] // m - 1))
            if above:
                unknowns[element, inner] = np.arange(fresh, fresh + m)
                for term in above:
                    rows.follow(unknowns[element, inner].copy(), term, np.ones(m))
                fresh += m
            else:
                above = [unknowns[element, inner].copy()]
            above.append(unknowns[element, outer].copy())
    return tuple(anchors), rows, fresh


def _chain_end(resonator: Resonator, chain: Chain, group: Group, side: int, orders: Orders) -> Tie:
    """The cross-section at one end of a chain and its unknowns."""
    place = resonator.at([chain.breaks[-side]], chain.segments[-side])
    m = sum(orders) + 3
    members = group.unknowns[0, :m] if side == 0 else group.unknowns[-1, -m:]
    return Tie(place, orders, tuple(int(k) for k in members))


def _hold_end(rows: Rows, end: End, tie: Tie, n: int) -> None:
    """Hold a clamped edge, or keep a pole regular: n = 0 only w; n = 1 the translation v = -t_r u; n > 1 nothing."""
    u, v, w = np.split(np.array(tie.unknowns), np.cumsum([tie.orders[0] + 1, tie.orders[1] + 1]))
    if end == "clamped" or (end == "pole" and n > 1):
        rows.hold(np.array(tie.unknowns))
    elif end == "pole" and n == 0:
        rows.hold(np.concatenate([u, v]))
    elif end == "pole":
        rows.hold(w)
        rows.follow(v, u, np.full(len(u), -float(np.round(tie.place.tangent_r[0]))))


def _sections(resonator: Resonator, chain: Chain, xi: Array, weights: Array) -> Section:
    names = ("r", "tangent_r", "tangent_z", "curvature", "thickness", "thickness_slope", "position")
    gathered: dict[str, list[Array]] = {name: [] for name in names}
    for one, two, segment in zip(chain.breaks, chain.breaks[1:], chain.segments, strict=False):
        points = resonator.at((one + two) / 2 + (two - one) / 2 * xi, segment)
        for name in names:
            gathered[name].append(getattr(points, name))
    halves = np.diff(np.array(chain.breaks)) / 2
    shape = (len(halves), len(xi))
    return Section(
        **{name: np.array(values) for name, values in gathered.items()},
        ds=np.broadcast_to(halves[:, None], shape),
        weight=np.broadcast_to(weights, shape),
    )


def _constraint(rows: Rows, size: int) -> csr_matrix:
    return rows.matrix(size)
