"""Holes in a record: what a driving temperature may have done between two distant rows: departures (K) from a line, in a few parts."""

import numpy as np

from thermal.profile import Profile

WIDE = 3.5  # usual distances of rows, from which a hole is more than a missing row
MOST = 8  # of a run, the widest
PARTS = 3  # of a hole: base, stem and shell behind a housing
LEAST = 0.02  # K, departure of a temperature that was steady on both sides


def bridge_holes(profile: Profile) -> tuple[Profile, dict[int, float]]:
    """Put `PARTS − 1` rows into each hole of a measured profile; return it, and by row k how far (K, sd) it may be off midway before."""
    t, T = profile.time, profile.value
    h = np.diff(t)
    usual = float(np.median(h))
    wide = np.flatnonzero(h > WIDE * usual)
    wide = np.sort(wide[np.argsort(-h[wide], kind="stable")][:MOST])
    departures: dict[int, float] = {}
    inner = [np.linspace(t[k], t[k + 1], PARTS + 1)[1:-1] for k in wide]
    for place, k in enumerate(wide):
        near = max(int(np.ceil(h[k] / 2 / usual)), 2)
        beside = np.ptp(T[max(k - near, 0) : k + 1]) + np.ptp(T[k + 1 : k + 2 + near])
        size = max(0.5 * float(abs(T[k + 1] - T[k]) + beside), LEAST)
        first = int(k) + 1 + place * (PARTS - 1)
        departures |= {first + part: size for part in range(PARTS)}
    times = np.sort(np.concatenate([t, *inner]), kind="stable")
    values = np.interp(times, t, T) if wide.size else T
    return Profile(times, values), departures
