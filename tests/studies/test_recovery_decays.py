"""Laws over many decays: planted, of an exact pendulum, and of measured sets that may not be copied here.

Those sets are read from the folder that HRG_MEASURED names: `membrane_ringdown` (github qpit/Ringdown-Processor) and `pendulum`
(github danielfgmb/DataCollectionPendulumRPI).
"""

import csv
import datetime
import os
from pathlib import Path

import numpy as np
import pytest
from scipy.special import ellipk

from studies.calibration.observed import observe
from studies.cli import main
from studies.record import read_record
from studies.record.decays import Decays, fit_laws
from tests.tables import write_columns

MEASURED = Path(os.environ.get("HRG_MEASURED", "missing"))


def laws(ask, *words):
    found = ask(["fit", "ringdown", *words])["laws"]
    return {name: law | {term["term"]: term for term in law["terms"]} for name, law in found.items()}


def holds(term, value):
    return term["low"] <= value <= term["high"]


def test_a_pendulum_that_is_solved_exactly_follows_the_printed_law(tmp_path, ask):
    """T = T₀ (1 + θ²/16), ½ α per kelvin; periods by the elliptic integral, late at the launch, with a reading error by place."""
    random, alpha, rows = np.random.default_rng(2), 1.6e-5, []
    for decay in range(60):
        T = 19.5 - 0.02 * decay + 0.1 * random.standard_normal()
        theta = 0.2 * random.uniform(0.9, 1.1) * np.exp(-np.arange(64) / 150)
        period = 3.3735 * (1 + alpha / 2 * (T - 19)) * 2 / np.pi * ellipk(np.sin(theta / 2) ** 2)
        period *= 1 + 2e-5 * random.standard_normal(64) + 1e-5 * np.sin(1.46 * np.arange(64))
        period[:3] += [3e-3, 2e-3, 1e-3]
        seen = theta * (1 + 0.01 * random.standard_normal(64))
        seen[random.integers(64)] = 0.0
        rows += [
            (720.0 * decay + 3.4 * k, decay, 1 / p, T, a) for k, (p, a) in enumerate(zip(period, seen, strict=True))
        ]
    names = ("time_s", "decay", "frequency_Hz", "housing_temperature_degC", "vibration_amplitude_V")
    law = laws(ask, write_columns(tmp_path / "swings.csv", dict(zip(names, zip(*rows, strict=True), strict=True))))[
        "frequency_Hz"
    ]
    assert law["left_out_rows"] == 3
    true = 1 / (3.3735 * (1 + alpha / 2 * (law["level_temperature_degC"] - 19)))
    assert law["level"] == pytest.approx(true, abs=4 * law["level_sd"])
    # the next term of the series, 11/3072 θ⁴, is −0.0003 here
    assert law["energy"]["value"] == pytest.approx(-1 / 16, abs=0.003)
    assert abs(law["temperature"]["value"] + alpha / 2) < 3 * law["temperature"]["sd"] < 1e-5


def test_a_step_between_sessions_is_a_step_and_ageing_is_ageing(tmp_path, ask):
    random = np.random.default_rng(4)
    time = np.concatenate([day * 86400.0 + 600.0 * np.arange(8) for day in (0, 3, 11, 20)])
    noise = 1e-7 * random.standard_normal(time.size)
    stepped = np.repeat([0.0, 4e-6, -2e-6, 1e-6], 8)
    for shape, term in ((stepped, "step 2"), (2e-7 * time / 86400, "time")):
        path = write_columns(tmp_path / "f.csv", {"time_s": time, "frequency_Hz": 7000 * (1 + shape + noise)})
        law = laws(ask, path)["frequency_Hz"]
        assert term in law
        assert abs(law[term]["value"] - (-6e-6 if term == "step 2" else 2e-7)) < 4 * law[term]["sd"]
        assert ("time" in law) == (term == "time")


@pytest.mark.parametrize("bend", [0.0, -2.2e-7])
def test_ageing_is_found_beside_a_frequency_that_bends_over_temperature(tmp_path, ask, bend):
    """f = f₀ (1 + α T + b T² + 1e-8 t) with 4.5e-8 of reading: ln f bends by b − α²/2, of a straight f too. The ageing was dropped, or 4 of 8 intervals held it."""
    held, alpha = 0, 8e-5
    for seed in range(30):
        random = np.random.default_rng(seed)
        T, time = random.uniform(15, 30, 60), np.sort(random.uniform(0, 30 * 86400, 60))
        x, noise = T - T.mean(), 4.5e-8 * random.standard_normal(60)
        f = 4432.07 * (1 + alpha * x + bend * x**2 + 1e-8 * time / 86400 + noise)
        columns = {"time_s": time, "frequency_Hz": f, "housing_temperature_degC": T}
        if seed == 0:
            law = laws(ask, write_columns(tmp_path / "f.csv", columns))["frequency_Hz"]
            assert law["scatter"] == pytest.approx(4.5e-8, rel=0.3)
            assert holds(law["temperature squared"], bend - alpha**2 / 2)
        term = fit_laws(Decays(columns, {}))["frequency_Hz"].terms["time"]
        held += term.low <= 1e-8 <= term.high
    assert held >= 24  # of 90 % intervals, fewer by chance once in forty


def test_decays_that_depend_on_nothing_tell_their_level_and_scatter(tmp_path, capsys):
    random = np.random.default_rng(6)
    columns = {"time_s": 900.0 * np.arange(40), "frequency_Hz": 7000 + 1e-3 * random.standard_normal(40)}
    assert main(["fit", "ringdown", write_columns(tmp_path / "still.csv", columns)]) == 0
    assert "no condition explains it, nor does time. Level: 7000.0" in capsys.readouterr().out


def test_viscous_gas_goes_with_the_root_of_the_pressure(tmp_path, ask):
    random = np.random.default_rng(5)
    p = np.geomspace(1.0, 1e5, 16)
    loss = (2e-6 + 3e-7 * np.sqrt(p)) * (1 + 0.05 * random.standard_normal(16))
    law = laws(ask, write_columns(tmp_path / "p.csv", {"pressure_Pa": p, "inverse_q": loss}))["inverse_q"]
    assert holds(law["root pressure"], 3e-7)


def test_decays_over_temperature_become_a_record_for_calibration(tmp_path, ask):
    """1/Q = 1e-6 (1 + 0.01 (T − 20 °C)) in twelve traces; calibration takes the record that is written."""
    random, paths = np.random.default_rng(6), []
    for k, T in enumerate(np.linspace(0, 40, 12)):
        rate = np.pi * 4599.7 * 1e-6 * (1 + 0.01 * (T - 20))
        t = np.linspace(0, 4 / rate, 600)
        power = 20 * np.log10(np.exp(-rate * t) + 1e-3 * random.standard_normal(t.size))
        when = datetime.datetime(2026, 3, 1) + datetime.timedelta(hours=6 * k)
        notes = [
            f"temperature_degC: {T}",
            f"start: {when.isoformat()}",
            f"reference_frequency_Hz: {4599.7 * (1 + 8e-5 * (T - 20))}",
        ]
        paths.append(write_columns(tmp_path / f"{k}.csv", {"time_s": t, "power_dB": power}, notes))
    out = tmp_path / "decays.csv"
    law = laws(ask, *paths, "--out", str(out))["inverse_q"]
    assert law["temperature"]["value"] == pytest.approx(1e-8, rel=0.05)
    assert law["level"] == pytest.approx(1e-6, rel=0.01)
    (run,) = observe([read_record(out)])
    assert {"frequency_Hz", "inverse_q"} <= set(run.responses)


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"time_s": [0, 1], "frequency_Hz": [7e3, 7e3]}, "four readings"),
        ({"time_s": [0, 2, 1, 3, 4], "frequency_Hz": [7e3] * 5}, "does not increase"),
        ({"time_s": [0, 1], "inverse_q": [1e7, 1e7]}, "not a possible reading"),
        ({"time_s": [0, 1], "frequency_Hz": [7e3] * 2, "pressure_mbar": [1, 2]}, "pressure_mbar"),
    ],
)
def test_tables_that_hold_no_decays_are_refused(tmp_path, refuse, columns, said):
    err = refuse(["fit", "ringdown", write_columns(tmp_path / "x.csv", columns)])
    assert said in err
    assert "x.csv" in err


needs = pytest.mark.skipif(not MEASURED.is_dir(), reason="HRG_MEASURED names no folder")


@needs
def test_published_gas_law_of_a_membrane(tmp_path, ask):
    """Free-molecular gas on 60 nm of silicon nitride: 5.3e-5 1/Pa; four steps of the frequency between five days."""
    with open(MEASURED / "membrane_ringdown" / "sample0321_mode1.csv") as file:
        rows = list(csv.DictReader(file))
    when = np.array([datetime.datetime.fromisoformat(row["utc"]).timestamp() for row in rows])
    columns = {
        "time_s": when - when[0],
        "frequency_Hz": [float(row["frequency_Hz"]) for row in rows],
        "inverse_q": [1 / float(row["Q"]) for row in rows],
        "pressure_Pa": [100 * float(row["pressure_mbar"]) for row in rows],
    }
    found = laws(ask, write_columns(tmp_path / "membrane.csv", columns))
    assert holds(found["inverse_q"]["pressure"], 5.3e-5)
    assert "step 4" in found["frequency_Hz"]
    assert "time" not in found["frequency_Hz"]


@needs
@pytest.mark.parametrize("first", [1, 4])
def test_published_law_of_a_pendulum(tmp_path, ask, first):
    """399 decays: θ²/16, and α/2 per kelvin with α = 1.6e-5."""
    with open(MEASURED / "pendulum" / "swings.csv") as file:
        rows = [row for row in csv.DictReader(file) if int(row["sample"]) >= first]
    when = np.array([datetime.datetime.fromisoformat(row["utc"]).timestamp() for row in rows])
    columns = {
        "time_s": when - when[0],
        "decay": [1000 * int(row["file"]) + int(row["run"]) for row in rows],
        "frequency_Hz": [1 / float(row["period_s"]) for row in rows],
        "housing_temperature_degC": [float(row["temperature_degC"]) for row in rows],
        "vibration_amplitude_V": [float(row["velocity_cm_per_s"]) / 100 / np.sqrt(9.81 * 2.8155) for row in rows],
    }
    law = laws(ask, write_columns(tmp_path / "swings.csv", columns))["frequency_Hz"]
    assert holds(law["energy"], -1 / 16)
    assert holds(law["temperature"], -0.8e-5)
