"""Published numbers of loss: P of the free dome, the plate strip, Lifshitz and Roukes' maximum, Q of bare and coated silica."""

from math import pi, sqrt

import pytest

from shell.damping.budget import bulk_cause, loss_budget, surface_cause
from shell.damping.faces import Vibration
from shell.damping.gas import GASES, R, free_molecular_loss
from shell.damping.thermoelastic import trace_share
from shell.materials import find_material
from shell.meridian import hemisphere
from shell.modes import solve_modes
from tests.shell.samples import DOME, SILICA


@pytest.mark.parametrize(("n", "share"), [(2, 0.2259), (3, 0.388), (4, 0.530)])
def test_trace_share_of_the_free_dome(n: int, share: float) -> None:
    """Notes on imperfection, loss and loops, section 3: P at h/R = 0.06, ν = 0.17."""
    (mode,) = solve_modes(DOME, SILICA, n)
    assert trace_share(mode.solution) == pytest.approx(share, abs=1e-3 * share)


def test_bare_silica_resonator_lies_where_bare_resonators_are_measured() -> None:
    """quality_factors.csv: bare high-purity HRG shells 30-50e6, an etched cylinder 25e6, a ground one 20e6."""
    silica = find_material("fused-silica")
    (mode,) = solve_modes(hemisphere(radius=15e-3, thickness=0.8558e-3), silica.elastic(293.15))
    vibration = Vibration(mode.solution, mode.resonator, silica, 293.15)
    causes = [bulk_cause(7.6e-12, 0.77, 0.4, "gwinc"), surface_cause(5.2e-12, 0.2, "gwinc")]
    budget = loss_budget(vibration, causes, 293.15)
    low, high = budget.interval
    assert 1 / high[0] < 30e6
    assert 1 / low[0] > 20e6
    assert budget.first.name == "surface"


def test_split_of_a_wavy_thickness_from_the_same_faces() -> None:
    """Notes on imperfection, loss and loops, section 2: h (1 + cos 4θ) splits the pair by −0.36902 of f, by three methods.

    Here from the strains and motions at the faces that film, surface and gas use: each face moves by h/2 cos 4θ, and
    (f_cos − f_sin)/f = ½ Σ ∫ (h/2) [C − S − ω² ρ (u² + w² − v²)] dA / ∫ σ : ε dV.
    """
    h = 0.9e-3
    (mode,) = solve_modes(hemisphere(radius=15e-3, thickness=h), SILICA, tolerance=1e-7)
    vibration = Vibration(mode.solution, mode.resonator, find_material("fused-silica"), 293.15)
    change = 0.0
    for face in vibration.faces:
        twist = SILICA.G * face.strain[3] ** 2
        u, v, w = face.moved
        inertia = mode.solution.eigenvalue * SILICA.rho * (u**2 + w**2 - v**2)  # type: ignore[union-attr]
        change += h / 2 * face.integrate(face.energy - 2 * twist - inertia)
    assert change / (2 * vibration.strain_energy) == pytest.approx(-0.36902, abs=1e-4)


def test_christians_formula_for_a_wall_in_normal_motion() -> None:
    """1/Q = 4 √(2/π) p √(M/(R T))/(ρ h ω), both faces, specular; here for the share of normal motion in the mode."""
    h = 0.3e-3
    (mode,) = solve_modes(hemisphere(radius=15e-3, thickness=h), SILICA)
    vibration = Vibration(mode.solution, mode.resonator, find_material("fused-silica"), 293.15)
    gas, omega = GASES["nitrogen"], 2 * pi * mode.frequency
    found = free_molecular_loss(vibration, gas, 1e-2, 293.15, 0.0)
    normal = sum(face.integrate(face.moved[2] ** 2) for face in vibration.faces)
    every = sum(face.integrate((face.moved**2).sum(axis=0)) for face in vibration.faces)
    christian = 4 * sqrt(2 / pi) * 1e-2 * sqrt(gas.molar_mass / (R * 293.15)) / (2203.0 * h * omega)
    assert found == pytest.approx(christian * normal / every, rel=2e-3)
