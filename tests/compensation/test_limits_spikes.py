"""Spikes: found on flat and on steep ground and at both ends; smooth curves, steps and plain noise have none."""

import numpy as np
import pytest

from compensation.spikes import find_spikes, find_stuck, find_stuck_at_ends

ROWS = np.arange(600.0)
SHAPES = {
    "slow wave": np.sin(ROWS / 50.0),
    "fast wave": np.sin(ROWS / 5.0),
    "cooling": np.exp(-ROWS / 40.0),
    "bend at the start": np.exp(-ROWS / 100.0) + 0.05 * np.exp(-ROWS / 2.0),
    "step": np.where(ROWS < 300.0, 0.0, 1.0),
    "kink": np.maximum(ROWS - 300.0, 0.0),
    "parabola": ROWS**2,
    "counts": np.round(20.0 * np.sin(ROWS / 50.0)),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_smooth_shapes_have_no_spikes(shape):
    assert not find_spikes(SHAPES[shape]).any()
    noise = 1e-3 * np.random.default_rng(1).standard_normal(ROWS.size)
    assert not find_spikes(SHAPES[shape] + noise * np.ptp(SHAPES[shape])).any()


@pytest.mark.parametrize("lag", [0.3, 0.7, 1.0, 1.5, 3.0])
@pytest.mark.parametrize("settling", [20.0, 100.0, 400.0])
def test_the_start_of_a_step_through_a_lag_has_none(lag, settling):
    """The response 1 − (T e^{−t/T} − τ e^{−t/τ})/(T − τ) starts at rest and bends for a few rows."""
    step = 1 - (settling * np.exp(-ROWS / settling) - lag * np.exp(-ROWS / lag)) / (settling - lag)
    for noise in (0.0, 1e-5, 1e-4):
        values = step + noise * np.random.default_rng(6).standard_normal(ROWS.size)
        assert not find_spikes(values).any()
        assert not find_spikes(values[::-1]).any()


@pytest.mark.parametrize("slope", [0.0, 0.1, 3.0])
def test_spikes_are_found_however_steep_the_record(slope):
    values = slope * ROWS + 0.01 * np.random.default_rng(2).standard_normal(ROWS.size)
    places = [0, 3, 40, 200, 311, 598]
    values[places] += [-0.3, -0.4, 0.2, -0.2, 0.3, 0.4]  # +0.3 in the first row could be a run that begins at rest
    assert np.flatnonzero(find_spikes(values)).tolist() == places


@pytest.mark.parametrize("apart", [1, 2, 3, 4, 5, 6])
@pytest.mark.parametrize("second", [0.2, -0.15])
def test_a_spike_does_not_hide_the_one_beside_it(apart, second):
    values = 0.1 * ROWS + 0.01 * np.random.default_rng(3).standard_normal(ROWS.size)
    places = [200, 200 + apart]
    values[places] += [0.2, second]
    assert np.flatnonzero(find_spikes(values)).tolist() == places


def test_a_staircase_has_none():
    """A row taken in the middle of a transition, and the rows beside it, are readings."""
    for noise in (0.0, 1e-3, 1e-2):
        values = np.repeat(np.arange(20.0), 30)
        values[30::90] -= 0.6
        values += noise * np.random.default_rng(4).standard_normal(values.size)
        assert not find_spikes(values).any()


def test_gaussian_noise_has_next_to_none():
    """Six robust deviations of the distance, about seven of the noise, are passed by 1e-11 of Gaussian rows."""
    found = sum(int(find_spikes(np.random.default_rng(k).standard_normal(600)).sum()) for k in range(100))
    assert found <= 1


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("step", [1e-4, 1e-3])
def test_readings_that_stand_still_at_an_end_after_noise_are_stuck(shape, step):
    span = np.ptp(SHAPES[shape])
    noise = 20.0 * step * span * np.random.default_rng(1).standard_normal(ROWS.size)
    own = np.round((SHAPES[shape] + noise) / (step * span)) * step * span
    assert not find_stuck(own).any()
    ended, begun = own.copy(), own.copy()
    ended[350:], begun[:350] = ended[350], begun[349]
    assert np.flatnonzero(find_stuck(ended)).tolist() == list(range(350, 600))
    assert np.flatnonzero(find_stuck_at_ends(begun)).tolist() == list(range(350))


@pytest.mark.parametrize("rows", [0.05, 0.3, 1.0, 3.0])
@pytest.mark.parametrize("step", [1e-6, 1e-2])
def test_what_settles_is_held_or_stands_still_at_its_rounding_is_not_stuck(rows, step):
    """A step, a cooling, a ramp to a set point and back: without noise, or with less than is recorded."""
    t = ROWS * rows
    for own in (
        np.exp(-t),
        1.0 - (1.0 + t) * np.exp(-t),
        np.minimum(ROWS / 100.0, 1.0),
        np.maximum(2.0 - ROWS / 200.0, 0.0),
    ):
        for noise in (0.0, 0.3 * step):
            recorded = np.round((own + noise * np.random.default_rng(2).standard_normal(ROWS.size)) / step) * step
            assert not find_stuck_at_ends(recorded).any()
            assert not find_stuck_at_ends(recorded[::-1]).any()


@pytest.mark.parametrize("noise", [0.05, 0.2, 0.35, 0.6])
def test_plateaus_of_coarse_digits_are_not_stuck_and_a_stuck_sensor_among_noise_or_on_a_ramp_is(noise):
    """Soaks, ramps of parts of a step to several steps a row, and a bend, noise in steps of the last digit; a real hold of 40 rows on a ramp."""
    t = np.arange(3000.0)
    soaks = np.interp(t, [0, 500, 700, 1400, 1500, 2200, 3000], [0, 0, 90, 90, -200, -200, 35]) + 8 * np.sin(t / 300)
    for seed in range(5):
        draw = noise * np.random.default_rng(seed).standard_normal(t.size)
        assert not find_stuck(np.round(soaks + draw)).any()
    held = np.round(t + 3.0 * np.random.default_rng(1).standard_normal(t.size))
    held[1000:1040] = held[1000]
    assert np.flatnonzero(find_stuck(held)).tolist() == list(range(1000, 1040))
