"""The judge counts as it says: hand-made answers."""

import pytest

from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.verdict import Cause, doubted
from tests.benchmarks.diagnosis.marks import band, calibration_error, compare


def test_the_band_is_wilsons():
    # Wilson's interval at z = 1.645 solves (p − x)² = z² p (1 − p) / n
    low, high = band(9, 12)
    for p in (low, high):
        assert (p - 0.75) ** 2 == pytest.approx(1.645**2 * p * (1 - p) / 12)


def test_a_further_name_has_a_doubt_of_its_own_and_a_value_that_of_the_first():
    """At evidence 100 the share that is stated, its odds times a factor for further names; a power of the evidence less beyond."""
    causes = [Cause(name, "frequency_Hz", 1.0, (), {}, evidence, kind) for name, evidence, kind in (
        ("E", 100.0, "value"), ("jump", 100.0, "physics"), ("leak", 100.0, "physics"), ("ageing", 1e4, "physics"))]  # fmt: skip
    odds = [(1.0 - cause.probability) / cause.probability for cause in doubted(causes)]
    usual = CONSTANTS["doubt"] / (1.0 - CONSTANTS["doubt"])
    further = usual * CONSTANTS["doubt_further"]
    assert odds == pytest.approx([usual, usual, further, further / 100.0 ** CONSTANTS["doubt_falls"]])


def line(key, kind, hidden, verdict, *names):
    causes = [{"effect": name, "probability": 0.9} for name in names]
    truth = {"kind": kind, "hidden": hidden, "effects": "", "snr": 3.0, "verdicts": ["explained"]}
    return {"case": key, "commit": "c", "seconds": 1.0, "MB": 1.0, "card": False, "truth": truth, "verdict": verdict, "causes": causes, "responses": {}}  # fmt: skip


def test_an_engine_that_loses_more_campaigns_than_chance_is_worse():
    """Of eight campaigns the new one loses five and wins none: 1 in 32 by chance. A second, wrong name makes an answer wrong."""
    keys = [f"a:{k}" for k in range(8)]
    old = [line(k, "effect", [["jump"]], "explained", "jump") for k in keys]
    new = [line(k, "effect", [["jump"]], "explained", *(["jump"] if i < 3 else ["jump", "leak"])) for i, k in enumerate(keys)]  # fmt: skip
    rows = {row.split("  ")[1]: row for row in compare(old, new).splitlines() if row.startswith("  one")}
    assert "lost 5 won 0   WORSE" in rows["one effect, SNR ≥ 2: right class"]
    again = compare(old, old)
    assert "WORSE" not in again
    assert "lost 0 won 0" in again


def test_a_probability_of_nine_tenths_that_is_right_nine_times_in_ten_has_no_error():
    assert calibration_error([(0.9, True)] * 9 + [(0.9, False)]) == pytest.approx(0, abs=1e-12)
    assert calibration_error([(0.95, False)] * 4) == pytest.approx(0.95)
