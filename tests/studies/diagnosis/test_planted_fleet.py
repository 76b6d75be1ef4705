"""Devices of one design: what they share is said once, a set that one device leaves open is closed by another, the odd one is named."""

import json

import numpy as np
import pytest

from studies.cli import main
from studies.diagnosis.fleet.comparison import Standing, against_others, compare
from studies.diagnosis.fleet.records import read_fleet
from studies.diagnosis.verdict import Interval
from studies.errors import InputError
from studies.record import Record, write_record
from thermal.lag import lag

STEP = 5.0  # s


def stand(score, size=1.0, sd=0.05):
    return Standing(score, size, sd)


def test_a_set_of_one_device_is_closed_by_another():
    open_set = {"second-lag": stand(20.0), "mounting-stress": stand(19.5)}
    closed = {"second-lag": stand(40.0), "mounting-stress": stand(5.0)}
    alone = compare("frequency_Hz", {"A": open_set, "B": open_set})
    assert {alone.effect, *alone.equivalent} == {"second-lag", "mounting-stress"}
    share = compare("frequency_Hz", {"A": open_set, "B": open_set, "C": closed})
    assert (share.kind, share.effect, share.equivalent) == ("all", "second-lag", ())
    assert share.probability > 0.8


def test_weak_evidence_of_every_device_adds_up():
    """None alone would be believed beyond doubt; a cause of the design pays its prior once."""
    share = compare("bias_deg_per_h", {name: {"rate-bias": stand(3.0, 1.0, 0.3)} for name in "ABCD"})
    assert share.kind == "all"
    assert share.evidence > 2 * (4 * 3.0 + 3 * 4.0)


def test_a_device_that_lacks_a_cause_is_odd():
    """Its evidence against the cause is nothing, for an effect may be small; its limit is far below the others' size."""
    lacking = {"rate-bias": stand(-4.0, 0.005, 0.01)}
    share = compare("bias_deg_per_h", {"A": {"rate-bias": stand(50.0)}, "B": {"rate-bias": stand(40.0)}, "C": lacking})
    assert (share.kind, share.odd) == ("all but", "C")


def test_a_device_that_cannot_see_a_cause_is_not_odd():
    blind = {"rate-bias": stand(-4.0, 0.5, 5.0)}
    share = compare("bias_deg_per_h", {"A": {"rate-bias": stand(50.0)}, "B": {"rate-bias": stand(40.0)}, "C": blind})
    assert share.kind == "all"


def test_a_device_that_has_a_cause_alone_is_odd():
    for name in ("jump", "hysteresis"):
        none = {name: stand(-4.0, 0.005, 0.01)}
        share = compare("frequency_Hz", {"A": none, "B": {name: stand(60.0)}, "C": none})
        assert (share.kind, share.odd) == ("alone", "B")
        assert compare("frequency_Hz", {"A": none, "B": none}) is None


def test_a_value_far_from_the_others_is_odd_and_left_out_of_their_mean():
    of = {
        name: Interval(value, value - 0.1, value + 0.1)
        for name, value in zip("ABCD", (5.0, 5.3, 4.8, 15.0), strict=True)
    }
    value = against_others("rate-bias", of)
    assert set(value.odd) == {"D"}
    assert value.common == pytest.approx(np.mean([5.0, 5.3, 4.8]))
    assert not against_others("rate-bias", {name: of[name] for name in "AD"}).odd


def device(number, rng, dip, jump):
    """Two runs of one gyro: law and lag scatter by some per cent, an activity dip is common, a jump its own."""
    tau, slope = 1500.0 * (1 + 0.03 * rng.standard_normal()), 0.4 * (1 + 0.02 * rng.standard_normal())
    records = []
    for k, ends in enumerate(((-10.0, 40.0), (35.0, -5.0))):
        time = np.arange(0.0, 6 * 3600.0, STEP)
        housing = lag(time, np.interp(time, [0, 3600, 9000, 14000, 2e4], [20, *ends, ends[0], 20]), 300.0)
        x = lag(time, housing, tau) - 20.0
        z = (x + 20.0 - 12.0 - 0.3 * number) / 0.8
        frequency = 5000.0 + number + slope * x - 4e-4 * x**2 + dip * z / (1 + z**2)
        frequency += jump * (k == 1) * (time > 11000.0) + 2e-3 * rng.standard_normal(time.size)
        housing = housing + 2e-3 * rng.standard_normal(time.size)
        columns = {"time_s": time, "housing_temperature_degC": housing, "frequency_Hz": frequency}
        records.append(Record({name: values[:: int(60 / STEP)] for name, values in columns.items()}))
    return records


@pytest.mark.slow
def test_the_common_cause_and_the_odd_one_of_three(tmp_path, capsys):
    rng = np.random.default_rng(8)
    words = []
    for number, name in enumerate("ABC"):
        paths = []
        for k, record in enumerate(device(number, rng, 0.03, 0.05 if name == "B" else 0.0)):
            paths.append(str(tmp_path / f"{name}{k}.csv"))
            write_record(record, paths[-1])
        words += ["--device", f"{name}={','.join(paths)}"]
    page = tmp_path / "fleet.html"
    assert main(["diagnose", *words, "--report", str(page), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["schema"] == "hrg.fleet/1"
    kinds = {one["effect"]: (one["kind"], one["device"]) for one in found["common_causes"]}
    assert kinds == {"activity-dip": ("all", None), "jump": ("alone", "B")}, found["common_causes"]
    sizes = {one["effect"]: one["sizes"] for one in found["common_causes"]}
    assert set(sizes["activity-dip"]) == {"A", "B", "C"}
    assert set(sizes["jump"]) == {"B"}
    assert found["odd_one_out"] == "B"
    assert any("alone has jump" in why for why in found["devices"]["B"]["odd"])
    lags = next(value for value in found["values"] if value["name"] == "time_constant_s")
    assert lags["common"] == pytest.approx(1500.0, rel=0.06)
    assert "Device B differs from the others" in page.read_text(encoding="utf-8")


def test_a_manifest_names_devices_beside_it(tmp_path):
    record = device(0, np.random.default_rng(1), 0.0, 0.0)[0]
    write_record(record, tmp_path / "a.csv")
    manifest = tmp_path / "fleet.toml"
    manifest.write_text('[devices]\nA = ["a.csv"]\nB = ["a.csv", "a.csv"]\n')
    assert {name: len(own) for name, own in read_fleet([], str(manifest)).items()} == {"A": 1, "B": 2}
    manifest.write_text('[devices]\nA = "a.csv"\n')
    with pytest.raises(InputError, match="A must be a list of 1 or more texts"):
        read_fleet([], str(manifest))
    with pytest.raises(InputError, match="give a unique name"):
        read_fleet(["a.csv"])


def test_one_device_is_no_fleet(tmp_path, capsys):
    write_record(device(0, np.random.default_rng(1), 0.0, 0.0)[0], tmp_path / "a.csv")
    assert main(["diagnose", "--device", f"A={tmp_path / 'a.csv'}"]) == 2
    assert "needs at least two devices" in capsys.readouterr().err
