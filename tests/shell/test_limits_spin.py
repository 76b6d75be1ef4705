"""The second-order effect of spin against the closed forms of a rotating ring."""

from math import pi

import pytest

from shell.errors import ShellError
from shell.meridian import cylinder, hemisphere
from shell.modes import solve_modes
from shell.resonator import Stem
from shell.spin import spin_shift
from tests.shell.samples import DOME, SILICA


@pytest.mark.parametrize("n", [2, 3])
def test_a_ring_that_bends_in_its_plane(n: int) -> None:
    """Bryan (1890), inextensional: ω = g Ω ± √(ω_0² + (n (n² - 1)/(n² + 1))² Ω²); what is left falls as (h/R)²."""
    exact, errors = (n * (n**2 - 1) / (n**2 + 1)) ** 2, []
    for h in (0.02, 0.01):
        (mode,) = solve_modes(cylinder(1.0, h, 3 * h), SILICA, n, tolerance=1e-7)
        found = spin_shift(mode, SILICA).total * 2 * (2 * pi * mode.frequency) ** 2
        errors.append(abs(found / exact - 1))
    assert errors[1] < 3e-5
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.05)


@pytest.mark.parametrize("n", [2, 3])
def test_a_ring_that_bends_out_of_its_plane_is_a_string(n: int) -> None:
    """Its tension ρ A R² Ω² alone gives ω² = n² Ω², and no Coriolis force acts along the axis."""
    (mode,) = solve_modes(cylinder(1.0, 0.01, 0.01), SILICA, n, tolerance=1e-7)
    assert spin_shift(mode, SILICA).total * 2 * (2 * pi * mode.frequency) ** 2 == pytest.approx(n**2, rel=3e-4)


def test_a_dome_on_its_stem_feels_spin_as_a_free_one_does() -> None:
    """A thin stem holds neither the stress at the rim nor the mode."""
    free, held = DOME, hemisphere(15e-3, 0.9e-3, support="stem", stem=Stem(1e-3, -5e-3, 0.2e-3))
    one, other = (spin_shift(solve_modes(body, SILICA)[0], SILICA).total for body in (free, held))
    assert one == pytest.approx(other, rel=5e-3)
    assert 0 < one * (2 * pi * 4596) ** 2 < 2


def test_modes_that_have_no_such_number_are_refused() -> None:
    (mode,) = solve_modes(DOME, SILICA, theory="shell")
    with pytest.raises(ShellError, match="solid theory"):
        spin_shift(mode, SILICA)
    (mode,) = solve_modes(DOME, SILICA, 1)
    with pytest.raises(ShellError, match="from 2 up"):
        spin_shift(mode, SILICA)
