"""The heat path of an instrument, from its geometry, its material and its table `[thermal]`, in SI units."""

from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.errors import InputError, naming

if TYPE_CHECKING:
    from shell.material import Material
    from shell.resonator import Resonator
    from studies.instrument.tables.thermal import Thermal
    from thermal.meridian import MeridianCells
    from thermal.resonator import HeatPath

FINE = 240  # cells from which one lump is made
ROWS = 4001  # points of the meridian's table
FROM_MATERIAL = {
    # key of the card: property of the material
    "conductivity_W_per_m_K": "conductivity",
    "heat_capacity_J_per_kg_K": "heat_capacity",
}


def build_heat_path(
    thermal: "Thermal", resonator: "Resonator", material: "Material", reference: float, where: str
) -> "HeatPath":
    """Build the heat path at a reference temperature (K); `where` is "file [thermal]", for messages."""
    from thermal.network import growing
    from thermal.resonator import HeatPath

    radius, length = _stem_size(thermal, resonator)
    with naming(where):
        cells, joint = _cut_shell(resonator, radius, int(thermal.cells))
        return HeatPath(
            cells=cells,
            joint_volume=joint,
            volumetric_capacity=_volumetric_capacity(thermal, material, reference, where),
            conductivity=_material_value(thermal, material, "conductivity_W_per_m_K", reference, where),
            stem_radius=radius,
            stem_length=length,
            emissivity=thermal.film_emissivity,
            housing_share=thermal.film_housing_share,
            base_capacity=growing(thermal.base_heat_capacity_J_per_K, thermal.base_capacity_slope_per_K),
            housing_capacity=thermal.housing_heat_capacity_J_per_K,
            mount_conductance=thermal.mount_conductance_W_per_K,
            mount_exchange=1e-4 * thermal.mount_exchange_cm2,
            chamber_conductance=thermal.chamber_conductance_W_per_K,
            drive_power=1e-3 * thermal.drive_power_mW,
            second_mass=thermal.second_mass_J_per_K or 0.0,
            second_mass_conductance=thermal.second_mass_conductance_W_per_K or 0.0,
        )


@lru_cache(maxsize=64)
def _cut_shell(resonator: "Resonator", stem_radius: float, count: int) -> "tuple[MeridianCells, float]":
    """Return the shell from where the stem ends, and the volume (m³) of its wall above the stem's end."""
    from thermal.meridian import cut_meridian_table, lump

    points = resonator.sample(ROWS)
    s, r, h = points.arc_length, points.r, points.thickness
    if resonator.support == "clamped-rim":
        s, r, h = resonator.length - s[::-1], r[::-1], h[::-1]
    root = max(stem_radius, 1e-3 * float(r.max()))
    first = int((r >= root).argmax()) if r[0] < root else 0
    cells = cut_meridian_table(s[first:] - s[first], r[first:], h[first:], FINE if count == 1 else count)
    joint = float(np.trapezoid((2 * np.pi * r * h)[: first + 1], s[: first + 1]))
    return (lump(cells) if count == 1 else cells), joint


def _stem_size(thermal: "Thermal", resonator: "Resonator") -> tuple[float, float]:
    """Return radius and length (m) of the stem's conducting part."""
    radius, length = resonator.size / 6, resonator.size
    if resonator.stem is not None:
        radius = resonator.stem.radius
        pole = resonator.at([0.0])
        half = float(pole.thickness[0]) / 2
        length = min(abs(float(pole.z[0]) + face * half - end) for face, end in resonator.stem.roots)
    given = thermal.stem_radius_mm, thermal.stem_length_mm
    return (radius if given[0] is None else 1e-3 * given[0]), (length if given[1] is None else 1e-3 * given[1])


def _material_value(thermal: "Thermal", material: "Material", key: str, reference: float, where: str) -> float:
    given: Any = getattr(thermal, key)
    if given is not None:
        return float(given)
    name = FROM_MATERIAL[key]
    if name not in material.properties:
        raise InputError(f"{where}: no source states {name.replace('_', ' ')} of {material.name}; add '{key}'.")
    return float(material.value(name, reference))


def _volumetric_capacity(
    thermal: "Thermal", material: "Material", reference: float, where: str
) -> float | Callable[[float], float]:
    """ρ c in J/(m³ K): a number, or over temperature where the material's heat capacity varies."""
    rho = float(material.value("density", reference))
    law = material.properties.get("heat_capacity")
    if law is None or law.form == "constant" or thermal.heat_capacity_J_per_kg_K is not None:
        return rho * _material_value(thermal, material, "heat_capacity_J_per_kg_K", reference, where)
    return lambda T: rho * float(material.value("heat_capacity", T))
