"""Grooves against an independent three-dimensional model, and against the limits of shallow, wide cuts."""

import csv
from pathlib import Path

import pytest

from shell.elastic import Elastic
from shell.groove import Groove, solve_groove
from shell.imperfection import Pair
from shell.modes import solve_modes
from tests.shell.samples import DOME

SILICA = Elastic(72.6283391332881e9, 0.1663662749173554, 2203.0)
REFERENCE = Path(__file__).parents[1] / "reference" / "grooves.csv"
CUTS = list(csv.DictReader(line for line in REFERENCE.read_text(encoding="utf-8").splitlines() if line[0] != "#"))
TRIED = [CUTS[k] for k in (1, 3, 6, 7)]
"""Of the edge and both faces; the last two were solved after the stated error had been chosen."""


@pytest.fixture(scope="module")
def pair():
    return Pair(solve_modes(DOME, SILICA, 2)[0])


@pytest.mark.parametrize(
    "row", [pytest.param(row, marks=[pytest.mark.slow] * (row["face"] != "edge" or row["width_mm"] == "2.0"), id=f"{row['face']}-{row['position']}-{row['width_mm']}-{row['depth_um']}") for row in TRIED]
)  # fmt: skip
def test_a_real_groove_lies_in_the_interval(pair, row):
    """NGSolve with the real cut (tests/reference/grooves.csv) lies within the stated 90 % interval."""
    width, length, depth = (1e-3 * float(row["width_mm"]), 1e-3 * float(row["length_mm"] or 1), 1e-6 * float(row["depth_um"]))  # fmt: skip
    found = solve_groove(pair, Groove(row["face"], float(row["position"]), width, length, depth))
    four, true = 4 * pair.mode.frequency, float(row["order4_Hz"])
    assert 4e9 * found.mass == pytest.approx(float(row["mass_ug"]), rel=1e-3)
    assert abs(four * found.wave - true) < 1.645 * four * found.error


@pytest.mark.slow
def test_a_shallow_wide_cut_is_the_shape_derivative(pair):
    """Hadamard's formula is exact as depth over width goes to 0: the relieved share falls in proportion."""
    shares = []
    for depth in (20e-6, 5e-6):
        found = solve_groove(pair, Groove("edge", 1.0, 4e-3, 1e-3, depth))
        shares.append(abs(found.relief / found.layer))
    assert shares[1] < 0.5 * shares[0] < 0.05
    assert found.layer / found.mass == pytest.approx(-pair.edging()[1], rel=0.1)


@pytest.mark.slow
def test_a_shallow_wide_cut_off_a_face_relieves_by_its_depth_squared(pair):
    """E is of second order in the depth; a traction that a mode leaves on a free face made it stay as the depth went to 0."""
    deep, half = (solve_groove(pair, Groove("inner", 1.0, 5e-3, 3e-3, depth)) for depth in (80e-6, 40e-6))
    assert 3.3 < deep.relief / half.relief < 4.0
