"""`hrg show`: planted steps, faults and noise are found where they are, and the commands that it names do run."""

import json
import re
import shlex
import shutil
from base64 import b64decode
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from compensation.noise import Noise
from compensation.spikes import STUCK, find_dropouts, find_stuck
from studies.cli import main
from studies.errors import InputError
from studies.record import Record, read_record, write_record
from studies.record.survey import find_density, find_steps, survey_column, survey_record
from studies.reports import style
from studies.results.page import draw
from tests.golden.answers import CASES

INPUTS = Path(__file__).parents[1] / "golden" / "inputs"
T = np.arange(4000.0)


@pytest.fixture
def noise():
    return np.random.default_rng(5).standard_normal(T.size)


def test_planted_steps_are_found_and_bends_are_not(noise):
    y = noise.copy()
    y[1500:] += 8.0
    y[3000:] -= 8.0
    found = find_steps(T, y)
    assert [round(step.time) for step in found] == pytest.approx([1500, 3000], abs=1.5)
    assert [step.size for step in found] == pytest.approx([8.0, -8.0], abs=4 * np.sqrt(8 / 25))
    assert not find_steps(T, noise)
    ramp = np.interp(T, [0, 1000, 1100, 4000], [0, 0, 50, 50])
    assert not find_steps(T, ramp)
    assert not find_steps(T, ramp + 0.01 * noise)
    there = np.random.default_rng(2).random(T.size) > 0.01  # a slope across rows that are missing is no step
    assert not find_steps(T[there], 40 * np.exp(-T[there] / 300))
    assert not find_steps(T, np.where(T < 1000, 0, 40 * (1 - np.exp(-(T - 1000) / 300))))


def test_planted_small_steps_are_found_in_means_of_rows():
    time = np.arange(20_000.0)
    noise = np.random.default_rng(8).standard_normal(time.size)
    (found,) = find_steps(time, noise + np.where(time < 12_345, 0, 0.9))
    assert found.time == pytest.approx(12_345, abs=130)
    assert found.size == pytest.approx(0.9, abs=0.4)
    for shape in (
        0 * time,
        30 * np.sin(time / 1500),
        40 * np.exp(-time / 3000),
        np.interp(time, [5000, 9000], [0, 40]),
    ):
        assert not find_steps(time, noise + shape)
        assert not find_steps(time, 0.01 * noise + shape)


def test_planted_faults_of_readings_are_counted(noise):
    y = 4432 + noise
    y[100:140] = y[100]
    y[700], y[900], y[901] = 4532.0, 0.0, 0.0
    column = survey_column("frequency_Hz", T, y)
    assert (column.stuck, column.zeros) == (40, 2)
    assert column.spikes >= 1
    coarse = np.round(np.cumsum(noise) / 200, 1)  # readings that repeat because they are coarse
    assert not find_stuck(coarse).any()
    assert find_stuck(np.r_[noise[:50], np.full(STUCK, 1.0), noise[:50]]).sum() == STUCK
    assert not find_dropouts(np.round(noise)).any()


def test_planted_a_line_stands_out_of_the_spectrum_of_a_record_with_a_gap(noise):
    """0.02 Hz of amplitude 0.6 in white noise of 1 at 1 Hz: 10 times its level in every eighth of the rows, none of them lost."""
    time = np.delete(np.arange(float(noise.size)), np.r_[700, 2000:2200])
    found = find_density(
        time, np.delete(noise + 0.6 * np.sin(2 * np.pi * 0.02 * np.arange(noise.size)), np.r_[700, 2000:2200])
    )
    assert found.even
    level = np.median(found.density)
    assert level == pytest.approx(2.0, rel=0.1)
    assert found.frequency[np.argmax(found.density)] == pytest.approx(0.02, rel=0.02)
    assert found.density.max() > 10 * level


@pytest.mark.parametrize("even", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_limits_the_density_of_white_noise_is_twice_variance_times_step(noise, even):
    time = T if even else np.sort(np.random.default_rng(2).uniform(0, T.size, T.size))
    found = find_density(time, noise + 3 + 0.01 * time)
    assert found.even is even
    upper = found.density[found.frequency > 0.02]
    assert np.mean(upper) == pytest.approx(2 * noise.var(), rel=0.15)


def test_recovery_levels_of_noise_are_read_off():
    planted = Noise(white=2.0, walk=0.02)
    y = planted.draw(40_000, 1.0, np.random.default_rng(3))
    found = survey_column("bias_deg_per_h", np.arange(y.size) * 1.0, y).stability.noise
    assert found.N == pytest.approx(2.0, abs=4 * found.N_uncertainty)
    assert found.K == pytest.approx(0.02, abs=4 * found.K_uncertainty)


def test_limits_white_noise_is_rounding_at_least():
    """A slow ramp in steps of 0.001 has few second differences: its noise was 5e-15, that of the computer."""
    t = np.arange(0.0, 10000.0, 5.0)
    found = survey_column("housing_temperature_degC", t, np.round(20 + 2e-5 * t, 3))
    assert found.white == pytest.approx(1e-3 / np.sqrt(12) * np.sqrt(5.0), rel=1e-6)


def test_planted_correlation_of_changes_tells_a_cause_from_a_drift():
    rng = np.random.default_rng(4)
    drift, driver = T / 400, rng.standard_normal(200).repeat(20)
    columns = {
        "time_s": T,
        "quadrature_V": drift + driver,
        "drive_amplitude_V": drift + rng.standard_normal(200).repeat(20),
    }
    columns["bias_deg_per_h"] = 2 * driver + 0.1 * rng.standard_normal(T.size)
    pairs = {frozenset((one["one"], one["two"])): one for one in survey_record(Record(columns)).correlations}
    assert pairs[frozenset(("quadrature_V", "drive_amplitude_V"))]["values"] > 0.7
    assert abs(pairs[frozenset(("quadrature_V", "drive_amplitude_V"))]["changes"]) < 0.3
    assert pairs[frozenset(("quadrature_V", "bias_deg_per_h"))]["changes"] > 0.9


@pytest.mark.slow
def test_contract_what_is_named_possible_runs_and_what_is_missing_is_said(tmp_path, ask, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(INPUTS / "cross.csv", tmp_path)
    uses = {use["command"]: use for use in ask(["show", "cross.csv"])["uses"]}
    cross = uses["fit cross-damping"]  # the record has no frequency_Hz and no inverse_q
    assert "cross.csv --frequency HZ --quality Q --save" in cross["line"]
    assert main(shlex.split(cross["line"].replace("HZ", "5000").replace(" Q ", " 2e4 "))[1:]) == 0
    assert cross["ready"]
    assert "pattern_angle_deg" in uses["fit whole-angle"]["missing"]
    assert "rate_deg_per_s" in uses["fit scale"]["missing"]
    assert uses["fit bias"]["ready"]


@pytest.mark.slow
def test_contract_every_line_that_is_named_possible_runs(tmp_path, ask, monkeypatch):
    """But for those that have a golden answer with the same words; fits to their second step, the diagnosis up to its search."""
    search = Mock(side_effect=InputError("as far as this"))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("studies.calibration.fit.MOST_STEPS", 2)
    monkeypatch.setattr("studies.inference.diagnosis.infer", search)
    run = read_record(INPUTS / "run1.csv")
    write_record(replace(run, columns={name: own[::4] for name, own in run.columns.items()}), "run1.csv")
    for use in ask(["show", "run1.csv"])["uses"]:
        words = shlex.split(use["line"].replace("CARD.toml", "hrg-30mm"))[1:]
        known = any(case["words"] == shlex.join(words[: case["words"].count(" ") + 1]) for case in CASES.values())
        if use["ready"] and not known:
            assert main(words) == (2 if words[0] == "diagnose" else 0), use["line"]
    search.assert_called_once()


def test_contract_bad_input_is_one_sentence(tmp_path, capsys):
    assert main(["show"]) == 2
    write_record(Record({"time_s": np.array([0.0]), "frequency_Hz": np.array([np.nan])}), tmp_path / "short.csv")
    assert main(["show", str(tmp_path / "short.csv"), "--report", str(tmp_path / "page.html")]) == 0
    apart = np.array([np.nan, 1.0])  # a logger that writes its channels in turn
    turns = {
        "time_s": np.arange(80.0),
        "housing_temperature_degC": 20 + np.tile(apart, 40),
        "frequency_Hz": 4e3 + np.tile(apart[::-1], 40),
    }
    write_record(Record(turns), tmp_path / "turns.csv")
    assert main(["show", str(tmp_path / "turns.csv")]) == 0
    assert main(["show", str(tmp_path / "none.csv")]) == 2
    assert capsys.readouterr().err.count("Traceback") == 0


@pytest.mark.slow
def test_contract_numbers_of_a_figure_lie_where_the_picture_has_them():
    x, y = np.linspace(1, 3, 7), np.geomspace(1, 1000, 7)
    with style.figure(1, 2, x="x <b>", y="y (V)") as (made, axes):
        axes[0].semilogy(x, y, color="#123456", label="a line")
        axes[1].imshow(np.eye(3))
    picture = draw(made, "caption", "alt")
    (plot,) = json.loads(picture.curves)
    assert "<" not in picture.curves
    assert plot["x"]["label"] == "x <b>"
    (line,) = plot["series"]
    assert line["x"] == pytest.approx(x)
    assert line["y"] == pytest.approx(y, rel=1e-5)
    svg = b64decode(picture.data_uri.split(",", 1)[1]).decode()
    width, height = map(float, re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', svg).groups())
    path = re.search(r'<path d="([^"]*)"[^>]*style="fill: none; stroke: #123456', svg)[1]
    drawn = np.array([[float(v) for v in pair] for pair in re.findall(r"[ML] ([\d.]+) ([\d.]+)", path)])
    (left, top, wide, high), (low, up) = plot["box"], np.log10(plot["y"]["ends"])
    ends = plot["x"]["ends"]
    told_x = (left + wide * (x - ends[0]) / (ends[1] - ends[0])) * width
    told_y = (top + high * (1 - (np.log10(y) - low) / (up - low))) * height
    assert drawn[:, 0] == pytest.approx(told_x, abs=0.5)
    assert drawn[:, 1] == pytest.approx(told_y, abs=0.5)


def test_contract_shaded_gaps_and_lines_across_are_numbers_that_a_browser_reads():
    with style.figure() as (made, axes):
        axes.plot([0, 1, 2], [1.0, np.nan, 3.0])
        axes.axvline(1.0)
        axes.broken_barh([(0.5, 1.0)], (0, 1), transform=axes.get_xaxis_transform())
        axes.fill_between([0, 1], [0, 1], [1, 2])

    def refuse(word):
        raise AssertionError(word)

    (plot,) = json.loads(draw(made, "caption", "alt").curves, parse_constant=refuse)
    assert [(one["kind"], one["across"]) for one in plot["series"]] == [
        ("line", ""),
        ("line", "y"),
        ("area", "y"),
        ("area", ""),
    ]
    assert plot["series"][0]["y"] == [1.0, None, 3.0]


def test_limits_what_is_drawn_of_many_rows_has_every_extreme():
    y = np.zeros(200_000)
    y[123_456], y[7] = 5.0, np.nan
    rows = style.outline_rows(y)
    assert {0, 7, 123_456, y.size - 1} <= set(rows)
    assert rows.size <= 2 * style.MOST_POINTS


def test_limits_the_density_far_below_its_largest_value(noise):
    """A housing that follows its chamber smoothly: the readings' own noise, 1e16 times less, is twice variance times step."""
    found = find_density(T, 2e4 * np.sin(T / 600.0) + 1e-4 * noise)
    assert (found.density > 0).all()
    upper = found.density[(found.frequency > 0.42) & (found.frequency < 0.49)]
    assert upper == pytest.approx(np.full(upper.size, 2e-8), rel=0.6)
