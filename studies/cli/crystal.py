"""The pairs of a resonator cut from a cubic crystal, for `hrg modes`."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shell.cubic import Cubic
    from shell.modes import Mode


def crystal_pairs(found: "list[Mode]", crystal: "Cubic | None", tolerance: float) -> "dict[int, dict[str, Any]]":
    """Both modes of every lowest pair n >= 2 but multiples of 4, by the identity of the mode in the isotropic mean."""
    if crystal is None:
        return {}
    from shell.cubic import solve_cubic

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


def print_crystal(found: "list[Mode]", pairs: "dict[int, dict[str, Any]]") -> None:
    """Print a table of it."""
    from studies.cli.output import print_table

    rows = [
        [
            str(m.harmonic),
            f"{p['antinode_along_100_Hz']:.4f}",
            f"{p['other_Hz']:.4f}",
            f"{p['split_Hz']:.4f}",
            f"{p['relative_error_estimate']:.0e}",
        ]
        for m in found
        if (p := pairs.get(id(m)))
    ]
    columns = ["n", "antinode along [100] (Hz)", "the other (Hz)", "split (Hz)", "rel. error"]
    note = (
        "Of the crystal with [001] along the axis. The table above, and every other command, take the isotropic mean of its"
        " elastic constants (Voigt)."
    )
    print_table("Pairs in the crystal", columns, rows, note)
