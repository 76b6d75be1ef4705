"""The symbolic derivation inside design code: which wall gives a wanted frequency, and how sharply it must be held.

HRG paper, eq. (14), is taken from the derivation, turned into a fast function and solved for the thickness; the solver
then says how far Rayleigh's mode, which ignores the free edge, was off.
"""

from typing import NamedTuple

import sympy as sp
from scipy.optimize import brentq

from shell.derivation.frequency import bending_integral, frequency, mass_integral
from shell.elastic import Elastic
from shell.meridian import hemisphere
from shell.modes import solve_modes

SILICA = Elastic(E=72.7e9, nu=0.17, rho=2203.0)
RADIUS = 15e-3
WANTED = 5000.0  # Hz


class DesignedWall(NamedTuple):
    """Thickness (m) by Rayleigh's formula and by the solver, and the frequency (Hz) that the solver gives the first."""

    by_formula: float
    by_solver: float
    frequency: float


def choose_thickness() -> DesignedWall:
    """Solve f(h) = 5 kHz for a free hemisphere, n = 2."""
    formula = frequency(sp.Integer(2))
    print("HRG paper, eq. (14):  f =", formula)
    integrals = {
        sp.Symbol(name, positive=True): value(2) for name, value in (("I", bending_integral), ("J", mass_integral))
    }
    symbols = {str(symbol): symbol for symbol in formula.free_symbols}
    numbers = {symbols["E"]: SILICA.E, symbols["nu"]: SILICA.nu, symbols["rho"]: SILICA.rho, symbols["r"]: RADIUS}
    formula = formula.subs({symbols[str(name)]: value for name, value in integrals.items()}).subs(numbers)
    in_hertz = sp.lambdify(symbols["h"], formula)  # numbers in, numbers out: no SymPy in the loop

    def solved(h: float) -> float:
        return solve_modes(hemisphere(RADIUS, h), SILICA, harmonic=2)[0].frequency

    by_formula = brentq(lambda h: float(in_hertz(h)) - WANTED, 0.2e-3, 3e-3)
    by_solver = brentq(lambda h: solved(h) - WANTED, by_formula, 1.5 * by_formula, xtol=1e-9)
    return DesignedWall(by_formula, by_solver, solved(by_formula))


if __name__ == "__main__":
    design = choose_thickness()
    print(f"thickness by the formula: {design.by_formula * 1e3:.4f} mm, which truly gives {design.frequency:.1f} Hz")
    print(f"thickness by the solver:  {design.by_solver * 1e3:.4f} mm for {WANTED:g} Hz")
