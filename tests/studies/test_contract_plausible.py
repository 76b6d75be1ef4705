"""A record of another gyro than the card's or the model's is a question, with the sentence that confirms it."""

import dataclasses

import numpy as np
import pytest

from compensation.frequency import fit_frequency
from studies.calibration.calibrate import calibrate
from studies.errors import InputError
from studies.instrument.card import load_card
from studies.models import compensate
from studies.models.kinds.frequency import find_temperature, save_frequency
from studies.record import Record
from studies.record.plausible import check_card_frequency
from studies.simulation.chamber import load_profile
from studies.simulation.virtual_gyro import simulate_run
from studies.workbench import diagnose_records

T = np.linspace(-20, 40, 7)
MODEL = save_frequency(fit_frequency(T, 4424.9 + 0.3716 * T, 1), (), "test")
QUESTION = "is this a record of that gyro\\? If it is, "


@pytest.fixture(scope="module")
def card():
    return load_card("hrg-30mm")


@pytest.fixture(scope="module")
def record(card):
    """A record at 5000 Hz of a card of 4432 Hz."""
    made = simulate_run(card, load_profile("ramp -10 35 0.5"), 1 / 60, 1).record
    return dataclasses.replace(made.with_columns({"frequency_Hz": made["frequency_Hz"] * 5000 / 4432}), path="run.csv")


@pytest.mark.parametrize(
    ("work", "of", "mend"),
    [
        (lambda card, run: calibrate(card, [run]), "the card hrg-30mm resonates at 4432", ""),
        (lambda card, run: diagnose_records([run], card), "", "give a dimension an uncertainty that covers the difference"),
        (lambda _, run: compensate(MODEL, run), "", "fit a model to its own records"),
        (lambda _, run: find_temperature(MODEL, run["frequency_Hz"], "run.csv"), "", ""),
    ],
    ids=["calibrate", "diagnose", "compensate", "temperature"],
)  # fmt: skip
def test_they_ask(card, record, work, of, mend):
    with pytest.raises(InputError, match=f"run.csv: frequency_Hz is near .*{of}.*{QUESTION}{mend}"):
        work(card, record)


def test_what_the_card_says_is_uncertain_confirms(card, record):
    unsure = card.with_values({"resonator.thickness_mm": {"value": 0.8558278, "relative_sd": 0.07}})
    check_card_frequency(unsure, record["frequency_Hz"], "run.csv")
    check_card_frequency(card, np.array([4432.0 * 1.02, np.nan]), "run.csv")
    check_card_frequency(card, np.array([np.nan]), "run.csv")


def test_a_models_own_record_is_compensated():
    own = Record({"time_s": T, "housing_temperature_degC": T / 2, "frequency_Hz": 4424.9 + 0.1858 * T})
    assert compensate(MODEL, own)["compensated_frequency_Hz"] == pytest.approx(4424.9, abs=1e-3)
