"""The letters of the derivation, one SymPy symbol each."""

import sympy as sp

phi, theta = sp.symbols("phi theta", real=True)  # polar angle from the pole and angle around the axis (rad)
z, t = sp.symbols("z t", real=True)  # height above the middle surface along its outward normal (m), and time (s)
n = sp.Symbol("n", integer=True, positive=True)  # circumferential harmonic
r, h = sp.symbols("r h", positive=True)  # radius of the middle surface and thickness (m)
E, rho = sp.symbols("E rho", real=True)  # Young's modulus (Pa) and density (kg/m³)
nu = sp.Symbol("nu", real=True)  # Poisson ratio, the HRG paper's μ
omega, Omega = sp.symbols("omega Omega", positive=True)
"""Angular frequency of the mode and turning rate about the axis (rad/s)."""
C = sp.Symbol("C", positive=True)  # amplitude of the mode (m)
phi_1, phi_2 = sp.symbols("phi_1 phi_2", positive=True)  # polar angles where the shell starts and ends (rad)
tan_half = sp.Symbol("T", positive=True)  # tan(φ/2), in which every function of φ of this problem is rational


def in_half_angle(expression: sp.Expr) -> sp.Expr:
    """Write sin φ, cos φ and tan(φ/2) by T = tan(φ/2): sin φ = 2T/(1+T²), cos φ = (1−T²)/(1+T²)."""
    return expression.subs(
        {
            sp.tan(phi / 2): tan_half,
            sp.sin(phi): 2 * tan_half / (1 + tan_half**2),
            sp.cos(phi): (1 - tan_half**2) / (1 + tan_half**2),
        }
    )
