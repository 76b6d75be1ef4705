"""Split consistency: one coefficient everywhere passes, a coefficient that differs between two parts is told."""

import numpy as np
import pytest

from studies.diagnosis.baseline import Term, pose
from studies.diagnosis.campaign import load_campaign
from studies.diagnosis.consistency import consistency
from studies.diagnosis.effects import find_effect
from studies.diagnosis.fit import fit_terms
from studies.diagnosis.thermometer import read_thermometer
from studies.record import Record
from tests.generator.thermal_twin import STEP, follow


def campaign_with(factor, rng):
    """Two cycled runs with a bias that follows the rate, times `factor(run, x, rate, time)`."""
    records = []
    for run in range(2):
        time = np.arange(0.0, 8 * 3600.0, STEP)
        chamber = 20.0 + 25.0 * np.interp(time % 9000.0, [0, 2250, 6750, 9000], [0, 1, -1, 0])
        housing = follow(chamber, 600.0)
        x = follow(housing, 2000.0) - 20.0
        rate = np.gradient(x, STEP)
        bias = 0.1 * x + 250.0 * rate * factor(run, x, rate, time) + 0.1 * rng.standard_normal(time.size)
        frequency = 5000.0 + 0.4 * x - 4e-4 * x**2 + 0.005 * rng.standard_normal(time.size)
        records.append(
            Record(
                {
                    "time_s": time[::4],
                    "housing_temperature_degC": housing[::4],
                    "frequency_Hz": frequency[::4],
                    "bias_deg_per_h": bias[::4] + run,
                }
            )
        )
    return load_campaign(records)


def agreement_of(factor, rng):
    campaign = campaign_with(factor, rng)
    thermometer = read_thermometer(campaign, fit_terms(pose(campaign, "frequency_Hz"), ()))
    problem = pose(campaign, "bias_deg_per_h", thermometer.change, thermometer.states)
    return consistency(fit_terms(problem, [Term(find_effect("rate-bias"), (), 1)]), 0)


PARTS = {
    "run and run": lambda run, x, rate, time: 1.0 + 0.6 * run,
    "hot and cold": lambda run, x, rate, time: 1.0 + 0.6 * (x > 0),
    "early and late": lambda run, x, rate, time: 1.0 + 0.6 * (time > 4 * 3600.0),
}


@pytest.mark.parametrize("split", PARTS)
def test_a_coefficient_that_differs_is_told(split):
    agreement = agreement_of(PARTS[split], np.random.default_rng(1))
    assert agreement.p < 1e-6
    assert agreement.split == split


def test_p_of_one_coefficient_is_uniform():
    """Twelve honest records: the mean of uncorrected p is 1/2 within four standard deviations, and none is tiny."""
    seed = int(np.random.SeedSequence().entropy % 2**31)
    print("seed", seed)
    rng = np.random.default_rng(seed)
    found = [agreement_of(lambda run, x, rate, time: 1.0, rng) for _ in range(12)]
    each = np.array([p for agreement in found for p in agreement.by_split.values()])
    assert each.size >= 36
    assert abs(each.mean() - 0.5) < 4.0 * np.sqrt(1.0 / 12.0 / 12.0)
    assert min(agreement.p for agreement in found) > 1e-5
