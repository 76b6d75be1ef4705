"""The averaged equations as self-contained Python or C code for controllers and simulators."""

from string import Template
from typing import Literal

import sympy as sp

from compensation.derivation.averaging import ellipse_rates

PYTHON = Template('''\
"""Averaged dynamics of a Coriolis vibratory gyro (Lynch's form); written by `hrg derive --dynamics --code python`.

Orbit of half axes a and q (m) at the angle psi = n theta (rad), phase phi (rad) against omega t; first order in
1/(omega tau), Delta_omega/omega, Omega/omega.
"""

from math import cos, sin


def averaged_rates(a, q, psi, tau, Delta_tau, psi_tau, Delta_omega, psi_omega, n, k, Omega, u_a=0.0, u_q=0.0, u_r=0.0, u_phi=0.0):
    """Return da/dt, dq/dt (m/s), dpsi/dt, dphi/dt (rad/s).

    Decay time tau (s), damping split Delta_tau = 1/tau_1 - 1/tau_2 (1/s) with its axis psi_tau = n theta_tau,
    frequency split Delta_omega (rad/s) with psi_omega, harmonic n, Bryan factor k, rate Omega (rad/s), and the forces of
    the loops per modal mass over 2 omega (m/s).
    """
$common
    return (
        $a,
        $q,
        $psi,
        $phi,
    )
''')

C = Template("""\
/* Averaged dynamics of a Coriolis vibratory gyro (Lynch's form); written by `hrg derive --dynamics --code c`.
 *
 * Orbit of half axes a and q (m) at the angle psi = n theta (rad), phase phi (rad) against omega t; first order in
 * 1/(omega tau), Delta_omega/omega, Omega/omega.
 */
#include <math.h>

/* rate[4] = da/dt, dq/dt (m/s), dpsi/dt, dphi/dt (rad/s).
 * Decay time tau (s), damping split Delta_tau = 1/tau_1 - 1/tau_2 (1/s) with its axis psi_tau = n theta_tau, frequency
 * split Delta_omega (rad/s) with psi_omega, harmonic n, Bryan factor k, rate Omega (rad/s), and the forces of the loops
 * per modal mass over 2 omega (m/s). */
void averaged_rates(double a, double q, double psi, double tau, double Delta_tau, double psi_tau, double Delta_omega,
                    double psi_omega, double n, double k, double Omega, double u_a, double u_q, double u_r, double u_phi,
                    double rate[4])
{
$common
    rate[0] = $a;
    rate[1] = $q;
    rate[2] = $psi;
    rate[3] = $phi;
}
""")


def emit_code(language: Literal["python", "c"]) -> str:
    """Return a module of Python or of C with ȧ, q̇, ψ̇, φ̇, common terms worked out once."""
    template, write, line = (
        (PYTHON, _python, "    {name} = {value}")
        if language == "python"
        else (C, sp.ccode, "    const double {name} = {value};")
    )
    common, rates = sp.cse(list(ellipse_rates()), symbols=sp.numbered_symbols("common_"))
    lines = "\n".join(line.format(name=name, value=write(value)) for name, value in common)
    return template.substitute(common=lines, **dict(zip(("a", "q", "psi", "phi"), map(write, rates), strict=True)))


def _python(expression: sp.Expr) -> str:
    return str(sp.pycode(expression)).replace("math.", "")
