"""`hrg fit scale` from files: planted chain recovered, model applied and emitted, bad files named; printed claims."""

import contextlib
import ctypes
import io
import json
from pathlib import Path

import numpy as np
import pytest

from compensation.bell import apply_chain, design_smoother, smooth
from compensation.bell_calibration import BellRun, fit_chain
from compensation.rate_law import RateCurve, fit_rate_law
from studies.cli import main
from studies.errors import InputError
from studies.fits.scale import settled_rows, study_scale
from studies.fits.scale_law import read_law
from studies.models import compensate, emit_c, read_model
from studies.models.kinds.scale import load_scale
from studies.papers.bvg import (
    bell_chapters,
    examine_claims,
    read_printed_chain,
    reduce_white,
    reproduce_bell,
    simulate_runs,
)
from studies.record import Record, read_record, write_record
from studies.results.page import make_blocks
from tests.compiled import compile_c

STRIDE = 20


def write(path, run, missing=(), stride=STRIDE, step=0.1):
    """Every twentieth row of a run as a record of 10 Hz; the rows in `missing` lose their output."""
    lines = ["time_s,housing_temperature_degC,output_counts,rate_deg_per_s"]
    for i, row in enumerate(range(0, len(run.time), stride)):
        output = "" if i in missing else f"{run.output[row]:.6f}"
        lines.append(f"{step * i:.3f},{run.temperature[row]:.6f},{output},{run.rate[row]:.9g}")
    path.write_text("\n".join(lines) + "\n")
    return str(path)


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    folder, runs = tmp_path_factory.mktemp("scale"), simulate_runs(np.random.default_rng(2))
    return [write(folder / f"{name}.csv", run) for name, run in zip(("rates", "rest", "turning"), runs, strict=True)]


@pytest.fixture(scope="module")
def fitted(records, tmp_path_factory):
    """What `hrg fit scale` answers and leaves behind: JSON, model, page."""
    model, page = (tmp_path_factory.mktemp("fit") / name for name in ("model.toml", "page.html"))
    with contextlib.redirect_stdout(io.StringIO()) as told:
        assert main(["fit", "scale", *records[::-1], "--save", str(model), "--report", str(page), "--json"]) == 0
    return json.loads(told.getvalue()), model, page


def test_planted_chain_is_recovered_in_any_order_of_files(fitted):
    found = fitted[0]
    assert found["schema"] == "hrg.fit-scale/1"
    assert set(found["parts"]) == {"rough", "bias", "scale_over_rate", "scale_over_temperature"}
    gyro, parts = read_printed_chain(), found["parts"]
    # The factors of the scale are shared between three steps; their product at 25 °C and their shape are planted.
    at_25 = float(gyro.scale_over_temperature.value(25.0))
    share = parts["rough"]["scale"]["value"] / 0.0242
    assert parts["scale_over_rate"]["c1"]["value"] * share / at_25 == pytest.approx(0.99, abs=2e-4)
    quadratic = parts["scale_over_rate"]["c2"]
    off = quadratic["value"] * share**2 / at_25 - 5.89e-6
    assert abs(off) < 4 * quadratic["standard_error"]
    bias = parts["bias"]
    for name, planted in (("c1", -0.0056), ("c2", 2.52e-5)):
        assert abs(bias[name]["value"] - planted * share) < 4 * bias[name]["standard_error"]
    assert found["error_held_out_deg_per_s"] < 0.5 * found["error_before_deg_per_s"]
    assert found["rate_law"]["chosen"] == "quadratic"


def test_the_form_over_rate_is_chosen_by_evidence_and_rates_left_out():
    """A line, two scales, a square, a dead band are told apart; a shallow sine and a cubic may stand for one another."""
    x = np.array([-300.0, -200, -100, -50, -20, -5, -2, 2, 5, 20, 50, 100, 200, 300])
    for name, y in {
        "line": x,
        "directions": x + 2e-3 * np.maximum(x, 0),
        "quadratic": x + 5e-6 * x**2,
        "dead band": np.sign(x) * np.maximum(np.abs(x) - 0.8, 0),
        "sine": 400 * np.sin(x / 400),
    }.items():
        noise = 0.8 * np.random.default_rng(1).standard_normal(x.size)
        law = fit_rate_law(x, -690 + 40 * y + noise, np.full(x.size, 0.8))
        assert law.chosen.name == name
        assert not law.structure
    wavy = fit_rate_law(x, x + 0.5 * np.sin(x / 30), np.full(x.size, 0.02))
    assert wavy.structure


def three_records():
    """Rates at 20 °C, rest and 60 °/s from -20 to 50 °C of one gyro, with noise of 2 m°/s."""
    rng, records = np.random.default_rng(5), []
    table = np.repeat([0.0, 10, -10, 30, -30, 60, -60, 90, -90, 0], 120)
    for rate, step, T in ((table, 0.5, 20.0), (np.zeros(3000), 2.0, None), (np.full(3000, 60.0), 2.0, None)):
        T = np.linspace(-20.0, 50.0, rate.size) if T is None else T + 0.01 * rng.standard_normal(rate.size)
        output = rate * (1 - 2e-5 * (T - 20)) * (1 + 1e-6 * rate) + 3e-3 + 1e-4 * (T - 20)
        columns = {"time_s": step * np.arange(rate.size), "rate_deg_per_s": rate, "housing_temperature_degC": T}
        columns["measured_rate_deg_per_s"] = output + 2e-3 * rng.standard_normal(rate.size)
        records.append(Record(columns, path=f"{len(records)}.csv"))
    return records


@pytest.mark.parametrize(
    ("k", "name", "read", "said"),
    [
        (0, "measured_rate_deg_per_s", lambda y: np.roll(y, 60), "0.csv: measured_rate_deg_per_s is 30 s behind rate_"),
        (
            1,
            "measured_rate_deg_per_s",
            lambda y: 3600 * y,
            "1.csv: measured_rate_deg_per_s is in °/h: read so, one chain",
        ),
        (
            2,
            "measured_rate_deg_per_s",
            lambda y: 0.95 * y,
            "contradict each other: .* Without 2.csv it leaves 0.002 °/s",
        ),
        (
            2,
            "housing_temperature_degC",
            lambda T: 1.8 * T + 32,
            "2.csv: housing_temperature_degC is in °F: read so, one chain",
        ),
    ],
    ids=["late", "per hour", "another gyro", "degF"],
)
def test_planted_contradictions_of_records_are_refused_and_none_is_seen_in_right_ones(k, name, read, said):
    """A model was saved that was wrong by 0.01 to 8.5 °/s on what was held out; of a late record the applied rate was said to be missing."""
    records = three_records()
    assert study_scale(records, None, 50).error_held_out < 2.2e-3
    records[k] = records[k].with_columns({name: read(records[k][name])})
    with pytest.raises(InputError, match=said):
        study_scale(records, None, 50)


@pytest.mark.parametrize("settled", [False, True])
def test_a_rate_table_over_temperature_tells_warming_from_cooling(settled):
    """Thirteen rates again and again in a chamber that warms and cools, or at temperatures reached by either: what was planted comes back."""
    rng, time = np.random.default_rng(4), 0.1 * np.arange(26 * 130)
    rate = np.repeat(np.tile(np.linspace(-300.0, 300.0, 13), 10), 26)
    away, warming = 15 * np.sin(2 * np.pi * time / time[-1]), np.sign(np.cos(2 * np.pi * time / time[-1]))
    if settled:
        up, down = range(-15, 16, 6), range(9, -10, -6)
        away = np.repeat([*up, *down], 13 * 26) + 0.01 * rng.standard_normal(time.size)
        warming = np.repeat([1.0] * len(up) + [-1.0] * len(down), 13 * 26)
    output = -690 + 40 * rate + 2 * away + 0.01 * away * rate + 3 * warming + 0.5 * rng.standard_normal(time.size)
    law = read_law([BellRun(time, output, 20 + away, rate)])
    assert law.chosen.name == "line"
    assert set(law.chosen.over) == {"temperature", "warming"}
    assert not law.structure
    for name, value, within in (
        ("k", 40, 1e-3),
        ("a_T", 2, 0.02),
        ("k_T", 0.01, 1e-4),
        ("a_warming", 3, 0.1),
        ("k_warming", 0, 1e-3),
    ):
        assert law.chosen.values[name] == pytest.approx(value, abs=within)


@pytest.mark.parametrize("planted", ["cubic", "rising cubic", "sine", "dead band", "directions"])
def test_the_saved_model_takes_the_law_that_was_chosen(planted, tmp_path, ask):
    """Other rates than those of the fit come back to the noise (0.05 °/s), in C too; within a dead band no rate is made up."""
    output_of = {
        "cubic": lambda x: x - 4e-7 * x**3,
        "rising cubic": lambda x: x + 2e-6 * x**3,
        "sine": lambda x: 320 * np.sin(x / 320),
        "dead band": lambda x: np.sign(x) * np.maximum(np.abs(x) - 1.5, 0),
        "directions": lambda x: x + 4e-3 * np.maximum(x, 0),
    }[planted]
    rng = np.random.default_rng(3)

    def table(name, rates):
        rate, rows = np.repeat(rates, 200), np.arange(200 * len(rates))
        counts = -690 + 40 * (output_of(rate) + 0.05 * rng.standard_normal(rate.size))
        run = BellRun(0.1 * rows, counts, np.full(rate.size, 25.0) + 0.01 * np.sin(rows), rate)
        return write(tmp_path / name, run, stride=1), rate

    seen, _ = table("seen.csv", np.r_[-300.0, -200:201:50, 300, -20, -8, -4, 4, 8, 20])
    unseen, rate = table("unseen.csv", np.r_[-270.0, -170, -70, -30, -6, 0, 6, 30, 70, 170, 270])
    found = ask(["fit", "scale", seen, "--no-filter", "--save", str(tmp_path / "m.toml")])
    assert found["rate_law"]["chosen"] == planted.removeprefix("rising ")
    model, record = read_model(tmp_path / "m.toml"), read_record(unseen)
    column = compensate(model, record)["compensated_measured_rate_deg_per_s"]
    hidden = (rate == 0) & (planted == "dead band")
    assert np.array_equal(np.isnan(column), hidden)
    noise = 0.05 / np.gradient(output_of(rate[~hidden] + np.array([[-1e-3], [1e-3]])), 2e-3, axis=0)[0]
    error = (column - rate)[~hidden] / noise
    assert np.sqrt(np.mean(error**2)) == pytest.approx(1, abs=0.05)
    assert np.max(np.abs(error.reshape(-1, 200).mean(axis=1))) < 0.5
    library = compile_c(emit_c(model), tmp_path, "25 rows, 0 differ")
    library.hrg_rate.restype, library.hrg_rate.argtypes = ctypes.c_double, [ctypes.c_double] * 2
    rows = zip(record["output_counts"], record["housing_temperature_degC"], strict=True)
    np.testing.assert_allclose([library.hrg_rate(*row) for row in rows], column, rtol=1e-9, atol=1e-11)


def test_saved_model_is_the_fitted_chain_and_compensates(records, fitted):
    assert fitted[2].stat().st_size > 10_000
    model = read_model(fitted[1])
    data = read_record(records[2])
    column = compensate(model, data)["compensated_measured_rate_deg_per_s"]
    assert np.mean(column[100:]) == pytest.approx(300, abs=0.1)
    assert np.std(column[100:]) < 0.1
    again = apply_chain(load_scale(model), data["time_s"], data["output_counts"], data["housing_temperature_degC"])
    np.testing.assert_allclose(again.filtered, column, rtol=1e-12)
    with pytest.raises(InputError, match="extrapolate"):
        compensate(model, data.with_columns({"housing_temperature_degC": data["housing_temperature_degC"] + 20}))


@pytest.mark.slow
def test_the_records_of_the_fit_are_compensated(tmp_path, capsys):
    """At 100 Hz a fit is of block averages: neither their narrower range nor an outlier refuses the rows they are made of."""
    records, model = [], tmp_path / "model.toml"
    for name, run in zip(("rates", "rest", "turning"), simulate_runs(np.random.default_rng(2)), strict=True):
        run.output[1554] += 1e6
        records.append(write(tmp_path / f"{name}.csv", run, stride=2, step=run.time[2]))
    assert main(["fit", "scale", *records, "--save", str(model)]) == 0
    for record in records:
        assert main(["compensate", str(model), record, "--out", str(tmp_path / "out.csv")]) == 0, (
            capsys.readouterr().err
        )
    assert "After: standard deviation of" in (said := capsys.readouterr().out)  # counts have no rate before
    assert "Before" not in said
    far = read_record(records[2])
    hot = far.with_columns({"housing_temperature_degC": far["housing_temperature_degC"] + 20})
    with pytest.raises(InputError, match="extrapolate"):
        compensate(read_model(model), hot)


def test_gaps(records, fitted, tmp_path):
    """With the filter a gap is refused; without it the row stays empty."""
    models = [fitted[1], tmp_path / "without.toml"]
    assert main(["fit", "scale", *records, "--no-filter", "--save", str(models[1])]) == 0
    holed = read_record(write(tmp_path / "holed.csv", simulate_runs(np.random.default_rng(3))[1], missing=(7,)))
    with pytest.raises(InputError, match="row 8"):
        compensate(read_model(models[0]), holed)
    column = compensate(read_model(models[1]), holed)["compensated_measured_rate_deg_per_s"]
    assert np.flatnonzero(np.isnan(column)).tolist() == [7]


def test_outliers_and_gaps_in_the_calibration_are_left_out(records, fitted, tmp_path, ask):
    clean = fitted[0]
    lines = Path(records[1]).read_text().splitlines()
    for row in (50, 700, 2000):
        cells = lines[row].split(",")
        lines[row] = ",".join([cells[0], cells[1], "99999", cells[3]])
    lines[900] = ",".join([*lines[900].split(",")[:2], "", "0"])
    holed = tmp_path / "holed.csv"
    holed.write_text("\n".join(lines) + "\n")
    page = tmp_path / "page.html"
    found = ask(["fit", "scale", records[0], str(holed), records[2], "--report", str(page)])
    assert found["rows_left_out"] == 4
    assert len(found["steps"]) == 4
    for name, coefficient in found["parts"]["bias"].items():
        before = clean["parts"]["bias"][name]
        assert abs(coefficient["value"] - before["value"]) < 0.5 * before["standard_error"]


def test_emitted_c_agrees_with_python(records, fitted, tmp_path):
    model = read_model(fitted[1])
    library = compile_c(emit_c(model), tmp_path, "25 rows, 0 differ")
    library.hrg_rate.restype = library.hrg_smooth.restype = ctypes.c_double
    library.hrg_rate.argtypes = [ctypes.c_double] * 2
    library.hrg_smooth.argtypes = [ctypes.c_void_p, ctypes.c_double]
    state = (ctypes.c_double * 60)()  # 51 doubles and one int, zero: not filled
    data = read_record(records[1])
    emitted = [
        library.hrg_smooth(ctypes.byref(state), library.hrg_rate(output, temperature))
        for output, temperature in zip(data["output_counts"], data["housing_temperature_degC"], strict=True)
    ]
    np.testing.assert_allclose(
        emitted, compensate(model, data)["compensated_measured_rate_deg_per_s"], rtol=1e-9, atol=1e-12
    )


def test_printed_claims():
    """Recomputed here from the printed coefficients by other means than the code's."""
    claims = examine_claims()
    T = np.linspace(-45, 55, 100_001)
    assert claims.bias_deviation[0] == pytest.approx(np.std(2.52e-5 * T**2 - 0.0056 * T + 0.1673), rel=1e-3)
    assert claims.bias_deviation[1] == pytest.approx(np.sqrt(0.1624**2 - 0.0619**2), rel=1e-12)
    assert claims.scale_deviation[0] == pytest.approx(300 * np.std(-1.26e-7 * T**2 - 1.83e-5 * T), rel=1e-3)
    # A parabola c x² over ±R departs from its line by 2/3 c R², at the ends.
    assert claims.curvature_nonlinearity == pytest.approx(2 / 3 * 5.89e-6 * 360, rel=1e-3)
    assert claims.mapped[0] == pytest.approx(5.89e-6 * 361.4**2 - 0.99 * 361.4 - 0.12, rel=1e-9)
    assert claims.mapped[0] == pytest.approx(-357.1, abs=0.05)
    assert claims.noise_deviation == pytest.approx(0.1466, abs=1e-4)
    assert dict(claims.averaging)[100.0] == pytest.approx(1.0, abs=0.002)


@pytest.mark.slow
def test_paper_twin():
    """Each step does what it can on runs not seen, and the filter leaves the random walk at long times alone."""
    twin = reproduce_bell(seed=1)
    steps = {figures.step: figures for figures in twin.held_out}
    rough, straight, linear, steady, filtered = steps.values()
    assert straight.at_rest < 0.8 * rough.at_rest
    assert linear.nonlinearity < 0.1 * straight.nonlinearity
    assert steady.turning < 0.8 * linear.turning
    assert rough.nonlinearity == pytest.approx(twin.claims.curvature_nonlinearity, rel=0.1)
    # White noise of 2.78 °/√h at 10 Hz is what remains before the filter, the wander adds little.
    assert steady.at_rest == pytest.approx(twin.claims.noise_deviation, rel=0.05)
    assert steady.random_walk_1s / filtered.random_walk_1s == pytest.approx(dict(twin.claims.averaging)[1.0], rel=0.02)
    assert steady.random_walk_100s / filtered.random_walk_100s == pytest.approx(1.0, abs=0.01)
    assert [len(make_blocks(*chapter.parts)) for chapter in bell_chapters(twin)] == [5, 1]


def test_filter_reduces_the_allan_deviation_as_predicted():
    """The factor against the Allan deviation of filtered white noise."""
    from compensation.bell import design_smoother, smooth
    from compensation.stability import allan_deviation

    taps = design_smoother(0.1, 0.5)
    noise = np.random.default_rng(6).standard_normal(200_000)
    before, after = allan_deviation(noise, 0.1), allan_deviation(smooth(noise, taps), 0.1)
    for rows in (1, 8, 64):
        k = int(np.argmin(np.abs(before.tau - 0.1 * rows)))
        assert before.tau[k] == pytest.approx(0.1 * rows)
        assert before.deviation[k] / after.deviation[k] == pytest.approx(reduce_white(taps, rows), rel=0.03)


@pytest.mark.slow
def test_long_runs_are_averaged_for_the_fit(monkeypatch):
    """Block averages give the same chain as the rows, and no block mixes two applied rates."""
    from studies.fits import scale

    rates, rest, turning = (
        BellRun(run.time[::4], run.output[::4], run.temperature[::4], run.rate[::4])
        for run in simulate_runs(np.random.default_rng(5))
    )
    whole = fit_chain(rates, rest, turning, cutoff=None)
    monkeypatch.setattr(scale, "MOST_ROWS", 2000)
    thin = [scale._thin(run) for run in (rates, rest, turning)]
    assert all(1900 < len(run.time) <= 2001 for run in thin)
    assert len(np.unique(np.round(thin[0].rate, 6))) == 19
    averaged = fit_chain(*thin, cutoff=None)
    for name in ("bias", "scale_over_rate", "scale_over_temperature"):
        one, other = getattr(whole, name), getattr(averaged, name)
        error = np.sqrt(np.diag(one.covariance))
        assert np.all(np.abs(one.coefficients - other.coefficients) < 0.5 * error)


def test_settled_rows():
    rate = np.array([0.0, 0, 0, 5, 5, 5, 5, 0, 0])
    assert settled_rows(rate, 2).tolist() == [True, True, True, False, False, True, True, False, False]


def test_a_record_given_twice_counts_once(records, tmp_path, ask, refuse):
    once, twice = (ask(["fit", "scale", *[records[0]] * n])["rate_law"]["forms"] for n in (1, 2))
    assert once == twice
    other = write(tmp_path / "other.csv", simulate_runs(np.random.default_rng(3))[1])
    assert "both runs at rest" in refuse(["fit", "scale", *records[:2], other])


@pytest.mark.parametrize(
    ("files", "more", "words"),
    [
        ([1, 2], [], "of several rates"),
        ([], [], "DATA is missing"),
        (
            [0, 1, 2],
            ["--cutoff", "200"],
            "rest.csv: the FIR filter's cut-off of 200 Hz is impossible at an output every 0.1 s; give --cutoff 4, or --no-filter.",
        ),
    ],
)
def test_missing_runs_and_an_impossible_cut_off_are_named(records, files, more, words, refuse):
    assert words in refuse(["fit", "scale", *(records[i] for i in files), *more])


@pytest.mark.parametrize("files", [[0], [0, 1], [0, 2]])
def test_fewer_records_tell_less(records, files, tmp_path, ask, refuse):
    """The scale over rate is there; what lacks is named, and the model is refused beyond the temperatures of the record of rates."""
    model = str(tmp_path / "model.toml")
    found = ask(["fit", "scale", *(records[i] for i in files), "--save", model])
    lacking = [("bias over temperature", 1), ("scale over temperature", 2)]
    assert found["undetermined"] == [what for what, file in lacking if file not in files]
    whole = read_printed_chain()
    share = found["parts"]["rough"]["scale"]["value"] / 0.0242
    at_25 = float(whole.scale_over_temperature.value(25.0))
    c1 = found["parts"]["scale_over_rate"]["c1"]["value"] * share
    assert c1 == pytest.approx(0.99 * at_25, rel=5e-3)
    assert found["parts"]["bias"]["c2"]["value"] == 0.0 or 1 in files
    error = refuse(["compensate", model, records[1], "--out", str(tmp_path / "out.csv")])
    assert "°C" in error or "temperature" in error
    assert ask(["compensate", model, records[0], "--out", str(tmp_path / "out.csv")])["columns"]


@pytest.mark.slow
def test_rough_calibration_of_the_paper_is_taken(records, tmp_path, capsys):
    """Five minutes of rest, then +100 °/s (eq. 33): null = mean at rest, scale = 100 °/s over the difference of the means."""
    generator = np.random.default_rng(9)
    output = np.where(np.arange(6000) < 3000, -690.0, 3500.0) + generator.normal(0, 3.0, 6000)
    time, rate = 0.1 * np.arange(6000), np.repeat([0.0, 100.0], 3000)
    rough = write(tmp_path / "rough.csv", BellRun(time, output, np.full(6000, 25.0), rate), stride=1)
    assert main(["fit", "scale", rough, *records, "--json"]) == 0
    said = capsys.readouterr()
    found = json.loads(said.out)["parts"]["rough"]
    step = output[3000:].mean() - output[:3000].mean()
    assert found["null"]["value"] == pytest.approx(output[:3000].mean(), rel=1e-6)
    assert found["scale"]["value"] == pytest.approx(100 / step, rel=1e-6)


@pytest.mark.slow
def test_rate_is_read_from_the_bells_own_elements():
    """(27)–(29) and the second form of (24) on the card's bell; σ_φφ alone is near ν/(1 + ν) = 0.23 where the wall only bends around."""
    from studies.papers.bvg_theory import read_planted_rate

    reading = read_planted_rate(2.0)
    assert reading.from_charges == pytest.approx(2.0, rel=1e-6)
    assert reading.second_form == pytest.approx(2.0, rel=1e-4)
    assert 0.1 < reading.printed_share < 0.25


def test_the_saved_model_tells_warming_from_cooling(tmp_path, ask):
    """An output 8 counts (0.2 °/s) off either way, in a rate table: another table comes back to its noise."""

    def table(name, seed, turns):
        rng, time = np.random.default_rng(seed), 0.1 * np.arange(26 * 13 * 20)
        rate = np.repeat(np.tile(np.linspace(-300.0, 300.0, 13), 20), 26)
        x = 2 * np.pi * turns * time / time[-1]
        away, warming = 15 * np.sin(x), np.sign(np.cos(x))
        output = (
            -690
            + 40 * rate
            + 2 * away
            + 0.01 * away * rate
            + warming * (8 + 0.02 * rate)
            + rng.standard_normal(time.size)
        )
        return write(tmp_path / name, BellRun(time, output, 20 + away, rate), stride=1), rate, away

    seen, unseen = table("seen.csv", 1, 1), table("unseen.csv", 2, 2)
    model, out = tmp_path / "m.toml", tmp_path / "out.csv"
    found = ask(["fit", "scale", seen[0], "--save", str(model)])
    assert {one["form"]: one["over"] for one in found["rate_law"]["forms"]}["line"] == "temperature, warming"
    assert found["undetermined"] == []
    ask(["compensate", str(model), unseen[0], "--out", str(out), "--extrapolate"])
    away = read_record(out)["compensated_measured_rate_deg_per_s"] - unseen[1]
    settled = np.arange(away.size) > 400  # until the temperature has moved by the turn
    assert np.sqrt(np.mean(away[settled] ** 2)) < 0.08


def test_a_filter_leaves_out_what_a_dead_band_hides():
    x = np.ones(300)
    x[100:103] = np.nan
    smoothed = smooth(x, design_smoother(0.1, 1.0))
    assert np.flatnonzero(np.isnan(smoothed)).tolist() == [100, 101, 102]
    np.testing.assert_allclose(smoothed[~np.isnan(smoothed)], 1.0)


@pytest.mark.parametrize(("form", "s"), [("cubic", -1e-7), ("sine", 400.0), ("dead band", 1.5), ("directions", 4e-3)])
def test_limits_the_inverse_of_a_law_gives_its_rate_back(form, s):
    curve = RateCurve(np.array([0.3, 1.02, s]), np.zeros((3, 3)), -300.0, 300.0, form)
    rate = np.array([-250.0, -20.0, 10.0, 299.0])
    np.testing.assert_allclose(curve.value(curve.inverse(rate)), rate, rtol=1e-12)


@pytest.mark.parametrize("output", ["output_counts", "measured_rate_deg_per_s"])
@pytest.mark.parametrize(
    ("k", "times", "said"),
    [
        (0, -1.0, "rate_deg_per_s has the opposite sign: {} changes -"),
        (2, np.pi / 180, "rate_deg_per_s is in rad/s: {} changes 57."),
        (2, 3600.0, "Divide the column by 3600."),
    ],
)
def test_an_applied_rate_of_another_sign_or_unit_is_named(tmp_path, refuse, k, times, said, output):
    """Each was fitted as a scale over temperature of −1, 0.017 or 3600."""
    time = 0.5 * np.arange(800)
    warm = 25.0 + 40.0 * np.sin(time / 60)
    runs = [(np.repeat([0.0, -200, -50, 50, 200], 160), 25.0 + 0 * time), (0 * time, warm), (0 * time + 250, warm)]
    paths, noise = [], np.random.default_rng(1)
    for j, (rate, T) in enumerate(runs):
        read = rate * (1 + 1e-4 * (T - 25)) + 0.01 * T + 0.05 * noise.standard_normal(time.size)
        read = read if output != "output_counts" else -690 + 40 * read
        columns = {"time_s": time, "housing_temperature_degC": T, "rate_deg_per_s": rate * (times if j == k else 1.0)}
        paths.append(tmp_path / f"run{j}.csv")
        write_record(Record(columns | {output: read}), paths[-1])
    error = refuse(["fit", "scale", *map(str, paths)])
    assert f"run{k}.csv" in error
    assert said.format(output) in error
