"""The benchmark counts as it says: hand-made cases."""

import numpy as np
import pytest

from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.verdict import Cause, doubted
from tests.benchmarks.diagnosis.calibrate import doubts
from tests.benchmarks.diagnosis.marks import calibration_error
from tests.benchmarks.diagnosis.marks import compare as compare_engines
from tests.benchmarks.diagnosis.plan_check import agreement, compare, simulated_shares
from tests.benchmarks.diagnosis.scoring import band, confusion, exact_set, first_right, reliability, said

NAMES = ("jump", "ageing", "leak", "radiation", "periodic", "hysteresis", "curvature", "rate-bias")


def case(truth, *causes, verdict="explained", **more):
    listed = [[name, list(others), "frequency_Hz", 0.9, 50.0] for name, *others in causes]
    own = {"kind": "effect", "count": 1, "seed": 2, "design": "rich", "snr": 1.0, "channel": "frequency_Hz"}
    own["family"] = "white"
    return {**own, "truth": truth, "raw": truth, "alien": "", "causes": listed, "verdict": verdict, **more}


def plan(**white):
    return {"cases": 1e6, "by_noise": {"white": white, "slow": {}}}


def test_the_truth_in_the_strongest_set_is_right():
    assert first_right(case(["ageing"], ("clock-drift", "ageing")))
    assert not first_right(case(["ageing"], ("jump",), ("ageing",)))
    assert not first_right(case(["ageing"]))


def test_exact_needs_every_effect_once_and_nothing_else():
    assert exact_set(case(["jump", "ageing"], ("clock-drift", "ageing"), ("jump",)))
    assert not exact_set(case(["jump", "ageing"], ("jump",)))
    assert not exact_set(case(["jump", "ageing"], ("jump",), ("ageing",), ("periodic",)))


def test_a_confusion_counts_sets_as_the_truth_and_keeps_silence_apart():
    cases = [
        case(["ageing"], ("clock-drift", "ageing")),
        case(["ageing"], ("jump",)),
        case(["ageing"], verdict="adequate"),
        case(["ageing"], verdict="unexplained"),
    ]
    assert [said(c) for c in cases] == ["ageing", "jump", "nothing", "unexplained"]
    assert confusion(cases)["ageing"] == {"ageing": 1, "jump": 1, "nothing": 1, "unexplained": 1}


def test_the_band_is_wilsons():
    # Wilson's interval at z = 1.645 solves (p − x)² = z² p (1 − p) / n
    low, high = band(9, 12)
    for p in (low, high):
        assert (p - 0.75) ** 2 == pytest.approx(1.645**2 * p * (1 - p) / 12)


def test_reliability_of_claims_that_are_right_as_often_as_they_say():
    rows, error = reliability([(0.7, k < 7) for k in range(10)])
    assert rows == [(0.6, 0.8, pytest.approx(0.7), 7, 10)]
    assert error == pytest.approx(0.0)


def test_predicted_and_measured_confusion_are_pooled_over_the_same_cases():
    plans = {
        "rich 1": plan(jump={"jump": 1.0}),
        "plain 1": plan(jump={"jump": 0.5, "nothing": 0.5}),
    }
    cases = [case(["jump"], ("jump",)) for _ in range(10)]
    cases += [case(["jump"], ("jump",) if k < 2 else ("ageing",), design="plain") for k in range(10)]
    entries = {(e.pool, e.said): (e.predicted, e.measured, e.cases) for e in compare(cases, plans)}
    assert entries["jump", "jump"] == (pytest.approx(0.75), pytest.approx(0.6), 20)
    assert entries["jump", "nothing"] == (pytest.approx(0.25), 0, 20)
    assert entries["jump", "ageing"] == (0, pytest.approx(0.4), 20)
    assert agreement(compare(cases, plans))["near"] == 0
    outcomes = {e.said: e.measured for e in compare(cases, plans, outcomes=True)}
    assert outcomes == pytest.approx({"named": 0.6, "nothing": 0.0, "unexplained": 0.0, "wrong": 0.4})


def test_an_effect_that_the_plan_calls_invisible_is_predicted_as_nothing():
    entry = compare([case(["self-heating"])], {"rich 1": plan()})[0]
    assert (entry.pool, entry.said, entry.predicted) == ("self-heating", "nothing", 1.0)


def test_the_band_of_a_pool_is_that_of_its_unequal_coins():
    # 30 cases at 0.9 and 10 at 0.2 with exact predictions: the count is a sum of two binomials
    p = np.repeat([0.9, 0.2], [30, 10])
    shares = simulated_shares(p, np.full(40, 1e9), np.arange(40), np.random.default_rng(1))
    assert shares.mean() == pytest.approx(29 / 40, abs=0.01)
    assert shares.std() == pytest.approx(np.sqrt(30 * 0.09 + 10 * 0.16) / 40, rel=0.06)


def test_right_predictions_leave_no_error_beyond_chance_and_wrong_ones_do():
    rng = np.random.default_rng(2)
    plans = {"rich 1": plan(**{name: {name: 0.6, "nothing": 0.4} for name in NAMES})}
    cases = [case([name], *[(name,)] * int(rng.random() < 0.6)) for name in NAMES for _ in range(60)]
    found = agreement(compare(cases, plans))
    assert found["rms"] < 0.04
    assert found["beyond"] <= 0.3 * found["entries"]
    shifted = {"rich 1": plan(**{name: {name: 0.9, "nothing": 0.1} for name in NAMES})}
    assert agreement(compare(cases, shifted))["rms"] == pytest.approx(0.3, abs=0.05)


def test_doubts_are_counted_by_rank():
    """Ten first names, one wrong; four further ones, one wrong. The one alien stands for a ninth of the ten cases that hide
    something: one in ten of all. An effect that was taken out of the library counts nowhere."""

    def answer(kind, truth, *names):
        return {"kind": kind, "truth": truth, "causes": [[name, [], "frequency_Hz", 0.99, 50.0] for name in names]}

    cases = [answer("effect", ["jump"], "jump") for _ in range(5)] + [answer("effect", ["jump"], "ageing")]
    cases += [answer("pair", ["jump", "leak"], "jump", "leak") for _ in range(3)]
    cases += [
        answer("effect", ["jump"], "jump", "leak"),
        answer("alien", [], "jump"),
        answer("without", ["jump"], "leak"),
    ]
    found = doubts(cases)
    alien = 10 / 9
    assert found == {"doubt": pytest.approx((1.5 + alien) / (11 + alien)), "doubt_further": pytest.approx(1.5 / 5)}


def test_a_further_name_has_a_doubt_of_its_own_and_a_value_that_of_the_first():
    causes = [Cause(name, "frequency_Hz", 1.0, (), {}, 10.0, kind) for name, kind in (("E", "value"), ("jump", "physics"), ("leak", "physics"))]  # fmt: skip
    left = [1.0 - cause.probability for cause in doubted(causes)]
    assert left == pytest.approx([CONSTANTS[name] for name in ("doubt", "doubt", "doubt_further")])


def line(key, kind, hidden, verdict, *names):
    causes = [{"effect": name, "probability": 0.9} for name in names]
    truth = {"kind": kind, "hidden": hidden, "effects": "", "snr": 3.0, "verdicts": ["explained"]}
    return {"case": key, "commit": "c", "seconds": 1.0, "MB": 1.0, "card": False, "truth": truth, "verdict": verdict, "causes": causes, "responses": {}}  # fmt: skip


def test_an_engine_that_loses_more_campaigns_than_chance_is_worse():
    """Of eight campaigns the new one loses five and wins none: 1 in 32 by chance. A second, wrong name makes an answer wrong."""
    keys = [f"a:{k}" for k in range(8)]
    old = [line(k, "effect", [["jump"]], "explained", "jump") for k in keys]
    new = [line(k, "effect", [["jump"]], "explained", *(["jump"] if i < 3 else ["jump", "leak"])) for i, k in enumerate(keys)]  # fmt: skip
    rows = {row.split("  ")[1]: row for row in compare_engines(old, new).splitlines() if row.startswith("  one")}
    assert "lost 5 won 0   WORSE" in rows["one effect, SNR ≥ 2: right class"]
    again = compare_engines(old, old)
    assert "WORSE" not in again
    assert "lost 0 won 0" in again


def test_a_probability_of_nine_tenths_that_is_right_nine_times_in_ten_has_no_error():
    assert calibration_error([(0.9, True)] * 9 + [(0.9, False)]) == pytest.approx(0, abs=1e-12)
    assert calibration_error([(0.95, False)] * 4) == pytest.approx(0.95)
