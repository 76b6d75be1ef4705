"""The frequency over temperature and its slope by parts, HRG paper eq. (15), which prints no derivative; I and J stay."""

from functools import cache
from typing import NamedTuple

import sympy as sp

from shell.derivation.frequency import frequency, log_derivatives
from shell.derivation.symbols import E, h, nu, r, rho

temperature = sp.Symbol("T", real=True)  # temperature of the resonator (K)
alpha = sp.Symbol("alpha", real=True)  # coefficient of free isotropic expansion (1/K): h'/h = r'/r = α, ρ'/ρ = −3 α
G = sp.Function("G")  # shear modulus over temperature (Pa), E = 2 G (1 + ν)
OVER_TEMPERATURE = {symbol: sp.Function(symbol.name)(temperature) for symbol in (E, nu, rho, h, r)}
"""Each property as a function of temperature."""


class TemperatureParts(NamedTuple):
    """The parts of d ln f/dT from E, ν, ρ, h and r (1/K)."""

    E: sp.Expr
    nu: sp.Expr
    rho: sp.Expr
    h: sp.Expr
    r: sp.Expr

    @property
    def total(self) -> sp.Expr:
        """Their sum, d ln f/dT."""
        return sum(self)


@cache
def frequency_over_temperature() -> sp.Expr:
    """Return HRG paper eq. (15): f(T) in Hz, (13) with E, ν, ρ, h and r functions of T, for any harmonic."""
    return frequency().subs(OVER_TEMPERATURE)


@cache
def temperature_parts() -> TemperatureParts:
    """Return d ln f/dT of (15) by parts: ½ E'/E, −½ ν'/(1 + ν), −½ ρ'/ρ, h'/h, −2 r'/r."""
    by = log_derivatives()
    slopes = {symbol: over.diff(temperature) for symbol, over in OVER_TEMPERATURE.items()}

    def part(slope: sp.Expr, symbol: sp.Symbol, logarithmic: bool) -> sp.Expr:
        found = slope * slopes[symbol] / (symbol if logarithmic else 1)
        return sp.simplify(found.subs(OVER_TEMPERATURE))

    return TemperatureParts(
        part(by.E, E, True), part(by.nu, nu, False), part(by.rho, rho, True), part(by.h, h, True), part(by.r, r, True)
    )


@cache
def free_expansion() -> sp.Expr:
    """Return d ln f/dT of a shell that expands freely: ½ G'/G + ½ α, since f ∝ √(E/((1+ν)ρ)) h/r² measures G."""
    T = temperature
    E_of_T, nu_of_T, rho_of_T, h_of_T, r_of_T = (OVER_TEMPERATURE[symbol] for symbol in (E, nu, rho, h, r))
    slopes = {rho_of_T.diff(T): -3 * alpha * rho_of_T, h_of_T.diff(T): alpha * h_of_T, r_of_T.diff(T): alpha * r_of_T}
    modulus = 2 * G(T) * (1 + nu_of_T)
    whole = temperature_parts().total.subs(slopes).subs(E_of_T, modulus).doit()
    return sp.expand(sp.simplify(whole))
