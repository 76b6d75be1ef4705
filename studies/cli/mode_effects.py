"""What else `hrg modes` shows of a mode: imperfections, a mount, films, a crystal.

Each function returns what is under its key of a mode in the JSON, or None where it does not apply; `TABLES` shows the keys.
"""

from dataclasses import dataclass
from math import degrees
from typing import TYPE_CHECKING, Any

from shell.errors import ShellError
from shell.law import check_mount
from shell.modes import Mode
from shell.prestress import Prestress
from studies.errors import naming
from studies.instrument.card import Instrument
from studies.loss.films import film_shifts
from studies.results import Column, Table, row_of

if TYPE_CHECKING:
    from shell.imperfection import Split

Entry = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Asked:
    """The card at T (K), and the largest error that was asked of its modes."""

    instrument: Instrument
    T: float
    tolerance: float


def describe_effects(mode: Mode, asked: Asked) -> dict[str, Any]:
    """Return what applies to a mode, by its key."""
    return {key: entry for key, describe in EFFECTS.items() if (entry := describe(mode, asked)) is not None}


def _split(m: Mode, asked: Asked) -> Entry | None:
    """What the card's imperfection and electrodes make of a pair."""
    if m.theory == "rayleigh" or m.harmonic < 1 or not asked.instrument.is_imperfect:
        return None
    from studies.resonator.splitting import SplitPair

    whole = SplitPair(asked.instrument, m, asked.T)
    slow, fast = whole.split.frequencies

    def told(one: "Split") -> Entry:
        return row_of(one, split_Hz="hertz", slow_axis_deg=("slow_axis", degrees(1)), shift_ppm=("shift", 1e6))

    parts = {name: told(getattr(whole, name)) for name in ("imperfection", "measured", "electrodes")}
    every = {"slow_Hz": slow, "fast_Hz": fast, "every_order_split_Hz": whole.of_every_order().hertz, "parts": parts}
    return told(whole.split) | every


def _mount(m: Mode, asked: Asked) -> Entry | None:
    """Shift and slope of a pair by the stress of [mount]."""
    instrument, mount = asked.instrument, asked.instrument.part("mount")
    if mount is None or m.theory != "solid" or not m.harmonic:
        return None
    with naming(f"{instrument.path} [mount]"):
        strain, slope = (float(x(instrument.material, asked.T)) for x in (mount.strain, mount.strain_slope))
        check_mount(instrument.resonator, m.theory, m.harmonic)
        s = Prestress(m).by_base
    return {
        "strain_ppm": 1e6 * strain,
        "shift_ppm": 1e6 * s * strain + 0.0,  # no -0
        "slope_ppm_per_degC": 1e6 * s * slope,
        "per_strain": s,
    }


def _films(m: Mode, asked: Asked) -> list[Entry] | None:
    """Every film and its shift in ppm, null where its numbers are not known."""
    if m.theory == "rayleigh":
        return None
    shifts = film_shifts(asked.instrument, m)
    return [row_of(one, "missing", film="material", shift_ppm=("relative", 1e6)) for one in shifts] or None


def _crystal(m: Mode, asked: Asked) -> Entry | None:
    """Both modes of a lowest pair n >= 2 but multiples of 4."""
    given, material = asked.instrument.keys("material").cubic, asked.instrument.material
    crystal = given or material.cubic(asked.T)
    if crystal is None or m.theory != "solid" or m.harmonic < 2 or m.harmonic % 4 == 0 or m.index:
        return None
    from shell.cubic import solve_cubic

    assert m.resonator is not None
    try:
        pair = solve_cubic(m.resonator, crystal, m.harmonic, asked.tolerance)
    except ShellError:
        if given is not None:
            raise
        return None  # of a stem or a clamp; the material's caveat says so
    axes = {"antinode_along_100_Hz": "along_100", "other_Hz": "along_110"}
    lines = row_of(pair, "relative_split", "relative_error_estimate", **axes)
    return lines | {"split_Hz": abs(pair.along_110 - pair.along_100)}


EFFECTS = {
    "split": _split,
    "mount": _mount,
    "films": _films,
    "crystal": _crystal,
}

MODE = "harmonic: n | index"
SPLIT = (
    f"{MODE} | split.slow_Hz: slow (Hz) .5f | split.fast_Hz: fast (Hz) .5f | split.split_Hz: split (Hz) .5f"
    " | split.every_order_split_Hz: split, all orders (Hz) .5f | split.slow_axis_deg: slow axis (°) .2f"
    " | split.shift_ppm: shift (ppm) +.3f"
)
MOUNT = (
    f"{MODE} | mount.per_strain: per strain +.4g | mount.shift_ppm: shift (ppm) +.4g"
    " | mount.slope_ppm_per_degC: slope (ppm/°C) +.3g"
)
FILMS = (
    f"{MODE} | film | shift_ppm: shift (ppm) +.4g",
    Column(lambda film: " and ".join(film["missing"]), "unknown without"),
)
CRYSTAL = (
    "harmonic: n | crystal.antinode_along_100_Hz: antinode along [100] (Hz) .4f | crystal.other_Hz: other mode (Hz) .4f"
    " | crystal.split_Hz: split (Hz) .4f | crystal.relative_error_estimate: solver error, relative .0e"
)
MISMATCH = (
    "The base has expanded {:.4g} ppm more than the resonator since they were joined. First order in the resulting stress"
    " and deformation. The frequencies above do not include it; those of hrg tcf and of simulations do."
)
BARE = "By stiffness and mass, to first order in the thickness. The frequencies above are those of the bare wall."
VOIGT = "[001] along the axis. The table above and every other command use the isotropic (Voigt-Reuss-Hill) mean of the elastic constants."


def effect_tables(modes: list[dict[str, Any]]) -> list[Table]:
    """Return the tables of what applies to the modes."""

    def those(key: str) -> list[dict[str, Any]]:
        return [row for row in modes if key in row]

    strain = next((row["mount"]["strain_ppm"] for row in those("mount")), 0.0)
    films = [row | film for row in those("films") for film in row["films"]]
    antinode = "Slow axis: an antinode of the slower mode."
    return [
        Table("Pairs with imperfections and electrodes", those("split"), SPLIT, antinode),
        Table("Thermal mismatch with the base", those("mount"), MOUNT, MISMATCH.format(strain)),
        Table("Effect of the films", films, FILMS, BARE),
        Table("Pairs of the anisotropic crystal", those("crystal"), CRYSTAL, VOIGT),
    ]
