"""The four-step chain of the bell-shaped gyro: planted coefficients come back, intervals hold, nonsense is refused."""

import numpy as np
import pytest

from compensation.bell import BellChain, PolynomialCurve, apply_chain, design_smoother, invert_chain, smooth
from compensation.bell_calibration import (
    BellRun,
    fit_chain,
    fit_curve,
    fit_rough,
    fit_scale_over_temperature,
)
from compensation.errors import CompensationError
from compensation.linearity import measure_nonlinearity
from compensation.polynomial import fit_polynomial

NONE = np.zeros((3, 3))
EVERYWHERE = (-1e9, 1e9)
PRINTED = BellChain(
    null=-703.3858,
    scale=0.0242,
    rough_covariance=np.zeros((2, 2)),
    bias=PolynomialCurve(np.array([0.1673, -0.0056, 2.52e-5]), NONE, *EVERYWHERE),
    scale_over_rate=PolynomialCurve(np.array([-0.12, 0.99, 5.89e-6]), NONE, *EVERYWHERE),
    scale_over_temperature=PolynomialCurve(np.array([0.9979, -1.83e-5, -1.26e-7]), NONE, *EVERYWHERE),
    taps=np.empty(0),
    sampling=0.1,
)
STEP = 0.1


def make_runs(generator, noise, rows=4000, dwell=200):
    """Rates −360…360 °/s at 25 °C, rest and 300 °/s over −45…55 °C, of a gyro that the printed chain describes.

    `noise` is the standard deviation (°/s) of the output, brought to counts by the rough scale.
    """
    sweep = np.linspace(-45, 55, rows)
    plateaus = np.repeat(np.arange(-360.0, 361, 40), dwell)

    def run(rate, temperature):
        counts = invert_chain(PRINTED, rate, temperature)
        counts = counts + noise / 0.0242 * generator.standard_normal(len(rate))
        return BellRun(STEP * np.arange(len(rate)), counts, temperature, rate)

    return (run(plateaus, np.full(len(plateaus), 25.0)), run(np.zeros(rows), sweep), run(np.full(rows, 300.0), sweep))


def fit_planted(seed, noise=0.06):
    rates, rest, turning = make_runs(np.random.default_rng(seed), noise)
    return fit_chain(rates, rest, turning, cutoff=None), (rates, rest, turning)


def test_inverse_then_chain_is_the_identity():
    rate, temperature = np.linspace(-340, 340, 50), np.linspace(-43, 55, 50)
    counts = invert_chain(PRINTED, rate, temperature)
    result = apply_chain(PRINTED, np.arange(50.0), counts, temperature)
    np.testing.assert_allclose(result.filtered, rate, rtol=1e-12, atol=1e-14)


def test_noise_free_records_are_compensated_and_give_the_printed_coefficients():
    """Scale is shared between S₁, (35) and (36), and the null between N₁ and (34): the products come back."""
    chain, (rates, rest, turning) = fit_planted(0, noise=0.0)
    for run in (rates, rest, turning):
        result = apply_chain(chain, run.time, run.output, run.temperature)
        np.testing.assert_allclose(result.temperature_compensated, run.rate, atol=2e-5 * 360)
    share = chain.scale / PRINTED.scale
    at_25 = PRINTED.scale_over_temperature.value(25.0)
    bias = chain.bias.coefficients - share * PRINTED.bias.coefficients
    np.testing.assert_allclose(bias[1:], 0, atol=1e-9)
    slope = chain.scale_over_rate.coefficients[1] * share / at_25
    assert slope == pytest.approx(PRINTED.scale_over_rate.coefficients[1], rel=1e-5)
    assert chain.scale_over_rate.coefficients[2] * share**2 / at_25 == pytest.approx(5.89e-6, rel=1e-3)
    np.testing.assert_allclose(
        chain.scale_over_temperature.coefficients * at_25, PRINTED.scale_over_temperature.coefficients, rtol=1e-4
    )


@pytest.mark.slow
def test_intervals_cover():
    """95 % intervals of every step, given the steps before it, hold what noise-free data would give."""
    runs, held = 50, {"rough": np.zeros(2), "bias": np.zeros(3), "rate": np.zeros(3), "temperature": np.zeros(3)}
    clean = make_runs(np.random.default_rng(0), 0.0, 600, 30)
    clean_null, clean_scale, _ = fit_rough(clean[0])
    for seed in range(runs):
        noisy = make_runs(np.random.default_rng(seed), 0.06, 600, 30)
        null, scale, covariance = fit_rough(noisy[0])
        off = np.array([null - clean_null, scale - clean_scale])
        held["rough"] += np.abs(off) < 1.96 * np.sqrt(np.diag(covariance))
        chain = fit_chain(*noisy, cutoff=None)
        truth = _fit_clean(chain, clean)
        for name, curve, true in zip(
            ("bias", "rate", "temperature"),
            (chain.bias, chain.scale_over_rate, chain.scale_over_temperature),
            truth,
            strict=True,
        ):
            off = np.abs(curve.coefficients - true)
            held[name] += off < 1.96 * np.sqrt(np.diag(curve.covariance))
    for name, count in held.items():
        assert np.all(np.abs(count / runs - 0.95) < 4 * np.sqrt(0.95 * 0.05 / runs)), (name, count / runs)


@pytest.mark.slow
def test_intervals_allow_for_a_bias_that_wanders():
    """With a random walk of 0.003 °/s a row, white-noise intervals of the bias would hold in a fifth of the records."""
    runs, held, naive = 40, np.zeros(3), np.zeros(3)
    _, rest, _ = make_runs(np.random.default_rng(0), 0.0, 600, 30)
    rough = PRINTED.scale * (rest.output - PRINTED.null)
    truth = fit_curve(rest.temperature, rough, "temperature").coefficients
    for seed in range(runs):
        generator = np.random.default_rng(seed)
        noise = 0.06 * generator.standard_normal(600) + 0.003 * np.cumsum(generator.standard_normal(600))
        curve = fit_curve(rest.temperature, rough + noise, "temperature")
        white = fit_polynomial(rest.temperature, rough + noise, 2).about(0.0)[1]
        off = np.abs(curve.coefficients - truth)
        held += off < 1.96 * np.sqrt(np.diag(curve.covariance))
        naive += off < 1.96 * np.sqrt(np.diag(white))
    assert np.all(held / runs > 0.8)
    assert np.all(naive / runs < 0.5)


def _fit_clean(chain, clean):
    """What each step would be on noise-free records after the same earlier steps."""
    rates, rest, turning = clean
    bias = fit_curve(rest.temperature, chain.scale * (rest.output - chain.null), "temperature")
    straight = chain.scale * (rates.output - chain.null) - chain.bias.value(rates.temperature)
    over_rate = fit_curve(straight, rates.rate, "measured rate")
    rough = chain.scale * (turning.output - chain.null) - chain.bias.value(turning.temperature)
    constant = chain.scale_over_rate.value(rough)
    over_temperature = fit_scale_over_temperature(turning.temperature, constant, turning.rate)
    return [curve.coefficients for curve in (bias, over_rate, over_temperature)]


def test_held_out_records_are_compensated_to_the_noise():
    chain, _ = fit_planted(1)
    for run in make_runs(np.random.default_rng(99), 0.06):
        before, after = (
            getattr(apply_chain(chain, run.time, run.output, run.temperature), step) - run.rate
            for step in ("rough", "temperature_compensated")
        )
        assert np.std(after) == pytest.approx(0.06, rel=0.05)
        assert np.sqrt(np.mean(before**2)) > 1.5 * np.sqrt(np.mean(after**2))


def test_filter_passes_a_constant_and_delays_a_ramp():
    taps = design_smoother(STEP, 1.0)
    assert len(taps) == 51
    np.testing.assert_allclose(smooth(np.full(80, 3.7), taps), 3.7, rtol=1e-12)
    ramp = np.arange(200) * STEP
    np.testing.assert_allclose(smooth(ramp, taps)[60:], ramp[60:] - 25 * STEP, rtol=1e-12)


def test_nonlinearity_is_of_means_at_held_rates_not_of_rows_on_the_way_between_them():
    """A parabola of 0.14 % in noise of 0.24 °/s: single rows on the way miss it by 0.1 %."""
    rates = np.linspace(-360.0, 360.0, 13)
    x = np.interp(
        np.arange(0.0, 13 * 31.0, 0.1),
        np.ravel([31.0 * np.arange(13), 31.0 * np.arange(13) + 30.0], "F"),
        np.repeat(rates, 2),
    )
    planted = 5.89e-6 * rates**2
    curve = np.polynomial.Polynomial.fit(rates, planted, 1)
    expected = np.max(np.abs(planted - curve(rates))) / 360.0
    noise = np.random.default_rng(3).normal(0.0, 0.24, x.size)
    assert measure_nonlinearity(x, x + 5.89e-6 * x**2 + noise) == pytest.approx(expected, abs=1.5e-4)
    assert measure_nonlinearity(x, x + noise) < 1.5e-4


def test_nonlinearity_of_a_parabola():
    """y = x + c x² on an even grid: the line leaves c (x² − mean x²), largest at the ends."""
    x = np.linspace(-2, 2, 41)
    expected = 0.01 * (4 - np.mean(x**2)) / 2
    assert measure_nonlinearity(x, x + 0.01 * x**2) == pytest.approx(expected, rel=1e-12)


def test_jitter_of_the_rate_table_does_not_split_a_plateau():
    x = np.repeat(np.linspace(-2, 2, 41), 50)
    jitter = 2e-4 * np.random.default_rng(1).uniform(-1, 1, len(x))
    noise = 0.1 * np.random.default_rng(2).standard_normal(len(x))
    even = measure_nonlinearity(x, x + noise)
    assert measure_nonlinearity(x + jitter, x + noise) == pytest.approx(even, rel=0.02)


def replace(run, **columns):
    return BellRun(
        **{name: columns.get(name, getattr(run, name)) for name in ("time", "output", "temperature", "rate")}
    )


RATES, REST, TURNING = make_runs(np.random.default_rng(8), 0.06)


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda: design_smoother(0.1, 200.0), "200 Hz is impossible"),
        (lambda: fit_chain(replace(RATES, rate=np.full(3800, 1.0)), REST, TURNING), r"\(33\): 'rate' is constant"),
        (
            lambda: fit_chain(RATES, replace(REST, temperature=np.full(4000, 27.0)), TURNING),
            r"\(34\): 'temperature' is constant",
        ),
        (lambda: fit_chain(RATES, REST, replace(TURNING, rate=0 * TURNING.rate)), r"\(36\)"),
        (lambda: replace(RATES, output=np.r_[np.nan, RATES.output[1:]]), "'output' has 1 missing"),
        (lambda: replace(RATES, output=RATES.output[1:]), "'output' has shape"),
        (lambda: apply_chain(fit_planted(1)[0], [0, 1], [0, 0], [-73.0, 27.0]), "extrapolation"),
        (lambda: apply_chain(fit_planted(1)[0], [0, 1], [0, 1e5], [17.0, 27.0]), "rate runs"),
        (lambda: measure_nonlinearity([1, 1, 2], [1, 1, 2]), "three applied rates"),
        (
            lambda: apply_chain(fit_chain(RATES, REST, TURNING), np.arange(9.0), np.full(9, -703.0), np.full(9, 27.0)),
            "designed for an output every 0.1 s",
        ),
    ],
)
def test_what_cannot_be_compensated_is_refused(act, words):
    with pytest.raises(CompensationError, match=words):
        act()
