"""A card with loss parts: its simulation reads 1/Q from the budget, and the bias from the parts that vary around."""

import numpy as np
import pytest
import tomli_w

from studies.cli import main
from studies.instrument.card import build_instrument
from studies.instrument.tables.bias import Bias
from studies.loss.damping_law import damping_law, settled_loss
from studies.loss.model import loss_model
from studies.record import read_record
from studies.simulation.virtual_gyro import simulate_run
from thermal.profile import Profile

BARE = {
    "schema": "hrg.card/1",
    "name": "dome",
    "resonator": {"shape": "hemisphere", "radius_mm": 15.0, "thickness_mm": 0.9},
    "material": {"name": "fused-silica"},
}
GOLD = {"material": "gold", "thickness_nm": 100.0, "loss": 1e-4, "anisotropy": 0.02, "anisotropy_angle_deg": 10.0}
PARTS = BARE | {"loss": {"film": [GOLD], "activated": [{"height": 5e-9, "energy_eV": 0.5, "peak_degC": 60.0}]}}


@pytest.mark.parametrize(("quality", "drift"), [(1e7, 2.592), (1e6, 25.92)])
def test_drift_of_one_per_cent(quality: float, drift: float) -> None:
    """Notes on imperfection, loss and loops, section 4: Δ(1/τ) of 1 %, k = 0.277, 4432 Hz, as a wave and as the table's keys."""
    at = (np.zeros(1), np.zeros(1), np.array([4432.0]), np.array([1 / quality]), 0.277)
    wave = np.array([0.01 / quality]) * np.exp(4j * np.radians(30.0))
    assert Bias(pattern_angle_deg=52.5).at(*at, wave=wave)[0] == pytest.approx(drift, rel=2e-4)
    assert Bias(damping_axis_deg=30.0, pattern_angle_deg=52.5).at(*at)[0] == pytest.approx(drift, rel=2e-4)


@pytest.mark.slow
def test_loss_and_bias_of_a_run_come_from_the_parts() -> None:
    card = build_instrument(PARTS)
    profile = Profile(np.array([0.0, 3600.0, 40000.0]), np.array([293.15, 333.15, 333.15]))
    run = simulate_run(card, profile, rate=0.01, noise=False).record.columns
    model = loss_model(card)
    T = run["resonator_temperature_degC"] + 273.15
    budget = model.budget(T)
    assert run["inverse_q"] == pytest.approx(budget.inverse_q, rel=1e-5)
    assert run["inverse_q"][-1] > run["inverse_q"][0] + 3e-9  # the activated peak
    wave = model.wave(budget)
    bias = Bias().at(
        np.zeros(len(T)), np.zeros(len(T)), run["frequency_Hz"], budget.inverse_q, model.bryan_factor, wave=wave
    )
    assert run["bias_deg_per_h"] == pytest.approx(bias, rel=1e-4)
    bare = simulate_run(build_instrument(BARE), profile, rate=0.01, noise=False).record.columns
    assert bare["inverse_q"][0] == pytest.approx(1e-7, rel=1e-6)  # the polynomial of a card without parts


def test_a_card_without_parts_has_no_damping_law() -> None:
    assert damping_law(build_instrument(BARE), 270.0, 320.0) is None
    plain = damping_law(build_instrument(BARE | {"loss": {"pressure_Pa": 1e-3}}), 270.0, 320.0)
    assert plain is not None
    assert plain.wave is None


def test_loops_without_errors_hold_the_drift_of_the_parts() -> None:
    """With a table [loop] whose errors are 0 the bias is the same Δ(1/τ)/(2 n k) sin 2n(θ − θ_τ), here of the parts."""
    profile = Profile(np.array([0.0, 3600.0, 10000.0]), np.array([293.15, 303.15, 303.15]))
    split = {"frequency_split_mHz": 0.0}
    one, two = (
        simulate_run(build_instrument(card), profile, rate=0.01, noise=False).record.columns
        for card in (PARTS, PARTS | {"loop": split})
    )
    assert two["bias_deg_per_h"] == pytest.approx(one["bias_deg_per_h"], rel=1e-3, abs=1e-4)
    inverse_q, there = settled_loss(build_instrument(PARTS), 293.15)
    assert inverse_q == pytest.approx(one["inverse_q"][0], rel=1e-6)
    assert there.bias.damping_axis_deg == pytest.approx(10.0, abs=0.5)


@pytest.mark.slow
def test_a_run_through_the_loops_takes_the_anisotropy_at_its_temperature(tmp_path, capsys) -> None:
    """The peak at 60 °C damps all patterns alike: Δ(1/τ) is the film's alone, as hrg simulate has it, and no share of 1/Q."""
    card, out = tmp_path / "card.toml", [str(tmp_path / f"{k}.csv") for k in range(2)]
    loss = {"film": [GOLD], "activated": [{"height": 5e-8, "energy_eV": 0.5, "peak_degC": 60.0}]}
    tables = {"loss": loss, "loop": {"frequency_split_mHz": 0.0}}
    card.write_text(tomli_w.dumps(BARE | tables), encoding="utf-8")
    profile = "soak 20 10min then ramp 20 60 120 then soak 60 100min"
    assert main(["loop", str(card), "--profile", profile, "--row", "60", "--noiseless", "--out", out[0]]) == 0
    assert main(["simulate", str(card), profile, "--row", "60", "--noiseless", "--out", out[1]]) == 0
    capsys.readouterr()
    loops, settled = (read_record(path) for path in out)
    assert settled["inverse_q"][-1] > 1.3 * settled["inverse_q"][0]
    size = np.abs(settled["bias_deg_per_h"]).mean()
    assert loops["bias_deg_per_h"][5:-5] == pytest.approx(settled["bias_deg_per_h"][5:-5], abs=5e-3 * size)
