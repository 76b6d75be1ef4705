"""`hrg acceptance` finds planted quantities in records, judges them by their intervals, and refuses what it cannot use."""

import datetime
import json

import numpy as np
import pytest

from studies.acceptance.measure import measure_scale, measure_temperature
from studies.acceptance.service import measure_transfer
from studies.cli import main
from studies.errors import InputError
from studies.record import Record, read_record, write_record
from thermal.lag import lag

TRUTH = {
    "warm_up_time_s": 400 * np.log(20),  # 20 e^{-t/400} reaches 1 deg/h
    "bias_temperature_slope_deg_per_h_per_K": 0.05,
    "bias_temperature_rate_deg_per_h_s_per_K": 30.0,
    "frequency_temperature_slope_ppm_per_K": 80.0,
    "scale_factor_error_ppm": 50.0,
    "angle_random_walk_deg_per_rt_h": 0.01,
    "run_down_time_s": 718.2,
    "quality_factor": np.pi * 4432 * 718.2,
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Records with known quantities; the limits that some tests use."""
    folder, g = tmp_path_factory.mktemp("acceptance"), np.random.default_rng(7)

    def write(name, columns, **more):
        write_record(Record(columns, instrument="free-dome", **more), folder / f"{name}.csv")

    t = np.arange(0, 20000.0)
    for k in range(3):
        start = datetime.datetime(2026, 1 + k, 1, tzinfo=datetime.UTC)
        bias = 2 + 0.1 * k + g.normal(0, 0.6, t.size)
        loss = 1e-7 * (1 + 0.02 * k / 12) + g.normal(0, 1e-10, t.size)
        steady = np.full(t.size, 20.0)
        write(
            f"rest{k}",
            {"time_s": t, "housing_temperature_degC": steady, "bias_deg_per_h": bias, "inverse_q": loss},
            start=start,
        )
    T = 20 + 30 * np.sin(2 * np.pi * t / 10000)
    bias = 1 + 0.05 * (T - 20) + 30 * np.gradient(T, t) + g.normal(0, 0.6, t.size)
    f = 4432 * (1 + 80e-6 * (T - 20)) + g.normal(0, 1e-3, t.size)
    write("cycle", {"time_s": t, "housing_temperature_degC": T, "bias_deg_per_h": bias, "frequency_Hz": f})
    rate = np.repeat([0.0, 10, 50, 100, 50, 10, 0, -10, -50, -100, -50, -10, 0], 60)
    read = rate * (1 + 50e-6) + 1e-3 + g.normal(0, 1e-4, rate.size)
    write("rates", {"time_s": np.arange(rate.size) * 1.0, "rate_deg_per_s": rate, "measured_rate_deg_per_s": read})
    t = np.arange(0, 2500.0)
    amplitude = np.exp(-t / 718.2) + g.normal(0, 1e-4, t.size)
    write("rundown", {"time_s": t, "frequency_Hz": np.full(t.size, 4432.0), "vibration_amplitude_V": amplitude})
    t = np.arange(0, 7200.0)
    bias = 2 + 20 * np.exp(-t / 400) + g.normal(0, 0.6, t.size)
    write("warm", {"time_s": t, "bias_deg_per_h": bias}, comments=("test: warm-up",))
    return folder


def limits(folder, text):
    path = folder / "limits.toml"
    path.write_text('schema = "hrg.limits/1"\n[limits]\n' + text + "\n[warm_up]\nband_deg_per_h = 1.0\n")
    return str(path)


def judged(capsys, folder, names, *options):
    status = main(["acceptance", "free-dome", *(str(folder / f"{name}.csv") for name in names), "--json", *options])
    said = capsys.readouterr()
    return status, json.loads(said.out) if status == 0 else None, said.err


ALL = ("rest0", "rest1", "rest2", "cycle", "rates", "rundown", "warm")


def test_the_noisiest_of_several_drift_records_is_judged_in_any_order(folder, capsys):
    """Planted: white noise of 0.01 and of 0.03 °/√h; a limit between them is not met, whichever record comes first; a short record does not count."""
    t, g = np.arange(0, 20000.0), np.random.default_rng(3)
    for name, size, rows in (("still", 0.6, 20000), ("noisy", 1.8, 15000), ("short", 6.0, 4000)):
        columns = {"time_s": t[:rows], "bias_deg_per_h": 2 + g.normal(0, size, rows)}
        write_record(Record(columns, instrument="free-dome"), folder / f"{name}.csv")
    path = limits(folder, "angle_random_walk_deg_per_rt_h = 0.02")
    said = []
    for names in (("still", "noisy", "short"), ("short", "noisy", "still")):
        _, payload, _ = judged(capsys, folder, names, "--limits", path)
        said.append(next(one for one in payload["quantities"] if one["key"] == "angle_random_walk_deg_per_rt_h"))
        assert payload["verdict"] == "fail"
    assert said[0] == said[1]
    assert said[0]["low"] < 0.03 < said[0]["high"]
    assert said[0]["records"] == [str(folder / "noisy.csv")]


@pytest.mark.slow
def test_planted_quantities_are_found(folder, capsys):
    path = limits(
        folder,
        "bias_deg_per_h = 5\nbias_temperature_rate_deg_per_h_s_per_K = 20\nangle_random_walk_deg_per_rt_h = 0.01\n"
        "run_down_time_s = 500",
    )
    page = folder / "page.html"
    status, found, _ = judged(capsys, folder, ALL, "--limits", path, "--report", str(page))
    assert status == 0
    assert found["schema"] == "hrg.acceptance/1"
    lines = {line["key"]: line for line in found["quantities"]}
    assert [line["section"] for line in found["quantities"]] == [
        "12.3", "12.5–12.6", "12.8", "12.8", "12.8", "12.8", "12.9", "12.9", "12.9",
        "12.11", "12.11", "12.11", "12.11", "12.11", "12.13", "12.14", "12.14", "12.15", "12.15", "12.18",
    ]  # fmt: skip
    for key, value in TRUTH.items():
        width = lines[key]["high"] - lines[key]["low"]
        assert lines[key]["low"] - width / 2 <= value <= lines[key]["high"] + width / 2, key
        assert lines[key]["value"] == pytest.approx(value, rel=0.04), key
    # 0.1 deg/h a month
    trend = lines["bias_trend_deg_per_h_per_year"]
    assert trend["low"] < 1.2 < trend["high"]
    assert trend["value"] == pytest.approx(1.2, rel=0.1)
    # 1/Q grew by 2 % a year
    assert lines["inverse_q_trend_per_year"]["value"] == pytest.approx(2e-9, rel=0.2)
    assert lines["bias_deg_per_h"]["verdict"] == lines["run_down_time_s"]["verdict"] == "pass"
    assert lines["bias_temperature_rate_deg_per_h_s_per_K"]["verdict"] == "fail"
    assert lines["angle_random_walk_deg_per_rt_h"]["verdict"] == "undecided"
    assert lines["scale_factor_error_ppm"]["verdict"] == "no limit"
    assert found["verdict"] == "fail"
    assert {one["section"] for one in found["elsewhere"]} == {"12.3", "12.18"}
    text = page.read_text()
    assert "Acceptance of free-dome: fail" in text
    assert "12.15" in text


@pytest.mark.parametrize("lags", [(), (2400.0,), (1900.0, 1100.0)])
def test_sensitivities_are_of_a_resonator_that_lags_its_housing(tmp_path, capsys, lags):
    """80 ppm/K and 0.05 °/h/K, while the resonator has not settled anywhere."""
    g, paths, levels_of = np.random.default_rng(5), [], []
    for k, (hours, levels) in enumerate(
        [([0, 1, 1.7, 4, 5, 7], [20, 20, -15, -15, 45, 45]), ([0, 2, 3, 5], [25, 25, 0, 30])]
    ):
        t = np.arange(0.0, 3600.0 * hours[-1], 20.0)
        T = resonator = np.interp(t, np.array(hours) * 3600.0, levels) + 0.2 * np.sin(t / 400.0)
        for tau in lags:
            resonator = lag(t, resonator, tau)
        x = resonator - 20
        f = 4432 + 4432 * 80e-6 * x + g.normal(0, 2e-3, t.size)
        levels_of.append(f)
        bias = 1 + k + 0.05 * x + g.normal(0, 0.02, t.size)
        paths.append(tmp_path / f"run{k}.csv")
        columns = {"time_s": t, "housing_temperature_degC": T, "frequency_Hz": f, "bias_deg_per_h": bias}
        write_record(Record(columns, instrument="free-dome"), paths[-1])
    assert main(["acceptance", "free-dome", *map(str, paths), "--json"]) == 0
    lines = {line["key"]: line for line in json.loads(capsys.readouterr().out)["quantities"]}
    for key, truth in (
        ("frequency_temperature_slope_ppm_per_K", 80.0 * 4432 / np.mean(np.concatenate(levels_of))),
        ("bias_temperature_slope_deg_per_h_per_K", 0.05),
    ):
        assert lines[key]["value"] == pytest.approx(truth, rel=0.01), key
        reach = (lines[key]["high"] - lines[key]["low"]) / 2 + 1e-4 * truth  # the lags act on averages over 100 s
        assert lines[key]["low"] - reach < truth < lines[key]["high"] + reach, key


def test_without_a_frequency_the_bias_tells_how_late_the_resonator_is():
    """Planted: 0.05 °/h/K and 200 °/h/(K/s) behind lags of 1900 s and 300 s; at no lag the slope was 0.058 in every run."""
    hours = 3600.0 * np.array([0, 1, 1.7, 4, 5, 7, 8.5, 9, 12])
    t, held = np.arange(0.0, hours[-1], 20.0), {"slope": 0, "rate": 0}
    T = np.interp(t, hours, [20, 20, -15, -15, 45, 45, 0, 30, 30]) + 0.2 * np.sin(t / 400.0)
    resonator = lag(t, lag(t, T, 1900.0), 300.0)
    for seed in range(6):
        noise = np.random.default_rng(seed).normal(0, 0.15, t.size)
        bias = 1 + 0.05 * (resonator - 20) + 200.0 * np.gradient(resonator, t) + noise
        columns = {"time_s": t, "housing_temperature_degC": T, "bias_deg_per_h": bias}
        found = measure_temperature([Record(columns, path="run")], "bias_deg_per_h")
        slope = found["bias_temperature_slope_deg_per_h_per_K"]
        rate = found["bias_temperature_rate_deg_per_h_s_per_K"]
        assert slope.value == pytest.approx(0.05, rel=0.02)
        held["slope"] += slope.low < 0.05 < slope.high
        held["rate"] += rate.low < 200.0 < rate.high
        assert found["bias_temperature_residual_deg_per_h"].value < 1.2 * 0.15 / np.sqrt(5)
    assert held["slope"] >= 4
    assert held["rate"] >= 4


@pytest.mark.slow
def test_intervals_over_temperature_know_the_error_of_the_lags():
    """Where a noisy frequency tells the lags badly, 90 % intervals of the bias's sensitivities held the truth in 5 runs of 20."""
    away: dict[str, list[float]] = {}
    for seed in range(12):
        g = np.random.default_rng(seed)
        t = np.arange(0.0, 3600.0 * 12, 50.0)
        hours = 3600.0 * np.array([0, 1, 1.7, 4, 5, 7, 8.5, 9, 12])
        T = np.interp(t, hours, [20, 20, -15, -15, 45, 45, 0, 30, 30]) + 0.2 * np.sin(t / 400.0)
        resonator = lag(t, lag(t, T, 1900.0), 1100.0)
        x = resonator - 20
        f = 4432 + 4432 * 80e-6 * x + g.normal(0, 0.2, t.size)
        bias = 1 + 0.05 * x + 20.0 * np.gradient(resonator, t) + g.normal(0, 5e-3, t.size)
        columns = {"time_s": t, "housing_temperature_degC": T, "frequency_Hz": f, "bias_deg_per_h": bias}
        found = measure_temperature([Record(columns, path="run")], "bias_deg_per_h")
        for key, truth in (
            ("frequency_temperature_slope_ppm_per_K", 80.0 * 4432 / np.mean(f)),
            ("bias_temperature_slope_deg_per_h_per_K", 0.05),
            ("bias_temperature_rate_deg_per_h_s_per_K", 20.0),
        ):
            own = found[key]
            away.setdefault(key, []).append((own.value - truth) / (0.5 * (own.high - own.low) / 1.7))
    for key, own in away.items():
        assert 0.1 < np.sqrt(np.mean(np.square(own))) < 1.5, key


def test_a_bias_that_bends_over_temperature_keeps_its_sensitivities():
    """−56 °/h/(K/s) beside 0.001 °/h/K² was −75 ± 6, and −52 ± 2 without the bend: the resonator began as its housing was within the first mean."""
    g, t, runs = np.random.default_rng(1), np.arange(0, 18000.0, 10.0), []
    for k, (begin, end) in enumerate([(25.0, -20.0), (-20.0, 25.0), (-20.0, 45.0)]):
        fades, late = np.exp(-t / 1500.0), (1500 * np.exp(-t / 1500.0) - 900 * np.exp(-t / 900.0)) / 600.0
        T, housing = (end + (begin - end) * own for own in (late, fades))
        bias = k + 0.05 * T + 1e-3 * T**2 - 56.0 * np.gradient(T, t) + 0.1 * g.standard_normal(t.size)
        f = 4432 + 0.31 * T + 2e-4 * g.standard_normal(t.size)
        columns = {"time_s": t, "housing_temperature_degC": housing, "frequency_Hz": f, "bias_deg_per_h": bias}
        runs.append((Record(columns, path=f"run{k}"), T))
    found = measure_temperature([record for record, _ in runs], "bias_deg_per_h")
    mean = float(np.mean([T for _, T in runs]))
    for key, truth in (
        ("bias_temperature_slope_deg_per_h_per_K", 0.05 + 2e-3 * mean),
        ("bias_temperature_rate_deg_per_h_s_per_K", -56.0),
    ):
        assert found[key].value == pytest.approx(truth, rel=0.03), key
        assert found[key].low < truth < found[key].high, key


def test_the_rate_of_a_temperature_that_swings_is_not_flattened_by_its_averages():
    """Differences over 200 s of a swing of 2500 s made 1 % too much of the sensitivity to it, twice its error."""
    t = np.arange(0.0, 36000.0, 10.0)
    bias = 0.5 * np.sin(t / 400.0) - 56.0 * np.cos(t / 400.0) / 40.0 + np.random.default_rng(1).normal(0, 0.1, t.size)
    columns = {"time_s": t, "housing_temperature_degC": 20 + 10 * np.sin(t / 400.0), "bias_deg_per_h": bias}
    found = measure_temperature([Record(columns, path="run")], "bias_deg_per_h")
    assert found["bias_temperature_rate_deg_per_h_s_per_K"].value == pytest.approx(-56.0, rel=5e-3)


@pytest.mark.parametrize("column", ["frequency_Hz", "housing_temperature_degC"])
def test_what_is_no_rate_is_not_judged_as_the_bias(folder, capsys, column):
    status, _, said = judged(capsys, folder, ("cycle",), "--output", column)
    assert status == 2
    assert f"--output {column}: the zero-rate output is a column in °/h" in said


def test_a_column_without_values_is_none(folder, capsys):
    """An empty frequency cost every other quantity of its record."""
    cycle = read_record(folder / "cycle.csv")
    write_record(cycle.with_columns({"frequency_Hz": np.full(len(cycle), np.nan)}), folder / "empty.csv")
    status, told, said = judged(capsys, folder, ("empty",))
    assert status == 0, said
    named = {one["key"] for one in told["quantities"] if one["value"] is not None}
    assert "bias_temperature_residual_deg_per_h" in named
    assert "frequency_temperature_slope_ppm_per_K" not in named


def test_a_limit_without_a_record_is_said_and_leaves_the_verdict_open(folder, capsys):
    path = limits(folder, "run_down_time_s = 500\nscale_factor_error_ppm = 100\nscale_factor_asymmetry_ppm = 100")
    status, found, said = judged(capsys, folder, ("rundown",), "--limits", path)
    assert status == 0
    assert found["verdict"] == "incomplete"
    assert "limits scale_factor_error_ppm, but no record gives it; it needs a record with rate_deg_per_s" in said
    page = folder / "missing.html"
    assert main(["acceptance", "free-dome", str(folder / "rundown.csv"), "--limits", path, "--report", str(page)]) == 0
    assert (
        "scale factor error; scale factor asymmetry, positive minus negative rates" in page.read_text()
    )  # two of them


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("bias_deg_per_hour = 5", "unknown key 'bias_deg_per_hour'; did you mean 'bias_deg_per_h'?"),
        ("", "no limit is given"),
    ],
)
def test_unusable_limits_are_refused(folder, capsys, text, message):
    status, _, said = judged(capsys, folder, ("rundown",), "--limits", limits(folder, text))
    assert status == 2
    assert message in said


def test_a_run_down_that_does_not_decay_is_refused(folder, tmp_path, capsys):
    t = np.arange(0, 500.0)
    amplitude = 1 + np.random.default_rng(1).normal(0, 1e-3, t.size)
    write_record(Record({"time_s": t, "vibration_amplitude_V": amplitude}), tmp_path / "still.csv")
    status, _, said = judged(capsys, tmp_path, ("still",))
    assert status == 2
    assert "still.csv: nothing decays in this trace" in said


def test_a_record_that_shows_no_test_is_named(folder, tmp_path, capsys):
    t = np.arange(0, 500.0)
    write_record(Record({"time_s": t, "bias_deg_per_h": np.sin(t)}), tmp_path / "short.csv")
    write_record(Record({"time_s": t, "quadrature_V": np.sin(t)}), tmp_path / "other.csv")
    status, found, said = judged(capsys, tmp_path, ("short", "other"))
    assert status == 0
    assert "short.csv is not used: the output at rest is of 500 s, less than an hour." in said
    assert "other.csv is not used: its columns fit none of the tests." in said
    assert found["verdict"] == "incomplete"


@pytest.mark.parametrize(("rows", "test"), [(360, "drift"), (300, "growth of 1/Q")])
def test_an_hour_is_its_rows_and_a_record_of_loss_alone_is_used(tmp_path, capsys, rows, test):
    """360 rows of 10 s are an hour, though the last begins after 3590 s; records that gave the growth of 1/Q were 'not used'."""
    g, t = np.random.default_rng(1), np.arange(0, 10.0 * rows, 10.0)
    for month in (1, 2, 3):
        columns = {
            "time_s": t,
            "inverse_q": 1e-7 * month + g.normal(0, 1e-10, rows),
            "bias_deg_per_h": g.normal(0, 1, rows),
        }
        start = datetime.datetime(2026, month, 1, tzinfo=datetime.UTC)
        write_record(Record(columns, start=start), tmp_path / f"q{month}.csv")
    _, found, said = judged(capsys, tmp_path, ("q1", "q2", "q3"))
    assert set(found["records"].values()) == {test}
    assert "not used" not in said


@pytest.mark.slow
def test_records_of_two_gyros_or_modes_are_refused(folder, tmp_path, capsys):
    """A run at n = 3 beside one at n = 2 once gave 11 500 ppm/K."""
    cycle = read_record(folder / "cycle.csv")
    time = {"time_s": cycle["time_s"]}
    turned = {name: own[::-1] for name, own in cycle.columns.items()} | time
    write_record(Record(turned | {"frequency_Hz": 2.8 * turned["frequency_Hz"]}), tmp_path / "third.csv")
    assert main(["acceptance", "free-dome", str(folder / "cycle.csv"), str(tmp_path / "third.csv")]) == 2
    assert "The records are of different gyros" in capsys.readouterr().err
    assert main(["acceptance", "hrg-30mm", str(folder / "cycle.csv")]) == 0
    assert "is not a record of that gyro" not in (told := capsys.readouterr().err)
    assert "frequency_Hz is near" not in told
    assert main(["acceptance", "hrg-30mm", str(tmp_path / "third.csv")]) == 0
    assert "third.csv: frequency_Hz is near 12410 Hz, but the card hrg-30mm resonates" in capsys.readouterr().err


def test_bandwidth_and_delay_of_a_shaken_gyro(folder, capsys):
    """A lag of first order falls by 3 dB at its corner; its delay is its time constant, of samples a part later."""
    g, rate, corner = np.random.default_rng(3), 200.0, 10.0
    from scipy import signal

    applied = signal.lfilter(*signal.butter(2, 40.0, fs=rate), g.normal(0, 30, 20000))
    lag = np.exp(-2 * np.pi * corner / rate)
    measured = signal.lfilter([1 - lag], [1, -lag], applied) + g.normal(0, 0.05, applied.size)
    columns = {"time_s": np.arange(applied.size) / rate, "rate_deg_per_s": applied, "measured_rate_deg_per_s": measured}
    write_record(Record(columns, instrument="free-dome"), folder / "shaken.csv")
    _, found, _ = judged(capsys, folder, ("shaken",))
    lines = {line["key"]: line for line in found["quantities"]}
    assert found["records"] == {str(folder / "shaken.csv"): "transfer"}
    assert lines["bandwidth_Hz"]["value"] == pytest.approx(corner, rel=0.03)
    assert lines["bandwidth_Hz"]["low"] < lines["bandwidth_Hz"]["value"] < lines["bandwidth_Hz"]["high"]
    assert lines["delay_ms"]["value"] == pytest.approx(1e3 * lag / (1 - lag) / rate, rel=0.005)


@pytest.mark.parametrize("corner", [3.0, 10.0, 30.0])
def test_intervals_of_a_swept_gyro_hold_its_bandwidth_and_delay(corner):
    """A sweep is in each band of frequency once, and at rest before: spectra of parts said 9.1 Hz ± 0.3 % of 10 Hz, never the truth."""
    from scipy import signal

    rate, fine, delay = 200.0, 20, 0.01
    t = np.arange(0, 120.0, 1 / rate / fine)
    applied, lag = 10 * signal.chirp(t, 0.5, 120.0, 60.0), np.exp(-2 * np.pi * corner / rate / fine)
    late = int(delay * rate * fine)
    measured = np.r_[np.zeros(late), signal.lfilter([1 - lag], [1, -lag], applied)[:-late]][::fine]
    truth = {"bandwidth_Hz": corner, "delay_ms": 1e3 * (delay + lag / (1 - lag) / rate / fine)}
    held, draws = dict.fromkeys(truth, 0), 20
    for seed in range(draws):
        read = measured + np.random.default_rng(seed).normal(0, 5e-3, measured.size)
        columns = {"time_s": t[::fine], "rate_deg_per_s": applied[::fine], "measured_rate_deg_per_s": read}
        found = measure_transfer(Record(columns, path="swept"))
        for key, value in truth.items():
            assert found[key].value == pytest.approx(value, rel=0.02), key
            slack = 2e-4 * value  # of the lag in steps
            held[key] += found[key].low - slack <= value <= found[key].high + slack
    assert min(held.values()) >= 15, held


def test_a_response_lost_in_noise_is_refused():
    """A bandwidth of 3 Hz in noise as large as the rate, of 20 s: told or refused in a sentence, never a number that is none."""
    from scipy import signal

    lag, refused = np.exp(-2 * np.pi * 3.0 / 200), 0
    for seed in range(30):
        g = np.random.default_rng(seed)
        applied = g.normal(0, 10, 4000)
        read = signal.lfilter([1 - lag], [1, -lag], applied) + g.normal(0, 3, applied.size)
        columns = {"time_s": np.arange(4000) / 200, "rate_deg_per_s": applied, "measured_rate_deg_per_s": read}
        try:
            found = measure_transfer(Record(columns, path="noisy"))["bandwidth_Hz"]
        except InputError:
            refused += 1
        else:
            assert np.isfinite([found.value, found.low]).all()
            assert 0.5 < found.value / 3.0 < 2.0
    assert 0 < refused


@pytest.mark.parametrize(
    "levels",
    [
        [0, 10, 50, 100, 200, 300, -10, -50, -100, -200, -300],
        [60, 120, 180, 240, 300, -60, -120, -180, -240, -300],
        [300, 0, -300],
        [20, 100, 300, -50, -80, -200],
    ],
)
def test_scale_factor_asymmetry_does_not_depend_on_the_rates(levels):
    """The slopes of the two sides differ by 1000 ppm of their mean, 1.02; the interval holds that in 90 of 100 records."""
    g, rate, kept = np.random.default_rng(1), np.repeat(np.array(levels, dtype=float), 60), 0
    for _ in range(100):
        read = 0.02 + 1.02 * np.where(rate > 0, 1 + 5e-4, 1 - 5e-4) * rate + g.normal(0, 1e-3, rate.size)
        columns = {"time_s": np.arange(rate.size) * 1.0, "rate_deg_per_s": rate, "measured_rate_deg_per_s": read}
        found = measure_scale(Record(columns))["scale_factor_asymmetry_ppm"]
        kept += found.low < 1000 < found.high
        assert found.high - found.low < 20
    assert 82 <= kept  # 90 less 2.7 standard deviations


@pytest.mark.parametrize(
    ("measured", "applied", "said"),
    [
        (-1.0003, 1.0, "measured_rate_deg_per_s has the opposite sign"),
        (np.pi / 180, 1.0, "measured_rate_deg_per_s is in rad/s.* Multiply the column by 57.2958"),
        (1.0, np.pi / 180, "rate_deg_per_s is in rad/s.* Multiply the column by 57.2958"),
        (3600.0, 1.0, "measured_rate_deg_per_s is in °/h.* Divide the column by 3600"),
        (0.7, 1.0, ""),
    ],
)
def test_an_output_of_another_sign_or_unit_is_named(measured, applied, said):
    """It was a scale factor error of −2000300 or −982541 ppm, and a nonlinearity 57 times too small. A gain of 0.7 is an error of the gyro."""
    rate = np.repeat([-100.0, -50.0, 0.0, 50.0, 100.0], 60)
    noise = 1e-3 * np.random.default_rng(1).standard_normal(rate.size)
    columns = {"rate_deg_per_s": applied * rate, "measured_rate_deg_per_s": measured * (rate + noise)}
    record = Record({"time_s": np.arange(float(rate.size))} | columns, path="rates.csv")
    if said:
        with pytest.raises(InputError, match=f"rates.csv: {said}"):
            measure_scale(record)
    else:
        assert measure_scale(record)["scale_factor_error_ppm"].value == pytest.approx(-3e5, rel=1e-3)


@pytest.mark.parametrize(("again", "apart"), [(False, 0.0), (True, 0.0), (True, 1e-3)])
def test_what_repeats_at_a_rate_is_no_error_of_the_scale_factor(again, apart):
    """Intervals of a gyro of 30 ppm nonlinearity were 15 times too wide; from hold to hold it may scatter more than within them."""
    levels = np.array([0.0, 20, 40, 80, 120, -20, -40, -80, -120] * (2 if again else 1))
    rate, held = np.repeat(levels, 80), {"error": 0, "asymmetry": 0}
    bent = 1.0003 * rate + 45e-6 * np.abs(rate) + 3e-3 * (4 * (rate / 120) ** 3 - 3 * rate / 120)
    record = {"time_s": np.arange(rate.size) * 1.0, "rate_deg_per_s": rate}
    truth = measure_scale(Record(record | {"measured_rate_deg_per_s": bent}))
    for seed in range(100):
        g = np.random.default_rng(seed)
        read = bent + g.normal(0, 2e-3, rate.size) + np.repeat(g.normal(0, 1.0, levels.size), 80) * apart
        found = measure_scale(Record(record | {"measured_rate_deg_per_s": read}))
        for name in held:
            own, true = (of[f"scale_factor_{name}_ppm"] for of in (found, truth))
            held[name] += own.low < true.value < own.high
            assert own.high - own.low < (100 if apart else 20)
    assert min(held.values()) >= 82, held  # 90 less 2.7 standard deviations


def test_the_angle_kept_without_power(folder, capsys):
    g, time = np.random.default_rng(0), np.concatenate([np.arange(300.0), np.arange(900.0, 1200.0)])
    angle = 3.0 + 1e-3 * time + g.normal(0, 1e-3, time.size) + np.where(time > 600, 0.25, 0.0)
    columns = {"time_s": time, "pattern_angle_deg": angle}
    write_record(Record(columns, instrument="free-dome", comments=("test: angle-storage",)), folder / "stored.csv")
    _, found, _ = judged(capsys, folder, ("stored",))
    (line,) = (one for one in found["quantities"] if one["key"] == "angle_storage_error_deg")
    assert abs(line["value"] - 0.25) < 2 * (line["high"] - line["low"]) / 2  # 3.3 standard deviations: one run of noise
    assert line["high"] - line["low"] < 0.01
    whole = {"time_s": np.arange(600.0), "pattern_angle_deg": np.zeros(600)}
    write_record(Record(whole, instrument="free-dome", comments=("test: angle-storage",)), folder / "whole.csv")
    status, _, said = judged(capsys, folder, ("whole",))
    assert status == 2
    assert "needs a gap" in said


def test_a_rest_record_in_deg_per_s_is_refused_and_a_rate_alone_is_asked_for_its_bias(folder, tmp_path, refuse, capsys):
    """It passed limits on N and bias 3600 times too easily."""
    rest = read_record(folder / "rest0.csv")
    write_record(rest.with_columns({"bias_deg_per_h": rest["bias_deg_per_h"] / 3600}), tmp_path / "rest.csv")
    assert "probably in °/s. Multiply it by 3600" in refuse(["acceptance", "hrg-30mm", tmp_path / "rest.csv"])
    rate = Record({"time_s": rest["time_s"], "measured_rate_deg_per_s": rest["bias_deg_per_h"] / 3600})
    write_record(rate, tmp_path / "rate.csv")
    assert main(["acceptance", "hrg-30mm", str(folder / "rest1.csv"), str(tmp_path / "rate.csv")]) == 0
    assert "bias_deg_per_h, 3600 times measured_rate_deg_per_s" in capsys.readouterr().err
