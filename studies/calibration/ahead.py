"""How well a card knows what it predicts: the spread of a run's columns over everything in the card that is uncertain."""

from collections.abc import Sequence
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
    spread = spread_along(instrument, drive, priors.names, priors.slopes(np.zeros(len(priors.values))), law)
    told = instrument.part("posterior")
    turn_on = max(instrument.noise.bias_turn_on_deg_per_h, told.bias_level_deg_per_h)
    for column, level in (("frequency_Hz", told.frequency_level_Hz), (BIAS, turn_on)):
        spread[column] = np.hypot(spread[column], level)
    return spread


def spread_along(
    instrument: "Instrument", drive: "Drive", names: Sequence[str], root: Array, law: "FrequencyLaw | None" = None
) -> dict[str, Array]:
    """Return √diag(J C Jᵀ) of every column of a predicted run, J its derivatives by names, C = root rootᵀ their covariance."""
    found, shape = predict(instrument, drive, names, law), (len(names), len(drive.time))
    slopes = {c: np.reshape([found.derivatives[name][c] for name in names], shape) for c in found.columns}
    return {c: np.asarray(np.linalg.norm(J.T @ root, axis=1)) for c, J in slopes.items()}
