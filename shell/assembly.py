"""From a resonator to its system of elements: layout, unknowns, poles, clamps, ties between shell and solid parts."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from shell.blocks import Mesh, Solid, Tie, constrain, find_boundary, hold_on_axis, mesh_solid, number_functions
from shell.cells import CellTable, at_gauss_points, tabulate_cells
from shell.corner import find_kinks, lay_clamped_edge, lay_clamped_face, lay_corner
from shell.errors import ShellError, mm
from shell.kernel import Section, shell_table
from shell.layout import OTHERS, Chain, End, Level, lay_chain
from shell.points import MiddleSurface
from shell.quadrature import Array, at_gauss, gauss, nodal
from shell.resonator import Resonator
from shell.root import lay_root
from shell.sparse import Index, Rows
from shell.system import Group, ShellGroup, SolidGroup, System


@dataclass(frozen=True, eq=False)
class Layout:
    """Chains of shell elements, the solid parts, and for each solid part the (chain, end) that it ties."""

    chains: tuple[Chain, ...]
    solids: tuple[tuple[Solid, tuple[tuple[int, int], ...]], ...]


@lru_cache(maxsize=16)
def build_system(resonator: Resonator, n: int, level: Level, alongside: tuple[int, ...] = ()) -> System:
    """Lay out, number and tabulate a resonator, in elements that suit the harmonics `alongside` too and are the same for all of them.

    It is kept for the next material or temperature, since only the material changes with them.
    """
    return assemble(resonator, lay_resonator(resonator, n, level, alongside), n, level)


def assemble(resonator: Resonator, layout: Layout, n: int, level: Level) -> System:
    """Number and tabulate the elements of a layout, its own or one that was extended."""
    groups: list[Group] = []
    rows = Rows()
    ends: dict[tuple[int, int], Tie] = {}
    size = 0
    for k, chain in enumerate(layout.chains):
        elements, inner_rows, size = _shell_group(resonator, chain, n, level, size)
        groups.append(elements)
        rows.extend(inner_rows)
        for side in (0, 1):  # the cross-section at one end of a chain and its unknowns
            place, m = resonator.at([chain.breaks[-side]], chain.segments[-side]), sum(level.through) + 3
            members = elements.unknowns[0, :m] if side == 0 else elements.unknowns[-1, -m:]
            ends[k, side] = Tie(place, level.through, tuple(members.tolist()))
            _hold_end(rows, chain.ends[side], ends[k, side], n)
    for solid, tied in layout.solids:
        mesh = mesh_solid(solid, level.block)
        ties = tuple(ends[at] for at in tied)
        cells, inner_rows, size = solid_group(mesh, solid, ties, n, level.block, size)
        groups.append(cells)
        rows.extend(inner_rows)
    rigid_motions = 2 if resonator.support == "free" and n < 2 else 0
    return System(tuple(groups), rows.matrix(size), rigid_motions, n, level)


@lru_cache(maxsize=12)
def lay_resonator(resonator: Resonator, n: int, level: Level, alongside: tuple[int, ...] = ()) -> Layout:
    """Divide the section: a solid root or clamped face first, then chains of shell with a solid corner at every kink."""
    model = lay_resonator(level.like, n, replace(level, like=None), alongside) if level.like else None
    lowest, highest = min(n, *alongside, n), max(n, *alongside, n)
    start, stop = 0.0, resonator.length
    first: End = "pole" if resonator.starts_on_axis else "free"
    last: End = "pole" if resonator.ends_on_axis else "free"
    solids: list[tuple[Solid, tuple[tuple[int, int], ...]]] = []
    kinks = find_kinks(resonator)
    if model and len(model.chains) != 1 + len(kinks):
        raise ShellError(f"{OTHERS}: its meridian has other kinks.")
    models = iter(model.chains if model else [None] * (1 + len(kinks)))
    whole_section = max(level.through) > 1  # a Naghdi shell is clamped as a line and has no singular corners there
    if resonator.support == "stem":
        root, start = lay_root(resonator, level, 2 if lowest > 1 else 1)
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
        corner, (before, after) = lay_corner(resonator, joint, level.rings, not whole_section)
        if not before > start:
            raise ShellError(
                f"the corner or clamp that ends at {mm(start)} of the meridian overlaps the next, which begins at {mm(before)}: lengthen the segment between them or make the clamp shorter."
            )
        chains.append(lay_chain(resonator, start, before, (first, "tied"), highest, level, next(models)))
        solids.append((corner, ((len(chains) - 1, 1), (len(chains), 0))))
        start, first = after, "tied"
    if not stop > start:
        raise ShellError(f"the corner or clamp that ends at {mm(start)} of the meridian overlaps the one that begins at {mm(stop)}: lengthen the last segment.")  # fmt: skip
    chains.append(lay_chain(resonator, start, stop, (first, last), highest, level, next(models)))
    return Layout(tuple(chains), tuple(solids))


def solid_group(
    mesh: Mesh, solid: Solid, ties: tuple[Tie, ...], n: int, degree: int, start: int
) -> tuple[SolidGroup, Rows, int]:
    """Tabulate the cells of one solid part and number their unknowns, (function, component) from `start`."""
    boundary = find_boundary(mesh, solid, ties)
    rows = constrain(mesh, boundary, ties, degree, n, start)
    numbers, signs, count = number_functions(mesh, degree)
    unknowns = start + (3 * numbers[:, :, None] + np.arange(3)).reshape(len(numbers), -1)
    table = replace(_tabulate(mesh, degree, solid.position), n=n)
    return SolidGroup(table, unknowns, mesh, boundary, signs), rows, start + 3 * count


@lru_cache(maxsize=12)  # the same for every harmonic
def _tabulate(mesh: Mesh, degree: int, position: float) -> CellTable:
    return tabulate_cells(mesh.grid, at_gauss_points(degree, degree, degree + 2), 0, position)


@lru_cache(maxsize=12)  # the same for every harmonic
def _stations(resonator: Resonator, chain: Chain, degree: int) -> Section:
    return sections(resonator, chain, *gauss(degree + 2))


def _shell_group(resonator: Resonator, chain: Chain, n: int, level: Level, start: int) -> tuple[ShellGroup, Rows, int]:
    """Tabulate one chain and number its unknowns, (node, amplitude) from `start`; see `_anchor` for the rows."""
    p, section = level.along, _stations(resonator, chain, level.along)
    table = shell_table(section, n, level.through, gauss(max(level.through) + 2), at_gauss(nodal, p, p + 2))
    elements, m = len(chain.segments), sum(level.through) + 3
    nodes = p * np.arange(elements)[:, None] + np.arange(p + 1)
    unknowns = start + (nodes[:, :, None] * m + np.arange(m)).reshape(elements, -1)
    anchors, rows, fresh = _anchor(chain, unknowns, m, start + (elements * p + 1) * m)
    group = ShellGroup(table, unknowns, chain, section, anchors)
    return group, rows, fresh


def _anchor(chain: Chain, unknowns: Index, m: int, fresh: int) -> tuple[tuple[tuple[int, int], ...], Rows, int]:
    """Choose the small elements at free edges solved in differences from their inner node; return them, their rows and the next number."""
    elements = len(chain.segments)
    anchors: list[tuple[int, int]] = []
    rows = Rows()
    for end, outwards in zip(chain.ends, (-1, 1), strict=True):
        if end != "free":
            continue
        edge = 0 if outwards < 0 else elements - 1
        most = elements // 2 if chain.ends == ("free", "free") else elements - 1
        run = [edge - outwards * k for k in range(most)]
        run = run[: next((k for k, element in enumerate(run) if not chain.small[element]), most)]
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


def _hold_end(rows: Rows, end: End, tie: Tie, n: int) -> None:
    """Hold a clamped edge, or keep a pole regular, where a translation is v = -t_r u."""
    if end == "clamped":
        rows.hold(np.array(tie.unknowns))
    elif end == "pole":
        u, v, w = np.split(np.array(tie.unknowns), np.cumsum([tie.orders[0] + 1, tie.orders[1] + 1]))
        hold_on_axis(rows, n, u, v, w, -float(np.round(tie.place.tangent_r[0])))


def sections(resonator: Resonator, chain: Chain, xi: Array, weights: Array) -> Section:
    """The middle surface at ξ of every element of a chain."""
    breaks = np.array(chain.breaks)
    halves = np.diff(breaks) / 2
    s = (breaks[:-1] + halves)[:, None] + halves[:, None] * xi
    points = resonator.at(s.ravel(), np.repeat(chain.segments, len(xi)))
    surface = {name: getattr(points, name).reshape(s.shape) for name in MiddleSurface.__dataclass_fields__}
    return Section(**surface, ds=np.broadcast_to(halves[:, None], s.shape), weight=np.broadcast_to(weights, s.shape))
