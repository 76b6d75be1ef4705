"""How far a gyro may have been from rest when its record begins: a departure d moves at about d/τ, τ the slowest time constant."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from compensation.noise import white_rms
from studies.calibration.observed import ObservedRun
from studies.simulation.heat_path import build_network, slowest_lag

if TYPE_CHECKING:
    from shell.law import FrequencyLaw
    from studies.instrument.card import Instrument

Array = NDArray[np.float64]
MOST_SPREAD = 10.0  # K: a run may begin in the midst of a change
LEAST_SPREAD = 0.05  # K, of a chamber that holds
WINDOW = 0.2  # of the slowest time constant, over which a rate is taken
LEAST_ROWS = 5
CARE = 2.0  # times what the card's time constant makes of a rate: it may be that much slower


def start_spread(run: ObservedRun, instrument: "Instrument", law: "FrequencyLaw") -> float:
    """Prior standard deviation (K) of what each part departs from rest at the start of a run."""
    if "frequency_Hz" not in run.responses:
        return MOST_SPREAD
    reference = instrument.reference_temperature
    lag = slowest_lag(build_network(instrument, boundary="housing"), reference)
    below, above = law.frequency(np.array([reference - 1.0, reference + 1.0]))
    frequency = run.responses["frequency_Hz"]
    rates = [_rate(frequency.time, frequency.value, WINDOW * lag) / abs(float(above - below) / 2)]
    if run.inner.boundary == "housing":
        rates.append(_rate(run.inner.profile.time, run.inner.profile.value, WINDOW * lag))
    return float(np.clip(CARE * lag * max(rates), LEAST_SPREAD, MOST_SPREAD))


def _rate(time: Array, value: Array, window: float) -> float:
    """Rate (per s) that the first rows leave likely, rms: of a straight line through them, and of its noise."""
    count = min(max(int(np.searchsorted(time - time[0], window)), LEAST_ROWS), len(time))
    t = time[:count] - time[:count].mean()
    spread = white_rms(value)
    return float(np.hypot(t @ value[:count] / (t @ t), spread / np.sqrt(t @ t)))
