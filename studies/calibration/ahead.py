"""How well a card knows what it predicts: the spread of a run's columns over everything in the card that is uncertain."""

from typing import TYPE_CHECKING

import numpy as np

from compensation.arrays import Array
from studies.calibration.priors import gather_priors
from studies.simulation.prediction import predict

if TYPE_CHECKING:
    from shell.law import FrequencyLaw
    from studies.instrument.card import Instrument
    from studies.simulation.drive import Drive

BIAS = "bias_deg_per_h"


def spread_of_prediction(
    instrument: "Instrument", drive: "Drive", law: "FrequencyLaw | None" = None
) -> dict[str, Array]:
    """Return √diag(J C Jᵀ) of every column of a predicted run, C of the card's uncertain values, levels of runs included, without noise."""
    priors = gather_priors(instrument)
    found = predict(instrument, drive, priors.names, law)
    scale = priors.slopes(np.zeros(len(priors.values)))
    spread = {}
    for column, values in found.columns.items():
        J = np.zeros((len(values), len(priors.values)))
        for k, name in enumerate(priors.names):
            J[:, k] = found.derivatives[name][column]
        spread[column] = np.asarray(np.linalg.norm(J @ scale, axis=1))
    told = instrument.part("posterior")
    turn_on = max(instrument.noise.bias_turn_on_deg_per_h, told.bias_level_deg_per_h)
    for column, level in (("frequency_Hz", told.frequency_level_Hz), (BIAS, turn_on)):
        spread[column] = np.hypot(spread[column], level)
    return spread
