"""What records show of a gyro in use: transfer function, angle kept without power, drift over its life."""

import math
from collections.abc import Sequence

import numpy as np
import scipy

from compensation.regression import fit_linear
from studies.acceptance.measure import CONFIDENCE, YEAR, Found, Measured, of_fit, within
from studies.errors import InputError
from studies.record import Record

SEGMENTS = 8  # of a record, each with its own spectrum; half overlapping
HEARD = 1e-4  # of the largest power of the applied rate, from which on a frequency is one that was applied
COHERENT = 0.8
HALF = math.sqrt(0.5)
LEAST = 100  # rows


def measure_transfer(record: Record) -> Found:
    """Bandwidth and delay of the measured rate behind the applied one (12.15), from the cross-spectrum of a swept or shaken run.

    H(f) = S_xy/S_xx where the applied rate has power and coherence; |H| has the relative error √((1 - γ²)/(2 γ² n)) of n segments.
    """
    time, x, y = (record[name] for name in ("time_s", "rate_deg_per_s", "measured_rate_deg_per_s"))
    step = np.diff(time)
    if len(time) < LEAST or np.ptp(step) > 1e-3 * float(np.median(step)) or not np.isfinite(x + y).all():
        raise InputError(f"{record.path}: a transfer function needs both rates in {LEAST} evenly spaced rows or more.")
    rate, size = 1 / float(np.median(step)), max(2 * len(x) // (SEGMENTS + 1), 16)
    f, across = scipy.signal.csd(x, y, rate, nperseg=size)
    _, applied = scipy.signal.welch(x, rate, nperseg=size)
    _, coherence = scipy.signal.coherence(x, y, rate, nperseg=size)
    kept = (f > 0) & (applied > HEARD * applied[1:].max()) & (coherence > COHERENT)
    if kept.sum() < 4:
        raise InputError(f"{record.path}: the applied rate covers {int(kept.sum())} frequencies only; sweep it.")
    f, H, squared = f[kept], across[kept] / applied[kept], coherence[kept]
    gain, phase = np.abs(H), np.unwrap(np.angle(H))
    error = np.sqrt((1 - squared) / (2 * squared * SEGMENTS))
    start = float(np.median(gain[:3]))
    z = float(scipy.special.ndtri(0.5 + CONFIDENCE / 2))

    def falls(curve: np.ndarray) -> float | None:
        below = np.flatnonzero(curve < HALF * start)
        if not len(below):
            return None
        place = int(below[0])
        if place == 0:
            return float(f[0])
        one, two = curve[place - 1], curve[place]
        return float(f[place - 1] + (one - HALF * start) / (one - two) * (f[place] - f[place - 1]))

    value, source = falls(gain), (record.path,)
    # where it does not fall off, the band that was applied is the least that it is
    least = falls(gain * (1 - z * error)) or float(f[-1])
    most = None if value is None else falls(gain * (1 + z * error))
    found: Found = {"bandwidth_Hz": Measured(float(f[-1]) if value is None else value, least, most, source)}
    low = f <= (value or f[-1]) / 2
    if low.sum() >= 3:
        fit = fit_linear(2 * np.pi * f[low][:, None], -phase[low], ["delay"])
        found["delay_ms"] = of_fit(fit, 1, source, 1e3)
    return found


def measure_storage(record: Record) -> Found:
    """How far the pattern's azimuth is, after the longest gap of the record, from where it was going before (12.13)."""
    if "pattern_angle_deg" not in record:
        raise InputError(f"{record.path}: angle storage needs the column pattern_angle_deg.")
    keep = np.isfinite(record["pattern_angle_deg"])
    time, angle = record["time_s"][keep], record["pattern_angle_deg"][keep]
    if len(time) < 2 * LEAST // 5:
        raise InputError(f"{record.path}: angle storage needs at least twenty rows before and after the gap.")
    at = int(np.argmax(np.diff(time))) + 1
    if np.diff(time)[at - 1] < 10 * np.median(np.diff(time)) or min(at, len(time) - at) < LEAST // 5:
        raise InputError(f"{record.path}: angle storage needs a gap in time while the power was off, with at least twenty rows before and after it.")  # fmt: skip
    sides = []
    for part in (slice(0, at), slice(at, None)):
        t = time[part] - time[at]
        unwrapped = np.rad2deg(np.unwrap(4 * np.deg2rad(angle[part]))) / 4  # a pattern of n = 2 repeats after 90°
        fit = fit_linear(t[:, None], unwrapped, ["drift"])
        row = np.array([1.0, 0.0])
        sides.append((float(fit.coefficients[0]), float(np.sqrt(row @ fit.covariance @ row))))
    (before, one), (after, two) = sides
    error = (after - before + 45.0) % 90.0 - 45.0
    return {"angle_storage_error_deg": within(error, math.hypot(one, two), [record.path])}


def measure_life(records: Sequence[Record], output: str) -> Found:
    """Change of the bias per year over dated runs at rest, three or more and a day or more apart (12.18, as far as they reach)."""
    dated = [record for record in records if record.start is not None]
    if len(dated) < 3:
        return {}
    at = np.array([record.start.timestamp() + float(record["time_s"].mean()) for record in dated if record.start])
    if np.ptp(at) < 2 * 86400.0:
        return {}
    bias = np.array([float(np.nanmean(record[output])) for record in dated])
    fit = fit_linear(((at - at.mean()) / YEAR)[:, None], bias, ["year"])
    return {"bias_trend_deg_per_h_per_year": of_fit(fit, 1, [r.path for r in dated])}
