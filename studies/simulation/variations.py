"""An instrument and its neighbours, one value of its card or of a drive moved: what the derivatives of a prediction are taken from."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from compensation.arrays import Array
from studies.effects.states import Lags
from studies.errors import InputError
from studies.instrument.dotted import look_up
from studies.loss.damping_law import DampingLaw, damping_law
from studies.resonator.law import law_of, moved_law
from studies.simulation.drive import Drive
from studies.simulation.heat_path import SENSOR, build_network, departures, with_sensor
from studies.simulation.response import lags_of
from thermal.network import Network
from thermal.profile import Profile
from thermal.sensitivity import NetworkChange, difference, no_change

if TYPE_CHECKING:
    from shell.law import FrequencyLaw
    from studies.instrument.card import Instrument

STEP = 1e-3  # of a value, or of its standard deviation: the differences that give derivatives
INITIAL = "initial."
SHIFT, JUMP, KINK = "shift", "jump.", "kink."
OF_WALL = ("thermal.conductivity_W_per_m_K", "thermal.heat_capacity_J_per_kg_K")
"""Values of the heat path that the loss of a wall takes as well."""
HEATED = ("thermal", "material", "resonator", "law")
"""Tables whose values the temperatures may depend on."""
OF_HEAT = ("density", "conductivity", "heat_capacity")
"""What of a material they depend on."""
LAG = "noise.housing_lag_s"


def heats(name: str) -> bool:
    """Return whether the temperatures may depend on a value of the card."""
    table = name.partition(".")[0]
    return table in HEATED and (table != "material" or any(word in name for word in OF_HEAT))


@dataclass(frozen=True)
class Side:
    """An instrument with one value moved a little, its law, and its networks by boundary."""

    distance: float
    instrument: "Instrument"
    law: "FrequencyLaw"
    damping: DampingLaw | None
    networks: dict[str, Network] = field(default_factory=dict)
    modes: dict[str, Lags] = field(default_factory=dict)
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

    def lags(self, boundary: str) -> Lags:
        """Lags of the resonator behind its housing, through which effects reach it."""
        if not self.instrument.effects:
            return Lags.one(1.0)
        if boundary not in self.modes:
            self.modes[boundary] = lags_of(self.instrument, self.law, self.network(boundary))
        return self.modes[boundary]


class Variations:
    """An instrument and its neighbours, one value moved to either side; for the derivatives of any number of runs."""

    def __init__(self, instrument: "Instrument", law: "FrequencyLaw", names: Sequence[str]) -> None:
        self.names = tuple(names)
        self.here = Side(0.0, instrument, law, damping_law(instrument, law.lowest, law.highest))
        self._known = {value.name: value for value in instrument.uncertain}
        self._sides: dict[str, tuple[Side, Side]] = {}
        self._changes: dict[tuple[str, str], NetworkChange | None] = {}

    def with_names(self, names: Sequence[str]) -> "Variations":
        """Return the same with other names; what has been built is shared."""
        other = copy(self)
        other.names = tuple(names)
        return other

    def sides(self, name: str) -> tuple[Side, Side]:
        """Return the instrument with a value a little below and a little above."""
        if name not in self._sides:
            self._sides[name] = self._build(name)
        return self._sides[name]

    def change(self, name: str, drive: Drive) -> NetworkChange | None:
        """What a value does to the temperatures; None for nothing."""
        network = self.here.driven(drive.boundary)
        if name.startswith(INITIAL):
            return no_change(network, initial=self.here.departures(drive)[name.removeprefix(INITIAL)])
        if name.startswith(KINK):
            return no_change(network, {drive.boundary: drive.kink_shape(int(name.removeprefix(KINK)))})
        if name == LAG and drive.boundary == "housing":
            return no_change(network, {"housing": Profile(drive.imposed.time, slope_of_reading(drive.imposed))})
        if not heats(name):
            return None
        if (name, drive.boundary) not in self._changes:
            below, above = (side.driven(drive.boundary) for side in self.sides(name))
            change = difference(above, below, float(np.ptp([side.distance for side in self.sides(name)])))
            self._changes[name, drive.boundary] = change if change.moves else None
        return self._changes[name, drive.boundary]

    def _build(self, name: str) -> tuple[Side, Side]:
        here = self.here
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
            known = ({}, {}) if heats(name) else (here.networks, here.modes)
            sides.append(Side(distance, moved, law, damping, *known))
        return sides[0], sides[1]

    def _value_and_ends(self, name: str) -> tuple[float, tuple[float, float]]:
        """Return a number of the card and small steps to both sides of it, within its bounds."""
        found = self._known.get(name)
        if found is None:
            value = _number(self.here.instrument, name)
            step = STEP * (abs(value) or 1.0)
            return value, (-step / 2, step / 2)
        step = STEP * (min(found.sd, abs(found.value)) if found.logarithmic else found.sd)
        # half way to a bound at most: some bounds are no values themselves
        low, high = (found.low - found.value) / 2, (found.high - found.value) / 2
        return found.value, (max(-step / 2, low), min(step / 2, high))


def _number(instrument: "Instrument", name: str) -> float:
    try:
        return float(look_up(instrument.content, name))
    except (LookupError, TypeError, ValueError):
        table, _, key = name.partition(".")
        value = getattr(instrument.keys(table), key, None) if table in instrument.tables else None
        if isinstance(value, int | float):
            return float(value)
        raise InputError(f"{instrument.path}: the card has no number '{name}'.") from None


def slope_of_reading(read: Profile) -> Array:
    """Slope at the rows (K/s): zero at the first, where the gyro has settled and the sensor with it."""
    slope: Array = np.gradient(read.value, read.time)
    slope[0] = 0.0
    return slope
