"""The frequency formula (13), (14) as self-contained Python or C code for design work, its integrals written with 17 digits."""

from importlib.resources import files
from string import Template
from typing import Literal

import sympy as sp

from shell.derivation import frequency
from shell.derivation.chain import DerivedCase
from shell.derivation.symbols import n, r


def emit_code(case: DerivedCase, language: Literal["python", "c"]) -> str:
    """Return a module of Python or of C with the frequency, the Bryan factor and the derivatives of ln f."""
    name, write = ("frequency.py.txt", sp.pycode) if language == "python" else ("frequency.c", sp.ccode)
    template = Template((files("shell.derivation") / "sources" / name).read_text(encoding="utf-8"))
    named = {frequency.I: sp.Symbol("BENDING_INTEGRAL"), frequency.J: sp.Symbol("MASS_INTEGRAL")}
    given = {r: sp.Symbol("R", positive=True), **named}
    omega_squared = frequency.omega_squared().subs(n, case.harmonic)
    by = frequency.log_derivatives()
    return template.substitute(
        n=case.harmonic, start=_degrees(case.start), end=_degrees(case.end), defect=_defect(case),
        equation="(14)" if case.harmonic == 2 else "(13)", I=_digits(case.bending), J=_digits(case.mass),
        K=_digits(case.precession), omega_squared=write(omega_squared.subs(given)), by_E=_digits(by.E),
        by_nu=write(by.nu), by_rho=_digits(by.rho), by_h=_digits(by.h), by_r=_digits(by.r),
        by_phi_2=_digits(case.rim_derivative),
    )  # fmt: skip


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
