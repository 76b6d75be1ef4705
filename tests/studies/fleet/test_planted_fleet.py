"""Devices of one design: an odd device and a bad batch are found and nobody else is named; a set that one leaves open is closed by another."""

import json
from concurrent.futures import Future
from datetime import date, timedelta

import numpy as np
import pytest

from compensation.memory import follow_lag
from studies.cli import main
from studies.errors import InputError
from studies.fleet.comparison import compare
from studies.fleet.device import Answer, Measured, Standing, diagnose_device
from studies.fleet.folder import Device, read_lot
from studies.fleet.lot import gather
from studies.fleet.population import Population, Quantity, Scatters
from studies.fleet.run import run_lot
from studies.instrument.card import load_card, save_card
from studies.record import Record, write_record
from studies.reports import fleet as parts
from studies.sweeps.workers import Workers
from tests.studies.fleet.lots import make_lot

QUICK = ("time_s", "housing_temperature_degC", "frequency_Hz")


def stand(score, size=1.0, sd=0.05):
    return Standing(score, size, sd, size, sd, "size")


def test_a_device_without_a_card_is_read_at_20_degC_with_what_was_found(tmp_path):
    """Planted: a cubic of the frequency, which no quadratic law has, behind a lag of 600 s; a range whose middle is 25 °C."""
    time = np.arange(0.0, 30000.0, 30.0)
    housing = np.interp(time, [0.0, 2000.0, 9000.0, 13000.0, 22000.0, 30000.0], [20.0, 20.0, 60.0, 60.0, -10.0, -10.0])
    x = follow_lag(housing, 30.0, 600.0) - 20.0
    f = 4432.0 * (1.0 + 80e-6 * x - 2e-8 * x**2 + 2e-9 * x**3)
    f += 3e-4 * np.random.default_rng(7).standard_normal(len(time))
    write_record(Record({"time_s": time, "housing_temperature_degC": housing, "frequency_Hz": f}), tmp_path / "run.csv")
    answer, _ = diagnose_device(Device("A", (str(tmp_path / "run.csv"),)), "")
    assert [cause["effect"] for cause in answer.verdict["causes"]] == ["curvature"]
    for name, true in (("frequency at 20 °C (Hz)", 4432.0), ("slope of frequency at 20 °C (ppm/K)", 80.0)):
        found = answer.measured[name]
        assert abs(found.value - true) < 4.0 * found.sd
    assert not any(name.startswith("law.a") for name in answer.measured)
    assert not any(
        one.open for one in answer.measured.values()
    )  # what no card says is no scale for the scatter of a lot


def test_a_set_of_one_device_is_closed_by_another():
    open_set = {"second-lag": stand(20.0), "mounting-stress": stand(19.5)}
    closed = {"second-lag": stand(40.0), "mounting-stress": stand(5.0)}
    alone = compare("frequency_Hz", {"A": open_set, "B": open_set})
    assert set(alone.names) == {"second-lag", "mounting-stress"}
    share = compare("frequency_Hz", {"A": open_set, "B": open_set, "C": closed})
    assert (share.kind, share.names) == ("all", ("second-lag",))


def test_weak_evidence_of_every_device_adds_up():
    """None alone would be believed beyond doubt; a cause of the design pays its prior once."""
    share = compare("bias_deg_per_h", {name: {"rate-bias": stand(3.0, 1.0, 0.3)} for name in "ABCD"})
    assert share.kind == "all"
    assert share.evidence == pytest.approx(2 * (4 * 3.0 + 3 * 4.0))


def test_what_the_models_of_all_devices_lack_is_no_common_cause():
    """Five healthy devices, each with a weak trace of a stress that the diagnosis of one alone names: a sixth was odd for lacking it."""
    lot = {name: {"rate-bias": stand(1.0)} for name in "ABCDE"} | {"F": {"rate-bias": stand(-4.0, 0.005, 0.01)}}
    for named, kind, odd in (("A", "some", ()), ("AB", "all but", ("F",))):
        share = compare("bias_deg_per_h", lot, {}, named)
        assert (share.kind, share.odd) == (kind, odd)


def test_a_device_that_lacks_a_cause_is_odd_and_one_that_cannot_show_it_is_not():
    having = {name: {"rate-bias": stand(50.0)} for name in "ABD"}
    lacking = compare("bias_deg_per_h", having | {"C": {"rate-bias": stand(-4.0, 0.005, 0.01)}})
    assert (lacking.kind, lacking.odd) == ("all but", ("C",))
    blind = compare("bias_deg_per_h", having | {"C": {"rate-bias": stand(-4.0, 0.5, 5.0)}})
    assert (blind.kind, blind.odd) == ("all", ())


def test_a_device_that_has_a_cause_alone_is_odd_and_three_of_eight_are_no_lot():
    none = {"hysteresis": stand(-4.0, 0.005, 0.01)}
    one = compare("frequency_Hz", {"A": none, "B": {"hysteresis": stand(60.0)}, "C": none})
    assert (one.kind, one.odd) == ("few", ("B",))
    devices = {f"G{k}": {"hysteresis": stand(60.0)} if k < 3 else none for k in range(8)}
    several = compare("frequency_Hz", devices)
    assert (several.kind, several.odd) == ("some", ())
    batch = compare("frequency_Hz", devices, {f"G{k}": "b1" if k < 3 else "b2" for k in range(8)})
    assert (batch.kind, batch.batch) == ("batch", "b1")
    assert compare("frequency_Hz", {"A": none, "B": none}) is None


def test_one_weak_exception_in_many_devices_is_what_a_wide_search_finds():
    none = {"hysteresis": stand(-4.0, 0.005, 0.01)}
    lots = {f"G{k:03d}": none for k in range(199)}
    assert compare("frequency_Hz", lots | {"X": {"hysteresis": stand(8.0)}}).odd == ()
    assert compare("frequency_Hz", lots | {"X": {"hysteresis": stand(20.0)}}).odd == ("X",)


@pytest.mark.parametrize(("count", "scatter"), [(8, 10.0), (30, 1.0), (8, 0.0)])
def test_limits_a_chance_is_one(count, scatter):
    """Of devices that are like the others 10 % have a chance below 0.1; fewer where all that scatters is the error of each."""
    rng, below = np.random.default_rng(1), 0
    for _ in range(400):
        sd = np.exp(0.3 * rng.standard_normal(count))
        value = scatter * rng.standard_normal(count) + sd * rng.standard_normal(count)
        below += Population.of(value[1:], sd[1:]).surprise(value[:1], sd[:1]) < 0.1
    assert below <= 400 * 0.1 + 3 * (400 * 0.09) ** 0.5
    if scatter > 1.0:
        assert below >= 400 * 0.1 - 3 * (400 * 0.09) ** 0.5


def test_limits_a_small_chance_of_one_among_four_is_one():
    """Three others may stand close by chance: with 2 degrees of freedom the tail is long, and was cut off at three ranges."""
    rng, chances = np.random.default_rng(1), []
    for _ in range(4000):
        value, sd = rng.standard_normal(4), np.full(4, 0.05)
        chances.append(Population.of(value[1:], sd[1:]).surprise(value[:1], sd[:1]))
    assert np.sum(np.array(chances) < 0.005) <= 20 + 3 * 20**0.5


def test_the_odd_one_of_four_is_named_and_of_three_none():
    assert set(lot_of([1.0, 1.01, 0.99, 5.0]).odd) == {"G03"}
    assert not lot_of([1.0, 1.01, 5.0]).odd
    near = lot_of([1.0, 1.04, 0.97, 1.4])
    assert not near.odd
    assert (near.farthest[1], near.farthest[0] < 1) == ("G03", True)


def test_a_device_whose_cause_is_larger_than_in_the_others_is_odd():
    """Its coefficient was among the sizes of a cause common to all, in the heading's unit but not by it, and no device differed."""
    cause = {"kind": "physics", "response": "bias_deg_per_h", "effect": "rate-bias", "equivalent": []}
    key = "coefficient_deg_per_h_per_K_per_s"
    answers = {}
    for serial, size in zip("ABCD", (500.0, 510.0, 495.0, 3000.0), strict=True):
        standing = {"bias_deg_per_h": {"rate-bias": {"rate-bias": Standing(50.0, 1.0, 0.05, size, 3.0, key)}}}
        answers[serial] = Answer(serial, "", {"causes": [cause], "verdict": "explained"}, 4432.0, {}, standing)
    lot = gather([Device(s, ()) for s in answers], answers, {})
    assert lot.odd == ["D"]
    assert "rate-bias: coefficient (°/h per K/min) is 50," in lot.reasons["D"][0]
    assert parts._sizes(lot.shares[0]) == "coefficient (°/h per K/min) 8.2 … 50"


def test_an_effect_that_another_cause_beats_in_its_own_place_is_not_there_too():
    """Once a mounting stress of one device was common to the lot: in the others it would do, less well, what curvature does."""
    answers = {}
    for serial in "ABCD":
        named = "mounting-stress" if serial == "D" else "curvature"
        cause = {"kind": "physics", "response": "frequency_Hz", "effect": named, "equivalent": []}
        places = {named: {"curvature": stand(600.0), "mounting-stress": stand(100.0)}}
        if serial == "D":
            places[named] = {"mounting-stress": stand(900.0)}
        standing = {"frequency_Hz": {**places, "": {"mounting-stress": stand(-4.0, 0.005, 0.01)}}}
        answers[serial] = Answer(serial, "", {"causes": [cause], "verdict": "explained"}, 4432.0, {}, standing)
    lot = gather([Device(s, ()) for s in answers], answers, {})
    assert {share.effect: (share.having, share.odd) for share in lot.shares} == {
        "curvature": (("A", "B", "C"), ()),
        "mounting-stress": (("D",), ("D",)),
    }


def test_causes_of_the_heat_path_that_every_device_has_are_said():
    """Once "no cause in common" stood above rows that all had second-lag and radiation."""

    def lot(*lists):
        answers = {}
        for serial, names in zip("ABCD", lists, strict=False):
            causes = [
                {"kind": "physics", "response": "frequency_Hz", "effect": name, "equivalent": []} for name in names
            ]
            values = [{"kind": "value", "response": "frequency_Hz", "effect": "loss.inverse_q", "equivalent": []}]
            answers[serial] = Answer(serial, "", {"causes": causes + values, "verdict": "explained"}, 4432.0, {}, {})
        return gather([Device(s, ()) for s in answers], answers, {})

    both = ("second-lag", "radiation")
    said = parts.headline(lot(both, both, (*both, "jump")))
    assert said.startswith("All devices have radiation and second-lag, and no other cause in common.")
    assert parts.headline(lot(both, (), both)).startswith("The devices have no cause in common.")


def test_sizes_of_unlike_kinds_are_told_as_what_all_have():
    """Once `rms (°/h) 0.41 … 80`, of which the 80 was a coefficient."""
    one = Standing(50.0, 0.41, 0.01, 80.0, 0.2, "coefficient_deg_per_h_per_K_per_s")
    share = compare("bias_deg_per_h", {"A": {"rate-bias": stand(50.0, 0.40)}, "B": {"rate-bias": one}})
    assert parts._sizes(share) == "rms (°/h) 0.4 … 0.41"
    assert parts._sizes(compare("bias_deg_per_h", {"A": {"rate-bias": one}, "B": {"rate-bias": one}})).startswith(
        "coeff"
    )


def test_recovery_of_mean_and_scatter():
    rng = np.random.default_rng(2)
    sd = rng.uniform(0.5, 2.0, 400)
    found = Population.of(5.0 + 1.5 * rng.standard_normal(400) + sd * rng.standard_normal(400), sd)
    assert found.mean == pytest.approx(5.0, abs=4 * found.mean_sd)
    assert found.scatter == pytest.approx(1.5, rel=0.15)


def lot_of(values, batches=()):
    rng = np.random.default_rng(4)
    of = {f"G{k:02d}": Measured(float(v + 0.01 * rng.standard_normal()), 0.02) for k, v in enumerate(values)}
    return Quantity("value", of, 5 * len(of), dict(zip(of, batches, strict=False)))


def test_odd_devices_and_a_bad_batch_are_named_and_left_out_of_mean_and_scatter():
    rng = np.random.default_rng(3)
    values = 1.0 + 0.1 * rng.standard_normal(40)
    assert not lot_of(values).odd
    values[[4, 9]] += 1.5
    assert set(lot_of(values).odd) == {"G04", "G09"}
    values[30:36] += 1.0
    batches = ["bad" if 30 <= k < 36 else f"b{k // 10}" for k in range(40)]
    both = lot_of(values, batches)
    assert set(both.bad_batches) == {"bad"}
    assert set(both.odd) == {"G04", "G09"}
    assert both.population.mean == pytest.approx(1.0, abs=0.08)
    assert both.population.scatter == pytest.approx(0.1, rel=0.35)
    shrunk = both.with_lot("G00")
    assert abs(shrunk.value - both.population.mean) <= abs(both.of["G00"].value - both.population.mean)


def test_a_drift_of_the_lot_with_its_dates_is_told_and_a_scatter_is_not():
    """Planted: 0.3 in 30 days; of 200 lots without a trend 1 % are told to have one."""
    rng, told = np.random.default_rng(6), 0
    made = {f"G{k:02d}": date(2026, 1, 1) + timedelta(days=30 * k) for k in range(9)}
    found = lot_of(3.0 + 0.3 * np.arange(9) + 0.05 * rng.standard_normal(9)).trend(made)
    assert found.per_month == pytest.approx(0.3, abs=3 * found.sd)
    assert found.sd < 0.02
    for _ in range(200):
        told += lot_of(3.0 + 0.5 * rng.standard_normal(9)).trend(made) is not None
    assert told <= 2
    assert lot_of(np.arange(4.0)).trend(made) is None


@pytest.mark.slow
@pytest.mark.parametrize(("count", "spread", "least"), [(5, 0.3, 6), (5, 0.7, 4), (8, 0.7, 8)])
def test_one_of_a_few_devices_is_odd_by_what_all_values_say_of_scatter(count, spread, least):
    """Of five devices one that was 12 scatters away was never odd: four may stand close by chance, in one value; in eighteen they do not."""
    rng, alarms, found = np.random.default_rng(count), 0, 0
    for _ in range(10):
        open_, errors = np.exp(2.0 * rng.standard_normal(18)), np.exp(rng.uniform(np.log(1e-4), np.log(0.3), 18))
        scatter = 0.05 * np.exp(spread * rng.standard_normal(18))
        values = np.hypot(scatter, errors) * rng.standard_normal((count, 18))
        for odd in (False, True):
            if odd:
                values[0, 0] = values[1:, 0].mean() + 12.0 * values[1:, 0].std(ddof=1)
            every = zip(open_ * values, open_ * errors * np.ones((count, 1)), strict=True)
            measured = [[Measured(v, s, True, o) for v, s, o in zip(*own, open_, strict=True)] for own in every]
            of = {f"value {k}": {f"G{d}": own[k] for d, own in enumerate(measured)} for k in range(18)}
            scatters = Scatters(of)
            named = [s for name, own in of.items() for s in Quantity(name, own, 18 * count, {}, scatters).odd]
            found += odd and "G0" in named
            alarms += not odd and bool(named)
    assert alarms <= 1  # 0.1 are expected
    assert found >= least


def test_a_device_of_another_design_is_put_aside():
    plain = {"causes": [], "verdict": "adequate"}
    answers = {
        s: Answer(s, "", plain, f, {}, {}) for s, f in (("A", 4432.0), ("B", 4440.0), ("C", 4429.0), ("D", 8100.0))
    }
    lot = gather([Device(s, ()) for s in answers], answers, {})
    assert set(lot.failed) == {"D"}
    assert "another design" in lot.failed["D"]
    assert set(lot.answers) == {"A", "B", "C"}


@pytest.mark.slow
def test_the_odd_device_and_the_bad_batch_of_a_small_lot(tmp_path):
    card, folder = str(tmp_path / "card.toml"), tmp_path / "lot"
    save_card(load_card("hrg-30mm").with_values({"thermal.cells": 10}), card)
    planted = make_lot(folder, 7, [1], [4, 5, 6], 2, 4, columns=(*QUICK, "inverse_q"), row=180.0, card=card)
    lot = run_lot(read_lot(str(folder), card))
    assert tuple(lot.odd) == planted.odd
    assert set(lot.bad_batches) == {planted.batch}
    assert not lot.shares
    assert not lot.failed


@pytest.mark.slow
def test_a_lot_goes_on_where_it_was_and_past_what_it_cannot_read(tmp_path, capsys, monkeypatch):
    folder, out = tmp_path / "lot", tmp_path / "out"
    make_lot(folder, 2, [], [], seed=2, batch_size=5, columns=QUICK, row=120.0)
    (folder / "lot.csv").unlink()
    (folder / "empty").mkdir()
    (folder / "torn").mkdir()
    (folder / "torn" / "run.csv").write_text("time_s,frequency_Hz\n0,1\n0,2\n")
    words = ["fleet", str(folder), "--out", str(out), "--card", "hrg-30mm", "--json"]
    assert main(words) == 4
    told = capsys.readouterr()
    first = json.loads(told.out)
    assert set(first["failed"]) == {"empty", "torn"}
    assert "device empty: its folder has no records" in told.err
    assert "time_s does not increase" in told.err
    assert set(first["devices"]) == {"G001", "G002"}
    assert {path.name for path in (out / "devices").iterdir()} == {"G001.json", "G001.html", "G002.json", "G002.html"}
    assert "Control charts" in (out / "lot.html").read_text(encoding="utf-8")
    monkeypatch.setattr("studies.fleet.device.diagnose_records", None)
    for path in (folder / "empty", folder / "torn"):
        for one in path.iterdir():
            one.unlink()
        path.rmdir()
    assert main(words) == 0  # nothing is worked out anew
    assert json.loads(capsys.readouterr().out)["devices"] == first["devices"]
    (out / "devices" / "G001.json").write_text("torn")
    with pytest.raises(TypeError):  # what is torn would be worked out again
        run_lot(read_lot(str(folder), "hrg-30mm"), str(out))


class Losing(Workers):
    """Workers that lose one device's process each time, and with it what the others have."""

    count, lost = 2, (BrokenPipeError,)

    def submit(self, function, devices):
        (device,), done = devices, Future()
        if device.serial == "B":
            done.set_exception(BrokenPipeError())
        else:
            done.set_result(Answer(device.serial, "", {"causes": [], "verdict": "adequate"}, 4432.0, {}, {}))
        return done

    def restart(self):
        return True


def test_a_device_that_ends_its_worker_costs_no_other():
    lot = run_lot([Device(serial, ()) for serial in "ABCD"], crew=Losing())
    assert set(lot.answers) == set("ACD")
    assert "its process was ended each time" in lot.failed["B"]


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("serial,bach\nA,1\n", "unknown column 'bach'; did you mean 'batch'"),
        ("date\n2024-01-01\n", "the column serial is missing"),
        ("serial,date\nA,yesterday\n", "line 2: date 'yesterday' is not of the form 2024-05-31"),
        ("serial,date\nZ,2024-01-01\n", "line 2: no folder of device 'Z'"),
        ("serial\nA\nA\n", "line 3: device 'A' is listed twice"),
    ],
)
def test_a_wrong_table_of_the_lot_is_told_with_its_line(tmp_path, table, said):
    (tmp_path / "A").mkdir()
    (tmp_path / "lot.csv").write_text(table)
    with pytest.raises(InputError, match=said):
        read_lot(str(tmp_path))


def test_a_folder_without_devices_and_a_lot_of_one_are_refused(tmp_path, refuse):
    assert "give a folder outside" in refuse(["fleet", str(tmp_path), "--out", str(tmp_path / "out")])
    (tmp_path / "lot").mkdir()
    assert "no folders of devices" in refuse(["fleet", str(tmp_path / "lot"), "--out", str(tmp_path / "out")])
