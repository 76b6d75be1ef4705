"""A cubic crystal: against an anisotropic ring, against NGSolve, and against an isotropic body."""

from math import pi

import numpy as np
import pytest
from scipy.linalg import eigh

from shell.cubic import Cubic, solve_cubic
from shell.errors import ShellError
from shell.meridian import cylinder, hemisphere
from shell.modes import solve_modes
from shell.resonator import Stem
from tests.shell.samples import DOME, SILICA

SILICON = Cubic(165.7e9, 63.9e9, 79.6e9, 2329.0)


def silicon_ring(h: float) -> list[float]:
    """Hz of the pair n = 2 of an inextensional ring of radius 1 in the plane (100).

    v = -sin kθ/k and w = cos kθ bend it with E(θ) = 1/(s₁₁ - 2 (s₁₁ - s₁₂ - s₄₄/2) sin²θ cos²θ), I/A = h²/12.
    """
    C = np.full((3, 3), SILICON.C12) + (SILICON.C11 - SILICON.C12) * np.eye(3)
    (s11, s12, _), *_ = np.linalg.inv(C)
    theta, k = 2 * pi * np.arange(128) / 128, np.arange(2, 30, 4)
    E = 1 / (s11 - 2 * (s11 - s12 - 1 / (2 * SILICON.C44)) * (np.sin(theta) * np.cos(theta)) ** 2)
    found = []
    for wave in (np.cos, np.sin):
        bent = (k**2 - 1)[:, None] * wave(np.multiply.outer(k, theta))
        stiffness = (bent * E) @ bent.T * 2 * pi / len(theta) * h**2 / 12
        values = eigh(stiffness, np.diag(pi * SILICON.rho * (1 + 1 / k**2)), eigvals_only=True)
        found.append(float(np.sqrt(values[0])) / (2 * pi))
    return found


@pytest.mark.slow
def test_a_ring_of_silicon() -> None:
    """What is left falls as (h/R)²."""
    errors = []
    for h in (0.04, 0.02):
        pair = solve_cubic(cylinder(1.0, h, 3 * h), SILICON)
        errors.append(np.array([pair.along_100, pair.along_110]) / silicon_ring(h) - 1)
    assert np.all(abs(errors[1]) < 1.2e-4)
    assert errors[0] / errors[1] == pytest.approx([4, 4], rel=0.02)


@pytest.mark.slow
def test_a_dome_of_silicon_splits_by_seven_per_cent() -> None:
    """By NGSolve, a quarter of the dome in curved tetrahedra of order 5, from above (tests/benchmarks/cubic_ngsolve.py of 722ba988)."""
    pair = solve_cubic(DOME, SILICON)
    assert pair.relative_error_estimate < 1e-5
    assert [pair.along_100, pair.along_110] == pytest.approx([6407.882, 6876.657], rel=1e-5)
    assert pair.relative_split == pytest.approx(0.07057, abs=1e-5)


@pytest.mark.slow
def test_a_crystal_that_is_isotropic_is_the_isotropic_body() -> None:
    glass = SILICA
    lam = glass.E * glass.nu / ((1 + glass.nu) * (1 - 2 * glass.nu))
    crystal = Cubic(lam + 2 * glass.G, lam, glass.G, glass.rho)
    assert [crystal.isotropic.E, crystal.isotropic.nu] == pytest.approx([glass.E, glass.nu], rel=1e-12)
    pair = solve_cubic(DOME, crystal)
    (mode,) = solve_modes(DOME, glass)
    assert pair.along_100 == pytest.approx(mode.frequency, rel=1e-5)
    assert pair.relative_split == pytest.approx(0.0, abs=1e-9)


@pytest.mark.slow
def test_odd_harmonics_do_not_split() -> None:
    pair = solve_cubic(cylinder(1.0, 0.02, 0.06), SILICON, 3, tolerance=1e-3)
    assert pair.relative_split == pytest.approx(0.0, abs=1e-8)


def test_what_is_not_computed_is_refused() -> None:
    with pytest.raises(ShellError, match="not n = 4"):
        solve_cubic(DOME, SILICON, 4)
    with pytest.raises(ShellError, match="without stem"):
        solve_cubic(hemisphere(15e-3, 0.9e-3, support="stem", stem=Stem(2.5e-3, -5e-3)), SILICON)
    with pytest.raises(ShellError, match="stable"):
        Cubic(60e9, 70e9, 80e9, 2329.0)
    with pytest.raises(ShellError, match="density"):
        Cubic(165.7e9, 63.9e9, 79.6e9, 0.0)
