"""Offsets of turn-ons in runs of this file's own making: at one temperature, nothing simulated."""

import datetime

import numpy as np
import pytest

from studies.calibration.calibrate import calibrate
from studies.inference.polynomial_card import polynomial_card
from studies.instrument.card import load_card
from studies.record import Record
from studies.workbench import diagnose_records

pytestmark = pytest.mark.slow


def _run(offset, random):
    return Record(
        {
            "time_s": np.arange(0.0, 2400.0, 60.0),
            "housing_temperature_degC": 20.0 + 5e-3 * random.standard_normal(40),
            "bias_deg_per_h": 3.0 + offset + 0.05 * random.standard_normal(40),
        }
    )


def test_what_a_card_states_of_its_turn_ons_is_no_contradiction():
    """Runs that scatter as stated are of one device; one that lies sixteen times as far is asked about, card or no card."""
    random, offsets = np.random.default_rng(5), (-0.4, 0.2, 0.6)
    exact = {
        "thermal.cells": 10,
        "bias.damping_anisotropy": {"value": 0.01, "sd": 0.0},
        "noise.bias_turn_on_deg_per_h": 0.5,
    }
    card = load_card("hrg-30mm").with_values(exact)
    runs = [_run(offset, random) for offset in offsets]
    found = calibrate(card, runs, profile=False)
    assert not [warning for warning in found.warnings if "contradict" in warning]
    assert found.instrument.noise.bias_turn_on_deg_per_h == pytest.approx(np.std(offsets, ddof=1), rel=0.3)
    far = calibrate(card, [runs[0], _run(8.0, random)], profile=False)
    assert [warning for warning in far.warnings if "the card states 0.5 from run to run" in warning]


def _diagnose(levels, stated, drift=0.0):
    """Runs a day apart, whose bias follows a housing that swings, but for a level of each and a drift, °/h a day."""
    random, time, records = np.random.default_rng(9), np.arange(0.0, 7200.0, 60.0), []
    for k, level in enumerate(levels):
        housing = 25.0 + 8.0 * np.sin(2 * np.pi * time / 7200.0 + k)
        bias = 0.2 * (housing - 20.0) + level + drift * (k + time / 86400.0) + 0.05 * random.standard_normal(time.size)
        columns = {"time_s": time, "housing_temperature_degC": housing, "bias_deg_per_h": bias}
        start = datetime.datetime(2026, 5, 1 + k)
        records.append(Record(columns, start=start, path=f"run{k}.csv", sha256=str(k)))
    card = polynomial_card(records).with_values({"noise.bias_turn_on_deg_per_h": stated})
    return diagnose_records(records, card).verdict


def test_one_turn_on_beyond_what_is_stated_is_no_ageing():
    far = _diagnose((-0.1, 0.2, 9.1, -0.3), 0.3)
    assert (far.verdict, far.causes) == ("adequate", ())
    assert "run2.csv: its bias lies +9" in far.responses["bias_deg_per_h"].remark


def test_a_bias_that_rises_from_run_to_run_is_ageing_where_turn_ons_are_stated():
    old = _diagnose((0.0, 0.1, -0.1, 0.1), 0.1, 2.0)
    assert [cause.effect for cause in old.causes] == ["ageing"]
    assert "its bias lies" not in old.responses["bias_deg_per_h"].remark
