r"""Gas that moves with a thin wall: what its inertia does to a mode, and the sound that the wall sends out.

The velocity potential φ inside and outside is that of dipoles on the wall, of the strength μ = φ₊ - φ₋ ∝ cos nθ, 0 at the ends of the
meridian. That the gas follows the wall, ∂φ/∂n = ẇ, is for all ν of that form (Maue, Z. Phys. 126 (1949) 601)

    A(ν, μ) = ∬ (curl ν · curl μ' - k² ν μ' n · n') e^{ikR}/(4πR) dS dS' = -∫ ν ẇ dS,      k = ω/c, curl μ = n × ∇μ.

The pressure ρ_g ∂μ/∂t on the wall adds ρ_g (w, A⁻¹ w) to ∫ ρ |u|² dV: a real part, ρ_g R/n per area on each side of a long tube at k = 0,
and an imaginary one, the sound. The wall is its middle surface; the gas is free on both sides of it.
"""

from collections.abc import Callable

import numpy as np

from shell.damping.gas import Gas
from shell.finite import solved_as_solid
from shell.modes import Mode
from shell.points import MeridianPoints
from shell.quadrature import Array
from shell.resonator import Resonator
from shell.solution import total

POINTS, STRENGTHS, AROUND = 64, 24, 32
"""Along the meridian, functions of the strength, points around the axis; and 2, 1 and 2 more for each wave."""


def gas_shift(mode: Mode, gas: Gas, pressure: float, temperature: float) -> complex:
    """δ ln ω by gas at a pressure (Pa) and temperature (K) around the mode, -½ ρ_g (w, A⁻¹ w)/∫ ρ |u|² dV; 1/Q by sound is -2 times the imaginary part."""
    solution = solved_as_solid(mode)
    chains = solution.system.chains
    position = np.concatenate([group.table.position.ravel() for group in chains.values()])
    w = np.concatenate([np.mean(solution.displacement[one][:, :, 2], axis=2).ravel() for one in chains])
    order = np.argsort(position)
    xp, fp = position[order], w[order]
    k = 2 * np.pi * mode.frequency / gas.sound_at(temperature)
    moved = entrained(mode.resonator, mode.harmonic, k, lambda s: np.interp(s, xp, fp))
    return -gas.density_at(pressure, temperature) * moved / (2 * total(solution.kinetic))


def entrained(resonator: Resonator, n: int, k: float, normal: Callable[[Array], Array]) -> complex:
    """(w, A⁻¹ w)/π of n waves around (1 or more) and the wave number k; `normal` is w at positions (0 … 1) of the meridian."""
    (x, Sx, Vx), (y, Sy, Vy) = sides = [_lay(resonator, n, count) for count in (POINTS + 2 * n, POINTS + 2 * n + 1)]
    before, own, after = _around(x, y, n, k) + _logarithm(*(one[0] for one in sides))
    cosine, sine = (before + after) / 2, (before - after) / 2  # of cos Δ cos nΔ, of sin Δ sin nΔ
    rr, radial, axial = (np.outer(getattr(x, name), getattr(y, name)) for name in ("r", "tangent_r", "tangent_z"))
    along = radial * cosine + axial * own - (k / n) ** 2 * rr * (axial * cosine + radial * own)
    A = Sx.T @ cosine @ Sy + Vx.T @ along @ Vy
    A += Sx.T @ (sine * y.tangent_r) @ Vy + Vx.T @ (sine * x.tangent_r[:, None]) @ Sy
    pushed, moved = (V.T @ (normal(at.position) * at.r) / n for at, _, V in sides)
    return complex(moved @ np.linalg.solve(A, pushed))


def _lay(resonator: Resonator, n: int, count: int) -> tuple[MeridianPoints, Array, Array]:
    """Places at s = L (1 - cos τ)/2, and there r ν' ds and n ν ds of every ν = sin jτ."""
    tau, j, length = _middles(count), np.arange(1, STRENGTHS + n + 1), resonator.length
    at = resonator.at(length * (1 - np.cos(tau)) / 2)
    angle, step = np.outer(tau, j), np.pi / count
    slope = step * j * np.cos(angle) * at.r[:, None]
    return at, slope, step * n * length / 2 * np.sin(tau)[:, None] * np.sin(angle)


def _middles(count: int) -> Array:
    return np.asarray((np.arange(count) + 0.5) * (np.pi / count))


def _around(x: MeridianPoints, y: MeridianPoints, n: int, k: float) -> Array:
    """∫ e^{ikR}/(4πR) cos mΔ dΔ of m = n - 1, n, n + 1 between places; Δ = ε sinh u is fine where R is small."""
    rr = np.outer(x.r, y.r)[..., None]
    apart = np.hypot(x.r[:, None] - y.r, x.z[:, None] - y.z)[..., None]
    u, weight = np.polynomial.legendre.leggauss(AROUND + 2 * n)
    width = apart / np.sqrt(rr)
    reach = np.arcsinh(np.pi / width)
    angle = width * np.sinh(reach * (u + 1) / 2)
    R = np.sqrt(apart**2 + 4 * rr * np.sin(angle / 2) ** 2)
    kernel = np.exp(1j * k * R) / (4 * np.pi * R) * np.sqrt(width**2 + angle**2) * reach * weight
    return np.stack([np.sum(kernel * np.cos(m * angle), axis=-1) for m in (n - 1, n, n + 1)])


def _logarithm(x: MeridianPoints, y: MeridianPoints) -> Array:
    """What the logarithm in these integrals, -ln |cos τ - cos τ'|/(2π √(r r')), is worth as a rule, by its series of cosines, beside its value."""
    tau, other = (_middles(len(one.r)) for one in (x, y))
    j = np.arange(1, len(other))
    rule = -np.log(2) - 2 * (np.cos(np.outer(tau, j)) / j) @ np.cos(np.outer(j, other))
    value = np.log(abs(np.cos(tau)[:, None] - np.cos(other)))
    return np.asarray((value - rule) / (2 * np.pi * np.sqrt(np.outer(x.r, y.r))))
