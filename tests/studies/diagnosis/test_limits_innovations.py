"""What is no noise: innovations of every kind of noise are normal and of one spectrum; switches and chirps are not.

Also the evidence of a record whose level is ten million times what is left of it.
"""

import numpy as np
import pytest
from scipy.signal import lfilter

from studies.diagnosis.campaign import load_campaign
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.evidence import Linear, solve
from studies.diagnosis.inquiry import begin
from studies.diagnosis.lack_of_fit import fitful, sharp
from studies.diagnosis.noise import NoiseModels
from studies.record import Record

SIGNIFICANT = CONSTANTS["margin"] - CONSTANTS["log_prior_unknown"]
ROWS, STEP = 2400, 12.0


def campaign(rng, beside):
    """A record of 8 h over one cycle of temperature, white noise of 1 mHz, and `beside`, Hz."""
    time = STEP * np.arange(ROWS)
    housing = 20.0 + 25.0 * np.sin(2 * np.pi * time / 20000.0)
    lagged = lfilter([STEP / 1500.0], [1.0, STEP / 1500.0 - 1.0], housing - 20.0) + 20.0
    frequency = 4430.0 + 0.36 * (lagged - 20.0) + 1e-3 * rng.standard_normal(ROWS) + beside
    columns = {"time_s": time, "housing_temperature_degC": housing, "frequency_Hz": frequency}
    return load_campaign([Record(columns)])


def look_at(beside, seed=1):
    fitted = begin(campaign(np.random.default_rng(seed), beside), "frequency_Hz", None)
    return sharp(fitted)[1], fitful(fitted)[1]


def walk(rng):
    return np.cumsum(rng.standard_normal(ROWS)) * 2e-4


def memory(rng):
    keep = np.exp(-STEP / 200.0)
    return lfilter([np.sqrt(1 - keep**2)], [1.0, -keep], rng.standard_normal(ROWS)) * 2e-3


@pytest.mark.parametrize("noise", [lambda rng: np.zeros(ROWS), walk, memory])
def test_noise_has_normal_innovations_of_one_spectrum(noise):
    for seed in (1, 2, 3):
        assert max(look_at(noise(np.random.default_rng(seed)), seed)) < 0.5 * SIGNIFICANT


def test_a_switch_is_no_relaxation():
    """A telegraph, of SNR 3, has the spectrum of a relaxation, but few of its innovations hold all of it."""
    rng = np.random.default_rng(4)
    edges = np.cumsum(rng.exponential(1500.0, 100) + 120.0)
    beside = 6e-3 * (np.searchsorted(edges, STEP * np.arange(ROWS)) % 2)
    assert look_at(beside)[0] > SIGNIFICANT


def test_a_chirp_is_no_noise():
    """Over the run it has a smooth spectrum; at each moment it has one frequency. At 3 mHz it is on the edge in some records."""
    u = np.arange(ROWS) / ROWS
    beside = 4e-3 * np.sin(2 * np.pi * STEP * ROWS * (u / 3000.0 + (1 / 300.0 - 1 / 3000.0) * u**2 / 2))
    for seed in (1, 2, 3):
        assert look_at(beside, seed)[1] > SIGNIFICANT


def test_a_high_level_hides_nothing():
    """25 MHz and 0.07 Hz: squared, the level is 10¹⁷ times what is left; the evidence and the noise are as without it."""
    rng = np.random.default_rng(5)
    t = np.arange(0.0, 28800.0, 144.0)
    columns = np.stack([np.ones(200), np.sin(t / 3000.0)], axis=1)
    y = 0.07 * rng.standard_normal(200)
    found = [
        solve(Linear(y + level, columns, np.full(2, np.inf), np.full(2, -1), NoiseModels.of([t], 1.0, 144.0), 0.07), 0)
        for level in (0.0, 25e6)
    ]
    assert found[1].log_evidence == pytest.approx(found[0].log_evidence, abs=1e-3)
    assert found[1].variance == pytest.approx(found[0].variance, rel=1e-4)
    assert found[1].coefficients[0] - 25e6 == pytest.approx(found[0].coefficients[0], abs=1e-6)
