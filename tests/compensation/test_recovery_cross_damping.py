"""Cross-damping: transfer functions against the full motion, the step from (8) to (9), and recovery of ζ₁₂(T)."""

import numpy as np
import pytest
import sympy

from compensation.cross_damping import (
    CrossDampingModel,
    RestRun,
    evaluate_cross_damping,
    fit_cross_damping,
    relate_cross_damping_to_rate_when_tuned,
    simulate_bias,
)
from compensation.demodulated import expand_secondary, relate_rate_to_secondary
from compensation.derivation import filters
from compensation.errors import CompensationError
from compensation.motion import demodulate, propagate_envelope, tune
from compensation.transfer import TransferFunction
from tests.compensation.integrated_motion import integrate_motion

PRINTED = np.array([1.0792e-3, -4.631e-5, 7.7044e-7, -5.8598e-9])
DEG_PER_H = np.pi / 180 / 3600
K, ZETA = 2 * np.pi * 5000, 5e-5


def test_eq_8_becomes_eq_9_exactly():
    k, zeta, s = filters.k, filters.zeta, filters.s
    assert sympy.simplify(filters.tuned_cross_damping() - 2 * k**2 * zeta / (filters.g_2 * (s + k * zeta))) == 0
    values = {k: 3000.0, zeta: 0.02, filters.g_2: 2.0}
    tuned = relate_cross_damping_to_rate_when_tuned(3000.0, 0.02)
    for at in (0.0, 3 + 90j, 300j):
        assert complex(filters.tuned_cross_damping().subs(values | {s: at})) == pytest.approx(
            complex(tuned(at)), rel=1e-12
        )


def test_constant_cross_damping_looks_like_a_rate():
    """2 k₂ ζ₁₂ / g₂: what no demodulation can tell from rotation."""
    e = tune(2 * np.pi * 500, 0.025)
    time = np.linspace(0, 0.2, 2001)
    zeta12 = 3e-6
    turned = propagate_envelope(e, time, np.full(2001, 2 * e.k2 * zeta12 / e.g2)).secondary[-1]
    damped = propagate_envelope(e, time, np.zeros(2001), zeta12=np.full(2001, zeta12)).secondary[-1]
    assert damped == pytest.approx(turned, rel=1e-4)


@pytest.mark.slow
def test_integrated_motion_with_varying_cross_damping_follows_the_slow_model():
    """Equations (2), carrier resolved and demodulated, against (9): 0.23 ζ in the amplitude, 2.6 ζ² in phase."""
    errors, in_phase = [], []
    for zeta in (0.02, 0.01):
        e = tune(2 * np.pi * 500, zeta)
        tau = 1 / (e.k1 * zeta)
        time = np.linspace(0, 8 * tau, 401)
        zeta12 = 1e-6 * np.clip(time / tau, 0, 1) * (1 + 0.5 * np.sin(time / tau))
        motion = integrate_motion(e, time, np.zeros(401), zeta12=zeta12, samples_per_cycle=24)
        at, amplitude = demodulate(motion.time, motion.secondary, e.omega)
        measured = amplitude / relate_rate_to_secondary(e).steady_gain
        expected = np.interp(at, time, simulate_bias(time, zeta12, e.k1, zeta))
        errors.append(np.max(np.abs(measured - expected)) / np.max(expected))
        in_phase.append(np.max(np.abs(measured.real - expected)) / np.max(expected))
        drive = 2j * e.primary_amplitude * e.omega * e.k2  # second of eqs. (6)
        exact = TransferFunction((drive,), expand_secondary(e)).simulate(time, zeta12)
        envelope = propagate_envelope(e, time, np.zeros(401), zeta12=zeta12).secondary
        assert np.max(np.abs(envelope - exact)) < 2e-4 * np.max(np.abs(exact))
    np.testing.assert_allclose(errors, [0.23 * 0.02, 0.23 * 0.01], rtol=0.05)
    np.testing.assert_allclose(in_phase, [2.7 * 0.02**2, 2.7 * 0.01**2], rtol=0.05)


def record(generator, *, noise, hours=6.0, step=10.0, size=40.0):
    """A zero-rate record: printed shape, constant part `size` °/h, temperature −40…+60 °C about 20 °C and back."""
    time = np.arange(0, hours * 3600, step)
    temperature = 10 + 50 * np.sin(2 * np.pi * time / (hours * 3600))
    coefficients = PRINTED / PRINTED[0] * size * DEG_PER_H / K
    rate = simulate_bias(time, evaluate_cross_damping(coefficients, temperature - 20), K, ZETA)
    return time, rate + noise * generator(len(time)), temperature, coefficients


def wandering(generator, walk):
    """White noise of deviation one plus a random walk of `walk` per step."""
    return lambda rows: generator.standard_normal(rows) + walk * np.cumsum(generator.standard_normal(rows))


def test_noise_free_record_gives_the_planted_coefficients():
    time, rate, temperature, planted = record(lambda rows: np.zeros(rows), noise=0.0)
    model = fit_cross_damping([RestRun(time, rate, temperature)], k=K, zeta=ZETA)
    np.testing.assert_allclose(model.coefficients, planted, rtol=1e-8)
    assert np.max(np.abs(model.compensate(time, rate, temperature))) < 1e-9 * np.max(np.abs(rate))


@pytest.mark.slow
@pytest.mark.parametrize("walk", [0.0, 0.05])
def test_intervals_cover(walk):
    """95 % intervals hold the planted coefficient in 95 % of 60 records, within 4 sigma, also when the bias wanders."""
    runs, held = 60, np.zeros(4)
    for seed in range(runs):
        draw = wandering(np.random.default_rng(seed), walk)
        time, rate, temperature, planted = record(draw, noise=0.5 * DEG_PER_H, step=60.0)
        model = fit_cross_damping([RestRun(time, rate, temperature)], k=K, zeta=ZETA)
        held += np.abs(model.coefficients - planted) < 1.96 * np.sqrt(np.diag(model.covariance))
    assert np.all(np.abs(held / runs - 0.95) < 4 * np.sqrt(0.95 * 0.05 / runs)), held / runs


def test_dynamics_is_invisible_in_a_slow_profile():
    """The filter's time constant 1/(kζ) is 0.6 s; against hours of temperature it moves nothing."""
    time, rate, temperature, _ = record(lambda rows: np.zeros(rows), noise=0.0)
    model = fit_cross_damping([RestRun(time, rate, temperature)], k=K, zeta=ZETA)
    assert 0 < model.memory(time, temperature) < 0.01 * np.ptp(rate)


def test_uneven_sampling_and_gaps_change_nothing():
    time, rate, temperature, planted = record(lambda rows: np.zeros(rows), noise=0.0)
    keep = np.r_[0:400, 900 : len(time)]
    model = fit_cross_damping([RestRun(time[keep], rate[keep], temperature[keep])], k=K, zeta=ZETA)
    np.testing.assert_allclose(model.coefficients, planted, rtol=1e-3)


def test_two_runs_are_fitted_together():
    """Each run starts settled; half a sweep in each gives what the whole sweep gives."""
    time, rate, temperature, planted = record(lambda rows: np.zeros(rows), noise=0.0)
    half = len(time) // 2
    runs = [RestRun(time[part], rate[part], temperature[part]) for part in (slice(half), slice(half, None))]
    model = fit_cross_damping(runs, k=K, zeta=ZETA)
    np.testing.assert_allclose(model.coefficients, planted, rtol=1e-3)


def some_model() -> CrossDampingModel:
    time, rate, temperature, _ = record(lambda rows: np.zeros(rows), noise=0.0)
    return fit_cross_damping([RestRun(time, rate, temperature)], k=K, zeta=ZETA)


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (
            lambda: fit_cross_damping([RestRun([0, 1, 2, 3], [0] * 4, [300] * 4)], k=K, zeta=ZETA),
            "'temperature' is constant",
        ),
        (lambda: fit_cross_damping([RestRun([0, 1, 2], [0] * 3, [300, 301, 302])], k=K, zeta=ZETA), "rows"),
        (lambda: fit_cross_damping([RestRun([0, 1, 2], [0, 1], [300, 301, 302])], k=K, zeta=ZETA), "'rate'"),
        (
            lambda: fit_cross_damping([RestRun([0, 1, 2], [0, 1, 2], [300, np.nan, 302])], k=K, zeta=ZETA),
            "'temperature' has 1",
        ),
        (lambda: fit_cross_damping([RestRun(range(9), [0] * 9, range(9))], k=K, zeta=ZETA, order=0), "order"),
        (
            lambda: fit_cross_damping([RestRun(range(9), [0] * 9, [300, 310] * 4 + [300])], k=K, zeta=ZETA),
            "combination",
        ),
        (lambda: fit_cross_damping([], k=K, zeta=ZETA), "at least one run"),
        (lambda: relate_cross_damping_to_rate_when_tuned(0.0, 0.1), "positive"),
        (lambda: some_model().predict([0, 1], [-73.0, -72.0]), "extrapolation"),
    ],
)
def test_what_cannot_be_fitted_is_refused(act, words):
    with pytest.raises(CompensationError, match=words):
        act()
