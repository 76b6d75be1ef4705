"""What a base that expands otherwise does to modes, for `hrg modes`."""

from typing import Any

from shell.law import check_mount
from shell.modes import Mode
from shell.prestress import Prestress
from studies.errors import naming
from studies.instrument.card import Instrument
from studies.results import Column, Table


def describe_mount(found: list[Mode], instrument: Instrument, T: float) -> dict[int, dict[str, Any]]:
    """Shift and slope of each pair by the stress of [mount] at T (K), by the identity of the mode."""
    mount = instrument.part("mount")
    if mount is None:
        return {}
    entries: dict[int, dict[str, Any]] = {}
    with naming(f"{instrument.path} [mount]"):
        strain, slope = (float(x(instrument.material, T)) for x in (mount.strain, mount.strain_slope))
        for m in found:
            if m.theory == "solid" and m.harmonic:
                check_mount(instrument.resonator, m.theory, m.harmonic)
                s = Prestress(m).by_base
                entries[id(m)] = {
                    "strain_ppm": 1e6 * strain,
                    "shift_ppm": 1e6 * s * strain + 0.0,  # no -0
                    "slope_ppm_per_degC": 1e6 * s * slope,
                    "per_strain": s,
                }
    return entries


def mount_table(modes: list[dict[str, Any]]) -> Table:
    """The table of modes with `mount`."""
    rows = [row for row in modes if "mount" in row]
    columns = [
        Column("harmonic", "n"),
        Column("index", "index"),
        Column("mount.per_strain", "per strain", form="+.4g"),
        Column("mount.shift_ppm", "shift", "ppm", "+.4g"),
        Column("mount.slope_ppm_per_degC", "slope", "ppm/°C", "+.3g"),
    ]
    strain = rows[0]["mount"]["strain_ppm"] if rows else 0.0
    note = (
        f"The base has expanded {strain:.4g} ppm more than the resonator since they were joined. First order in the resulting stress"
        " and deformation. The frequencies above do not include it; those of hrg tcf and of simulations do."
    )
    return Table("Thermal mismatch with the base", rows, columns, note)
