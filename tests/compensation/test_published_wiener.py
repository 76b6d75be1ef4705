"""Wiener filters: the printed (35), (36), the optimum itself, and spectra that the paper does not treat."""

import math

import numpy as np
import pytest
import sympy

from compensation.demodulated import relate_rate_to_measured_rate
from compensation.derivation.filters import derive_wiener_filter
from compensation.errors import CompensationError
from compensation.spectral import (
    Spectrum,
    factorise,
    high_pass_spectrum,
    rate_spectrum,
    reflect,
    separate,
    white_spectrum,
)
from compensation.transfer import TransferFunction
from compensation.wiener import design_wiener_filter, judge_filter, renormalise

K, ZETA, GAMMA, B = 2 * math.pi * 500, 0.025, 0.1, 2 * math.pi * 3


def printed_filter(noise, gamma, B, a):
    """Eqs. (35) and (36) as printed, a = ζ k."""
    root = math.sqrt(1 + gamma**2)
    if noise == "white":
        middle = math.sqrt(gamma * (B**2 * gamma + a**2 * gamma + 2 * a * B * root))
        return TransferFunction((B * root, B * root * a), (gamma, middle, a * B * root))
    return TransferFunction((B, B * a), (gamma, math.sqrt(a * gamma * (2 * B + a * gamma)), B * a))


def noise_spectrum(noise, gamma, sigma, B):
    return white_spectrum(gamma, sigma) if noise == "white" else high_pass_spectrum(gamma, sigma, B)


@pytest.mark.parametrize("noise", ["white", "high-pass"])
@pytest.mark.parametrize(
    ("gamma", "B", "zeta", "k"), [(GAMMA, B, ZETA, K), (2.0, 30.0, 0.004, 900.0), (0.01, 5.0, 0.3, 7.0)]
)
def test_numeric_factorisation_gives_the_printed_filters_after_renormalisation(noise, gamma, B, zeta, k):
    gyro = relate_rate_to_measured_rate(k, zeta)
    best = design_wiener_filter(gyro, rate_spectrum(0.7, B), noise_spectrum(noise, gamma, 0.7, B))
    frequency = B * np.array([0.0, 0.1, 1.0, 7.0, 300.0])
    expected = printed_filter(noise, gamma, B, k * zeta).respond(frequency)
    np.testing.assert_allclose(renormalise(best.filter, gyro).respond(frequency), expected, rtol=1e-9)
    assert best.filter.is_stable


@pytest.mark.parametrize("noise", ["white", "high-pass"])
def test_symbolic_derivation_gives_the_printed_filters(noise):
    gamma, B, zeta, k = sympy.symbols("gamma B zeta k", positive=True)
    s = sympy.Symbol("s")
    root, a = sympy.sqrt(1 + gamma**2), k * zeta
    printed = {
        "white": B
        * root
        * (s + a)
        / (gamma * s**2 + s * sympy.sqrt(gamma * (B**2 * gamma + a**2 * gamma + 2 * a * B * root)) + a * B * root),
        "high-pass": B * (s + a) / (s**2 * gamma + s * sympy.sqrt(a * gamma * (2 * B + a * gamma)) + B * a),
    }[noise]
    derived = derive_wiener_filter(noise)
    assert sympy.simplify(derived.renormalised - printed) == 0
    # The derived optimum, before renormalisation, is the numeric one.
    values = {gamma: 0.1, B: 18.8, zeta: 0.025, k: 3000.0}
    gyro = relate_rate_to_measured_rate(3000.0, 0.025)
    numeric = design_wiener_filter(gyro, rate_spectrum(1.0, 18.8), noise_spectrum(noise, 0.1, 1.0, 18.8)).filter
    at = 4.0 + 9.0j
    assert complex(derived.optimum.subs(values).subs(s, at)) == pytest.approx(complex(numeric(at)), rel=1e-10)


@pytest.mark.parametrize("noise", ["white", "high-pass"])
def test_no_other_filter_errs_less(noise):
    """The optimum is stationary and least against every change of its coefficients; renormalising costs error."""
    gyro, rate, disturbance = (
        relate_rate_to_measured_rate(K, ZETA),
        rate_spectrum(1, B),
        noise_spectrum(noise, GAMMA, 1, B),
    )
    best = design_wiener_filter(gyro, rate, disturbance)
    generator = np.random.default_rng(3)
    for _ in range(40):
        size = 10.0 ** generator.uniform(-3, -0.5)
        numerator = np.array(best.filter.numerator) * (1 + size * generator.standard_normal(2))
        denominator = np.array(best.filter.denominator) * (1 + size * np.abs(generator.standard_normal(3)))
        other = judge_filter(TransferFunction(tuple(numerator), tuple(denominator)), gyro, rate, disturbance)
        assert other.error > best.error
    after = judge_filter(renormalise(best.filter, gyro), gyro, rate, disturbance)
    assert best.error < after.error < rate.variance


def test_error_is_the_integral_of_the_spectral_density():
    gyro, rate, noise = relate_rate_to_measured_rate(K, ZETA), rate_spectrum(1, B), white_spectrum(GAMMA, 1)
    result = design_wiener_filter(gyro, rate, noise)
    frequency = np.sinh(np.linspace(-16, 16, 40001))  # dense near zero, far enough for the tails
    GW, G = result.filter.respond(frequency) * gyro.respond(frequency), result.filter.respond(frequency)
    distortion = np.trapezoid(np.abs(GW - 1) ** 2 * rate.density(frequency), frequency) / (2 * np.pi)
    passed = np.trapezoid(np.abs(G) ** 2 * noise.density(frequency), frequency) / (2 * np.pi)
    assert result.distortion == pytest.approx(distortion, rel=1e-4)
    assert result.noise == pytest.approx(passed, rel=1e-4)


def test_error_of_a_simulated_gyro_is_the_computed_one():
    """A rate of spectrum (27) and white noise in time, through (25) and the filter: variance of 40 s to 10 %."""
    from scipy.signal import lfilter

    step, rows = 2e-4, 200_000
    generator = np.random.default_rng(12)
    gyro, rate, noise = relate_rate_to_measured_rate(K, ZETA), rate_spectrum(1, B), white_spectrum(GAMMA, 1)
    best = design_wiener_filter(gyro, rate, noise)
    kept = math.exp(-B * step)
    Omega = lfilter([math.sqrt(rate.variance * (1 - kept**2))], [1, -kept], generator.standard_normal(rows))
    time = step * np.arange(rows)
    added = GAMMA / math.sqrt(step) * generator.standard_normal(rows)
    read = best.filter.simulate(time, gyro.simulate(time, Omega) + added)
    assert np.mean((read - Omega)[1000:] ** 2) == pytest.approx(best.error, rel=0.1)


def test_corners_far_apart_and_axis_roots():
    far = np.poly([-1e-6, -1e3])
    np.testing.assert_allclose(np.sort(np.roots(factorise(np.polymul(far, reflect(far))))), [-1e3, -1e-6], rtol=1e-6)
    with pytest.raises(CompensationError, match="at 2 rad/s"):
        factorise([1.0, 0.0, 8.0, 0.0, 16.0])


def test_wiener_without_gyro_dynamics_is_the_textbook_first_order_filter():
    """Gauss–Markov signal in white noise: G = (β − B) / (s + β), β = B √(1 + 1/γ²)."""
    best = design_wiener_filter(TransferFunction((1.0,), (1.0,)), rate_spectrum(2.0, 3.0), white_spectrum(0.5, 2.0))
    beta = 3.0 * math.sqrt(1 + 1 / 0.25)
    s = np.array([0.0, 1j, 40j])
    np.testing.assert_allclose(best.filter(s), (beta - 3.0) / (s + beta), rtol=1e-12)


def test_other_spectra():
    """A resonant line in the noise: the optimum dips there and still errs less than the filter for white noise."""
    gyro, rate = relate_rate_to_measured_rate(K, ZETA), rate_spectrum(1, B)
    line = Spectrum((-2.0, 0.0, 5e4), (1.0, 0.0, 2 * 60.0**2 - 4.0, 0.0, 60.0**4))  # S(jω) peaks at 60 rad/s
    best = design_wiener_filter(gyro, rate, line)
    for_white = design_wiener_filter(gyro, rate, white_spectrum(GAMMA, 1)).filter
    assert best.error < judge_filter(for_white, gyro, rate, line).error
    assert abs(best.filter.respond(60.0)) < 0.2 * abs(best.filter.respond(200.0))


def test_factor_and_separation():
    stable = np.poly([-2.0, -2.0, -1 + 3j, -1 - 3j]).real
    np.testing.assert_allclose(factorise(np.polymul(stable, reflect(stable))), stable, rtol=1e-6)
    # 1/((s+1)²(2−s)) = t/(s+1)² + b/(2−s):  b = 1/9, t = (s + 4)/9
    t = separate(np.array([1.0]), np.array([1.0, 2.0, 1.0]), np.array([-1.0, 2.0]))
    np.testing.assert_allclose(t, [0, 1 / 9, 4 / 9], rtol=1e-12, atol=1e-15)


def test_variance_of_the_rate():
    assert rate_spectrum(1.5, B).variance == pytest.approx(1.5**2 * B / 2, rel=1e-12)
    assert white_spectrum(1, 1).variance == math.inf


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda: Spectrum((1.0, 0.0), (1.0,)), "even"),
        (lambda: Spectrum((1.0,), (1.0, 0.0, 4.0)), "negative"),
        (lambda: Spectrum((0.0,), (1.0,)), "not all zero"),
        (
            lambda: design_wiener_filter(
                TransferFunction((1.0,), (1.0, 1.0)), Spectrum((1.0,), (-1.0, 0.0, 0.0)), white_spectrum(1, 1)
            ),
            "infinite at 0 rad/s",
        ),
        (
            lambda: design_wiener_filter(
                TransferFunction((1.0,), (1.0, -1.0)), rate_spectrum(1, 1), white_spectrum(1, 1)
            ),
            "stable gyro",
        ),
    ],
)
def test_what_has_no_optimum_is_refused(act, words):
    with pytest.raises(CompensationError, match=words):
        act()
