"""What is refused, and with which words."""

import pytest

from shell.errors import ShellError
from shell.imperfection import CoupledHarmonics, Imperfection, Pair, PointMass, find_split, wave
from shell.meridian import hemisphere
from shell.modes import solve_modes
from shell.resonator import Stem
from tests.shell.samples import DOME, SILICA


def test_n_0_does_not_split_and_rayleigh_has_no_energies():
    dome = DOME
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


def test_waves_are_checked():
    with pytest.raises(ShellError, match="whole number"):
        wave(-1, 1.0)
