"""`hrg simulate` of a whole-angle card: the wave turns with the rate, with its self-precession and by its own drift."""

import numpy as np
import pytest

from compensation.controllers import Loops
from compensation.electronics import Channels, Electronics
from compensation.settled_turn import read_turning, turn_settled
from compensation.wave import from_quality
from compensation.whole_angle import simulate_whole_angle
from studies.cli import main
from studies.instrument.card import load_card, shipped_cards
from studies.record import read_record

CARD = """
[loss]
inverse_q = 1e-6
[bias]
damping_anisotropy = 0.03
damping_axis_deg = 10.0
pattern_angle_deg = 0.0
[loop]
mode = "whole-angle"
frequency_split_mHz = 0.0
"""
K = 0.27562  # Bryan factor of the solid free dome


def simulated(tmp_path, lines, schedule, noise=False):
    card, out, path = tmp_path / "card.toml", tmp_path / "run.csv", tmp_path / "schedule.csv"
    card.write_text(shipped_cards()["free-dome"].read_text() + lines)
    path.write_text(schedule)
    words = ["simulate", str(card), str(path), "--out", str(out), "--row", "10"]
    assert main(words if noise else [*words, "--noiseless"]) == 0
    return load_card(card), read_record(out)


def test_the_pattern_turns_with_the_applied_rate(tmp_path, capsys):
    schedule = "time_s,chamber_temperature_degC,rate_deg_per_s\n0,20,0\n100,20,0\n101,20,10\n1000,20,10\n"
    _, record = simulated(tmp_path, CARD.replace("0.03", "0.0"), schedule)
    t, angle = record["time_s"], record["pattern_angle_deg"]
    assert angle[t <= 100] == pytest.approx(0.0, abs=1e-9)
    assert angle[-1] - angle[t == 200][0] == pytest.approx(K * 10 * 800, rel=1e-3)
    assert record["rate_deg_per_s"][-1] == 10
    assert record["measured_rate_deg_per_s"][-1] == pytest.approx(10, rel=1e-9)
    assert capsys.readouterr().err == f"record: {tmp_path / 'run.csv'}\n"


@pytest.mark.slow
@pytest.mark.parametrize(("rate", "factor"), [(120.0, 1.0), (20.0, 0.0)])
def test_a_slow_wave_locks_and_a_fast_one_turns_at_the_root_of_the_squares(tmp_path, rate, factor):
    """θ̇ = k (Ω + Ω_d sin 4(θ - θ_τ)), Ω_d = Δ(1/τ)/(4 k): k √(Ω² - Ω_d²) on average, and nothing below Ω_d."""
    degrees = rate / 3600
    schedule = f"time_s,chamber_temperature_degC,rate_deg_per_s\n0,20,{degrees}\n360000,20,{degrees}\n"
    card, record = simulated(tmp_path, CARD, schedule)
    drift = 0.03 * np.pi * record["frequency_Hz"][0] * card.loss.inverse_q / (4 * K)
    most = np.degrees(drift) * 3600  # deg/h
    assert 60 < most < 120
    t, angle = record["time_s"], record["pattern_angle_deg"]
    if factor:
        periods = np.flatnonzero(np.diff(np.floor(angle / 90)))  # whole periods of 4 θ
        mean = (angle[periods[-1]] - angle[periods[0]]) / (t[periods[-1]] - t[periods[0]])
        assert mean == pytest.approx(K * np.sqrt(rate**2 - most**2) / 3600, rel=0.01)
    else:
        assert abs(angle[-1] - angle[len(angle) // 2]) < 1e-3
        assert record["measured_rate_deg_per_s"][-1] == pytest.approx(0.0, abs=1e-6)


def test_self_precession_is_taken_out_of_the_rate(tmp_path):
    lines = CARD + "self_precession_deg_per_s = 0.5\n"
    _, record = simulated(tmp_path, lines, "time_s,chamber_temperature_degC\n0,20\n3600,20\n")
    assert record["pattern_angle_deg"][-1] == pytest.approx(1800.0, rel=1e-3)
    bias = record["bias_deg_per_h"]
    assert np.std(bias) == pytest.approx(np.max(bias) / np.sqrt(2), rel=0.02)  # a sine of the azimuth
    assert abs(np.mean(bias)) < 0.03 * np.max(bias)


WAVE = from_quality(4432.0, 1e6, damping_anisotropy=0.02, damping_axis=0.2, frequency_split=5e-3, frequency_axis=0.1)


def test_settled_turning_is_the_loops_own_run_without_their_lag():
    """Every error of the electronics, against the loops sample by sample: to second order in the errors."""
    time = np.arange(0.0, 1200.0, 2.0)
    errors = Electronics(Channels(0.004, 0.002, 0.003, 0.001, 0.004), Channels(-0.005, 0.001, 0.002, 5e-4, 0.006))
    for precession in (0.0, 1e-3):
        loops = simulate_whole_angle(WAVE, errors, Loops(), time, rate=7e-5, precession=precession, angle=0.1)
        settled = turn_settled(WAVE, errors, time, rate=7e-5, precession=precession, angle=0.1)
        ideal = turn_settled(WAVE, Electronics(), time, rate=7e-5, precession=precession, angle=0.1)
        made = np.ptp(loops.angle - ideal.angle)
        assert made > 1e-2
        assert np.abs(settled.angle - loops.angle).max() < 0.02 * made


def test_settled_commands_of_a_turning_wave_are_those_of_the_loops():
    """Amplitude's drive, quadrature, frequency and rate, each against its own swing around: the gains make the amplitude swell."""
    time = np.arange(0.0, 1200.0, 1.0)
    errors = Electronics(Channels(0.008, 0.002, 0.003, 0.001, 0.004), Channels(-0.005, 0.001, 0.002, 5e-4, 0.006))
    precession = np.radians(0.5) * np.where(time < 600, 1.0, -1.0)
    loops = simulate_whole_angle(WAVE, errors, Loops(), time, rate=7e-5, precession=precession, angle=0.1)
    settled = read_turning(WAVE, errors, loops.angle, rate=7e-5, time=time)
    inside = np.abs(time[:-1] - 600) > 5
    for name in ("rate", "quadrature", "decay", "omega"):
        values = getattr(settled, name)
        made, found = getattr(loops, name)[:-1][inside], ((values[1:] + values[:-1]) / 2)[inside]
        assert np.std(found - made) < 0.01 * np.std(made), name
    given = read_turning(WAVE, errors, loops.angle[:500], rate=7e-5, precession=np.radians(0.5))
    assert given.rate[5:495] == pytest.approx(settled.rate[5:495], abs=1e-3 * np.std(settled.rate))


def test_noise_turns_the_wave_that_all_columns_follow(tmp_path):
    """θ = ∫ k (Ω + noise) dt and white noise of the reading; the frequency is that of the turned azimuth."""
    silent = "bias_flicker_deg_per_h = 0.0\nbias_walk_deg_per_h_per_rt_h = 0.0\n"
    silent += "frequency_white_Hz = 0.0\nfrequency_flicker_Hz = 0.0\nfrequency_walk_Hz = 0.0\n"
    lines = CARD.replace("split_mHz = 0.0", "split_mHz = 5.0") + "self_precession_deg_per_s = 0.05\n"
    lines += f"[noise]\nbias_white_deg_per_rt_h = 3.0\npattern_angle_white_deg = 1e-3\n{silent}"
    chamber = "time_s,chamber_temperature_degC\n0,20\n7200,20\n"
    _, noisy = simulated(tmp_path, lines, chamber, noise=True)
    _, plain = simulated(tmp_path, lines, chamber)
    off = noisy["pattern_angle_deg"] - plain["pattern_angle_deg"]
    wander = noisy["bias_deg_per_h"] - plain["bias_deg_per_h"]
    step = np.median(np.diff(noisy["time_s"]))
    turned = K * np.concatenate([[0.0], np.cumsum(wander[:-1])]) * step / 3600
    assert np.std(turned) > 0.3
    assert np.std(off - turned) == pytest.approx(1e-3 / np.sqrt(step), rel=0.1)
    x = 4 * np.radians(noisy["pattern_angle_deg"])
    X = np.stack([np.ones_like(x), np.cos(x), np.sin(x)], axis=1)
    X, f = (X[1:] + X[:-1]) / 2, noisy["frequency_Hz"][:-1]  # means to the next row
    b, left, *_ = np.linalg.lstsq(X, f, rcond=None)
    assert np.hypot(*b[1:]) == pytest.approx(2.5e-3, rel=1e-3)
    assert np.sqrt(left[0] / len(f)) < 1e-3 * 2.5e-3
