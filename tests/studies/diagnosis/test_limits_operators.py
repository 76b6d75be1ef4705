"""Operators with memory and the coloured likelihood against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from studies.diagnosis.campaign import load_campaign
from studies.diagnosis.evidence import Grams, Linear, solve
from studies.diagnosis.noise import KERNELS, SHARES, Eigenbasis, NoiseModels
from studies.effects import States, apply_effect, find_effect
from studies.effects.states import average, lag, play, remembered
from studies.record import Record


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


@pytest.mark.parametrize("kind", range(len(KERNELS)))
def test_evidence_is_that_of_the_full_covariance(kind):
    """Against the dense formula: flat columns projected out, priors as part of the covariance, σ² integrated.

    A prior counts in the white noise that this noise model leaves, whatever is usual.
    """
    rng = np.random.default_rng(4)
    t = np.sort(rng.choice(np.arange(0.0, 28800.0, 144.0), 90, replace=False))
    flat = np.stack([np.ones(90), t / 1e4], axis=1)
    ours = np.stack([np.sin(t / 3000.0), np.cos(t / 900.0)], axis=1)
    y = flat @ [1.0, 0.5] - 0.3 * ours[:, 0] + rng.standard_normal(90) + np.cumsum(rng.standard_normal(90)) * 0.1
    noise = NoiseModels.of([t], 1.0, 144.0)
    prior = np.array([np.inf, np.inf, 2.0, 0.5])
    model = Linear(y, np.concatenate([flat, ours], axis=1), prior, np.array([-1, -1, 0, 0]), noise, 0.7)
    share, scale = 5, 0.1
    grams = Grams(model, np.array([scale]))
    found = grams.log_evidence(np.array([scale]), (kind, share)) - noise.prior(kind)[share]
    white = 0.7 / grams.units[kind, share]
    basis = noise.bases[kind]
    covariance = basis.vectors[0] @ np.diag(1.0 + SHARES[share] * basis.eigenvalues) @ basis.vectors[0].T
    covariance += (ours * (scale * prior[2:] / white) ** 2) @ ours.T
    inverse = np.linalg.inv(covariance)
    middle = flat.T @ inverse @ flat
    rest = y @ inverse @ y - y @ inverse @ flat @ np.linalg.solve(middle, flat.T @ inverse @ y)
    exact = -0.5 * (np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(middle)[1] + 88 * np.log(rest))
    assert found == pytest.approx(exact, abs=1e-6)
    assert white == pytest.approx(np.sqrt(rest / 88), rel=0.01)


def test_a_solution_holds_the_coefficients_of_generalised_least_squares():
    rng = np.random.default_rng(5)
    t = np.arange(0.0, 28800.0, 144.0)
    columns = np.stack([np.ones(200), t / 1e4, np.sin(t / 3000.0)], axis=1)
    y = columns @ [1.0, 0.5, -0.3] + 0.1 * rng.standard_normal(200)
    noise = NoiseModels.of([t], 1.0, 144.0)
    found = solve(Linear(y, columns, np.full(3, np.inf), np.full(3, -1), noise, 0.1), 0)
    basis = noise.bases[found.kind]
    covariance = basis.vectors[0] @ np.diag(1.0 + SHARES[found.share] * basis.eigenvalues) @ basis.vectors[0].T
    inverse = np.linalg.inv(covariance)
    exact = np.linalg.solve(columns.T @ inverse @ columns, columns.T @ inverse @ y)
    assert np.allclose(found.coefficients, exact, rtol=1e-6)
    rest = y - columns @ exact
    assert np.allclose(
        found.covariance, rest @ inverse @ rest / 197 * np.linalg.inv(columns.T @ inverse @ columns), rtol=1e-5
    )


def test_walk_kernel_is_brownian_with_a_past():
    t = np.array([0.0, 7200.0, 28800.0])
    basis = Eigenbasis.of([t], KERNELS["random walk"], 0.1)
    covariance = basis.vectors[0] @ np.diag(basis.eigenvalues) @ basis.vectors[0].T
    assert np.allclose(covariance, [[0.5, 0.5, 0.5], [0.5, 0.75, 0.75], [0.5, 0.75, 1.5]])


def test_average_leaves_out_an_incomplete_group():
    assert np.allclose(average(np.arange(7.0), 3), [1.0, 4.0])


def test_radiation_of_a_saved_card_solves_the_exchange_of_heat():
    """Forward, at the fitted share: against small explicit steps of τ T′ = (1 − ρ)(T_h − T) + ρ (T_h⁴ − T⁴)/(4 T₀³)."""
    share, tau, step = 0.6, 1200.0, 10.0
    time = np.arange(0.0, 20000.0, step)
    housing = 293.15 + 30.0 * np.sin(time / 2500.0)
    states = States(0, time, time, housing, housing, 1.0, 285.0).with_lag(tau)
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
    return States(number, time, time + start, temperature, temperature, 1.0, 293.15)


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


def test_uneven_and_missing_rows_do_not_bend_means_and_a_bend_loses_no_heat():
    rng = np.random.default_rng(8)
    time = np.arange(0.0, 108000.0, 5.0)
    time[1:] += rng.uniform(-1.0, 1.0, time.size - 1)
    time = time[(rng.random(time.size) > 0.05) | (time < 20.0)]
    housing = 20.0 + 0.08 * np.clip(time - 9004.0, 0.0, 300.0)
    slow = 4400.0 + 40.0 * (time / 36000.0) ** 2 + np.cos(time / 900.0)
    record = Record({"time_s": time, "housing_temperature_degC": housing, "frequency_Hz": slow})
    campaign = load_campaign([record])
    run = campaign.runs[0]
    fine = np.linspace(-0.5, 0.5, 401)[None] * campaign.step + run.time[:, None]
    exact = np.mean(4400.0 + 40.0 * (fine / 36000.0) ** 2 + np.cos(fine / 900.0), axis=1)
    bound = np.diff(time).max() ** 2 / 8.0 * (1.0 / 900.0**2 + 80.0 / 36000.0**2)  # of a line between rows
    assert np.nanmax(np.abs(run.responses["frequency_Hz"] - exact)) < bound
    heat = np.cumsum(run.states.housing - 293.15) * run.states.step
    told = [
        0.5 * 0.08 * min(max(t - 9004.0, 0.0), 300.0) ** 2 + 24.0 * max(t - 9304.0, 0.0)
        for t in run.states.time + run.states.step / 2
    ]
    assert (
        np.max(np.abs(heat - told)) < 2.0 * 0.08 * np.diff(time).max() ** 2 / 8.0
    )  # of a line between rows at two bends
