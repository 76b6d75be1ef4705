"""The cells of roots of stems: none folded, edge to edge, and together the volume that Pappus gives."""

from math import atan2, cos, hypot, pi, sin, sqrt

import numpy as np
import pytest

from shell.blocks import Solid, mesh_solid
from shell.cells import at_gauss_points, tabulate_cells
from shell.errors import ShellError
from shell.layout import LEVELS
from shell.meridian import hemisphere
from shell.modes import solve_modes
from shell.patches import Patch, rings, straight, whole
from shell.resonator import Resonator, Stem
from shell.root import lay_root
from tests.shell.samples import SILICA

R = 15e-3
Spot = tuple[float, float]


def turned(points: list[tuple[Spot, Spot, Spot | None]]) -> float:
    """Volume (m³) inside a closed outline of lines and arcs (start, end, centre) turned around the axis: π ∮ r² dz."""
    x, w = np.polynomial.legendre.leggauss(40)
    x, w = (x + 1) / 2, w / 2
    volume = 0.0
    for (r_1, z_1), (r_2, z_2), center in points:
        if center is None:
            r, dz = r_1 + (r_2 - r_1) * x, np.full_like(x, z_2 - z_1)
        else:
            one, two = (atan2(z - center[1], r - center[0]) for r, z in ((r_1, z_1), (r_2, z_2)))
            turn = (two - one + pi) % (2 * pi) - pi
            radius, psi = hypot(r_1 - center[0], z_1 - center[1]), one + turn * x
            r, dz = center[0] + radius * np.cos(psi), radius * turn * np.cos(psi)
        volume += float(w @ (r**2 * dz))
    return abs(pi * volume)


def face_with_stem(h: float, stem: Stem, face: int, end: float, collar: float) -> list[tuple[Spot, Spot, Spot | None]]:
    """From the end of the stem on the axis over its side and fillet along one face of the dome to the collar."""
    radius, a, f = R + face * h / 2, stem.radius, stem.fillet
    z = sqrt((radius + face * f) ** 2 - (a + f) ** 2)  # the fillet's centre is f beyond the face and f beside the stem
    on_dome = ((a + f) * radius / (radius + face * f), z * radius / (radius + face * f))
    rim = (radius * sin(collar / R), radius * cos(collar / R))
    return [
        ((0.0, end), (a, end), None),
        ((a, end), (a, z), None),
        *([((a, z), on_dome, (a + f, z))] if f else []),
        (on_dome, rim, (0.0, 0.0)),
    ]


def pappus(h: float, stem: Stem, collar: float) -> float:
    """Volume of stem and dome within the collar."""
    lines = []
    for face in (-1, 1):
        end = dict(stem.roots).get(face)  # type: ignore[call-overload]
        radius = R + face * h / 2
        rim = (radius * sin(collar / R), radius * cos(collar / R))
        bare: list[tuple[Spot, Spot, Spot | None]] = [((0.0, radius), rim, (0.0, 0.0))]
        lines.append(bare if end is None else face_with_stem(h, stem, face, end, collar))
    inner, outer = lines
    return turned([*inner, (inner[-1][1], outer[-1][1], None), *((b, a, c) for a, b, c in outer[::-1])])


def stemmed(h: float, stem: Stem) -> Resonator:
    return hemisphere(R, h, support="stem", stem=stem)


@pytest.mark.parametrize("fillet", [0.0, 0.2e-3, 1e-3])
@pytest.mark.parametrize("h", [1.5e-3, 0.25e-3, 0.03e-3])
@pytest.mark.parametrize(("side", "ends"), [("inner", -5e-3), ("outer", 25e-3), ("both", (-5e-3, 25e-3))])
def test_root_fills_its_outline(side: str, ends: float, h: float, fillet: float) -> None:
    stem = Stem(3.5e-3, ends, fillet, side)  # type: ignore[arg-type]
    root, collar = lay_root(stemmed(h, stem), LEVELS["solid"][0], 1)
    mesh = mesh_solid(root, 14)  # refuses cells that do not join edge to edge
    table = tabulate_cells(mesh.grid, at_gauss_points(2, 14, 18), 1, root.position)  # refuses folded cells
    assert 2 * pi * table.volume.sum() == pytest.approx(pappus(h, stem, collar), rel=1e-12)


@pytest.mark.slow
def test_random_roots_are_conforming_and_never_folded() -> None:
    rng = np.random.default_rng(31)
    for _ in range(60):
        h, a = R * 10 ** rng.uniform(-3, -0.9), R * rng.uniform(0.05, 0.4)
        side = ("inner", "outer", "both")[rng.integers(3)]
        inner, outer = -R * rng.uniform(0, 1), R * rng.uniform(1.5, 2)
        ends = {"inner": inner, "outer": outer, "both": (inner, outer)}[side]
        fillet = rng.integers(2) * a * rng.uniform(0.02, 0.5)
        dome = stemmed(h, Stem(a, ends, fillet, side))  # type: ignore[arg-type]
        root, collar = lay_root(dome, LEVELS["solid"][0], 2)
        mesh = mesh_solid(root, 12)
        table = tabulate_cells(mesh.grid, at_gauss_points(2, 12, 14), 2, root.position)
        assert 2 * pi * table.volume.sum() == pytest.approx(pappus(h, dome.stem, collar), rel=1e-9)  # type: ignore[arg-type]


def test_a_stem_on_both_sides_with_a_fillet_is_one_body() -> None:
    """Both values by NGSolve, finite elements of order 6 in the section (tests/benchmarks/fourier_ngsolve.py of 722ba988), from above."""
    both = stemmed(0.5e-3, Stem(3e-3, (-5e-3, 25e-3), 0.6e-3, "both"))
    for n, reference in ((2, 2745.679), (1, 3414.68)):
        (mode,) = solve_modes(both, SILICA, n)
        assert mode.frequency == pytest.approx(reference, rel=1e-5)


def test_the_core_of_a_thin_dome_under_an_outer_stem() -> None:
    """The value again by NGSolve: 1478.0343 from above."""
    outer = stemmed(0.25e-3, Stem(3.5e-3, 25e-3, 0.0, "outer"))
    (mode,) = solve_modes(outer, SILICA, 2)
    (finer,) = solve_modes(outer, SILICA, 2, tolerance=2e-7)
    assert mode.frequency == pytest.approx(finer.frequency, rel=1e-5)
    assert mode.frequency == pytest.approx(1478.034, rel=1e-5)


def test_cells_that_overlap_or_do_not_meet_are_refused() -> None:
    square = Patch(
        straight((1, 0), (2, 0)),
        straight((1, 1), (2, 1)),
        straight((1, 0), (1, 1)),
        straight((2, 0), (2, 1)),
        whole(),
        "root",
    )
    above = Patch(
        straight((1, 1), (2, 1)),
        straight((1, 2), (2, 2)),
        straight((1, 1), (1, 2)),
        straight((2, 1), (2, 2)),
        rings((1, 0.2)),
        "root",
    )
    with pytest.raises(ShellError, match="edge to edge"):
        mesh_solid(Solid((square, above), lambda r, z: False, 0.5), 4)
    folded = Patch(
        straight((1, 0), (2, 0)),
        straight((1, 1), (1.2, -0.5)),
        straight((1, 0), (1, 1)),
        straight((2, 0), (1.2, -0.5)),
        whole(),
        "root",
    )
    mesh = mesh_solid(Solid((folded,), lambda r, z: False, 0.5), 4)
    with pytest.raises(ShellError, match="overlap"):
        tabulate_cells(mesh.grid, at_gauss_points(2, 4, 6), 1, 0.5)


def test_an_outer_stem_has_to_clear_the_pole() -> None:
    with pytest.raises(ShellError, match="not clear of the dome"):
        stemmed(0.25e-3, Stem(3.5e-3, 15.3e-3, 0.0, "outer"))
