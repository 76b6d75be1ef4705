"""Expansion that stresses a mode: exact limits, a clamped disc in closed form, and finite elements of another kind."""

from math import pi

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import iv, ivp, jv, jvp

from shell.curves import Line
from shell.elastic import Elastic
from shell.errors import ShellError
from shell.law import build_law
from shell.material import Mount
from shell.materials import find_material
from shell.meridian import cylinder, hemisphere, meridian
from shell.modes import solve_modes
from shell.prestress import Prestress, expansion_shares
from shell.resonator import Stem
from tests.shell.samples import DOME, SILICA

T0 = 293.15


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("shape", [DOME, hemisphere(15e-3, [(0, 1.2e-3), (1, 0.5e-3)])])
def test_even_expansion_of_a_free_body_leaves_no_stress(shape, n):
    """Lengths grow by β and the mass stays: f by √β, though the places for themselves count many times as much."""
    (mode,) = solve_modes(shape, SILICA, n)
    shares = expansion_shares(mode)
    assert shares.sum() == pytest.approx(0.5, abs=2e-7)
    assert abs(shares).sum() > 1.5
    assert Prestress(mode).by_base == 0.0


def test_a_stem_keeps_the_strain_of_its_base_away_from_the_dome():
    (mode,) = solve_modes(hemisphere(15e-3, 0.9e-3, support="stem", stem=Stem(2.5e-3, -5e-3, 0.5e-3)), SILICA)
    assert abs(Prestress(mode).by_base) < 1e-5


def disc(n: int, nu: float) -> float:
    """D ln f/dε times h² of a thin clamped disc of radius 1 whose edge is stretched by ε, in its n-th mode around.

    ω² ρ h ∫ w² = D ∫ (Δw)² + N ∫ |∇w|², N = E h ε/(1 - ν), with the mode J_n(k r) - J_n(k)/I_n(k) I_n(k r) (Leissa 1969).
    """
    k = brentq(lambda k: jv(n, k) * ivp(n, k) - iv(n, k) * jvp(n, k), n + 2, n + 4.5)
    c = jv(n, k) / iv(n, k)
    w, slope = (lambda r: jv(n, k * r) - c * iv(n, k * r)), (lambda r: k * (jvp(n, k * r) - c * ivp(n, k * r)))
    gradient = quad(lambda r: (slope(r) ** 2 + (n * w(r) / r) ** 2) * r, 1e-9, 1)[0]
    return 6 * (1 + nu) * gradient / (k**4 * quad(lambda r: w(r) ** 2 * r, 0, 1)[0])


@pytest.mark.slow
@pytest.mark.parametrize("n", [2, 3])
def test_a_clamped_disc_that_its_frame_stretches(n):
    """Thick discs depart by shear and by the edge, as h and h²; three thicknesses take both out."""
    metal, thicknesses = Elastic(70e9, 0.3, 2700.0), np.array([0.04, 0.02, 0.01])
    found = []
    for h in thicknesses:
        frame = meridian([Line((0.0, 0.0), (1.0, 0.0))], thickness=h, support="clamped-rim")
        (mode,) = solve_modes(frame, metal, n, tolerance=1e-6)
        found.append(Prestress(mode).by_base * h**2 / disc(n, 0.3))
    assert np.polyfit(thicknesses, found, 2)[2] == pytest.approx(1.0, abs=3e-4)


@pytest.mark.parametrize(
    ("shape", "by_base"),
    [
        (hemisphere(15e-3, 0.9e-3, support="clamped-rim"), -1.0171617),
        (cylinder(12.5e-3, 0.6e-3, 18e-3, bottom_thickness=1e-3, clamp_radius=3e-3), 0.28376),
    ],
)
def test_the_stress_of_a_base_as_another_code_has_it(shape, by_base):
    """NGSolve: modes on equilibria of Green's strain at ± 1e-6 of the base, differenced (tests/benchmarks/finite_ngsolve.py of 722ba988)."""
    (mode,) = solve_modes(shape, SILICA, tolerance=1e-7)
    assert Prestress(mode).by_base == pytest.approx(by_base, abs=2e-4)


def test_uneven_expansion_of_a_free_dome_as_another_code_has_it():
    """The same of a dome that grows by cos² of the polar angle."""
    (mode,) = solve_modes(DOME, SILICA, tolerance=1e-6)
    assert expansion_shares(mode) @ np.cos(mode.along.position * pi / 2) ** 2 == pytest.approx(-0.2035640, abs=2e-6)


@pytest.mark.slow
def test_a_law_with_a_base():
    """Its parts add up, its derivatives are its own, its places too; the temperature of the joint moves f at once."""
    cup, alloy = cylinder(12.5e-3, 0.6e-3, 18e-3, bottom_thickness=1e-3, clamp_radius=3e-3), find_material("3j53")
    alloy = alloy.rescaled(T0, youngs_modulus=190e9, poisson_ratio=0.3, density=8000.0)
    law = build_law(cup, alloy, T0, 273.15, 313.15, mount=Mount(23e-6, T0))
    bare = build_law(cup, alloy, T0, 273.15, 313.15)
    T, s = np.array([280.0, 305.0]), law.prestress.by_base
    assert law.logarithm(T) - bare.logarithm(T) == pytest.approx(s * law.mount.strain(alloy, T), rel=1e-6)
    assert law.parts(T).total == pytest.approx(law.slope(T), rel=1e-6)
    assert law.sensitivity().sum() == pytest.approx(float(law.slope(T0)), rel=1e-6)
    assert bare.sensitivity().sum() == pytest.approx(float(bare.slope(T0)), rel=1e-6)
    moved = law.with_material(alloy.with_coefficients({"expansion.value": 1e-7}))
    assert law.derivatives(T)["expansion.value"] == pytest.approx(
        (moved.logarithm(T) - law.logarithm(T)) / 1e-7, rel=1e-5
    )
    expansion = float(alloy.value("expansion", T0))
    same = build_law(cup, alloy, T0, 273.15, 313.15, mount=Mount(expansion, 340.0))
    assert same.logarithm(T) == pytest.approx(bare.logarithm(T), abs=1e-12)


def test_what_no_base_can_stress_is_refused():
    silica = find_material("fused-silica")
    with pytest.raises(ShellError, match="free resonator"):
        build_law(DOME, silica, T0, T0, T0, mount=Mount(5e-6, T0))
    held = hemisphere(15e-3, 0.9e-3, support="clamped-rim")
    with pytest.raises(ShellError, match="solid theory"):
        build_law(held, silica, T0, T0, T0, "shell", mount=Mount(5e-6, T0))
    (mode,) = solve_modes(held, SILICA, theory="shell")
    with pytest.raises(ShellError, match="solid theory"):
        expansion_shares(mode)
