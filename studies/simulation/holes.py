"""Holes in a record: what a driving temperature may have done between two distant rows.

Over a hole the temperature is drawn as a straight line in a few parts; a departure (K) in the middle of each part is free. As
many as the heat path has slow parts leave nothing of its state known after the hole but what its rows show.
"""

import numpy as np

from thermal.profile import Profile

WIDE = 3.5  # usual distances of rows, from which a hole is more than a missing row
MOST = 8  # of a run, the widest
PARTS = 3  # of a hole: base, stem and shell behind a housing
LEAST = 0.02  # K, departure of a temperature that was steady on both sides


def bridge_holes(profile: Profile) -> tuple[Profile, dict[int, float]]:
    """Put rows into the holes of a measured profile.

    Returns:
        profile: With `PARTS − 1` rows more in each hole, on the straight line across it.
        departures: How far (K, standard deviation) it may have been from that line midway before row k, by k: half of
            the change across the hole, and half of what changed over as long before and after it.
    """
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
