"""A card calibrated on a gyro whose heat path has another form: distributed, with a board beside it; nothing simulated."""

import numpy as np
import pytest

from studies.calibration.calibrate import calibrate
from studies.instrument.card import load_card
from studies.record import Record
from tests.stranger.network import STEP_S, Network, housing_of, integrate

NETWORK = Network(
    housing_s=700.0, main_s=1500.0, stem_s=120.0, shell_s=90.0, board_share=0.15, board_s=4000.0, t4_share=0.0
)
OPEN = ("thermal.", "noise.", "material.deviation.shear_modulus")


def _run(times, levels, random):
    """A run that begins at rest: rows of two minutes, 5 mK and 1 mHz."""
    t = np.arange(0.0, 4 * 3600.0 + 1.0, STEP_S)
    chamber = np.interp(t, times, levels)
    housing = housing_of(NETWORK, chamber)
    x = integrate(NETWORK, housing)[0] - 20.0
    columns = {
        "time_s": t,
        "chamber_temperature_degC": chamber,
        "housing_temperature_degC": housing + 5e-3 * random.standard_normal(t.size),
        "frequency_Hz": 4432.07 * (1 + 82e-6 * x - 6e-8 * x**2) + 1e-3 * random.standard_normal(t.size),
    }
    return Record({name: column[::12] for name, column in columns.items()})


@pytest.mark.slow
def test_a_heat_path_of_another_form_is_fitted_as_well_as_it_can_be_and_the_misfit_is_said():
    random, card = np.random.default_rng(1), load_card("hrg-30mm").with_values({"thermal.cells": 10})
    runs = [_run((0, 900, 1800), (20, 20, 0), random), _run((0, 900, 2100), (20, 20, 45), random)]
    exact = [value.name for value in card.uncertain if not value.name.startswith(OPEN)]
    found = calibrate(card, runs, exact=exact, profile=False)
    assert found.fit.converged
    for name, rung in found.ladder.items():
        rows, noise = found.fit.rows[name], found.fit.noise[name]
        assert rung.calibrated < 0.1 * rung.as_shipped
        assert np.mean(rows.whiten(found.fit.state.residual[name], noise) ** 2) < 1.5  # the noise is what is left
    assert max(abs(one.shift_sd) for one in found.estimates) < 6
    values = len(found.fit.problem.priors.values)
    away = [
        sd * u
        for (_, name, sd), u in zip(found.fit.problem.starts, found.fit.point[values:], strict=True)
        if "initial" in name
    ]
    assert np.abs(away).max() < 0.3
    (said,) = [one for one in found.warnings if "poor fit in the frequency" in one]
    assert "hrg diagnose" in said
