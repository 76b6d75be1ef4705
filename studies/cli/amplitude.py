"""What a large amplitude does to modes, for `hrg modes --amplitude`."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shell.modes import Mode

MICROMETRE = 1e-6


def describe_amplitude(found: "list[Mode]", amplitude: float) -> "dict[int, dict[str, Any]]":
    """The shift of each mode in ppb by its largest displacement of `amplitude` µm, by the identity of the mode."""
    from math import isfinite

    from shell.duffing import amplitude_shift
    from studies.errors import InputError

    if not (isfinite(amplitude) and amplitude > 0):
        raise InputError(f"--amplitude {amplitude:g}: it is a largest displacement in µm, above 0.")
    entries: dict[int, dict[str, Any]] = {}
    for m in found:
        if m.theory != "solid" or m.harmonic < 2:
            continue
        shift, square = amplitude_shift(m), (amplitude * MICROMETRE) ** 2
        entries[id(m)] = {
            "amplitude_um": amplitude,
            "shift_ppb": 1e9 * shift.total * square,
            "static_ppb": 1e9 * shift.static * square,
            "inertial_ppb": 1e9 * shift.inertial * square,
            "shift_Hz_per_um2": shift.total * m.frequency * MICROMETRE**2,
        }
    if not entries:
        raise InputError(
            "--amplitude: the effect of the amplitude is computed for harmonics from 2 up, in the solid theory;"
            " none of these modes is one."
        )
    return entries


def print_amplitude(found: "list[Mode]", amplitude: "dict[int, dict[str, Any]]") -> None:
    """Print a table of it."""
    from studies.cli.output import print_table

    rows = [
        [
            str(m.harmonic),
            str(m.index),
            *(f"{s[name]:+.4g}" for name in ("shift_ppb", "static_ppb", "inertial_ppb", "shift_Hz_per_um2")),
        ]
        for m in found
        if (s := amplitude.get(id(m)))
    ]
    largest = next(iter(amplitude.values()))["amplitude_um"]
    note = (
        "Largest displacement of a standing wave; the shift goes with its square. By geometry alone: the bent shape stiffens, the"
        " motion at twice the frequency that relieves it loads. Elastic constants of higher order, which in thick shells may"
        " count as much, and the springs of electrodes come besides."
    )
    columns = ["n", "index", "shift (ppb)", "bent shape", "motion at 2f", "Hz/µm²"]
    print_table(f"Amplitude of {largest:g} µm", columns, rows, note)
