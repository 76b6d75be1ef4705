"""1/Q of the drive mode and its anisotropy over temperature, as a simulation takes them from the parts of a loss budget."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studies.instrument.card import Instrument

NODE_STEP = 4.0  # K, for the narrowest activated peaks


@dataclass(frozen=True)
class DampingLaw:
    """1/Q and, where the card states it, `wave` Δ(1/Q) exp(2 i n θ_τ) over temperature: between nodes as cubic splines."""

    inverse_q: Callable[[NDArray[np.float64]], NDArray[np.float64]]
    wave: Callable[[NDArray[np.float64]], NDArray[np.complex128]] | None


def damping_law(instrument: Instrument, lowest: float, highest: float) -> DampingLaw | None:
    """1/Q of the drive mode (n = 2) between two temperatures (K) from the parts in the card; None where it has none."""
    from scipy.interpolate import CubicSpline

    from studies.loss.model import loss_model

    if not instrument.part("loss", "loss_parts").given:
        return None
    material = instrument.material
    low, high = max(lowest, material.lowest), min(highest, material.highest)
    nodes = np.linspace(low, high, max(9, 1 + math.ceil((high - low) / NODE_STEP)))
    model = loss_model(instrument)
    budget = model.budget(nodes)
    logarithm = CubicSpline(nodes, np.log(budget.inverse_q))
    wave = CubicSpline(nodes, model.wave(budget)) if model.ripples else None
    return DampingLaw(lambda T: np.asarray(np.exp(logarithm(T))), wave)


def settled_loss(instrument: Instrument, temperature: float) -> tuple[float, Instrument]:
    """Return 1/Q at a temperature (K), and the instrument whose `[bias]` has the anisotropy of its parts there."""
    law = damping_law(instrument, temperature - 1.0, temperature + 1.0)
    at = np.array([temperature])
    if law is None:
        return float(instrument.loss.at(at - instrument.reference_temperature)[0]), instrument
    inverse_q = float(law.inverse_q(at)[0])
    if law.wave is None:
        return inverse_q, instrument
    wave = complex(law.wave(at)[0])
    axis = float(np.degrees(np.angle(wave) / 4))  # n = 2
    moved = {"bias.damping_anisotropy": abs(wave) / inverse_q, "bias.damping_axis_deg": axis}
    return inverse_q, instrument.with_values(moved)
