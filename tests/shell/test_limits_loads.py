"""Loads on a held resonator: membranes, beams, a body under pressure all around, and finite elements of another kind."""

from math import pi

import numpy as np
import pytest

from shell.errors import ShellError
from shell.inertia import weigh
from shell.loads import Loads
from shell.meridian import cylinder, hemisphere
from shell.modes import solve_modes
from shell.resonator import Resonator, Stem
from shell.system import ShellGroup
from tests.shell.samples import DOME, SILICA


def loads_on(body: Resonator, tolerance: float = 1e-5) -> Loads:
    (mode,) = solve_modes(body, SILICA, tolerance=tolerance)
    return Loads(mode, SILICA)


def test_a_thin_dome_hangs_from_its_pole_as_a_membrane() -> None:
    """N_φ = ρ a h R cos φ/sin² φ and N_θ = -ρ a h R cos φ - N_φ (Timoshenko and Woinowsky-Krieger 1959, section 104)."""
    R = 15e-3
    errors = []
    for h in (0.2e-3, 0.1e-3):
        found = loads_on(hemisphere(R, h, support="stem", stem=Stem(1e-3, 10e-3, 0.2e-3)))
        solution = found.answers["axial"]
        (k,) = (k for k, group in enumerate(solution.system.groups) if isinstance(group, ShellGroup))
        group, stress = solution.system.groups[k], solution.stress[k]
        phi = group.table.position * pi / 2
        share = group.table.volume / group.table.volume.sum(axis=2, keepdims=True)
        along, around = (np.sum(stress[:, :, j] * share, axis=2) / (SILICA.rho * R) for j in (0, 1))
        inside = (phi > 0.8) & (phi < 1.2)
        membrane = np.cos(phi) / np.sin(phi) ** 2
        errors.append(max(np.ptp(x[inside]) for x in (along - membrane, around + np.cos(phi) + membrane)))
    assert errors[1] < 0.02
    assert errors[1] < 0.7 * errors[0]


def test_a_dome_on_a_thin_stem_bends_it_as_a_beam() -> None:
    """Euler and Bernoulli: the end of a cantilever under a force and its moment moves by F L³/3EI + M L²/2EI, turns by F L²/2EI + M L/EI."""
    errors = []
    for a in (0.6e-3, 0.3e-3):
        body = hemisphere(15e-3, 2e-3, support="stem", stem=Stem(a, 8e-3, 0.0))
        found, mass = loads_on(body), weigh(body, SILICA.rho)
        root = 14e-3
        L, EI, F = root - 8e-3, SILICA.E * pi * a**4 / 4, -mass.mass
        M = F * (mass.center - root)
        turn = (F * L**2 / 2 + M * L) / EI
        shift = (F * L**3 / 3 + M * L**2 / 2) / EI
        sag = found.sag({"lateral": 1.0})
        errors.append(max(abs(sag.tilt / -turn - 1), abs(sag.lateral / (shift + turn * (0.0 - root)) - 1)))
    assert errors[1] < 0.1
    assert errors[1] < 0.6 * errors[0]


def test_pressure_all_around_changes_the_elastic_constants() -> None:
    """A body that shrinks by ε = p/3K everywhere has λ (1 - 2ε) + p and G (1 - 2ε) - p beside the unchanged mesh."""
    found, p = loads_on(hemisphere(15e-3, 0.9e-3, support="stem", stem=Stem(1e-3, -5e-3, 0.2e-3)), 1e-6), 1e5
    E, nu = SILICA.E, SILICA.nu
    lam, G, shrink = E * nu / (1 + nu) / (1 - 2 * nu), SILICA.G, p * (1 - 2 * nu) / E
    lam, G = lam * (1 - 2 * shrink) + p, G * (1 - 2 * shrink) - p
    change = [G * (3 * lam + 2 * G) / (lam + G) / E - 1, lam / (2 * (lam + G)) - nu]
    s = found.mode.sensitivities
    assert p * found.shift("pressure") == pytest.approx(s.E * change[0] + s.nu * change[1], rel=2e-3)


@pytest.mark.parametrize(
    ("body", "other"),
    [
        (hemisphere(15e-3, 0.9e-3, support="clamped-rim"), -1.15585e-9),
        (cylinder(12.5e-3, 0.6e-3, 18e-3, bottom_thickness=1e-3, clamp_radius=3e-3), -1.55134e-08),
    ],
)
def test_an_acceleration_along_the_axis_as_another_code_has_it(body: Resonator, other: float) -> None:
    """NGSolve: modes on equilibria of Green's strain at ± 1e4 m/s², differenced (tests/benchmarks/finite_ngsolve.py of 722ba988)."""
    assert loads_on(body, 1e-6).shift("axial") == pytest.approx(other, rel=1e-3)


def test_a_fillet_bounds_the_stress_that_a_beam_has() -> None:
    """Largest stress at the root: that of the beam there, raised by the fillet; the same on a finer mesh."""
    body = hemisphere(15e-3, 0.9e-3, support="stem", stem=Stem(2.5e-3, -5e-3, 1e-3))
    coarse, fine = (loads_on(body, tolerance) for tolerance in (1e-5, 1e-7))
    one, two = (found.peak({"lateral": 1e3, "axial": 1e3}) for found in (coarse, fine))
    assert one.worst == pytest.approx(two.worst, rel=0.01)
    assert one.part == "root"
    beam = coarse.beam(0.0, 1e3)
    assert 0.5 * beam < one.tension < 3 * beam


def test_a_cool_rim_stresses_only_what_it_shrinks_beside() -> None:
    """A dome of one temperature but for its solid root has no stress far from it; a free one is refused."""
    found = loads_on(hemisphere(15e-3, 0.9e-3, support="stem", stem=Stem(2.5e-3, -5e-3, 0.5e-3)))
    away = found.away(np.array([0.0, 0.5, 1.0]))
    assert away[0] == 0.0
    assert 0.3 < away[1] < 0.5
    assert away[2] == 1.0
    assert found.shift("lateral") == 0.0
    with pytest.raises(ShellError, match="held against no load"):
        loads_on(DOME)
