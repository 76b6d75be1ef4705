"""`hrg electrodes`: what the card's electrodes do to a pair, and the trim voltages that null a split."""

import math
from math import isinf
from typing import Annotated, Any

import numpy as np

from shell.constants import zero_Celsius
from shell.electrodes import reach, trim_voltages
from shell.errors import ShellError
from shell.modes import solve_modes
from studies.cli.arguments import COUNT, POSITIVE, Card, Harmonic, Temperature, open_card
from studies.cli.output import answers
from studies.errors import InputError, naming
from studies.instrument.tables.electrodes import ElectrodeKeys
from studies.resonator.splitting import SplitPair
from studies.results import Part, Result, Sentence, Table, row_of

DUST = 1e-4  # of the largest voltage: what is below does less than 1e-8 of the trim, rounding of the least squares


@answers("hrg.electrodes/1")
def electrodes(
    card: Card,
    *,
    harmonic: Annotated[Harmonic, COUNT] = 2,
    split: Annotated[float | None, POSITIVE] = None,
    axis: float | None = None,
    limit: Annotated[float, POSITIVE] = 100.0,
    temperature: Temperature = None,
) -> Result:
    """Show the effects of the card's table [electrodes] on a mode pair: softening, split, coefficients, pull-in, trim voltages.

    Args:
        split: Split in Hz to be nulled; by default that of the card.
        axis: Azimuth in degrees of an antinode of its slower mode.
        limit: Largest trim voltage in V.
    """
    if (split is None) != (axis is None):
        raise InputError("a split that is to be nulled needs both --split (Hz) and --axis (degrees).")
    instrument, T = open_card(card, temperature)
    if "electrodes" not in instrument.content:
        raise InputError(f"{instrument.path}: no table [electrodes]; add it (gap_um, count, coverage, voltage_V).")
    keys = instrument.part("electrodes").keys
    with naming(f"{instrument.path} [electrodes]"):
        resonator, elastic = instrument.at(T)
        (mode,) = solve_modes(resonator, elastic, harmonic)
        whole = SplitPair(instrument, mode, T)
        charged = instrument.part("electrodes").on(whole.pair, T)
        own = charged.soften()
        if split is not None and axis is not None:
            z = complex(-split / mode.frequency * np.exp(2j * harmonic * np.deg2rad(axis)))
        else:
            z = whole.split.squares[1]
        factor, most = charged.pull_in, reach(charged, limit)
        asked = split is not None or whole.split.resolved
        trim, beyond = None, ""
        try:
            trim = trim_voltages(charged, z, limit) if asked else None
        except ShellError as error:
            if split is not None:
                raise
            beyond = f"The card's split is not nulled: {error}"
    nulled = trim and {
        "voltages_V": trim.voltages, "left_Hz": abs(trim.left) * mode.frequency, "shift_ppm": 1e6 * trim.shift
    }  # fmt: skip
    payload: dict[str, Any] = {
        "card": instrument.name,
        "temperature_degC": T - zero_Celsius,
        "harmonic": harmonic,
        "frequency_Hz": mode.frequency,
        **row_of(own, softening_ppm=("shift", 1e6), split_Hz="hertz", slow_axis_deg=("slow_axis", math.degrees(1))),
        "per_volt_ppm": 1e6 * charged.per_volt(),
        "per_kelvin_ppm": 1e6 * charged.per_kelvin(keys.gap_expansion_per_K),
        "pull_in_factor": factor,
        "limit_V": limit,
        "reach_Hz": most * mode.frequency,
        "trim": nulled,
    }
    return Result(
        payload,
        f"Electrodes of {instrument.name}",
        f"Effect of the electrodes on the pair n = {harmonic} at {mode.frequency:.3f} Hz and {T - zero_Celsius:g} °C.",
        _parts(payload, abs(z) * mode.frequency, beyond, own.resolved, keys),
    )


def _parts(payload: dict[str, Any], split: float, beyond: str, resolved: bool, keys: ElectrodeKeys) -> list[Part]:
    """What people read; `split` in Hz is the one to be nulled, `beyond` why it is not; `resolved` says whether the voltages make one."""
    factor, limit, trim = payload["pull_in_factor"], payload["limit_V"], payload["trim"]
    where = f"{payload['frequency_Hz']:.3f} Hz at {payload['temperature_degC']:g} °C"
    quantities = (
        ("softening by the card's voltages", payload["softening_ppm"], "ppm"),
        ("split by the card's voltages", *((1e3 * payload["split_Hz"], "mHz") if resolved else ("none", ""))),
        ("sensitivity to a change of all voltages", payload["per_volt_ppm"], "ppm/V"),
        ("sensitivity to temperature, through the gap", payload["per_kelvin_ppm"], "ppm/K"),
        ("pull-in safety factor of the voltages", "unlimited" if isinf(factor) else factor, ""),
        (f"largest split nulled by up to {limit:g} V, any axis", 1e3 * payload["reach_Hz"], "mHz"),
    )
    title = f"{payload['card']}, n = {payload['harmonic']}, {where}"
    head = Table(title, quantities, "0: quantity | 1: value | 2: unit")
    if trim is None:
        return [head, Sentence(beyond, "warning") if beyond else None]
    step = 360 / keys.count
    voltages = [
        {"electrode": k, "azimuth": keys.azimuth_deg + step * (k - 1), "voltage": v}
        for k, v in enumerate(trim["voltages_V"], 1)
        if v > DUST * max(trim["voltages_V"])
    ]
    title = f"Trim voltages for a split of {1e3 * split:.4g} mHz, in addition to the card's own voltages"
    note = f"They lower the frequency of the pair by {abs(trim['shift_ppm']):.3g} ppm. Squares of voltages add; in a card they are trim_V, in order from electrode 1 at azimuth_deg."
    columns = "electrode | azimuth: azimuth (°) .2f | voltage: voltage (V) .4"
    return [head, Table(title, voltages, columns, note)]
