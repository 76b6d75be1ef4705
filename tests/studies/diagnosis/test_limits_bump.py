"""A narrow feature at one temperature is no smooth curve: where nothing named makes one, it is said; a wide curve is none."""

import numpy as np
import pytest

from studies.inference.lack_of_fit import generic_bank, look
from studies.record import Record
from tests.studies.diagnosis.bench import searched


@pytest.mark.slow
@pytest.mark.parametrize(
    ("added", "bump", "structure"),
    [
        (lambda t: np.exp(-0.5 * ((t - 24.0) / 1.8) ** 2), True, True),
        (lambda t: np.tanh((t - 24.0) / 5.0), True, True),
        (lambda t: ((t - 20.0) / 30.0) ** 4, False, True),
        (lambda t: 0.0 * t, False, False),
    ],
    ids=["bump", "step", "quartic", "nothing"],
)
def test_a_bump_is_told_from_a_curve(added, bump, structure):
    rng = np.random.default_rng(5)
    time = np.arange(0.0, 40000.0, 100.0)
    housing = 20.0 - 30.0 * np.cos(2 * np.pi * time / 20000.0)
    frequency = 4432.0 + 0.36 * (housing - 20.0) + 1e-3 * rng.standard_normal(time.size)
    bias = 0.2 * (housing - 20.0) + 0.5 * added(housing) + 0.05 * rng.standard_normal(time.size)
    columns = {"time_s": time, "housing_temperature_degC": housing, "frequency_Hz": frequency, "bias_deg_per_h": bias}
    search, plain = searched([Record(columns)])
    seen = look(search, generic_bank(search), plain, plain, {})["bias_deg_per_h"]
    assert seen.significant is structure
    assert (structure and seen.input == "temperature: a narrow feature") is bump
