"""Campaigns of an unusual kind: gaps in a log, a bias alone, a voltage that swings, uneven stamps, a second clock."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from scipy.signal import lfilter

from studies.errors import InputError
from studies.instrument.card import build_instrument
from studies.record import Record
from studies.simulation.virtual_gyro import simulate_run
from studies.workbench import diagnose_records
from tests.studies.diagnosis.bench import BACK, CYCLE, Bench, searched
from thermal.profile import Profile

LAGGED = {
    "schema": "hrg.card/1",
    "name": "one lag",
    "law": {"f0_Hz": 4432.07, "a1_per_K": 8.1e-5, "a2_per_K2": -7e-8, "lag_s": 2000.0},
}
FIRST_DAY = datetime(2026, 3, 1, tzinfo=UTC)


def told(records):
    return diagnose_records(records).verdict


@pytest.mark.slow
@pytest.mark.parametrize(("softening", "seen"), [(2.5e-7, True), (-2.5e-7, False)])
def test_a_voltage_that_swings_about_its_mean_softens_and_never_stiffens(softening, seen):
    """V² and V⁴ are nearly one curve there: which of their two coefficients is negative says nothing, their sum does."""
    for seed in (10, 50):
        records = []
        for number, corners in enumerate([CYCLE, BACK]):
            bench = Bench(corners, seed=seed + number)
            voltage = 100.0 + 10.0 * np.sin(2.0 * np.pi * bench.time / 5200.0 + number)
            frequency = bench.frequency(8e-4) - softening * voltage**2
            records.append(bench.record(number, frequency_Hz=frequency, electrode_bias_V=voltage))
        search, plain = searched(records, "electrostatic-softening")
        assert [one.score - plain.score > 20.0 for one in search.contenders(plain)] == [True] * seen


@pytest.mark.slow
def test_a_bias_alone_with_a_term_in_the_rate_finds_its_lag(only):
    """Without the effect no lag at all seems the best: the temperature comes forward as the rate does."""
    only("rate-bias", "curvature", "hysteresis", "cross-damping", "mounting-stress", "thermometer-lag")
    records = []
    for number, corners in enumerate([CYCLE, BACK]):
        bench = Bench(corners, seed=number + 7)
        x = (bench.gyro() - 20.0) / 10.0
        bias = number + 0.5 * x - 0.1 * x**2 + 400.0 * bench.rate + 0.05 * bench.rng.standard_normal(x.size)
        records.append(bench.record(number, bias_deg_per_h=bias))
    verdict = told(records)
    (cause,) = verdict.causes
    assert "rate-bias" in cause.names
    assert verdict.responses["bias_deg_per_h"].noise == pytest.approx(0.05, rel=0.05)


@pytest.mark.slow
def test_what_the_chamber_does_past_the_housing_is_structure(only):
    """Gusts of 2 K and 300 s reach the electronics before the housing: 0.1 °/h for each kelvin of the chamber's lead."""
    only("rate-bias", "hysteresis", "cross-damping")
    card, records = build_instrument({**LAGGED, "bias": {"damping_anisotropy": 0.0, "k1_deg_per_h_per_Hz": 0.4}}), []
    t = np.arange(0.0, 14400.0, 60.0)
    for number, (before, after) in enumerate(((20.0, -5.0), (-5.0, 35.0), (35.0, 10.0))):
        rng = np.random.default_rng(number)
        gusts = lfilter([2.0 * np.sqrt(1.0 - np.exp(-0.4))], [1.0, -np.exp(-0.2)], rng.standard_normal(t.size))
        air = np.interp(t, [0.0, 3600.0, 7200.0, 14400.0], [before, before, after, after]) + gusts
        run = simulate_run(card, Profile(t, air + 273.15), 1 / 60, number).record
        leads = run["chamber_temperature_degC"] - run["housing_temperature_degC"]
        kept = ("time_s", "chamber_temperature_degC", "housing_temperature_degC", "frequency_Hz")
        bias = {"bias_deg_per_h": run["bias_deg_per_h"] + 0.1 * leads}
        records.append(Record({name: run[name] for name in kept} | bias))
    result = told(records).responses["bias_deg_per_h"]
    assert result.verdict == "unexplained"
    assert result.left_over_input == "the chamber's lead over the housing"


@pytest.mark.slow
def test_a_delay_is_said():
    """A thermometer that reads 12 s late: one record cannot tell that from clocks, and the answer says so."""
    records = []
    for number, corners in enumerate([CYCLE, BACK]):
        bench = Bench(corners, seed=number + 11)
        records.append(bench.record(number, frequency_Hz=bench.frequency(1e-3, late=-12.0)))
    result = told(records).responses["frequency_Hz"]
    assert "12 s earlier" in result.remark


@pytest.mark.slow
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_drift_of_the_frequency_is_no_reason_for_one_of_the_loss_and_damping_that_falls_is_no_leak(sign, only):
    """A clock that drifts looks like a resonator that ages; the loss of a gyro that leaks is not its doing. A leak only adds gas."""
    only("clock-drift", "ageing", "leak", "jump", "hysteresis", "mounting-stress")
    records = []
    for k in range(3):
        bench = Bench([(0, 20), (1, 20), (2, -10 + 15 * k), (4, -10 + 15 * k), (6, 35), (8, 35)], seed=60 + k)
        day = 2.0 * k + bench.time / 86400.0
        loss = 1.4e-7 * (1.0 + sign * 0.02 * day) + 1e-10 * bench.rng.standard_normal(day.size)
        start = FIRST_DAY + timedelta(days=2 * k)
        records.append(bench.record(k, start=start, frequency_Hz=bench.frequency(0.002) + 0.01 * day, inverse_q=loss))
    found = {cause.response: cause.names for cause in told(records).causes}
    assert found.keys() == {"frequency_Hz", "inverse_q"}
    assert "clock-drift" in found["frequency_Hz"]
    assert ("leak" in found["inverse_q"]) is (sign > 0)


def drifting(size, spread, reference=None):
    """Runs two days apart whose frequency drifts by so much a day; the reference clock sees all of the drift, none, or is not there."""
    records = []
    for k, corners in enumerate([CYCLE, BACK, CYCLE]):
        bench = Bench(corners, seed=40 + k)
        day, quiet = 2.0 * k + bench.time / 86400.0, bench.frequency(spread)
        columns = {"frequency_Hz": quiet + size * day}
        if reference is not None:
            noise = 0.02 * spread * bench.rng.standard_normal(day.size)
            columns["reference_frequency_Hz"] = quiet + (size * day if reference else 0.0) + noise
        records.append(bench.record(k, start=FIRST_DAY + timedelta(days=2 * k), **columns))
    return records


@pytest.mark.slow
def test_a_reference_clock_tells_ageing_from_a_drifting_clock():
    verdict = told(drifting(0.01, 2e-3, True))
    (cause,) = verdict.causes
    assert (cause.effect, cause.equivalent) == ("ageing", ())
    assert verdict.verdict == "explained"


@pytest.mark.slow
def test_a_reference_clock_finds_a_drift_that_the_record_hides():
    """A drift that white noise of each row covers: without the reference nothing is named, with it the clock is."""
    assert "clock-drift" in {cause.effect for cause in told(drifting(2e-5, 2e-3, False)).causes}
    assert not told(drifting(2e-5, 2e-3)).causes


@pytest.mark.slow
@pytest.mark.usefixtures("coarser")
def test_a_file_of_another_gyro_of_the_lot_is_said(only):
    """One lag behind a housing that lags, and a run 3 Hz above the other: which of the two is right is not known, and no cause is believed for what lags take of that."""
    only("jump", "ageing")
    cool, warm = [(0, 25), (0.333, 25), (0.335, -15), (4, -15)], [(0, -15), (0.333, -15), (0.335, 40), (4, 40)]
    records = []
    for k, corners in enumerate([cool, warm]):
        bench = Bench(corners, sampling=30.0, seed=90 + k)
        housing = bench.behind(500.0)
        x = (2200.0 * bench.behind(2200.0) - 500.0 * housing) / 1700.0 - 20.0  # both lags in series
        frequency = 4432.07 * (1.0 + 7.9e-5 * x - 1e-7 * x**2) + 2e-4 * bench.rng.standard_normal(x.size)
        housing = housing + 0.005 * bench.rng.standard_normal(x.size)
        records.append(bench.record(k, housing_temperature_degC=housing, frequency_Hz=frequency + 3.0 * (k == 1)))
    verdict = told(records)
    assert any("frequency_Hz is +3 Hz from" in note or "frequency_Hz is -3 Hz from" in note for note in verdict.notes)
    assert verdict.verdict != "adequate"
    assert all(cause.probability < 0.5 for cause in verdict.causes)


def test_a_second_clock_that_counts_another_wave_is_refused():
    bench = Bench(CYCLE, seed=80)
    frequency = bench.frequency(2e-3)
    with pytest.raises(InputError, match="of one wave, by two clocks"):
        told([bench.record(0, frequency_Hz=frequency, reference_frequency_Hz=frequency / 2)])
