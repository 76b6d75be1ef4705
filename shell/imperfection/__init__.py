"""The imperfect resonator: how a harmonic pair splits, and where the axes of its two modes lie.

>>> mode, = solve_modes(resonator, elastic, harmonic=2)
>>> flaw = Imperfection(thickness=wave(4, 1e-6), masses=(PointMass(5e-9, azimuth=0.3),))
>>> find_split(Pair(mode), flaw).hertz                          # first order
>>> CoupledHarmonics(mode, elastic).solve(flaw).slow_axis       # every order, with the harmonics n ± m
"""

from shell.imperfection.coupled import CoupledHarmonics
from shell.imperfection.field import Field, wave
from shell.imperfection.imperfect import Imperfection, PointMass
from shell.imperfection.pair import Pair
from shell.imperfection.split import Split, find_split

__all__ = [
    "CoupledHarmonics", "Field", "Imperfection", "Pair", "PointMass", "Split", "find_split", "wave",
]  # fmt: skip
