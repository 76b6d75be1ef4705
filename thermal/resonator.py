"""The heat path of a hemispherical resonator gyro: chamber, housing, base with electrodes, stem and shell.

    chamber —film of air— housing —mount, radiation— base —stem— shell, and the shell's faces radiate to the base

The resonator stands in vacuum: its shell sees the base and the electrodes on it by radiation, and the base's
temperature through the stem by conduction. Residual gas and the stem's own radiation are left out.
"""

from dataclasses import dataclass, replace

import numpy as np

from thermal.errors import ThermalError
from thermal.meridian import MeridianCells, cell_names, describe_meridian, scale
from thermal.network import Array, Boundary, Capacity, Conductor, Node, Part, Radiator, Source


@dataclass(frozen=True)
class HeatPath:
    """Plain numbers of the heat path."""

    cells: MeridianCells  # the shell's meridian from the stem to the rim; `meridian.lump` makes them one
    volumetric_capacity: Capacity  # float or callable of temperature (K), ρ c of shell and stem, J/(m³ K)
    conductivity: float  # k of shell and stem, W/(m K)
    stem_radius: float  # stem_radius, stem_length: m
    stem_length: float
    # effective emissivity between each face of the shell and what it faces, 1/(1/ε₁ + 1/ε₂ − 1) of parallel faces;
    # decided by the metal film
    emissivity: float
    base_capacity: Capacity  # base_capacity, housing_capacity: J/K
    housing_capacity: float
    mount_conductance: float  # base to housing, W/K
    mount_exchange: float  # base to housing, exchange area in m²
    chamber_conductance: float  # housing to chamber, W/K
    housing_share: float = 0.0  # of the shell's radiation, with the housing, not with the base
    drive_power: float = 0.0  # heat of the vibration, W, spread evenly over the shell's volume
    second_mass: float = 0.0  # J/K, of a part that hangs on the base
    second_mass_conductance: float = 0.0  # base to that part, W/K
    joint_volume: float = 0.0  # m³, of the shell's wall above the end of the stem

    def __post_init__(self) -> None:
        if not 0 <= self.emissivity <= 1:
            raise ThermalError(f"an emissivity must lie between 0 and 1, not {self.emissivity:g}.")
        if not (self.stem_radius > 0 and self.stem_length > 0):
            raise ThermalError("a stem needs a positive radius and a positive length.")


def describe_shell_and_stem(path: HeatPath) -> list[Part]:
    """Return the parts of shell and stem, which are joined to a node or boundary "base"."""
    section = np.pi * path.stem_radius**2
    volume, slenderness = section * path.stem_length, path.stem_length / section
    share, place, carried = _gather(path.joint_volume / volume, 1 + path.cells.shape_resistance[0] / slenderness)
    cells = replace(path.cells, volume=path.cells.volume + volume * carried * (np.arange(path.cells.count) == 0))
    resistance = slenderness / path.conductivity
    shell = describe_meridian(
        cells, "stem", path.volumetric_capacity, path.conductivity, (1 - place) * resistance,
        {"base": 2 * path.emissivity * (1 - path.housing_share), "housing": 2 * path.emissivity * path.housing_share},
    )  # fmt: skip
    stem = Node("stem", scale(path.volumetric_capacity, share * volume))
    return [stem, Conductor("base", "stem", 1 / (place * resistance)), *shell]


def _gather(joint: float, first: float) -> tuple[float, float, float]:
    """Gather the heat capacity of the stem, 1, and of the wall above its end, `joint`, at two points of the resistance: share and place of one, share of the other, the shell's `first` cell.

    Places count from the base, with the stem's end at 1. The rule of Gauss and Radau keeps μ_k = ∫₀¹ x^k dx + joint, k = 0, 1, 2, which are
    capacity, mean delay and Rayleigh's quotient of a field linear along the stem: 3/4 at x = 1/3 and 1/4 at x = 1 for the stem alone.
    """
    capacity, delay, energy = 1 + joint, 1 / 2 + joint, 1 / 3 + joint
    place = (first * delay - energy) / (first * capacity - delay)
    share = (first * capacity - delay) / (first - place)
    return share, place, capacity - share


def describe_resonator(path: HeatPath) -> list[Part]:
    """Return the parts of the whole heat path, from the boundary "chamber" to the cells "shell-1" … of the shell."""
    parts: list[Part] = [
        Boundary("chamber"),
        Node("housing", path.housing_capacity),
        Conductor("chamber", "housing", path.chamber_conductance),
        Node("base", path.base_capacity),
        Conductor("housing", "base", path.mount_conductance),
    ]
    if path.mount_exchange:
        parts.append(Radiator("housing", "base", path.mount_exchange))
    if path.second_mass:
        parts += [Node("mass", path.second_mass), Conductor("base", "mass", path.second_mass_conductance)]
    if path.drive_power:
        share = path.cells.volume / path.cells.volume.sum()
        names = cell_names(path.cells.count)
        parts += [Source(name, path.drive_power * float(part)) for name, part in zip(names, share, strict=True)]
    return parts + describe_shell_and_stem(path)


def shell_weights(nodes: tuple[str, ...], weights: Array) -> Array:
    """Row of weights, of sum one, over all nodes of a network for a mean over the cells of its shell."""
    row = np.zeros(len(nodes))
    for name, weight in zip(cell_names(len(weights)), weights, strict=True):
        row[nodes.index(name)] = weight
    return np.asarray(row / row.sum())
