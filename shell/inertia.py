"""Mass, centre and inertia of a resonator from the solver's own volume elements."""

from dataclasses import dataclass
from itertools import pairwise
from math import pi

import numpy as np

from shell.assembly import build_system
from shell.layout import LEVELS, Level
from shell.quadrature import Array, gauss
from shell.resonator import Resonator
from shell.system import Group, SolidGroup


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
    places = [_gauss_points(resonator, group, system.level) for group in system.groups]
    r = np.concatenate([place[0].ravel() for place in places])
    z = np.concatenate([place[1].ravel() for place in places])
    dV = 2 * pi * np.concatenate([group.table.volume.ravel() for group in system.groups])
    volume = float(dV.sum())
    center = float((z * dV).sum()) / volume
    axial = density * float((r**2 * dV).sum())
    transverse = axial / 2 + density * float(((z - center) ** 2 * dV).sum())
    return MassProperties(volume, density * volume, center, axial, transverse)


def _gauss_points(resonator: Resonator, group: Group, level: Level) -> tuple[Array, Array]:
    """Coordinates r and z (elements, stations, points) of the quadrature points of one group."""
    if isinstance(group, SolidGroup):
        points = gauss(level.block + 2)[0]
        r, z = group.mesh.place(points, points)
        return r, z
    xi, eta = gauss(level.along + 2)[0], gauss(max(level.through) + 2)[0]
    chain, found = group.chain, []
    for (one, two), segment in zip(pairwise(chain.breaks), chain.segments, strict=True):
        at = resonator.at((one + two) / 2 + (two - one) / 2 * xi, segment)
        found.append(at.at_heights(eta))
    return np.array([r for r, _ in found]), np.array([z for _, z in found])
