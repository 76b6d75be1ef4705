"""The effect of the amplitude against a ring that is bent exactly, and against finite elements of another kind."""

import pytest

from shell.duffing import amplitude_shift
from shell.errors import ShellError
from shell.meridian import cylinder, hemisphere
from shell.modes import TheoryRangeWarning, solve_modes
from tests.shell.samples import DOME, SILICA


def ring(n: int) -> float:
    """δf/f over (w/R)² of a thin inextensible ring, w the radial amplitude.

    By Lindstedt's method from the exact energies of a plane curve of tangent angle s + ϑ(s), ϑ = A sin ns + B sin 2ns: with
    e^(iϑ) = Σ c_k e^(ikns) the kinetic energy is π Σ ċ_k²/(1 + kn)², the bending energy ½ π (n² A² + 4 n² B²), w = A n/(n² - 1).
    """
    top = (n * n - 1) ** 2 * (8 * n**10 - 9 * n**8 - 51 * n**6 - 17 * n**4 + 12 * n**2 + 3)
    return -top / (16 * n**2 * (n**2 + 1) ** 2 * (4 * n**4 + 5 * n**2 - 3))


@pytest.mark.parametrize("n", [2, 3])
def test_a_thin_ring_softens_as_an_inextensible_one(n: int) -> None:
    """What is left of the difference falls as (h/R)², though the stretching to be relieved grows as (R/h)²."""
    errors = []
    for h in (0.02, 0.01):
        (mode,) = solve_modes(cylinder(1.0, h, 3 * h), SILICA, n, tolerance=1e-7)
        errors.append(amplitude_shift(mode).total / ring(n) - 1)
    assert abs(errors[1]) < 3e-3
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.02)


def test_a_free_dome_as_another_code_has_it() -> None:
    """NGSolve, polynomials of order 6, energies summed over azimuths: -323.4011 per m² (tests/benchmarks/finite_ngsolve.py of 722ba988)."""
    (mode,) = solve_modes(DOME, SILICA)
    assert amplitude_shift(mode).total == pytest.approx(-323.4011, rel=1e-4)


def test_a_mode_at_twice_the_frequency_is_said() -> None:
    """The first torsion-free mode of a clamped dome lies among many at twice its frequency."""
    (mode,) = solve_modes(hemisphere(15e-3, 0.9e-3, support="clamped-rim"), SILICA)
    with pytest.warns(TheoryRangeWarning, match="twice the frequency"):
        amplitude_shift(mode)


def test_modes_that_have_no_such_number_are_refused() -> None:
    (mode,) = solve_modes(DOME, SILICA, theory="shell")
    with pytest.raises(ShellError, match="solid theory"):
        amplitude_shift(mode)
    (mode,) = solve_modes(DOME, SILICA, 1)
    with pytest.raises(ShellError, match="from 2 up"):
        amplitude_shift(mode)
