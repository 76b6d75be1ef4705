"""Simulated noise has the levels that gyro data sheets state, measured by an established implementation."""

import allantools
import numpy as np
import pytest

from compensation.noise import Noise
from studies.instrument.tables.noise import NoiseKeys
from studies.simulation.noise import bias_noise, quantise


def allan(samples, rate, taus):
    found, deviation, _, _ = allantools.oadev(samples, rate=rate, data_type="freq", taus=taus)
    assert len(found) == len(taus)
    return deviation


def test_levels_of_the_rate_output_are_in_the_units_of_gyro_data_sheets():
    """Angle random walk N: N/√τ with τ in h; rate random walk K: K √(τ/3)."""
    levels = NoiseKeys(bias_white_deg_per_rt_h=0.02, bias_flicker_deg_per_h=0.0, bias_walk_deg_per_h_per_rt_h=0.5)
    both = bias_noise(levels)
    rng = np.random.default_rng(3)
    white = Noise(white=both.white).draw(400_000, 1.0, rng)
    assert allan(white, 1.0, [36.0]) == pytest.approx([0.02 / np.sqrt(0.01)], rel=0.05)
    walk = Noise(walk=both.walk).draw(400_000, 1.0, rng)
    assert allan(walk, 1.0, [360.0]) == pytest.approx([0.5 * np.sqrt(0.1 / 3)], rel=0.15)


def test_rounding_rounds():
    assert quantise(np.array([4432.0749, 4432.0751]), 0.01) == pytest.approx([4432.07, 4432.08])
    values = np.array([0.123456789])
    assert quantise(values, 0.0) is values
