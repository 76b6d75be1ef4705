"""The one forward model: what an instrument's record is, without noise, and how it changes with every value of its card.

Temperatures and their derivatives come from the network (`thermal.sensitivity`); what the gyro reads at them is algebra
(`studies.simulation.response`), whose derivatives are differences along the change of values and temperatures together.
"""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from shell.constants import zero_Celsius
from studies.errors import InputError
from studies.instrument.dotted import look_up
from studies.loss.damping_law import DampingLaw, damping_law
from studies.resonator.law import law_of, moved_law
from studies.simulation.drive import COLUMN, Drive
from studies.simulation.heat_path import SENSOR, build_network, departures, slowest_lag, with_sensor
from studies.simulation.response import Temperatures, check_loss, observed_rows, read_out
from thermal.network import Network
from thermal.profile import Profile
from thermal.sensitivity import NetworkChange, difference, no_change, respond

if TYPE_CHECKING:
    from shell.law import FrequencyLaw
    from shell.levels import Theory
    from studies.instrument.card import Instrument

Array = NDArray[np.float64]
MARGIN = 10.0  # K beyond the boundary in which the frequency stays known: the drive's own heat
STEP = 1e-3  # of a value, or of its standard deviation: the differences that give derivatives
INITIAL = "initial."
SHIFT, JUMP, KINK = "shift", "jump.", "kink."
SHIFT_STEP = 0.02  # s
OF_WALL = ("thermal.conductivity_W_per_m_K", "thermal.heat_capacity_J_per_kg_K")
"""Values of the heat path that the loss of a wall takes as well."""
HEATED = ("thermal", "material", "resonator", "law")
"""Tables whose values the temperatures may depend on."""
LAG = "noise.housing_lag_s"
GAP = 3.0  # usual distances of rows, across which nothing is known of a curve


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
    derivatives: "Sequence[str] | Variations" = (),
    law: "FrequencyLaw | None" = None,
    longest: float | None = None,
) -> Prediction:
    """Predict the record of a run.

    Args:
        derivatives: names, or `Variations` of this instrument that several runs share Keys of the card
            ("thermal.mount_conductance_W_per_K"), "initial.base" (K) and whatever else of the drive may depart, "shift"
            (s), "jump.0" (s) and the other jumps of its profile, "kink.7" (K) before its row 7.
        law: One that was built before for this instrument and a range that is wide enough.
        longest: Between the knots of what radiation adds; the error goes with its fourth power.
    """
    if law is None:
        law = law_for(instrument, drive)
    varied = derivatives if isinstance(derivatives, Variations) else Variations(instrument, law, tuple(derivatives))
    network = varied.driven(drive.boundary)
    rows = observed_rows(instrument, law, tuple(node.name for node in network.nodes))
    imposed, lines = _impose(instrument, drive)
    boundary: dict[str, Profile] = {drive.boundary: lines}
    shapes = varied.departures(drive)
    departure = sum((value * shapes[name] for name, value in drive.initial.items()), np.zeros(network.count))
    changes = {name: change for name in varied.names if (change := varied.change(name, drive)) is not None}
    thermal = respond(network, boundary, drive.time, rows, list(changes.values()), departure, longest)
    found, reading = Temperatures(thermal.temperature[:, :6], thermal.rate[:, :6]), thermal.temperature[:, 6]
    if drive.boundary == "housing":
        found.value[:, 0], reading = imposed.at(drive.time), drive.profile.at(drive.time)
    columns = {COLUMN["housing"]: reading - zero_Celsius}
    columns |= read_out(instrument, law, drive, found, varied.lag(drive.boundary), varied.damping)
    check_loss(instrument, columns["inverse_q"])
    slopes = {}
    for name in varied.names:
        along, read = partial(_still, found), np.zeros(len(drive.time))
        if name == SHIFT or name.startswith(JUMP):
            slope, rate = _slope_of_timing(network, drive, name, rows, departure)
            along, read = partial(found.moved, slope[:, :6], rate[:, :6]), slope[:, 6]
        elif name in changes:
            k = list(changes).index(name)
            slope, rate = thermal.slope[k], thermal.rate_slope[k]
            if drive.boundary == "housing" and changes[name].boundaries:
                slope[:, 0] = changes[name].boundaries["housing"].at(drive.time)
            along, read = partial(found.moved, slope[:, :6], rate[:, :6]), slope[:, 6]
        elif name == LAG:
            read = _slope_of_lag(varied.sides(name), boundary, drive.time, departure)
        below, above = (
            read_out(side.instrument, side.law, drive, along(side.distance), side.lag(drive.boundary), side.damping)
            for side in varied.sides(name)
        )
        step = np.ptp([side.distance for side in varied.sides(name)])
        slopes[name] = {COLUMN["housing"]: read} | {column: (above[column] - below[column]) / step for column in above}
    network = varied.network(drive.boundary)
    return Prediction(drive, columns, slopes, found.value[:, 0], law, network, found, varied.damping)


def law_for(
    instrument: "Instrument", drive: Drive, margin: float = MARGIN, theory: "Theory" = "solid"
) -> "FrequencyLaw":
    """Build the frequency law over the temperatures of a drive and of the reference, and some kelvin more.

    Over all that the material allows where the card has effects on the temperature: how far they go is not known before.
    """
    from studies.effects import find_effect

    if any(find_effect(one.name).thermal for one in instrument.effects):
        return law_of(instrument, theory=theory)
    reached = np.append(drive.profile.value, instrument.reference_temperature)
    return law_of(instrument, float(reached.min()) - margin, float(reached.max()) + margin, theory)


def _impose(instrument: "Instrument", drive: Drive) -> tuple[Profile, Profile]:
    """Temperature that is imposed, of the housing what its sensor will have read, y + τ dy/dt: at its rows, and as lines between them.

    The area of τ dy/dt, the sum of central differences, is right as it is. What jumps is behind no sensor.
    """
    read = drive.imposed
    if drive.boundary == "chamber" or read.jumps.size:
        return read, read
    if instrument.polynomial is not None:  # it follows what was read, linear between its rows
        return read, drive.kinked(read)
    lag = instrument.noise.housing_lag_s * _slope_of_reading(read)
    return Profile(read.time, read.value + lag), drive.kinked(Profile(read.time, of_equal_area(read).value + lag))


def of_equal_area(curve: Profile) -> Profile:
    """Straight lines between the rows of a smooth curve T(t), with the area under it.

    Straight lines through its rows leave out h³ T''/12 between two of them; rows moved by h² T''/12 do not. What follows
    with a time constant of many rows takes in the area. Beside a gap the rows stay.
    """
    h = np.diff(curve.time)
    before, after = h[:-1], h[1:]
    bend = np.diff(np.diff(curve.value) / h) * (before**3 + after**3) / (6 * (before + after) ** 2)
    bend[np.maximum(before, after) > GAP * np.median(h)] = 0.0
    return Profile(curve.time, curve.value - np.concatenate([[0.0], bend, [0.0]]))


def _slope_of_reading(read: Profile) -> Array:
    """Slope at the rows (K/s): zero at the first, where the gyro has settled and the sensor with it."""
    slope: Array = np.gradient(read.value, read.time)
    slope[0] = 0.0
    return slope


def _slope_of_timing(network: Network, drive: Drive, name: str, rows: Array, departure: Array) -> tuple[Array, Array]:
    """Derivatives of `Temperatures` by the time of the boundary or of one of its jumps (K/s, K/s²): differences.

    A jump is moved to earlier times only: at a row there is a kink.
    """

    def moved(step: float) -> Drive:
        if name == SHIFT:
            return replace(drive, shift=drive.shift + step)
        k = int(name.removeprefix(JUMP))
        return replace(drive, jumps={**drive.jumps, k: drive.jumps.get(k, 0.0) + step})

    steps = (-SHIFT_STEP, SHIFT_STEP if name == SHIFT else 0.0)
    below, above = (
        respond(network, {drive.boundary: moved(step).imposed}, drive.time, rows, departure=departure) for step in steps
    )
    distance = steps[1] - steps[0]
    return (above.temperature - below.temperature) / distance, (above.rate - below.rate) / distance


def _slope_of_lag(sides: "Sequence[Side]", boundary: Mapping[str, Profile], time: Array, departure: Array) -> Array:
    """Derivative of the reading of a predicted housing by its sensor's time constant (K/s): it may be shorter than a sweep's steps."""
    reading = np.zeros((1, len(departure)))
    reading[0, -1] = 1.0
    below, above = (
        respond(side.driven("chamber"), boundary, time, reading, departure=departure).temperature[:, 0]
        for side in sides
    )
    return np.asarray((above - below) / (sides[1].distance - sides[0].distance))


def _still(found: Temperatures, _: float) -> Temperatures:
    return found


@dataclass(frozen=True)
class Side:
    """An instrument with one value moved a little, its law, and its networks by boundary."""

    distance: float
    instrument: "Instrument"
    law: "FrequencyLaw"
    damping: DampingLaw | None
    networks: dict[str, Network] = field(default_factory=dict)
    lags: dict[str, float] = field(default_factory=dict)
    sensed: dict[str, Network] = field(default_factory=dict)
    left: dict[str, dict[str, Array]] = field(default_factory=dict)

    def departures(self, drive: Drive) -> dict[str, Array]:
        """Temperatures of the nodes (K) for 1 K of each lump at the start, worked out once."""
        if drive.boundary not in self.left:
            T0 = self.instrument.reference_temperature
            plain = self.network(drive.boundary)
            left = departures(plain, drive.lumps, T0)
            if drive.boundary == "chamber":  # the sensor begins at its housing's temperature, unless it departs itself
                left = {lump: np.append(shape, shape[plain.index("housing")]) for lump, shape in left.items()}
                left[SENSOR] = np.append(np.zeros(plain.count), 1.0)
            self.left[drive.boundary] = left
        return self.left[drive.boundary]

    def network(self, boundary: str) -> Network:
        """Return its network, built once."""
        if boundary not in self.networks:
            self.networks[boundary] = build_network(self.instrument, boundary=boundary)
        return self.networks[boundary]

    def driven(self, boundary: str) -> Network:
        """Return its network with the sensor of a housing that is predicted, built once."""
        if boundary == "housing":
            return self.network(boundary)
        if boundary not in self.sensed:
            self.sensed[boundary] = with_sensor(self.network(boundary), self.instrument.noise.housing_lag_s)
        return self.sensed[boundary]

    def lag(self, boundary: str) -> float:
        """Slowest time constant (s) of the resonator behind its housing, in which effects count."""
        if not self.instrument.effects:
            return 1.0
        if boundary not in self.lags:
            self.lags[boundary] = slowest_lag(self.network(boundary), self.instrument.reference_temperature)
        return self.lags[boundary]


class Variations:
    """An instrument and its neighbours, one value moved to either side; for the derivatives of any number of runs."""

    def __init__(self, instrument: "Instrument", law: "FrequencyLaw", names: Sequence[str]) -> None:
        self.names = tuple(names)
        self._here = Side(0.0, instrument, law, damping_law(instrument, law.lowest, law.highest))
        self._known = {value.name: value for value in instrument.uncertain}
        self._sides: dict[str, tuple[Side, Side]] = {}

    def with_names(self, names: Sequence[str]) -> "Variations":
        """Return the same with other names; what has been built is shared."""
        other = copy(self)
        other.names = tuple(names)
        return other

    def network(self, boundary: str) -> Network:
        """Return the network of the instrument itself."""
        return self._here.network(boundary)

    def driven(self, boundary: str) -> Network:
        """Return its network with the sensor of a housing that is predicted."""
        return self._here.driven(boundary)

    def departures(self, drive: Drive) -> dict[str, Array]:
        """Temperatures of its nodes (K) for 1 K of each lump at the start."""
        return self._here.departures(drive)

    @property
    def damping(self) -> DampingLaw | None:
        """Its loss over temperature, where the parts of a budget make it."""
        return self._here.damping

    def lag(self, boundary: str) -> float:
        """Slowest time constant (s) of its resonator behind the housing."""
        return self._here.lag(boundary)

    def sides(self, name: str) -> tuple[Side, Side]:
        """Return the instrument with a value a little below and a little above."""
        if name not in self._sides:
            self._sides[name] = self._build(name)
        return self._sides[name]

    def change(self, name: str, drive: Drive) -> NetworkChange | None:
        """What a value does to the temperatures; None for nothing."""
        network = self.driven(drive.boundary)
        if name.startswith(INITIAL):
            return no_change(network, initial=self.departures(drive)[name.removeprefix(INITIAL)])
        if name.startswith(KINK):
            return no_change(network, {drive.boundary: drive.kink_shape(int(name.removeprefix(KINK)))})
        if name == LAG and drive.boundary == "housing":
            return no_change(network, {"housing": Profile(drive.imposed.time, _slope_of_reading(drive.imposed))})
        if name.partition(".")[0] not in HEATED:
            return None
        below, above = self.sides(name)
        step, T0 = above.distance - below.distance, self._here.instrument.reference_temperature
        change = difference(above.driven(drive.boundary), below.driven(drive.boundary), step, temperature=T0)
        return change if change.moves else None

    def _build(self, name: str) -> tuple[Side, Side]:
        here = self._here
        if name == SHIFT or name.startswith((INITIAL, JUMP, KINK)):
            low, high = (replace(here, distance=d) for d in (-0.05, 0.05))
            return low, high
        value, ends = self._value_and_ends(name)
        table = name.partition(".")[0]
        sides = []
        for distance in ends:
            moved, law = here.instrument.with_values({name: value + distance}), here.law
            if table in ("material", "mount", "law"):
                law = moved_law(law, moved)
            elif table == "resonator":
                law = law_of(moved, law.lowest, law.highest, law.theory)
            damping = here.damping
            if damping is not None and (table in ("loss", "material", "resonator") or name in OF_WALL):
                damping = damping_law(moved, law.lowest, law.highest)
            same = table not in HEATED
            known = (here.networks, here.lags) if same else ({}, {})
            sides.append(Side(distance, moved, law, damping, *known))
        return sides[0], sides[1]

    def _value_and_ends(self, name: str) -> tuple[float, tuple[float, float]]:
        """Return a number of the card and small steps to both sides of it, within its bounds."""
        found = self._known.get(name)
        if found is None:
            value = _number(self._here.instrument, name)
            step = STEP * (abs(value) or 1.0)
            return value, (-step / 2, step / 2)
        step = STEP * (min(found.sd, abs(found.value)) if found.logarithmic else found.sd)
        ends = np.clip(found.value + np.array([-step / 2, step / 2]), found.low, found.high) - found.value
        return found.value, (float(ends[0]), float(ends[1]))


def _number(instrument: "Instrument", name: str) -> float:
    """Return an exact number of the card."""
    try:
        return float(look_up(instrument.content, name))
    except (LookupError, TypeError, ValueError):
        table, _, key = name.partition(".")
        value = getattr(instrument.keys(table), key, None) if table in instrument.tables else None
        if isinstance(value, int | float):
            return float(value)
        raise InputError(f"{instrument.path}: the card has no number '{name}'.") from None
