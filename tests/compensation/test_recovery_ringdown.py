"""Ring-downs of two coupled oscillators whose values are known: recovered, with intervals that hold, or warned of."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from compensation.errors import CompensationError
from compensation.ringdown.analysis import analyse_decay
from compensation.ringdown.envelope import even_rows, from_lock_in, mix_down
from compensation.ringdown.model import Decay, swing
from compensation.ringdown.spectrum import fit_spectrum
from compensation.ringdown.trace import analyse_trace
from tests.compensation.two_oscillators import Gyro, noisy

CARRIER = 7000.0
TIME = np.arange(0.0, 600.0, 1.0)


def draw_gyro(random):
    q = 1e7 * random.uniform(0.8, 1.2)
    return Gyro(
        CARRIER + 0.03 + random.uniform(-5e-3, 5e-3),
        CARRIER + 0.01,
        q * random.uniform(0.8, 0.97),
        q,
        random.uniform(0, np.pi / 2),
        random.uniform(0, np.pi / 2),
    )


def truth_of(gyro):
    values, _ = gyro.modes()
    C = gyro.matrices()[1]
    two_n = 2 * gyro.harmonic
    return {
        "frequency_1_Hz": values[0].imag / (2 * np.pi),
        "frequency_2_Hz": values[1].imag / (2 * np.pi),
        "q_1": -values[0].imag / (2 * values[0].real),
        "q_2": -values[1].imag / (2 * values[1].real),
        "split_Hz": gyro.upper - gyro.lower,
        "frequency_axis_deg": np.degrees(gyro.axis) % (360 / two_n),
        "damping_axis_deg": np.degrees(gyro.damping_axis) % (360 / two_n),
        "inverse_q": np.trace(C) / (2 * 2 * np.pi * (gyro.upper + gyro.lower) / 2),
    }


def ring(gyro, random, sd=0.006, time=TIME):
    amplitudes = random.uniform(0.3, 1, 2) * np.exp(2j * np.pi * random.uniform(0, 1, 2))
    return noisy(gyro.envelope(time, CARRIER, amplitudes), sd, random)


def misses(found, truth):
    """Deviations in standard deviations, and whether the 90 % interval holds each value."""
    z, held = {}, {}
    for name, value in truth.items():
        e = found.estimates[name]
        period = 45.0 * 2 if name.endswith("axis_deg") else np.inf
        away = value - e.value
        away = (away + period / 2) % period - period / 2 if np.isfinite(period) else away
        z[name] = away / e.sd
        held[name] = e.low - e.value <= away <= e.high - e.value
    return z, held


@pytest.mark.slow
def test_two_channels_reach_the_bound_and_their_intervals_hold():
    """7 kHz, Q = 1e7, split 15 to 25 mHz: within 1.3 of the Cramér–Rao bound."""
    random = np.random.default_rng(20)
    scores, held, split, q, axis = [], [], [], [], []
    for _ in range(8):
        gyro = draw_gyro(random)
        found = analyse_decay(from_lock_in(TIME, ring(gyro, random), CARRIER))
        truth = truth_of(gyro)
        z, inside = misses(found, truth)
        scores.append(list(z.values()))
        held.append(list(inside.values()))
        split.append(found.estimates["split_Hz"].value - truth["split_Hz"])
        q.append(found.estimates["inverse_q"].value / truth["inverse_q"] - 1)
        axis.append(z["frequency_axis_deg"] * found.estimates["frequency_axis_deg"].sd)
    assert np.sqrt(np.mean(np.square(scores))) < 1.3
    # 64 statements, of which some are about one thing: within two standard deviations of half as many
    assert 0.81 <= np.mean(held) <= 0.99
    assert np.max(np.abs(split)) < 1e-4
    assert np.max(np.abs(q)) < 0.01
    assert np.max(np.abs(axis)) < 1.0


def test_raw_samples_give_the_same_resonator():
    """20 kHz samples of a lossy resonator, with an offset, and one sample in fifty lost."""
    random = np.random.default_rng(3)
    gyro = Gyro(7003.2, 7000.9, 2.0e4, 2.3e4, 0.4, 1.1)
    time = np.arange(100_000) / 20_000
    samples = gyro.samples(time, [1.0, 0.7j]) + 0.3 + 0.05 * random.standard_normal((2, time.size))
    samples[:, random.random(time.size) < 0.02] = np.nan
    found = analyse_decay(mix_down(time, samples))
    z, _ = misses(found, truth_of(gyro))
    assert max(map(abs, z.values())) < 4
    assert found.estimates["split_Hz"].sd < 5e-4


def times(kind, random):
    """12 kHz for 2.5 s: with a part of the rows missing at random, known jitter, two bursts off one grid, two rates, or at random."""
    step = 1 / 12_000
    grid = step * np.arange(30_000)
    if kind == "jitter":
        grid += step * random.uniform(-0.3, 0.3, grid.size)
    elif kind == "bursts":
        grid[15_000:] += 0.5 + 0.3 * step
    elif kind == "rates":
        grid = np.append(grid[:15_000], grid[15_000::2])
    elif kind == "random":
        grid = np.sort(random.uniform(0, 2.5, grid.size))
    else:
        grid = grid[random.random(grid.size) >= kind]
    return np.round(grid, 9)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [0.1, 0.65, "bursts", "jitter", "rates", "random"])
def test_samples_at_uneven_times_give_the_same_resonator(kind):
    """Laid onto an even grid, 65 % missing gave 2546 Hz of 3000 Hz, a tenth lost the split, jitter a drift, bursts 500 sd."""
    scores, held = [], []
    for seed in range(2):
        random = np.random.default_rng(seed)
        gyro = Gyro(3001.0, 2999.2, 8e3, 9.3e3, random.uniform(0, 1.5), random.uniform(0, 1.5))
        time = times(kind, random)
        x = gyro.samples(time, random.uniform(0.3, 1, 2) * np.exp(2j * np.pi * random.uniform(size=2)))
        found = analyse_decay(mix_down(time, x + 0.1 + 5e-3 * random.standard_normal(x.shape)))
        z, inside = misses(found, truth_of(gyro))
        scores += z.values()
        held += inside.values()
        lost = [one for one in found.remarks if one.endswith("lost.")]
        assert not any(
            one.startswith(("Interference", "The frequency", "The first", "The residual")) for one in found.remarks
        )
        assert len(lost) == (kind not in ("jitter", "random"))
    assert np.sqrt(np.mean(np.square(scores))) < 1.35
    assert np.mean(held) >= 0.78


def test_times_written_with_few_digits_lose_no_samples():
    """48 kHz with times to 0.1 µs: the median step is 0.16 % short, yet frequency and decay time are those of the samples."""
    rng = np.random.default_rng(5)
    f, tau = 4432.1, 0.9
    time = np.arange(48_000) / 48e3
    samples = np.exp(-time / tau) * np.cos(2 * np.pi * f * time) + 1e-3 * rng.standard_normal(time.size)
    found = analyse_decay(mix_down(np.round(time, 7), samples))
    assert set(found.estimates) == {"frequency_Hz", "decay_time_s", "inverse_q"}, "one mode, and no image of it beside"
    for name, true in (("frequency_Hz", f), ("decay_time_s", tau)):
        one = found.estimates[name]
        assert abs(one.value - true) < 4 * one.sd + 1e-7 * true


def test_times_of_seven_digits_are_still_an_even_grid():
    """Beyond 10 s they stand in steps of 10 µs, half a row at 48 kHz."""
    time = np.arange(960_000) / 48e3
    step, rows = even_rows(np.round(time, 5))
    assert step == pytest.approx(1 / 48e3, rel=1e-6)
    np.testing.assert_allclose(rows, np.arange(960_000), rtol=1e-6, atol=1e-12)


def test_one_channel_tells_two_modes_but_no_axes():
    random = np.random.default_rng(4)
    gyro = draw_gyro(random)
    found = analyse_decay(from_lock_in(TIME, ring(gyro, random)[:1], CARRIER))
    truth = {
        name: value
        for name, value in truth_of(gyro).items()
        if name in ("frequency_1_Hz", "frequency_2_Hz", "q_1", "q_2")
    }
    z, _ = misses(found, truth)
    assert max(map(abs, z.values())) < 4
    assert "frequency_axis_deg" not in found.estimates


@pytest.mark.slow
def test_an_isotropic_resonator_has_no_axis_and_says_so():
    gyro, squares = Gyro(CARRIER, CARRIER, 1e7, 1e7, 0.3, 0.3), 0.0
    for seed in range(4):
        found = analyse_decay(from_lock_in(TIME, ring(gyro, np.random.default_rng(seed), sd=0.03), CARRIER))
        assert any("not resolved" in remark for remark in found.remarks)
        assert "frequency_axis_deg" not in found.estimates
        loss = found.estimates["inverse_q"]
        squares += ((loss.value - 1e-7) / loss.sd) ** 2
    assert 0.29 < squares < 13.3  # 98 % of χ² with 4 degrees of freedom


@pytest.mark.slow
@pytest.mark.parametrize(("axis", "said"), [(0.2, False), (0.6, True)])
def test_why_the_frequencies_are_closer_than_the_split_is_said_where_they_are(axis, said):
    """Damping along the elastic axes leaves their distance the split; across them it pulls them together, here by 0.2 %."""
    gyro = Gyro(4600.0, 4599.5, 8e3, 9e3, 0.2, axis)
    x = gyro.samples(CLIPPED_TIME, [1.0, 1.0]) + 0.002 * np.random.default_rng(4).standard_normal((2, 40_000))
    remarks = analyse_decay(mix_down(CLIPPED_TIME, x)).remarks
    assert any("closer than the split" in one for one in remarks) is said


def test_refused():
    random = np.random.default_rng(8)
    z = ring(draw_gyro(random), random)
    with pytest.raises(CompensationError, match="carry the same signal"):
        analyse_decay(from_lock_in(TIME, np.array([z[0], 2 * z[0]]), CARRIER))
    driven = noisy(np.ones((2, TIME.size), dtype=complex) * np.array([[1.0], [0.5j]]), 0.02, random)
    with pytest.raises(CompensationError, match="nothing decays"):
        analyse_decay(from_lock_in(TIME, driven, CARRIER))
    time = np.arange(1000) / 1000
    with pytest.raises(CompensationError, match="fall together"):
        mix_down(time, np.exp(-time / 0.3) * np.cos(2 * np.pi * 7000.0 * time), 7000.0)
    with pytest.raises(CompensationError, match="within 25 % of the 7000 Hz given"):
        mix_down(time, random.standard_normal((1, 1000)), 7000.0)
    empty = np.full((2, 1000), np.nan)
    empty[0, ::2] = empty[1, 1::2] = 1.0
    with pytest.raises(CompensationError, match="0 rows have a value of every pick-off"):
        mix_down(time, empty)
    with pytest.raises(CompensationError, match="299 rows repeat the one before or are 0"):
        from_lock_in(np.arange(300.0), np.ones((2, 300)), CARRIER)
    t, quiet = np.arange(500) / 500, 3e-6 * np.random.default_rng(0).standard_normal(500)
    with pytest.raises(CompensationError, match="nothing decays"):  # what one decay foretells of it overflows
        analyse_trace(t, np.abs(np.exp(-28 * t) + quiet), None)
    t = np.arange(800) / 200
    with pytest.raises(CompensationError, match="amplitudes of whole periods"):
        analyse_decay(mix_down(t, np.exp(-t) * np.cos(2 * np.pi * 14.03 * t)[None], None))


def test_recovery_of_a_decay_of_few_blocks():
    t = np.arange(0.0, 40.0, 0.01)
    x = np.exp(-t / 10) * np.cos(2 * np.pi * 7.03 * t) + 1e-2 * np.random.default_rng(1).standard_normal(t.size)
    found = analyse_decay(mix_down(t, x[None], None)).estimates
    assert abs(found["frequency_Hz"].value - 7.03) < 5 * found["frequency_Hz"].sd < 2e-4
    assert abs(found["decay_time_s"].value - 10) < 5 * found["decay_time_s"].sd < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("plateau", [0.0, 5.0])
def test_a_trace_of_power_gives_the_decay_that_its_noise_allows(plateau):
    """Amplitude without phase, additive complex noise, a drive on for 5 s: the interval holds 1/τ, but for two of 8 traces."""
    random = np.random.default_rng(9)
    t = np.arange(0.0, 90.0, 0.05)
    inside = 0
    for _ in range(8):
        tau = random.uniform(8, 20)
        clean = np.where(t < plateau, 3.0, np.exp(-(t - plateau) / tau)) + 0j
        found = analyse_trace(t, np.abs(noisy(clean, 0.02, random)))
        assert found.window[0] == pytest.approx(plateau, abs=3.0)
        rate = found.estimates["decay_per_s"]
        assert abs(rate.value - 1 / tau) < 4.5 * rate.sd
        inside += rate.low <= 1 / tau <= rate.high
    assert inside >= 6


@pytest.mark.slow
def test_a_spectrum_gives_frequency_and_q_with_intervals_that_hold():
    """Averaged periodograms of Lorentzian lines on a background: 16 spectra, two values of each."""
    random, inside, scores = np.random.default_rng(12), [], []
    for _ in range(16):
        f0, q = 7000.0 + random.uniform(-1, 1), 10 ** random.uniform(3, 4.5)
        f = np.linspace(7000 - 20 * 7000 / q, 7000 + 20 * 7000 / q, 401)
        f0 = 7000 + random.uniform(-5, 5) * 7000 / q
        clean = 1 + 10 ** random.uniform(1, 4) / (1 + (2 * (f - f0) * q / f0) ** 2)
        found = fit_spectrum(f, clean * random.gamma(8, 1 / 8, f.size)).estimates
        for name, value in (("frequency_Hz", f0), ("inverse_q", 1 / q)):
            scores.append((found[name].value - value) / found[name].sd)
            inside.append(found[name].low <= value <= found[name].high)
    assert 0.77 <= np.mean(inside)
    assert np.max(np.abs(scores)) < 4.5


def test_a_spectrum_of_a_split_mode_gives_both_lines():
    f = np.linspace(6990, 7010, 801)
    clean = 1 + 100 / (1 + (2 * (f - 7000.6) / 0.5) ** 2) + 60 / (1 + (2 * (f - 6999.7) / 0.4) ** 2)
    found = fit_spectrum(f, clean * np.random.default_rng(13).gamma(20, 1 / 20, f.size)).estimates
    for name, value in (("split_Hz", 0.9), ("q_1", 7000.6 / 0.5), ("q_2", 6999.7 / 0.4)):
        assert abs(found[name].value - value) < 4 * found[name].sd
    with pytest.raises(CompensationError, match="no resonance"):
        fit_spectrum(f, np.random.default_rng(14).gamma(20, 1 / 20, f.size))


@pytest.mark.slow
def test_absent_rows_are_told_as_lost_like_empty_cells_and_an_uneven_clock_is_not():
    random = np.random.default_rng(5)
    z = ring(draw_gyro(random), random)
    gone = (np.arange(TIME.size) > 160) & (np.arange(TIME.size) < 221)
    empty = np.where(gone, np.nan, z)
    for envelope in (from_lock_in(TIME, empty, CARRIER), from_lock_in(TIME[~gone], z[:, ~gone], CARRIER)):
        assert envelope.lost == pytest.approx(0.1)
        assert "10 % of the samples are lost." in analyse_decay(envelope).remarks
    assert from_lock_in(np.geomspace(1.0, 600.0, TIME.size), z, CARRIER).lost == 0


def test_limits_a_swing_with_cubic_terms_is_that_of_a_step_by_step_integration():
    """Ellipses turned by κ, damped by γ and split; κ turns by 30 rad, in several goes, and time may run backwards."""
    decay, start = Decay(1.0, 2.0, 0.3, 0.1, 18.0, 24.0, 60.0, 0.4), np.array([1 + 0.1j, 0.3 - 0.4j])
    (a, b), _ = decay.matrix
    M = decay.mean * np.eye(2) + np.array([[a, b], [b, -a]])

    def law(_, z):
        size = np.vdot(z, z).real
        return M @ z + 1j * decay.hardening * (2 * size * z + (z @ z) * z.conj()) / 3 - decay.thickening * size * z

    time = np.sort(np.random.default_rng(1).uniform(0, 1, 50))
    exact = solve_ivp(law, (0, 1), start, "DOP853", time, rtol=1e-11, atol=1e-12).y
    there = swing([decay], time, start[None])[0]
    np.testing.assert_allclose(there, exact, atol=2e-5)
    back = swing([decay], -time[-1:], there[None, :, -1])[0, :, 0]
    np.testing.assert_allclose(back, start, atol=1e-4)
    grows = swing([replace(decay, thickening=-40.0)], time, start[None])
    assert not np.isfinite(grows).any(), "what grows without limit is not followed, and is no fault"


@pytest.mark.slow
def test_limits_a_wave_that_grows_without_limit_is_followed_up_to_its_pole():
    """dE/dt = −2E/τ − 2γE² has its pole at τ/2 ln(γE/(γE + 1/τ)) where γE < −1/τ; halves of the time before it have no end."""
    time, starts = np.linspace(0, 1, 356), np.array([[0.01 - 0.001j, -0.88 + 0.16j]])
    E = float(np.sum(np.abs(starts) ** 2))
    for thickening in np.linspace(-3.6, -4.0, 60):
        z = swing([Decay(4.2, 2.8, hardening=-40.0, thickening=thickening)], time, starts)
        pole = np.log(thickening * E / (thickening * E + 2.8)) / 2 / 2.8
        assert np.array_equal(np.isnan(z[0, 0]), time > pole)


def test_a_record_that_ends_within_a_block_has_lost_nothing():
    """20 050 samples are no whole number of blocks: the rest of the last one is the end of the record."""
    time = np.arange(20_050) / 1e5
    samples = np.exp(-time / 0.09) * np.cos(2 * np.pi * 7000 * time)
    assert mix_down(time, samples).lost == 0


def test_a_phase_jump_within_a_block_of_raw_samples_is_named_and_left_behind():
    random, time = np.random.default_rng(8), np.arange(80_000) / 10e3
    gyro = Gyro(2000.25, 1999.75, 1.5e4, 1.6e4, 0.4, 1.1)
    amplitudes = np.array([1.0, 0.7j])
    samples = gyro.samples(time, amplitudes)
    samples[:, 20_011:] = gyro.samples(time, amplitudes * np.exp(1.1j))[:, 20_011:]
    found = analyse_decay(mix_down(time, samples + 2e-3 * random.standard_normal(samples.shape)))
    assert found.remarks[0].startswith("The phase jumps at 2.0")
    z, _ = misses(found, truth_of(gyro))
    assert max(map(abs, z.values())) < 4


CLIPPED_TIME = np.arange(40_000) / 16_000
CLIPPED = Gyro(4600.0, 4598.0, 8e3, 9e3, 0.2, 0.5)  # τ 0.6 s


@pytest.mark.slow
@pytest.mark.parametrize(("rail", "noise"), [(0.1, 0.002), (0.9, 0.1)])
def test_what_is_clipped_is_left_out_to_its_last_sample(rail, noise):
    """Most of the record, and a few peaks lifted by noise: fitted with the rest they gave a wrong decay, Q 3 sd off, or none."""
    x = CLIPPED.samples(CLIPPED_TIME, [1.0, 1.0]) + noise * np.random.default_rng(4).standard_normal((2, 40_000))
    found = analyse_decay(mix_down(CLIPPED_TIME, np.clip(x, -rail, rail)))
    assert found.window[0] > CLIPPED_TIME[np.flatnonzero(np.any(np.abs(x) >= rail, axis=0))[-1]]
    for name in ("frequency_1_Hz", "q_1", "q_2"):
        estimate = found.estimates[name]
        assert abs(estimate.value - truth_of(CLIPPED)[name]) < 4 * estimate.sd, name
    assert any("clipped" in one for one in found.remarks)
    assert not any("drive" in one for one in found.remarks)
    with pytest.raises(CompensationError, match="overloaded to the end"):
        analyse_decay(mix_down(CLIPPED_TIME, np.clip(x, -0.005, 0.005)))


@pytest.mark.slow
def test_a_held_value_is_no_interference():
    """The mean of rows that measure nothing shifted the rest, and its alias was named as a line whose source was to be found."""
    x = CLIPPED.samples(CLIPPED_TIME, [1.0, 1.0]) + 0.002 * np.random.default_rng(4).standard_normal((2, 40_000))
    x[:, 8000:12000] = 0.5
    found = analyse_decay(mix_down(CLIPPED_TIME, x))
    assert not any("Interference" in one for one in found.remarks)


def test_a_line_at_half_the_sampling_rate_is_refused():
    time = np.arange(20_000) / 2e3
    with pytest.raises(CompensationError, match="its image in samples at 2000 Hz fall together"):
        mix_down(time, np.exp(-time / 3) * np.cos(2 * np.pi * 6999.9 * time))


@pytest.mark.slow
@pytest.mark.parametrize("looks", [1, 30, None])
def test_recovery_of_a_decay_into_the_noise_floor(looks):
    """Power of signal and complex noise, averaged over looks, or a still floor with a scatter of the reading: 1/τ of 8 traces, none off."""
    random, time = np.random.default_rng(3), np.linspace(0.0, 2000.0, 2000)
    scores, held = [], 0
    for _ in range(8):
        tau, floor = random.uniform(300, 600), 10 ** random.uniform(-4.5, -2)
        signal = np.exp(-time / tau)
        noise = np.sqrt(floor / 2) * (
            random.normal(size=(looks or 1, 2000)) + 1j * random.normal(size=(looks or 1, 2000))
        )
        power = np.mean(np.abs(signal + noise) ** 2, axis=0)
        power = power if looks else (signal**2 + floor) * np.exp(0.012 * random.normal(size=2000))
        found = analyse_trace(time, np.sqrt(power))
        rate = found.estimates["decay_per_s"]
        scores.append((rate.value - 1 / tau) / rate.sd)
        held += rate.low <= 1 / tau <= rate.high
        assert found.noise[0] == pytest.approx(np.sqrt(floor), rel=0.5)
    assert abs(np.mean(scores)) < 0.9
    assert np.max(np.abs(scores)) < 3.5
    assert held >= 6


@pytest.mark.slow
def test_recovery_of_a_decay_whose_frequency_wanders():
    """A random walk of both frequencies, some fifteen radians from a line: τ, split and axis come back, and the drift is said."""
    random = np.random.default_rng(2)
    gyro = draw_gyro(random)
    course = np.interp(TIME, np.linspace(0.0, TIME[-1], 150), 2e-3 * np.cumsum(random.normal(size=150)))
    phase = 2 * np.pi * np.cumsum(course) * (TIME[1] - TIME[0])
    found = analyse_decay(from_lock_in(TIME, ring(gyro, random, 1e-3) * np.exp(1j * phase), CARRIER))
    truth = truth_of(gyro)
    z, _ = misses(found, {name: truth[name] for name in ("split_Hz", "frequency_axis_deg", "inverse_q")})
    assert max(map(abs, z.values())) < 4
    assert found.estimates["inverse_q"].sd < 0.02 * truth["inverse_q"]
    assert any("drifts" in one for one in found.remarks)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hardening", "sd", "ratios"), [(5e-4, 4e-4, [1.0]), (0.01, 0.02, [1.0]), (0.01, 0.02, [1.0, 0.6])]
)
def test_recovery_of_a_frequency_that_goes_with_the_amplitude(hardening, sd, ratios):
    """The closed form of one mode with cubic stiffness (Hz at the start): no second mode, no drift."""
    q = 1e6
    time, tau = np.arange(0, 60, 1e-2), q / (np.pi * CARRIER)
    phase = np.pi * hardening * tau * (1 - np.exp(-2 * time / tau))
    z = np.array(ratios)[:, None] * np.exp(-time / tau + 1j * phase + 0.3j)
    found = analyse_decay(from_lock_in(time, noisy(z, sd, np.random.default_rng(11)), CARRIER))
    z, _ = misses(found, {"inverse_q": 1 / q, "hardening_Hz": hardening})
    assert max(map(abs, z.values())) < 4
    assert "split_Hz" not in found.estimates
    assert not any("drifts" in one for one in found.remarks)


@pytest.mark.slow
@pytest.mark.parametrize("line", [50.0, 7321.0])
def test_interference_is_named_at_its_own_frequency(line):
    """Blocks of eight periods fold it beside the carrier, where 50 Hz was named as 4650 Hz."""
    random = np.random.default_rng(int(line))
    x = CLIPPED.samples(CLIPPED_TIME, [1.0, 1.0]) + 0.002 * random.standard_normal((2, 40_000))
    x += 0.1 * np.sin(2 * np.pi * line * CLIPPED_TIME + np.array([[0.0], [1.0]]))
    found = analyse_decay(mix_down(CLIPPED_TIME, x))
    assert found.interference == pytest.approx([line], abs=0.02)
    assert any(one.startswith("Interference at") for one in found.remarks)


@pytest.mark.slow
@pytest.mark.parametrize("rate", [-12.0])
def test_a_pattern_that_turns_is_no_interference(rate):
    """A table turns (°/s of pattern azimuth) a shell without split: its two circular waves were a decay and a line to be found."""
    turn = 2 * np.radians(rate) * TIME
    still = np.exp(-TIME / 130.0) * np.array([[1.0], [0.2j]])
    z = np.array([np.cos(turn) * still[0] - np.sin(turn) * still[1], np.sin(turn) * still[0] + np.cos(turn) * still[1]])
    found = analyse_decay(from_lock_in(TIME, noisy(z, 1e-3, np.random.default_rng(1)), CARRIER))
    assert found.remarks[0].endswith("changes every value.")
    assert f"the pattern turns by {abs(rate):.0f} °/s" in found.remarks[0]
    assert not found.interference


@pytest.mark.slow
def test_an_alias_whose_frequency_is_given_gives_the_resonator():
    """1013 Hz samples of 3000 Hz hold it at 39 Hz, where blocks of eight periods are a part of the beat; above half of the sampling rate it was refused."""
    scores, held = [], []
    for seed in range(2):
        random = np.random.default_rng(seed)
        gyro = Gyro(3000.4, 2999.6, 4.9e4, 5.1e4, random.uniform(0, 1.5), random.uniform(0, 1.5))
        time = np.arange(16_000) / 1013
        x = gyro.samples(time, random.uniform(0.3, 1, 2) * np.exp(2j * np.pi * random.uniform(size=2)))
        found = analyse_decay(mix_down(time, x + 4e-3 * random.standard_normal(x.shape), 3000.0))
        z, inside = misses(found, truth_of(gyro))
        scores += z.values()
        held += inside.values()
    assert np.sqrt(np.mean(np.square(scores))) < 1.35
    assert np.mean(held) >= 0.78


@pytest.mark.parametrize("line", [4580.0, 4606.0, 4620.0])
def test_a_frequency_given_off_the_line_says_in_which_zone_it_is(line):
    """1 kHz samples mixed at 4599.68 Hz, as it was given, held a mode and its own alias: two modes 26.67 Hz apart, or interference."""
    time = np.arange(20_000) / 1e3
    x = np.exp(-time / 12) * np.cos(2 * np.pi * line * time) + 1e-3 * np.random.default_rng(0).standard_normal(
        time.size
    )
    found = analyse_decay(mix_down(time, x, 4599.68))
    assert found.estimates["frequency_Hz"].value == pytest.approx(line, abs=1e-4)
    assert found.estimates["decay_time_s"].value == pytest.approx(12, rel=2e-3)
    assert "split_Hz" not in found.estimates
    assert not found.interference


@pytest.mark.slow
@pytest.mark.parametrize("given", [None, 5000.0])
def test_the_line_of_a_decay_that_is_short_in_its_record_is_found(given):
    """A window over 2.6 s left nothing of 0.05 s at its beginning: a line of the noise was taken, and nothing decayed."""
    time = np.arange(260_000) / 1e5
    x = np.exp(-time / 0.05) * np.cos(2 * np.pi * 5003 * time) + 0.2 * np.random.default_rng(0).standard_normal(
        time.size
    )
    found = analyse_decay(mix_down(time, x, given)).estimates
    assert abs(found["frequency_Hz"].value - 5003) < 4 * found["frequency_Hz"].sd < 0.2
    assert abs(found["decay_time_s"].value - 0.05) < 4 * found["decay_time_s"].sd < 5e-3


def test_a_frequency_given_that_is_of_no_line_is_refused_and_another_line_is_not_taken():
    random, time = np.random.default_rng(1), np.arange(40_000) / 11_025
    x = Gyro(4400.0, 4400.12, 3e4, 3.3e4, 0.3, 0.3).samples(time, [1.0, 0.7]) + 2e-3 * random.standard_normal(
        (2, 40_000)
    )
    x += 3 * np.sin(2 * np.pi * 50 * time)  # hum, the largest line
    for given in (4350.0, 4700.0):
        assert mix_down(time, x, given).carrier == pytest.approx(4400.05, abs=0.1)
    for given in (3000.0, 99.0):
        with pytest.raises(CompensationError, match=f"within 25 % of the {given:g} Hz given; their largest is at 50"):
            mix_down(time, x, given)


@pytest.mark.parametrize("part", [0.0, 0.72])
def test_the_window_of_a_line_off_the_reference_is_the_whole_decay(part):
    """Turns from row to row were taken for noise: of 400 s, 31 s were used where the line was 0.72 of half the rows a second away."""
    random, time = np.random.default_rng(4), np.arange(0.0, 400.0, 0.2)
    z = noisy(
        draw_gyro(random).envelope(time, CARRIER, [1.0, 0.3]) * np.exp(1j * np.pi * part * time / 0.2), 1e-3, random
    )
    found = analyse_decay(from_lock_in(time, z, CARRIER))
    assert found.window[1] > 0.95 * time[-1]
    assert found.estimates["frequency_Hz"].value == pytest.approx(CARRIER + part / 0.4, abs=0.05)
