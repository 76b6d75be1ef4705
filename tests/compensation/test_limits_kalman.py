"""Kalman filter: consistency with its own statistics, the Riccati equation, another library and the Wiener filter."""

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from compensation.demodulated import relate_rate_to_measured_rate
from compensation.errors import CompensationError
from compensation.kalman import LinearModel, expect_mean_nis, model_gyro, noise_of_estimate, run_filter, settle
from compensation.spectral import rate_spectrum, white_spectrum
from compensation.wiener import design_wiener_filter

K, ZETA, STEP = 2 * np.pi * 500, 0.025, 1e-3
GYRO = model_gyro(K, ZETA, STEP, np.diag([0.0, 2e-6]), 0.01)


def simulate(model, rows, generator):
    """A series that the model describes exactly, from a start drawn from N(0, 1)."""
    n, m = len(model.transition), len(model.measurement_noise)
    x = generator.standard_normal(n)
    states, measurements = np.empty((rows, n)), np.empty((rows, m))
    roots = [np.diag(np.sqrt(np.diag(matrix))) for matrix in (model.process_noise, model.measurement_noise)]
    for i in range(rows):
        x = model.transition @ x + roots[0] @ generator.standard_normal(n)
        states[i], measurements[i] = x, model.measurement @ x + roots[1] @ generator.standard_normal(m)
    return states, measurements


def test_transition_and_observability_are_the_printed_ones():
    """Eqs. (38)–(41): exp(A t) and its observability matrix."""
    from scipy.linalg import expm

    a = K * ZETA
    np.testing.assert_allclose(GYRO.transition, expm(np.array([[-a, a], [0, 0]]) * STEP), rtol=1e-13)
    kept = np.exp(-a * STEP)
    observability = np.vstack([GYRO.measurement, GYRO.measurement @ GYRO.transition])
    np.testing.assert_allclose(observability, [[1, 0], [kept, 1 - kept]], rtol=1e-14)
    assert np.linalg.matrix_rank(observability) == 2


@pytest.mark.slow
def test_innovations_and_errors_are_chi_squared():
    runs, rows = 40, 600
    generator = np.random.default_rng(11)
    nis, final = [], []
    for _ in range(runs):
        states, measurements = simulate(GYRO, rows, generator)
        run = run_filter(GYRO, measurements, np.zeros(2), np.eye(2))
        nis.append(run.nis)
        error = run.states[-1] - states[-1]
        final.append(error @ np.linalg.solve(run.covariances[-1], error))
    low, high = expect_mean_nis(runs * rows, 1, 0.999)
    assert low < np.mean(nis) < high
    low, high = expect_mean_nis(runs, 2, 0.999)
    assert low < np.mean(final) < high
    # Innovations are white: neighbours are uncorrelated within the sampling error.
    series = np.asarray(nis) - 1
    assert abs(np.mean(series[:, 1:] * series[:, :-1])) < 5 * 2 / np.sqrt(runs * rows)


def test_a_wrong_noise_leaves_the_band():
    _, measurements = simulate(GYRO, 4000, np.random.default_rng(5))
    proud = model_gyro(K, ZETA, STEP, np.diag([0.0, 2e-6]), 0.008)
    assert np.mean(run_filter(proud, measurements, np.zeros(2), np.eye(2)).nis) > expect_mean_nis(4000, 1, 0.999)[1]


def test_filter_settles_to_the_riccati_solution():
    gain, before, after = settle(GYRO)
    run = run_filter(GYRO, np.zeros(6000), np.zeros(2), np.eye(2))
    np.testing.assert_allclose(run.covariances[-1], after, rtol=1e-9)
    np.testing.assert_allclose(run.innovation_covariances[-1, 0, 0], before[0, 0] + 0.01, rtol=1e-9)
    np.testing.assert_allclose(gain[:, 0], before[:, 0] / (before[0, 0] + 0.01), rtol=1e-12)


def test_noise_of_the_settled_estimate_is_that_of_its_answer_to_an_impulse():
    """White noise v of variance R through a filter with the impulse response h leaves R Σ h²."""
    _, _, after = settle(GYRO)
    impulse = np.zeros(60_000)
    impulse[0] = 1.0
    answer = run_filter(GYRO, impulse, np.zeros(2), after).states
    np.testing.assert_allclose(np.diag(noise_of_estimate(GYRO)), 0.01 * np.sum(answer**2, axis=0), rtol=1e-6)


def test_estimates_equal_another_library():
    _, measurements = simulate(GYRO, 500, np.random.default_rng(2))
    other = KalmanFilter(dim_x=2, dim_z=1)
    other.F, other.H, other.Q, other.R = GYRO.transition, GYRO.measurement, GYRO.process_noise, GYRO.measurement_noise
    other.x, other.P = np.zeros((2, 1)), np.eye(2)
    means, covariances, _, _ = other.batch_filter(list(measurements[:, :, None]))
    run = run_filter(GYRO, measurements, np.zeros(2), np.eye(2))
    np.testing.assert_allclose(run.states, means[:, :, 0], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(run.covariances, covariances, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize(("phi", "Q", "R"), [(0.9, 0.3, 2.0), (0.999, 1e-4, 1.0)])
def test_stationary_filter_of_an_ar1_in_white_noise_is_the_wiener_filter(phi, Q, R):
    """Spectral factorisation of Q/|1 − φz|² + R gives G = 1 − (R/r)(1 − φz)/(1 − cz), |c| < 1."""
    gain, _, after = settle(LinearModel([[phi]], [[1.0]], [[Q]], [[R]]))
    middle = (Q + R * (1 + phi**2)) / (R * phi)
    c = (middle - np.sqrt(middle**2 - 4)) / 2
    r = R * phi / c  # variance of the innovation
    z = np.exp(-1j * np.array([0.0, 0.02, 0.5, 3.0]))
    wiener = 1 - (R / r) * (1 - phi * z) / (1 - c * z)
    k = gain[0, 0]
    np.testing.assert_allclose(k / (1 - (1 - k) * phi * z), wiener, rtol=1e-10)
    # Its error is R times the zero-lag gain of the optimum, a standard identity of filtering.
    assert after[0, 0] == pytest.approx(R * k, rel=1e-10)


def test_fast_sampling_gives_the_wiener_filter_behind_the_gyro():
    """The rate (27) in white noise behind (25): sampled ever faster, the settled filter tends to the continuous one."""
    from scipy.linalg import expm

    a, B, sigma, gamma = K * ZETA, 2 * np.pi * 3, 0.3, 0.1
    best = design_wiener_filter(
        relate_rate_to_measured_rate(K, ZETA), rate_spectrum(sigma, B), white_spectrum(gamma, sigma)
    )
    A, frequency = np.array([[-a, a], [0.0, -B]]), np.array([0.0, 10.0, 50.0, 200.0])
    errors, differences = [], []
    for step in (4e-5, 2e-5):
        F = expm(A * step)
        model = LinearModel(F, [[1.0, 0.0]], np.diag([0.0, (sigma * B) ** 2 * step]), [[(gamma * sigma) ** 2 / step]])
        gain, _, after = settle(model)
        kept = (np.eye(2) - gain @ model.measurement) @ F
        response = [np.linalg.solve(np.eye(2) - kept * np.exp(-1j * at * step), gain)[1, 0] for at in frequency]
        errors.append(abs(after[1, 1] / best.error - 1))
        differences.append(np.max(np.abs(response - best.filter.respond(frequency))))
    assert errors[1] < 0.002
    assert differences[1] < 0.005
    # Both fall in proportion to the step.
    assert errors[0] / errors[1] == pytest.approx(2, rel=0.1)
    assert differences[0] / differences[1] == pytest.approx(2, rel=0.1)


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda: model_gyro(K, ZETA, 0.0, np.eye(2), 1.0), "positive"),
        (lambda: model_gyro(K, ZETA, STEP, -np.eye(2), 1.0), "non-negative"),
        (lambda: model_gyro(K, ZETA, STEP, np.eye(2), 0.0), "positive"),
        (lambda: run_filter(GYRO, [0.0, np.nan], np.zeros(2), np.eye(2)), "measurement 2"),
        (lambda: run_filter(GYRO, [0.0], np.zeros(3), np.eye(2)), "states"),
        (lambda: settle(model_gyro(K, ZETA, STEP, np.zeros((2, 2)), 1.0)), "steady"),
    ],
)
def test_what_cannot_be_filtered_is_refused(act, words):
    with pytest.raises(CompensationError, match=words):
        act()
