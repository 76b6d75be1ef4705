"""What records show of a gyro in use: transfer function, angle kept without power, drift over its life."""

import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.polynomial import Polynomial

from compensation.arrays import Array
from compensation.regression import LinearFit, compare_nested, fit_linear
from compensation.response import measure_response
from studies.acceptance.measure import YEAR, Found, Measured, of_fit, within
from studies.errors import InputError
from studies.record import Record

HEARD = 1e-4  # of the largest power of the applied rate, from which on a frequency is one that was applied
TOLD = 0.1  # relative error of the response, below which a band tells it
FEWEST = 8  # bands
LEAST_TERMS, TERMS, RARE = 4, 7, 1e-3  # even powers, and odd ones, of the frequency: one more must pay at this level
BEYOND, SAME = 1.25, 1e-9  # part of the corner up to which they are fitted; imaginary part of a real root
HALF = math.sqrt(0.5)
LEAST = 100  # rows


def measure_transfer(record: Record) -> Found:
    """Bandwidth and delay of the measured rate behind the applied one (12.15), from a swept or shaken run.

    1/H = e^{jωd} Σ_k c_k (jω)ᵏ with real c_k, of poles and a delay: the bandwidth is where |1/H|² is 2 c₀², -dφ/dω at rest is d + c₁/c₀.
    """
    time, x, y = (record[name] for name in ("time_s", "rate_deg_per_s", "measured_rate_deg_per_s"))
    step = np.diff(time)
    if len(time) < LEAST or np.ptp(step) > 1e-3 * float(np.median(step)) or not np.isfinite(x + y).all():
        raise InputError(f"{record.path}: a transfer function needs both rates in {LEAST} evenly spaced rows or more.")
    f, H, error, applied = measure_response(x, y, 1 / float(np.median(step)))
    kept = (applied > HEARD * applied.max()) & (error < TOLD * np.abs(H))
    f, H, error, source = f[kept], H[kept], error[kept], (record.path,)
    fallen = np.flatnonzero(np.abs(H) < HALF * np.median(np.abs(H[:FEWEST]))) if f.size else f
    near = f <= (BEYOND * f[fallen[0]] if len(fallen) else np.inf)
    if near.sum() < FEWEST:
        raise InputError(f"{record.path}: the applied rate tells the response in {int(near.sum())} bands of frequency only; sweep it, or longer.")  # fmt: skip
    corner = float(f[fallen[0]] if len(fallen) else f[-1])
    f, H, weight = f[near], H[near], np.abs(H[near]) ** 2 / error[near]
    late = float(-np.polyfit(2 * np.pi * f, np.unwrap(np.angle(H)), 1)[0])
    inverse, u = np.exp(-2j * np.pi * f * late) / H, f / corner
    even, odd = _fit_powers(u, inverse.real, weight, 0), _fit_powers(u, inverse.imag, weight, 1)
    c0, c1, per = even.coefficients[0], odd.coefficients[0] / even.coefficients[0], 2 * np.pi * corner
    sd = np.hypot(odd.standard_errors[0], c1 * even.standard_errors[0]) / abs(c0) / per
    found = {"delay_ms": within(late + c1 / per, sd, source, odd.degrees_of_freedom, scale=1e3)}
    # where it does not fall off, the band that was applied is the least that it is
    found["bandwidth_Hz"] = Measured(float(f[-1]), float(f[-1]), None, source)
    if len(fallen):
        R, S = Polynomial(even.coefficients), Polynomial(odd.coefficients)  # of u²; |1/H|² = R² + u² S²
        excess = R**2 + Polynomial([0, 1]) * S**2 - 2 * c0**2
        v = min(
            (float(root.real) for root in excess.roots() if abs(root.imag) < SAME),
            key=lambda root: abs(root - 1),
            default=0.0,
        )
        if not u[0] ** 2 < v < u[-1] ** 2:
            raise InputError(
                f"{record.path}: noise hides where the response falls by 3 dB, near {corner:.3g} Hz; apply larger rates, or for longer."
            )
        by_even, by_odd = 2 * R(v) * v ** np.arange(R.coef.size), 2 * v * S(v) * v ** np.arange(S.coef.size)
        by_even[0] -= 4 * c0
        sd = np.sqrt(by_even @ even.covariance @ by_even + by_odd @ odd.covariance @ by_odd) / abs(excess.deriv()(v))
        free = min(even.degrees_of_freedom, odd.degrees_of_freedom)
        found["bandwidth_Hz"] = within(np.sqrt(v), sd / 2 / np.sqrt(v), source, free, scale=corner)
    return found


def _fit_powers(u: Array, values: Array, weight: Array, first: int) -> LinearFit:
    """Fit every second power of u from the `first` on, as many as the data support."""
    powers = first + 2 * np.arange(TERMS)
    fits = [
        fit_linear(
            u[:, None] ** powers[:n] * weight[:, None], values * weight, [f"c{k}" for k in powers[:n]], constant=False
        )
        for n in range(LEAST_TERMS, min(TERMS, len(u) // 2) + 1)
    ]
    pays = [compare_nested(*pair).p_value < RARE for pair in itertools.pairwise(fits)]
    return fits[max(np.flatnonzero(pays), default=-1) + 1]


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
