"""The pairs of a resonator cut from a cubic crystal, for `hrg modes`."""

from typing import Any

from shell.cubic import Cubic, solve_cubic
from shell.modes import Mode
from studies.results import Column, Table


def crystal_pairs(found: list[Mode], crystal: Cubic | None, tolerance: float) -> dict[int, dict[str, Any]]:
    """Both modes of every lowest pair n >= 2 but multiples of 4, by the identity of the mode in the isotropic mean."""
    if crystal is None:
        return {}

    entries: dict[int, dict[str, Any]] = {}
    for m in found:
        if m.theory != "solid" or m.harmonic < 2 or m.harmonic % 4 == 0 or m.index:
            continue
        assert m.resonator is not None
        pair = solve_cubic(m.resonator, crystal, m.harmonic, tolerance)
        entries[id(m)] = {
            "antinode_along_100_Hz": pair.along_100,
            "other_Hz": pair.along_110,
            "split_Hz": abs(pair.along_110 - pair.along_100),
            "relative_split": pair.relative_split,
            "relative_error_estimate": pair.relative_error_estimate,
        }
    return entries


def crystal_table(modes: list[dict[str, Any]]) -> Table:
    """The table of modes with `crystal`."""
    columns = [
        Column("harmonic", "n"),
        Column("crystal.antinode_along_100_Hz", "antinode along [100]", "Hz", ".4f"),
        Column("crystal.other_Hz", "other mode", "Hz", ".4f"),
        Column("crystal.split_Hz", "split", "Hz", ".4f"),
        Column("crystal.relative_error_estimate", "solver error, relative", form=".0e"),
    ]
    note = "[001] along the axis. The table above and every other command use the isotropic (Voigt) mean of the elastic constants."
    return Table("Pairs of the anisotropic crystal", [row for row in modes if "crystal" in row], columns, note)
