"""A film on the shell: against a closed form and against a thicker wall."""

from math import pi, sqrt

import pytest

from shell.damping.film import Film, film_shift
from shell.elastic import Elastic
from shell.errors import ShellError
from shell.meridian import hemisphere
from shell.modes import solve_modes
from tests.shell.samples import SILICA

GOLD = Elastic(78e9, 0.42, 19300.0)
R, H = 15e-3, 0.3e-3


def film(material: Elastic, thickness: float, faces: tuple[str, ...] = ("inner", "outer"), start: float = 0.0) -> Film:
    return Film(thickness, material.E, material.nu, faces=faces, span=(start, 1.0), rho=material.rho)


def test_a_breathing_sphere() -> None:
    """ω² = 2 E/((1 - ν) ρ R²): the membrane of the film adds to the wall's, and its mass to the mass."""
    exact = sqrt(2 * SILICA.E / ((1 - SILICA.nu) * SILICA.rho)) / R / (2 * pi)
    wall = 1.5e-3
    modes = solve_modes(hemisphere(R, wall, rim_angle=pi), SILICA, 0, 8, tolerance=1e-3)
    breathing = min(modes, key=lambda mode: abs(mode.frequency - exact))
    assert breathing.frequency == pytest.approx(exact, rel=1e-3)
    t = 1e-7
    stiffer = GOLD.E / (1 - GOLD.nu) / (SILICA.E / (1 - SILICA.nu)) - GOLD.rho / SILICA.rho
    assert film_shift(breathing, film(GOLD, t)) == pytest.approx(t / wall * stiffer, rel=(wall / R) ** 2)


@pytest.mark.parametrize("theory", ["solid", "shell"])
@pytest.mark.parametrize("face", ["inner", "outer"])
def test_a_film_of_the_same_glass_is_a_thicker_wall(face: str, theory: str) -> None:
    (mode,) = solve_modes(hemisphere(R, H), SILICA, 2, theory=theory, tolerance=1e-8)  # type: ignore[arg-type]
    t, side = 1e-3 * H, 1 if face == "outer" else -1

    def frequency(added: float) -> float:
        grown = hemisphere(R + side * added / 2, H + added)
        return solve_modes(grown, SILICA, 2, theory=theory, tolerance=1e-8)[0].frequency  # type: ignore[arg-type]

    difference = (frequency(t) - frequency(-t)) / (2 * mode.frequency)
    allowed = 3e-5 if theory == "solid" else 5e-3  # Naghdi's shear at the faces is no film's
    assert film_shift(mode, film(SILICA, t, (face,))) == pytest.approx(difference, rel=allowed)


def test_films_add_up_and_thick_ones_are_refused() -> None:
    (mode,) = solve_modes(hemisphere(R, H), SILICA)
    inner, outer, both = (
        film_shift(mode, film(GOLD, 20e-9, faces)) for faces in (("inner",), ("outer",), ("inner", "outer"))
    )
    assert both == pytest.approx(inner + outer, rel=1e-12)
    half = film_shift(mode, film(GOLD, 20e-9, start=0.5))
    assert abs(half) < abs(both) * 1.2
    with pytest.raises(ShellError, match="more than 5 % of the wall"):
        film_shift(mode, film(GOLD, 0.1 * H))
    with pytest.raises(ShellError, match="0 or positive"):
        film_shift(mode, film(GOLD, -1e-9))
