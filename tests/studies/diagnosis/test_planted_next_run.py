"""The designed next run: words that simulate, evidence that dense algebra confirms, answers where no run helps."""

import itertools

import numpy as np
import pytest

from studies.diagnosis.baseline import Term, pose
from studies.diagnosis.campaign import load_campaign
from studies.diagnosis.effects import find_effect
from studies.diagnosis.fit import fit_terms, jacobian_of
from studies.diagnosis.investigate import investigate
from studies.diagnosis.next_run import Member, continued, join, loss, own_count
from studies.diagnosis.programme import candidates, words_of
from studies.diagnosis.states import average
from studies.diagnosis.thermometer import corrected
from studies.record import Record
from tests.generator.designs import up_stairs
from tests.generator.device import add_run, build
from tests.generator.thermal_twin import STEP, follow
from thermal.profile import parse_profile


@pytest.mark.parametrize("covered", [(-19.0, 43.0), (-7.3, 11.2), (20.0, 26.0)])
def test_every_profile_is_understood_and_stays_where_the_campaign_was(covered):
    for kind, words in words_of(*covered, 8 * 3600.0).items():
        profile = parse_profile(words)
        assert covered[0] - 0.06 <= profile.value.min() - 273.15, kind
        assert profile.value.max() - 273.15 <= covered[1] + 0.06, kind
        assert profile.end == pytest.approx(8 * 3600.0, rel=0.01), kind


def plan_of_one(chamber):
    return {"chambers": [chamber], "volts": None, "drives": None, "angles": None, "gaps": [0.0]}


def rivals_of(seed, effect, others):
    """Fit the named rivals to one monotone run with an effect."""
    records, _ = build(plan_of_one(up_stairs()), "walk", np.random.default_rng(seed), (effect,), "", 3.0)
    campaign = load_campaign(records)
    problem = corrected(fit_terms(pose(campaign, "frequency_Hz"), ())).problem
    return campaign, [fit_terms(problem, [Term(find_effect(name), shape, 1)]) for name, shape in others]


def test_expected_evidence_is_that_of_dense_least_squares():
    """D by whitened projections equals the generalised least squares with the covariance written out."""
    seed = int(np.random.SeedSequence().entropy % 2**31)
    print("seed", seed)
    campaign, (one, two) = rivals_of(seed, "second-lag", [("second-lag", (9000.0,)), ("mounting-stress", (5000.0,))])
    members = [Member("a", one, None, one), Member("b", two, None, one)]
    programme = next(p for p in candidates(campaign) if p.kind == "two rates")
    ahead = [member.follow(programme.states) for member in members]
    mean = [(member.recorded[0], part[0]) for member, part in zip(members, ahead, strict=True)]
    columns = members[1].joined(ahead[1][1])
    found = loss(mean[0], mean[1], columns)

    share, variance = one.linear.share, one.linear.variance
    times = [run.time for run in campaign.runs] + [average(programme.states.time, campaign.group)]
    blocks = []
    for time, present in zip(times, [*one.problem.present, np.ones(times[-1].size, bool)], strict=True):
        t = time[present] - time[present][0]
        blocks.append(np.eye(t.size) + share * (np.minimum.outer(t, t) / (8 * 3600.0) + 0.5))
    blocks.insert(1, np.eye(1))  # the row of the delay's prior
    covariance = np.zeros((sum(len(b) for b in blocks),) * 2)
    ends = np.cumsum([0, *map(len, blocks)])
    for (begin, end), block in zip(itertools.pairwise(ends), blocks, strict=True):
        covariance[begin:end, begin:end] = variance * block
    values = [m.fit.columns() @ m.fit.linear.coefficients for m in members]
    later = [continued(m.fit, programme.states, None) for m in members]
    rows = times[-1].size
    difference = np.concatenate(
        [
            values[0] - values[1],
            (later[0].columns() @ later[0].linear.coefficients)[:rows]
            - (later[1].columns() @ later[1].linear.coefficients)[:rows],
        ]
    )
    tangent = join(
        np.concatenate([two.columns(), jacobian_of(two)], axis=1),
        np.concatenate([later[1].columns(), jacobian_of(later[1])], axis=1)[:rows],
        own_count(two.problem),
        len(two.problem.states),
    )
    scale = np.linalg.norm(tangent, axis=0)
    white = np.linalg.solve(np.linalg.cholesky(covariance), np.column_stack([tangent / scale, difference]))
    solution = np.linalg.lstsq(white[:, :-1], white[:, -1], rcond=1e-12)[0]
    left = white[:, -1] - white[:, :-1] @ solution
    assert found == pytest.approx(left @ left, rel=1e-3, abs=1e-3)


def test_nothing_separates_an_explanation_from_itself():
    campaign, (one,) = rivals_of(5, "second-lag", [("second-lag", (9000.0,))])
    member, twin = Member("a", one, None, one), Member("b", one, None, one)
    for programme in candidates(campaign)[:3]:
        ahead, same = member.follow(programme.states), twin.follow(programme.states)
        assert loss((member.recorded[0], ahead[0]), (twin.recorded[0], same[0]), twin.joined(same[1])) < 1e-9


def test_inseparable_pair_gets_a_measurement_and_no_run():
    rng = np.random.default_rng(11)
    records = []
    for k in range(2):
        time = np.arange(0.0, 6 * 3600.0, STEP)
        housing = follow(20.0 + 25.0 * np.sign(np.sin(2 * np.pi * time / 9000.0 + k)), 600.0)
        x = follow(housing, 2000.0) - 20.0
        drift = 0.05 * (time + 6 * 3600.0 * k) / 3600.0
        frequency = 5000.0 + 0.4 * x - 4e-4 * x**2 + drift + 0.01 * rng.standard_normal(time.size)
        columns = {"time_s": time, "housing_temperature_degC": housing, "frequency_Hz": frequency}
        records.append(Record({name: values[::4] for name, values in columns.items()}))
    verdict = investigate(load_campaign(records), held_out=False).verdict
    assert {verdict.causes[0].effect, *verdict.causes[0].equivalent} >= {"ageing", "clock-drift"}
    assert verdict.as_dict()["next_run"] is None
    assert "reference clock" in verdict.next_experiment


def test_suggested_run_is_part_of_the_answer():
    records, _ = build(plan_of_one(up_stairs()), "white", np.random.default_rng(2))
    verdict = investigate(load_campaign(records), held_out=False).verdict
    run = verdict.as_dict()["next_run"]
    assert set(run) == {"profile", "drives", "expected_evidence", "repeat_evidence", "separates"}
    assert run["expected_evidence"] >= run["repeat_evidence"] > 10.0
    assert run["profile"].startswith("repeat") or parse_profile(run["profile"]).end > 7 * 3600.0
    assert run["profile"] in verdict.next_experiment


def test_generator_goes_on_with_the_same_gyro():
    """A further run shows the frequency law and the hidden effect of the first."""
    records, truth = build(plan_of_one(up_stairs()), "white", np.random.default_rng(3), ("loss-peak",), "", 5.0)
    again = add_run(truth.twin, up_stairs(), np.random.default_rng(4))
    late = [np.interp(np.arange(2e4, 2.7e4, 100.0), r["time_s"], r["inverse_q"]) for r in (records[0], again)]
    noise = truth.noise["inverse_q"]
    assert np.abs(late[0] - late[1]).mean() < 2.0 * noise
    assert abs(again["frequency_Hz"].mean() - records[0]["frequency_Hz"].mean()) < 0.2
