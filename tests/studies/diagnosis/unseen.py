"""An effect hidden in a card's own virtual runs, diagnosed, saved, and held against a run through a chamber profile that is new.

One effect a response; `TIMES` the noise is the rms of what it adds to its response in the recorded runs.
"""

from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta

import numpy as np

from studies.calibration.ahead import spread_of_prediction
from studies.effects import find_effect
from studies.inference.extension import extend
from studies.instrument.card import load_card
from studies.simulation.chamber import load_profile
from studies.simulation.drive import COMMANDS, drive_by_profile, rows_of
from studies.simulation.virtual_gyro import simulate_run
from studies.workbench import diagnose_records

CARD = "hrg-30mm"
PROFILES = ("cycle 20 -15 40 0.5 30min 1", "step 20 -10 3h then ramp -10 30 1 then soak 30 2h")
UNSEEN = "cycle 20 35 -10 1 20min 2"
RATE = 1 / 60
GAP = 86400.0
RESPONSES = F, B, Q = ("frequency_Hz", "bias_deg_per_h", "inverse_q")
TIMES = 20.0
DEVIATIONS = 1.96
"""An error is within so many of its standard deviations in 95 of 100 draws of the noise; of several independent ones, in more."""
CARD_SAYS = {
    "thermal.cells": 10,
    "bias.k1_deg_per_h_per_Hz": 0.5,
    "bias.damping_anisotropy": 0.0,
    "noise.bias_turn_on_deg_per_h": 0.02,
}
"""The bias follows the temperature, without a second cause; offsets of turn-on of a tenth of the noise, beside which a drift of the bias
from run to run is told."""
COMMANDED = {
    "amplitude_squared": (1.0, 1.2, 0.8, 1.1),
    "voltage_squared": (80.0, 100.0, 60.0, 90.0),
    "quadrature": (0.5, 1.5, -0.5, 1.0),
    "pattern_angle": (0.0, 15.0, 30.0, 40.0),
}
"""Levels of a commanded drive, in the unit of its column."""
CASES = (
    ("self-heating", F, {"heating_K_per_V2": 1.0}),
    ("ageing", B, {"onset_s": 9000.0, "drift_deg_per_h": 1.0}),
    ("jump", Q, {"run": 0.0, "time_s": 9000.0, "step_1": 1.0}),
)
"""Effects that do not disturb each other, with their shapes: of a commanded drive through the heat path, of days, of a moment."""


@dataclass(frozen=True)
class Recovery:
    """What came of hidden effects.

    `names` of all causes; of each response over its noise: `before` what the shipped card leaves of the new run, `after` what the
    saved one leaves, `stated` what its own uncertainties let expect; 1 is the noise.
    """

    names: tuple[str, ...]
    before: dict
    after: dict
    stated: dict

    @property
    def errors(self):
        """Error of the saved card over the standard deviation that it states of it, by response."""
        return {c: float(np.sqrt((self.after[c] ** 2 - 1) / (self.stated[c] ** 2 - 1))) for c in self.after}


def run_drive(words, start, commanded, turn):
    """Return the drive of one run, its commands stepping through their levels."""
    profile = load_profile(words)
    time = rows_of(profile, RATE)
    commands = {}
    for name in commanded:
        _, factor, power = COMMANDS[name]
        held = np.minimum((6 * time / time[-1]).astype(int), 5)
        commands[name] = (np.roll(np.resize(COMMANDED[name], 6), turn)[held] * factor) ** power
    return replace(drive_by_profile(profile, time), commands=commands, start=start)


def recover(cases):
    """Hide effects, each in a response of its own, diagnose, save, and predict a new run from its chamber alone."""
    effects = [find_effect(name) for name, _, _ in cases]
    card = load_card(CARD).with_values(CARD_SAYS)
    commanded = sorted({need for effect in effects for need in effect.needs})
    drives = [run_drive(w, k * GAP, commanded, k) for k, w in enumerate((*PROFILES, UNSEEN))]
    law = simulate_run(card, drives[0], noise=False).law

    def simulate(instrument, k, noise=False):
        return simulate_run(instrument, drives[k], seed=k, noise=noise, law=law).record

    bare, noisy = ([simulate(card, k, noise) for k in range(3)] for noise in (False, True))
    noise = {column: rms([q[column] - b[column] for q, b in zip(noisy, bare, strict=True)]) for column in RESPONSES}

    def sized(effect, response, shape):
        """Return the effect's table at the size that adds so many times the noise."""
        keys, size = effect.coefficient_names(response), 1e-4 if effect.thermal else 1e-2 * noise[response]

        def table(size):
            own = {key: value * size if key in keys else value for key, value in shape.items()}
            return {"name": effect.name, "response": response, **own}

        for _ in range(3 if effect.thermal else 1):  # of the others the response goes with the size
            one = card.with_table("effect", [table(size)])
            runs = [0] if effect.once else [0, 1]
            added = rms([simulate(one, k)[response] - bare[k][response] for k in runs])
            size *= TIMES * noise[response] / added
        return table(size)

    tables = [sized(effect, response, shape) for effect, (_, response, shape) in zip(effects, cases, strict=True)]
    lasting = [table for table, effect in zip(tables, effects, strict=True) if not effect.once]
    devices = [card.with_table("effect", own) if own else card for own in (tables, lasting, lasting)]
    starts = [datetime(2026, 1, 1, tzinfo=UTC) + timedelta(seconds=k * GAP) for k in range(2)]
    records = [replace(simulate(devices[k], k, True), start=starts[k], path=f"run{k}") for k in range(2)]
    truth, diagnosis = simulate(devices[2], 2), diagnose_records(records, card)
    saved = extend(diagnosis).instrument

    def left(instrument):
        said = simulate_run(instrument, drives[2], noise=False).record
        return {c: float(np.hypot(1.0, rms([said[c] - truth[c]]) / own)) for c, own in noise.items()}

    spread = spread_of_prediction(saved, drives[2])
    stated = {c: float(np.hypot(1.0, rms([spread[c]]) / own)) for c, own in noise.items()}
    names = tuple(name for cause in diagnosis.verdict.causes for name in cause.names)
    return Recovery(names, left(card), left(saved), stated)


def rms(parts):
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))
