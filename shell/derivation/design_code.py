"""The frequency formula (13), (14) as self-contained Python or C code for design work, its integrals written with 17 digits."""

from string import Template
from typing import Literal

import sympy as sp

from shell.derivation import frequency
from shell.derivation.chain import DerivedCase
from shell.derivation.symbols import n, r

PYTHON = Template('''\
"""Rayleigh's frequency of an inextensional spherical shell, harmonic n = $n, from $start to $end degrees.

HRG paper, equation $equation; written by `hrg derive --code python`. Rayleigh's mode ignores the conditions at
the free edge: $defect.
"""

from math import pi, sqrt

BENDING_INTEGRAL = $I
MASS_INTEGRAL = $J


def rayleigh_frequency(E, nu, rho, h, R):
    """Return the frequency in Hz, equation $equation.

    Young's modulus E (Pa), Poisson ratio nu, density rho (kg/m^3), thickness h and radius R (m).
    """
    omega_squared = $omega_squared
    return sqrt(omega_squared) / (2 * pi)


def rayleigh_bryan_factor():
    """Return how far the standing wave lags behind the turning shell, per angle turned."""
    return $K


def rayleigh_log_derivatives(nu):
    """Return the derivatives of ln(frequency) by ln E, nu, ln rho, ln h, ln R and the rim angle (1/rad)."""
    return {
        "E": $by_E,
        "nu": $by_nu,
        "rho": $by_rho,
        "h": $by_h,
        "R": $by_r,
        "phi_2": $by_phi_2,
    }


def rayleigh_temperature_coefficient(nu, d_ln_E, d_nu, d_ln_rho, d_ln_h, d_ln_R):
    """Return d ln(frequency)/dT (1/K) and its parts, equation (15), from the slopes of ln E, nu, ln rho, ln h and ln R (1/K).

    A shell that expands freely by alpha has d_ln_rho = -3 alpha and d_ln_h = d_ln_R = alpha.
    """
    by = rayleigh_log_derivatives(nu)
    slopes = {"E": d_ln_E, "nu": d_nu, "rho": d_ln_rho, "h": d_ln_h, "R": d_ln_R}
    parts = {name: by[name] * slope for name, slope in slopes.items()}
    return sum(parts.values()), parts
''')

C = Template("""\
/* Rayleigh's frequency of an inextensional spherical shell, harmonic n = $n, from $start to $end degrees.
 *
 * HRG paper, equation $equation; written by `hrg derive --code c`. Rayleigh's mode ignores the conditions at
 * the free edge: $defect.
 */
#include <math.h>

static const double PI = 3.1415926535897932;
static const double BENDING_INTEGRAL = $I;
static const double MASS_INTEGRAL = $J;

/* Frequency in Hz, equation $equation: Young's modulus E (Pa), Poisson ratio nu, density rho (kg/m^3),
 * thickness h and radius R (m). */
double rayleigh_frequency(double E, double nu, double rho, double h, double R)
{
    const double omega_squared = $omega_squared;
    return sqrt(omega_squared) / (2.0 * PI);
}

/* How far the standing wave lags behind the turning shell, per angle turned. */
double rayleigh_bryan_factor(void)
{
    return $K;
}

/* Derivatives of ln(frequency) by ln E, nu, ln rho, ln h, ln R and the rim angle (1/rad), in this order. */
void rayleigh_log_derivatives(double nu, double derivative[6])
{
    derivative[0] = $by_E;
    derivative[1] = $by_nu;
    derivative[2] = $by_rho;
    derivative[3] = $by_h;
    derivative[4] = $by_r;
    derivative[5] = $by_phi_2;
}

/* d ln(frequency)/dT (1/K), equation (15), and its parts from E, nu, rho, h and R, from the slopes of ln E, nu, ln rho,
 * ln h and ln R (1/K). A shell that expands freely by alpha has slopes -3 alpha of ln rho and alpha of ln h and ln R. */
double rayleigh_temperature_coefficient(double nu, const double slope[5], double part[5])
{
    double derivative[6], total = 0.0;
    int k;
    rayleigh_log_derivatives(nu, derivative);
    for (k = 0; k < 5; k++) {
        part[k] = derivative[k] * slope[k];
        total += part[k];
    }
    return total;
}
""")


def emit_code(case: DerivedCase, language: Literal["python", "c"]) -> str:
    """Return a module of Python or of C with the frequency, the Bryan factor and the derivatives of ln f."""
    template, write = (PYTHON, sp.pycode) if language == "python" else (C, sp.ccode)
    given = {
        r: sp.Symbol("R", positive=True),
        frequency.I: sp.Symbol("BENDING_INTEGRAL"),
        frequency.J: sp.Symbol("MASS_INTEGRAL"),
    }
    omega_squared = frequency.omega_squared().subs(n, case.harmonic)
    by = frequency.log_derivatives()
    return template.substitute(
        n=case.harmonic,
        start=_degrees(case.start),
        end=_degrees(case.end),
        defect=_defect(case),
        equation="(14)" if case.harmonic == 2 else "(13)",
        I=_digits(case.bending),
        J=_digits(case.mass),
        K=_digits(case.precession),
        omega_squared=write(omega_squared.subs(given)),
        by_E=_digits(by.E),
        by_nu=write(by.nu),
        by_rho=_digits(by.rho),
        by_h=_digits(by.h),
        by_r=_digits(by.r),
        by_phi_2=_digits(case.rim_derivative),
    )


def _defect(case: DerivedCase) -> str:
    """Say by how much the solid with free edges is lower than Rayleigh's form, at h/R = 0.06 and nu = 0.17."""
    from shell.elastic import Elastic
    from shell.errors import ShellError
    from shell.meridian import hemisphere
    from shell.modes import solve_modes
    from shell.rayleigh import rayleigh_frequency

    start, end, elastic = float(case.start), float(case.end), Elastic(E=72.7e9, nu=0.17, rho=2203.0)
    try:
        (mode,) = solve_modes(hemisphere(1.0, 0.06, end, start), elastic, case.harmonic)
    except ShellError:
        return "the true frequency is lower"
    assumed = float(rayleigh_frequency(case.harmonic, elastic.E, elastic.nu, elastic.rho, 0.06, 1.0, start, end))
    return f"the true frequency is lower, by {100 * (1 - mode.frequency / assumed):.1f} % at h/R = 0.06 and nu = 0.17"


def _digits(value: sp.Expr) -> str:
    return repr(float(value)) if value in (sp.S.Half, -sp.S.Half) or value.is_Integer else str(sp.N(value, 17))


def _degrees(angle: sp.Expr) -> str:
    return f"{float(angle * 180 / sp.pi):g}"
