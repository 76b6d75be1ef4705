"""Planted in records of the tests' own making: a slow mass that is still warm, a narrow dip crossed once, runs that lie apart, a pair that no run separates."""

import datetime

import numpy as np
import pytest
from scipy.constants import Stefan_Boltzmann, zero_Celsius

from compensation.noise import Noise
from studies.calibration.ahead import spread_of_prediction
from studies.calibration.fit import fit
from studies.inference.background import Background
from studies.inference.diagnosis import build_problem
from studies.inference.extension import extend
from studies.inference.heat_path import find_heat_path, slow_share
from studies.inference.polynomial_card import polynomial_card
from studies.instrument.card import build_instrument, load_card
from studies.planning.chamber import Chamber
from studies.record import Record
from studies.simulation.drive import drive_by_profile, drive_by_record, rows_of
from studies.simulation.virtual_gyro import simulate_run
from studies.workbench import diagnose_records
from tests.studies.diagnosis.bench import searched
from thermal.lag import lag
from thermal.network import Boundary, Conductor, Node, Radiator, assemble
from thermal.profile import Profile, parse_profile
from thermal.radiative import integrate

pytestmark = pytest.mark.slow

STEP, RUN, PAUSE = 60.0, 9000.0, 2400.0  # s
SLOW, SHARE, NOISE = 15000.0, 0.08, 1e-3  # s, –, Hz
LEVELS = ((55.0, -5.0), (-15.0, 50.0))


def a_day_in_the_chamber():
    """Two runs of two levels each, 40 min apart at 20 °C: one solution of the resonator's two paths from the first to the last."""
    time = np.arange(0.0, len(LEVELS) * (RUN + PAUSE), STEP)
    place = time % (RUN + PAUSE)
    housing = np.full(time.size, 20.0)
    for k, (first, second) in enumerate(LEVELS):
        own = time // (RUN + PAUSE) == k
        corners = [0.0, 600.0, 2400.0, 4020.0, 6000.0, 8220.0, RUN]  # on rows
        housing[own] = np.interp(place[own], corners, [20.0, 20.0, first, first, second, second, 20.0])
    resonator = (1.0 - SHARE) * lag(time, housing, 500.0) + SHARE * lag(time, housing, SLOW)
    x = resonator - 20.0
    frequency = 4432.0 + 0.35 * x + 4e-5 * x**2 + NOISE * np.random.default_rng(11).standard_normal(time.size)
    columns = {"time_s": time, "housing_temperature_degC": housing, "frequency_Hz": frequency}
    records = []
    for k in range(len(LEVELS)):
        own = (time // (RUN + PAUSE) == k) & (place < RUN)
        run = {name: values[own] - (values[own][0] if name == "time_s" else 0.0) for name, values in columns.items()}
        records.append(Record(run, path=f"run{k}.csv", sha256=str(k)))
    return records


def follow(housing, tau, share):
    """Temperatures (°C, every 4 s) behind a housing, of which radiation takes a share at 20 °C."""
    out, now = np.empty(housing.size), housing[0] + 273.15
    for k, T in enumerate(housing + 273.15):
        for _ in range(4):
            now += ((1 - share) * (T - now) + share * (T**4 - now**4) / (4 * 293.15**3)) / tau
        out[k] = now - 273.15
    return out


@pytest.mark.usefixtures("fine")
def test_a_late_thermometer_is_named_beside_radiation_and_a_second_lag():
    """Late by a minute, it was told as mounting stress or a second lag: a late sensor was tried only where the gyro is ahead of it."""
    records = []
    for k, (corners, levels) in enumerate((
        ([0, 600, 1500, 2600, 4000, 4700, 6500, 8000], [20, 20, 45, 45, -5, -5, 30, 20]),
        ([0, 900, 1300, 3000, 3500, 5200, 5600, 8000], [20, 20, 0, 0, 40, 40, 10, 10]),
    )):  # fmt: skip
        rng, time = np.random.default_rng(k), np.arange(0.0, 8000.0, 4.0)
        housing = np.interp(time, corners, levels)
        x = lag(time, follow(housing, 330.0, 0.1), 40.0) - 20.0
        frequency = 8000.0 + 0.6 * x + 2e-4 * x**2 + 0.004 * rng.standard_normal(time.size)
        read = lag(time, housing, 60.0) + 0.002 * rng.standard_normal(time.size)
        columns = {"time_s": time, "housing_temperature_degC": read, "frequency_Hz": frequency}
        run = {name: own[::2] for name, own in columns.items()}
        records.append(Record(run, path=f"run{k}.csv", sha256=str(k)))
    found = {cause.effect: cause.parameters for cause in diagnose_records(records).verdict.causes}
    assert set(found) == {"second-lag", "radiation", "thermometer-lag"}
    lags = sorted(found["second-lag"][name].value for name in ("lag_s", "second_lag_s"))
    assert lags == pytest.approx([40.0, 330.0], rel=0.15)
    assert found["radiation"]["radiated_share"].value == pytest.approx(0.1, rel=0.15)
    assert found["thermometer-lag"]["sensor_time_constant_s"].value == pytest.approx(60.0, rel=0.1)


@pytest.mark.usefixtures("coarser")
def test_a_slow_mass_that_the_runs_before_have_warmed_is_one_cause(only):
    """The second path starts every run with what it has kept; it was once called mounting stress, ageing and a jump."""
    only("second-lag", "mounting-stress", "ageing", "jump")
    verdict = diagnose_records(a_day_in_the_chamber()).verdict
    (cause,) = verdict.causes
    assert cause.effect == "second-lag"
    result = verdict.responses["frequency_Hz"]
    assert result.left_over == "none"
    assert result.extended[0] == pytest.approx(NOISE, rel=0.05)
    found = cause.parameters["second_time_constant_s"]
    assert found.low < SLOW < found.high


def a_resonator_behind(housing_words, follow):
    """One run of a resonator that follows a housing with a lag of its own, with the law of the HRG paper's Table 1."""
    profile = parse_profile(housing_words)
    t = np.arange(0.0, profile.end, 60.0)
    before = np.concatenate([[-60.0], t])
    housing = lag(before, np.concatenate([profile.value[:1], profile.at(t)]), 600.0)[1:]
    x = follow(t, housing) - 293.15
    f = 4432.07 + 0.3716 * x - 9.7e-4 * x**2 + 3e-3 * np.random.default_rng(11).standard_normal(t.size)
    columns = {"time_s": t, "housing_temperature_degC": housing - zero_Celsius, "frequency_Hz": f}
    return Record(columns, path="run.csv", sha256="0")


def test_radiation_takes_the_form_of_its_own_size():
    """A lump with 40 % of its conductance by radiation over 100 K."""

    def radiating(t, T):
        exchange = Radiator("housing", "shell", 0.4 / 1500.0 / (4 * Stefan_Boltzmann * 293.15**3))
        own = assemble([Boundary("housing"), Node("shell", 1.0), Conductor("housing", "shell", 0.6 / 1500.0), exchange])
        return integrate(own, {"housing": Profile(t, T)}, relative_tolerance=1e-9).node("shell", t)

    run = a_resonator_behind("step 20 -40 4h then step -40 60 4h", radiating)
    search, _ = searched([run], "radiation")
    _, final = search.grow()
    size = Background(search.linear, final.terms, final.noise).coefficients(0)[0][0]
    assert size == pytest.approx(0.4, abs=0.004)  # 0.42 to first order


CENTRE, WIDTH = 3.46747, 0.262176  # °C, K
PULL = [0.044927, 0.023272, -0.028969, 0.011996, 0.021019, 0.045055]  # Hz
RATE = 0.05  # Hz


def a_run_through_a_dip(card):
    """One run of a card's gyro between three levels; its frequency is pulled where a spurious mode crosses."""
    corners = np.array([0.0, 470.0, 5690.0, 6560.0, 9350.0, 11052.0, 17640.0])  # s
    levels = np.array([20.0, 4.823, 4.823, 21.85, 21.85, -4.068, -4.068])  # °C
    profile = Profile(corners, levels + zero_Celsius)
    dip = {
        "name": "activity-dip",
        "response": "frequency_Hz",
        "temperature_degC": CENTRE,
        "width_K": WIDTH,
        "pull_Hz": PULL,
    }
    record = simulate_run(
        card.with_table("effect", [dip]), drive_by_profile(profile, rows_of(profile, RATE)), seed=2
    ).record
    kept = ("time_s", "housing_temperature_degC", "frequency_Hz")
    return [Record({name: record[name] for name in kept}, path="run.csv", sha256="1")]


def test_a_narrow_dip_that_is_crossed_once_is_not_called_a_jump(only):
    """A first look at a grid of dips sees less than half of what it sees of a jump: a hop is sharp and lies between its shapes."""
    card = load_card("cvg-25mm").with_values({"thermal.cells": 10})
    only("activity-dip", "jump", "ageing", "hysteresis")
    verdict = diagnose_records(a_run_through_a_dip(card), card).verdict
    (cause,) = (cause for cause in verdict.causes if cause.kind == "physics")
    assert cause.effect == "activity-dip"
    assert cause.parameters["temperature_degC"].value == pytest.approx(CENTRE, abs=0.3)


SCATTER = 1e-3  # Hz
TIME = np.arange(0.0, 7200.0, 20.0)
HOUSING = 25.0 + 8.0 * np.sin(2 * np.pi * TIME / 7200.0)


def runs(offsets, gap=None):
    """Runs of one gyro whose frequency is that of a lagging resonator, but for an offset of each (Hz)."""
    rng, records = np.random.default_rng(3), []
    resonator = lag(TIME, HOUSING, 300.0)
    for k, offset in enumerate(offsets):
        f = 4432.0 + 0.35 * (resonator - 20.0) + offset + SCATTER * rng.standard_normal(TIME.size)
        columns = {"time_s": TIME, "housing_temperature_degC": HOUSING, "frequency_Hz": f}
        start = None if gap is None else datetime.datetime(2026, 1, 1) + datetime.timedelta(seconds=k * gap)
        records.append(Record(columns, start=start, path=f"run{k}.csv", sha256=str(k)))
    return records


def judge(records):
    return diagnose_records(records).verdict


@pytest.mark.usefixtures("coarser")
def test_runs_that_lie_apart_are_not_adequate_and_start_times_would_show_why(only):
    only("ageing", "jump", "clock-drift")
    verdict = judge(runs([0.0, 0.05, -0.03]))
    result = verdict.responses["frequency_Hz"]
    assert verdict.verdict == "not-identifiable"
    assert "(rms) apart" in result.remark
    assert "start times" in result.remark
    assert np.ptp(result.run_shifts) == pytest.approx(0.08, rel=0.1)
    assert result.white == pytest.approx(SCATTER, rel=0.2)
    timed = judge(runs([0.0, 0.05, -0.03], gap=86400.0)).responses["frequency_Hz"]
    assert timed.verdict != "adequate"
    assert "start times" not in timed.remark


def test_a_bias_that_differs_from_run_to_run_is_adequate_as_turn_on_and_what_else_it_may_be_is_said():
    rng, records = np.random.default_rng(5), []
    for k, offset in enumerate((0.0, 4.0)):
        bias = 0.2 * (HOUSING - 20.0) + offset + 0.05 * rng.standard_normal(TIME.size)
        columns = {"time_s": TIME, "housing_temperature_degC": HOUSING, "bias_deg_per_h": bias}
        records.append(Record(columns, path=f"run{k}.csv", sha256=str(k)))
    result = judge(records).responses["bias_deg_per_h"]
    assert result.verdict == "adequate"
    assert "lie 2 °/h (rms) apart" in result.remark
    assert "turn-on" in result.remark


@pytest.mark.usefixtures("fine")
def test_telegraph_noise_is_two_levels():
    """A trapped charge that hops once an hour was called slow noise, and the bias adequate."""
    rng, records = np.random.default_rng(4), []
    for k in range(3):
        time = np.arange(0.0, 7 * 3600.0, 20.0)
        hops = np.searchsorted(np.cumsum(rng.exponential(3600.0, 100)), time) % 2
        noise = Noise(white=2.2, flicker=0.06).draw(time.size, 0.05, rng)
        housing = lag(
            time, 20.0 + 25.0 * np.clip(np.sin(2 * np.pi * time / (9000.0 + 4000.0 * k) + k), -0.6, 0.6), 500.0
        )
        bias = 3.0 + 0.05 * lag(time, housing, 1500.0) + hops + noise
        columns = {"time_s": time, "housing_temperature_degC": housing, "bias_deg_per_h": bias}
        records.append(Record(columns, path=f"run{k}.csv", sha256=str(k)))
    result = judge(records).responses["bias_deg_per_h"]
    assert (result.verdict, result.left_over_input) == ("unexplained", "time: switching between two levels")


@pytest.mark.parametrize(("late", "name"), [(45.0, "rate-frequency"), (-45.0, "thermometer-lag")])
def test_what_looks_like_a_delay_is_told_with_the_size_that_its_name_would_have(late, name, only):
    """f(t − d) = f − d df/dT dT/dt: of a delay that was planted, c = −d df/dT, and of one below 0, a sensor of −d; neither had a size, or one that the prior of a delay, 10 s, drew to 0."""
    only("rate-frequency", "thermometer-lag", "second-lag")
    law = {"f0_Hz": 5000.0, "a1_per_K": 8e-5, "a2_per_K2": 0.0, "lag_s": 1500.0, "delay_s": late}
    noise = {"housing_lag_s": 0.0, "frequency_white_Hz": 2e-3}
    card = build_instrument({"schema": "hrg.card/1", "name": "late", "law": law, "noise": noise})
    words = (
        "ramp 20 30 0.02 then soak 30 3h then ramp 30 15 0.02",
        "ramp 25 15 0.03 then soak 15 2h then ramp 15 32 0.02",
    )
    runs = [simulate_run(card, parse_profile(own), 1 / 30, k).record for k, own in enumerate(words)]
    found = diagnose_records(runs)
    (cause,) = found.verdict.causes
    assert cause.effect == name
    (size,) = cause.parameters.values()
    truth = 45.0 if late < 0.0 else -45.0 * 5000.0 * 8e-5
    assert size.value == pytest.approx(truth, rel=0.2)  # 4 s of 45
    assert size.low < truth < size.high
    rate = np.concatenate([np.gradient(run["resonator_temperature_degC"], run["time_s"]) for run in runs])
    assert cause.peak == pytest.approx(45.0 * 5000.0 * 8e-5 * np.ptp(rate), rel=0.25)


def test_inseparable_pair_gets_a_measurement_and_no_run():
    rng = np.random.default_rng(11)
    records = []
    for k in range(2):
        time = np.arange(0.0, 6 * 3600.0, 5.0)
        housing = lag(time, 20.0 + 25.0 * np.sign(np.sin(2 * np.pi * time / 9000.0 + k)), 600.0)
        x = lag(time, housing, 2000.0) - 20.0
        drift = 0.05 * (time + 6 * 3600.0 * k) / 3600.0
        frequency = 5000.0 + 0.4 * x - 4e-4 * x**2 + drift + 0.01 * rng.standard_normal(time.size)
        columns = {"time_s": time, "housing_temperature_degC": housing, "frequency_Hz": frequency}
        records.append(Record({name: values[::4] for name, values in columns.items()}))
    verdict = diagnose_records(records, chamber=Chamber()).verdict
    assert {verdict.causes[0].effect, *verdict.causes[0].equivalent} >= {"ageing", "clock-drift"}
    assert verdict.verdict == "not-identifiable"
    assert verdict.as_dict()["next_run"] is None
    assert "reference clock" in verdict.next_experiment


def one_lag(k, late=0.0, by_rate=0.0):
    """A run behind one lag whose thermometer is `late` (s), of a frequency that follows the rate too (Hz per K/s)."""
    time, noise = np.arange(0.0, 7 * 3600.0, 2.0), np.random.default_rng(k)
    housing = lag(time, 20.0 + 25.0 * np.clip(np.sin(2 * np.pi * time / (9000.0 + 4000.0 * k) + k), -0.6, 0.6), 500.0)
    x = lag(time, housing, 1500.0) - 20.0
    f = 6200.0 * (1.0 + 7e-5 * x - 8e-8 * x**2) + by_rate * np.gradient(x, time)
    read = lag(time, housing, late) if late else housing
    columns = {"time_s": time, "housing_temperature_degC": read + 1e-3 * noise.standard_normal(time.size)}
    columns["frequency_Hz"] = f + 2e-3 * noise.standard_normal(time.size)
    return Record({name: values[::10] for name, values in columns.items()}, path=f"run{k}.csv", sha256=str(k))


@pytest.mark.parametrize(
    ("hidden", "runs", "said"),
    [({"late": 60.0}, (0, 1), {"thermometer-lag"}), ({"by_rate": 40.0}, (1,), {"rate-frequency", "mounting-stress"})],
    ids=["a late thermometer", "a frequency that follows the rate"],
)
def test_a_resonator_ahead_of_its_thermometer_has_a_late_one_or_follows_the_rate(hidden, runs, said, only):
    """The first was called a mounting stress beside a delay, the second a mounting stress that nothing equals."""
    only("thermometer-lag", "rate-frequency", "mounting-stress", "second-lag", "radiation", "hysteresis")
    verdict = judge([one_lag(k, **hidden) for k in runs])
    (cause,) = verdict.causes
    assert {cause.effect, *cause.equivalent} >= said
    assert verdict.responses["frequency_Hz"].extended[0] == pytest.approx(2e-3, rel=0.1)
    if "late" in hidden:
        assert cause.parameters["sensor_time_constant_s"].value == pytest.approx(60.0, abs=3.0)


def exchanged(k, new):
    """A run whose thermometer, where it is a `new` one, reads s where T = s + 0.8 K + 0.03 (s − 20) + 5e-4 (s − 20)²/K."""
    time, noise = np.arange(0.0, 6 * 3600.0, 30.0), np.random.default_rng(k)
    T = lag(time, 20.0 + 28.0 * np.clip(np.sin(2 * np.pi * time / (9000.0 + 2500.0 * k) + k), -0.7, 0.7), 500.0)
    x = lag(time, T, 1200.0) - 20.0
    readings = np.linspace(-60.0, 90.0, 3001)
    y = readings - 20.0
    read = np.interp(T, readings + new * (0.8 + 0.03 * y + 5e-4 * y**2), readings)
    columns = {"time_s": time, "housing_temperature_degC": read + 1e-3 * noise.standard_normal(time.size)}
    columns["frequency_Hz"] = 6200.0 * (1.0 + 7e-5 * x - 8e-8 * x**2) + 2e-3 * noise.standard_normal(time.size)
    return Record(columns, path=f"run{k}.csv", sha256=str(k))


def test_the_card_of_a_gyro_whose_thermometer_was_exchanged_predicts_a_run_with_the_new_one(only):
    """It was saved as of the second run, and missing in a run that is simulated alone: 17 times the noise."""
    only("thermometer-scale", "curvature", "second-lag")
    found = diagnose_records([exchanged(0, False), exchanged(1, True), exchanged(2, True)])
    (cause,) = found.verdict.causes
    assert (cause.effect, cause.parameters["from_run"].value) == ("thermometer-scale", 2)
    y, zero = found.card.reference_temperature - 293.15, cause.parameters["zero_K"]
    assert zero.low < 0.8 + 0.03 * y + 5e-4 * y**2 < zero.high
    unseen = exchanged(3, True)
    run = simulate_run(extend(found).instrument, drive_by_record(unseen), noise=False)
    left = run.record["frequency_Hz"] - unseen["frequency_Hz"]
    assert np.sqrt(np.mean(left[120:] ** 2)) < 1.1 * 2e-3  # after an hour: how it began is not recorded


def lumps_of_silica(words, seed, base=(200.0, 0.25), capacity=60.0, stem=0.05, seen=2e-3, growth=1.8e-3):
    """A record of a base and a shell of fused silica that loads it, hung on a thin stem and radiating to the housing, by the implicit integrator (J/K, W/K, m²)."""
    parts = [
        Boundary("chamber"), Node("housing", 1e6), Conductor("chamber", "housing", 2500.0),
        Node("base", base[0]), Conductor("housing", "base", base[1]),
        Node("shell", lambda T: capacity * (1.0 + growth * (T - 293.15))), Conductor("base", "shell", stem),
        Radiator("housing", "shell", seen),
    ]  # fmt: skip
    profile = parse_profile(words)
    time = np.arange(0.0, profile.end, 30.0)
    inside = integrate(assemble(parts), {"chamber": profile})
    x, noise = inside.node("shell", time) - 293.15, np.random.default_rng(seed)
    f = 7500.0 * (1.0 + 8.5e-5 * x + 5e-8 * x**2)
    columns = {
        "time_s": time,
        "housing_temperature_degC": inside.node("housing", time) - zero_Celsius + noise.normal(0.0, 0.005, time.size),
        "frequency_Hz": f + noise.normal(0.0, 2e-3, time.size),
        "bias_deg_per_h": 2.0 + 0.05 * (f - 7500.0) + noise.normal(0.0, 0.02, time.size),
    }
    return Record(columns, path=f"run{seed}.csv", sha256=str(seed))


@pytest.mark.usefixtures("coarser")
def test_a_healthy_gyro_of_several_lumps_is_followed_to_its_noise_and_its_card_predicts_an_unseen_run():
    """Lags in series, whose lumps take no heat, left 60 times the noise; two runs left the level of the bias open by 10 °/h."""
    runs = [lumps_of_silica("step 20 45 3h then step 45 -15 4h", 1), lumps_of_silica("cycle 20 -10 40 1 30min 2", 2)]
    found = diagnose_records(runs)
    assert {cause.effect for cause in found.verdict.causes} == {"second-lag", "radiation"}
    assert found.verdict.responses["frequency_Hz"].extended[0] == pytest.approx(2e-3, rel=0.1)
    assert found.verdict.responses["bias_deg_per_h"].verdict == "adequate"
    unseen = lumps_of_silica("ramp 20 -20 0.4 then step -20 35 4h", 3)
    unseen.columns["housing_temperature_degC"][0] = 20.0  # where it is settled
    run = simulate_run(extend(found).instrument, drive_by_record(unseen), noise=False)
    width = spread_of_prediction(extend(found).instrument, run.prediction.drive, run.law)
    for name, noise in (("frequency_Hz", 2e-3), ("bias_deg_per_h", 0.02)):
        stated = 2.0 * np.sqrt(np.mean(width[name] ** 2))
        assert np.sqrt(np.mean((run.record[name] - unseen[name]) ** 2)) < np.hypot(1.1 * noise, stated)
        assert stated < 0.8 * noise or (name == "frequency_Hz" and stated < 1.5 * noise)


LUMPS = {
    "schema": "hrg.card/1",
    "name": "two lumps",
    "law": {"f0_Hz": 4432.0, "a1_per_K": 8.7e-5, "a2_per_K2": -9e-8, "lag_s": 2600.0, "second_lag_s": 1900.0, "chamber_lag_s": 500.0},
    "bias": {"damping_anisotropy": 0.0, "offset_deg_per_h": 3.0, "k1_deg_per_h_per_Hz": 0.25},
    "loss": {"inverse_q": 1e-7, "slope_per_K": 0.004},
    "noise": {"housing_lag_s": 0.0},
}  # fmt: skip


def two_lumps():
    """The card's own runs behind noisy thermometers."""
    card, noise, runs = build_instrument(LUMPS), np.random.default_rng(1), []
    spread = dict.fromkeys(("chamber_temperature_degC", "housing_temperature_degC", "bias_deg_per_h"), 0.02)
    for words in ("soak 25 30min then soak -20 270min", "soak -20 30min then soak 25 270min"):
        run = simulate_run(card, parse_profile(words), 1 / 60, noise=False).record
        known = (spread | {"frequency_Hz": 2e-3}).items()
        runs.append(run.with_columns({k: run[k] + noise.normal(0.0, s, len(run)) for k, s in known}))
    return runs


def light_shell():
    """A base that the shell does not load, 900 s behind the housing, and a shell of 500 s whose capacity grows."""
    light = {"base": (1e4, 1e4 / 900.0), "capacity": 1.0, "stem": 1.0 / 500.0, "seen": 1e-9, "growth": 1e-3}
    words = "step 20 45 3h then step 45 -15 4h", "cycle 20 -10 40 1 30min 2"
    return [lumps_of_silica(one, k, **light) for k, one in enumerate(words, 1)]


@pytest.mark.usefixtures("coarser")
@pytest.mark.parametrize(
    ("make", "lags", "row"), [(two_lumps, (2600.0, 1900.0), 60.0), (light_shell, (900.0, 500.0), 30.0)]
)
def test_a_heat_path_of_two_lumps_is_found_and_followed_to_the_noise(make, lags, row):
    """One lag in the noise of the first was led to a housing below 0 K; the search for the second ended where 6 mHz were left of 2 mHz."""
    runs = make()
    path = find_heat_path(fit(build_problem(polynomial_card(runs), runs)), None, {})
    priors, noise = path.fit.problem.priors, path.fit.noise["frequency_Hz"]
    values = priors.at(path.fit.point[: len(priors.values)])
    assert (values["law.lag_s"], values["law.second_lag_s"]) == pytest.approx(lags, rel=0.06)
    assert abs(values["law.radiated_share"]) < 0.02
    assert noise.white == pytest.approx(2e-3 * row**0.5, rel=0.2)
    assert slow_share(path.fit) < 0.5


@pytest.mark.usefixtures("coarser")
def test_plain_lags_in_series_that_radiate_along_are_told_with_their_one_share():
    """The cause asked a path without a direct share for it, and the diagnosis ended in a fault."""
    law = LUMPS["law"] | {"lag_s": 1500.0, "second_lag_s": 400.0, "radiated_share": 0.4}
    card, noise, runs = build_instrument(LUMPS | {"law": law}), np.random.default_rng(3), []
    for words in ("step 20 -40 3h then step -40 50 4h", "cycle 20 -10 40 1 30min 2"):
        run = simulate_run(card, parse_profile(words), 1 / 30, noise=False).record
        spread = {"time_s": 0.0, "housing_temperature_degC": 1e-3, "frequency_Hz": 2e-3}
        runs.append(Record({k: run[k] + noise.normal(0.0, s, len(run)) for k, s in spread.items()}))
    named = {cause.effect: cause.parameters for cause in diagnose_records(runs).verdict.causes}
    assert named["radiation"]["radiated_share"].value == pytest.approx(0.4, abs=0.02)
    assert "direct_share" not in named["radiation"]


def test_what_rounding_leaves_is_no_structure():
    """A bias read in steps far above its noise, which was unexplained, or had a cross-damping; a 1/Q between two readings, which were two levels."""
    step, noise, digit = 0.25, 0.005, 4.4e-10
    t = np.arange(0.0, 6 * 3600.0, 60.0)  # fewer than two rows a mean
    housing = lag(t, 20.0 + 25.0 * np.sin(2.0 * np.pi * t / 9000.0), 300.0)
    x, rng = lag(t, housing, 1500.0) - 20.0, np.random.default_rng(4)
    columns = {
        "time_s": t,
        "housing_temperature_degC": housing,
        "frequency_Hz": 4432.0 + 0.37 * x + 2e-3 * rng.standard_normal(t.size),
        "bias_deg_per_h": np.round((0.05 * x + noise * rng.standard_normal(t.size)) / step) * step,
        "inverse_q": np.round(120.7 + 0.012 * x + 0.25 * rng.standard_normal(t.size)) * digit,
    }
    verdict = diagnose_records([Record(columns, path="run.csv", sha256="1")]).verdict
    assert verdict.verdict == "adequate"
    assert "the last digit of its readings" in verdict.responses["bias_deg_per_h"].remark
