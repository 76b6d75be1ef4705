"""Campaigns in which one claim of the diagnosis is hard: look-alikes, a library that lacks the cause, a second clock.

That every effect is named, and nothing where nothing is hidden: tests/stranger/test_planted_campaigns.py.
"""

import zlib
from dataclasses import replace

import numpy as np
import pytest

from studies.diagnosis.campaign import load_campaign
from studies.diagnosis.investigate import investigate
from studies.effects import library
from tests.generator.device import build
from tests.studies.diagnosis.naming import check_all, check_first


def seed_of(*words):
    return zlib.crc32(" ".join(words).encode())


def diagnose(design, family, effects=(), alien="", snr=3.0, seed=0, effects_of=None, only=None):
    records, truth = build(design, family, np.random.default_rng(seed), effects, alien, snr)
    campaign = load_campaign(records)
    if only is not None:
        campaign = replace(campaign, responses=tuple(r for r in campaign.responses if r in only))
    return investigate(campaign, score_held_out=False, advise=False, effects=effects_of).verdict, truth


def only_frequency(records):
    return replace(load_campaign(records), responses=("frequency_Hz",))


@pytest.mark.slow
def test_a_static_curve_of_the_bias_is_no_bend_between_temperature_and_frequency():
    """A bias follows the temperature or the frequency: minus ten parts of their difference took what cross-damping does."""
    verdict, truth = diagnose(
        "steps/4", "white", ("cross-damping",), snr=1.0, seed=0, only=("frequency_Hz", "bias_deg_per_h")
    )
    assert [cause.effect for cause in verdict.causes] == ["cross-damping"], (verdict.causes, truth)


@pytest.mark.slow
def test_effect_without_its_file_is_not_explained_by_another():
    name = "electrostatic-softening"
    effects = [e for e in library().values() if e.name != name]
    verdict, _ = diagnose("rich/2", "white", (name,), seed=seed_of("without", name), effects_of=effects, snr=4.0)
    assert verdict.verdict == "unexplained", verdict.causes


@pytest.mark.slow
def test_wandering_noise_is_no_line():
    """A bias that wanders with six knots a run: noise, or unexplained, but no periodic disturbance."""
    for family in ("white", "walk"):
        verdict, _ = diagnose("plain/2", family, alien="drift@bias", seed=seed_of("drift", family))
        assert not [c for c in verdict.causes if c.effect == "periodic" and c.probability > 0.5], verdict.causes


@pytest.mark.slow
def test_two_effects_are_not_named_as_a_wider_one():
    """A bond with its joint imitates both at once, and neither alone comes near it."""
    hidden = ("rate-frequency", "radiation")
    verdict, truth = diagnose("rich/2", "white", hidden, seed=5100, only=("frequency_Hz",))
    assert len(verdict.causes) == 2, (verdict.causes, truth)
    check_all(verdict, hidden)


@pytest.mark.slow
def test_inseparable_pair_is_answered_as_a_set():
    """A drifting clock and an ageing frequency are the same data without a reference clock."""
    verdict, _ = diagnose("plain/2", "white", ("clock-drift",), seed=6000, only=("frequency_Hz",))
    check_first(verdict, "ageing")
    check_first(verdict, "clock-drift")
    assert verdict.verdict == "not-identifiable"


@pytest.mark.slow
@pytest.mark.parametrize("hidden", ["clock-drift", "ageing"])
def test_reference_clock_tells_a_drifting_clock_from_ageing(hidden):
    seed = 7000
    rng = np.random.default_rng(seed)
    records, _ = build("plain", "white", rng, ("clock-drift",), snr=3.0)
    quiet, _ = build("plain", "white", np.random.default_rng(seed), (), snr=0.0)
    with_reference = []
    for record, other in zip(records, quiet, strict=True):
        measured = record.columns["frequency_Hz"]
        # the counters share the gyro's own noise; a clock's drift is in one of them only
        true = other.columns["frequency_Hz"] if hidden == "clock-drift" else measured
        noise = rng.normal(0.0, 1e-3, measured.size)
        with_reference.append(record.with_columns({"reference_frequency_Hz": true + noise}))
    verdict = investigate(only_frequency(with_reference), score_held_out=False, advise=False).verdict
    assert verdict.causes[0].effect == hidden
    assert verdict.causes[0].equivalent == ()
    assert verdict.responses["frequency_Hz"].verdict == "explained"


@pytest.mark.slow
def test_reference_clock_finds_a_drift_that_the_record_hides():
    """A drift of the size of the run-to-run noise: the record alone is adequate, with the reference it is named."""
    rng = np.random.default_rng(9000)
    records, _ = build("three", "walk", rng, (), snr=0.0)
    slope = 0.05 * np.std(records[0].columns["frequency_Hz"][:50]) / 86400.0
    alone, together = [], []
    for record in records:
        time = record.columns["time_s"] + (record.start - records[0].start).total_seconds()
        drifted = record.columns["frequency_Hz"] + slope * time
        true = record.columns["frequency_Hz"] + rng.normal(0.0, 0.02 * slope * time.max(), time.size)
        alone.append(record.with_columns({"frequency_Hz": drifted}))
        together.append(record.with_columns({"frequency_Hz": drifted, "reference_frequency_Hz": true}))
    named = investigate(only_frequency(together), score_held_out=False, advise=False).verdict
    assert "clock-drift" in {cause.effect for cause in named.causes}
    assert not investigate(only_frequency(alone), score_held_out=False, advise=False).verdict.causes


@pytest.mark.slow
def test_damping_that_falls_is_no_leak():
    """A leak only adds gas: 1/Q that falls with time must have another name, or none."""
    records, _ = build("plain/3", "white", np.random.default_rng(9500), ("leak",), snr=1.0)
    falling = [
        r.with_columns({"inverse_q": 2.0 * records[0].columns["inverse_q"].mean() - r.columns["inverse_q"]})
        for r in records
    ]
    verdict = investigate(load_campaign(falling), score_held_out=False, advise=False).verdict
    assert "leak" not in {cause.effect for cause in verdict.causes}
