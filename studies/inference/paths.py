"""Paths of runs: their states on an even grid as a card predicts them, and how what is read there goes with temperature, rate and loss."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from compensation.arrays import Array
from shell.constants import zero_Celsius
from studies.effects import Effect
from studies.effects.states import States
from studies.simulation.prediction import Prediction
from studies.simulation.response import Temperatures, lags_of, read_out

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from studies.instrument.card import Instrument

WARMER, FASTER, LOSSIER = 0.01, 1e-6, 0.01
"""Steps of temperature (K), of its rate (K/s) and of 1/Q (relative) for the slopes of the read-out."""


@dataclass(frozen=True)
class Path:
    """One run as the card predicts it: its states on an even grid, and by response the slopes per K, per K/s and by 1/Q."""

    instrument: "Instrument"
    states: States
    prediction: Prediction

    @property
    def time(self) -> Array:
        """Predicted rows, s since the first."""
        return np.asarray(self.prediction.drive.time - self.prediction.drive.time[0])

    @cached_property
    def by_temperature(self) -> dict[str, Array]:
        """Slopes per K."""
        return self._slopes(WARMER, np.array([WARMER, 0.0, 0.0]))

    @cached_property
    def by_rate(self) -> dict[str, Array]:
        """Slopes per K/s."""
        return self._slopes(FASTER, np.array([0.0, FASTER, 0.0]))

    @cached_property
    def by_loss(self) -> Array:
        """Slope of the bias by 1/Q."""
        more = LOSSIER * float(np.median(self.prediction.columns["inverse_q"]))
        return self._slopes(more, np.array([0.0, 0.0, more]))["bias_deg_per_h"]

    def _slopes(self, step: float, change: Array) -> dict[str, Array]:
        """Central differences of the read-out, for a change of temperature, rate and 1/Q."""
        found = self.prediction

        def read(warmer: float, faster: float, lossier: float) -> dict[str, Array]:
            value, rate = found.temperatures.value.copy(), found.temperatures.rate.copy()
            value[:, 1] += warmer
            rate[:, 1] += faster
            at = Temperatures(value, rate)
            return read_out(self.instrument, found.law, found.drive, at, self.states.lags, found.damping, lossier)

        below, above = read(*-change), read(*change)
        return {name: (above[name] - below[name]) / (2 * step) for name in above}

    def onto_rows(self, values: Array) -> Array:
        """Return columns of the even grid at the predicted rows."""
        if self.time.shape == self.states.time.shape and np.allclose(self.time, self.states.time, rtol=0.0, atol=1e-6):
            return values
        return np.stack([np.interp(self.time, self.states.time, column) for column in values.T], axis=1)

    @cached_property
    def interpolation(self) -> "csr_array":
        """What takes values of the even grid to the predicted rows, linear between them."""
        from scipy.sparse import csr_array

        even, rows = self.states.time, self.time
        before = np.clip(np.searchsorted(even, rows, side="right") - 1, 0, len(even) - 2)
        part = np.clip((rows - even[before]) / self.states.step, 0.0, 1.0)
        place = np.arange(len(rows))
        entries = np.concatenate([1.0 - part, part])
        return csr_array((entries, (np.tile(place, 2), np.concatenate([before, before + 1]))), (len(rows), len(even)))

    def changes(self, effect: Effect, own: Array, response: str) -> dict[str, Array]:
        """Return what the columns of an effect on the even grid make of every response at the predicted rows."""
        here = self.onto_rows(own)
        if effect.thermal:
            faster = self.onto_rows(np.gradient(own, self.states.step, axis=0))
            return {
                name: by_T[:, None] * here + self.by_rate[name][:, None] * faster
                for name, by_T in self.by_temperature.items()
            }
        if response == "inverse_q":
            return {response: here, "bias_deg_per_h": self.by_loss[:, None] * here}
        return {response: here}


def trace(instrument: "Instrument", found: Prediction, run: int) -> Path:
    """Return the path of one run, as it is predicted, through the states of a card."""
    drive, time = found.drive, found.drive.time - found.drive.time[0]
    even = np.linspace(0.0, time[-1], int(np.ceil(time[-1] / np.median(np.diff(time)))) + 1)
    standing = {"pattern_angle": np.full(len(time), np.radians(instrument.bias.pattern_angle_deg))}
    commands = {name: np.interp(even, time, values) for name, values in (standing | dict(drive.commands)).items()}
    states = States(
        run=run,
        time=even,
        campaign_time=even + drive.start,
        housing=np.interp(even, time, found.housing),
        resonator=np.interp(even, time, found.columns["resonator_temperature_degC"]) + zero_Celsius,
        known_rate=np.interp(even, time, found.temperatures.rate[:, 1]),
        lags=lags_of(instrument, found.law, found.network),
        reference=instrument.reference_temperature,
        **commands,
    )
    return Path(instrument, states, found)


def memory_of(effect: Effect, shape: Sequence[float]) -> float:
    """Return the time constant, s, with which an effect forgets what came before a run."""
    return float(shape[[one.name for one in effect.shape].index(effect.memory)])


def starts_of(effect: Effect, states: States, shape: Sequence[float], runs: int, wide: float) -> Array:
    """Return what an effect with memory had at the start of each run, on the even grid: as much as the covered range would give it."""
    out = np.zeros((states.time.size, runs))
    out[:, states.run] = wide * np.exp(-(states.time - states.time[0]) / memory_of(effect, shape))
    return out
