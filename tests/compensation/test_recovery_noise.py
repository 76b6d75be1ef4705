"""Levels of noise come back from draws by restricted likelihood, with and without a prior."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.stats import chi2

from compensation.errors import CompensationError
from compensation.noise import Noise
from compensation.noise_estimate import estimate_noise
from compensation.noise_rows import UNKNOWNS, NoiseRows
from compensation.noise_within import within

Array = NDArray[np.float64]
GAPPED = np.cumsum(np.concatenate([np.full(60, 80.0), [4000.0], np.full(50, 130.0)]))
EVEN = 96.0 * np.arange(200.0)


def draw(rows: NoiseRows, noise: Noise, generator: np.random.Generator) -> Array:
    parts = [np.linalg.cholesky(rows.covariance(run, noise)) for run in range(len(rows.times))]
    return np.concatenate([L @ generator.standard_normal(len(L)) for L in parts])


@pytest.mark.slow
def test_levels_are_recovered_from_drawn_noise():
    generator = np.random.default_rng(11)
    rows = NoiseRows.of([EVEN] * 4)
    columns = np.column_stack([np.ones(800), np.tile(np.sin(EVEN / 3000.0), 4)])
    true = Noise(1.5, 0.1, 3e-4)
    found = [estimate_noise(rows, draw(rows, true, generator) + columns @ [3.0, -1.0], columns) for _ in range(12)]
    assert np.median([n.white for n in found]) == pytest.approx(1.5, rel=0.05)
    assert np.median([n.flicker for n in found]) == pytest.approx(0.1, rel=0.2)
    quiet = [estimate_noise(rows, draw(rows, Noise(1.5), generator), columns) for _ in range(6)]
    assert max(n.flicker for n in quiet) < 0.025
    assert max(n.walk for n in quiet) < 5e-4


@pytest.mark.slow
def test_what_is_stated_of_the_noise_helps_where_rows_say_little_and_yields_where_they_say_much():
    """Two short runs with a trend of each that is free: they hardly tell a walk from flicker."""
    generator = np.random.default_rng(8)
    few, many = NoiseRows.of([EVEN] * 2), NoiseRows.of([EVEN] * 4)
    trends = np.kron(np.eye(2), np.column_stack([np.ones(200), EVEN / 2e4, np.log1p(EVEN / 5e3)]))
    true = Noise(2.0, 0.2, 0.01)
    drawn = [draw(few, true, generator) for _ in range(12)]

    def missed(stated: Noise | None) -> float:
        found = [estimate_noise(few, r, trends, stated=stated).walk for r in drawn]
        return float(np.sqrt(np.mean(np.log(np.array(found) / true.walk) ** 2)))

    assert missed(true) < 0.5
    assert missed(true) < 0.5 * missed(None)
    loud = [draw(many, Noise(2.0, walk=2.0 / 60), generator) for _ in range(2)]
    found = [estimate_noise(many, r, stated=Noise(0.0, flicker=0.008, walk=0.1 / 60)).walk for r in loud]
    assert np.median(found) == pytest.approx(2.0 / 60, rel=0.35)


@pytest.mark.slow
def test_tests_at_the_estimated_noise_keep_their_level():
    """A smooth column that is not there: χ² of its coefficient exceeds its 5 % quantile in about 5 % of runs of noise."""
    generator = np.random.default_rng(5)
    rows = NoiseRows.of([EVEN[:120]] * 3)
    t = EVEN[:120]
    X = np.column_stack([np.ones(360), np.tile(np.sin(t / 2500.0), 3), np.tile(t / t[-1], 3)])
    beyond = 0
    for _ in range(60):
        r = draw(rows, Noise(1.5, 0.08, 8e-4), generator)
        noise = estimate_noise(rows, r, X)
        W = rows.whiten(np.column_stack([X, r]), noise)
        covariance = np.linalg.inv(W[:, :3].T @ W[:, :3])
        coefficient = covariance @ W[:, :3].T @ W[:, 3]
        beyond += coefficient[1] ** 2 / covariance[1, 1] > chi2.ppf(0.95, 1)
    assert beyond <= 8  # of 60; 3 expected


@pytest.mark.parametrize("seed", range(6))
def test_levels_of_many_rows_are_those_of_all_of_them(seed, monkeypatch):
    """From coarse rows alone, white noise was up to half off and −2 ln L up to 36 above its least."""
    generator, t = np.random.default_rng(seed), 40.0 * np.arange(401.0)
    rows, true = NoiseRows.of([t]), Noise(0.002, 0.0002, 1e-5)
    X = np.vander((t - t.mean()) / t.std(), 4)
    r = draw(rows, true, generator) + 1e3 * X @ [1.0, -2.0, 3.0, 4.0]
    found = estimate_noise(rows, r, X)
    monkeypatch.setattr("compensation.noise_rows.COARSE", 1000)
    whole = NoiseRows.of([t])
    best = estimate_noise(whole, r, X)
    assert found.white == pytest.approx(true.white, rel=0.25)
    beyond = [whole.deviance(r, X, np.zeros(4), one)[0] for one in (found, best)]
    assert beyond[0] < beyond[1] + 3.0


def test_what_only_the_rows_within_a_coarse_one_tell_of_is_no_noise():
    """A jump whose time is free leaves no trace in a mean over it, and was taken for white noise."""
    generator, t = np.random.default_rng(1), 40.0 * np.arange(401.0)
    rows, jump = NoiseRows.of([t]), np.zeros((401, 1))
    jump[30:32, 0] = 1.0, -1.0
    found = estimate_noise(rows, draw(rows, Noise(2.0), generator) + 50.0 * jump[:, 0], jump)
    assert found.white == pytest.approx(2.0, rel=0.1)


def test_what_is_within_coarse_rows_is_the_likelihood_of_their_contrasts():
    """Of groups of three even rows, an outlier's and a gap's left out: exact where groups are independent, slopes its differences."""
    generator = np.random.default_rng(3)
    t = np.cumsum(np.full(400, 5.0) + 100.0 * (np.arange(400) == 151))
    stretch = np.where(np.arange(400) == 30, 50.0, 1.0)
    rows = replace(NoiseRows.of([t], [np.full(400, 5.0)]), stretch=(stretch,))
    noise, r = Noise(1.0, 0.5, 0.1, 0.0, 0.6, 7.0), generator.standard_normal(400)
    (own,) = within(rows, r, np.zeros((400, 0)))
    kept = [k for k in range(0, 399, 3) if k not in (30, 150)]
    assert own.count == len(kept)
    Q = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, -2.0]]) / np.sqrt([[2.0], [6.0]])
    C = Q @ NoiseRows.of([t[:3]], [np.full(3, 5.0)]).covariance(0, noise) @ Q.T
    d = np.array([Q @ r[k : k + 3] for k in kept])
    exact = len(kept) * np.linalg.slogdet(C)[1] + np.sum(d @ np.linalg.inv(C) * d)
    total, expected, seen, _ = own.deviance(noise)
    assert total == pytest.approx(exact, rel=1e-9)
    for kind, slope in zip(UNKNOWNS, expected - seen, strict=True):
        ends = (own.deviance(replace(noise, **{kind: getattr(noise, kind) * np.exp(e)}))[0] for e in (-1e-5, 1e-5))
        low, high = ends
        assert slope == pytest.approx((high - low) / 2e-5, rel=1e-5, abs=1e-6)


def test_a_prior_narrows_and_its_absence_is_restricted_likelihood():
    generator = np.random.default_rng(2)
    rows = NoiseRows.of([EVEN[:50]])
    X, r = np.column_stack([np.ones(50), EVEN[:50] / 3600.0]), generator.standard_normal(50)
    noise = Noise(1.1 * np.sqrt(96.0))
    V = 1.21 * np.eye(50) + X @ X.T / 4.0
    exact = np.linalg.slogdet(V)[1] + r @ np.linalg.solve(V, r)
    given = rows.deviance(r, X, np.full(2, 4.0), noise)[0]
    assert given - 2 * np.log(4.0) == pytest.approx(exact, rel=1e-9)
    rss = float(np.linalg.lstsq(X, r, rcond=None)[1][0])
    restricted = 100 * np.log(1.1) + np.linalg.slogdet(X.T @ X / 1.21)[1] + rss / 1.21
    assert rows.deviance(r, X, np.zeros(2), noise)[0] == pytest.approx(restricted, rel=1e-9)


def test_slopes_of_the_likelihood_are_its_differences():
    generator = np.random.default_rng(4)
    rows = NoiseRows.of([EVEN[:60], EVEN[:60], np.sort(generator.uniform(0.0, 3000.0, 50))])
    r, X = generator.standard_normal(170), generator.standard_normal((170, 3))
    noise, prior = Noise(3.0, 0.4, 0.02, 0.3, 0.5, 200.0), (np.full(3, 0.7), np.full(3, 0.3))

    def at(level: str, e: float) -> float:
        moved = replace(noise, **{level: getattr(noise, level) * np.exp(e)})
        return rows.deviance(r, X, prior[0], moved, prior[1])[0]

    _, expected, seen, curvature = rows.deviance(r, X, prior[0], noise, prior[1])
    for level, slope in zip(UNKNOWNS, expected - seen, strict=True):
        assert slope == pytest.approx((at(level, 1e-4) - at(level, -1e-4)) / 2e-4, rel=1e-6, abs=1e-6)

    def dense(one):
        return block_diag(*(rows.covariance(run, one) for run in range(3)))

    P = np.linalg.inv(dense(noise) + X @ np.diag(1 / prior[0]) @ X.T)
    v = P @ (r - X @ prior[1])
    ends = [[dense(replace(noise, **{k: getattr(noise, k) * np.exp(e)})) for e in (1e-4, -1e-4)] for k in UNKNOWNS]
    moved = [(high - low) / 2e-4 @ v for high, low in ends]
    assert curvature == pytest.approx(np.array([[a @ P @ b for b in moved] for a in moved]), rel=1e-6)


@pytest.mark.parametrize("time", [300.0, 600.0])
def test_correlated_noise_is_told_with_its_time_and_healthy_noise_has_none(time):
    """Rows of 96 s, 4 runs: rms and time within three of their sampling errors, √(2τ/T) and as much over again; none in 12 draws of the usual kinds."""
    generator, rows = np.random.default_rng(7), NoiseRows.of([EVEN] * 4)
    error = np.sqrt(2 * time / (4 * EVEN[-1]))
    for _ in range(3):
        found = estimate_noise(rows, draw(rows, Noise(2.0, offset=0.3, markov=1.0, markov_time=time), generator))
        assert abs(np.log(found.markov)) < 3 * error
        assert abs(np.log(found.markov_time / time)) < 6 * error
        assert found.flicker < 0.2
    usual = (Noise(2.0), Noise(2.0, 0.3), Noise(2.0, 0.05, 0.005), Noise(1.0, 0.5))
    assert not any(estimate_noise(rows, draw(rows, own, generator)).markov for own in usual * 3)


def test_the_unit_of_the_signal_does_not_matter():
    generator = np.random.default_rng(8)
    rows = NoiseRows.of([EVEN, GAPPED])
    r = draw(rows, Noise(2.0, 0.1), generator)
    one, other = estimate_noise(rows, r), estimate_noise(rows, 1e-9 * r)
    assert 1e-9 * one.white == pytest.approx(other.white, rel=1e-3)
    assert 1e-9 * one.flicker == pytest.approx(other.flicker, rel=1e-2)
    assert estimate_noise(rows, r, kinds=("white",)).walk == 0.0


def test_rows_that_are_none_are_refused():
    with pytest.raises(CompensationError, match="rows in every run"):
        NoiseRows.of([EVEN, np.array([])])
    with pytest.raises(CompensationError, match="must increase"):
        NoiseRows.of([np.array([0.0, 2.0, 1.0])])
