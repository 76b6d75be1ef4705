"""What a calibration says of itself where it can be worked out by hand: spreads, bent valleys, jumps at a record's first row."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from compensation.noise_rows import NoiseRows
from studies.calibration.ahead import spread_of_prediction
from studies.calibration.calibrate import calibrate
from studies.calibration.estimates import NINETY, estimate
from studies.calibration.fit import CardFit, whitened
from studies.calibration.noise_levels import stated_noise
from studies.calibration.observed import HOUSING, observe
from studies.calibration.priors import Priors
from studies.calibration.problem import MOST_SPREAD, CardProblem, State, start_spread
from studies.instrument.card import load_card
from studies.instrument.tables.noise import NoiseKeys
from studies.instrument.uncertain import UncertainValue
from studies.record import Record
from studies.resonator.law import law_of
from studies.simulation.chamber import load_profile
from studies.simulation.drive import Drive, drive_by_profile, drive_by_record, rows_of
from studies.simulation.heat_path import build_network, slowest_lag
from studies.simulation.noise import bias_noise, frequency_noise
from studies.simulation.prediction import law_for, predict
from studies.simulation.variations import LAG
from studies.simulation.virtual_gyro import simulate_run
from thermal.lag import lag
from thermal.profile import Profile

LEVEL = {"bias_white_deg_per_rt_h": 0.0, "bias_flicker_deg_per_h": 0.0, "bias_walk_deg_per_h_per_rt_h": 0.0}
OF_RECORD = [
    f"noise.{key}" for key in ("frequency_white_Hz", "frequency_flicker_Hz", "frequency_walk_Hz", "housing_white_K")
]
TWO = {"thermal.mount_conductance_W_per_K": 1e-4, "bias.k1_deg_per_h_per_Hz": 0.02}


def test_the_spread_of_a_prediction_is_that_of_two_correlated_values():
    """σ² = d₁²s₁² + d₂²s₂² + 2ρ d₁d₂ s₁s₂ with d from moved cards; every other value is exact."""
    card, rho = load_card("hrg-30mm"), 0.8
    exact = {v.name: {"value": v.value, "sd": TWO.get(v.name, 0.0)} for v in card.uncertain}
    names = list(TWO)
    known = card.with_values(exact).with_table("posterior", {"names": names, "correlation": [[1.0, rho], [rho, 1.0]]})
    profile = load_profile("step 20 5 1h")
    drive = drive_by_profile(profile, rows_of(profile, 1 / 60))
    law = law_for(card, drive)
    spread = spread_of_prediction(known, drive, law)
    value = {v.name: v.value for v in known.uncertain}
    moves = []
    for name, sd in TWO.items():
        above, below = (
            predict(card.with_values({name: value[name] + sign * 0.1 * sd}), drive, law=law) for sign in (1, -1)
        )
        moves.append({c: (above.columns[c] - below.columns[c]) / 0.2 for c in spread})
    for column in ("frequency_Hz", "bias_deg_per_h"):
        one, two = (move[column] for move in moves)
        expected = np.sqrt(one**2 + two**2 + 2 * rho * one * two)
        assert spread[column] == pytest.approx(expected, rel=1e-3, abs=1e-4 * expected.max())
        assert expected.max() > 0


def test_an_offset_of_each_turn_on_is_part_of_the_spread_of_the_bias():
    """A card whose values are all exact and whose bias differs by 0.3 °/h from turn-on to turn-on is wrong by so much."""
    card = load_card("hrg-30mm")
    known = card.with_values({v.name: {"value": v.value, "sd": 0.0} for v in card.uncertain})
    known = known.with_values({"noise.bias_turn_on_deg_per_h": 0.3})
    profile = load_profile("step 20 5 1h")
    spread = spread_of_prediction(known, drive_by_profile(profile, rows_of(profile, 1 / 60)))
    assert spread["bias_deg_per_h"] == pytest.approx(0.3)
    assert np.all(spread["frequency_Hz"] == 0.0)


def test_the_offset_of_a_turn_on_is_drawn_once_a_run():
    levels = bias_noise(NoiseKeys(**LEVEL, bias_turn_on_deg_per_h=0.3))
    draws = np.array([levels.draw(3, 1.0, np.random.default_rng(seed)) for seed in range(2000)])
    assert np.ptp(draws, axis=1).max() == 0.0
    assert draws[:, 0].std() == pytest.approx(0.3, rel=0.05)


@pytest.mark.slow
def test_a_calibrated_card_states_the_turn_on_that_its_runs_show():
    """Offsets of +0.8, −1.1 and +0.3 °/h, far beyond the noise of a run's mean: their standard deviation is 0.985 °/h."""
    card, offsets = load_card("hrg-30mm"), (0.8, -1.1, 0.3)
    profile = load_profile("step 20 0 3h")
    records = []
    for seed, offset in enumerate((*offsets, 0.0)):
        record = simulate_run(card, profile, rate=1 / 60, seed=seed).record
        records.append(record.with_columns({"bias_deg_per_h": record["bias_deg_per_h"] + offset}))
    known = [value.name for value in card.uncertain if not value.name.startswith("bias.")]
    stated = calibrate(card, records[:3], exact=known, profile=False).instrument.noise.bias_turn_on_deg_per_h
    assert np.std(offsets, ddof=1) / 1.5 < stated < 1.5 * np.std(offsets, ddof=1)
    single = calibrate(card, records[3:], exact=known, profile=False)
    assert single.instrument.noise.bias_turn_on_deg_per_h == 0.0


@pytest.mark.slow
def test_a_bias_that_agrees_with_the_card_keeps_its_level():
    """The anisotropy was held where its components are 0, not at the card's length: the saved card was 12 °/h off."""
    card, profile = load_card("cvg-25mm"), load_profile("step 20 50 3h")
    made = simulate_run(card, profile, rate=1 / 60, seed=1).record
    record = replace(made, columns={name: own for name, own in made.columns.items() if name != "inverse_q"})
    found = calibrate(card, [record], profile=False)
    assert found.instrument.bias.damping_anisotropy == card.bias.damping_anisotropy
    told = simulate_run(found.instrument, drive_by_record(record), noise=False).record["bias_deg_per_h"]
    noise = float(np.std(record["bias_deg_per_h"] - told))
    assert float(np.mean(record["bias_deg_per_h"] - told)) == pytest.approx(0.0, abs=0.5 * noise)
    assert noise < 1.1 * found.ladder["bias_deg_per_h"].noise


@dataclass(frozen=True)
class Banana:
    """Two coordinates of unit prior; the data hold u₀ = 0 ± s and, a hundred times closer, u₁ = c u₀²."""

    priors: Priors
    responses: tuple[str, ...] = ("y",)
    count: int = 2
    sd: float = 0.5
    bend: float = 0.2
    ends: tuple[np.ndarray, np.ndarray] = (np.full(2, -np.inf), np.full(2, np.inf))

    def evaluate(self, u, slopes=True):
        rest = np.array([-u[0] / self.sd, -(u[1] - self.bend * u[0] ** 2) / (0.01 * self.sd)])
        slope = np.array([[1 / self.sd, 0.0], [-2 * self.bend * u[0] / (0.01 * self.sd), 1 / (0.01 * self.sd)]])
        return State(u, {"y": rest}, {"y": slope})


def fitted(problem):
    """Return the fit of a problem at its most probable point, 0."""
    state = problem.evaluate(np.zeros(problem.count))
    rows = {"y": SimpleNamespace(whiten=lambda columns, noise: columns)}
    J, _ = whitened(problem, state, {"y": None}, rows)
    return CardFit(problem, state, {"y": None}, rows, np.linalg.inv(J.T @ J + np.eye(problem.count)), {}, 1, True)


def test_an_interval_follows_a_bent_valley():
    """Straight on, 1.6 standard deviations of u₀ miss the valley's floor by many times its width; along it nothing is bent."""
    values = tuple(UncertainValue(f"thermal.{name}", 0.0, 1.0, -np.inf, np.inf) for name in "ab")
    problem = Banana(Priors(values, np.eye(2)))
    found = estimate(fitted(problem))[0]
    half = NINETY / np.sqrt(1 / problem.sd**2 + 1)
    assert (found.low, found.high) == pytest.approx((-half, half), rel=0.12)
    straight = problem.evaluate(np.array([half, 0.0])).residual["y"][1] ** 2
    assert straight > 100


@dataclass(frozen=True)
class Steep(Banana):
    """The same, but the data see sinh 15 (u₁ − c u₀²): two steps with the slopes at 0 do not reach the valley's floor."""

    def evaluate(self, u, slopes=True):
        off, by = 15 * (u[1] - self.bend * u[0] ** 2), 15 * 0.01 * self.sd
        slope = np.array([[1 / self.sd, 0.0], 15 * np.cosh(off) / by * np.array([-2 * self.bend * u[0], 1.0])])
        return State(u, {"y": np.array([-u[0] / self.sd, -np.sinh(off) / by])}, {"y": slope})


def test_an_interval_is_not_narrowed_by_a_floor_that_is_hard_to_reach():
    values = tuple(UncertainValue(f"thermal.{name}", 0.0, 1.0, -np.inf, np.inf) for name in "ab")
    found = estimate(fitted(Steep(Priors(values, np.eye(2)))))[0]
    half = NINETY / np.sqrt(1 / Banana.sd**2 + 1)
    assert (found.low, found.high) == pytest.approx((-half, half), rel=0.12)


@dataclass(frozen=True)
class Stopped(Banana):
    """Of u₀ the data say nothing; u₁ is u₂, which they would have at 1, but which may not exceed 0."""

    count: int = 3
    ends: tuple[np.ndarray, np.ndarray] = (np.full(3, -np.inf), np.array([np.inf, np.inf, 0.0]))

    def evaluate(self, u, slopes=True):
        rest = np.array([(u[2] - u[1]) / 0.1, (1.0 - u[2]) / 0.1])
        return State(u, {"y": rest}, {"y": np.array([[0.0, 1.0, -1.0], [0.0, 0.0, 1.0]]) / 0.1})


def test_what_a_bound_holds_back_bends_no_interval():
    values = tuple(UncertainValue(f"material.{name}", 0.0, 1.0, -np.inf, np.inf) for name in "ab")
    for one in estimate(fitted(Stopped(Priors(values, np.eye(2))))):
        assert one.interval == "normal"
        assert one.low == pytest.approx(-one.high, rel=1e-6)


@dataclass(frozen=True)
class Bow(Banana):
    """The data say nothing of u₀, and closely u₁ = c u₀²: on the straight line at 0 the one does not move the other."""

    def evaluate(self, u, slopes=True):
        rest = np.array([-(u[1] - self.bend * u[0] ** 2) / 0.001])
        return State(u, {"y": rest}, {"y": np.array([[-2 * self.bend * u[0], 1.0]]) / 0.001})


def test_a_value_that_follows_the_square_of_an_unknown_one_is_no_surer_than_that():
    """u₀² of a unit normal is chi-squared with one degree of freedom, of which 95 % are below 3.84."""
    values = tuple(UncertainValue(f"material.{name}", 0.0, 1.0, -np.inf, np.inf) for name in "ab")
    problem = Bow(Priors(values, np.eye(2)))
    unknown, follower = estimate(fitted(problem))
    assert (unknown.low, unknown.high) == pytest.approx((-NINETY, NINETY), rel=1e-3)
    assert follower.high == pytest.approx(3.84 * problem.bend, rel=0.03)
    assert follower.low == pytest.approx(0.0, abs=0.01)
    assert follower.sd < 0.01  # of a point where the other is known, as a saved card keeps it


def test_a_measured_housing_has_a_kink_between_the_rows_where_its_chamber_jumped():
    """What the kink before that row does is the change of the profile midway; nowhere else is one looked for."""
    card = load_card("hrg-30mm").with_values({"noise.housing_lag_s": 0.0})
    profile = load_profile("soak 20 1815s then soak 5 30min")
    record = simulate_run(card, profile, 1 / 30, noise=False).record
    (run,) = observe([record])
    assert list(run.kinks) == [61]  # 1815 s is midway between rows 60 and 61
    law = law_for(card, run.inner)
    true = record["frequency_Hz"]
    plain = predict(card, run.inner, ["kink.61"], law)
    slope, error = plain.derivatives["kink.61"]["frequency_Hz"], true - plain.columns["frequency_Hz"]
    size = float(slope @ error / (slope @ slope))
    bent = predict(card, replace(run.inner, kinks={61: size}), law=law)
    assert bent.columns["frequency_Hz"] - plain.columns["frequency_Hz"] == pytest.approx(
        size * slope, abs=1e-2 * np.abs(size * slope).max()
    )
    assert abs(size) < 2 * run.kinks[61]
    left = true - bent.columns["frequency_Hz"]
    assert np.sqrt(np.mean(left**2)) < 0.2 * np.sqrt(np.mean(error**2))


def test_a_sensor_follows_its_housing_between_rows_too():
    """Of a jump midway between rows 30 s apart: one lag through the housing every half second, not through its rows."""
    card, tau = load_card("hrg-30mm").with_values({"noise.housing_lag_s": 20.0}), 20.0
    profile = load_profile("soak 20 1815s then soak 5 30min")
    fine = drive_by_profile(profile, rows_of(profile, 2.0))
    law = law_for(card, fine)
    expected = lag(fine.time, predict(card, fine, law=law).housing, tau)[::60] - 273.15
    read = predict(card, drive_by_profile(profile, fine.time[::60]), law=law).columns["housing_temperature_degC"]
    assert np.ptp(read) > 10
    assert read == pytest.approx(expected, rel=0, abs=1e-5)


def test_a_slower_sensor_reads_its_housing_later():
    """The slope of a reading by the sensor's time constant, of one that begins 1 K warmer than its housing, against differences."""
    profile = load_profile("soak 20 20min then ramp -10 35 1.0 then soak 35 30min")
    drive = replace(drive_by_profile(profile, rows_of(profile, 1 / 30)), initial={"sensor": 1.0})

    def read(tau: float):
        return predict(load_card("hrg-30mm").with_values({LAG: tau}), drive, (LAG,))

    slope = (read(20.05).columns[HOUSING] - read(19.95).columns[HOUSING]) / 0.1
    assert read(20.0).derivatives[LAG][HOUSING] == pytest.approx(slope, rel=0, abs=3e-3 * np.abs(slope).max())


@pytest.mark.parametrize("tau", [0.0, 20.0])
def test_a_measured_housing_drives_the_frequency_as_its_chamber_did(tau):
    """Straight lines between rows h apart miss h²/12 of a curve's bend: where a ramp of slope s begins, h² s/12 of its area."""
    card = load_card("hrg-30mm").with_values({"noise.housing_lag_s": tau})
    profile, h = load_profile("ramp -10 35 0.5 then soak 35 90min"), 30.0
    drive = drive_by_profile(profile, rows_of(profile, 1 / h))
    law = law_for(card, drive)
    found = predict(card, drive, law=law)
    measured = Profile(drive.time, found.columns["housing_temperature_degC"] + 273.15)
    again = predict(card, Drive(drive.time, "housing", measured), law=law)
    missed_by_lines = h**2 / 12 * (0.5 / 60)  # K s
    per_area = np.abs(law.slope(293.15) * law.frequency(293.15)) / slowest_lag(found.network, 293.15)  # Hz/(K s)
    error = np.abs(again.columns["frequency_Hz"] - found.columns["frequency_Hz"])
    assert error.max() < 0.05 * missed_by_lines * per_area


@pytest.mark.slow
@pytest.mark.parametrize("rate", [0.1, 2.0])
def test_means_of_a_long_record_are_predicted_as_means(rate):
    """The mean over a row of width w of a curve is w²/24 of its bend beside its middle: of a ramp that begins, 0.7 mK of a housing here."""
    card = load_card("hrg-30mm").with_values(dict.fromkeys(OF_RECORD, 0.0))
    record = simulate_run(card, load_profile("cycle 20 -5 40 0.6 4h 1"), rate).record
    (run,) = observe([record])
    assert len(record) > 1.5 * len(run.inner.time)  # it is averaged
    law = law_of(card, 240.0, 340.0)
    left = CardProblem(card, Priors((), np.eye(0)), (run,), law)
    left = left.evaluate(np.zeros(left.count), slopes=False).residual
    assert np.abs(left["frequency_Hz"]).max() < 1e-6
    assert np.abs(left["housing_temperature_degC"]).max() < 5e-5


def test_a_jump_is_free_up_to_a_row_earlier_but_not_at_the_first_row():
    """At the first row nothing is known but what it did to the initial temperatures; a later one is after the row before it."""
    card = load_card("hrg-30mm")
    for words, expected in (
        ("step 20 -10 1h", []),
        ("soak 20 30min then soak 5 30min", ["jump.0"]),
        ("ramp 20 0 1", []),  # it never jumps: known between its rows, and another clock is an effect
    ):
        record = simulate_run(card, load_profile(words), 1 / 60).record
        runs = observe([record])
        problem = CardProblem(card, Priors((), np.eye(0)), runs, law_of(card, 240.0, 330.0))
        times = [name for _, name, _ in problem.starts if not name.startswith(("initial.", "kink."))]
        low, high = problem.ends
        assert times == expected
        bounded = np.isfinite(low)
        assert bounded.sum() == sum(name.startswith("jump.") for name in times)
        sd = next((sd for _, name, sd in problem.starts if name.startswith("jump.")), 0.0)
        assert low[bounded] * sd == pytest.approx(-60.0)
        assert np.array_equal(high[bounded], np.zeros(bounded.sum()))


def test_a_gyro_whose_frequency_and_housing_stand_still_was_at_rest():
    """Half a kelvin that fades within the card's slowest time constant is seen in the frequency; without one nothing is known."""
    card, random, t = load_card("hrg-30mm"), np.random.default_rng(2), np.arange(0.0, 7200.0, 30.0)
    law = law_of(card, 270.0, 320.0)
    tau = slowest_lag(build_network(card, boundary="housing"), 293.15)

    def spread(away, **columns):
        housing = 20.0 + 5e-3 * random.standard_normal(t.size)
        f = law.frequency(293.15 + away * np.exp(-t / tau)) + 1e-3 * random.standard_normal(t.size)
        (run,) = observe([Record({"time_s": t, "housing_temperature_degC": housing, "frequency_Hz": f} | columns)])
        return start_spread(run, card, law)

    assert spread(0.0) < 0.2
    assert 0.5 < spread(0.5) < 2.0
    assert spread(0.0, housing_temperature_degC=20.0 + 0.01 * t) == MOST_SPREAD
    (blind,) = observe([Record({"time_s": t, "housing_temperature_degC": 20.0 + 0 * t, "bias_deg_per_h": 1.0 + 0 * t})])
    assert start_spread(blind, card, law) == MOST_SPREAD


def test_the_noise_that_a_card_states_has_the_covariance_that_a_calibration_expects():
    """Mean squares of what drawn frequency noise changes by within 10 min to 3 h, against the stated levels' covariance."""
    noise = NoiseKeys(frequency_white_Hz=0.0, frequency_flicker_Hz=3e-4, frequency_walk_Hz=2e-6,
                      frequency_markov_Hz=5e-4, frequency_markov_s=900.0)  # fmt: skip
    stated = stated_noise(noise, "frequency_Hz")
    lags = np.array([10, 30, 90, 180])
    drawn = [frequency_noise(noise).draw(1000, 1 / 60, np.random.default_rng(seed)) for seed in range(60)]
    measured = [np.mean([np.mean((x[lag:] - x[:-lag]) ** 2) for x in drawn]) for lag in lags]
    C = NoiseRows.of([60.0 * np.arange(1000)]).covariance(0, stated)
    expected = [np.mean(np.diag(C)[lag:] + np.diag(C)[:-lag] - 2 * np.diag(C, lag)) for lag in lags]
    assert measured == pytest.approx(expected, rel=0.15)
    assert stated_noise(noise, "inverse_q") is None
