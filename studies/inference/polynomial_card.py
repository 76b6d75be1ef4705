"""The card of a gyro of which only records are known: a polynomial law behind one lag, every value wide.

    f = f₀ (1 + a₁ x + a₂ x²),   x = T_r − T_ref;   bias = offset + a cubic in f − f₀;   1/Q = q₀ (1 + b₁ x + b₂ x²)

Most probable values are those of a fit by least squares at the lag that leaves least; of the widths no record sees an end.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy

from compensation.arrays import Array
from compensation.noise import white_rms
from shell.constants import zero_Celsius
from studies.calibration.noise_levels import LASTING
from studies.calibration.observed import ObservedRun, SettledTable, observe
from studies.instrument.card import SCHEMA, Instrument, build_instrument
from studies.record import Record
from thermal.lag import lag

LAGS = np.geomspace(30.0, 3e4, 40)
"""Lags, s, among which one is looked for."""
OF_RUN = 0.5
"""Part of the longest run up to which a response that is no thermometer shows a lag."""
WIDE, BENT = 10.0, {"frequency_Hz": 0.7, "bias_deg_per_h": 3.0, "inverse_q": 3.0}
"""Standard deviations of level and slope, and of each bend, over the covered range, in parts of what the response varies by."""
USUAL_LAG, USUAL_SPREAD = 1500.0, 1.5
"""Median (s) and standard deviation of the logarithm of lags of such resonators, for a record that shows none."""
START, STEEP, MISFIT = 10.0, 3.0, 0.02
"""How far the resonator may be from its housing at a start (K); the slope of the first fit over the covered range, and what it leaves, in parts of what the response varies by."""
ROWS = 120
"""Block averages of a run that the first fit looks at."""
LAG_WIDTH = 0.5
"""Standard deviation of the logarithm of the lag."""
PER_KELVIN = 1e-4
"""Relative slope of a frequency that nobody measured, which then stands for the temperature: 1 Hz for 1 K at 10 kHz."""
POWERS = {"frequency_Hz": 2, "inverse_q": 2, "bias_deg_per_h": 3}


def polynomial_card(records: Sequence[Record], name: str = "") -> Instrument:
    """Return the card of a gyro with these records; InputError where they have no drive or response, or are too short."""
    runs = observe(records, blocks=ROWS)
    housing = np.concatenate([run.inner.profile.value for run in runs])
    reference = float(np.round(0.5 * (housing.min() + housing.max()) - zero_Celsius, 1))
    x0, reach = reference + zero_Celsius, max(0.5 * float(np.ptp(housing)), 1e-2)
    by_chamber = runs[0].inner.boundary == "chamber"
    thermometers = [column for column in POWERS if any(column in run.responses for run in runs)]
    tau = _likeliest_lag(runs, thermometers[:1] if thermometers[0] == "frequency_Hz" else thermometers, x0)
    law: dict[str, Any] = {
        "f0_Hz": _exact(1.0 / PER_KELVIN),
        "a1_per_K": _exact(PER_KELVIN),
        "a2_per_K2": _exact(0.0),
        "a3_per_K3": _exact(0.0),
        "lag_s": {"value": tau, "sd": LAG_WIDTH * tau},
        "delay_s": {"value": 0.0, "sd": 10.0},
    }
    if {"frequency_Hz", "bias_deg_per_h"} <= set(thermometers):
        law["bias_bend"] = {"value": 0.5, "sd": 0.5}
    if by_chamber:
        law["chamber_lag_s"] = _exact(1.0)
    content: dict[str, Any] = {
        "schema": SCHEMA,
        "name": name or next((record.instrument for record in records if record.instrument), "") or "gyro",
        "reference_temperature_degC": reference,
        "law": law,
        "bias": {"damping_anisotropy": _exact(0.0), "damping_axis_deg": _exact(0.0)},
        "noise": {"housing_lag_s": _exact(0.0), "frequency_flicker_Hz": 0.0, "frequency_walk_Hz": 0.0,
                  "bias_flicker_deg_per_h": 0.0, "bias_walk_deg_per_h_per_rt_h": 0.0},
        "posterior": {"unseen": [column for column in POWERS if column not in thermometers]},
    }  # fmt: skip
    slope = 1.0
    for column in thermometers:
        level, own, spread = _levels(runs, column, tau, x0)
        if column == "frequency_Hz":
            slope = max(abs(own[0]), 0.1 * spread / reach)
            law |= _parabola(np.array([level, *own[:2]]), spread, reach, BENT[column])
            content["noise"]["frequency_white_Hz"] = _white(runs, column)
        elif column == "inverse_q":
            content["loss"] = {
                "inverse_q": {"value": level, "sd": WIDE * spread},
                "slope_per_K": {"value": own[0] / level, "sd": WIDE * spread / reach / level},
                "curvature_per_K2": {"value": own[1] / level, "sd": BENT[column] * spread / reach**2 / level},
            }
            content["noise"]["inverse_q_white"] = _white(runs, column) / level
        else:
            changes = slope * reach
            content["bias"] |= {
                "offset_deg_per_h": {"value": level, "sd": WIDE * spread},
                "k1_deg_per_h_per_Hz": {"value": own[0] / slope, "sd": WIDE * spread / changes},
                "k2_deg_per_h_per_Hz2": {"value": 0.0, "sd": BENT[column] * spread / changes**2},
                "k3_deg_per_h_per_Hz3": {"value": 0.0, "sd": BENT[column] * spread / changes**3},
            }
            content["noise"]["bias_white_deg_per_rt_h"] = _white(runs, column) / 60.0
    return build_instrument(content, "the records")


def settled_card(table: SettledTable) -> Instrument:
    """Return the card of a gyro with this steady-state table: a parabola of wide level, slope and curvature."""
    T, x = table.temperature - zero_Celsius, table.middled
    own = np.asarray(np.polyfit(x, table.frequency, 2)[::-1], dtype=float)
    law = _parabola(own, max(float(np.std(table.frequency)), table.rounding), float(x.max()), WIDE)
    law |= {"a3_per_K3": _exact(0.0), "lag_s": _exact(USUAL_LAG), "delay_s": _exact(0.0)}
    content = {"schema": SCHEMA, "name": "the table", "reference_temperature_degC": float((T - x)[0]), "law": law,
               "posterior": {"unseen": [column for column in POWERS if column != "frequency_Hz"]}}  # fmt: skip
    return build_instrument(content, table.path)


def _parabola(own: Array, spread: float, reach: float, bent: float) -> dict[str, dict[str, float]]:
    """Return level, slope and curvature of a frequency with their widths, of what it varies by over the covered range."""
    level, a1, a2 = (float(one) for one in own)
    return {
        "f0_Hz": {"value": level, "sd": WIDE * spread + 1e-4 * level},
        "a1_per_K": {"value": a1 / level, "sd": min(WIDE * spread / reach / level, 5e-3)},
        "a2_per_K2": {"value": a2 / level, "sd": bent * spread / reach**2 / level},
    }


def _exact(value: float) -> dict[str, float]:
    return {"value": value, "sd": 0.0}


def _followed(runs: Sequence[ObservedRun], column: str, tau: float, x0: float) -> tuple[Array, Array, Array]:
    """Return the column's blocks, the lagged temperature above a reference, and what an initial state of each run adds to it."""
    value, excess, starts = [], [], []
    members = [run for run in runs if column in run.responses]
    for k, run in enumerate(members):
        blocks, t = run.responses[column], run.inner.time
        follows = lag(t, run.inner.profile.at(t), tau) - x0
        own = np.zeros((len(blocks.value), len(members)))
        own[:, k] = blocks.average(np.exp(-(t - t[0]) / tau))
        value.append(blocks.value)
        excess.append(blocks.average(follows))
        starts.append(own)
    return np.concatenate(value), np.concatenate(excess), np.concatenate(starts)


def _fit(runs: Sequence[ObservedRun], column: str, tau: float, x0: float, apart: bool) -> tuple[Array, float]:
    """Return the coefficients of a polynomial with starts (and levels, where they lie `apart`) of each run, and what is left over noise."""
    y, x, starts = _followed(runs, column, tau, x0)
    spread = max(float(np.std(y)), 1e-300)
    reach = max(*(0.5 * float(np.ptp(run.inner.profile.value)) for run in runs), 1e-2)
    powers = range(1, POWERS[column] + 1)
    columns = [np.ones_like(x), *(x**power for power in powers), *starts.T]
    prior = [np.inf, STEEP * spread / reach, *(BENT[column] * spread / reach**power for power in powers if power > 1)]
    prior += [START * spread / reach] * starts.shape[1]
    if apart:
        columns += list((starts[:, 1:] > 0).astype(float).T)
        prior += [np.inf] * (starts.shape[1] - 1)
    X = np.stack(columns, axis=1)
    size = np.linalg.norm(X, axis=0)
    size[size == 0] = 1.0
    noise = MISFIT * spread
    whole = np.vstack([X / size / noise, np.diag(1.0 / (np.array(prior) * size))])
    target = np.append(y / noise, np.zeros(len(size)))
    found = np.linalg.lstsq(whole, target, rcond=1e-12)[0]
    return found / size, float(np.sum((target - whole @ found) ** 2))


def _likeliest_lag(runs: Sequence[ObservedRun], columns: Sequence[str], x0: float) -> float:
    """Return the lag behind which the columns, each in noise of its own, are likeliest: an effect in one of them is none in the others."""
    longest = max(float(np.ptp(run.inner.time)) for run in runs)
    most = 1e5 if "frequency_Hz" in columns else max(OF_RUN * longest, float(LAGS[1]))

    def left(logarithm: float) -> float:
        unusual = float((logarithm - np.log(USUAL_LAG)) / USUAL_SPREAD) ** 2
        rest = [_fit(runs, column, float(np.exp(logarithm)), x0, True)[1] for column in columns]
        if len(rest) == 1:
            return rest[0] + unusual
        rows = [sum(len(run.responses[one].value) for run in runs if one in run.responses) for one in columns]
        return float(np.dot(rows, np.log(rest))) + unusual

    grid = np.log(LAGS[LAGS <= most])
    seen = np.array([left(one) for one in grid])
    walled = np.concatenate([[np.inf], seen, [np.inf]])
    found = []
    for k in map(
        int, np.flatnonzero((seen <= walled[:-2]) & (seen <= walled[2:]))
    ):  # a narrow valley may be the deeper one
        ends = grid[max(k - 1, 0)], grid[min(k + 1, len(grid) - 1)]
        found.append(scipy.optimize.minimize_scalar(left, bounds=ends, method="bounded", options={"maxiter": 15}))
    return float(np.exp(min(found, key=lambda one: float(one.fun)).x))


def _levels(runs: Sequence[ObservedRun], column: str, tau: float, x0: float) -> tuple[float, Array, float]:
    """Return a column's level and coefficients about the reference, and the rms that it varies by about its mean."""
    own, _ = _fit(runs, column, tau, x0, column not in LASTING)
    y = np.concatenate([run.responses[column].value for run in runs if column in run.responses])
    spread = max(float(np.std(y)), 1e-12 * abs(float(np.median(y))), 1e-300)
    level = float(own[0])
    if column != "bias_deg_per_h" and not 0.5 * np.median(y) < level < 2.0 * np.median(y):
        level = float(np.median(y))
    return level, own[1:], spread


def _white(runs: Sequence[ObservedRun], column: str) -> float:
    """White noise of a column, as an Allan deviation at 1 s."""
    blocks = [run.responses[column] for run in runs if column in run.responses]
    span = float(np.median(np.concatenate([one.span for one in blocks])))
    return float(white_rms(*(one.value for one in blocks)) * np.sqrt(span))
