"""The loop twin against closed forms and against the carrier, every cycle of it."""

from dataclasses import replace

import numpy as np
import pytest

from compensation.actuators import Actuators
from compensation.applied_rate import AppliedRate
from compensation.closed_loop import ClosedLoop
from compensation.controllers import Loops, find_margins
from compensation.electronics import Channels, Electronics, LoopNoise, thermal_noise
from compensation.errors import CompensationError
from compensation.rebalance import close_loops, settle_rebalance, simulate_rebalance
from compensation.start_up import start_up
from compensation.wave import from_quality
from compensation.whole_angle import simulate_whole_angle
from tests.compensation.carrier import simulate_carrier

DEG_PER_H = np.degrees(1.0) * 3600
ERRORS = Electronics(Channels(0.01, 0.002, 0.003, 0.001, 0.01), Channels(-0.02, 0.001, 0.002, 0.0005, 0.02))
STIFF = replace(ERRORS, actuators=Actuators(quadrature="stiffness"))
FREQUENCY = 4432.07
SAMPLE = 8 / FREQUENCY
FAST = Loops(8.0, 15.0, 15.0, 10.0, sampling=1 / SAMPLE, delay=SAMPLE, demodulator=100.0)


@pytest.mark.parametrize(("quality", "drift"), [(1e5, 259.2), (1e6, 25.92), (1e7, 2.592)])
def test_damping_anisotropy_becomes_bias(quality, drift):
    """1 % of 1/τ at 4432 Hz, k = 0.277: Ω_d = Δ(1/τ)/(4 k) at 22.5° from its axis, held and free."""
    wave = from_quality(4432.0, quality, damping_anisotropy=0.01)
    time = np.arange(0.0, 20.0)
    held = simulate_rebalance(wave, Electronics(), Loops(), time, angle=np.pi / 8)
    assert held.rate[-1] * DEG_PER_H == pytest.approx(drift, rel=1e-3)
    assert held.decay[-1] == pytest.approx(np.pi * 4432.0 / quality, rel=1e-6)
    free = simulate_whole_angle(wave, Electronics(), Loops(), time, angle=np.pi / 8)
    assert free.rate[0] * DEG_PER_H == pytest.approx(drift, rel=1e-2)


@pytest.mark.parametrize("quality", [1e5, 1e6, 1e7])
@pytest.mark.parametrize("ratio", [15.041 / 2.592, 1.2, 0.5])
def test_mean_rate_and_dead_zone_of_a_free_wave(quality, ratio):
    """√(Ω² − Ω_d²): 14.816 °/h of 15.041 at Ω_d = 2.592; nothing below the threshold, where the wave locks."""
    wave = from_quality(4432.0, quality, damping_anisotropy=0.01)
    threshold = wave.damping_split / (2 * wave.coupling)
    rate = ratio * threshold
    mean = np.sqrt(max(ratio**2 - 1, 0)) * threshold
    # One turn of sin 4θ is 90° of azimuth; a locked wave settles in a few of its own time constants.
    seconds = np.pi / 2 / (wave.bryan_factor * mean) if mean else 20 / (wave.coupling * threshold)
    loops = Loops(sampling=1000.0)
    step = max(round(seconds / 400, 3), 1e-3)
    time = step * np.arange(round(seconds / step) + 1)
    run = simulate_whole_angle(wave, Electronics(), loops, time, rate=rate)
    turned = run.angle[-1] - (run.angle[0] if mean else run.angle[3 * len(time) // 4])
    found = turned / wave.bryan_factor / time[-1]
    assert found == pytest.approx(mean, rel=1e-2, abs=1e-6 * threshold)


@pytest.mark.parametrize("row", [0.5, 1.0, 10.0])
def test_a_pulse_between_rows_acts_by_its_integral(row):
    """From 22 s 5 s of 10 °/s and a line back, corners between samples: ∫ Ω dt = 0.1745 (5.25000 + ½ 0.36) turns a free wave and is what force to rebalance says."""
    corners = np.array([22.00037, 22.00037, 27.25037, 27.61037])
    pulse = AppliedRate(corners, np.radians([0.0, 10.0, 10.0, 0.0]))
    integral, time = np.radians(10.0) * (5.25 + 0.18), row * np.arange(round(60 / row) + 1)
    wave = from_quality(4432.0, 1e7)
    assert pulse.means(time)[:-1].sum() * row == pytest.approx(integral, rel=1e-12)
    assert np.all(pulse.means(time) <= pulse.largest(time) + 1e-12)
    assert pulse.largest(time).max() == np.radians(10.0)
    free = simulate_whole_angle(wave, Electronics(), Loops(), time, rate=pulse)
    assert np.ptp(free.angle) == pytest.approx(wave.bryan_factor * integral, rel=1e-9)
    assert free.rate == pytest.approx(pulse.means(time), abs=1e-9)
    held = simulate_rebalance(wave, Electronics(), Loops(), time, rate=pulse)
    assert held.rate.sum() * row == pytest.approx(integral, rel=1e-6)
    steady = AppliedRate(np.array([0.0, 22.00037, 60.0]), np.full(3, 1e-3))  # cut rows that nothing bends
    plain, cut = (simulate_rebalance(wave, ERRORS, Loops(), time, rate=one, angle=0.3) for one in (1e-3, steady))
    assert cut.rate == pytest.approx(plain.rate, abs=1e-12)


@pytest.mark.parametrize(("electronics", "within"), [(ERRORS, 2e-3), (STIFF, 3e-3)], ids=["force", "stiffness"])
def test_every_error_of_the_electronics_against_the_carrier(electronics, within):
    """Q = 1000, all errors at once, a step of rate: the commands of the averaged loops follow those of the carrier.

    The spring K_c x that may null the quadrature couples the two patterns in every cycle.
    """
    wave = from_quality(
        FREQUENCY, 1e3, damping_anisotropy=0.01, damping_axis=0.1, frequency_split=0.5, frequency_axis=0.4
    )
    true = simulate_carrier(wave, electronics, FAST, 1.6, rate=0.5, rate_from=0.8, angle=0.2)
    time = SAMPLE * np.arange(len(true.time))
    rate = np.where(time >= 0.8 - 1e-12, 0.5, 0.0)
    # The demodulated sample of the carrier is a mean over one interval, half of it old.
    averaged = simulate_rebalance(wave, electronics, replace(FAST, delay=1.5 * SAMPLE), time, rate=rate, angle=0.2)
    before, after = int(0.75 / SAMPLE), len(time) - 1
    for row in (before, after):
        assert averaged.rate[row] == pytest.approx(true.rate[row], abs=2e-3)
        assert averaged.quadrature[row] == pytest.approx(true.quadrature[row], rel=within)
        assert averaged.decay[row] == pytest.approx(true.decay[row], rel=2e-3)
        assert averaged.omega[row] == pytest.approx(true.omega[row], abs=0.02)
    moving = slice(int(0.8 / SAMPLE), int(1.1 / SAMPLE))
    assert np.max(np.abs(averaged.rate[moving] - true.rate[moving])) < 0.01 * 0.5


@pytest.mark.parametrize(
    ("precession", "electronics"), [(0.5, ERRORS), (-0.5, ERRORS), pytest.param(0.5, STIFF, marks=pytest.mark.slow)]
)
def test_a_turning_wave_with_every_error_against_the_carrier(precession, electronics):
    """Whole angle at Q = 1000: what damping and electronics do to the angle, some 0.1 rad, within 2 % of the carrier."""
    wave = from_quality(
        FREQUENCY, 1e3, damping_anisotropy=0.02, damping_axis=0.1, frequency_split=0.3, frequency_axis=0.4
    )
    loops = Loops(15.0, 15.0, 15.0, 15.0, sampling=1 / SAMPLE, delay=SAMPLE, demodulator=100.0)
    true = simulate_carrier(wave, electronics, loops, 4.0, rate=0.3, angle=0.2, precession=precession)
    time = 4 * SAMPLE * np.arange(len(true.time) // 4)
    averaged = simulate_whole_angle(
        wave, electronics, replace(loops, delay=1.5 * SAMPLE), time, rate=0.3, angle=0.2, precession=precession
    )
    ideal = 0.2 + (precession + 0.3 * wave.bryan_factor) * time
    late = time > 0.5
    carrier = np.interp(time, true.time - SAMPLE / 2, true.angle)
    assert np.ptp((carrier - ideal)[late]) > 0.05
    assert np.ptp((averaged.angle - carrier)[late]) < 0.02 * np.ptp((carrier - ideal)[late])
    for name in ("quadrature", "decay"):
        said, seen = getattr(averaged, name)[late], np.interp(time, true.time, getattr(true, name))[late]
        assert np.max(np.abs(said - seen)) < 0.02 * np.ptp(seen)


def test_free_and_held_wave_show_the_same_bias():
    wave = from_quality(4432.0, 1e5, damping_anisotropy=0.02, damping_axis=0.3, frequency_split=0.01)
    time = np.arange(0.0, 30.0)
    for angle in (0.1, 0.5, 1.2):
        held = simulate_rebalance(wave, ERRORS, Loops(), time, angle=angle)
        free = simulate_whole_angle(wave, ERRORS, Loops(), time[:2], angle=angle)
        # Pick-offs that err by a per cent hold the wave, and read it, at another azimuth: second order.
        assert free.rate[0] == pytest.approx(held.rate[-1], abs=0.02 * 0.01 * np.pi * 4432 / 1e5 / wave.coupling + 3e-5)


def test_closed_form_of_the_bias():
    """What the docstring of `rebalance` says, to first order in the errors."""
    wave = from_quality(4432.0, 1e6, damping_anisotropy=0.01, frequency_split=0.02, frequency_axis=0.5)
    electronics = Electronics(Channels(1e-3, 0.0, 2e-3, 1e-3, 3e-3), Channels(5e-4, 0.0, -1e-3, 5e-4, 2e-3))
    angle, time = 0.2, np.arange(0.0, 10.0)
    run = simulate_rebalance(wave, electronics, Loops(), time, rate=1e-4, angle=angle)
    leak = 2 * (5e-4 - 1e-3) - 1.5e-3 / 2 * np.sin(4 * angle) + 1e-3 / 2 * np.cos(4 * angle)
    expected = 1e-4 + wave.drift(angle) + (leak / wave.tau - 5e-3 * wave.quadrature(angle)) / wave.coupling
    assert run.rate[-1] == pytest.approx(expected, rel=0.01)


def test_angle_random_walk_of_thermal_noise():
    """A rate loop hides nothing of it: σ/(n k) per √s, Leland (2001) and others; 4000 rows of 1 s."""
    wave = from_quality(4432.0, 1e6)
    level = thermal_noise(wave, 293.0, 1e-4, 1e-7)
    electronics = Electronics(noise=LoopNoise(thermal=level))
    run = simulate_rebalance(wave, electronics, Loops(), np.arange(0.0, 4000.0), generator=np.random.default_rng(3))
    assert np.std(run.rate) == pytest.approx(level / wave.coupling, rel=0.05)


@pytest.mark.slow
def test_quantisation_is_the_noise_that_is_said():
    """Rounded samples and commands of the carrier against white noise of step²/12 in the averaged loop."""
    wave = from_quality(FREQUENCY, 1e3)
    electronics = Electronics(noise=LoopNoise(pickoff=3e-5, adc_step=2e-3))
    true = simulate_carrier(wave, electronics, FAST, 12.0, generator=np.random.default_rng(1)).rate[1000:]
    time = SAMPLE * np.arange(6000)
    said = simulate_rebalance(
        wave, electronics, replace(FAST, delay=1.5 * SAMPLE), time, generator=np.random.default_rng(2)
    ).rate
    assert np.std(said[1000:]) == pytest.approx(np.std(true), rel=0.1)


def test_margins_and_instability():
    loops = Loops(rate=20.0)
    (margin,) = find_margins(loops, 1e-3, ("rate",))
    # At the reversal the loop turns its input around, at the crossover it has gain one.
    assert loops.open_loop("rate", 1e-3, margin.reversal).real * margin.gain == pytest.approx(-1, abs=1e-3)
    assert abs(loops.open_loop("rate", 1e-3, margin.crossover)) == pytest.approx(1, abs=1e-6)
    # Margins end where the poles of the sampled loop leave the unit circle.
    for bandwidth in np.linspace(80.0, 160.0, 9):
        for delay in (0.0, 0.6e-3, 1e-3, 2.3e-3):
            fast = Loops(rate=bandwidth, delay=delay)
            one = ClosedLoop(-1e-3 * np.eye(2, dtype=complex), np.eye(2), np.eye(2), fast, Electronics())
            kept = one.places["sent"].stop
            poles = np.abs(np.linalg.eigvals(one.sample[0][:kept, :kept]))
            assert find_margins(fast, 1e-3, ("rate",))[0].stable == (poles.max() < 1)
    with pytest.raises(CompensationError, match=r"rate loop \(GR\) is unstable: gain margin -"):
        simulate_rebalance(from_quality(4432.0, 1e6), Electronics(), Loops(rate=200.0), np.arange(0.0, 5.0))


def test_what_cannot_be_simulated_is_refused():
    wave = from_quality(4432.0, 1e6)
    with pytest.raises(CompensationError, match="not a whole number of the loops' samples"):
        simulate_rebalance(wave, Electronics(), Loops(), 0.0015 * np.arange(5))
    with pytest.raises(CompensationError, match="undamped"):
        from_quality(4432.0, 1e6, damping_anisotropy=2.0)
    with pytest.raises(CompensationError, match="positive frequency"):
        Loops(rate=0.0)


@pytest.mark.parametrize("electronics", [ERRORS, STIFF], ids=["force", "stiffness"])
def test_settled_loops_are_where_the_simulation_comes_to_rest(electronics):
    wave = from_quality(
        4432.0, 1e5, damping_anisotropy=0.02, damping_axis=0.3, frequency_split=0.01, frequency_axis=0.2
    )
    run = simulate_rebalance(wave, electronics, Loops(), np.arange(0.0, 40.0), rate=1e-3, angle=0.3)
    settled = settle_rebalance(wave, electronics, 1e-3, 0.3)
    for name in ("rate", "quadrature", "decay"):
        assert getattr(run, name)[-1] == pytest.approx(getattr(settled, name)[0], rel=1e-6)
    assert run.omega[-1] - wave.omega == pytest.approx(settled.omega[0] - wave.omega, rel=1e-5)


@pytest.mark.parametrize(("name", "channel"), [("amplitude", 0), ("rate", 2), ("quadrature", 3)])
def test_answer_to_a_step_is_the_recursion_of_the_controllers(name, channel):
    """Held plant, low pass and PI of the docstring of `controllers`, stepped one by one, the command one sample late."""
    wave, loops = from_quality(4432.0, 1e5), Loops(delay=1e-3)
    loop, _ = close_loops(wave, Electronics(), loops, 0.0, 0.3)
    time, answer = loop.answer_step(name, 5, 200)
    K, K_i = loops.gains(name)
    T, decay, x, y, integral, waiting, found = loops.step, 1 / wave.tau, 0.0, 0.0, 0.0, [0.0, 0.0], [0.0]
    for _ in range(1000):
        y += loops.smoothing * (x - y)
        u = -(K * y + integral)
        integral += K_i * T * y
        waiting = [u, *waiting[:-1]]
        x = x * np.exp(-decay * T) + (1 - np.exp(-decay * T)) / decay * (1.0 + waiting[-1])
        found.append(-u)
    assert time[1] == pytest.approx(5e-3)
    assert answer == pytest.approx(np.array(found)[::5], abs=1e-9)
    assert answer[-1] == pytest.approx(1.0, abs=0.1 if name == "amplitude" else 1e-3)


def test_start_at_full_drive_takes_what_the_closed_form_says():
    """A limited drive reaches the amplitude after τ ln(N/(N − 1)), N the headroom: 14.5 s at Q = 1e7, N = 50."""
    tau = 1e7 / np.pi / 4432
    run = start_up(tau, Loops(), headroom=50.0, offset=10.0)
    assert run.ready == pytest.approx(tau * np.log(50 / 49), rel=0.03)
    assert run.locked < 1.0
    assert run.offset[-1] == pytest.approx(10.0, rel=1e-3)
    with pytest.raises(CompensationError, match="it must exceed 1"):
        start_up(tau, Loops(), headroom=0.9)
