"""What a loss budget says beside its sum: what varies around the axis, what a stated Q leaves open, what each part is worth."""

from dataclasses import dataclass

import numpy as np

from compensation.arrays import Array
from compensation.wave import StandingWave
from shell.damping.anisotropy import describe_wave
from shell.damping.budget import Budget
from studies.instrument.card import Instrument
from studies.loss.model import LossModel


@dataclass(frozen=True, eq=False)
class DampingAround:
    """Damping that differs around the axis: `split` Δ(1/Q), `axis` (rad) of the most damped pattern, `drift` (deg/h) at most."""

    split: Array
    axis: Array
    drift: Array


def damping_around(model: LossModel, budget: Budget) -> DampingAround | None:
    """Return what varies around; None where nothing does."""
    if not model.ripples:
        return None
    split, axis = describe_wave(model.wave(budget), model.harmonic)
    omega = model.vibration.omega(budget.temperatures)
    wave = StandingWave(
        omega, 2 / (omega * budget.inverse_q), omega * split / 2, axis, harmonic=model.harmonic,
        bryan_factor=model.bryan_factor,
    )  # fmt: skip
    worst = np.degrees(wave.drift(axis + np.pi / (4 * model.harmonic))) * 3600
    return DampingAround(split, axis, worst)


@dataclass(frozen=True)
class StatedLoss:
    """What a card states of 1/Q at its reference temperature, and the part of it that the budget explains, with its 90 % interval."""

    inverse_q: float
    explained: float
    low: float
    high: float

    @property
    def verdict(self) -> str:
        """What follows from the interval; nothing where it holds the whole."""
        if self.high < 1:
            return "The stated loss exceeds these contributions: look for a cause that the card does not have."
        if self.low > 1:
            return "The stated loss is below these contributions: one of them is too large."
        return ""


def stated_loss(instrument: Instrument, model: LossModel) -> StatedLoss | None:
    """Return what the card states beside what the parts explain; None where it states nothing of this mode."""
    if "inverse_q" not in instrument.content.get("loss", {}) or model.harmonic != 2:
        return None
    stated = instrument.loss.inverse_q
    budget = model.budget(instrument.reference_temperature)
    low, high = (float(end[0]) for end in budget.interval)
    return StatedLoss(stated, float(budget.inverse_q[0]) / stated, low / stated, high / stated)
