"""A card with loops, and drives that are commanded, in `hrg simulate`: bias, quadrature and 1/Q are those of the formulas."""

import numpy as np
import pytest

from studies.cli import main
from studies.instrument.card import load_card, shipped_cards
from studies.record import read_record

SCHEDULE = """time_s,chamber_temperature_degC,electrode_bias_V,pattern_angle_deg
0,20,0,22.5
600,20,0,22.5
601,20,100,22.5
1200,20,100,22.5
1201,20,100,11.25
1800,20,100,11.25
"""


def simulated(tmp_path, card_lines, words=None):
    card, out, schedule = tmp_path / "card.toml", tmp_path / "run.csv", tmp_path / "schedule.csv"
    card.write_text(shipped_cards()["free-dome"].read_text() + card_lines)
    schedule.write_text(SCHEDULE)
    assert main(["simulate", str(card), words or str(schedule), "--out", str(out), "--noiseless", "--row", "10"]) == 0
    return load_card(card), read_record(out)


def test_commands_move_the_drives(tmp_path, capsys):
    lines = '\n[[effect]]\nname = "electrostatic-softening"\nsoftening_Hz_per_V2 = 1e-6\n'
    _, record = simulated(tmp_path, lines)
    assert "does not act" not in capsys.readouterr().err
    t, f = record["time_s"], record["frequency_Hz"]
    # −k V²: 100 V at 1e-6 Hz/V²
    assert f[t == 1000][0] - f[t == 300][0] == pytest.approx(-0.01, abs=1e-6)
    assert record["electrode_bias_V"][t == 1000][0] == pytest.approx(100)
    # sin 4θ: 22.5° is its maximum, 11.25° half of the square
    bias = record["bias_deg_per_h"]
    assert bias[t == 1700][0] / bias[t == 1000][0] == pytest.approx(np.sqrt(0.5), rel=1e-4)


def test_bias_quadrature_and_loss_come_from_the_loops(tmp_path, capsys):
    lines = """
[bias]
damping_anisotropy = 0.02
offset_deg_per_h = 1.0

[loop]
frequency_split_mHz = 4.0
frequency_axis_deg = 5.0
drive_phase_deg = 0.2
quadrature_V_per_Hz = 10.0
"""
    card, record = simulated(tmp_path, lines)
    f, theta = record["frequency_Hz"][0], np.radians(22.5)
    k = 0.2785  # of the solid dome, h/R = 0.06
    held = 4e-3 * np.sin(4 * (theta - np.radians(5.0)))  # of the split, Hz
    decay = np.pi * f * card.loss.inverse_q
    rate = (0.02 * decay / 2 - np.radians(0.2) * np.pi * held) / (2 * k)
    assert record["bias_deg_per_h"][0] == pytest.approx(1.0 + np.degrees(rate) * 3600, rel=0.02)
    assert record["quadrature_V"][0] == pytest.approx(10.0 * held, rel=1e-3)
    assert record["inverse_q"][0] == pytest.approx(card.loss.inverse_q, rel=1e-3)
    turned = record["time_s"] == 1700
    held = 4e-3 * np.sin(4 * np.radians(11.25 - 5.0))
    assert record["quadrature_V"][turned][0] == pytest.approx(10.0 * held, rel=1e-3)


def test_a_hole_in_a_schedule_is_refused(tmp_path, refuse):
    path = tmp_path / "schedule.csv"
    path.write_text(SCHEDULE.replace("600,20,0,22.5", "600,20,,22.5"))
    assert "electrode_bias_V has empty cells" in refuse(
        ["simulate", "free-dome", str(path), "--out", str(tmp_path / "run.csv")]
    )


def test_a_planned_run_moves_the_commanded_drives(tmp_path):
    from studies.planning.plan import simulate_plan

    path = tmp_path / "schedule.csv"
    path.write_text(SCHEDULE)
    commanded, plain = simulate_plan(load_card("free-dome"), [str(path), "soak 20 30min"])
    assert "electrode_bias_V" not in plain
    assert commanded["electrode_bias_V"].max() == pytest.approx(100.0)
    assert commanded["pattern_angle_deg"].min() == pytest.approx(11.25)
