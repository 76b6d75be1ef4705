"""The designed next run: words that simulate, evidence that dense algebra confirms, a candidate that is the run which it repeats."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from studies.inference.diagnosis import build_problem
from studies.inference.hypothesis import Hypothesis
from studies.inference.linear import Linear
from studies.inference.polynomial_card import polynomial_card
from studies.inference.search import Search
from studies.inference.signatures import Signatures
from studies.instrument.card import load_card
from studies.planning.candidate import Known, simulate_candidates, unabsorbed
from studies.planning.chamber import Chamber
from studies.planning.next_run import between
from studies.planning.plan import simulate_plan, stated_noises
from studies.planning.programme import candidates, words_of
from studies.record import write_record
from thermal.profile import parse_profile

WORDS = "soak 20 10min then ramp 20 40 1.5 then soak 40 50min"


@pytest.mark.parametrize("covered", [(-19.0, 43.0), (-7.3, 11.2), (20.0, 26.0)])
def test_every_profile_is_understood_and_stays_where_the_campaign_was(covered):
    for kind, words in words_of(*covered, 8 * 3600.0).items():
        profile = parse_profile(words)
        assert covered[0] - 0.06 <= profile.value.min() - 273.15, kind
        assert profile.value.max() - 273.15 <= covered[1] + 0.06, kind
        assert profile.end == pytest.approx(8 * 3600.0, rel=0.01), kind


def test_evidence_is_what_a_rival_cannot_take_back():
    """D by its definition and by least squares over the rival's unknowns, their prior as rows more."""
    rng = np.random.default_rng(1)
    J, difference = rng.standard_normal((40, 5)), rng.standard_normal(40)
    dense = difference @ np.linalg.solve(np.eye(40) + J @ J.T, difference)
    rows = np.vstack([J, np.eye(5)])
    left = np.append(difference, np.zeros(5))
    left = left - rows @ np.linalg.lstsq(rows, left, rcond=None)[0]
    assert unabsorbed(difference, J) == pytest.approx(dense) == pytest.approx(left @ left)


@pytest.fixture(scope="module")
def found():
    """What a diagnosis hands on of one monotone run, its values at the card's and its noise as stated."""
    card = load_card("hrg-30mm")
    records = simulate_plan(card, [WORDS])
    problem = build_problem(card, records, housing=False)
    state = problem.evaluate(np.zeros(problem.count))
    linear, noise = Linear(problem, problem.rows, state.residual, state.slope), stated_noises(card, records)
    search = Search(linear, Signatures.at(problem, state.point), noise, bank=[])
    return SimpleNamespace(search=search, final=Hypothesis((), noise, 0.0), numbers=SimpleNamespace(point=state.point))


def test_a_card_made_from_records_simulates_what_could_come_next(found):
    """Without a card the runs go through the polynomial card of the records; how the housing follows its chamber is assumed (600 s)."""
    card = polynomial_card([run.record for run in found.search.linear.problem.runs])
    (record,) = simulate_plan(card, [WORDS])
    rise = np.ptp(record["frequency_Hz"]) / np.ptp(found.search.linear.problem.runs[0].record["frequency_Hz"])
    assert 0.7 < rise < 1.4


def rival(found, name, size):
    effect = next(e for e, r in found.search.signatures.applicable() if e.name == name and r == "frequency_Hz")
    grid = effect.grid(found.search.signatures.span, "frequency_Hz")
    term = found.search.signatures.term(effect, "frequency_Hz", tuple(grid[len(grid) // 2]))
    return replace(found.final, terms=(replace(term, scale=size),))


def test_a_repeat_is_the_recorded_run_once_more(found):
    linear = found.search.linear
    repeat, *_ = simulate_candidates(found, candidates(linear.problem.runs, Chamber())[:1])
    white = np.vstack([linear.rows[n].whiten(linear.slope[n], found.final.noise[n]) for n in linear.responses])
    assert np.allclose(repeat.slopes, white, rtol=1e-9, atol=1e-9 * np.abs(white).max())
    term = rival(found, "second-lag", 0.1).terms[0]
    own = np.vstack([linear.rows[n].whiten(X * term.spread, found.final.noise[n]) for n, X in term.columns.items()])
    count = len(term.members)  # behind these what the recorded run began with, which is not in a further one
    assert np.allclose(repeat.columns(term)[:, :count], own[:, :count], rtol=1e-6, atol=1e-9 * np.abs(own).max())
    assert not repeat.columns(term)[:, count:].any()


def test_rivals_are_separated_by_runs_and_not_from_themselves(found):
    programmes = candidates(found.search.linear.problem.runs, Chamber())
    runs = simulate_candidates(
        found, [programmes[0], *(p for p in programmes if p.kind in ("fast cycles", "quiet"))][:3]
    )
    one, two = rival(found, "second-lag", 0.1), rival(found, "mounting-stress", 0.1)
    assert max(evidence for evidence, _, _ in between(found, [one, one], runs)) < 1e-4  # a difference of thousands
    told = {programme.kind: evidence for evidence, _, programme in between(found, [one, two], runs)}
    assert all(evidence >= 0.0 for evidence in told.values())
    known = Known(found, one)
    for run in runs:  # a further run never leaves less known
        J = run.ahead(known)[1]
        after = np.linalg.inv(np.eye(J.shape[1]) + J.T @ J)
        assert np.linalg.eigvalsh(after).max() <= 1.0 + 1e-9


@pytest.mark.slow
def test_a_diagnosis_with_a_card_proposes_the_next_run(tmp_path, ask):
    card = load_card("hrg-30mm")
    (record,) = simulate_plan(card, [WORDS])
    write_record(record, tmp_path / "run.csv")
    words = ["diagnose", str(tmp_path / "run.csv"), "--card", "hrg-30mm", "--next", "--chamber", "rate 2 range -10 50"]
    answer = ask(words)
    run = answer["next_run"]
    keys = {"profile", "drives", "expected_evidence", "repeat_evidence", "separates", "narrows", "hours"}
    assert set(run) == keys
    profile = parse_profile(run["profile"])
    assert profile.end / 3600.0 == pytest.approx(run["hours"])
    assert -10.0 - 1e-6 <= profile.value.min() - 273.15
    assert profile.value.max() - 273.15 <= 50.0 + 1e-6
    assert np.max(np.abs(np.diff(profile.value)) / np.maximum(np.diff(profile.time), 1e-9)) * 60.0 <= 2.0 + 1e-6
    assert run["profile"] in answer["next_experiment"]
