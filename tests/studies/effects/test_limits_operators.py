"""Operators with memory against closed forms and finer steps."""

from dataclasses import replace

import numpy as np
import pytest

from studies.effects import Lags, States, apply_effect, find_effect
from studies.effects.states import lag, play, remembered


@pytest.mark.parametrize("tau", [40.0, 900.0, 2e4])
def test_lag_of_ramp_and_sine_are_exact(tau):
    t = np.arange(0.0, 30000.0, 10.0)
    ramp = lag(0.002 * t, 10.0, tau)
    assert np.allclose(ramp, 0.002 * (t - tau * (1.0 - np.exp(-t / tau))), atol=1e-9)
    omega = 2 * np.pi / 7200.0
    exact = (np.sin(omega * t) - omega * tau * (np.cos(omega * t) - np.exp(-t / tau))) / (1 + (omega * tau) ** 2)
    # a sine is not linear between samples: the error is that of the interpolation, (ω h)²/12
    assert np.max(np.abs(lag(np.sin(omega * t), 10.0, tau) - exact)) < (omega * 10.0) ** 2 / 8 + 1e-12


def test_play_is_rate_independent_and_remembers_its_return_points():
    drive = np.interp(np.linspace(0, 1, 4001), [0, 0.2, 0.5, 0.6, 0.7, 1.0], [0, 10, -8, 2, -3, 12])
    out = play(drive, 2.5)
    assert np.max(np.abs(out - drive)) <= 2.5 + 1e-12
    even = np.linspace(0, 1, 4001)
    hurried = play(np.interp(even**1.7, even, drive), 2.5)
    assert np.max(np.abs(np.interp(even ** (1 / 1.7), even, hurried) - out)) < 0.05
    # on the long way down the state is half a loop above; the minor loop 2 -> -3 -> 12 closes where it began
    down = 800 + int(np.argmin(np.abs(drive[800:2000])))
    assert out[down] == pytest.approx(2.5, abs=0.02)
    opened = 2000 + int(np.argmax(drive[2000:2600]))
    closed = 2900 + int(np.argmin(np.abs(drive[2900:] - drive[opened])))
    assert out[closed] == pytest.approx(out[opened], abs=0.02)


def test_radiation_of_a_saved_card_solves_the_exchange_of_heat():
    """Forward, at the fitted share: against small explicit steps of τ T′ = (1 − ρ)(T_h − T) + ρ (T_h⁴ − T⁴)/(4 T₀³)."""
    share, tau, step = 0.6, 1200.0, 10.0
    time = np.arange(0.0, 20000.0, step)
    housing = 293.15 + 30.0 * np.sin(time / 2500.0)
    states = States(0, time, time, housing, lag(housing, step, tau), Lags.one(tau), 285.0)
    _, change = apply_effect(
        "radiation", {"share_of_form": share, "exchange": 1.0, "radiated_share": share}, states, "frequency_Hz"
    )
    fine = np.arange(0.0, 20000.0, 0.5)
    drive = np.interp(fine, time, housing)
    T = np.empty_like(fine)
    T[0] = drive[0]
    for k in range(1, fine.size):
        u, t = drive[k - 1], T[k - 1]
        T[k] = t + 0.5 / tau * ((1.0 - share) * (u - t) + share * (u**4 - t**4) / (4.0 * 293.15**3))
    exact = np.interp(time, fine, T)
    assert np.abs(exact - states.resonator).max() > 0.4
    assert np.abs(states.resonator + change - exact).max() < 0.01


def run_of(number, time, temperature, start=0.0):
    return States(number, time, time + start, temperature, temperature, Lags.one(1.0), 293.15)


def test_a_loop_goes_on_in_the_next_run_where_it_ended_in_the_last():
    time = np.arange(0.0, 6000.0, 10.0)
    whole = 293.15 + 20.0 * np.sin(time / 700.0) * time / 6000.0
    runs = [run_of(0, time[:250], whole[:250]), run_of(1, time[:350], whole[250:], 2500.0)]
    parts = [replace(run, before=past) for run, past in zip(runs, remembered(runs), strict=True)]
    effect = find_effect("hysteresis")
    shape = (3.0, 2.0, -5.0, 45.0)
    once = effect.columns(run_of(0, time, whole), shape, "bias_deg_per_h")
    twice = np.concatenate([effect.columns(part, shape, "bias_deg_per_h") for part in parts])
    assert np.allclose(once, twice, atol=1e-9)
    assert not np.allclose(once, np.concatenate([effect.columns(run, shape, "bias_deg_per_h") for run in runs]))


def test_a_jump_relaxes_as_the_mean_over_each_step_of_the_grid():
    """Against a sum over a hundred times finer steps; what relaxes is gone in later runs, what stays is not."""
    effect, step, moment = find_effect("jump"), 240.0, 1000.0

    def states(run, spacing):
        time = spacing * (np.arange(round(4800.0 / spacing)) + 0.5)
        return States(run, time, time, time, time, Lags.one(600.0), 293.0)

    coarse = effect.columns(states(0, step), (0.0, moment, 1.0), "frequency_Hz")
    fine = effect.columns(states(0, step / 100.0), (0.0, moment, 1.0), "frequency_Hz")
    np.testing.assert_allclose(coarse, fine.reshape(20, 100, -1).mean(axis=1), atol=1e-12)
    later = effect.columns(states(1, step), (0.0, moment, 1.0), "frequency_Hz")
    assert np.all(later[:, 0] == 1.0)
    assert not later[:, 1:].any()
