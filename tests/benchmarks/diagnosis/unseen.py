"""An effect hidden in a card's own virtual runs, diagnosed, saved, and held against runs through a chamber profile that is new.

Every (effect, response) of the library stands in `HIDDEN` with the shape it has, and in one of the campaigns of `PACKS`, one
effect a response; `TIMES` the noise is the rms of what it adds to its response in the recorded runs.
"""

from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta

import numpy as np

from studies.calibration.ahead import spread_of_prediction
from studies.effects import find_effect, library
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
RATES = {("rate-frequency", "frequency_Hz"): 1 / 30}
"""Rows a second; what follows the rate of the temperature shows in the minutes after a step."""
GAP = 86400.0
RESPONSES = F, B, Q = ("frequency_Hz", "bias_deg_per_h", "inverse_q")
TIMES = 20.0
LARGER = {("curvature", "frequency_Hz"): 60.0, ("cross-damping", "bias_deg_per_h"): 40.0}
"""The same of what shows at the ends of the range, where the unseen profile hardly is."""
DEVIATIONS = 1.96
"""An error is within so many of its standard deviations in 95 of 100 draws of the noise; of several independent ones, in more."""
BIAS = {"bias.k1_deg_per_h_per_Hz": 0.5, "bias.damping_anisotropy": 0.0}
"""The bias follows the temperature; the wave's own anisotropy is 0, so that its azimuth may move without a second cause."""
COMMANDED = {
    "amplitude_squared": (1.0, 1.2, 0.8, 1.1),
    "voltage_squared": (80.0, 100.0, 60.0, 90.0),
    "quadrature": (0.5, 1.5, -0.5, 1.0),
    "pattern_angle": (0.0, 15.0, 30.0, 40.0),
}
"""Levels of a commanded drive, in the unit of its column."""
HIDDEN = {
    ("second-lag", "frequency_Hz"): {"second_time_constant_s": 9000.0, "weight": 1.0},
    ("rate-bias", "bias_deg_per_h"): {"coefficient_deg_per_h_per_K_per_s": 1.0},
    ("hysteresis", "bias_deg_per_h"): {"half_width_K": 4.0, "loop_deg_per_h_per_K": 1.0},
    ("hysteresis", "frequency_Hz"): {"half_width_K": 4.0, "loop_Hz_per_K": 1.0},
    ("hysteresis", "inverse_q"): {"half_width_K": 4.0, "loop_1_per_K": 1.0},
    ("ageing", "frequency_Hz"): {"onset_s": 9000.0, "drift_Hz": 1.0},
    ("ageing", "bias_deg_per_h"): {"onset_s": 9000.0, "drift_deg_per_h": 1.0},
    ("ageing", "inverse_q"): {"onset_s": 9000.0, "drift_1": 1.0},
    ("jump", "frequency_Hz"): {"run": 0.0, "time_s": 9000.0, "step_Hz": 1.0},
    ("jump", "bias_deg_per_h"): {"run": 0.0, "time_s": 9000.0, "step_deg_per_h": 1.0},
    ("jump", "inverse_q"): {"run": 0.0, "time_s": 9000.0, "step_1": 1.0},
    ("activity-dip", "frequency_Hz"): {"temperature_degC": 8.0, "width_K": 1.5, "pull_Hz": 1.0},
    ("activity-dip", "inverse_q"): {"temperature_degC": 8.0, "width_K": 1.5, "pull_1": 1.0},
    ("electrostatic-softening", "frequency_Hz"): {"softening_Hz_per_V2": 1.0},
    ("amplitude-frequency", "frequency_Hz"): {"slope_Hz_per_V2": 1.0},
    ("curvature", "frequency_Hz"): {"from_degC": -15.0, "to_degC": 40.0, "cubic_Hz_per_10K3": 1.0},
    ("cross-damping", "bias_deg_per_h"): {
        "from_degC": -15.0,
        "to_degC": 40.0,
        "axis_deg": -90.0,
        "quartic_deg_per_h_per_10K4": 1.0,
        "quintic_deg_per_h_per_10K5": 0.3,
    },
    ("self-heating", "frequency_Hz"): {"heating_K_per_V2": 1.0},
    ("loss-peak", "inverse_q"): {"temperature_degC": 8.0, "width_K": 6.0, "peak_1": 1.0},
    ("leak", "inverse_q"): {"temperature_exponent": 0.5, "growth_1_per_day": 1.0},
    ("periodic", "bias_deg_per_h"): {"period_s": 1700.0, "sine_deg_per_h": 1.0},
    ("periodic", "frequency_Hz"): {"period_s": 1700.0, "sine_Hz": 1.0},
    ("periodic", "inverse_q"): {"period_s": 1700.0, "sine_1": 1.0},
    ("radiation", "frequency_Hz"): {"exchange": 1.0, "radiated_share": 1.0},
    ("clock-drift", "frequency_Hz"): {"drift_Hz_per_day": 1.0},
    ("quadrature-leakage", "bias_deg_per_h"): {"leakage_deg_per_h_per_V": 1.0},
    ("axis-rotation", "bias_deg_per_h"): {"rotation_deg_per_10K": 4.0, "sine_deg_per_h": 1.0},
    ("thermometer-scale", "frequency_Hz"): {"cubic_K_per_10K3": 1.0},
    ("mounting-stress", "frequency_Hz"): {"relaxation_time_s": 6000.0, "stress_Hz_per_K": 1.0},
    ("mounting-stress", "bias_deg_per_h"): {"relaxation_time_s": 6000.0, "stress_deg_per_h_per_K": 1.0},
    ("thermometer-lag", "frequency_Hz"): {"sensor_time_constant_s": 1.0},
    ("rate-frequency", "frequency_Hz"): {"coefficient_Hz_per_K_per_s": 1.0},
    ("clock-offset", "frequency_Hz"): {"run": 0.0, "offset_s": 1.0},
    ("clock-offset", "bias_deg_per_h"): {"run": 0.0, "offset_s": 1.0},
}
TURN_ON = {"noise.bias_turn_on_deg_per_h": 0.02}
"""What a card must state for a drift of the bias from run to run to be told from offsets of turn-on, °/h: a tenth of the noise."""
PACKS = (
    (("jump", F), ("hysteresis", B), ("ageing", Q)),
    (("ageing", F), ("jump", B), ("hysteresis", Q)),
    (("hysteresis", F), ("ageing", B), ("jump", Q)),
    (("electrostatic-softening", F), ("axis-rotation", B), ("activity-dip", Q)),
    (("amplitude-frequency", F), ("mounting-stress", B), ("periodic", Q)),
    (("self-heating", F), ("cross-damping", B), ("leak", Q)),
    (("activity-dip", F), ("quadrature-leakage", B), ("loss-peak", Q)),
    (("radiation", F), ("rate-bias", B)),
    (("curvature", F), ("periodic", B)),
    (("periodic", F), ("clock-offset", B)),
    (("second-lag", F),),
    (("clock-drift", F),),
    (("thermometer-scale", F),),
    (("mounting-stress", F),),
    (("thermometer-lag", F),),
    (("rate-frequency", F),),
    (("clock-offset", F),),
)
"""Effects that do not disturb each other: one a response, and alone where it acts on all of them."""
MOVED = (
    "thermal.mount_conductance_W_per_K",
    "thermal.chamber_conductance_W_per_K",
    "material.deviation.shear_modulus.log_slope_per_K",
    "bias.k2_deg_per_h_per_Hz2",
)
"""Values of the device that are one of their standard deviations away from what the card says, where that is asked for."""


@dataclass(frozen=True)
class Hidden:
    """A card, records of a device that has effects more, and the device's next run, noiseless, with what drives it.

    `noise`: rms of the noise in the records, by response: the frequency, and those in which effects are hidden.
    """

    card: object
    records: list
    next_drive: object
    truth: object
    noise: dict

    def left(self, instrument):
        """Return the residual that an instrument leaves of the next run over its noise, by response; 1 is the noise."""
        said = simulate_run(instrument, self.next_drive, noise=False).record
        return {c: float(np.hypot(1.0, rms([said[c] - self.truth[c]]) / noise)) for c, noise in self.noise.items()}

    def stated(self, instrument):
        """Return what an instrument states that it will leave, its own uncertainty and the noise together over the noise."""
        spread = spread_of_prediction(instrument, self.next_drive)
        return {c: float(np.hypot(1.0, rms([spread[c]]) / noise)) for c, noise in self.noise.items()}


@dataclass(frozen=True)
class Recovery:
    """What came of hidden effects.

    `names` of all causes; `named` whether every effect is among them; of each response over its noise: `before` what the shipped
    card leaves of the new run, `after` what the saved one leaves, `stated` what its own uncertainties let expect; 1 is the noise.
    """

    names: tuple[str, ...]
    named: bool
    verdict: str
    before: dict
    after: dict
    stated: dict
    saved: object
    diagnosis: object

    @property
    def errors(self):
        """Error of the saved card over the standard deviation that it states of it, by response."""
        return {c: float(np.sqrt((self.after[c] ** 2 - 1) / (self.stated[c] ** 2 - 1))) for c in self.after}


def run_drive(words, start, commanded, turn, rate=RATE):
    """Return the drive of one run, its commands stepping through their levels."""
    profile = load_profile(words)
    time = rows_of(profile, rate)
    commands = {}
    for name in commanded:
        levels = COMMANDED[name]
        _, factor, power = COMMANDS[name]
        held = np.minimum((6 * time / time[-1]).astype(int), 5)
        commands[name] = (np.roll(np.resize(levels, 6), turn)[held] * factor) ** power
    return replace(drive_by_profile(profile, time), commands=commands, start=start)


def hide(*cases, times=TIMES, seed=0, moved=(), stated=None):
    """Hide effects in records of a device.

    `cases`: (effect, response), each of its own response. `moved`: names of values of the device that differ from the card that
    the diagnosis is given, by a standard deviation; `stated`: values that card and device have besides.
    """
    effects = [find_effect(name) for name, _ in cases]
    card = load_card(CARD).with_values(BIAS | (stated or {}))
    device = card.with_values({v.name: v.value + v.sd for v in card.uncertain if v.name in moved})
    turning = any(name == "cross-damping" and HIDDEN[name, r]["axis_deg"] > -90.0 for name, r in cases)
    commanded = sorted(
        {*(["pattern_angle"] if turning else []), *(need for effect in effects for need in effect.needs)}
    )
    starts = [k * GAP for k in range(len(PROFILES) + 1)]
    rate = max(RATES.get(case, RATE) for case in cases)
    drives = [
        run_drive(w, s, commanded, k, rate) for k, (w, s) in enumerate(zip((*PROFILES, UNSEEN), starts, strict=True))
    ]
    law = simulate_run(device, drives[0], noise=False).law

    def simulate(instrument, k, noise=True, law=law):
        return simulate_run(instrument, drives[k], seed=100 * seed + k, noise=noise, law=law).record

    bare = [simulate(device, k, noise=False) for k in range(3)]
    quiet = [simulate(device, k) for k in range(3)]
    measured = [column for column in RESPONSES if column == F or any(column == own for _, own in cases)]
    noise = {column: rms([q[column] - b[column] for q, b in zip(quiet, bare, strict=True)]) for column in measured}

    def sized(effect, response):
        """Return the effect's table at the size that adds so many times the noise."""
        shape, keys = HIDDEN[effect.name, response], effect.coefficient_names(response)
        column = "frequency_Hz" if effect.thermal and response != "inverse_q" else response
        size = 1e-4 if effect.thermal else 1e-2 * noise[column]

        def table(size):
            own = {key: value * size if key in keys else value for key, value in shape.items()}
            return {"name": effect.name, "response": response, **own}

        for _ in range(3):
            one = device.with_table("effect", [table(size)])
            runs = [0] if effect.once else [0, 1]
            added = rms([simulate(one, k, noise=False)[column] - bare[k][column] for k in runs])
            size *= LARGER.get((effect.name, response), TIMES) / TIMES * times * noise[column] / added
        return table(size)

    tables = [sized(effect, response) for effect, (_, response) in zip(effects, cases, strict=True)]
    lasting = [table for table, effect in zip(tables, effects, strict=True) if not effect.once]
    devices = [device.with_table("effect", own) if own else device for own in (tables, lasting, lasting)]
    records = []
    for k in range(2):
        record, start = simulate(devices[k], k), datetime(2026, 1, 1, tzinfo=UTC) + timedelta(seconds=starts[k])
        columns = {name: own for name, own in record.columns.items() if name in measured or name not in RESPONSES}
        records.append(replace(record, columns=columns, start=start, path=f"run{k}"))
    return Hidden(card, records, drives[2], simulate(devices[2], 2, noise=False), noise)


def recover(*cases, times=TIMES, seed=0, moved=(), stated=None):
    """Hide effects, each in a response of its own, diagnose, save, and predict a new run from its chamber alone."""
    hidden = hide(*cases, times=times, seed=seed, moved=moved, stated=stated)
    diagnosis = diagnose_records(hidden.records, hidden.card)
    saved = extend(diagnosis).instrument
    names = tuple(dict.fromkeys(n for cause in diagnosis.verdict.causes for n in cause.names))
    return Recovery(
        names,
        all(name in names for name, _ in cases),
        diagnosis.verdict.verdict,
        hidden.left(hidden.card),
        hidden.left(saved),
        hidden.stated(saved),
        saved,
        diagnosis,
    )


def rms(parts):
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def lacking():
    """Return the effects and responses of the library that no campaign hides."""
    return {(e.name, r) for e in library().values() for r in e.responses} - {case for pack in PACKS for case in pack}
