"""Settled parts of a record: soaks, each of which becomes one row of a steady-state table, as the HRG paper makes its Table 1.

Settled: |dT/dt| τ of the sensor and |df/dt| τ over the slope of the frequency are small, τ the slowest time constant (3
000 s, Figure 3) or the record's. An unsettled hold is extrapolated along its last third, f = a + b exp(−t/τ), where that is sure enough.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from compensation.arrays import Array
from compensation.decimation import average_blocks
from compensation.errors import CompensationError
from compensation.noise import white_rms
from compensation.samples import check_time
from studies.errors import InputError
from studies.record import Record

BLOCK = 60.0  # s
REACH = 5  # blocks to either side, over which slopes are taken in a quiet record
FARTHEST = 60  # the same in a noisy one
UNSEEN = 1 / 3  # of the tolerance: what noise may make of what is left (one standard deviation)
LEAST = 600.0  # s, of a soak
USUAL_SLOPE = 8e-5  # 1/K, relative, where a record is too even to show its own
HELD = 0.5  # K, within which a temperature is held
STANDS_OUT = 5.0  # scatters of a block, by which an exponential is seen
UNTRUE = 0.2  # of what is left at the end of a hold: error of its extrapolation (0.06 to 0.14 in simulated steps of 10 and 20 K)
HOUR = 3600.0
TEMPERATURES = ("housing_temperature_degC", "chamber_temperature_degC")


@dataclass(frozen=True)
class Soak:
    """One settled part, or the settled state that the end of a hold is extrapolated to."""

    path: str  # of its record
    # start, end: float, s
    start: float
    end: float
    # temperature_degC, frequency_Hz: float, means, or the extrapolated state
    temperature_degC: float
    frequency_Hz: float
    error_Hz: float  # float, of the frequency: its scatter, and what is left to settle
    left_K: float  # float, largest estimate of what is left to settle; of an extrapolated state its error
    time_constant: float  # float, s, by which that is judged
    extrapolated_K: float = 0.0  # float, from the last reading to the state; 0 of a settled part


def find_soaks(records: Sequence[Record], time_constant: float = 3000.0, tolerance: float = 0.05) -> tuple[Soak, ...]:
    """Find the settled parts of records, by the slowest time constant, given or shown, and what may be left of a change."""
    if not (time_constant > 0 and tolerance > 0):
        raise InputError("a time constant and a tolerance must be positive.")
    found = []
    for one in _judge(records, time_constant, tolerance):
        soaks = _soaks_of(one, tolerance)
        found += sorted([*soaks, *_extrapolated(one, soaks, tolerance)], key=lambda soak: soak.start)
    return tuple(found)


def settled_table(soaks: Sequence[Soak], where: str, advice: str = "") -> tuple[Array, Array, float]:
    """Return temperatures (°C) and frequencies (Hz) of soaks, and the step (Hz) of readings that are as uncertain as theirs."""
    T, f = np.array([s.temperature_degC for s in soaks]), np.array([s.frequency_Hz for s in soaks])
    if np.count_nonzero(np.diff(np.sort(T)) > 0.5) < 1:
        raise InputError(
            f"{where}: found {len(soaks) or 'no'} settled {'part' if len(soaks) == 1 else 'parts'}; a fit over temperature needs at least two"
            f" temperatures 0.5 K apart. {advice or 'Hold each temperature longer.'} Raising --left accepts parts that are less settled."
        )
    return T, f, float(np.sqrt(12.0) * max(s.error_Hz for s in soaks))


def advise_hold(records: Sequence[Record], time_constant: float, tolerance: float) -> str:
    """Say how long to hold a temperature: the longest hold that had not settled needs τ ln(left/tolerance) more."""
    holds = [(one, rows) for one in _judge(records, time_constant, tolerance) for rows in find_holds(one.drive)]
    # Slopes near the end of a hold know of what comes after it.
    whole = [(one, rows[: -one.reach]) for one, rows in holds if _is_whole(one.time, rows, one.reach)]
    if not whole:
        longest = max((float(np.ptp(one.time[rows])) for one, rows in holds), default=0.0)
        return f"Hold each temperature longer: none is held for more than {longest / 60:.0f} min." if holds else ""
    moving = [(one, rows) for one, rows in whole if one.left[rows[-2 * one.reach :]].min() > tolerance]
    if not moving:
        return ""
    longest = max(float(np.ptp(one.time[rows])) for one, rows in moving)
    found = [_settling(one, rows, tolerance) for one, rows in moving if np.ptp(one.time[rows]) > 0.9 * longest]
    speed, own, needed = max(found, key=lambda one: one[2])  # the temperature that settles most slowly
    moves = f"The frequency still drifts by {speed * HOUR:.2g} Hz/h at the end of the longest hold that has not settled, {longest / HOUR:.1f} h"
    if not np.isfinite(own):
        return f"{moves}: hold each temperature longer."
    return f"{moves}; with the time constant of {own / 60:.0f} min that it shows, hold each temperature {np.ceil(10 * needed / HOUR) / 10:.1f} h."


def _settling(one: "_Judged", rows: NDArray[np.intp], tolerance: float) -> tuple[float, float, float]:
    """Speed at the end of a hold (Hz/s), its time constant (s) and how long it should be held (s); infinite where none shows."""
    t, f = one.time[rows], one.frequency[rows]
    speed = abs(float(_slopes(t, f, one.reach)[-1]))
    own = _time_constant(t[len(t) // 2 :], f[len(t) // 2 :])
    # The mean is that of the middle of its rows, the reach before their end; as much at the end of a hold sees what comes after.
    left = float(one.left[rows[-2 * one.reach :]].mean())
    return speed, own, float(np.ptp(t)) + own * float(np.log(left / tolerance)) + LEAST + one.reach * one.width


@dataclass(frozen=True)
class _Seen:
    """Blocks of a record: time (s), what holds the temperature (°C), temperature, frequency (Hz) and its slope (Hz/K)."""

    path: str
    time: Array
    drive: Array
    temperature: Array
    frequency: Array
    slope: float
    width: float


@dataclass(frozen=True)
class _Judged(_Seen):
    """What is left to settle (K) in every block, by a time constant (s), from slopes over `reach` blocks to either side."""

    left: Array
    time_constant: float
    reach: int


def _judge(records: Sequence[Record], time_constant: float, tolerance: float) -> list[_Judged]:
    seen = [one for record in records if (one := _see(record)) is not None]
    tau = max(time_constant, _shown(seen, tolerance))
    return [_judge_one(one, tau, tolerance) for one in seen]


def _see(record: Record) -> _Seen | None:
    column = next((name for name in TEMPERATURES if name in record), TEMPERATURES[0])
    drive = TEMPERATURES[1] if TEMPERATURES[1] in record else column
    try:
        check_time(record["time_s"])
        blocks = average_blocks(
            record["time_s"],
            {column: record[column], "frequency_Hz": record["frequency_Hz"], drive: record[drive]},
            max(BLOCK, float(np.median(np.diff(record["time_s"])))),
        )
    except CompensationError as error:
        raise InputError(f"{record.path}: {error}") from None
    t, T, f = blocks.time, blocks.columns[column], blocks.columns["frequency_Hz"]
    if len(t) < 2 * REACH + 1:
        return None
    slope = abs(float(np.polyfit(T - T.mean(), f, 1)[0])) if np.ptp(T) > 1.0 else 0.0
    return _Seen(
        record.path or "record", t, blocks.columns[drive], T, f, slope or USUAL_SLOPE * float(f.mean()), blocks.width
    )


def _shown(seen: Sequence[_Seen], tolerance: float) -> float:
    """Return the longest time constant (s) that the longest holds show clearly, 0 where none does."""
    found = []
    for one in seen:
        for rows in (rows[:-REACH] for rows in find_holds(one.drive) if _is_whole(one.time, rows, REACH)):
            half = rows[len(rows) // 2 :]
            tau = _time_constant(one.time[half], one.frequency[half], tolerance * one.slope)
            if tau < np.ptp(one.time[half]):
                found.append((float(np.ptp(one.time[rows])), tau))
    longest = max((length for length, _ in found), default=0.0)
    return max((tau for length, tau in found if length > 0.9 * longest), default=0.0)


def _judge_one(one: _Seen, time_constant: float, tolerance: float) -> _Judged:
    t, T, f = one.time, one.temperature, one.frequency
    noise = time_constant * max(white_rms(T), white_rms(f) / one.slope) / one.width
    # A line through blocks −r … r has a slope that scatters by σ/√Σk².
    r = np.arange(REACH, FARTHEST + 1)
    quiet = np.flatnonzero(noise <= UNSEEN * tolerance * np.sqrt(r * (r + 1) * (2 * r + 1) / 3))
    reach = int(r[quiet[0]]) if quiet.size else FARTHEST
    left = time_constant * np.maximum(np.abs(_slopes(t, T, reach)), np.abs(_slopes(t, f, reach)) / one.slope)
    return _Judged(**vars(one), left=left, time_constant=time_constant, reach=reach)


def _soaks_of(one: _Judged, tolerance: float) -> list[Soak]:
    t, T, f, left = one.time, one.temperature, one.frequency, one.left
    found = []
    for rows in _stretches((left < tolerance) & (np.gradient(t) < 3 * one.width), T, one.reach):
        if t[rows[-1]] - t[rows[0]] >= LEAST:
            scatter = float(np.std(np.diff(f[rows]))) / np.sqrt(2.0 * len(rows))
            uncertainty = float(np.hypot(scatter, one.slope * left[rows].mean()))
            ends, means = (float(t[rows[0]]), float(t[rows[-1]])), (float(T[rows].mean()), float(f[rows].mean()))
            found.append(Soak(one.path, *ends, *means, uncertainty, float(left[rows].max()), one.time_constant))
    return found


def _extrapolated(one: _Judged, soaks: Sequence[Soak], tolerance: float) -> list[Soak]:
    """Return the states that holds without a settled part would settle at, where their error is within the tolerance."""
    found = []
    for rows in (rows[: -one.reach] for rows in find_holds(one.drive)):
        t = one.time[rows]
        settled = any(soak.start < t[-1] and soak.end > t[0] for soak in soaks) if len(rows) else True
        if settled or not _is_whole(one.time, rows, one.reach):
            continue
        half, third = (rows[-(len(rows) // part) :] for part in (2, 3))
        early, late = (_asymptote(one.time[part], one.frequency[part]) for part in (half, third))
        if early is None or late is None:
            continue
        left = abs(late.left) * max(one.time_constant / late.time_constant, 1.0)
        error = float(np.linalg.norm([late.error, UNTRUE * left, early.value - late.value]))
        if error > tolerance * one.slope:
            continue
        T = late.extrapolate(one.time[third], one.temperature[third])
        ends = float(one.time[third[0]]), float(one.time[third[-1]])
        shares = error / one.slope, late.time_constant, abs(late.left) / one.slope
        found.append(Soak(one.path, *ends, T, late.value, error, *shares))
    return found


@dataclass(frozen=True)
class _Asymptote:
    """Where y = a + b exp(−t/τ) leads: a with its error, what is left at the last time, τ (s)."""

    value: float
    error: float
    left: float
    time_constant: float

    def extrapolate(self, t: Array, y: Array) -> float:
        """Return where another column settles with the same time constant."""
        return float(np.linalg.lstsq(_decay(t, self.time_constant), y, rcond=None)[0][0])


def _decay(t: Array, tau: float) -> Array:
    return np.column_stack([np.ones(len(t)), np.exp(-(t - t[-1]) / tau)])


def _asymptote(t: Array, y: Array) -> _Asymptote | None:
    tau = _time_constant(t, y)
    if not np.isfinite(tau):
        return None
    X = _decay(t, tau)
    (a, b), *_ = np.linalg.lstsq(X, y, rcond=None)
    J = np.column_stack([X, b * X[:, 1] * (t - t[-1]) / tau**2])
    variance = float(np.sum((y - X @ [a, b]) ** 2)) / max(len(t) - 3, 1)
    return _Asymptote(float(a), float(np.sqrt(variance * np.linalg.pinv(J.T @ J)[0, 0])), float(b), tau)


def _is_whole(time: Array, rows: NDArray[np.intp], reach: int) -> bool:
    return len(rows) > 3 * reach and float(np.ptp(time[rows])) >= LEAST


def find_holds(drive: Array) -> list[NDArray[np.intp]]:
    """Rows of the stretches in which a temperature stays within `HELD`."""
    ends, low, high = [0], np.inf, -np.inf
    for k, T in enumerate(drive):
        low, high = min(low, T), max(high, T)
        if high - low > HELD:
            ends.append(k)
            low = high = T
    return [np.arange(first, last) for first, last in pairwise([*ends, len(drive)])]


def _time_constant(t: Array, f: Array, least: float = 0.0) -> float:
    """Time constant (s) of f = a + b exp(−t/τ); infinite where b stands out neither from noise nor `least` (Hz), or τ is too long."""

    def miss(log_tau: float) -> tuple[float, float]:
        X = np.column_stack([np.ones(len(t)), np.exp(-(t - t[0]) / np.exp(log_tau))])
        found, *_ = np.linalg.lstsq(X, f, rcond=None)
        return float(np.sum((f - X @ found) ** 2)), float(found[1])

    length = float(np.ptp(t))
    low, high = np.log(length / 30), np.log(3 * length)
    best = scipy.optimize.minimize_scalar(lambda x: miss(x)[0], bounds=(low, high), method="bounded").x
    scatter = np.sqrt(miss(best)[0] / max(len(t) - 3, 1))
    if min(best - low, high - best) < 0.01 or abs(miss(best)[1]) < max(STANDS_OUT * scatter, least):
        return np.inf
    return float(np.exp(best))


def _slopes(t: Array, values: Array, reach: int) -> Array:
    """Slopes of straight lines through each block and its neighbours."""
    slopes = np.empty_like(values)
    for k in range(len(t)):
        near = slice(max(k - reach, 0), k + reach + 1)
        x = t[near] - t[near].mean()
        slopes[k] = float(x @ values[near]) / float(x @ x)
    return slopes


def _stretches(settled: NDArray[np.bool_], T: Array, reach: int) -> list[NDArray[np.intp]]:
    """Settled rows, apart where more than some of them together are not, or the temperature is another: noise interrupts no soak."""
    rows = np.flatnonzero(settled)
    gap = np.diff(rows)
    apart = (gap > 2 * reach) | ((gap > 2 * REACH) & (np.abs(np.diff(T[rows])) > HELD))
    return [part for part in np.split(rows, np.flatnonzero(apart) + 1) if len(part)]
