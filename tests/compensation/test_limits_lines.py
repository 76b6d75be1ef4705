"""Lines: none in noise of any colour, in rounded slopes, at bends and hops; a planted one at its period and with its size."""

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d

from compensation.lines import find_line

ROWS, SAMPLING, SLOWEST = 6000, 5.0, 200.0
TIME = SAMPLING * np.arange(ROWS)


def coloured(kind, seed):
    rng = np.random.default_rng(seed)
    white = rng.standard_normal(ROWS)
    return {
        "white": white,
        "heavy tails": rng.standard_t(3.0, ROWS),
        "a filter's": uniform_filter1d(white, 5),
        "random walk": np.cumsum(white),
        "rounded": np.round(white),
    }[kind]


@pytest.mark.parametrize("kind", ["white", "heavy tails", "a filter's", "random walk", "rounded"])
def test_noise_has_no_line(kind):
    """At e⁻¹² one such series in 160 000 has one: forty have none, nor have they in pairs."""
    series = [(TIME, coloured(kind, seed)) for seed in range(40)]
    assert all(find_line([own], SAMPLING, SLOWEST) is None for own in series)
    assert all(find_line(pair, SAMPLING, SLOWEST) is None for pair in zip(series[::2], series[1::2], strict=True))


@pytest.mark.slow
def test_its_probability_is_that_of_noise():
    """Of 800 series of white noise as many exceed an evidence of 1, 2 and 4 as it says, e⁻¹, e⁻² and e⁻⁴ of frequencies that are
    independent; a window joins some, so that there are fewer, not more, and far out too: the level is one of noise itself."""
    found = [find_line([(TIME, coloured("white", seed))], SAMPLING, SLOWEST, -50.0).evidence for seed in range(800)]
    for evidence in (1.0, 2.0, 4.0):
        part = np.mean(np.array(found) > evidence)
        assert 0.2 * np.exp(-evidence) < part < 1.2 * np.exp(-evidence)


@pytest.mark.parametrize("slope", [0.013, 0.04, 0.09])
def test_a_rounded_slope_has_no_line(slope):
    assert find_line([(TIME, np.round(slope * np.arange(ROWS)))], SAMPLING, SLOWEST) is None


def test_bends_and_hops_are_no_line():
    noise = coloured("white", 3)
    bends = np.interp(
        TIME, [0.0, 3100.0, 9200.0, 11000.0, 19700.0, 24300.0, 30000.0], [0.0, 0.0, 30.0, 30.0, -10.0, 5.0, 5.0]
    )
    assert find_line([(TIME, 1e-2 * noise + bends)], SAMPLING, SLOWEST) is None
    assert find_line([(TIME, noise + 20.0 * (TIME > 7000.0) - 15.0 * (TIME > 21000.0))], SAMPLING, SLOWEST) is None


@pytest.mark.parametrize("period", [12.6, 61.0, 187.0])
def test_a_planted_line_is_found(period):
    """With another phase in each series, rows missing, an uneven clock and a walk beside it."""
    rng = np.random.default_rng(5)
    series = []
    for phase in (0.3, 2.0, 4.4):
        time = TIME + rng.uniform(-0.2, 0.2, ROWS)
        values = 0.3 * np.sin(2.0 * np.pi * time / period + phase) + rng.standard_normal(ROWS)
        values += 0.05 * np.cumsum(rng.standard_normal(ROWS))
        values[rng.random(ROWS) < 0.03] = np.nan
        series.append((time, values))
    line = find_line(series, SAMPLING, SLOWEST)
    assert line.period == pytest.approx(period, abs=period**2 / TIME[-1])
    assert line.rms == pytest.approx(0.3 / np.sqrt(2.0), rel=0.2)


def test_a_line_far_above_noise_has_a_finite_evidence():
    line = find_line([(TIME, np.sin(2.0 * np.pi * TIME / 61.0) + 1e-4 * coloured("white", 1))], SAMPLING, SLOWEST)
    assert 200.0 < line.evidence < np.inf


def test_too_few_readings_have_no_line():
    assert find_line([(TIME[:90], np.sin(TIME[:90]))], SAMPLING, SLOWEST) is None
    assert find_line([], SAMPLING, SLOWEST) is None
    assert find_line([(TIME, np.full(ROWS, np.nan))], SAMPLING, SLOWEST) is None
    assert find_line([(TIME, np.zeros(ROWS))], SAMPLING, SLOWEST) is None
