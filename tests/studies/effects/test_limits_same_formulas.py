"""An effect and the card's own part of the same physics say the same: one formula each, used by both."""

import numpy as np
import pytest

from compensation.cross_damping import evaluate_cross_damping, relate_cross_damping_to_rate_when_tuned, simulate_bias
from studies.effects import Lags, States, apply_effect
from studies.instrument.card import load_card
from studies.loss.damping_law import damping_law
from studies.resonator.splitting import reference_split
from studies.simulation.drive import Drive
from studies.simulation.prediction import law_for, predict
from studies.simulation.response import Temperatures, read_out
from thermal.profile import Profile

TIME = np.arange(0.0, 7200.0, 60.0)
HOUSING = 293.15 + 15.0 * np.sin(TIME / 1500.0)
DRIVE = Drive(TIME, "chamber", Profile(TIME, HOUSING))


@pytest.fixture(scope="module")
def card():
    return load_card("hrg-30mm")


@pytest.fixture(scope="module")
def law(card):
    return law_for(card, DRIVE)


def read(card, law, commands, damping=None):
    """Return what a card reads at given temperatures of its resonator."""
    value = np.stack([HOUSING, HOUSING, *np.zeros((4, len(TIME)))], axis=1)
    drive = Drive(TIME, "chamber", Profile(TIME, HOUSING), commands=commands)
    return read_out(card, law, drive, Temperatures(value, np.zeros_like(value)), Lags.one(1000.0), damping)


def states(**drives):
    return States(0, TIME, TIME, HOUSING, HOUSING, Lags.one(1000.0), 293.15, **drives)


def test_softening_is_that_of_the_cards_electrodes(card, law):
    volts = 100.0 + 50.0 * (TIME > 3600.0)
    charged = card.with_table("electrodes", {"gap_um": 100.0, "voltage_V": 100.0})
    stepped = read(charged, law, {"voltage_squared": volts**2})["frequency_Hz"]
    still = read(charged, law, {"voltage_squared": np.full_like(volts, 1e4)})["frequency_Hz"]
    whole = reference_split(charged)
    per_square_volt = charged.part("electrodes").on(whole.pair, 293.15).per_square_volt[0].sum()
    thermal = read(card, law, {})["frequency_Hz"]
    drives = (states(voltage_squared=v) for v in (volts**2, np.full_like(volts, 1e4)))
    size = -float(per_square_volt) / 2  # √(1 - 2 x) = 1 - x - x²/2 …
    sized = {"softening_Hz_per_V2": size, "narrowing_Hz_per_V4": size**2 / 2}
    moved, level = (apply_effect("electrostatic-softening", sized, one)[1] for one in drives)
    assert np.ptp(stepped - still) > 1e-3
    assert stepped - still == pytest.approx(thermal * (moved - level), rel=1e-6, abs=1e-9)


def test_turned_axis_is_that_of_the_cards_damping(card, law):
    """One azimuth after the other at one temperature: the axis stands."""
    angle = np.radians(np.where(TIME > 3600.0, 10.0, 35.0))
    plain = card.with_values({"bias.damping_anisotropy": 0.0, "loss.slope_per_K": 0.0})
    uneven = plain.with_values({"bias.damping_anisotropy": 0.02, "bias.damping_axis_deg": 12.0})
    value = np.tile([293.15, 293.15, 0.0, 0.0, 0.0, 0.0], (TIME.size, 1))
    drive = Drive(TIME, "chamber", Profile(TIME, np.full_like(TIME, 293.15)), commands={"pattern_angle": angle})
    found = Temperatures(value, np.zeros_like(value))
    with_it, without = (read_out(one, law, drive, found, Lags.one(1000.0)) for one in (uneven, plain))
    drift = with_it["bias_deg_per_h"] - without["bias_deg_per_h"]
    size = np.degrees(0.02 * np.pi * with_it["frequency_Hz"][0] * 1e-7 / (4 * law.bryan_factor)) * 3600.0
    axis = np.radians(12.0)
    parts = {"sine_deg_per_h": size * np.cos(4 * axis), "cosine_deg_per_h": -size * np.sin(4 * axis)}
    _, change = apply_effect("axis-rotation", {"rotation_deg_per_10K": 3.0, **parts}, still_states(angle))
    assert np.ptp(drift) > 1.0
    assert drift == pytest.approx(change, rel=1e-9)


def still_states(angle):
    level = np.full_like(TIME, 293.15)
    return States(0, TIME, TIME, level, level, Lags.one(1000.0), 293.15, pattern_angle=angle)


def test_axis_that_turns_with_temperature_is_an_axis_that_stands_elsewhere(card, law):
    """Heated by 10 K the effect is that of a card whose axis is further by its rotation."""
    angle = np.radians(np.linspace(0.0, 45.0, TIME.size))
    warm = np.full_like(TIME, 303.15)
    sized = {"rotation_deg_per_10K": 3.0, "sine_deg_per_h": 2.0}
    turned = States(0, TIME, TIME, warm, warm, Lags.one(1000.0), 293.15, pattern_angle=angle)
    _, change = apply_effect("axis-rotation", sized, turned)
    assert change == pytest.approx(2.0 * np.sin(4 * (angle - np.radians(3.0))), rel=1e-12)


def test_leaked_quadrature_is_that_of_the_cards_loops(card, law):
    """A phase error in [loop] against the effect at the slope that it means; to first order in the phase."""
    angle = np.radians(np.linspace(0.0, 40.0, TIME.size))
    keys = {"frequency_split_mHz": 5.0, "quadrature_V_per_Hz": 10.0}
    exact, late = (
        read(card.with_table("loop", {**keys, "pickoff_phase_deg": phase}), law, {"pattern_angle": angle})
        for phase in (0.0, 0.2)
    )
    quadrature = late["quadrature_V"]
    seen = states(quadrature=quadrature)
    per_volt = -np.degrees(np.radians(0.2) * np.pi / (10.0 * 2 * law.bryan_factor)) * 3600.0
    _, change = apply_effect("quadrature-leakage", {"leakage_deg_per_h_per_V": float(per_volt)}, seen)
    found = late["bias_deg_per_h"] - exact["bias_deg_per_h"]
    assert np.ptp(found) > 1.0
    assert np.abs(found - change).max() < 5e-3 * np.ptp(found)


def test_loss_peak_is_an_activated_loss_of_the_cards_budget(card, law):
    peak, width, height = 8.0, 12.0, 3e-8
    energy = 8.617333262e-5 * (peak + 273.15) ** 2 / width
    parts = {"anchor_inverse_q": 1e-8}
    active = {**parts, "activated": [{"height": height, "energy_eV": energy, "peak_degC": peak}]}
    losses = []
    for table in (parts, active):
        budget = damping_law(card.with_table("loss", table), 270.0, 315.0)
        losses.append(budget.inverse_q(HOUSING))
    sized = {"temperature_degC": peak, "width_K": width, "peak_1": height}
    _, change = apply_effect("loss-peak", sized, states())
    assert losses[1] - losses[0] == pytest.approx(change, rel=2e-3, abs=2e-3 * height)


def test_leak_is_the_gas_of_the_cards_budget(card):
    """Gas of one pressure (exponent -1/2) after a day of leaking, against a card with that pressure."""
    parts, pressure = {"anchor_inverse_q": 1e-8}, 1e-4
    gassed = damping_law(card.with_table("loss", {**parts, "pressure_Pa": pressure}), 270.0, 315.0)
    empty = damping_law(card.with_table("loss", parts), 270.0, 315.0)
    gas = gassed.inverse_q(HOUSING) - empty.inverse_q(HOUSING)
    day = np.full_like(TIME, 86400.0)
    aged = States(0, TIME, day, HOUSING, HOUSING, Lags.one(1000.0), 293.15)
    level = gassed.inverse_q(np.array([293.15]))[0] - empty.inverse_q(np.array([293.15]))[0]
    _, change = apply_effect("leak", {"temperature_exponent": -0.5, "growth_1_per_day": float(level)}, aged)
    # stiffness and so ω follow the temperature in the budget: 85 ppm/K
    assert gas == pytest.approx(change, rel=2e-3)


def test_a_leak_fills_up():
    """p = τ (1 − e^(−t/τ)) at a constant temperature: after ln 2 of τ half of what the first rate would bring in τ; τ → ∞: t."""
    tau = 4.0e6
    still = np.full_like(TIME, 293.15)
    aged = States(0, TIME, np.full_like(TIME, tau * np.log(2.0)), still, still, Lags.one(1000.0), 293.15)
    sized = {"temperature_exponent": 0.5, "growth_1_per_day": 1e-9}
    _, half = apply_effect("leak", {**sized, "filling_s": tau}, aged)
    _, never = apply_effect("leak", sized, aged)
    _, late = apply_effect("leak", {**sized, "filling_s": 1e12}, aged)
    assert half == pytest.approx(0.5 * 1e-9 * tau / 86400.0, rel=1e-12)
    assert late == pytest.approx(never, rel=1e-5)


def test_cross_damping_goes_through_the_papers_filter():
    """ζ₁₂(T) of eq. (10) through eq. (9), whose time constant is 1/(kζ) and whose gain is 2k/g₂."""
    k, zeta, quartic, quintic = 50.0, 4e-4, 3e-7, -1e-8
    coefficients = [0.0, 0.0, 0.0, 0.0, quartic / 1e4, quintic / 1e5]
    rate = simulate_bias(TIME, evaluate_cross_damping(coefficients, HOUSING - 293.15), k, zeta)
    gain = np.real(relate_cross_damping_to_rate_when_tuned(k, zeta).steady_gain)
    sized = {"quartic_deg_per_h_per_10K4": quartic * gain, "quintic_deg_per_h_per_10K5": quintic * gain}
    shape = {"from_degC": 0.0, "to_degC": 40.0, "pole_s": 1.0 / (k * zeta), "axis_deg": -90.0}
    _, change = apply_effect("cross-damping", {**shape, **sized}, states())
    assert change == pytest.approx(rate, rel=1e-9, abs=1e-12 * np.abs(rate).max())


def test_an_effect_of_the_azimuth_counts_at_that_of_the_card(card):
    """A run that does not turn its wave has it where [bias] says."""
    hidden = {"name": "axis-rotation", "rotation_deg_per_10K": 0.0, "sine_deg_per_h": 3.0}
    turned = card.with_values({"bias.damping_anisotropy": 0.0, "bias.pattern_angle_deg": 10.0})
    at_rest = Drive(TIME, "chamber", Profile(TIME, np.full_like(TIME, 293.15)))
    bias = predict(turned.with_table("effect", [hidden]), at_rest).columns["bias_deg_per_h"]
    assert bias == pytest.approx(3.0 * np.sin(np.radians(40.0)), rel=1e-9)
