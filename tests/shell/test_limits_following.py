"""A mode keeps its name by its shape: through crossings within a harmonic, past repeated roots, or it is said to have vanished."""

import dataclasses

import numpy as np
import pytest

from shell.cross_section import cut
from shell.elastic import Elastic
from shell.errors import ShellError
from shell.following import follow, likeness
from shell.meridian import cylinder
from shell.modes import solve_modes
from tests.shell.samples import DOME, SILICA

METAL = Elastic(190e9, 0.3, 8000.0)


def solve_tube(n, heights):
    """Modes of a cylinder on the way from one height to another."""

    def solve(place, count):
        height = heights[0] + place * (heights[1] - heights[0])
        body = cylinder(12.5e-3, 0.6e-3, height, bottom_thickness=1e-3, clamp_radius=3e-3)
        return solve_modes(body, METAL, n, count, "shell", 1e-3)

    return solve


def test_a_shape_is_like_itself_and_unlike_the_others():
    for n in (0, 1, 2):
        modes = solve_modes(DOME, SILICA, n, 3, "shell", 1e-3)
        assert likeness(modes[0], modes[0]) == pytest.approx(1.0)
        assert max(likeness(modes[0], one) for one in modes[1:]) < 0.5


def test_twist_and_stretch_cross_and_keep_their_names():
    # twist does not mix with the axial motion of n = 0, so these two cross: the second twist comes below the second axial mode
    solve = solve_tube(0, (30e-3, 42e-3))
    before, after = solve(0.0, 3), solve(1.0, 3)
    assert [m.label for m in before] == ["axial", "torsion", "axial"]
    assert [m.label for m in after] == ["axial", "torsion", "torsion"]
    followed = follow(solve, before[2])
    assert (followed.label, followed.index) == ("axial", 3)
    assert follow(solve, before[1]).index == 1


def is_even(mode):
    """Whether the radial motion is the same at both ends of a tube."""
    ends = [[cut(mode.resonator, mode.solution.system, s, np.zeros(1)).displacements(mode.solution.unknowns)[:, 0]
             for s in (place, 1 - place)] for place in (0.05, 0.2, 0.35)]  # fmt: skip
    return sum(one @ (other * [-1.0, 1.0, 1.0]) for one, other in ends) > 0


@pytest.mark.parametrize(
    ("tube", "ratio", "n", "heights", "start", "end"),
    [((20e-3, 1.06e-3), 0.33, 1, (32e-3, 73e-3), 1, 0), ((10e-3, 0.55e-3), 0.17, 2, (6.3e-3, 13.1e-3), 3, 2)],
)
def test_even_and_odd_modes_of_a_tube_cross(tube, ratio, n, heights, start, end):
    """They do not mix: the k-th even one stays the k-th even one (of drawn tubes: tests/benchmarks/crossings.py of 425c9816)."""

    def solve(place, count):
        height = heights[0] + place * (heights[1] - heights[0])
        return solve_modes(cylinder(*tube, height), Elastic(70e9, ratio, 2500.0), n, count, "shell", 1e-4)

    before, after = solve(0.0, 4), solve(1.0, 4)
    kind = is_even(before[start])
    assert is_even(after[end]) == kind
    assert sum(is_even(one) == kind for one in before[:start]) == sum(is_even(one) == kind for one in after[:end])
    assert follow(solve, before[start]).index == end


def test_a_design_far_away_is_reached_step_by_step():
    solve = solve_tube(2, (8e-3, 40e-3))
    assert follow(solve, solve(0.0, 1)[0]).index == 0


def test_of_a_repeated_root_one_shape_is_found():
    solve = solve_tube(0, (30e-3, 30e-3))
    known, twin = solve(0.0, 2)
    mixed = [dataclasses.replace(one, frequency=known.frequency * (1 + 1e-6 * one.index)) for one in (twin, known)]
    assert follow(lambda place, count: mixed, known).label == known.label


def test_a_mode_that_vanishes_is_named():
    axial, torsion = solve_tube(0, (30e-3, 30e-3))(0.0, 2)
    with pytest.raises(ShellError, match="vanished or changed its shape"):
        follow(lambda place, count: [torsion], axial)
