"""Gas damping: free molecular at low pressure, a viscous layer at high pressure.

A face that moves with velocity v loses Z v² per area, so 1/Q = ∫ Z |u|² dA / (ω ∫ ρ |u|² dV). Free molecules at rest
give, per face and with the accommodation a of the wall,

    Z = p √(M/(R T)) × [(1 - a) 2√(2/π) + a (√(2/π) + ½ √(π/2))] along the normal, a/√(2π) along the face;

both faces of a plate in normal motion with a = 0: 1/Q = 4 √(2/π) p √(M/(R T))/(ρ h ω) (Christian, Vacuum 16 (1966) 175;
Bao et al., J. Micromech. Microeng. 12 (2002) 341). In a viscous gas the layer of width √(2μ/(ρ_g ω)) shears with the slip between
the wall and the potential flow that its waves drive, Z = √(ρ_g μ ω/2) on that slip (Stokes). Between the two regimes, where no
closed form holds, the two are joined by Q² = Q_free² + Q_viscous², and the uncertainty is a half.

A gap g to electrodes is not counted, only bounded. In a period molecules diffuse along it by about √(g √(R T/M)/ω), 1 mm at 0.1 mm
and 4 kHz: farther than that from an end of the electrodes they are compressed in place, as a spring p/g, and nearer they escape and
lose. A film that leaks at a rate r per time has Z = p/(g ω) ω r/(ω² + r²), at most half its spring (Blech, J. Lubr. Technol. 105
(1983) 615; Bao et al. for plates so small that all molecules leave).
"""

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from numpy.typing import ArrayLike

from shell.damping.faces import Kind, Vibration
from shell.errors import ShellError
from shell.quadrature import Array

R = 8.314462618  # J/(mol K)


@dataclass(frozen=True)
class Gas:
    """A gas: molar mass (kg/mol), viscosity μ₀ (Pa s) at T₀ (K), Sutherland's constant S (K), and c_p/c_v."""

    name: str
    molar_mass: float
    viscosity: float
    at: float
    sutherland: float
    heats: float

    def viscosity_at(self, temperature: float) -> float:
        """Sutherland's law μ = μ₀ (T/T₀)^1.5 (T₀ + S)/(T + S), Pa s."""
        ratio = temperature / self.at
        return float(self.viscosity * ratio**1.5 * (self.at + self.sutherland) / (temperature + self.sutherland))

    def density_at(self, pressure: float, temperature: float) -> float:
        """Of an ideal gas, p M/(R T), kg/m³."""
        return pressure * self.molar_mass / (R * temperature)

    def sound_at(self, temperature: float) -> float:
        """Speed of sound of an ideal gas, √((c_p/c_v) R T/M), m/s."""
        return sqrt(self.heats * R * temperature / self.molar_mass)


# viscosities, Sutherland constants, ratios of heat capacities: White, Viscous Fluid Flow, tables 1-2 and A-2
GASES = {
    gas.name: gas
    for gas in (
        Gas("air", 0.0289652, 1.716e-5, 273.0, 111.0, 1.40),
        Gas("nitrogen", 0.0280134, 1.663e-5, 273.0, 107.0, 1.40),
        Gas("argon", 0.039948, 2.125e-5, 273.0, 144.0, 1.667),
        Gas("hydrogen", 0.00201588, 8.411e-6, 273.0, 97.0, 1.41),
    )
}


def gas_loss(vibration: Vibration, gas: Gas, pressure: float, temperature: float, accommodation: float = 1.0) -> float:
    """1/Q to a gas at a pressure (Pa) and temperature (K); `accommodation` is the share of molecules that leave the wall diffusely."""
    if not pressure >= 0:
        raise ShellError(f"the gas pressure must be 0 or positive, not {pressure:g} Pa.")
    if not 0 <= accommodation <= 1:
        raise ShellError(f"the accommodation coefficient lies between 0 and 1, not {accommodation:g}.")
    if pressure == 0:
        return 0.0
    free = free_molecular_loss(vibration, gas, pressure, temperature, accommodation)
    viscous = viscous_loss(vibration, gas, pressure, temperature)
    return free * viscous / float(np.hypot(free, viscous))


def free_molecular_loss(
    vibration: Vibration, gas: Gas, pressure: float, temperature: float, accommodation: float
) -> float:
    """1/Q from free molecular damping."""
    normal = (1 - accommodation) * 2 * sqrt(2 / pi) + accommodation * (sqrt(2 / pi) + 0.5 * sqrt(pi / 2))
    along = accommodation / sqrt(2 * pi)
    hit = sum(
        face.integrate(normal * face.moved[2] ** 2 + along * (face.moved[0] ** 2 + face.moved[1] ** 2))
        for face in vibration.faces
    )
    impedance = float(free_impedance(pressure, gas.molar_mass, temperature))
    return impedance * hit / (float(vibration.omega(temperature)) * vibration.kinetic)


def free_impedance(pressure: ArrayLike, molar_mass: float, temperature: ArrayLike) -> Array:
    """P √(M/(R T)), kg/(m² s): free molecular pressure per velocity of the face, up to a constant."""
    return np.asarray(np.asarray(pressure) * np.sqrt(molar_mass / (R * np.asarray(temperature, dtype=float))))


def viscous_loss(vibration: Vibration, gas: Gas, pressure: float, temperature: float) -> float:
    """1/Q from the viscous layer on the faces; the gas flows around as fast as the wall moves along its normal."""
    omega = float(vibration.omega(temperature))
    resistance = sqrt(gas.density_at(pressure, temperature) * gas.viscosity_at(temperature) * omega / 2)
    slip = 0.0
    for face in vibration.faces:
        out = vibration.resonator.outward * (1 if face.kind == "outer" else -1)
        flow = out * (vibration.solution.system.n > 0) * face.moved[2]
        slip += face.integrate(face.moved[0] ** 2 + (face.moved[1] - flow) ** 2)
    return resistance * slip / (omega * vibration.kinetic)


def most_squeezed(vibration: Vibration, face: Kind, gap: float, pressure: float, temperature: float) -> float:
    """The largest 1/Q of gas in a gap (m) over the whole of a face, Z = p/(2 g ω) along the normal."""
    omega = float(vibration.omega(temperature))
    hit = sum(one.integrate(one.moved[2] ** 2) for one in vibration.faces if one.kind == face)
    return pressure / (2 * gap * omega) * hit / (omega * vibration.kinetic)


def mean_free_path(gas: Gas, pressure: float, temperature: float) -> float:
    """λ = (μ/p) √(π R T/(2 M)), m: the mean free path; a smaller gap or layer is no continuum."""
    return float(gas.viscosity_at(temperature) / pressure * np.sqrt(pi * R * temperature / (2 * gas.molar_mass)))
