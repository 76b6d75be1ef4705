"""NBS14 test data (NIST SP 1065, pp. 107–108), an established implementation, and recovered noise coefficients."""

from pathlib import Path

import allantools
import numpy as np
import pytest

from compensation.errors import CompensationError
from compensation.noise import Noise
from compensation.stability import allan_deviation, equivalent_freedom, fit_noise

REFERENCE = Path(__file__).parents[1] / "reference"


def at(allan, tau):
    return allan.deviation[np.flatnonzero(allan.tau == tau)[0]]


def test_nbs14_nine_points():
    allan = allan_deviation(np.loadtxt(REFERENCE / "nbs14.csv", skiprows=5), 1.0)
    assert at(allan, 1) == pytest.approx(91.22945, abs=5e-6)
    assert at(allan, 2) == pytest.approx(85.95287, abs=5e-6)


def test_nbs14_thousand_points():
    n = [1234567890]
    for _ in range(999):
        n.append(16807 * n[-1] % 2147483647)
    allan = allan_deviation(np.array(n) / 2147483647, 1.0, factors=[1, 10, 100])
    assert allan.tau == pytest.approx([1, 10, 100])
    assert allan.deviation == pytest.approx([2.922319e-01, 9.159953e-02, 3.241343e-02], abs=5e-8)


@pytest.mark.parametrize("kind", ["white", "random walk", "drift"])
def test_allantools_agrees(kind):
    rng = np.random.default_rng(4)
    y = rng.normal(size=3000)
    y = {"white": y, "random walk": np.cumsum(y), "drift": y + 1e6 + 0.01 * np.arange(3000)}[kind]
    ours = allan_deviation(y, 0.05)
    _, deviation, _, _ = allantools.oadev(y, rate=20.0, data_type="freq", taus=ours.tau)
    assert ours.deviation == pytest.approx(deviation, rel=1e-8)


@pytest.mark.parametrize(("kind", "alpha"), [("phase", 2), ("white", 0), ("flicker", -1), ("random walk", -2)])
@pytest.mark.parametrize("m", [1, 4, 100])
def test_degrees_of_freedom_agree_with_allantools(kind, alpha, m):
    expected = allantools.edf_simple(1001, m, alpha)
    if (kind, m) == ("flicker", 1):
        expected *= 1001 - 2  # allantools 2024.6 lacks the square in 2 (N − 2)² / (2.3 N − 4.9) and returns 0.87
    assert equivalent_freedom(kind, 1001, m) == pytest.approx(expected, rel=1e-12)


def test_confidence_bands_cover_the_truth():
    """White noise of unit density: σ(τ) = 1/√τ lies in the 68.3 % band about that often, at short and long τ."""
    inside = []
    for seed in range(300):
        allan = allan_deviation(np.random.default_rng(seed).normal(size=600), 1.0, points_per_octave=1)
        truth = 1 / np.sqrt(allan.tau)
        inside.append((allan.low < truth) & (truth < allan.high))
    rate = np.mean(inside, axis=0)
    assert np.all(np.abs(rate - 0.683) < 0.1)


@pytest.mark.slow
def test_planted_noise_is_recovered_with_honest_uncertainty():
    near = np.zeros((2, 2))
    runs = 100
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        y = 3.0 * rng.normal(size=6000) + np.cumsum(0.02 * rng.normal(size=6000))
        noise = fit_noise(allan_deviation(y, 1.0, points_per_octave=2))
        z = np.abs([(noise.N - 3.0) / noise.N_uncertainty, (noise.K - 0.02) / noise.K_uncertainty])
        near += z[:, None] < [1, 2]
    assert np.all(near[:, 0] / runs > 0.55)
    assert np.all(near[:, 0] / runs < 0.90)
    assert np.all(near[:, 1] / runs > 0.90)


def test_white_noise_shows_no_random_walk():
    noise = fit_noise(allan_deviation(np.random.default_rng(1).normal(size=20000), 1.0))
    assert noise.N == pytest.approx(1.0, abs=0.03)
    assert noise.K < 3 * noise.K_uncertainty
    assert noise.misfit < 2


def test_flicker_is_read_at_its_flat_part():
    readings = [
        allan_deviation(Noise(flicker=0.5).draw(30000, 1.0, np.random.default_rng(seed)), 1.0).deviation[12:24].mean()
        for seed in range(20)
    ]
    assert np.mean(readings) == pytest.approx(0.5, rel=0.05)


@pytest.mark.parametrize(
    ("rate", "step", "message"),
    [
        (np.arange(8.0), 1.0, "at least 9 samples"),
        (np.where(np.arange(20) == 3, np.nan, 1.0), 1.0, "has 1 missing value;"),
        (np.arange(20.0), 0.0, "step must be positive"),
        (np.full(20, 3.0), 1.0, "constant"),
    ],
)
def test_unusable_series_are_refused(rate, step, message):
    with pytest.raises(CompensationError, match=message):
        allan_deviation(rate, step)


@pytest.mark.parametrize("time", [30.0, 300.0])
def test_recovery_correlated_noise_is_read_off_the_curve_where_three_kinds_miss_it(time):
    """N = 1, Gauss–Markov noise of rms 0.5 beside it, 60 000 rows of 1 s: level and time within 15 and 40 %; N, B and K alone never need it."""
    for seed in range(3):
        y = Noise(white=1.0, markov=0.5, markov_time=time).draw(60_000, 1.0, np.random.default_rng(seed))
        found = fit_noise(allan_deviation(y, 1.0))
        assert found.misfit < 2
        assert found.N == pytest.approx(1.0, rel=0.03)
        assert found.markov == pytest.approx(0.5, rel=0.15)
        assert found.markov_time == pytest.approx(time, rel=0.4)
        plain = Noise(1.0, 0.05, 0.003).draw(60_000, 1.0, np.random.default_rng(seed))
        assert fit_noise(allan_deviation(plain, 1.0)).markov == 0.0
