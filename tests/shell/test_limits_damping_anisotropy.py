"""Damping that varies around: rings and domes, brute-force integrals around the axis, maps, bad input."""

from math import pi

import numpy as np
import pytest

from shell.curves import Line
from shell.damping.anisotropy import Ripple, damping_wave, describe_wave, film_weight, surface_weight
from shell.damping.budget import film_causes, loss_budget
from shell.damping.faces import Vibration
from shell.damping.film import Film, film_energies, thickness_power
from shell.damping.heat import Heat
from shell.errors import ShellError
from shell.material import constant_material
from shell.meridian import hemisphere
from shell.modes import Mode, solve_modes
from shell.resonator import Resonator
from tests.shell.samples import SILICA

GOLD = Film(100e-9, 78e9, 0.44, 1e-4)
WALL, INSIDE = Heat(5.1e-7, 2203 * 740.0, 1.38), Heat(14.2e-6, 19300 * 129.0, 320.0)


def _vibration(mode: Mode) -> Vibration:
    return Vibration(mode.solution, mode.resonator, constant_material("glass", 72.7e9, 0.17, 2203.0), 293.15)


def _dome(h: float) -> Vibration:
    return _vibration(solve_modes(hemisphere(radius=15e-3, thickness=h), SILICA)[0])


def test_a_ring_feels_it_fully_and_a_thin_dome_hardly() -> None:
    """A ring has normal strains only, κ = 1; in an inextensional dome twist and bending have equal energies, κ → 0."""
    ring = Resonator((Line((10e-3, 0.0), (10e-3, 0.1e-3)),), ((0.0, 0.05e-3), (1.0, 0.05e-3)))
    vibration = _vibration(solve_modes(ring, SILICA)[0])
    assert film_weight(GOLD, vibration.faces) == pytest.approx(1.0, abs=0.02)
    assert surface_weight(vibration.surfaces) == pytest.approx(1.0, abs=0.05)
    thick, thin = (film_weight(GOLD, _dome(h).faces) for h in (0.9e-3, 0.09e-3))
    assert abs(thin) < abs(thick) < 0.2


def test_against_the_integral_around_the_axis() -> None:
    """1/Q of patterns at many azimuths, integrated over θ with the film's own thickness there; other waves are not felt."""
    vibration, n = _dome(0.9e-3), 2
    amplitude, angle = 0.3, np.radians(17.0)
    theta = np.linspace(0, 2 * pi, 721)[:-1]
    density = 1 + amplitude * np.cos(2 * n * (theta - angle)) + 0.2 * np.cos(theta - 1.0) + 0.1 * np.cos(6 * theta)
    found = []
    for azimuth in np.radians([17.0, 30.0, 62.0]):
        total = 0.0
        for face in vibration.faces:
            cosine, sine = np.cos(n * (theta - azimuth)) ** 2, np.sin(n * (theta - azimuth)) ** 2
            twist = GOLD.E / (2 * (1 + GOLD.nu)) * face.strain[3] ** 2
            both = sum(film_energies(GOLD, face))
            for weight, energy in ((cosine, both - twist), (sine, twist)):
                total += face.integrate(energy) * float(np.mean(density * weight)) * 2
        found.append(GOLD.loss * GOLD.thickness * total / vibration.strain_energy)
    budget = loss_budget(vibration, film_causes("gold", GOLD, None, (0, 0), ""), 293.15)
    ripple = Ripple("gold film", amplitude, angle, film_weight(GOLD, vibration.faces))
    split, axis = describe_wave(damping_wave(budget, [ripple], n), n)
    q = float(budget.inverse_q[0])
    expected = [q + split[0] / 2 * np.cos(2 * n * (a - axis[0])) for a in np.radians([17.0, 30.0, 62.0])]
    assert found == pytest.approx(expected, rel=1e-9)
    assert abs(found[0] - found[2]) == pytest.approx(float(split[0]), rel=1e-9)


def test_two_ripples_add_as_vectors() -> None:
    vibration = _dome(0.9e-3)
    budget = loss_budget(vibration, film_causes("gold", GOLD, None, (0, 0), ""), 293.15)
    one = Ripple("gold film", 0.01, 0.0, 1.0)
    across = Ripple("gold film", 0.01, pi / 8, 1.0)
    against = Ripple("gold film", 0.01, pi / 4, 1.0)
    q = float(budget.inverse_q[0])
    assert abs(damping_wave(budget, [one, against], 2)[0]) < 1e-12 * q
    split, axis = describe_wave(damping_wave(budget, [one, across], 2), 2)
    assert split[0] == pytest.approx(np.sqrt(2) * 0.01 * q, rel=1e-12)
    assert axis[0] == pytest.approx(pi / 16, rel=1e-12)


def test_heat_of_a_thin_film_goes_as_its_square() -> None:
    film = Film(10e-9, 78e9, 0.44, 1e-4, INSIDE)
    assert thickness_power(film, WALL, 2 * pi * 4400) == pytest.approx(2.0, abs=1e-2)


def test_bad_input_is_said() -> None:
    with pytest.raises(ShellError, match="at most 1"):
        Ripple("surface", 1.5, 0.0, 1.0)
    budget = loss_budget(_dome(0.9e-3), film_causes("gold", GOLD, None, (0, 0), ""), 293.15)
    with pytest.raises(ShellError, match="no loss 'surface'"):
        damping_wave(budget, [Ripple("surface", 0.1, 0.0, 1.0)], 2)
