"""What spin about the axis does to pairs, for `hrg modes --spin`."""

from math import isfinite, pi, radians
from typing import Any

from shell.elastic import Elastic
from shell.modes import Mode
from shell.spin import spin_shift
from studies.errors import InputError
from studies.results import Column, Table


def spin_pairs(found: list[Mode], elastic: Elastic, rate: float) -> dict[int, dict[str, Any]]:
    """What a spin of `rate` °/s makes of each pair, in the frame of the resonator, by the identity of its mode.

    The two waves that run around have f + shift ± g Ω/2π, with g = n K of Bryan's factor K.
    """
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


def spin_table(modes: list[dict[str, Any]]) -> Table:
    """The table of modes with `spin`."""
    rows = [row for row in modes if "spin" in row]
    columns = [
        Column("harmonic", "n"),
        Column("spin.lower_wave_Hz", "lower wave", "Hz", ".5f"),
        Column("spin.upper_wave_Hz", "upper wave", "Hz", ".5f"),
        Column("spin.shift_ppm", "shift of the mean", "ppm", "+.3g"),
        Column("spin.stress_ppm", "by stress", "ppm", "+.3g"),
        Column("spin.centrifugal_ppm", "centrifugal", "ppm", "+.3g"),
        Column("spin.coriolis_ppm", "Coriolis", "ppm", "+.3g"),
    ]
    rate = f" at {rows[0]['spin']['rate_deg_per_s']:g} °/s" if rows else ""
    note = (
        "In the frame of the resonator. Bryan's effect separates the two waves; their mean shifts with the square of the rate,"
        " by the stress of rotation, centrifugal softening and Coriolis forces."
    )
    return Table(f"Effects of rotation{rate}", rows, columns, note)
