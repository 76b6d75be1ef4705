"""Mass, centre and inertia of a resonator from the solver's own volume elements."""

from dataclasses import dataclass
from math import pi

import numpy as np

from shell.assembly import build_system
from shell.layout import LEVELS
from shell.resonator import Resonator


@dataclass(frozen=True)
class MassProperties:
    """Mass properties of a body of revolution."""

    volume: float  # m³
    mass: float  # kg
    center: float  # height z of the centre of mass, m
    # axial, transverse: moments of inertia about the axis and about a diameter through the centre of mass, kg m²
    axial: float
    transverse: float


def weigh(resonator: Resonator, density: float) -> MassProperties:
    """Integrate over the solver's elements: V = 2π ∫ r dr dz, I_axial = ∫ ρ r² dV, I_transverse = ∫ ρ (r²/2 + (z - z_c)²) dV."""
    system = build_system(resonator, 2, LEVELS["solid"][0])
    r, z = np.concatenate([group.places.reshape(2, -1) for group in system.groups], axis=1)
    dV = 2 * pi * np.concatenate([group.table.volume.ravel() for group in system.groups])
    volume = float(dV.sum())
    center = float((z * dV).sum()) / volume
    axial = density * float((r**2 * dV).sum())
    transverse = axial / 2 + density * float(((z - center) ** 2 * dV).sum())
    return MassProperties(volume, density * volume, center, axial, transverse)
