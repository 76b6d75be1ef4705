"""`hrg simulate` of a whole-angle card: the wave turns with the rate, with its self-precession and by its own drift."""

import numpy as np
import pytest

from compensation.controllers import Loops
from compensation.electronics import Channels, Electronics
from compensation.settled_turn import read_turned, turn_settled
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


def simulated(tmp_path, lines, schedule, noise=False, row=10):
    card, out, path = tmp_path / "card.toml", tmp_path / "run.csv", tmp_path / "schedule.csv"
    card.write_text(shipped_cards()["free-dome"].read_text() + lines)
    path.write_text(schedule)
    words = ["simulate", str(card), str(path), "--out", str(out), "--row", str(row)]
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
    settled = read_turned(WAVE, errors, time, loops.angle, rate=7e-5)
    inside = np.abs(time[:-1] - 600) > 5
    for name in ("rate", "quadrature", "decay", "omega"):
        values = getattr(settled, name)
        made, found = getattr(loops, name)[:-1][inside], values[:-1][inside]
        assert np.std(found - made) < 0.01 * np.std(made), name
    given = turn_settled(WAVE, errors, time[:500], rate=7e-5, precession=np.radians(0.5), angle=0.1)
    again = read_turned(WAVE, errors, given.time, given.angle, rate=7e-5)
    assert again.rate[:-1] == pytest.approx(given.rate[:-1], abs=1e-3 * np.std(given.rate))


@pytest.mark.parametrize("row", [0.01, 1.0, 5.0, 10.0, 30.0])
def test_limits_a_row_holds_the_mean_to_the_next(row):
    """∫ cos x and ∫ sin x of a wave that turns evenly, x = 2n(θ − θ_ω), for frequency and quadrature; the rate is what the azimuth did."""
    time, turn = row * np.arange(40), np.radians(2.0)
    wave = from_quality(4432.0, 1e7, frequency_split=3e-3, frequency_axis=0.1)
    run = turn_settled(wave, Electronics(), time, precession=turn, angle=0.3)
    x = 4 * (0.3 + turn * time - 0.1)
    half = np.pi * 3e-3
    assert run.angle == pytest.approx(0.3 + turn * time, rel=1e-12)
    frequency = wave.omega + half * np.diff(np.sin(x)) / np.diff(x)
    assert run.omega[:-1] == pytest.approx(frequency, rel=0, abs=3e-6 * half)
    assert run.quadrature[:-1] == pytest.approx(-half * np.diff(np.cos(x)) / np.diff(x), abs=3e-6 * half)
    run = turn_settled(WAVE, Electronics(), time, precession=turn, rate=1e-4, angle=0.3)
    made = (np.diff(run.angle) / row - turn) / WAVE.bryan_factor
    assert run.rate[:-1] == pytest.approx(made, abs=1e-5 * np.abs(made).max() + 1e-14 / row)


JUMP = "0,20,8\n1800,20,8\n1800.000001,20,-8\n3600,20,-8\n"


@pytest.mark.slow
@pytest.mark.parametrize("row", [1, 5, 10])
def test_recovery_of_a_simulated_wave_at_long_rows(tmp_path, ask, row):
    """Split, anisotropy and their axes come back from rows in which 4θ turns by half a radian to five."""
    lines = CARD.replace("split_mHz = 0.0", "split_mHz = 3.0") + "frequency_axis_deg = -12.0\n"
    simulated(tmp_path, lines, f"time_s,chamber_temperature_degC,rate_deg_per_s\n{JUMP}", noise=True, row=row)
    words = [str(tmp_path / "run.csv"), "--card", str(tmp_path / "card.toml"), "--confidence", "0.997"]
    told = ask(["fit", "whole-angle", *words])["estimates"]
    planted = {"loop.frequency_split_mHz": 3.0, "loop.frequency_axis_deg": -12.0, "bias.damping_anisotropy": 0.03}
    for key, value in (planted | {"bias.damping_axis_deg": 10.0}).items():
        assert told[key]["low"] < value < told[key]["high"], key
        assert told[key]["high"] - told[key]["low"] < 0.2 * abs(value), key


@pytest.mark.parametrize("row", [1, 10, 100])
def test_limits_a_pulse_between_rows_turns_the_wave_by_its_integral(tmp_path, row):
    """θ = k ∫ Ω dt with 10 °/s from 22 to 27 s, as jumps of 1 ms and inside a row; the row's rate is its mean, and its angle the sum of its rates."""
    pulse = "time_s,chamber_temperature_degC,rate_deg_per_s\n0,20,0\n22,20,0\n22.001,20,10\n27,20,10\n27.001,20,0\n200,20,0\n"
    lines = CARD.replace("0.03", "0.0")
    _, record = simulated(tmp_path, lines, pulse, row=row)
    turned = record["pattern_angle_deg"]
    k = turned[-1] / 50.0
    assert k == pytest.approx(K, rel=1e-3)
    assert np.diff(turned) == pytest.approx(k * row * record["measured_rate_deg_per_s"][:-1], abs=1e-6)
    assert record["rate_deg_per_s"][:-1].sum() * row == pytest.approx(50.0, rel=1e-9)
    held = CARD.replace('mode = "whole-angle"\n', "").replace("0.03", "0.0")
    _, record = simulated(tmp_path, held, pulse, row=row)  # force to rebalance: the same means
    assert record["measured_rate_deg_per_s"].sum() * row == pytest.approx(50.0, abs=1e-4)


def test_a_drive_that_brakes_is_no_negative_loss(tmp_path):
    """Under self-precession p, pick-offs of unequal gain ask for 1/Q ± δ n p/ω of drive, here less than nothing at times."""
    lines = CARD.replace("1e-6", "1e-7") + "self_precession_deg_per_s = 2.0\npickoff_gain_ratio = 0.05\n"
    _, record = simulated(tmp_path, lines, "time_s,chamber_temperature_degC\n0,20\n600,20\n", row=1)
    swing = 0.05 * 2 * np.radians(2.0) / (2 * np.pi * record["frequency_Hz"][0])
    assert record["inverse_q"].min() == pytest.approx(1e-7 - swing, abs=0.03 * swing)
    assert record["inverse_q"].max() == pytest.approx(1e-7 + swing, abs=0.03 * swing)


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
    X, f = (X[1:] + X[:-1]) / 2, noisy["frequency_Hz"][:-1]  # means to the next row, in which the wave hardly turns
    b, left, *_ = np.linalg.lstsq(X, f, rcond=None)
    assert np.hypot(*b[1:]) == pytest.approx(2.5e-3, rel=1e-3)
    assert np.sqrt(left[0] / len(f)) < 1e-3 * 2.5e-3
