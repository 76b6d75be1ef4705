"""The one forward model: what an instrument's record is, without noise, and how it changes with every value of its card."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from compensation.arrays import Array
from compensation.decimation import curvature
from shell.constants import zero_Celsius
from studies.effects import find_effect
from studies.loss.damping_law import DampingLaw
from studies.resonator.law import law_of
from studies.simulation.drive import COLUMN, Drive
from studies.simulation.response import Temperatures, observed_rows, read_out
from studies.simulation.variations import JUMP, LAG, SHIFT, Side, Variations, slope_of_reading
from thermal.network import Network
from thermal.profile import Profile
from thermal.sensitivity import respond

if TYPE_CHECKING:
    from shell.law import FrequencyLaw
    from shell.layout import Theory
    from studies.instrument.card import Instrument

MARGIN = 10.0  # K beyond the boundary in which the frequency stays known
SHIFT_STEP = 0.02  # s


@dataclass(frozen=True)
class Prediction:
    """A record without noise."""

    drive: Drive
    # `housing_temperature_degC` (as its sensor reads it), `resonator_temperature_degC`, `frequency_Hz`,
    # `bias_deg_per_h`, `inverse_q`: arrays (N,).
    columns: Mapping[str, Array]
    # Of each value that was asked for, by name: the derivative of every column by it, in the unit of its key.
    derivatives: Mapping[str, Mapping[str, Array]]
    housing: Array  # array (N,), K: The housing itself
    law: "FrequencyLaw"
    network: Network
    temperatures: Temperatures  # what the gyro reads its columns at
    damping: DampingLaw | None


def predict(
    instrument: "Instrument",
    drive: Drive,
    derivatives: Sequence[str] | Variations = (),
    law: "FrequencyLaw | None" = None,
    longest: float | None = None,
    housing_only: bool = False,
) -> Prediction:
    """Predict the record of a run, and its derivatives by names or by `Variations` that runs share, of the `housing_only` where no other counts.

    Names are keys of the card, departures "initial.base" (K), "shift" (s), "jump.0" (s), "kink.7" (K, before row 7);
    `longest` is between the knots of what radiation adds.
    """
    if law is None:
        law = law_for(instrument, drive)
    varied = derivatives if isinstance(derivatives, Variations) else Variations(instrument, law, tuple(derivatives))
    network = varied.here.driven(drive.boundary)
    rows = observed_rows(instrument, law, tuple(node.name for node in network.nodes))
    imposed, lines = _impose(instrument, drive)
    boundary: dict[str, Profile] = {drive.boundary: lines}
    shapes = varied.here.departures(drive)
    departure = sum((value * shapes[name] for name, value in drive.initial.items()), np.zeros(network.count))
    changes = {name: change for name in varied.names if (change := varied.change(name, drive)) is not None}
    thermal = respond(network, boundary, drive.time, rows, list(changes.values()), departure, longest)
    found, reading = Temperatures(thermal.temperature[:, :6], thermal.rate[:, :6]), thermal.temperature[:, 6]
    if drive.boundary == "housing":
        found.value[:, 0], reading = imposed.at(drive.time), drive.profile.at(drive.time)
    columns = {COLUMN["housing"]: reading - zero_Celsius}
    columns |= read_out(instrument, law, drive, found, varied.here.lags(drive.boundary), varied.here.damping)
    slopes = {}
    for name in varied.names:
        along, read = partial(_still, found), np.zeros(len(drive.time))
        if name == SHIFT or name.startswith(JUMP):
            slope, rate = _slope_of_timing(network, drive, name, rows, departure, longest)
            along, read = partial(found.moved, slope[:, :6], rate[:, :6]), slope[:, 6]
        elif name in changes:
            k = list(changes).index(name)
            slope, rate = thermal.slope[k], thermal.rate_slope[k]
            if drive.boundary == "housing" and changes[name].boundaries:
                slope[:, 0] = changes[name].boundaries["housing"].at(drive.time)
            along, read = partial(found.moved, slope[:, :6], rate[:, :6]), slope[:, 6]
        elif name == LAG:
            read = _slope_of_lag(
                varied.sides(name), boundary, drive.time, departure, longest, thermal.temperature[:, 6]
            )
        slopes[name] = {COLUMN["housing"]: read}
        if housing_only:
            continue
        below, above = (
            read_out(side.instrument, side.law, drive, along(side.distance), side.lags(drive.boundary), side.damping)
            for side in varied.sides(name)
        )
        step = np.ptp([side.distance for side in varied.sides(name)])
        slopes[name] |= {column: (above[column] - below[column]) / step for column in above}
    network = varied.here.network(drive.boundary)
    return Prediction(drive, columns, slopes, found.value[:, 0], law, network, found, varied.here.damping)


def law_for(
    instrument: "Instrument", drive: Drive, margin: float = MARGIN, theory: "Theory" = "solid"
) -> "FrequencyLaw":
    """Build the frequency law over the temperatures of a drive, with what parts depart from them at its start, and the reference."""
    return law_about(
        instrument, drive.profile.value, margin + max(map(abs, drive.initial.values()), default=0.0), theory
    )


def law_about(
    instrument: "Instrument", imposed: "Array", margin: float = MARGIN, theory: "Theory" = "solid"
) -> "FrequencyLaw":
    """Build it over imposed temperatures (K); over all that the material allows where a power or effects warm the resonator."""
    if instrument.keys("thermal").drive_power_mW or any(find_effect(one.name).thermal for one in instrument.effects):
        return law_of(instrument, theory=theory)
    reached = np.append(imposed, instrument.reference_temperature)
    return law_of(instrument, float(reached.min()) - margin, float(reached.max()) + margin, theory)


def _impose(instrument: "Instrument", drive: Drive) -> tuple[Profile, Profile]:
    """Temperature that is imposed, of the housing y + τ dy/dt of its sensor (not of jumps): at its rows, and as lines between them."""
    read = drive.imposed
    if drive.boundary == "chamber" or read.jumps.size:
        return read, read
    lag = instrument.noise.housing_lag_s * slope_of_reading(read)
    return Profile(read.time, read.value + lag), drive.kinked(Profile(read.time, of_equal_area(read).value + lag))


def of_equal_area(curve: Profile) -> Profile:
    """Straight lines between the rows of a smooth curve T(t), with the area under it: rows moved by h² T''/12, not at a corner nor beside a gap."""
    h = np.diff(curve.time)
    before, after = h[:-1], h[1:]
    bend = _lasting(curvature(curve.time, curve.value))[1:-1] * (before**3 + after**3) / (12 * (before + after))
    return Profile(curve.time, curve.value - np.concatenate([[0.0], bend, [0.0]]))


def _lasting(bend: Array) -> Array:
    """Return of T'' at each row what a neighbour has as well, of the two the larger: of a lone corner, or of noise, nothing (minmod)."""
    small = np.where(bend[1:] * bend[:-1] > 0.0, np.minimum(np.abs(bend[1:]), np.abs(bend[:-1])), 0.0)
    return np.asarray(np.sign(bend) * np.maximum(np.append(0.0, small), np.append(small, 0.0)))


def _slope_of_timing(
    network: Network, drive: Drive, name: str, rows: Array, departure: Array, longest: float | None
) -> tuple[Array, Array]:
    """Derivatives of `Temperatures` by the time of the boundary or of a jump (K/s, K/s²): differences, of a jump to earlier times only."""

    def moved(step: float) -> Drive:
        if name == SHIFT:
            return replace(drive, shift=drive.shift + step)
        k = int(name.removeprefix(JUMP))
        return replace(drive, jumps={**drive.jumps, k: drive.jumps.get(k, 0.0) + step})

    steps = (-SHIFT_STEP, SHIFT_STEP if name == SHIFT else 0.0)
    below, above = (
        respond(network, {drive.boundary: moved(step).imposed}, drive.time, rows, (), departure, longest)
        for step in steps
    )
    distance = steps[1] - steps[0]
    return (above.temperature - below.temperature) / distance, (above.rate - below.rate) / distance


def _slope_of_lag(
    sides: Sequence[Side], boundary: Mapping[str, Profile], time: Array, departure: Array, longest: float | None,
    here: Array,
) -> Array:  # fmt: skip
    """Derivative of the reading of a predicted housing, `here`, by its sensor's time constant (K/s): it may be shorter than a sweep's steps."""
    reading = np.zeros((1, len(departure)))
    reading[0, -1] = 1.0
    side = max(sides, key=lambda one: abs(one.distance))
    moved = respond(side.driven("chamber"), boundary, time, reading, (), departure, longest).temperature[:, 0]
    return np.asarray((moved - here) / side.distance)


def _still(found: Temperatures, _: float) -> Temperatures:
    return found
