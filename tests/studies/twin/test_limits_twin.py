"""The C twin against the simulation that it stands for: shipped cards, every effect, drives, noise, sanitizers."""

import subprocess
from dataclasses import astuple
from pathlib import Path

import numpy as np
import pytest

from compensation.noise import Noise
from studies.cli import main
from studies.effects import library
from studies.instrument.card import load_card, save_card
from studies.record import read_record
from studies.simulation.chamber import load_drive
from studies.twin.plan import plan_twin
from studies.twin.source import exposed
from tests.studies.twin.building import (
    OPTIMISED,
    SANITIZED,
    compile_twin,
    needs_compiler,
    off,
    run_twin,
    simulated,
    worst,
    write_profile,
)
from thermal.profile import Profile

pytestmark = needs_compiler
HERE = Path(__file__).parent
HOUR = 3600.0
TEN_HOURS = {
    "time_s": [0.0, 0.0, 5 * HOUR, 5 * HOUR + 3000.0, 10 * HOUR],
    "chamber_temperature_degC": [20.0, -20.0, -20.0, 40.0, 40.0],
}
RAMPS = {
    "time_s": np.array([0.0, 600.0, 4000.0, 4600.0, 9000.0]),
    "chamber_temperature_degC": [20.0, 20.0, 45.0, 5.0, 15.0],
    "rate_deg_per_s": [0.0, 0.02, -0.03, 0.01, 0.0],
    "drive_amplitude_V": [1.0, 1.0, 1.3, 0.8, 1.0],
    "electrode_bias_V": [80.0, 80.0, 110.0, 90.0, 80.0],
    "quadrature_V": [0.1, 0.2, -0.1, 0.3, 0.1],
    "pattern_angle_deg": [20.0, 20.0, 31.0, 12.0, 25.0],
}
SHAPES = {
    # a shape in the middle of what is reached, where the middle of the bounds is not
    "temperature_degC": 22.0, "width_K": 2.0, "half_width_K": 3.0, "from_degC": 5.0, "to_degC": 40.0,
    "second_time_constant_s": 900.0, "relaxation_time_s": 1500.0, "period_s": 1234.5, "onset_s": 1000.0,
    "time_s": 4321.0, "filling_s": 5000.0, "pole_s": 40.0, "axis_deg": 7.0, "share_of_form": 0.2,
    "rotation_deg_per_10K": 3.0,
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("twin")


@pytest.mark.slow
@pytest.mark.parametrize("card", ["birdbath-5mm", "hrg-30mm-loops"])
def test_limits_shipped_card_over_ten_hours(card, folder):
    """A step, a ramp and soaks, ten hours in rows of 12 s: every column to 1e-9 of its largest value."""
    instrument = load_card(card)
    profile = write_profile(folder / "ten.csv", TEN_HOURS)
    found = run_twin(compile_twin(instrument, folder / card, OPTIMISED), profile, 12.0)
    chamber = Profile(np.array(TEN_HOURS["time_s"]), 273.15 + np.array(TEN_HOURS["chamber_temperature_degC"]))
    expected = simulated(instrument, chamber, 12.0)
    assert set(expected) < set(found)
    assert off(found, expected) == {}


def one_effect(name, response):
    effect = library()[name]
    shape = {p.name: min(max(SHAPES.get(p.name, p.low), p.low), p.high) for p in effect.shape}
    size = {"frequency_Hz": 1e-3, "bias_deg_per_h": 1.0, "inverse_q": 1e-9}[response] if not effect.thermal else 0.05
    size *= 100.0 if name == "rate-frequency" else 1.0
    keys = zip(effect.coefficient_names(response), effect.coefficients, strict=True)
    weights = {
        key: size * c.spread[0] if len(c.spread) == 1 else [size * float(part) for part in c.spread] for key, c in keys
    }
    return {"name": name, "response": response, **shape, **weights}


BY_DIFFERENCES = {"clock-offset": 1e-7}
"""The simulation and the twin take this rate as a difference between rows, the one of both sides, the other of what has been."""


def programs():
    """Effects that share a compiled program, where their errors add: of the heat path three, of the others five in every column."""
    effects, responses = sorted(library().items()), ("frequency_Hz", "bias_deg_per_h", "inverse_q")
    thermal = [(name, r) for name, e in effects if e.thermal and name not in BY_DIFFERENCES for r in e.responses]
    columns = [[(name, r) for name, e in effects if not e.thermal and r in e.responses] for r in responses]
    alone = [[(name, r)] for name in BY_DIFFERENCES for r in library()[name].responses]
    shared = [[one for column in columns for one in column[k : k + 5]] for k in range(0, max(map(len, columns)), 5)]
    return [*alone, *(thermal[k : k + 3] for k in range(0, len(thermal), 3)), *shared]


DATED = (
    (("clock-drift", "frequency_Hz"), ("ageing", "bias_deg_per_h"), ("leak", "inverse_q")),
    (("periodic", "bias_deg_per_h"),),
)
"""Effects with a date that share a program, each alone in its column."""


def test_every_effect_with_a_date_is_tried():
    assert {name for row in DATED for name, _ in row} == {name for name, effect in library().items() if effect.dated}


@pytest.mark.slow
@pytest.mark.parametrize("effects", DATED, ids=lambda one: "+".join(name for name, _ in one))
def test_limits_effect_with_a_date(effects, bare, folder):
    """A profile's '# start' places the run in time: what has a date goes on from it; without a start, or before the date, it begins."""
    entries = [one_effect(*one) | {"since": "2026-03-01T12:00:00"} for one in effects]
    for entry in entries:
        entry |= {"restarts_each_run": 0.0} if entry["name"] == "periodic" else {}
    instrument = load_card("free-dome").with_table("effect", entries)
    program = compile_twin(instrument, folder / "dated")
    profile, first = folder / "dated.csv", None
    spellings = ("2026-03-04 23:30+05:45", "2026-04-01T00:00:00Z", "2028-02-29") if len(effects) > 1 else ()
    for start in ("", "2026-02-01T12:00:00", "2026-03-05T18:00:07.25", *spellings):
        write_profile(profile, RAMPS)
        profile.write_text((f"# start: {start}\n" if start else "") + profile.read_text())
        found, expected = run_twin(program, profile, 5.0), simulated(instrument, profile, 5.0)
        first = expected if first is None else first
        for _, column in effects:
            moved = np.abs(expected[column] - first[column]).max() / np.abs(bare[column]).max()
            assert (moved > 1e-8) == (start > "2026-03"), (start, column)
            assert worst(found, expected)[column] < 1e-9, (start, column)
        assert read_record(program.parent / "record.csv").moment == load_drive(str(profile), rate=0.2).moment
    profile.write_text("# start: yesterday\n" + profile.read_text())
    done = subprocess.run([program, profile, folder / "no.csv"], capture_output=True, text=True, check=False)
    assert (done.returncode, "'# start' is no ISO 8601 time" in done.stderr) == (2, True)


@pytest.fixture(scope="module")
def bare(folder):
    return simulated(load_card("free-dome"), write_profile(folder / "ramps.csv", RAMPS), 20.0)


@pytest.mark.slow
@pytest.mark.parametrize("effects", programs(), ids=lambda one: "+".join(name for name, _ in one))
def test_limits_effect(effects, bare, folder):
    """Every effect of the library with all its coefficients, of which each moves its column, through ramps with moving commands."""
    card, profile = load_card("free-dome"), folder / "ramps.csv"
    instrument = card.with_table("effect", [one_effect(*one) for one in effects])
    found = run_twin(compile_twin(instrument, folder / "effect"), profile, 4.0)
    allowed = max(BY_DIFFERENCES.get(name, 1e-9) for name, _ in effects)
    assert off(found, simulated(instrument, profile, 4.0), allowed) == {}
    for name, response in effects:
        alone = simulated(card.with_table("effect", [one_effect(name, response)]), profile, 20.0)
        columns = bare if library()[name].thermal else (response,)
        moved = max(np.abs(alone[column] - bare[column]).max() / np.abs(bare[column]).max() for column in columns)
        assert moved > 1e-8 or name == "jump", name


ERRORS = {f"{side}_gain_ratio": 0.02 for side in ("pickoff", "drive")} | {
    "drive_skew_mrad": -20.0,
    "pickoff_skew_mrad": 30.0,
}
ERRORS |= {f"{side}_phase_deg": 1.0 for side in ("pickoff", "drive")} | {"misalignment_mrad": 3.0}
ERRORS |= {"frequency_split_mHz": 2.0, "frequency_axis_deg": 7.0}
ERRORS |= {"drive_phase_difference_deg": 2.0, "pickoff_phase_difference_deg": -1.0}


@pytest.mark.slow
@pytest.mark.parametrize(("precession", "control"), [(0.5, "force"), (-0.05, "stiffness")])
def test_limits_wave_that_turns_freely(precession, control, folder):
    """Whole angle with every error of the electronics, ten hours, at a rate and by its command: up to fifty turns."""
    loop = {**ERRORS, "mode": "whole-angle", "self_precession_deg_per_s": precession, "quadrature_control": control}
    instrument = load_card("hrg-30mm-loops").with_table("loop", loop)
    program = compile_twin(instrument, folder / "free")
    ten = TEN_HOURS | {"time_s": [0.0, 600.0, *TEN_HOURS["time_s"][2:]]}
    rate = {"rate_deg_per_s": [0.0, 0.01, -0.01, 0.02, 0.0]}
    pulses = {"time_s": [0.0, 33.3, 33.300001, 38.0, 38.1, 600.0], "chamber_temperature_degC": [20.0] * 5 + [25.0]}
    pulses |= {"rate_deg_per_s": [0.0, 0.0, 10.0, 10.0, 0.0, -0.1]}  # inside a row
    for columns, row in ((ten | rate, 12.0), ({k: RAMPS[k] for k in (*ten, *rate)}, 4.0), (pulses, 10.0)):
        profile = write_profile(folder / "free.csv", columns)
        found, expected = run_twin(program, profile, row), simulated(instrument, profile, row)
        assert np.ptp(expected["pattern_angle_deg"]) > 0.9 * abs(precession) * columns["time_s"][-1]
        assert np.ptp(expected["pattern_angle_deg"]) > 0.3
        assert off(found, expected) == {}
    held = write_profile(folder / "held.csv", TEN_HOURS | {"pattern_angle_deg": [0.0] * 5})
    done = subprocess.run([program, held, folder / "no.csv"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "turns freely" in done.stderr


@pytest.mark.slow
def test_limits_noise_turns_the_free_wave(folder):
    """What is read as a rate has turned the azimuth by the Bryan factor times its integral, and the frequency is that of this azimuth."""
    noise = {"bias_white_deg_per_rt_h": 3.0, "bias_flicker_deg_per_h": 0.0, "bias_walk_deg_per_h_per_rt_h": 0.0}
    noise |= {"pattern_angle_white_deg": 1e-3, "bias_resolution_deg_per_h": 0.0, "frequency_white_Hz": 0.0}
    noise |= {"frequency_flicker_Hz": 0.0, "frequency_walk_Hz": 0.0, "frequency_resolution_Hz": 0.0}
    loop = {"mode": "whole-angle", "self_precession_deg_per_s": 0.05, "frequency_split_mHz": 5.0}
    instrument = load_card("hrg-30mm-loops").with_table("loop", loop).with_table("noise", noise)
    program = compile_twin(instrument, folder / "wander")
    profile = write_profile(folder / "still.csv", {"time_s": [0.0, 7200.0], "chamber_temperature_degC": [20.0, 20.0]})
    noisy, plain = run_twin(program, profile, 2.0, 5), run_twin(program, profile, 2.0)
    wander = noisy["bias_deg_per_h"] - plain["bias_deg_per_h"]
    turned = plan_twin(instrument).constants["BRYAN"] * np.cumsum(np.append(0.0, wander[:-1])) * 2.0 / 3600
    off = noisy["pattern_angle_deg"] - plain["pattern_angle_deg"]
    assert np.std(wander) == pytest.approx(180.0 / np.sqrt(2.0), rel=0.06)
    assert np.std(turned) > 0.3
    assert np.std(off - turned) == pytest.approx(1e-3 / np.sqrt(2.0), rel=0.06)
    x = 4 * np.radians(noisy["pattern_angle_deg"])
    X = np.stack([np.ones_like(x), np.cos(x), np.sin(x)], axis=1)
    b, left, *_ = np.linalg.lstsq((X[1:] + X[:-1]) / 2, noisy["frequency_Hz"][:-1], rcond=None)
    assert np.hypot(*b[1:]) == pytest.approx(2.5e-3, rel=1e-3)
    assert np.sqrt(left[0] / len(x)) < 1e-3 * 2.5e-3


@pytest.mark.slow
def test_limits_everything_at_once(folder):
    """Loops with every error of their electronics, electrodes, a polynomial bias and a linear heat path."""
    bias = {"offset_deg_per_h": 0.3, "k1_deg_per_h_per_Hz": 0.1, "k4_deg_per_h_s_per_Hz": 30.0}
    bias |= {"k9_deg_per_h_s2_per_Hz3": 5.0}
    profile = write_profile(folder / "ramps.csv", {k: v for k, v in RAMPS.items() if k != "quadrature_V"})
    for control, radiates in (("force", True), ("stiffness", False)):
        instrument = (
            load_card("hrg-30mm-loops")
            .with_table("loop", {**ERRORS, "quadrature_control": control})
            .with_table("bias", bias)
        )
        heat = {"drive_power_mW": 2.0, "cells": 8, "base_capacity_slope_per_K": 1.5e-3, "film_housing_share": 0.4}
        instrument = instrument.with_table("thermal", {"radiation": radiates, **heat})
        found = run_twin(compile_twin(instrument, folder / control), profile, 2.0)
        expected = simulated(instrument, profile, 2.0)
        assert off(found, expected) == {}, control


@pytest.mark.slow
@pytest.mark.parametrize("cells", [1, 60])
def test_limits_imperfect_card(cells, folder):
    """Imperfection, charged electrodes at a commanded voltage, a mount, the parts of a loss budget; few cells of the shell and many."""
    instrument = load_card(HERE.parents[1] / "golden" / "inputs" / "busy.toml").with_values({"thermal.cells": cells})
    profile = write_profile(
        folder / "volts.csv", {key: RAMPS[key] for key in ("time_s", "chamber_temperature_degC", "electrode_bias_V")}
    )
    found = run_twin(compile_twin(instrument, folder / "busy"), profile, 10.0)
    expected = simulated(instrument, profile, 10.0)
    assert off(found, expected) == {}


LAW = """
schema = "hrg.card/1"
name = "of records alone"
reference_temperature_degC = 20.0
[law]
f0_Hz = 4432.07
a1_per_K = 8.1e-5
a2_per_K2 = 1.3e-7
a3_per_K3 = -4e-10
lag_s = 1400.0
second_lag_s = 220.0
third_lag_s = 31.0
radiated_share = 0.4
direct_share = {direct}
base_radiated_share = 0.2
capacity_ratio = 0.2
capacity_slope_per_K = 2e-3
base_capacity_slope_per_K = 6e-4
chamber_lag_s = 500.0
delay_s = {delay}
bias_bend = 0.3
[bias]
k1_deg_per_h_per_Hz = 0.4
k2_deg_per_h_per_Hz2 = 0.05
k4_deg_per_h_s_per_Hz = 30.0
"""


@pytest.mark.slow
@pytest.mark.parametrize(("delay", "direct"), [(31.0, 0.3), (-31.0, 0.3)])
def test_limits_card_without_a_geometry(delay, direct, folder):
    """A polynomial law behind three lumps that radiate, past one another too, bias that follows part of its bend, a resonator late or early.

    The program knows a corner of its profile before it comes, but neither it nor the simulation what comes after the end.
    """
    card = folder / "law.toml"
    card.write_text(LAW.format(direct=direct, delay=delay))
    instrument = load_card(card)
    profile = write_profile(folder / "ten.csv", TEN_HOURS)
    found = run_twin(compile_twin(instrument, folder / "law", SANITIZED), profile, 3.0)
    chamber = Profile(np.array(TEN_HOURS["time_s"]), 273.15 + np.array(TEN_HOURS["chamber_temperature_degC"]))
    expected = simulated(instrument, chamber, 3.0)
    known = found["time_s"] <= TEN_HOURS["time_s"][-1] + min(delay, 0.0)
    assert off({k: v[known] for k, v in found.items()}, {k: v[known] for k, v in expected.items()}) == {}
    assert not [key for key in instrument_keys(instrument) if key.startswith(("thermal.", "law."))]


def instrument_keys(instrument):
    plan = plan_twin(instrument)
    return [exposed(plan, key) for key in plan.parameters]


@pytest.mark.slow
def test_limits_imposed_housing(folder):
    """The housing itself imposed, without the lag of its sensor: as a record of straight lines drives the simulation."""
    instrument = load_card("hrg-30mm").with_table("noise", {"housing_lag_s": 0.0})
    time = np.arange(0.0, 7200.0, 120.0)
    columns = {"time_s": time, "housing_temperature_degC": 20.0 + 0.004 * time}
    profile = write_profile(folder / "housing.csv", columns)
    found = run_twin(compile_twin(instrument, folder / "housing", boundary="housing"), profile, 120.0)
    expected = simulated(instrument, profile)
    assert off(found, expected) == {}


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["force-rebalance", "whole-angle"])
def test_contract_record_of_the_program(mode, folder, capsys):
    """Columns, order and digits of `hrg simulate --noiseless`, which reads what the twin writes."""
    card = folder / "card.toml"
    save_card(load_card("hrg-30mm-loops").with_table("loop", {"mode": mode}), card)
    without = ("electrode_bias_V", "pattern_angle_deg" if mode == "whole-angle" else "")
    profile = write_profile(folder / "short.csv", {k: v for k, v in RAMPS.items() if k not in without})
    assert (
        main(["simulate", str(card), str(profile), "--out", str(folder / "python.csv"), "--noiseless", "--row", "10"])
        == 0
    )
    program = compile_twin(load_card(card), folder / "record")
    run_twin(program, profile, 10.0, full=False)
    python, c = read_record(folder / "python.csv"), read_record(folder / "record" / "record.csv")
    assert list(c.columns) == list(python.columns)
    for name in python.columns:
        np.testing.assert_allclose(
            c[name], python[name], rtol=0, atol=1.01e-6 if "temperature" in name or "bias" in name else 1.01e-8
        )


@pytest.mark.slow
def test_contract_words_and_files_of_the_program(folder):
    """A word that is not understood is refused; the record never takes the profile's place, and stands whole or not at all."""
    program = compile_twin(load_card("free-dome"), folder / "words")
    profile = write_profile(folder / "words.csv", {"time_s": [0.0, 600.0], "chamber_temperature_degC": [20.0, 25.0]})
    hot = write_profile(folder / "hot.csv", {"time_s": [0.0, 6000.0], "chamber_temperature_degC": [20.0, 900.0]})
    out, link, hard = folder / "kept.csv", folder / "link.csv", folder / "hard.csv"
    out.write_text("kept")
    link.symlink_to(profile)
    hard.hardlink_to(profile)
    before = profile.read_text()

    def run(*words):
        return subprocess.run([program, *map(str, words)], capture_output=True, text=True, check=False)

    for words in (
        "10 Noiseless",
        "10 nois",
        "10 1.5",
        "10 -1",
        "10 1e3",
        "10 noiseless ful",
        "10 1 full 1",
        "1x",
        "inf",
    ):
        done = run(profile, out, *words.split())
        assert (done.returncode, done.stderr.split()[0]) == (2, "usage:"), words
    for place in (profile, link, hard, folder / "words" / ".." / "words.csv", folder):
        done = run(profile, place, 10)
        assert (done.returncode, str(place) in done.stderr) == (2, True)
    assert run(hot, out, 10).returncode == 2
    assert (out.read_text(), profile.read_text(), list(folder.glob("*.part"))) == ("kept", before, [])
    assert run(profile, out, 10, 3, "full").returncode == 0
    assert len(read_record(out)) == 61
    assert run(profile, "/dev/stdout", 10, 3, "full").stdout == out.read_text()
    for start, words in (
        ("# start: 2026-02-29\n", "'# start' is no ISO 8601 time"),
        ("# start: 2026-04-31T08:00\n", "'# start' is no ISO 8601 time"),
        ("temp_degC,", "column 'temp_degC' is unknown"),
        ("time_s,", "column 'time_s' is unknown, or there twice"),
    ):
        hot.write_text(start + before)
        assert words in run(hot, out, 10).stderr
    hot.write_text("# start: 2028-02-29\n" + before, encoding="utf-8-sig")
    assert run(hot, out, 10).returncode == 0


@pytest.fixture(scope="module")
def draw(folder):
    """Draws of the C code, 64 runs of 4096 rows."""
    program = compile_twin(load_card("free-dome"), folder / "draws", main=str(HERE / "draw.c"))

    def make(noise, span):
        words = map(repr, (*astuple(noise), span))
        said = subprocess.run([program, *words, "64", "4096"], check=True, capture_output=True, text=True).stdout
        return np.array(said.split(), float).reshape(64, 4096)

    return make


@pytest.mark.slow
@pytest.mark.parametrize(
    "noise",
    [Noise(flicker=1.0), Noise(walk=1.0), Noise(markov=1.0, markov_time=40.0), Noise(0.3, 0.5, 0.02)],
    ids=["flicker", "walk", "markov", "all"],
)
def test_limits_allan_variance_of_the_draws(noise, draw):
    """Rows of 2 s against the closed-form Allan variance; 5 standard errors of their scatter."""
    values = draw(noise, 2.0)
    for count in (1, 8, 64, 512):
        means = values.reshape(64, -1, count).mean(axis=2)
        each = (np.diff(means, axis=1) ** 2).mean(axis=1) / 2
        scatter = each.std(ddof=1) / np.sqrt(64)
        assert abs(each.mean() - noise.allan_variance(count * 2.0)) < 5 * scatter
        assert scatter < 0.2 * each.mean()


@pytest.mark.slow
def test_limits_draws_are_normal_and_seeded(draw, folder):
    """Moments of 262 144 white draws within 5 standard errors; the same seed gives the same run, another one does not."""
    x = draw(Noise(white=1.0), 1.0).ravel()
    for power, moment, variance in ((1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)):
        assert abs((x**power).mean() - moment) < 5 * np.sqrt(variance / x.size)
    assert np.unique(x).size == x.size
    twin, profile = (
        compile_twin(load_card("free-dome"), folder / "seeds"),
        write_profile(folder / "short.csv", {k: TEN_HOURS[k][1:3] for k in TEN_HOURS}),
    )
    one, again, other = (run_twin(twin, profile, 60.0, seed)["frequency_Hz"] for seed in (3, 3, 4))
    assert np.array_equal(one, again)
    assert not np.array_equal(one, other)


@pytest.mark.slow
def test_limits_sanitizers(folder):
    """All effects at once, loops and noise, and an FMU's life, under the address and undefined-behaviour sanitizers."""
    free = load_card("hrg-30mm-loops").with_table("loop", {**ERRORS, "mode": "whole-angle"})
    turning = write_profile(folder / "turning.csv", {k: v for k, v in RAMPS.items() if k != "pattern_angle_deg"})
    found = run_twin(compile_twin(free, folder / "turning", SANITIZED), turning, 5.0, 7)
    assert all(np.isfinite(column).all() for column in found.values())
    entries = [one_effect(name, library()[name].responses[0]) for name in sorted(library())]
    entries = [entry | {"share_of_form": 1.0} if entry["name"] == "radiation" else entry for entry in entries]
    instrument = load_card("hrg-30mm-loops").with_table("effect", entries)
    profile = write_profile(folder / "ramps.csv", RAMPS)
    program = compile_twin(instrument, folder / "sane", SANITIZED)
    assert np.isfinite(run_twin(program, profile, 5.0, 7)["frequency_Hz"]).all()
    assert subprocess.run([program, profile], capture_output=True, check=False).returncode == 2
    for bad in (
        "time_s\n0\n1\n",
        "time_s,chamber_temperature_degC\n0,20\n1,x\n",
        "time_s,chamber_temperature_degC\n1,20\n0,20\n",
        "",
    ):
        broken = folder / "broken.csv"
        broken.write_text(bad)
        done = subprocess.run([program, broken, folder / "no.csv"], capture_output=True, text=True, check=False)
        assert done.returncode == 2
        assert str(broken) in done.stderr
    for version in (2, 3):
        life = compile_twin(
            instrument,
            folder / f"life{version}",
            (*SANITIZED, f"-DTWIN_FMI={version}"),
            main=str(HERE / "life.c"),
            names=("fmi.c", "fmi2.inc", "fmi3.inc"),
        )
        done = subprocess.run([life], capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, "")
