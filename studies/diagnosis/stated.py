"""What a card states of all responses beside its frequency law, brought onto the grid of a campaign."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from studies.diagnosis.campaign import Campaign
from studies.diagnosis.response import RESPONSES
from studies.diagnosis.simulated import Simulated
from studies.effects.states import FloatArray, average
from studies.instrument.tables.bias import TERMS
from studies.simulation.prediction import predict

if TYPE_CHECKING:
    from studies.diagnosis.model import Fit

RATE_TERMS = tuple(key for key, (_, by_rate) in TERMS.items() if by_rate)
"""Terms of the bias in the rate of the frequency."""
NUDGE = 0.01
"""Part of 1/Q by which it is changed to see what the bias does then."""


def without_rate_terms(campaign: Campaign, baseline: Simulated) -> Campaign:
    """Take what the card says of the bias by rate (k4 to k9) out of the records: the static terms are free, these are stated."""
    stated = dict(baseline.card.content.get("bias", {}))
    static = {key: value for key, value in stated.items() if key not in RATE_TERMS}
    if len(static) == len(stated) or "bias_deg_per_h" not in campaign.responses:
        return campaign
    still = baseline.instrument.with_table("bias", static)
    runs = []
    for k, run in enumerate(campaign.runs):
        drive, time = baseline.drive(k)
        whole, rest = (
            predict(card, drive, (), baseline.law).columns["bias_deg_per_h"] for card in (baseline.instrument, still)
        )
        by_rate = whole - rest
        fine = average(np.interp(run.states.time, time, by_rate), campaign.group)
        responses = run.responses | {"bias_deg_per_h": run.responses["bias_deg_per_h"] - fine}
        own = run.row_responses["bias_deg_per_h"] - np.interp(run.row_time, time, by_rate)
        runs.append(replace(run, responses=responses, row_responses=run.row_responses | {"bias_deg_per_h": own}))
    return replace(campaign, runs=tuple(runs))


def with_loss_carried(campaign: Campaign, baseline: Simulated, loss: "Fit") -> Campaign:
    """Tell the bias what the effects on 1/Q do to it: B ∝ Δ(1/τ), which is the card's anisotropy of π f/Q."""
    made = loss.beside_temperature()
    if not made:
        return campaign
    card = baseline.instrument
    lossier = card.with_values({"loss.inverse_q": (1.0 + NUDGE) * card.loss.inverse_q})
    carried = []
    for k, run in enumerate(campaign.runs):
        drive, time = baseline.drive(k)
        one, two = (predict(own, drive, (), baseline.law).columns for own in (card, lossier))
        change = two["inverse_q"] - one["inverse_q"]  # none where the card adds up parts: their anisotropy is their own
        gain = np.divide(
            two["bias_deg_per_h"] - one["bias_deg_per_h"], change, np.zeros_like(change), where=change != 0.0
        )
        here = average(np.interp(run.states.time, time, gain), campaign.group)
        carried.append(np.stack([here * own[k] for own in made], axis=1))
    return replace(campaign, carried=tuple(carried))


def as_shipped(campaign: Campaign, baseline: Simulated) -> dict[str, float]:
    """Return what the card as shipped leaves of every response, rms on the records' rows; of a bias about each run's mean."""
    parts: dict[str, list[FloatArray]] = {column: [] for column in campaign.responses}
    for k, run in enumerate(campaign.runs):
        drive, time = baseline.drive(k)
        found = predict(baseline.card, drive, (), baseline.law)
        for column, own in parts.items():
            rest = run.row_responses[column] - np.interp(run.row_time, time, found.columns[column])
            own.append(rest - np.nanmean(rest) if RESPONSES[column].own_offset else rest)
    return {column: float(np.sqrt(np.nanmean(np.concatenate(own) ** 2))) for column, own in parts.items()}
