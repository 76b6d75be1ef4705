"""What spin about the axis does to pairs, for `hrg modes --spin`."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shell.elastic import Elastic
    from shell.modes import Mode


def spin_pairs(found: "list[Mode]", elastic: "Elastic", rate: float) -> "dict[int, dict[str, Any]]":
    """What a spin of `rate` °/s makes of each pair, in the frame of the resonator, by the identity of its mode.

    The two waves that run around have f + shift ± g Ω/2π, with g = n K of Bryan's factor K.
    """
    from math import isfinite, pi, radians

    from shell.spin import spin_shift
    from studies.errors import InputError

    if not isfinite(rate):
        raise InputError(f"--spin {rate:g}: it is a rate in °/s.")
    omega = radians(rate)
    entries: dict[int, dict[str, Any]] = {}
    for m in found:
        if m.theory != "solid" or m.harmonic < 2 or m.index:
            continue
        shift = spin_shift(m, elastic)
        parts = {name: getattr(shift, name) * omega**2 for name in ("stress", "centrifugal", "coriolis")}
        mean = m.frequency * (1 + shift.total * omega**2)
        apart = m.harmonic * abs(m.bryan_factor * omega) / (2 * pi)
        entries[id(m)] = {
            "rate_deg_per_s": rate,
            "shift_ppm": 1e6 * shift.total * omega**2,
            **{f"{name}_ppm": 1e6 * value for name, value in parts.items()},
            "lower_wave_Hz": mean - apart,
            "upper_wave_Hz": mean + apart,
        }
    if not entries:
        raise InputError(
            "--spin: the effect of spin is computed for the lowest mode of a harmonic from 2 up, in the solid theory;"
            " none of these modes is one."
        )
    return entries


def print_spin(found: "list[Mode]", spin: "dict[int, dict[str, Any]]") -> None:
    """Print a table of it."""
    from studies.cli.output import print_table

    rows = [
        [
            str(m.harmonic),
            f"{s['lower_wave_Hz']:.5f}",
            f"{s['upper_wave_Hz']:.5f}",
            *(f"{s[name]:+.3g}" for name in ("shift_ppm", "stress_ppm", "centrifugal_ppm", "coriolis_ppm")),
        ]
        for m in found
        if (s := spin.get(id(m)))
    ]
    rate = next(iter(spin.values()))["rate_deg_per_s"]
    columns = ["n", "lower wave (Hz)", "upper wave (Hz)", "mean (ppm)", "stress", "centrifugal", "Coriolis"]
    note = (
        "In the frame of the resonator. The waves lie apart by Bryan's effect; their mean moves by the second order in the rate:"
        " stress of the spin, centrifugal softening, Coriolis forces."
    )
    print_table(f"Spin of {rate:g} °/s", columns, rows, note)
