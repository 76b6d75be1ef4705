"""What is said of measured data that nobody of this project wrote, in bands from what their owners or a second look know of them.

Sources and licences: `tests/reference/measured/SOURCES.md`. Known and not found here: the memory of axis y, which
one cycle of 70 min does not tell from a wander of its size; like the voltmeter's second lag, whose log evidence in one sweep is near
the margin, it may be left open, never called noise of another size or given a false name.
"""

import datetime
from dataclasses import replace

import pytest

from studies.record import read_record
from studies.workbench import diagnose_records
from tests.measured import DATA, bring_in
from tests.sketches import coarsen

pytestmark = pytest.mark.slow


def diagnose(*records):
    read = [one if hasattr(one, "columns") else read_record(str(one)) for one in records]
    return diagnose_records(read).verdict


@pytest.fixture(scope="module")
def chamber(tmp_path_factory):
    """The three axes of a gyro in a chamber, one record each."""
    folder = tmp_path_factory.mktemp("imu")
    bring_in("imu_chamber.txt", folder, ('unit = "deg/s"', 'unit = "rad/s"'))
    return folder


@pytest.mark.parametrize(("axis", "when", "means"), [("x", 1021.0, "fine"), ("z", 1448.0, "coarse")])
def test_the_step_of_an_axis_is_named_with_its_moment(chamber, axis, when, means, request):
    """Known: x by +454 ± 26 °/h at 1021 s, z by -199 ± 17 at 1448; a step was once named with probability 0.10."""
    request.getfixturevalue(means)
    verdict = diagnose(chamber / f"run_{axis}.csv")
    jump = next(cause for cause in verdict.causes if cause.effect == "jump")
    assert jump.probability > 0.7
    assert jump.parameters["time_s"].value == pytest.approx(when, abs=6)
    if axis == "z":
        step = jump.parameters["step_deg_per_h"]
        assert step.low < -199 + 17
        assert step.high > -199 - 17
        assert verdict.responses["bias_deg_per_h"].verdict == "explained"


def test_noise_of_the_third_axis_is_split_into_white_and_wander(chamber):
    """Known: a cubic leaves 196 °/h, white noise is 73."""
    (found,) = diagnose(chamber / "run_y.csv").as_dict()["responses"].values()
    assert found["baseline"]["residual_rms"] == pytest.approx(196, rel=0.1)
    assert found["white"] == pytest.approx(73, rel=0.15)
    assert found["wander"] > 0.5 * found["white"]


@pytest.mark.usefixtures("coarser")
def test_bursts_whose_range_a_law_explains_get_no_name(tmp_path):
    scale = ("scale = 1.0 ", "scale = 0.00390625 "), ("offset = 0.0 ", "offset = -231.0 ")
    bring_in("pan_bursts.csv", tmp_path, *scale)
    assert not diagnose(tmp_path / "run_x.csv").causes


def resistor():
    """Three of four repeats of one staircase, two hours apart: the last moves as little as the one before."""
    records, start = [], datetime.datetime(2018, 2, 3)
    for k in (1, 2, 3):
        records.append(replace(read_record(str(DATA / f"resistor_run{k}.csv")), start=start))
        start += datetime.timedelta(seconds=float(records[-1]["time_s"][-1]) + 7200.0)
    return records


def test_a_resistor_that_relaxes_from_run_to_run_ages(only, monkeypatch):
    """Known: -8.8 and -1.7 ppm from run to run, white noise 0.08 ppm of 10 kilohm."""
    only("ageing", "jump")
    coarsen(monkeypatch, 50)
    verdict = diagnose(*resistor())
    if verdict.verdict == "unexplained" and not verdict.causes:
        pytest.xfail("left unexplained: the lag of the first fit, 1.6 h, follows what relaxes from run to run")
    (cause,) = verdict.causes
    assert "ageing" in {cause.effect, *cause.equivalent}
    assert cause.probability > 0.8
    assert cause.peak / 9998.2 * 1e6 == pytest.approx(8.8 + 1.7, rel=0.3)
    (found,) = verdict.as_dict()["responses"].values()
    assert 0.04 < found["white"] / 9998.2 * 1e6 < 0.16  # within a factor of two
    assert found["gain"] > 1.5


@pytest.mark.usefixtures("fine")
def test_a_voltmeter_in_an_air_bath_gets_no_false_name():
    """Known: one lag leaves 0.33 ppm, two 0.19, of averages over many rows."""
    verdict = diagnose(DATA / "voltmeter_sweep.csv")
    (found,) = verdict.as_dict()["responses"].values()
    assert all("second-lag" in cause.names for cause in verdict.causes)
    assert found["white"] / 1e4 < 0.33e-6


@pytest.mark.usefixtures("fine")
def test_the_thermometer_of_a_crystal_is_slower_than_the_crystal(tmp_path):
    """Known: by 100 to 130 s, of a crystal at 25 MHz. To the frequency it is as if a gradient shifted it: one set."""
    column = '# unknown column: "column 3"'
    named = '[[file.column]]\nfrom = "column 3"\nto = "frequency_Hz"\nunit = "ppm"\nnominal_Hz = 25e6\n'
    verdict = diagnose(bring_in("dcxo_gps.txt", tmp_path, (column, named)))
    cause = verdict.causes[0]
    assert "thermometer-lag" in {cause.effect, *cause.equivalent}
    assert cause.probability > 0.8


@pytest.mark.usefixtures("coarser")
def test_steps_of_liquid_on_a_crystal_are_not_adequate(only, tmp_path):
    """Of every sixth row, and of the effects those that are slow."""
    only("ageing", "jump", "hysteresis", "second-lag", "mounting-stress")
    record = read_record(str(bring_in("qcm_steps.txt", tmp_path)))
    thin = {name: own[::6] for name, own in record.columns.items()}
    assert diagnose(replace(record, columns=thin)).verdict != "adequate"
