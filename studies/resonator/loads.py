"""What static loads do to a card: its frequency under an uneven temperature, and its bias as gravity shifts the wall in its electrodes."""

from dataclasses import dataclass
from math import atan2, degrees, hypot

import numpy as np

from shell.loads import Loads
from shell.modes import solve_modes
from studies.instrument.card import Instrument
from studies.loss.damping_law import settled_loss
from studies.resonator.law import law_of
from studies.simulation.loop import settled_columns

STANDARD_GRAVITY = 9.80665  # m/s²
SMALL = 0.1  # % of the gap, over which the bias is differenced


@dataclass(frozen=True)
class BiasSensitivity:
    """Bias by an acceleration across the axis (°/h per g), largest towards `azimuth_deg`; `gap` the shift over the electrodes, m per g."""

    deg_per_h_per_g: float
    azimuth_deg: float
    gap: float


def loads_of(instrument: Instrument, temperature: float, harmonic: int = 2) -> Loads:
    """Return the loads of a card's resonator on its lowest mode of a harmonic at a temperature (K)."""
    resonator, elastic = instrument.at(temperature)
    return Loads(solve_modes(resonator, elastic, harmonic)[0], elastic)


def shift_per_kelvin(instrument: Instrument, loads: Loads, temperature: float) -> float:
    """δ ln f per kelvin by which the base is warmer than the free end, the base as warm as before, 1/K."""
    law = law_of(instrument, temperature, temperature, "solid", loads.mode.harmonic)
    return -float(law.sensitivity(temperature) @ loads.away(law.along.position))


def bias_by_tilt(instrument: Instrument, loads: Loads, temperature: float) -> BiasSensitivity | None:
    """Return the bias by a shift of the wall within its charged electrodes: a gap of order 1 splits the pair; None without loop or charge."""
    card = instrument.part("electrodes")
    if instrument.loop is None or "electrodes" not in instrument.content or not card.are_charged:
        return None
    inverse_q, settled = settled_loss(instrument, temperature)
    waves = list(instrument.content["electrodes"].get("gap_wave", []))
    f, losses = np.array([loads.mode.frequency]), np.array([inverse_q])

    def bias(percent: float, azimuth: float) -> float:
        wave = {"order": 1, "amplitude_percent": percent, "azimuth_deg": azimuth}
        moved = settled.with_table("electrodes", {**settled.content["electrodes"], "gap_wave": [*waves, wave]})
        return float(settled_columns(moved, f, losses, loads.mode.bryan_factor)["bias_deg_per_h"][0])

    gap = STANDARD_GRAVITY * loads.gap("lateral", card.keys.first, card.keys.last)
    share = 100 * abs(gap) / (1e-6 * card.keys.gap_um) / (2 * SMALL)
    x, y = (share * (bias(SMALL, azimuth) - bias(-SMALL, azimuth)) for azimuth in (0.0, 90.0))
    return BiasSensitivity(hypot(x, y), degrees(atan2(y, x)), gap)
