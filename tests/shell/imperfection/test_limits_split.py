"""What must hold exactly or to known order: symmetry, invariance, agreement of first order and coupled solve."""

from math import pi

import numpy as np
import pytest

from shell.imperfection import CoupledHarmonics, Imperfection, Pair, PointMass, find_split, wave
from shell.meridian import hemisphere
from shell.modes import solve_modes
from shell.resonator import Stem
from tests.shell.samples import DOME, SILICA, H, R


@pytest.fixture(scope="module")
def coupled():
    (mode,) = solve_modes(DOME, SILICA, 2)
    return CoupledHarmonics(mode, SILICA)


@pytest.fixture(scope="module")
def pair(coupled):
    return Pair(coupled.mode)


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_a_perfect_dome_does_not_split(n):
    (mode,) = solve_modes(DOME, SILICA, n)
    assert CoupledHarmonics(mode, SILICA).solve(Imperfection()).relative <= 1e-12
    assert find_split(Pair(mode), Imperfection()).relative == 0.0


def test_a_perfect_dome_on_a_stem_does_not_split_and_even_departures_only_shift():
    stemmed = hemisphere(radius=R, thickness=H, support="stem", stem=Stem(2.5e-3, -5e-3, 0.5e-3))
    (mode,) = solve_modes(stemmed, SILICA, 2)
    coupled = CoupledHarmonics(mode, SILICA)
    assert coupled.solve(Imperfection()).relative <= 1e-12
    thicker = coupled.solve(Imperfection(thickness=wave(0, 1e-3 * H), density=wave(0, 1e-3)))
    assert thicker.relative <= 1e-12
    assert thicker.shift > 0


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_first_order_is_the_limit_of_the_coupled_harmonics(n):
    """They differ by the square of the amplitude; Hadamard's face energies bring the discretisation of the faces."""
    (mode,) = solve_modes(DOME, SILICA, n, tolerance=1e-7)
    pair, coupled = Pair(mode), CoupledHarmonics(mode, SILICA)
    for name in ("thickness", "outer", "inner", "offset", "density", "modulus", "rim"):
        flaw = Imperfection(**{name: wave(2 * n, 1e-4 * (1.0 if name in ("density", "modulus") else H), azimuth=0.3)})
        gap = abs(coupled.solve(flaw).wave - find_split(pair, flaw).wave)
        assert gap < 1e-5 * 1e-4, name  # per unit of amplitude, where a split may be a small difference


def test_first_order_leaves_the_square_of_the_amplitude(coupled):
    """At 1 % of the thickness 4.9e-5 of the split, whatever the discretisation: the third order of the split, not an error."""
    (finer,) = solve_modes(DOME, SILICA, 2, tolerance=1e-6)

    def left(solved, amplitude):
        """The coupled solve against its own limit, which is first order on the same elements."""
        small, large = (solved.solve(Imperfection(thickness=wave(4, e * H))).relative / e for e in (1e-5, amplitude))
        return large / small - 1

    one, two = left(coupled, 0.01), left(coupled, 0.02)
    assert one == pytest.approx(4.9e-5, abs=2e-6)
    assert two / one == pytest.approx(4.0, rel=0.02)
    assert left(CoupledHarmonics(finer, SILICA), 0.01) == pytest.approx(one, rel=0.03)


def test_mean_shift_is_the_frequency_of_the_changed_dome(pair, coupled):
    for flaw, changed in (
        (Imperfection(thickness=wave(0, 1e-4 * H)), hemisphere(radius=R, thickness=(1 + 1e-4) * H)),
        (Imperfection(offset=wave(0, 1e-4 * H)), hemisphere(radius=R + 1e-4 * H, thickness=H)),
    ):
        (exact,) = solve_modes(changed, SILICA, 2)
        wanted = exact.frequency / pair.mode.frequency - 1
        assert find_split(pair, flaw).shift == pytest.approx(wanted, rel=2e-4)
        assert coupled.solve(flaw).shift == pytest.approx(wanted, rel=2e-4)


def test_the_edge_of_the_rim_moves_as_a_longer_dome_does(pair):
    longer = hemisphere(radius=R, thickness=H, rim_angle=pi / 2 + 1e-5)
    (exact,) = solve_modes(longer, SILICA, 2)
    shift = find_split(pair, Imperfection(rim=wave(0, 1e-5 * R))).shift
    assert shift == pytest.approx(exact.frequency / pair.mode.frequency - 1, rel=1e-3)


@pytest.mark.parametrize("rounds", [1, 2])
def test_turning_the_imperfection_turns_the_axes_and_nothing_else(coupled, rounds):
    def flaw(turn):
        return Imperfection(
            thickness=wave(1, 0.02 * H, turn) + wave(4, 0.01 * H, 0.2 + turn),
            density=wave(3, 0.02, 0.1 + turn),
            masses=(PointMass(2e-7, turn),),
        )

    here, there = (coupled.solve(flaw(turn), 0.0, rounds) for turn in (0.0, 0.7))
    assert there.relative == pytest.approx(here.relative, rel=1e-7)
    assert (there.slow_axis - here.slow_axis - 0.7 + pi / 4) % (pi / 2) - pi / 4 == pytest.approx(0.0, abs=1e-7)
    assert there.shift == pytest.approx(here.shift, rel=1e-7)


def test_harmonics_m_and_m_plus_4_act_together_as_their_product(coupled):
    """Second order: split ∝ a b, along the difference (or sum) of their phases; each alone does nothing."""

    def split(a, b):
        return coupled.solve(Imperfection(density=wave(1, a, 0.5) + wave(3, b, -0.2)))

    base = split(1e-3, 1e-3)
    assert split(2e-3, 1e-3).relative == pytest.approx(2 * base.relative, rel=1e-4)
    assert split(1e-3, 3e-3).relative == pytest.approx(3 * base.relative, rel=1e-4)
    assert split(1e-3, 0.0).relative < 1e-6 * base.relative
    phase = np.angle(base.wave) - (1 * 0.5 + 3 * -0.2)  # 1 + 3 = 4
    assert min(abs(phase % pi), abs(phase % pi - pi)) < 1e-5


def test_one_round_errs_in_the_fifth_order(coupled):
    one, two = (
        [coupled.solve(Imperfection(thickness=wave(4, e * H)), 0.0, k).relative / e for e in (0.02, 0.04)]
        for k in (1, 2)
    )
    gaps = [abs(a - b) for a, b in zip(one, two, strict=True)]
    assert gaps[1] / gaps[0] == pytest.approx(16, rel=0.1)  # the split over ε, of which only even orders are not 0
    assert gaps[0] < 1e-5


@pytest.mark.parametrize("faces", [{"outer": (1, 3)}, {"thickness": (1, 3)}, {"density": (1, 3)}, {"modulus": (1, 5)}])
def test_rounds_end_where_more_would_change_nothing(coupled, faces):
    """Two waves together, which first order does not see at all: the split of a default solve against many rounds."""
    ((name, (one, other)),) = faces.items()
    size = 1.0 if name in ("density", "modulus") else H
    flaw = Imperfection(**{name: wave(one, 0.02 * size, 0.1) + wave(other, 0.03 * size, 0.7)})
    many = coupled.solve(flaw, 0.0, 8)
    assert abs(coupled.solve(flaw).wave - many.wave) < 1e-5 * many.relative
    assert many.relative > 1e-6


def test_three_equal_masses_at_120_degrees_do_not_split_in_any_order(coupled):
    """C3v has representations of two dimensions, and n = 2 is one: its pair stays whole, whatever the masses."""
    masses = tuple(PointMass(2e-6, 0.1 + 2 * pi * k / 3) for k in range(3))
    whole = coupled.solve(Imperfection(masses=masses))
    assert whole.shift < -3e-3
    assert whole.relative < 1e-12
