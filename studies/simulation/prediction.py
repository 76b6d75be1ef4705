"""The one forward model: what an instrument's record is, without noise, and how it changes with every value of its card.

Temperatures and their derivatives come from the network (`thermal.sensitivity`); what the gyro reads at them is algebra
(`studies.simulation.response`), whose derivatives are differences along the change of values and temperatures together.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from studies.errors import InputError
from studies.instrument.dotted import look_up
from studies.law import law_of
from studies.loss import DampingLaw, damping_law
from studies.simulation.drive import Drive
from studies.simulation.heat_path import build_network, lump_shape, slowest_lag
from studies.simulation.response import Temperatures, check_loss, observed_rows, read_out
from thermal.network import Network
from thermal.profile import Profile
from thermal.sensitivity import Change, difference, no_change, respond

if TYPE_CHECKING:
    from shell.law import FrequencyLaw
    from shell.levels import Theory
    from studies.instrument.card import Instrument

Array = NDArray[np.float64]
MARGIN = 10.0  # K beyond the boundary in which the frequency stays known: effects and self-heating
STEP = 1e-3  # of a value, or of its standard deviation: the differences that give derivatives
INITIAL = "initial."
LAG = "noise.housing_lag_s"


@dataclass(frozen=True)
class Prediction:
    """A record without noise.

    Attributes
    ----------
    drive : Drive
    columns : mapping
        `housing_temperature_degC` (as its sensor reads it), `resonator_temperature_degC`, `frequency_Hz`,
        `bias_deg_per_h`, `inverse_q`: arrays (N,).
    derivatives : mapping
        Of each value that was asked for, by name: the derivative of every column by it, in the unit of its key.
    housing : array (N,), K
        The housing itself.
    law : FrequencyLaw
    network : Network
    """

    drive: Drive
    columns: Mapping[str, Array]
    derivatives: Mapping[str, Mapping[str, Array]]
    housing: Array
    law: "FrequencyLaw"
    network: Network


def predict(
    instrument: "Instrument", drive: Drive, derivatives: Sequence[str] = (), law: "FrequencyLaw | None" = None
) -> Prediction:
    """Predict the record of a run.

    Parameters
    ----------
    instrument : Instrument
    drive : Drive
    derivatives : names
        Keys of the card ("thermal.mount_conductance_W_per_K"), or "initial.base" (K) and the other lumps of the drive.
    law : FrequencyLaw, optional
        One that was built before for this instrument and a range that is wide enough.

    Raises
    ------
    InputError, ThermalError, ShellError
        An unusable table or effect, or temperatures that leave the range of the material.
    """
    if law is None:
        law = law_for(instrument, drive)
    network = build_network(instrument, boundary=drive.boundary)
    rows = observed_rows(instrument, law, tuple(node.name for node in network.nodes))
    boundary: dict[str, Profile] = {drive.boundary: _behind_sensor(instrument, drive)}
    departure = sum(
        (value * lump_shape(network, name) for name, value in drive.initial.items()), np.zeros(network.count)
    )
    tau = slowest_lag(network, instrument.reference_temperature)
    values = [_Value(instrument, drive, network, law, name, tau) for name in derivatives]
    warming = [value for value in values if value.change is not None]
    changes = [value.change for value in warming if value.change is not None]
    thermal = respond(network, boundary, drive.time, rows, changes, departure)
    found = Temperatures(thermal.temperature, thermal.rate)
    if drive.boundary == "housing":
        found.value[:, 0] = boundary["housing"].at(drive.time)
    damping = damping_law(instrument, law.lowest, law.highest)
    columns = read_out(instrument, law, drive, found, tau, damping)
    check_loss(instrument, columns["inverse_q"])
    slopes = {}
    for value in values:
        along = partial(_still, found)
        if value.change is not None:
            k = warming.index(value)
            slope = thermal.slope[k]
            for profile in changes[k].boundaries.values():
                slope[:, 0] = profile.at(drive.time)
            along = partial(found.moved, slope, thermal.rate_slope[k])
        above, below = (
            read_out(value.instrument(d), value.law(d), drive, along(d), lag, value.damping(d, damping))
            for d, lag in zip(value.ends, value.lags, strict=True)
        )
        slopes[value.name] = {name: (above[name] - below[name]) / value.step for name in columns}
    return Prediction(drive, columns, slopes, found.value[:, 0], law, network)


def law_for(
    instrument: "Instrument", drive: Drive, margin: float = MARGIN, theory: "Theory" = "solid"
) -> "FrequencyLaw":
    """Build the frequency law over the temperatures of a drive and of the reference, and some kelvin more."""
    reached = np.append(drive.profile.value, instrument.reference_temperature)
    return law_of(instrument, float(reached.min()) - margin, float(reached.max()) + margin, theory)


def _behind_sensor(instrument: "Instrument", drive: Drive) -> Profile:
    """Temperature that is imposed: of the housing what its sensor will have read, y + τ dy/dt."""
    time_constant = instrument.noise.housing_lag_s
    if drive.boundary == "chamber" or time_constant == 0:
        return drive.profile
    return Profile(drive.profile.time, drive.profile.value + time_constant * _slope_of_reading(drive.profile))


def _slope_of_reading(read: Profile) -> Array:
    """Slope at the rows (K/s): zero at the first, where the gyro has settled and the sensor with it."""
    slope: Array = np.gradient(read.value, read.time)
    slope[0] = 0.0
    return slope


def _still(found: Temperatures, _: float) -> Temperatures:
    return found


class _Value:
    """One value of a card: what a small change of it does to the network, the law and the instrument."""

    def __init__(
        self, instrument: "Instrument", drive: Drive, network: Network, law: "FrequencyLaw", name: str, lag: float
    ) -> None:
        self.name, self.base, self.base_law = name, instrument, law
        self.moves = not name.startswith(INITIAL)
        self.step, self.ends, self.lags = 1.0, (0.5, -0.5), (lag, lag)
        if not self.moves:
            self.change: Change | None = no_change(network, initial=lump_shape(network, name.removeprefix(INITIAL)))
            return
        self.value, self.step, self.ends = _value_and_ends(instrument, name)
        self.change = self._change(network, drive)

    def instrument(self, distance: float) -> "Instrument":
        """Return the instrument with the value moved."""
        return self.base.with_values({self.name: self.value + distance}) if self.moves else self.base

    def law(self, distance: float) -> "FrequencyLaw":
        """Return the law of that instrument."""
        table = self.name.partition(".")[0]
        if not self.moves or table not in ("material", "resonator"):
            return self.base_law
        moved = self.instrument(distance)
        if table == "material":
            return self.base_law.with_material(moved.material)
        return law_of(moved, self.base_law.lowest, self.base_law.highest, self.base_law.theory)

    def damping(self, distance: float, base: DampingLaw | None) -> DampingLaw | None:
        """Return the loss of that instrument."""
        of_wall = self.name in ("thermal.conductivity_W_per_m_K", "thermal.heat_capacity_J_per_kg_K")
        if base is None or not (self.name.startswith(("loss.", "material.", "resonator.")) or of_wall):
            return base
        return damping_law(self.instrument(distance), self.base_law.lowest, self.base_law.highest)

    def _change(self, network: Network, drive: Drive) -> Change | None:
        """What the value does to the temperatures; None for nothing."""
        if self.name == LAG and drive.boundary == "housing":
            return no_change(network, {"housing": Profile(drive.profile.time, _slope_of_reading(drive.profile))})
        if self.name.partition(".")[0] not in ("thermal", "material", "resonator"):
            return None
        above, below = (build_network(self.instrument(d), boundary=drive.boundary) for d in self.ends)
        if self.base.effects:  # they count in the resonator's slowest lag
            T0 = self.base.reference_temperature
            self.lags = (slowest_lag(above, T0), slowest_lag(below, T0))
        change = difference(above, below, self.step, temperature=self.base.reference_temperature)
        return change if change.moves else None


def _value_and_ends(instrument: "Instrument", name: str) -> tuple[float, float, tuple[float, float]]:
    """Return a number of the card, a step that is small against it and its uncertainty, and its ends within the bounds."""
    found = next((one for one in instrument.uncertain if one.name == name), None)
    if found is None:
        value = _number(instrument, name)
        step = STEP * (abs(value) or 1.0)
        return value, step, (step / 2, -step / 2)
    step = STEP * (min(found.sd, abs(found.value)) if found.logarithmic else found.sd)
    ends = np.clip(found.value + np.array([step / 2, -step / 2]), found.low, found.high) - found.value
    return found.value, float(ends[0] - ends[1]), (float(ends[0]), float(ends[1]))


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
