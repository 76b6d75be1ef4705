"""What a base that expands otherwise does to modes, for `hrg modes`."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shell.modes import Mode
    from studies.instrument.card import Instrument


def describe_mount(found: "list[Mode]", instrument: "Instrument", T: float) -> "dict[int, dict[str, Any]]":
    """Shift and slope of each pair by the stress of [mount] at T (K), by the identity of the mode."""
    from shell.law import check_mount
    from shell.prestress import Prestress
    from studies.errors import naming

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


def print_mount(found: "list[Mode]", mount: "dict[int, dict[str, Any]]") -> None:
    """Print a table of it."""
    from studies.cli.output import print_table

    rows = [
        [
            str(m.harmonic),
            str(m.index),
            f"{s['per_strain']:+.4g}",
            f"{s['shift_ppm']:+.4g}",
            f"{s['slope_ppm_per_degC']:+.3g}",
        ]
        for m in found
        if (s := mount.get(id(m)))
    ]
    strain = next(iter(mount.values()))["strain_ppm"]
    note = (
        f"The base has grown by {strain:.4g} ppm more than the resonator since they were joined. By the stress and the shape that this"
        " gives, to first order; the frequencies above are those without it, those of hrg tcf and of simulations have it."
    )
    print_table("Mount", ["n", "index", "per strain", "shift (ppm)", "slope (ppm/°C)"], rows, note)
