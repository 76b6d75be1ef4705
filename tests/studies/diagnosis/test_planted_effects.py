"""Every effect of the library, hidden by an independent generator, must be named; nothing where nothing is hidden.

Each effect has its own fixed seed, drawn from its name; the large campaigns are tests/benchmarks/bench_diagnosis.py.
"""

import ast
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from studies.diagnosis.campaign import load_campaign
from studies.diagnosis.investigate import investigate
from studies.effects import library
from tests.generator.device import build
from tests.generator.hidden import EFFECTS
from tests.generator.noises import FAMILIES
from tests.studies.diagnosis.naming import check_all, check_clean, check_first

RUNS = {"axis-rotation": "rich/4", "cross-damping": "rich/4", "loss-peak": "rich/3", "leak": "rich/4"}
"""Effects that two runs of the rich design cannot show, or not tell from others."""


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
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_static_curve_of_the_bias_is_no_bend_between_temperature_and_frequency(seed):
    """A bias follows the temperature or the frequency: minus ten parts of their difference took what cross-damping does."""
    verdict, truth = diagnose(
        "steps/4", "white", ("cross-damping",), snr=1.0, seed=seed, only=("frequency_Hz", "bias_deg_per_h")
    )
    assert [cause.effect for cause in verdict.causes] == ["cross-damping"], (verdict.causes, truth)


@pytest.mark.slow
@pytest.mark.parametrize("key", sorted(EFFECTS))
def test_hidden_effect_is_named(key):
    name, family = key.split("@")[0], FAMILIES[seed_of(key) % len(FAMILIES)]
    design = RUNS.get(key, "rich/2")
    records, truth = build(design, family, np.random.default_rng(seed_of(key)), (key,), "", 4.0)
    campaign = load_campaign(records)
    campaign = replace(campaign, responses=tuple(r for r in campaign.responses if r in ("frequency_Hz", truth.channel)))
    verdict = investigate(campaign, score_held_out=False, advise=False).verdict
    check_first(verdict, name)
    assert verdict.causes[0].response == truth.channel
    result = verdict.responses[truth.channel]
    assert result.verdict in ("explained", "not-identifiable"), (result, truth)


def test_every_effect_of_the_library_is_hidden_here():
    assert {key.split("@")[0] for key in EFFECTS} == set(library())


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_null_campaigns_are_adequate(family):
    verdict, _ = diagnose("rich/2", family, seed=seed_of("null", family))
    check_clean(verdict)


@pytest.mark.slow
@pytest.mark.parametrize("alien", ["rate-square@bias", "volt-temperature", "fringes@bias", "chirp@bias", "volts@loss"])
def test_aliens_are_not_explained(alien):
    """Structure that no file of the library knows must not be called explained."""
    verdict, _ = diagnose("rich/2", "white", alien=alien, seed=seed_of(alien), snr=4.0)
    assert verdict.verdict == "unexplained", verdict.causes


@pytest.mark.slow
@pytest.mark.parametrize("name", ["quadrature-leakage", "periodic", "electrostatic-softening"])
def test_effect_without_its_file_is_not_explained_by_another(name):
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
def test_two_effects_are_both_found():
    verdict, _ = diagnose("rich/2", "white", ("hysteresis", "amplitude-frequency"), seed=5000)
    check_all(verdict, ("hysteresis", "amplitude-frequency"))


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


def test_generator_knows_nothing_of_the_diagnosis():
    for path in (Path(__file__).resolve().parents[2] / "generator").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            modules = (
                [node.module or ""]
                if isinstance(node, ast.ImportFrom)
                else ([alias.name for alias in node.names] if isinstance(node, ast.Import) else [])
            )
            assert not any(module.startswith(("studies.diagnosis", "studies.effects")) for module in modules), path


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
