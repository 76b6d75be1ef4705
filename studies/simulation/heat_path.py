"""The `[thermal]` table of a card becomes the heat path of `thermal.resonator`.

    [thermal]                               # every key may be left out
    film_emissivity = 0.03                  # effective, of each face of the shell; bare metal film 0.03, silica 0.8
    base_heat_capacity_J_per_K = 25.0       # base with electrodes: about 34 g of silica
    housing_heat_capacity_J_per_K = 70.0    # about 150 g of steel
    chamber_conductance_W_per_K = 0.1       # moving air, 10 W/(m² K) on 100 cm²
    mount_conductance_W_per_K = 0.0118      # base to housing; identified, see below
    mount_exchange_cm2 = 10.0               # base to housing, area x effective emissivity
    drive_power_mW = 0.0                    # heat of the vibration, spread over the shell
    radiation = true                        # false: linearised at the reference temperature
    cells = 24                              # of the shell's meridian; 1 makes it a lump
    stem_radius_mm, stem_length_mm          # of the card's stem; without one a sixth of the radius, and the radius
    conductivity_W_per_m_K, heat_capacity_J_per_kg_K   # of the material table unless given
    note = "..."                            # free text

Shell and stem follow from geometry and material. The mount's conductance is identified from the settling in the HRG
paper's Figure 3 (`studies.papers.settling`); capacities and the chamber's air are assumptions.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from studies.errors import InputError, naming
from studies.files.toml import Section
from thermal.meridian import MeridianCells, cell_names, cut_meridian_table, lump
from thermal.network import Boundary, Network, Part, Source, assemble, linearise
from thermal.resonator import HeatPath, describe_resonator, describe_shell_and_stem

if TYPE_CHECKING:
    from studies.instrument.card import Instrument

KEYS = (
    "film_emissivity",
    "base_heat_capacity_J_per_K",
    "housing_heat_capacity_J_per_K",
    "chamber_conductance_W_per_K",
    "mount_conductance_W_per_K",
    "mount_exchange_cm2",
    "drive_power_mW",
    "radiation",
    "cells",
    "stem_radius_mm",
    "stem_length_mm",
    "conductivity_W_per_m_K",
    "heat_capacity_J_per_kg_K",
    "note",
)
IDENTIFIED_MOUNT = 0.0118  # W/K, for the card hrg-30mm; see studies.papers.settling
FINE = 240  # cells from which one lump is made
ROWS = 4001  # points of the meridian's table


def build_network(instrument: "Instrument", radiation: bool | None = None) -> Network:
    """Build the whole heat path, from the boundary "chamber" to the cells of the shell.

    Parameters
    ----------
    instrument : Instrument
    radiation : bool, optional
        False linearises at the reference temperature; what the card says when absent.
    """
    table = _section(instrument)
    path = build_heat_path(instrument)
    with naming(table.where):
        network = assemble([*describe_resonator(path), *_drive(table, path)])
    wanted = _radiates(table) if radiation is None else radiation
    return network if wanted else linearise(network, instrument.reference_temperature)


def build_shell_and_stem(instrument: "Instrument") -> Network:
    """Build shell and stem alone, on the boundary "base"."""
    return assemble([Boundary("base"), *describe_shell_and_stem(build_heat_path(instrument))])


def build_heat_path(instrument: "Instrument") -> HeatPath:
    """Read the `[thermal]` table beside the card's geometry and material.

    Raises
    ------
    InputError
        An unknown key or an impossible value.
    """
    table = _section(instrument)
    radius, length = stem_size(instrument, table)
    with naming(table.where):
        return HeatPath(
            cells=cut_shell(instrument),
            volumetric_capacity=_volumetric_capacity(instrument, table),
            conductivity=_material_value(instrument, table, "conductivity_W_per_m_K", "conductivity"),
            stem_radius=radius,
            stem_length=length,
            emissivity=table.number("film_emissivity", 0.03, least=0.0, most=1.0),
            base_capacity=table.number("base_heat_capacity_J_per_K", 25.0, above=0.0),
            housing_capacity=table.number("housing_heat_capacity_J_per_K", 70.0, above=0.0),
            mount_conductance=table.number("mount_conductance_W_per_K", IDENTIFIED_MOUNT, above=0.0),
            mount_exchange=1e-4 * table.number("mount_exchange_cm2", 10.0, least=0.0),
            chamber_conductance=table.number("chamber_conductance_W_per_K", 0.1, above=0.0),
        )


def cut_shell(instrument: "Instrument") -> MeridianCells:
    """Cut the shell's meridian, from its root to its free end, into the cells of the network."""
    table = _section(instrument)
    count = int(table.number("cells", 24, least=1, most=400))
    s, r, h = root_to_end(instrument)
    if count == 1:
        return lump(cut_meridian_table(s - s[0], r, h, FINE))
    return cut_meridian_table(s - s[0], r, h, count)


def root_to_end(instrument: "Instrument") -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return distance from the start of the meridian's root (m, from where the stem ends), radius and thickness."""
    resonator = instrument.resonator
    points = resonator.sample(ROWS)
    s, r, h = points.arc_length, points.r, points.thickness
    if resonator.support == "clamped-rim":
        s, r, h = resonator.length - s[::-1], r[::-1], h[::-1]
    root = max(stem_size(instrument, _section(instrument))[0], 1e-3 * float(r.max()))
    first = int(np.argmax(r >= root)) if r[0] < root else 0
    return s[first:], r[first:], h[first:]


def stem_size(instrument: "Instrument", table: Section) -> tuple[float, float]:
    """Return radius and length (m) of the stem's conducting part."""
    resonator = instrument.resonator
    radius, length = resonator.size / 6, resonator.size
    if resonator.stem is not None:
        radius = resonator.stem.radius
        pole = resonator.at([0.0])
        half = float(pole.thickness[0]) / 2
        length = min(abs(float(pole.z[0]) + face * half - end) for face, end in resonator.stem.roots)
    return (
        1e-3 * table.number("stem_radius_mm", 1e3 * radius, above=0.0),
        1e-3 * table.number("stem_length_mm", 1e3 * length, above=0.0),
    )


def _section(instrument: "Instrument") -> Section:
    return Section(instrument.table("thermal"), f"{instrument.path} [thermal]", KEYS)


def _radiates(table: Section) -> bool:
    wanted = table.raw("radiation", True)
    if not isinstance(wanted, bool):
        raise InputError(f"{table.where}: radiation must be true or false, not {wanted!r}.")
    return wanted


def _drive(table: Section, path: HeatPath) -> list[Part]:
    power = 1e-3 * table.number("drive_power_mW", 0.0, least=0.0)
    if power == 0:
        return []
    share = path.cells.volume / path.cells.volume.sum()
    return [Source(name, power * float(s)) for name, s in zip(cell_names(path.cells.count), share, strict=True)]


def _material_value(instrument: "Instrument", table: Section, key: str, name: str) -> float:
    if key in table:
        return table.number(key, above=0.0)
    if name not in instrument.material.properties:
        raise InputError(
            f"{table.where}: no source states the {name.replace('_', ' ')} of {instrument.material.name}; add the key '{key}'."
        )
    return float(instrument.material.value(name, instrument.reference_temperature))


def _volumetric_capacity(instrument: "Instrument", table: Section) -> float | Callable[[float], float]:
    """ρ c in J/(m³ K): a number, or over temperature where the material's heat capacity varies."""
    material, T0 = instrument.material, instrument.reference_temperature
    rho = float(material.value("density", T0))
    key = "heat_capacity_J_per_kg_K"
    if key in table or "heat_capacity" not in material.properties:
        return rho * _material_value(instrument, table, key, "heat_capacity")
    law = material.properties["heat_capacity"]
    if law.form == "constant":
        return rho * float(law(T0))
    return lambda T: rho * float(material.value("heat_capacity", T))
