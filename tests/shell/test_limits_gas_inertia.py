"""Gas that moves with a wall: a turning disc, a sphere that sounds, a long tube, and the mode of a tube."""

from math import pi

import numpy as np
import pytest
from scipy.special import lpmv, spherical_jn, spherical_yn

from shell.curves import Line
from shell.damping.gas import Gas
from shell.gas_inertia import entrained, gas_shift
from shell.meridian import cylinder, hemisphere
from shell.modes import solve_modes
from shell.resonator import Resonator
from tests.shell.samples import SILICA

R = 1.3


def straight(*ends: tuple[float, float]) -> Resonator:
    return Resonator((Line(*ends),), ((0.0, 1e-3), (1.0, 1e-3)), "free")


def test_a_disc_that_turns_about_a_diameter() -> None:
    """Added moment of inertia 16/45 ρ a⁵ (Lamb, Hydrodynamics, as the limit of a spheroid): an edge and both sides, w = r cos θ."""
    disc = straight((0.0, 0.0), (R, 0.0))
    assert pi * entrained(disc, 1, 0.0, lambda s: s * R) == pytest.approx(16 / 45 * R**5, rel=1e-6)


@pytest.mark.parametrize(("order", "n"), [(1, 1), (2, 2), (3, 2), (3, 3)])
@pytest.mark.parametrize("kR", [0.0, 0.5, 1.2, 2.0])
def test_a_sphere_sounds_outside_and_holds_a_field_inside(order: int, n: int, kR: float) -> None:
    """Per area ρR (j/(x j') - h/(x h')) of x = kR; ρR/n and ρR/(n + 1) where the gas does not yield."""

    def w(s):
        return lpmv(n, order, np.cos(pi * s))

    x, weight = np.polynomial.legendre.leggauss(200)
    s = (x + 1) / 2
    found = entrained(hemisphere(R, 1e-3, rim_angle=pi), n, kR / R, w)
    found /= float(np.sum(weight / 2 * pi * R**2 * np.sin(pi * s) * w(s) ** 2))
    expected: complex = R / order + R / (order + 1)
    if kR:
        j, out = (spherical_jn(order, kR, slope) for slope in (False, True))
        h, gone = (spherical_jn(order, kR, d) + 1j * spherical_yn(order, kR, d) for d in (False, True))
        expected = R / kR * (j / out - h / gone)
    assert abs(found / expected - 1) < 1e-4
    assert found.imag == pytest.approx(complex(expected).imag, rel=1e-4, abs=1e-12)


@pytest.mark.parametrize("n", [2, 3])
def test_a_long_tube_carries_its_radius_over_n_on_each_side(n: int) -> None:
    """ρ R/n inside and outside, by what five radii more of a long tube carry."""
    short, long = (entrained(straight((R, 0.0), (R, L * R)), n, 0.0, np.ones_like).real for L in (5, 10))
    assert (long - short) / (5 * R**2) == pytest.approx(2 * R / n, rel=5e-3)


def test_a_mode_carries_the_gas_of_its_normal_motion() -> None:
    """A tube bends without stretching, v = w/n: δ ln f = -½ ρ_g (2R/n)/(ρ h (1 + 1/n²)) in the limit of its length; a gas that does not yield."""
    radius, h, n = 12.5e-3, 0.25e-3, 2
    stiff = Gas("stiff", 0.029, 0.0, 273.0, 0.0, 1e6)
    lengths = (5, 10)
    shifts = []
    for L in lengths:
        (mode,) = solve_modes(cylinder(radius, h, L * radius), SILICA, n)
        shifts.append(gas_shift(mode, stiff, 1e5, 293.15).real)
    limit = (lengths[1] * shifts[1] - lengths[0] * shifts[0]) / (lengths[1] - lengths[0])  # the ends lose as 1/L
    strip = -0.5 * stiff.density_at(1e5, 293.15) * (2 * radius / n) / (SILICA.rho * h * (1 + 1 / n**2))
    assert limit == pytest.approx(strip, rel=5e-3)
    assert abs(shifts[1] / strip) < 1
