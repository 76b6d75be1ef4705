"""The one noise: its draws, covariance, Allan variance and spectrum say the same, each found in a way of its own."""

import allantools
import numpy as np
import pytest
from scipy.linalg import block_diag

from compensation.noise import FLAT, FLICKER_TIMES, Noise, flicker, gauss_markov, random_walk, white_rms
from compensation.noise_rows import NoiseRows

KINDS = {
    "white": Noise(white=2.0),
    "flicker": Noise(flicker=0.5),
    "walk": Noise(walk=0.1),
    "markov": Noise(markov=0.5, markov_time=3.0),
    "all": Noise(2.0, 0.5, 0.02, 0.0, 1.0, 20.0),
}


@pytest.mark.parametrize("rate", [0.25, 8.0])
@pytest.mark.parametrize("kind", KINDS)
def test_the_allan_variance_of_draws_is_that_of_the_levels(kind, rate):
    """Measured by an established implementation, over 40 realisations; six standard errors of them."""
    noise, generator = KINDS[kind], np.random.default_rng(3)
    taus = np.array([1.0, 4.0, 16.0, 64.0, 256.0]) / rate
    found = np.array(
        [
            allantools.oadev(noise.draw(4096, rate, generator), rate=rate, data_type="freq", taus=taus)[1] ** 2
            for _ in range(40)
        ]
    )
    error = found.std(axis=0, ddof=1) / np.sqrt(len(found))
    assert np.all(np.abs(found.mean(axis=0) - noise.allan_variance(taus)) < 5 * error)
    assert np.all(error / found.mean(axis=0) < 0.1)


@pytest.mark.slow
def test_draws_have_the_covariance_of_the_levels():
    """Whitened by it, 8000 runs of 30 rows have the unit matrix: eigenvalues of a sample's are within (1 ± √(30/8000))²."""
    noise, times = Noise(2.0, 0.5, 0.05, 0.7, 0.4, 90.0), 20.0 * np.arange(30)
    generator = np.random.default_rng(5)
    drawn = np.array([noise.draw(30, 0.05, generator) for _ in range(8000)])
    L = np.linalg.cholesky(noise.covariance(times, 20.0))
    white = np.linalg.solve(L, drawn.T)
    ends = np.linalg.eigvalsh(white @ white.T / 8000)[[0, -1]]
    edge = np.sqrt(30 / 8000)
    assert ends[0] > (1 - edge) ** 2 - 0.01
    assert ends[1] < (1 + edge) ** 2 + 0.01


@pytest.mark.parametrize(
    "covariance", [flicker, random_walk, lambda t, s: gauss_markov(t, s, 600.0), lambda t, s: np.diag(1.0 / np.broadcast_to(s, t.shape))]
)  # fmt: skip
def test_means_have_the_mean_of_the_covariance_of_what_they_are_means_of(covariance):
    """48 rows of 3 s side by side are 4 rows of 36 s; also with spans that differ."""
    fine = 3.0 * np.arange(48) + 1.5
    groups = np.split(np.arange(48), [12, 16, 30])
    mean = np.array([np.isin(np.arange(48), g) / len(g) for g in groups])
    spans = np.array([3.0 * len(g) for g in groups])
    exact = mean @ covariance(fine, 3.0) @ mean.T
    assert covariance(mean @ fine, spans) == pytest.approx(exact, rel=1e-9)


def test_the_allan_variance_follows_from_the_covariance_of_two_neighbours():
    """σ²(τ) = ½ var(y₂ − y₁) of two means over τ side by side."""
    noise = Noise(2.0, 0.5, 0.03, 1.0, 0.7, 20.0)
    for tau in (1e-4, 0.1, 10.0, 1e3, 1e5):
        C = noise.covariance(np.array([0.5, 1.5]) * tau, tau)
        assert noise.allan_variance(tau) == pytest.approx((C[0, 0] + C[1, 1] - 2 * C[0, 1]) / 2, rel=1e-7)


def test_flicker_is_flat_and_has_a_spectrum_of_one_over_f():
    """B = 1: Allan deviation √(2 ln 2/π) = 0.664, two-sided S(ω) = B²/ω, IEEE Std 952; the ladder's Lorentzians add up to it."""
    assert pytest.approx(0.66428, abs=1e-5) == FLAT
    deviation = np.sqrt(Noise(flicker=FLAT).allan_variance(np.geomspace(0.01, 3600.0, 30)))
    assert deviation == pytest.approx(np.full(30, 0.66428), rel=0.004)
    f = np.geomspace(1e-3, 300.0, 200)
    spectrum = FLAT**2 * np.sum(2.0 * FLICKER_TIMES / (1.0 + np.outer(2 * np.pi * f, FLICKER_TIMES) ** 2), axis=1)
    assert spectrum * 2 * np.pi * f == pytest.approx(np.ones(200), rel=0.012)


def test_whitened_rows_have_the_identity_as_covariance_where_rows_are_uneven():
    gapped = np.cumsum(np.concatenate([np.full(60, 80.0), [4000.0], np.full(50, 130.0)]))
    spans = np.concatenate([np.full(60, 80.0), [130.0], np.full(50, 120.0)])
    rows = NoiseRows.of([gapped, gapped[:60]], [spans, spans[:60]])
    noise = Noise(0.2, 0.3, 0.01, 0.5)
    covariance = block_diag(*[noise.covariance(t, s) for t, s in zip(rows.times, rows.spans, strict=True)])
    W = rows.whiten(np.eye(rows.count), noise)
    assert W @ covariance @ W.T == pytest.approx(np.eye(rows.count), abs=1e-9)


def test_rows_that_are_kept_have_the_covariance_of_rows_at_their_times():
    """Rows apart: of neighbours, what they share of brief noise goes with the rows between them."""
    times, kept, noise = 90.0 * np.arange(80.0), np.arange(80) % 2 == 1, Noise(0.2, 0.3, 0.01, 0.5)
    rows = NoiseRows.of([times, times], [np.full(80, 30.0)] * 2)
    few = rows.kept([kept, np.zeros(80, dtype=bool)])
    assert [len(t) for t in few.times] == [40]
    assert few.covariance(0, noise) == pytest.approx(noise.covariance(times[kept], 30.0), rel=1e-9)


@pytest.mark.slow
def test_coarse_rows_are_means_of_neighbours_and_have_their_covariance():
    """400 rows of a run are 134 of three and a rest of one; rows without gaps: the walk and the white noise of means are exact."""
    rows, noise = NoiseRows.of([30.0 * np.arange(400.0), 20.0 * np.arange(90.0)]), Noise(2.0, 0.0, 0.05, 0.7)
    A = block_diag(np.kron(np.eye(134), np.ones(3) / 3)[:, :400], np.eye(90))
    A[133] /= A[133].sum()
    coarse = rows.coarse
    assert [len(t) for t in coarse.times] == [134, 90]
    assert rows.means(np.eye(490)) == pytest.approx(A, abs=1e-12)
    assert np.concatenate(coarse.times) == pytest.approx(A @ np.concatenate(rows.times))
    own, there = (block_diag(*[r.covariance(k, noise) for k in (0, 1)]) for r in (coarse, rows))
    assert own == pytest.approx(A @ there @ A.T, rel=1e-9)


def test_levels_of_zero_are_silent_and_short_runs_are_drawn():
    assert not Noise().draw(100, 1.0, np.random.default_rng(0)).any()
    assert [len(Noise(1.0, 1.0, 1.0, 1.0).draw(n, 1.0, np.random.default_rng(0))) for n in range(4)] == [0, 1, 2, 3]


def test_white_noise_is_found_beside_a_slow_change():
    noise = 0.3 * np.random.default_rng(1).standard_normal(20_000) + np.sin(np.arange(20_000) / 300.0)
    assert white_rms(noise) == pytest.approx(0.3, rel=0.03)
