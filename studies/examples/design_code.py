"""The symbolic derivation inside design code: which wall gives a wanted frequency (HRG paper, eq. 13), and how sharply it must be held."""

from typing import NamedTuple

import sympy as sp
from scipy.optimize import brentq

import hrg

SILICA = hrg.Elastic(E=72.7e9, nu=0.17, rho=2203.0)
RADIUS = 15e-3
WANTED = 5000.0  # Hz


class DesignedWall(NamedTuple):
    """Thickness (m) by Rayleigh's formula and by the solver, and the frequency (Hz) that the solver gives the first."""

    by_formula: float
    by_solver: float
    frequency: float


def choose_thickness() -> DesignedWall:
    """Solve f(h) = 5 kHz for a free hemisphere, n = 2."""
    formula = sp.sqrt(hrg.derivation.omega_squared()) / (2 * sp.pi)
    print("HRG paper, eq. (13):  f =", formula)
    known = {"n": 2, "E": SILICA.E, "nu": SILICA.nu, "rho": SILICA.rho, "r": RADIUS}
    known |= {"I": hrg.derivation.bending_integral(2), "J": hrg.derivation.mass_integral(2)}
    symbols = {str(symbol): symbol for symbol in formula.free_symbols}
    formula = formula.subs({symbols[name]: value for name, value in known.items()})
    in_hertz = sp.lambdify(symbols["h"], formula)  # numbers in, numbers out: no SymPy in the loop

    def solved(h: float) -> float:
        return hrg.solve_modes(hrg.hemisphere(RADIUS, h), SILICA, harmonic=2)[0].frequency

    by_formula = brentq(lambda h: float(in_hertz(h)) - WANTED, 0.2e-3, 3e-3)
    by_solver = brentq(lambda h: solved(h) - WANTED, by_formula, 1.5 * by_formula, xtol=1e-9)
    return DesignedWall(by_formula, by_solver, solved(by_formula))


if __name__ == "__main__":
    design = choose_thickness()
    print(f"thickness by the formula: {design.by_formula * 1e3:.4f} mm, which truly gives {design.frequency:.1f} Hz")
    print(f"thickness by the solver:  {design.by_solver * 1e3:.4f} mm for {WANTED:g} Hz")
