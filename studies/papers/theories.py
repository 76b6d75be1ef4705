"""Rayleigh's closed form, shell theory and the solid on one free hemisphere: how far apart, and how they close."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

from shell.elastic import Elastic
from shell.law import build_law
from shell.levels import Theory
from shell.materials import find_material
from shell.meridian import hemisphere
from shell.modes import TheoryRangeWarning, solve_modes

THEORIES: tuple[Theory, ...] = ("rayleigh", "shell", "solid")
RADIUS = 15e-3
SILICA = Elastic(72.7e9, 0.17, 2203.0)
RATIOS = (0.2, 0.06, 0.01, 1e-3, 3e-4, 1e-4)


@dataclass(frozen=True)
class TheoryComparison:
    """One thickness ratio: the n = 2 frequencies (Hz) of the three theories."""

    ratio: float
    rayleigh: float
    shell: float
    solid: float

    @property
    def excess(self) -> float:
        """Rayleigh's relative excess over the solid."""
        return float(self.rayleigh / self.solid - 1)

    @property
    def coefficient(self) -> float:
        """The excess over √(h/R), which tends to a constant."""
        return float(self.excess / self.ratio**0.5)


def compare_theories(ratios: Sequence[float] = RATIOS, n: int = 2) -> list[TheoryComparison]:
    """Solve the free hemisphere of 15 mm at falling thickness with all three theories."""
    rows = []
    for ratio in ratios:
        dome = hemisphere(RADIUS, ratio * RADIUS)
        # The Rayleigh form is known to be far off the solid for thick shells: that is what is shown here.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", TheoryRangeWarning)
            f = [solve_modes(dome, SILICA, n, theory=theory, tolerance=1e-6)[0].frequency for theory in THEORIES]
        rows.append(TheoryComparison(ratio, *f))
    return rows


def thin_limit(thinner: TheoryComparison, thicker: TheoryComparison) -> float:
    """Extrapolate the coefficient to vanishing thickness, where it is linear in √(h/R)."""
    a, b = thinner.ratio**0.5, thicker.ratio**0.5
    return float((thinner.coefficient * b - thicker.coefficient * a) / (b - a))


def slopes_by_theory(ratio: float = 0.06, temperature: float = 293.15) -> dict[str, float]:
    """Return the slope of ln f at one temperature (1/K) by theory, default silica, free hemisphere."""
    dome, silica = hemisphere(RADIUS, ratio * RADIUS), find_material("fused-silica")
    return {
        theory: float(build_law(dome, silica, temperature, temperature, temperature, theory).parts(temperature).total)
        for theory in THEORIES
    }
