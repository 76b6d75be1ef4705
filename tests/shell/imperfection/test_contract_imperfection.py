"""What is refused, and with which words."""

import numpy as np
import pytest

from shell.elastic import Elastic
from shell.errors import ShellError
from shell.imperfection import CoupledHarmonics, Imperfection, Map, Pair, PointMass, find_split, teeth, wave
from shell.meridian import hemisphere
from shell.modes import solve_modes
from shell.resonator import Stem

SILICA = Elastic(72.7e9, 0.17, 2203.0)
X, THETA = np.linspace(0, 1, 5), 2 * np.pi * np.arange(24) / 24


def test_a_map_must_close_the_circle():
    with pytest.raises(ShellError, match="close the circle"):
        Map(X, np.deg2rad(np.arange(24) * 14.0), np.zeros((5, 24)))
    with pytest.raises(ShellError, match="close the circle"):
        Map(X, np.deg2rad(np.arange(25) * 15.0), np.zeros((5, 25)))  # 0° and 360° both


def test_a_map_has_no_holes_and_the_right_size():
    holey = np.zeros((5, 24))
    holey[2, 3] = np.nan
    with pytest.raises(ShellError, match="1 empty cell"):
        Map(X, THETA, holey)
    with pytest.raises(ShellError, match="5 positions and 24 azimuths"):
        Map(X, THETA, np.zeros((24, 5)))
    with pytest.raises(ShellError, match="must rise"):
        Map(X[::-1], THETA, np.zeros((5, 24)))


def test_n_0_does_not_split_and_rayleigh_has_no_energies():
    dome = hemisphere(radius=15e-3, thickness=0.9e-3)
    (breathing,) = solve_modes(dome, SILICA, 0)
    with pytest.raises(ShellError, match="n = 0"):
        Pair(breathing)
    (closed,) = solve_modes(dome, SILICA, 2, theory="rayleigh")
    with pytest.raises(ShellError, match="Rayleigh"):
        Pair(closed)
    with pytest.raises(ShellError, match="harmonic from 1 up"):
        CoupledHarmonics(breathing, SILICA)


def test_masses_lie_on_the_shell():
    stemmed = hemisphere(radius=15e-3, thickness=0.9e-3, support="stem", stem=Stem(2.5e-3, -5e-3, 0.5e-3))
    (mode,) = solve_modes(stemmed, SILICA, 2)
    for position, words in ((0.02, "solid root"), (1.2, "0 \\(start\\)")):
        with pytest.raises(ShellError, match=words):
            find_split(Pair(mode), Imperfection(masses=(PointMass(1e-9, 0.0, position),)))


def test_a_clamped_rim_has_no_edge():
    (mode,) = solve_modes(hemisphere(radius=15e-3, thickness=0.9e-3, support="clamped-rim"), SILICA, 2)
    with pytest.raises(ShellError, match="no free rim"):
        find_split(Pair(mode), Imperfection(rim=wave(4, 1e-6)))


def test_waves_and_teeth_are_checked():
    with pytest.raises(ShellError, match="whole number"):
        wave(-1, 1.0)
    with pytest.raises(ShellError, match="do not fit"):
        teeth(40, 0.2, 1e-4)
    with pytest.raises(ShellError, match="3 errors were given for 4 teeth"):
        teeth(4, 0.2, 1e-4, errors=(0.1, 0.1, 0.1))
