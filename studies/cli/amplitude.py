"""What a large amplitude does to modes, for `hrg modes --amplitude`."""

from math import isfinite
from typing import Any

from shell.duffing import amplitude_shift
from shell.modes import Mode
from studies.errors import InputError
from studies.results import Column, Table

MICROMETRE = 1e-6


def describe_amplitude(found: list[Mode], amplitude: float) -> dict[int, dict[str, Any]]:
    """The shift of each mode in ppb by its largest displacement of `amplitude` µm, by the identity of the mode."""
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


def amplitude_table(modes: list[dict[str, Any]]) -> Table:
    """The table of modes with `amplitude`."""
    rows = [row for row in modes if "amplitude" in row]
    columns = [
        Column("harmonic", "n"),
        Column("index", "index"),
        Column("amplitude.shift_ppb", "shift", "ppb", "+.4g"),
        Column("amplitude.static_ppb", "static", "ppb", "+.4g"),
        Column("amplitude.inertial_ppb", "inertial", "ppb", "+.4g"),
        Column("amplitude.shift_Hz_per_um2", "coefficient", "Hz/µm²", "+.4g"),
    ]
    largest = f" of {rows[0]['amplitude']['amplitude_um']:g} µm" if rows else ""
    note = (
        "Standing wave; the shift is proportional to the square of the largest displacement. Geometric nonlinearity only: the static"
        " part stiffens, the inertia of the motion at twice the frequency softens. Third-order elastic constants, which may matter as much in thick shells,"
        " and electrostatic springs are not included."
    )
    return Table(f"Effect of an amplitude{largest}", rows, columns, note)
