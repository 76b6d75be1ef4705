"""Holes of a measured temperature: the curve that bridges them, and how far it may be off."""

from collections.abc import Iterable, Mapping

import numpy as np

from compensation.arrays import Array
from thermal.profile import Profile

WIDE = 3.5  # usual distances of rows, from which a hole is more than a missing row
MOST = 8  # of a run, the widest: the others are bridged and not doubted
PARTS = 3  # of a hole: base, stem and shell behind a housing
LEAST = 0.02  # K, departure of a temperature that was steady on both sides
BESIDE = 4  # rows on each side of a hole, or all within half its width, tell the slope there
STEEPEST = 3.0  # mean slopes of a hole: up to it a cubic does not turn round (Fritsch and Carlson 1980)


def bridge_holes(profile: Profile) -> tuple[Profile, dict[int, float]]:
    """Put `PARTS − 1` rows into each hole of a measured profile; return it, and by the first of these rows how far (K, sd) each part may be off midway.

    A hole of width h has the cubic of its ends' values and slopes s, T − line = h (s₀ u (1 − u)² − s₁ u² (1 − u)) for
    slopes beside the line's; its rows are off the line by so much more that straight pieces have its integral, h² (s₀ − s₁)/12.
    """
    t, T = profile.time, profile.value
    h = np.diff(t)
    usual = float(np.median(h))
    wide = np.flatnonzero(h > WIDE * usual)
    doubted = set(wide[np.argsort(-h[wide], kind="stable")][:MOST])
    u = np.arange(1, PARTS) / PARTS
    times, values, departures = [], [], dict[int, float]()
    for place, k in enumerate(int(k) for k in wide):
        s0, s1 = _slopes_beside(t, T, k, usual)
        bend = h[k] * (s0 * u * (1 - u) ** 2 - s1 * u**2 * (1 - u)) * PARTS**2 / (PARTS**2 - 1)
        times.append(t[k] + h[k] * u)
        values.append(T[k] + (T[k + 1] - T[k]) * u + bend)
        if k in doubted:
            near = max(int(np.ceil(h[k] / 2 / usual)), 2)
            beside = np.ptp(T[max(k - near, 0) : k + 1]) + np.ptp(T[k + 1 : k + 2 + near])
            size = max(0.5 * float(abs(T[k + 1] - T[k]) + beside), LEAST)
            departures[k + 1 + place * (PARTS - 1)] = size
    if not wide.size:
        return profile, {}
    at = np.repeat(wide + 1, PARTS - 1)
    return Profile(np.insert(t, at, np.concatenate(times)), np.insert(T, at, np.concatenate(values))), departures


def _slopes_beside(t: Array, T: Array, k: int, usual: float) -> tuple[float, float]:
    """Return the slopes (K/s) before and after the hole that follows row k, beside its mean slope; where few rows tell, none."""
    h, mean = t[k + 1] - t[k], (T[k + 1] - T[k]) / (t[k + 1] - t[k])
    reach = max(h / 2, BESIDE * usual)
    found = []
    for at, rows in (
        (k, np.arange(np.searchsorted(t, t[k] - reach), k + 1)),
        (k + 1, np.arange(k + 1, np.searchsorted(t, t[k + 1] + reach) + 1)),
    ):
        rows = rows[rows < len(t)]
        slope = np.polyfit(t[rows] - t[at], T[rows] - T[at], 2)[1] if len(rows) >= BESIDE else mean
        low, high = sorted((0.0, STEEPEST * mean))
        found.append(float(np.clip(slope, low, high) - mean))
    return found[0], found[1]


def each_part(holes: Mapping[int, float]) -> dict[int, float]:
    """Return how far each part of the holes may be off, by the row after it."""
    return {k + part: size for k, size in holes.items() for part in range(PARTS)}


def longest_hole(profile: Profile, holes: Iterable[int]) -> tuple[float, float]:
    """Return the width (s) of the widest hole of a bridged profile, and the time (s) after which it is."""
    t = profile.time
    return max((float(t[k + PARTS - 1] - t[k - 1]), float(t[k - 1])) for k in holes)


def straight(profile: Profile, holes: Iterable[int]) -> Profile:
    """Return a bridged profile with straight lines over its holes, which are given by the first of their rows."""
    own = [k + part for k in holes for part in range(PARTS - 1)]
    t, T = np.delete(profile.time, own), np.delete(profile.value, own)
    return Profile(profile.time, np.interp(profile.time, t, T)) if own else profile
