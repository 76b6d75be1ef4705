"""hrg fit ringdown on files of a resonator whose values are known, and on files that are no ring-down."""

from pathlib import Path

import numpy as np
import pytest

from studies.cli import main
from studies.errors import InputError
from studies.fits.misread_decay import check_phase
from studies.fits.ringdown import read_decay
from studies.instrument.card import load_card
from studies.record.decays import read_table
from tests.benchmarks.hands.decays import make
from tests.compensation.two_oscillators import Gyro, noisy
from tests.tables import write_columns

GYRO = Gyro(4599.75, 4599.63, 9.0e5, 1.1e6, np.radians(31), np.radians(70))
TIME = np.arange(0.0, 120.0, 0.1)
PAIRS = {
    "frequency_1_Hz": "f2_Hz", "frequency_2_Hz": "f1_Hz", "frequency_Hz": "mean_Hz", "split_Hz": "split_Hz", "inverse_q": "inverse_q",
    "frequency_axis_deg": "stiff_axis_deg", "q_1": "q2", "q_2": "q1", "damping_axis_deg": "lossy_axis_deg",
}  # fmt: skip


@pytest.fixture
def lock_in(tmp_path):
    z = noisy(GYRO.envelope(TIME, 4599.7, [1.0, 0.8j]), 0.003, np.random.default_rng(1))
    columns = {"time_s": TIME}
    for part, channel in zip(("cos", "sin"), z, strict=True):
        columns[f"amplitude_{part}_V"], columns[f"phase_{part}_deg"] = np.abs(channel), np.degrees(np.angle(channel))
    return write_columns(tmp_path / "decay.csv", columns, ["reference_frequency_Hz: 4599.7"])


@pytest.mark.slow
def test_a_lock_in_file_gives_split_axes_and_q_and_a_card_that_has_them(lock_in, tmp_path, capsys, ask):
    card, page = tmp_path / "measured.toml", tmp_path / "page.html"
    (decay,) = ask(["fit", "ringdown", lock_in, "--card", "free-dome", "--save", card, "--report", page])["decays"]
    found = {row["name"]: row for row in decay["estimates"]}
    truth = {
        "split_Hz": 0.12,
        "frequency_axis_deg": 31.0,
        "damping_axis_deg": 70.0,
        "inverse_q": (1 / 9e5 + 1 / 1.1e6) / 2,
    }
    for name, value in truth.items():
        assert abs(found[name]["value"] - value) < 4 * found[name]["sd"], name
    assert found["split_Hz"]["sd"] < 1e-4
    split = load_card(str(card)).content["imperfection"]["split"]
    assert split["split_Hz"] == pytest.approx(0.12, abs=1e-3)
    assert split["slow_axis_deg"] == pytest.approx(76.0, abs=0.5)
    sd = found["split_Hz"]["sd"], 4 * 0.12 * np.radians(found["frequency_axis_deg"]["sd"])
    assert split["split_error_Hz"] == pytest.approx(max(sd), rel=0.01)
    assert "Axis of the upper mode".lower() in page.read_text().lower()
    bare = Path(lock_in).with_name("bare.csv")
    bare.write_text(
        "".join(line for line in Path(lock_in).read_text().splitlines(True) if "reference_frequency_Hz" not in line)
    )
    assert main(["fit", "ringdown", str(bare)]) == 0
    assert "No reference frequency is given: frequencies are relative to it" in capsys.readouterr().out


@pytest.mark.slow
def test_from_a_raw_decay_to_acceptance_in_five_commands(lock_in, tmp_path, ask):
    """Decay, split, trim plan, decay of the trimmed shell (2 mHz left), acceptance of its run-down."""
    measured, trimmed = str(tmp_path / "measured.toml"), str(tmp_path / "trimmed.toml")
    after = Gyro(4599.702, 4599.700, 1.0e6, 1.04e6, 0.3, 1.0)
    z = noisy(after.envelope(TIME, 4599.7, [1.0, 0.8j]), 0.001, np.random.default_rng(4))
    columns = {"time_s": TIME}
    for part, channel in zip(("cos", "sin"), z, strict=True):
        columns |= {f"in_phase_{part}_V": channel.real, f"out_of_phase_{part}_V": channel.imag}
    again = write_columns(tmp_path / "after.csv", columns, ["reference_frequency_Hz: 4599.7"])
    limits = tmp_path / "limits.toml"
    limits.write_text('schema = "hrg.limits/1"\n[limits]\nrun_down_time_s = 60.0\nquality_factor = 1.1e6\n')
    assert main(["fit", "ringdown", lock_in, "--card", "free-dome", "--save", measured]) == 0
    plan = ask(["trim", measured])
    assert plan["before"][0]["split_Hz"] == pytest.approx(0.12, abs=1e-3)
    assert (
        0
        < plan["before"][0]["error_Hz"]
        == pytest.approx(load_card(measured).content["imperfection"]["split"]["split_error_Hz"])
    )
    assert ask(["trim", measured, "--reading-error", "3e-4"])["before"][0]["error_Hz"] == pytest.approx(3e-4)
    cuts = plan["rounds"][0]["cuts"]
    pull = sum(cut["mass_ug"] * np.exp(4j * np.radians(cut["azimuth_deg"])) for cut in cuts)
    assert np.degrees(np.angle(pull)) / 4 % 90 == pytest.approx(76.0, abs=0.5)  # mass off where the slow mode moves
    assert main(["fit", "ringdown", again, "--card", measured, "--save", trimmed]) == 0
    assert load_card(trimmed).content["imperfection"]["split"]["split_Hz"] == pytest.approx(0.002, abs=2e-4)
    assert main(["modes", trimmed]) == 0
    found = {row["key"]: row for row in ask(["acceptance", trimmed, again, "--limits", limits])["quantities"]}
    q = 2 / (1 / 1.0e6 + 1 / 1.04e6)
    assert found["quality_factor"]["low"] < q < found["quality_factor"]["high"]
    assert found["quality_factor"]["verdict"] == "fail"
    assert found["run_down_time_s"]["value"] == pytest.approx(q / (np.pi * 4599.7), rel=0.01)
    assert found["run_down_time_s"]["verdict"] == "pass"


@pytest.mark.slow
def test_raw_samples_and_their_alias(tmp_path, ask, refuse):
    time = np.arange(40_000) / 16_000
    gyro = Gyro(4600.0, 4598.0, 8e3, 8e3, 0.2, 0.2)
    x = gyro.samples(time, [1.0, 1.0]) + 0.01 * np.random.default_rng(2).standard_normal((2, time.size))
    good = write_columns(tmp_path / "raw.csv", {"time_s": time, "pickoff_cos_V": x[0], "pickoff_sin_V": x[1]})
    (decay,) = ask(["fit", "ringdown", good, "--card", "free-dome"])["decays"]
    found = {row["name"]: row["value"] for row in decay["estimates"]}
    assert found["split_Hz"] == pytest.approx(2.0, rel=0.01)
    assert found["q_1"] == pytest.approx(8e3, rel=0.01)
    slow = write_columns(tmp_path / "slow.csv", {"time_s": time[::4], "pickoff_cos_V": x[0, ::4]})
    said = refuse(["fit", "ringdown", slow, "--card", "free-dome"])
    assert "alias" in said
    assert "slow.csv" in said
    (decay,) = ask(["fit", "ringdown", slow, "--card", "free-dome", "--frequency", "4600"])["decays"]
    assert decay["frequency_Hz"] == pytest.approx(4599, abs=1.1)
    assert "hold 4600 Hz as its alias at 600 Hz" in decay["remarks"][0]


@pytest.mark.parametrize("name", ["power_dBm", "power_W"])
def test_a_spectrum_analysers_trace(tmp_path, ask, name):
    f = np.linspace(4590, 4610, 501)
    power = (0.01 + 1 / (1 + (2 * (f - 4599.7) / 0.8) ** 2)) * np.random.default_rng(5).gamma(30, 1 / 30, f.size)
    path = write_columns(
        tmp_path / "trace.csv", {"frequency_Hz": f, name: 10 * np.log10(power) if name == "power_dBm" else power}
    )
    (line,) = ask(["fit", "ringdown", path, "--report", str(tmp_path / "page.html")])["decays"]
    assert line["frequency_Hz"] == pytest.approx(4599.7, abs=0.02)
    assert line["q_low"] < 4599.7 / 0.8 < line["q_high"]
    assert line["window_s"] is None


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"time_s": TIME}, "only time_s"),
        ({"time_s": TIME, "amplitude_cos_V": np.exp(-TIME)}, "belong together"),
        ({"time_s": TIME[::-1], "power_dBm": -TIME}, "does not increase"),
        ({"time_s": TIME, "power_dBm": 0 * TIME + np.sin(TIME)}, "nothing decays"),
        ({"time_s": TIME[:10], "power_dBm": -TIME[:10]}, "32 rows"),
        ({"time_s": TIME, "voltage": TIME}, "voltage"),
        ({"time_s": TIME, "power_W": -np.exp(-TIME)}, "32 rows or more with a positive amplitude, not 0"),
        ({"time_s": TIME, "pickoff_cos_V": np.nan * TIME}, "the column 'pickoff_cos_V' has no value"),
        ({"frequency_Hz": TIME + 1, "power_dBm": 0 * TIME}, "no resonance"),
        ({"frequency_Hz": TIME[::-1] + 1, "power_dBm": TIME}, "does not increase"),
    ],
)
def test_what_is_no_ring_down_is_refused_with_its_file(tmp_path, refuse, columns, said):
    path = write_columns(tmp_path / "x.csv", columns)
    err = refuse(["fit", "ringdown", path])
    assert said in err
    assert "x.csv" in err


@pytest.mark.parametrize(
    ("comment", "more", "said"),
    [
        ("reference_frequency_Hz: banana", [], "'reference_frequency_Hz: banana' holds no number"),
        ("reference_frequency_Hz: -4432", [], "reference_frequency_Hz must be a number from 0.001 up"),
        ("reference_frequency_Hz: nan", [], "reference_frequency_Hz must be a number from 0.001 up"),
        ("pressure_Pa: -1", [], "pressure_Pa must be a number from 0 up"),
        ("temperature_degC: 22 C", [], "'temperature_degC: 22 C' holds no number"),
        ("source: a lock-in", ["--frequency", "-5"], "--frequency"),
        ("source: a lock-in", ["--harmonic", "-2"], "--harmonic"),
    ],
)
def test_a_number_that_a_decay_cannot_have_is_refused_by_its_comment_or_option(tmp_path, refuse, comment, more, said):
    """A negative reference gave a decay of −4431.93 Hz, a word was taken for none, a negative harmonic turned the axes round."""
    z = LOCK + 1e-3 * np.random.default_rng(1).standard_normal(TIME.size)
    path = write_columns(tmp_path / "x.csv", lock(z), [comment])
    assert said in refuse(["fit", "ringdown", path, *more])


FINE = np.arange(16_000) / 16_000
TONE = np.exp(-FINE / 0.4) * np.cos(2 * np.pi * 4600 * FINE)
LOCK = 0.3 * np.exp(-TIME / 40 + 0.2j * TIME)


def lock(z):
    return {"time_s": TIME, "in_phase_cos_V": z.real, "out_of_phase_cos_V": z.imag}


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"time_s": FINE, "pickoff_cos_V": np.cos(2 * np.pi * 4600 * FINE)}, "drive off"),
        ({"time_s": FINE, "pickoff_cos_V": np.clip(9 * np.cos(2 * np.pi * 4600 * FINE), -1, 1)}, "lower the gain"),
        ({"time_s": FINE, "pickoff_cos_V": TONE, "pickoff_sin_V": 0.5 * TONE}, "own column"),
        ({"time_s": 2 * FINE, "pickoff_cos_V": TONE}, "sampling rate"),
        ({"time_s": FINE[::4], "pickoff_cos_V": TONE[::4]}, "alias"),
        ({"pickoff_cos_V": TONE}, "time_s"),
        ({"time_s": 0 * FINE, "pickoff_cos_V": TONE}, "does not increase"),
        (lock(LOCK * np.where(TIME > 80, np.exp(1.6j), 1)), "phase jumps at 80"),
        (lock(0 * LOCK + 0.2), "drive off"),
        (lock(np.conj(LOCK) / np.abs(LOCK) ** 2), "drive off"),
    ],
)
def test_a_bad_decay_ends_in_one_sentence_with_cause_and_mend(tmp_path, refuse, columns, said):
    random = np.random.default_rng(9)
    for name in columns:
        if name.endswith("_V") and said not in ("own column", "lower the gain"):
            columns = columns | {name: columns[name] + 1e-3 * random.standard_normal(len(columns[name]))}
    path = write_columns(
        tmp_path / "bad.csv", columns, ["reference_frequency_Hz: 4599.7"] if "in_phase_cos_V" in columns else []
    )
    err = refuse(["fit", "ringdown", path, "--card", "free-dome"])
    assert said in err
    assert "bad.csv" in err


@pytest.mark.slow
def test_decays_over_pressure_give_the_gas_law(tmp_path, ask):
    """1/Q = 1e-7 + 5e-5 p planted in ten traces of power."""
    random = np.random.default_rng(3)
    paths = []
    for k, p in enumerate(np.geomspace(1e-5, 2e-2, 10)):
        rate = np.pi * 2e5 * (1e-7 + 5e-5 * p)
        t = np.linspace(0, 5 / rate, 2000)
        power = 20 * np.log10(np.abs(noisy(np.exp(-rate * t) + 0j, 0.01, random)))
        comments = [f"pressure_Pa: {p:.6g}", "reference_frequency_Hz: 2e5"]
        paths.append(write_columns(tmp_path / f"p{k}.csv", {"time_s": t, "power_dBm": power}, comments))
    law = ask(["fit", "ringdown", *paths])["laws"]["inverse_q"]
    assert law["level"] == pytest.approx(1e-7, rel=0.03)
    assert law["terms"][0]["term"] == "pressure"
    assert law["terms"][0]["value"] == pytest.approx(5e-5, rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "word"), [("cubic", "cubic stiffness"), ("crosstalk", "Interference"), ("drift", "drifts with time")]
)
def test_decays_of_an_independent_generator_are_named_and_fitted(tmp_path, kind, word):
    """A shift of 6.6 line widths of an ellipse, a drive that leaks into the pick-offs, a drift: no interval misses by twice its width."""
    index = {"cubic": 1, "crosstalk": 3, "drift": 3}[kind]
    decay = make(kind, 1, index)
    found = read_decay(decay.write(tmp_path / "decay.csv"))
    assert any(word in remark for remark in found.remarks)
    for name, e in found.estimates.items():
        truth = decay.truth.get(PAIRS.get(name, ""))
        if truth is not None and not (kind == "drift" and name in ("frequency_1_Hz", "frequency_2_Hz", "frequency_Hz")):
            away = (truth - e.value + 45) % 90 - 45 if name.endswith("axis_deg") else truth - e.value
            assert 1.5 * e.low - 0.5 * e.high < e.value + away < 1.5 * e.high - 0.5 * e.low, name


def test_a_run_is_no_table_of_decays(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("time_s,chamber_temperature_degC,frequency_Hz\n0,20,4430\n1,20,4430\n")
    with pytest.raises(
        InputError, match="chamber_temperature_degC is one of a run, and this command takes free decays"
    ):
        read_table(path)


def test_a_line_near_half_of_the_rows_a_second_may_be_an_alias(tmp_path, ask):
    """2.88 Hz from the reference at 5 rows a second stands at -2.12 Hz; nothing was said."""
    t = np.arange(0.0, 200.0, 0.2)
    for away, said in ((1.5, False), (2.88, True)):
        z = noisy(GYRO.envelope(t, 4599.7 - away, [1.0, 0.8j]), 0.003, np.random.default_rng(1))
        columns = {"time_s": t}
        for part, one in zip(("cos", "sin"), z, strict=True):
            columns[f"in_phase_{part}_V"], columns[f"out_of_phase_{part}_V"] = one.real, one.imag
        path = write_columns(tmp_path / "far.csv", columns, [f"reference_frequency_Hz: {4599.7 - away}"])
        (decay,) = ask(["fit", "ringdown", path])["decays"]
        assert ("may be the alias of one at 4599.69 Hz" in " ".join(decay["remarks"])) is said


def lock_in_columns(z, polar, time=TIME):
    columns = {"time_s": time}
    for part, channel in zip(("cos", "sin"), z, strict=True):
        columns |= (
            {f"amplitude_{part}_V": np.abs(channel), f"phase_{part}_deg": np.degrees(np.angle(channel))}
            if polar
            else {f"in_phase_{part}_V": channel.real, f"out_of_phase_{part}_V": channel.imag}
        )
    return columns


def written(tmp_path, columns, reference=4599.7):
    return write_columns(tmp_path / "misread.csv", columns, [f"reference_frequency_Hz: {reference}"])


@pytest.mark.parametrize("low", [-np.pi, 0.0])
def test_contract_phases_in_rad_are_refused_with_their_factor_and_slow_ones_in_degrees_are_not(tmp_path, refuse, low):
    """Phases in rad lie within one turn of 2π and jump by it; read in degrees they gave a split of 55 for 1.4 mHz."""
    z = noisy(GYRO.envelope(TIME, 4599.7, [1.0, 0.8j]), 0.003, np.random.default_rng(1))
    columns, saved = lock_in_columns(z, True), tmp_path / "saved.toml"
    columns["phase_sin_deg"] = (np.radians(columns["phase_sin_deg"]) - low) % (2 * np.pi) + low
    said = refuse(["fit", "ringdown", written(tmp_path, columns), "--card", "free-dome", "--save", saved])
    assert "phase_sin_deg" in said
    assert "in rad. Multiply the column by 57.29578" in said
    assert not saved.exists()
    for sd in (0.1, 1.0):  # a line on the reference: its phase stays within π degrees of 0, whatever its noise
        still = np.clip(sd * np.random.default_rng(2).standard_normal(TIME.size), -3.1, 3.1)
        check_phase("still.csv", "phase_cos_deg", np.exp(-TIME / 60), still)


@pytest.mark.slow
@pytest.mark.parametrize("polar", [False, True])
def test_contract_one_pick_off_with_its_components_exchanged_is_refused_by_its_columns(tmp_path, refuse, polar):
    """I + iQ becomes Q + iI, a phase its negative: the line of that pick-off lies on the other side of the reference. The right file of the same gyro is the control."""
    reference, time = 4599.69, TIME[::3]
    z = noisy(GYRO.envelope(time, reference, [1.0, 0.8j]), 0.003, np.random.default_rng(1))
    right = read_decay(written(tmp_path, lock_in_columns(z, polar, time), reference))
    assert right.estimates["split_Hz"].value == pytest.approx(0.12, abs=1e-3)
    assert not any("mirrored" in said for said in right.remarks)
    z[1] = z[1].conj() * (1 if polar else 1j)
    said = refuse(["fit", "ringdown", written(tmp_path, lock_in_columns(z, polar, time), reference)])
    words = "phase_sin_deg has the opposite sign" if polar else "in_phase_sin_V and out_of_phase_sin_V, are exchanged"
    assert words in said


def test_contract_a_split_that_each_pick_off_sees_half_of_is_doubted_and_kept(tmp_path):
    """Modes along the pick-offs, as far above as below the reference: both readings hold, so the split stands with a remark."""
    gyro = Gyro(4600.0, 4599.4, 9.0e5, 1.1e6, 0.0, 0.0)
    z = noisy(gyro.envelope(TIME, 4599.7, [1.0, 0.8j]), 0.003, np.random.default_rng(1))
    found = read_decay(written(tmp_path, lock_in_columns(z, False)))
    assert found.estimates["split_Hz"].value == pytest.approx(0.6, abs=1e-3)
    assert "Doubtful" in found.remarks[0]


@pytest.mark.parametrize(("ms", "said"), [(1000.0, "divide it by 1000"), (1.0, "")])
def test_contract_a_q_that_no_shell_has_is_a_time_in_milliseconds(tmp_path, refuse, ms, said):
    """Annealed fused silica has 2e8 at the most (Ageev et al. 2004), this gyro 2.7e6."""
    gyro = Gyro(4599.75, 4599.63, 2.5e6, 2.9e6, np.radians(31), np.radians(70))
    z = noisy(gyro.envelope(TIME, 4599.7, [1.0, 0.8j]), 0.003, np.random.default_rng(1))
    columns = lock_in_columns(z, False)
    path = written(tmp_path, columns | {"time_s": ms * TIME})
    if said:
        assert said in refuse(["fit", "ringdown", path])
        found = read_decay(written(tmp_path, columns | {"time_s": 150.0 * TIME}))  # a record, and not impossible
        assert any("is time_s in milliseconds?" in one for one in found.remarks)
    else:
        assert not any("milliseconds" in one for one in read_decay(path).remarks)


def test_contract_a_decay_in_minutes_is_told_by_the_q_of_its_card(tmp_path, refuse, capsys):
    """Sixty times too lossy and sixty times split: a card of it was saved (Q 1.7e5 for 1e7)."""
    gyro = Gyro(4432.075, 4432.025, 0.9e7, 1.1e7, np.radians(31), np.radians(70))
    z = noisy(gyro.envelope(TIME, 4432.05, [1.0, 0.8j]), 1e-4, np.random.default_rng(1))
    columns, saved = lock_in_columns(z, False), tmp_path / "card.toml"
    path = written(tmp_path, columns | {"time_s": TIME / 60.0}, 4432.05)
    asked = ["fit", "ringdown", path, "--card", "hrg-30mm"]
    assert "is time_s in minutes? Then multiply it by 60" in refuse([*asked, "--save", saved])
    assert not saved.exists()
    assert main([*map(str, asked)]) == 0
    assert "is time_s in minutes?" in capsys.readouterr().err
    written(tmp_path, columns, 4432.05)
    assert main([*map(str, asked)]) == 0
    assert "minutes" not in capsys.readouterr().err
