"""Readings that are not what their column says: temperatures in °F or with the opposite sign, a bias in °/s or of the opposite sign."""

from typing import TYPE_CHECKING

import numpy as np

from compensation.arrays import Array
from compensation.noise import white_rms
from shell.constants import zero_Celsius
from shell.errors import ShellError
from studies.calibration.ahead import BIAS
from studies.calibration.priors import gather_priors
from studies.calibration.problem import FARTHEST
from studies.calibration.settled import READ_AS, REVERSED
from studies.errors import InputError
from studies.resonator.law import law_of, moved_law
from studies.simulation.drive import COLUMN, drive_by_record
from studies.simulation.heat_path import slowest_lag
from studies.simulation.noise import bias_noise
from studies.simulation.prediction import predict
from thermal.errors import ThermalError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from shell.law import FrequencyLaw
    from studies.instrument.card import Instrument
    from studies.record import Record

    Left = Mapping[str, tuple[float, float]]

FREQUENCY, LOSS = "frequency_Hz", "inverse_q"
ROWS = 400
FOLLOWED, REFUSED = 0.3, 0.4
"""Parts of a frequency's changes: left of them by a reading that agrees, and by one that does not."""
AGAINST = 0.5
"""The same of a reading that agrees, where the other one leaves more than there was: a sign is told by less."""
LIKELY, STARTED, STEPS = 3.0, 2.0, 4
"""Standard deviations up to which a departure is likely; changes by which a frequency may start elsewhere; steps to the likeliest values."""
CLOSELY, CERTAIN = 0.02, 2.0
"""Part of a frequency's changes up to which a reading agrees with the very card, and departures that then speak for it: by chance, few gyros would."""
CLEAR = 20.0
"""Times its own noise by which a frequency must change before it says how a temperature is to be read."""
SECONDS = 3600.0
LIKE = 10.0
"""Times by which the noise of a bias in its right unit may differ from what the card states."""


def check_readings(instrument: "Instrument", records: "Sequence[Record]", law: "FrequencyLaw | None" = None) -> None:
    """Refuse records whose frequency follows the temperatures only if these are read otherwise, and a bias in °/s or of the opposite sign."""
    law = law or law_of(instrument)
    for record in records:
        check_unit(instrument, record)
        left = _left(instrument, record, law)
        _check_temperatures(instrument, record, left)
        _check_sign(instrument, record, left, law)


def _check_temperatures(instrument: "Instrument", record: "Record", as_read: "Left") -> None:
    """Refuse temperatures that the frequency follows only if they are read otherwise."""
    names = [name for name in COLUMN.values() if name in record]
    if FREQUENCY not in record or not names:
        return
    known = record[FREQUENCY][np.isfinite(record[FREQUENCY])]
    changes = float(np.std(known)) if known.size > 2 else 0.0
    if changes <= CLEAR * white_rms(known):
        return
    left = as_read[FREQUENCY][0]
    if left < REFUSED * changes:
        return
    whole = law_of(instrument)
    for words, read in READ_AS.items():
        columns = {name: read(record[name] + zero_Celsius) - zero_Celsius for name in names}
        read_so = record.with_columns(columns)
        other = _left(instrument, read_so, whole)[FREQUENCY][0]
        agrees = other < min((AGAINST if left > changes else FOLLOWED) * changes, left / 3)
        needed = _needed(instrument, read_so, changes, whole) if agrees else np.inf
        enough = CERTAIN if other < CLOSELY * changes else LIKELY
        if needed < LIKELY**2 and _needed(instrument, record, changes, whole) - needed > enough**2:
            right = columns[COLUMN["housing"] if COLUMN["housing"] in names else names[0]]
            wrong = [one for one in names if _apart(columns[one], right) <= _apart(record[one], right)]
            reversed_too = ", or frequency_Hz if its changes are reversed" if words == REVERSED else ""
            raise InputError(
                f"{record.path}: frequency_Hz does not follow the temperatures as the card predicts, unless they are read {words}:"
                f" {other:.2g} Hz of its {changes:.2g} Hz (rms) then remain. Correct {' and '.join(wrong)}{reversed_too}."
            )


def _needed(instrument: "Instrument", record: "Record", changes: float, law: "FrequencyLaw") -> float:
    """Sum of squares of the prior standard deviations by which values and the start must depart for the frequency to follow the temperatures; infinite where they cannot."""
    priors, places = gather_priors(instrument), _places(record)
    drive = drive_by_record(record, time=record["time_s"][places])
    known = np.isfinite(record[FREQUENCY][places])
    u = np.zeros(len(priors.values))
    for _ in range(STEPS):
        own = instrument.with_values(priors.at(u))
        try:
            found = predict(own, drive, priors.names, moved_law(law, own), FARTHEST)
        except (ShellError, ThermalError):
            return np.inf
        slopes = np.column_stack([found.derivatives[name][FREQUENCY] for name in priors.names]) @ priors.slopes(u)
        fades = (drive.time[0] - drive.time) / slowest_lag(found.network, instrument.reference_temperature)
        starts = STARTED * changes * np.exp(np.outer(fades, [1.0, 2.0, 4.0]))
        J = np.column_stack([slopes, starts])[known] / (FOLLOWED * changes)
        rest = (record[FREQUENCY][places] - found.columns[FREQUENCY] + slopes @ u)[known] / (FOLLOWED * changes)
        J, rest = J - J.mean(axis=0), rest - rest.mean()
        z = _departures(J, rest)
        u = priors.inside(np.clip(z[: len(u)], -LIKELY, LIKELY))
    return float(z @ z) if np.std(rest - J @ z) < 1.0 else np.inf


def _apart(one: Array, two: Array) -> float:
    return float(np.nanmedian(np.abs(one - two)))


def _check_sign(instrument: "Instrument", record: "Record", as_read: "Left", law: "FrequencyLaw") -> None:
    """Refuse a bias that follows what the card predicts with the opposite sign, where the card knows it."""
    if BIAS not in record:
        return
    white = white_rms(record[BIAS][np.isfinite(record[BIAS])])
    changes, left, rest = (
        float(np.sqrt(max(rms**2 - white**2, 0.0))) for rms in (float(np.nanstd(record[BIAS])), *as_read[BIAS])
    )
    if (
        white < changes
        and rest < min(FOLLOWED * changes, left / 3)
        and not _may_follow(instrument, record, changes, law)
    ):
        raise InputError(
            f"{record.path}: {BIAS} has the opposite sign to the card's prediction: the prediction leaves {rest:.2g} °/h of its"
            f" {changes:.2g} °/h with the sign changed and {left:.2g} °/h as it is (rms without white noise). Change the sign of the"
            " column or, if the output is right, that of the card's bias."
        )


def _may_follow(instrument: "Instrument", record: "Record", changes: float, law: "FrequencyLaw") -> bool:
    """Whether a bias follows the card's prediction as it is read, with values of the bias that the card holds for likely."""
    values = [one for one in gather_priors(instrument).values if one.name.startswith("bias.")]
    places = _places(record)
    drive = drive_by_record(record, time=record["time_s"][places])
    found = predict(instrument, drive, [one.name for one in values], law, FARTHEST)
    rows = [found.columns[BIAS], *(one.sd * found.derivatives[one.name][BIAS] for one in values)]
    known = np.isfinite(record[BIAS][places])
    told = np.array([record[BIAS][places] - rows[0], *rows[1:]])[:, known] / (FOLLOWED * changes)
    rest, *J = told - told.mean(axis=1, keepdims=True)
    X = np.reshape(J, (len(values), -1)).T
    z = _departures(X, rest)
    return float(np.std(rest - X @ z)) < 1.0 and float(z @ z) < LIKELY**2


def _departures(J: Array, rest: Array) -> Array:
    """Departures in standard deviations with which columns most probably explain a rest, both in units of what may be left."""
    heavy, count = len(J) ** 0.5, J.shape[1]
    X, y = np.vstack([J * heavy, np.eye(count)]), np.append(rest * heavy, np.zeros(count))
    return np.asarray(np.linalg.lstsq(X, y)[0])


def check_unit(instrument: "Instrument", record: "Record") -> None:
    """Refuse a bias that scatters 3600 times less than the card states, as one in °/s does."""
    if BIAS not in record or len(record) < ROWS // 10:
        return
    stated = bias_noise(instrument.noise).white / np.sqrt(float(np.median(np.diff(record["time_s"]))))
    scatter = white_rms(record[BIAS])
    if stated > 0 and stated / LIKE < SECONDS * scatter < stated * LIKE:
        raise InputError(
            f"{record.path}: {BIAS} scatters by {scatter:.2g} °/h from row to row, {stated / scatter:.0f} times less than the card states:"
            " the column is probably in °/s. Multiply it by 3600; if the gyro is as quiet as this, lower [noise] bias_white_deg_per_rt_h."
        )


def check_loss(instrument: "Instrument", record: "Record") -> None:
    """Refuse a 1/Q that is negative throughout; of a wave that turns freely the drive may be."""
    turning = instrument.loop is not None and instrument.loop.mode == "whole-angle"
    if LOSS in record and not turning and (middle := float(np.nanmedian(record[LOSS]))) < 0:
        raise InputError(
            f"{record.path}: {LOSS} is negative ({middle:.3g} in the middle); a loss is not. Change its sign."
        )


def _left(instrument: "Instrument", record: "Record", law: "FrequencyLaw") -> "Left":
    """Rms of frequency and bias, and of these with the sign changed, minus predicted about its mean, with the card as given; infinite where it cannot be predicted."""
    places, names = _places(record), [name for name in (FREQUENCY, BIAS) if name in record]
    try:
        found = predict(instrument, drive_by_record(record, time=record["time_s"][places]), (), law, FARTHEST).columns
    except (ShellError, ThermalError):
        return dict.fromkeys(names, (np.inf, np.inf))
    pairs = {name: (record[name][places], found[name]) for name in names}
    return {
        name: (float(np.nanstd(own - other)), float(np.nanstd(own + other))) for name, (own, other) in pairs.items()
    }


def _places(record: "Record") -> "NDArray[np.intp]":
    return np.unique(np.linspace(0, len(record) - 1, min(ROWS, len(record))).astype(int))
