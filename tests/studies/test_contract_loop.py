"""`hrg loop` speaks as promised: its schema, its refusals, and a record whose noise and bias are those that it states."""

import re

import numpy as np
import pytest

from studies.cli import main
from studies.instrument.card import load_card, shipped_cards
from studies.record import read_record


@pytest.fixture
def card(tmp_path):
    def write(lines):
        path = tmp_path / "looped.toml"
        path.write_text(shipped_cards()["free-dome"].read_text() + "\n[loop]\n" + lines)
        return str(path)

    return write


@pytest.mark.slow
def test_schema_and_record(card, tmp_path, ask):
    path = card("misalignment_mrad = 0.5\nvibration_um = 1.0\nmodal_mass_mg = 500.0\n")
    out = tmp_path / "run.csv"
    found = ask(["loop", path, "--out", str(out), "--hours", "1"])
    assert found["schema"] == "hrg.loop/1"
    assert [margin["paper"] for margin in found["margins"]] == ["GA", "GF", "GR", "GQ"]
    assert list(found["bias"][0]) == ["source", "deg_per_h", "sd_deg_per_h"]
    record = read_record(out)
    assert len(record) == found["rows"] == 3601
    bias = record["bias_deg_per_h"]
    one = next(noise for noise in found["noise"] if noise["source"] == "all")["deg_per_h_over_1s"]
    assert np.std(bias) == pytest.approx(one, rel=0.06)
    assert np.mean(bias) == pytest.approx(found["bias"][-1]["deg_per_h"], abs=5 * one / 60)
    # turn of the drives: n β/τ over n k, from the card's Q = 1e7
    turn = next(source for source in found["bias"] if source["source"] == "turn of the drives")["deg_per_h"]
    decay = np.pi * found["frequency_Hz"] / 1e7
    assert turn == pytest.approx(np.degrees(0.5e-3 * decay / found["bryan_factor"]) * 3600, rel=1e-3)


@pytest.mark.parametrize("lines", ["rate_bandwidth_Hz = 200.0\n", "rate_bandwidth_Hz = 120.0\ndelay_ms = 4.0\n"])
def test_unstable_loop_is_said_with_its_margin_before_anything_is_simulated(card, tmp_path, ask, refuse, lines):
    out = tmp_path / "run.csv"
    path = card(lines)
    for words in (["loop", path, "--out", str(out)], ["simulate", path, "step 20 10 1h", "--out", str(out)]):
        said = refuse(words)
        assert "[loop]: the rate loop (GR) is unstable: gain margin -" in said
        assert not out.exists()
    calm = re.search(r"lower its bandwidth to about ([\d.]+) Hz", said)[1]
    assert float(calm) > 5
    slower = ask(["loop", card(re.sub(r"(?<=rate_bandwidth_Hz = )[\d.]+", calm, lines))])
    rate = next(m for m in slower["margins"] if m["loop"] == "rate")
    assert rate["gain_margin_dB"] > 5.5
    assert rate["phase_margin_deg"] > 44


def test_uncertainties_of_the_loops_hold_only_where_the_card_has_them(card):
    names = {value.name for value in load_card(card("")).uncertain}
    assert "loop.pickoff_phase_deg" in names
    assert not any(value.name.startswith("loop.") for value in load_card("free-dome").uncertain)


def test_half_of_the_thermal_noise_is_refused(card, refuse):
    assert "needs both vibration_um and modal_mass_mg" in refuse(["loop", card("vibration_um = 1.0\n")])


def test_noise_of_a_free_wave_is_what_its_run_shows(card, tmp_path, ask):
    path = card('mode = "whole-angle"\nvibration_um = 1.0\nmodal_mass_mg = 500.0\n')
    out = tmp_path / "run.csv"
    found = ask(["loop", path, "--out", str(out), "--hours", "0.5"])
    assert [margin["paper"] for margin in found["margins"]] == ["GA", "GF", "GQ"]
    one = next(noise for noise in found["noise"] if noise["source"] == "all")["deg_per_h_over_1s"]
    assert np.std(read_record(out)["bias_deg_per_h"]) == pytest.approx(one, rel=0.06)


def test_limits_white_pickoff_noise_is_no_walk_of_the_angle(ask):
    """A reading e (1/√Hz) costs the force e √(1/τ² + Δω² cos² φ + ¼Δω² sin² φ), φ = 2n(θ − θ_ω): decay, quadrature left, phase; the DAC's walks as it is."""
    card, found = load_card("hrg-30mm-loops"), ask(["loop", "hrg-30mm-loops"])
    loop, coupling = card.loop, 2 * found["bryan_factor"]
    decay = np.pi * found["frequency_Hz"] / found["quality_factor"]
    phi = np.radians(4 * (card.bias.pattern_angle_deg - loop.frequency_axis_deg))
    split = 2e-3 * np.pi * loop.frequency_split_mHz * np.hypot(np.cos(phi), np.sin(phi) / 2)
    reading = 1e-6 * loop.pickoff_noise_uV_per_rt_Hz * np.hypot(decay, split)
    force = coupling * np.radians(loop.rate_range_deg_per_s) * 2 / 2**loop.dac_bits / np.sqrt(12 * loop.sampling_Hz)
    said = {noise["source"]: noise for noise in found["noise"]}
    for source, walk in (("pickoff", reading), ("dac_step", force)):
        assert said[source]["deg_per_rt_h"] == pytest.approx(np.degrees(walk / coupling) * 60, rel=0.01), source
    # over 1 s the angle's white noise at both ends: 2 Q²
    assert said["pickoff"]["angle_arcsec"] == pytest.approx(said["pickoff"]["deg_per_h_over_1s"] / 2**0.5, rel=0.01)
    whole = np.hypot.reduce([noise["angle_arcsec"] for source, noise in said.items() if source != "all"])
    assert said["all"]["angle_arcsec"] == pytest.approx(whole, rel=1e-3)


def test_a_profile_drives_the_resonator_not_its_reading(card, tmp_path):
    """What the loops read is the resonator, not what they have read already."""
    path, out = card("pickoff_phase_deg = 3.0\n"), tmp_path / "run.csv"
    words = ["--profile", "soak 20 20min", "--row", "10", "--noiseless"]
    assert main(["loop", path, "--json", "--out", str(out), *words]) == 0
    record = read_record(out)
    # the phase error counts once, as 1/cos ε
    assert record["inverse_q"][-1] == pytest.approx(1e-7 / np.cos(np.radians(3.0)), rel=3e-4)


@pytest.mark.parametrize(
    ("lines", "words", "said"),
    [
        ("", ["--rate", "300"], "the rate of 300 °/s (--rate) is beyond rate_range_deg_per_s = 100"),
        ("frequency_split_mHz = 5000.0\n", [], "can null a split of at most 306"),
        ('quadrature_control = "stiffness"\nfrequency_split_mHz = 5000.0\n', [], "quadrature_range_Hz = 1"),
        ('mode = "whole-angle"\nself_precession_deg_per_s = 60.0\n', [], "the self-precession of 60 °/s takes 217.7 %"),
        *(
            (lines, ["--both-ways"], "--both-ways reverses the self-precession of a whole-angle wave")
            for lines in ("", 'mode = "whole-angle"\n')
        ),
    ],
    ids=["rate", "split, force", "split, stiffness", "self-precession", "no wave to reverse", "nothing to reverse"],
)
def test_what_the_loops_cannot_do_is_refused_with_their_range(card, tmp_path, refuse, lines, words, said):
    """n k Ω, ½ Δω and n θ̇ against n k Ω_max: k = 0.2756 of the dome, so that 100 °/s hold a split of n k Ω_max/π = 306 mHz."""
    path = card(lines)
    assert said in refuse(["loop", path, *words])
    if not words:
        assert said in refuse(["simulate", path, "soak 20 10min", "--out", str(tmp_path / "run.csv")])


@pytest.mark.slow
def test_the_rate_of_a_profile_is_applied_and_one_beyond_the_range_is_named_by_its_line(card, tmp_path, refuse, ask):
    path, profile, out = card(""), tmp_path / "rates.csv", str(tmp_path / "run.csv")

    def write(last):
        profile.write_text(f"time_s,chamber_temperature_degC,rate_deg_per_s\n0,20,0\n300,20,50\n600,20,{last}\n")
        return str(profile)

    for words in (["loop", path, "--profile", write(-150)], ["simulate", path, write(-150)]):
        assert "the rate of 150 °/s (" + str(profile) + ", line 4)" in refuse([*words, "--out", out])
    ask(["loop", path, "--profile", write(-60), "--row", "10", "--out", out, "--noiseless"])
    record = read_record(out)
    assert record["rate_deg_per_s"][[0, 59]] == pytest.approx([5 / 6, -60 + 11 / 6])
    assert record["measured_rate_deg_per_s"] == pytest.approx(
        record["rate_deg_per_s"], abs=0.02
    )  # °/s; a row is 3.7 °/s
    assert "leave out one of them" in refuse(["loop", path, "--profile", str(profile), "--rate", "9", "--out", out])
    profile.write_text(profile.read_text().replace("rate_deg_per_s", "drive_amplitude_V"))
    assert "applies no drive_amplitude_V" in refuse(["loop", path, "--profile", str(profile), "--out", out])


@pytest.mark.parametrize("mode", ["force-rebalance", "whole-angle"])
def test_limits_a_pulse_between_rows_is_applied_and_its_columns_stay(card, tmp_path, ask, mode):
    """10 °/s for half a second inside a row of a second, at no row: the mean of its row is 5 °/s."""
    profile, out = tmp_path / "pulse.csv", str(tmp_path / "run.csv")
    rows = "0,20,0\n2.2,20,0\n2.200001,20,10\n2.7,20,10\n2.700001,20,0\n6,20,0\n"
    profile.write_text(f"time_s,chamber_temperature_degC,rate_deg_per_s\n{rows}")
    ask(["loop", card(f'mode = "{mode}"\n'), "--profile", str(profile), "--out", out, "--noiseless"])
    record = read_record(out)
    for name in ("rate_deg_per_s", "measured_rate_deg_per_s"):
        assert record[name] == pytest.approx([0, 0, 5, 0, 0, 0, 0], abs=5e-3), name


def test_range_in_use_is_stated(card, ask):
    """A rate of 59 °/s of 100, and a split that takes eight tenths: √(0.6² + 0.8²); the stiffness takes it off the force."""
    lines = "frequency_split_mHz = 245.0\n"
    for quadrature, across, split in (("force", 1.0, 0.8), ("stiffness", 0.59, 0.245)):
        path = card(f'quadrature_control = "{quadrature}"\n' + lines)
        found = ask(["loop", path, "--rate", "59"])["range"]
        assert found["rate"] == pytest.approx(0.59, rel=1e-3)
        assert found["quadrature"] == pytest.approx(split, rel=3e-3)
        assert found["across"] == pytest.approx(across, rel=1e-2)
        assert found["drive"] == pytest.approx(1 / 20, rel=1e-2)


def test_two_equal_contributions_are_both_named(capsys):
    """Errors of phase of the pick-off and of the drive act alike; the first of them alone was the largest."""
    assert main(["loop", "hrg-30mm-loops"]) == 0
    said = capsys.readouterr().out
    assert (
        "Largest contributions to the uncertainty of the bias: pick-off phase error (loop.pickoff_phase_deg, ± 0.5°) and"
        in said
    )
    assert "drive phase error (loop.drive_phase_deg, ± 0.5°), 10 °/h each, 48 % of the variance each" in said
