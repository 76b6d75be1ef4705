"""Limits of the actuators, and quadrature nulled by a stiffness: against closed forms and, saturated, against the carrier."""

from dataclasses import replace

import numpy as np
import pytest

from compensation.actuators import Actuators
from compensation.controllers import Loops
from compensation.electronics import Channels, Electronics
from compensation.errors import CompensationError
from compensation.rebalance import settle_rebalance, simulate_rebalance
from compensation.wave import from_quality
from compensation.whole_angle import simulate_whole_angle
from tests.compensation.carrier import simulate_carrier
from tests.compensation.test_limits_loops import ERRORS, FAST, FREQUENCY, SAMPLE


def test_rate_and_quadrature_share_one_force():
    """Ω = 0.6 and ½ Δω sin = 0.8 of the range are all of it, √(0.6² + 0.8²) = 1; a stiffness leaves the force to the rate."""
    force = 1.0
    wave = from_quality(4432.0, 1e7, frequency_split=0.8 * 2 * force / (2 * np.pi))
    electronics = Electronics(actuators=Actuators(force=force))
    run = settle_rebalance(wave, electronics, 0.6 * force / wave.coupling, np.pi / 8)
    use = electronics.actuators.use(wave.coupling * run.rate, run.quadrature, run.decay)
    assert (use.rate[0], use.quadrature[0], use.across[0]) == pytest.approx((0.6, 0.8, 1.0), rel=1e-6)
    stiff = replace(electronics, actuators=Actuators(force=force, stiffness=2.0, quadrature="stiffness"))
    run = settle_rebalance(wave, stiff, 0.6, np.pi / 8)
    use = stiff.actuators.use(wave.coupling * run.rate, run.quadrature, run.decay)
    assert (use.quadrature[0], use.across[0]) == pytest.approx((0.4, 0.6 * wave.coupling), rel=1e-6)


@pytest.mark.parametrize(("part", "held"), [(0.99, True), (1.01, False)])
def test_a_steady_rate_is_held_up_to_the_range_and_refused_beyond(part, held):
    wave = from_quality(4432.0, 1e6)
    electronics = Electronics(actuators=Actuators(force=0.5))
    rate = part * 0.5 / wave.coupling
    if held:
        run = simulate_rebalance(wave, electronics, Loops(), np.arange(0.0, 5.0), rate=rate)
        assert run.rate[-1] == pytest.approx(rate, rel=1e-9)
    else:
        with pytest.raises(CompensationError, match=r"101 % of the actuators' range"):
            simulate_rebalance(wave, electronics, Loops(), np.arange(0.0, 5.0), rate=rate)


def overload(most: float) -> tuple[np.ndarray, np.ndarray, float, float]:
    """A rate of three halves of the range for 0.1 s: rows of one sample, the true rate, n k, the range as a rate."""
    wave = from_quality(4432.0, 1e6)
    loops = Loops()
    time = loops.step * np.arange(1500)
    excess = 1.5 * most / wave.coupling
    rate = np.where((time > 0.2) & (time <= 0.3), excess, 0.0)
    run = simulate_rebalance(wave, Electronics(actuators=Actuators(force=most)), loops, time, rate=rate)
    assert 80 < run.limited < 400
    return time, run.rate, wave.coupling, most / wave.coupling


def test_an_overload_clips_turns_the_wave_and_is_turned_back():
    """What is indicated stays within the range; its integral is the whole turn, for what was not held is turned back later."""
    most = 0.5
    time, said, _, limit = overload(most)
    assert np.max(np.abs(said)) == pytest.approx(limit, rel=1e-12)
    assert np.trapezoid(said, time) == pytest.approx(1.5 * limit * 0.1, rel=2e-3)
    assert abs(said[-1]) < 1e-4 * limit


def test_a_wave_that_its_force_cannot_hold_is_lost():
    wave = from_quality(4432.0, 1e6)
    time = np.arange(0.0, 10.0)
    rate = np.where(time > 3, 3.0, 0.0) * 0.5 / wave.coupling
    with pytest.raises(CompensationError, match="the wave is lost"):
        simulate_rebalance(wave, Electronics(actuators=Actuators(force=0.5)), Loops(), time, rate=rate)


def test_a_free_wave_needs_the_force_for_quadrature_and_commanded_turn():
    wave = from_quality(4432.0, 1e6, frequency_split=0.2)
    time = 0.01 * np.arange(200)
    for force, fits in ((0.7, True), (0.6, False)):
        electronics = Electronics(actuators=Actuators(force=force))
        if fits:
            simulate_whole_angle(wave, electronics, Loops(), time, precession=0.05, angle=np.pi / 8)
        else:
            with pytest.raises(CompensationError, match="the wave cannot be held"):
                simulate_whole_angle(wave, electronics, Loops(), time, precession=0.05, angle=np.pi / 8)


def test_saturated_loops_against_the_carrier():
    """Q = 1000, every error, a rate of 1.3 times the range that sets in at 0.8 s and ends at 0.9 s: the commands of both agree."""
    wave = from_quality(
        FREQUENCY, 1e3, damping_anisotropy=0.01, damping_axis=0.1, frequency_split=0.5, frequency_axis=0.4
    )
    rate = 1.3 * 2.0 / wave.coupling
    electronics = replace(ERRORS, actuators=Actuators(force=2.0))
    true = simulate_carrier(wave, electronics, FAST, 1.6, rate=rate, rate_from=0.8, rate_until=0.9, angle=0.2)
    time = SAMPLE * np.arange(len(true.time))
    applied = np.where((time >= 0.8 - 1e-12) & (time < 0.9 - 1e-12), rate, 0.0)
    averaged = simulate_rebalance(wave, electronics, replace(FAST, delay=1.5 * SAMPLE), time, rate=applied, angle=0.2)
    assert averaged.limited > 30
    late = time > 0.5
    for name in ("rate", "quadrature"):
        said, seen = getattr(averaged, name)[late], getattr(true, name)[late]
        assert np.max(np.abs(said - seen)) < 0.03 * np.ptp(seen)
    assert np.max(true.rate) > 0.9 * 2.0 / wave.coupling  # the rest of the force holds the quadrature


def test_quadrature_nulled_by_a_stiffness_leaks_no_rate():
    """−ε ½ Δω sin 2n(θ − θ_ω)/(n k) of a force is gone with a stiffness, to every order in the phase errors."""
    wave = from_quality(4432.0, 1e9, frequency_split=0.02, frequency_axis=0.5)
    phases = Electronics(Channels(phase=3e-3), Channels(phase=2e-3))
    angle = 0.2
    forced = settle_rebalance(wave, phases, 0.0, angle)
    assert forced.rate[0] == pytest.approx(-5e-3 * wave.quadrature(angle) / wave.coupling, rel=1e-3)
    nulled = settle_rebalance(wave, replace(phases, actuators=Actuators(quadrature="stiffness")), 0.0, angle)
    assert abs(nulled.rate[0]) < 1e-12 * abs(forced.rate[0])
    assert nulled.quadrature[0] == pytest.approx(wave.quadrature(angle), rel=1e-12)
