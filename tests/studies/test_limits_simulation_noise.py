"""Simulated noise has the Allan deviation that its levels state, measured by an established implementation."""

import allantools
import numpy as np
import pytest

from studies.instrument.tables.noise import NoiseKeys
from studies.simulation.noise import (
    NoiseLevels,
    bias_noise,
    flicker_noise,
    quantise,
    random_walk,
    white_noise,
)


def allan(samples, rate, taus):
    found, deviation, _, _ = allantools.oadev(samples, rate=rate, data_type="freq", taus=taus)
    assert len(found) == len(taus)
    return deviation


@pytest.mark.parametrize("rate", [1.0, 8.0])
def test_white_noise_falls_with_the_root_of_time(rate):
    noise = white_noise(400_000, rate, 2e-3, np.random.default_rng(1))
    taus = np.array([1.0, 10.0, 100.0])
    assert allan(noise, rate, taus) == pytest.approx(2e-3 / np.sqrt(taus), rel=0.06)


@pytest.mark.parametrize("rate", [1.0, 8.0])
def test_a_random_walk_rises_with_the_root_of_time(rate):
    noise = random_walk(400_000, rate, 1e-5, np.random.default_rng(2))
    taus = np.array([10.0, 100.0, 1000.0]) * 8 / rate
    assert allan(noise, rate, taus) == pytest.approx(1e-5 * np.sqrt(taus / 3), rel=0.1)
    assert noise[0] == 0.0


def test_flicker_noise_is_flat_at_its_level():
    """Averaged over realisations: a single flat part scatters by several per cent at its long end."""
    taus = np.array([8.0, 64.0, 512.0])
    runs = [allan(flicker_noise(1 << 17, 0.1, np.random.default_rng(seed)), 1.0, taus) ** 2 for seed in range(12)]
    assert np.sqrt(np.mean(runs, axis=0)) == pytest.approx(np.full(3, 0.1), rel=0.06)


def test_levels_of_the_rate_output_are_in_the_units_of_gyro_data_sheets():
    """Angle random walk N: N/√τ with τ in h; rate random walk K: K √(τ/3)."""
    levels = NoiseKeys(bias_white_deg_per_rt_h=0.02, bias_flicker_deg_per_h=0.0, bias_walk_deg_per_h_per_rt_h=0.5)
    both = bias_noise(levels)
    rng = np.random.default_rng(3)
    white = NoiseLevels(white=both.white).draw(400_000, 1.0, rng)
    assert allan(white, 1.0, [36.0]) == pytest.approx([0.02 / np.sqrt(0.01)], rel=0.05)
    walk = NoiseLevels(walk=both.walk).draw(400_000, 1.0, rng)
    assert allan(walk, 1.0, [360.0]) == pytest.approx([0.5 * np.sqrt(0.1 / 3)], rel=0.15)


def test_levels_of_zero_are_silent_and_rounding_rounds():
    assert not NoiseLevels().draw(100, 1.0, np.random.default_rng(0)).any()
    assert quantise(np.array([4432.0749, 4432.0751]), 0.01) == pytest.approx([4432.07, 4432.08])
    values = np.array([0.123456789])
    assert quantise(values, 0.0) is values
