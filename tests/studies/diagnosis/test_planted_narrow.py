"""A narrow dip that a run crosses once, in a minute, beside the card's own simulation."""

import numpy as np
import pytest
from scipy.constants import zero_Celsius

from studies.instrument.card import load_card
from studies.record import Record
from studies.simulation.drive import drive_by_profile, rows_of
from studies.simulation.virtual_gyro import simulate_run
from studies.workbench import diagnose_records
from thermal.profile import Profile

CENTRE, WIDTH = 3.46747, 0.262176  # °C, K
PULL = [0.044927, 0.023272, -0.028969, 0.011996, 0.021019, 0.045055]  # Hz
RATE = 0.05  # Hz


def a_run_through_a_dip(card):
    """One run of a card's gyro between three levels; its frequency is pulled where a spurious mode crosses."""
    corners = np.array([0.0, 470.0, 5690.0, 6560.0, 9350.0, 11052.0, 17640.0])  # s
    levels = np.array([20.0, 4.823, 4.823, 21.85, 21.85, -4.068, -4.068])  # °C
    profile = Profile(corners, levels + zero_Celsius)
    dip = {
        "name": "activity-dip",
        "response": "frequency_Hz",
        "temperature_degC": CENTRE,
        "width_K": WIDTH,
        "pull_Hz": PULL,
    }
    record = simulate_run(
        card.with_table("effect", [dip]), drive_by_profile(profile, rows_of(profile, RATE)), seed=2
    ).record
    kept = ("time_s", "housing_temperature_degC", "frequency_Hz")
    return [Record({name: record[name] for name in kept}, path="run.csv", sha256="1")]


@pytest.mark.slow
def test_a_narrow_dip_that_is_crossed_once_is_not_called_a_jump():
    """A first look at a grid of dips sees less than half of what it sees of a jump: a hop is sharp and lies between its shapes."""
    card = load_card("cvg-25mm")
    verdict = diagnose_records(a_run_through_a_dip(card), card).verdict
    (cause,) = (cause for cause in verdict.causes if cause.kind == "physics")
    assert cause.effect == "activity-dip"
    assert cause.parameters["temperature_degC"].value == pytest.approx(CENTRE, abs=0.3)
