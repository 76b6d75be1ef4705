"""The designed next run: words that simulate, evidence that dense algebra confirms, answers where no run helps."""

import numpy as np
import pytest

from studies.diagnosis.campaign import load_campaign
from studies.diagnosis.inquiry import begin
from studies.diagnosis.investigate import investigate
from studies.diagnosis.model import fit
from studies.diagnosis.planning.next_run import against, covariance_of_noise
from studies.diagnosis.planning.next_run import follow as continue_model
from studies.diagnosis.planning.programme import candidates
from studies.diagnosis.terms import Term
from studies.effects import find_effect
from studies.record import Record
from tests.studies.diagnosis.bench import LAG, STAIRS, Bench
from thermal.lag import lag
from thermal.profile import parse_profile


def one_run(seed, share=0.0):
    """One monotone run; a share of the heat takes nine times the time."""
    bench = Bench(STAIRS, sampling=20.0, seed=seed)
    slow = share * (bench.behind(9.0 * LAG) - bench.gyro())
    walk = 1e-3 * np.cumsum(bench.rng.standard_normal(bench.time.size)) if share else 0.0
    return load_campaign([bench.record(frequency_Hz=bench.frequency(0.01) + 0.4 * slow + walk)])


def rivals_of(seed, others):
    """Fit the named rivals to one monotone run with a second lag."""
    campaign = one_run(seed, 0.05)
    plain = begin(campaign, "frequency_Hz", None)
    return campaign, [fit(plain.problem, plain.baseline, [Term(find_effect(name), shape)], 4) for name, shape in others]


def test_expected_evidence_is_what_the_rival_loses():
    """D against twice the log-likelihood ratio that the rival would lose on the run, its values refitted within their posterior."""
    campaign, (one, two) = rivals_of(3, [("second-lag", (9000.0,)), ("mounting-stress", (5000.0,))])
    programme = next(p for p in candidates(campaign) if p.kind == "two rates")
    a, b = (continue_model(model, programme.states, None) for model in (one, two))
    noise = covariance_of_noise(one, a.mean.size, campaign.step)
    found = against(a, b, noise)
    # the same by least squares over the rival's values, their posterior as rows of data more
    factor = np.linalg.cholesky(noise)
    root = np.linalg.cholesky(b.covariance + 1e-12 * np.diag(np.diag(b.covariance)))
    rows = np.concatenate([np.linalg.solve(factor, b.columns @ root), np.eye(root.shape[1])])
    target = np.concatenate([np.linalg.solve(factor, a.mean - b.mean), np.zeros(root.shape[1])])
    left = target - rows @ np.linalg.lstsq(rows, target, rcond=None)[0]
    assert found == pytest.approx(left @ left, rel=1e-3)
    assert found > 0


def test_nothing_separates_an_explanation_from_itself():
    campaign, (one,) = rivals_of(5, [("second-lag", (9000.0,))])
    for programme in candidates(campaign)[:3]:
        ahead = continue_model(one, programme.states, None)
        assert against(ahead, ahead, covariance_of_noise(one, ahead.mean.size, campaign.step)) < 1e-9


def test_a_model_goes_on_where_it_was():
    """The mean of a repeated run is the fitted model of the recorded one, its initial state and noise aside."""
    campaign, (one,) = rivals_of(7, [("second-lag", (9000.0,))])
    ahead = continue_model(one, candidates(campaign)[0].states, None)
    fitted = np.full(one.problem.present[0].size, np.nan)
    fitted[one.problem.present[0]] = one.linear.columns @ one.solved.coefficients - one.problem.stack(one.tangent.shift)
    late = slice(ahead.mean.size // 2, ahead.mean.size)
    away = (ahead.mean - fitted)[late]
    assert np.isfinite(away).mean() > 0.99
    assert np.nanmax(np.abs(away)) < 0.02 * np.nanmax(fitted) - 0.02 * np.nanmin(fitted)


@pytest.mark.slow
def test_inseparable_pair_gets_a_measurement_and_no_run():
    rng = np.random.default_rng(11)
    records = []
    for k in range(2):
        time = np.arange(0.0, 6 * 3600.0, 5.0)
        housing = lag(time, 20.0 + 25.0 * np.sign(np.sin(2 * np.pi * time / 9000.0 + k)), 600.0)
        x = lag(time, housing, 2000.0) - 20.0
        drift = 0.05 * (time + 6 * 3600.0 * k) / 3600.0
        frequency = 5000.0 + 0.4 * x - 4e-4 * x**2 + drift + 0.01 * rng.standard_normal(time.size)
        columns = {"time_s": time, "housing_temperature_degC": housing, "frequency_Hz": frequency}
        records.append(Record({name: values[::4] for name, values in columns.items()}))
    verdict = investigate(load_campaign(records), score_held_out=False).verdict
    assert {verdict.causes[0].effect, *verdict.causes[0].equivalent} >= {"ageing", "clock-drift"}
    assert verdict.verdict == "not-identifiable"
    assert verdict.as_dict()["next_run"] is None
    assert "reference clock" in verdict.next_experiment


@pytest.mark.slow
def test_suggested_run_is_part_of_the_answer():
    verdict = investigate(one_run(2), score_held_out=False).verdict
    run = verdict.as_dict()["next_run"]
    assert set(run) == {"profile", "drives", "expected_evidence", "repeat_evidence", "separates", "narrows", "hours"}
    assert run["expected_evidence"] > 10.0
    assert run["profile"].startswith("repeat") or parse_profile(run["profile"]).end > 3 * 3600.0
    assert run["profile"] in verdict.next_experiment
