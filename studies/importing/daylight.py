"""Local times that leap by an hour where clocks go to summer or winter time: a gap, or rows twice, that are none."""

import datetime

import numpy as np

from compensation.arrays import Array

ZONES = ("Europe/London", "Europe/Berlin", "Europe/Helsinki", "America/New_York", "Australia/Sydney")
HOUR = 3600.0  # s
NEAR = 60.0  # s, beside half of the usual step
LONGEST_STEP = 6 * HOUR


def find_change(origin: datetime.datetime, seconds: Array) -> tuple[str, str] | None:
    """Return a zone whose clocks change where local times first leap by an hour, and in words what leaps; None where nothing does.

    The step s from one row to the next is an unusual one, but s - Δ is the usual one, where the zone is Δ = ± 1 h further ahead of UTC.
    """
    seconds = seconds[np.isfinite(seconds)]
    steps = np.diff(seconds)
    usual = float(np.median(steps)) if steps.size else 0.0
    near = max(NEAR, usual / 2)
    if not 0 < usual <= LONGEST_STEP:
        return None
    for more in (HOUR, -HOUR):
        for k in np.flatnonzero((abs(steps - usual - more) <= near) & (abs(steps - usual) > usual / 2)).tolist():
            one, two = (origin + datetime.timedelta(seconds=float(t)) for t in seconds[k : k + 2])
            for name in ZONES:
                if _change(origin, seconds[k : k + 2], name) == more:
                    leap, pause = ("more", ", unless the logger paused") if more > 0 else ("less", "")
                    return name, (
                        f"after {one:%Y-%m-%d %H:%M:%S} comes {two:%H:%M:%S}, an hour {leap} than between other rows: clocks change then,"
                        f" in {name} for one; give timezone = '{name}', or what applies{pause}"
                    )
    return None


def _change(origin: datetime.datetime, seconds: Array, zone: str) -> float:
    """Return by how much a zone is further ahead of UTC at the second of two local times; NaN where the machine does not know it."""
    try:
        before, after = (ahead_of_utc(origin, seconds[[k]], zone, summer=k == 0) for k in (0, 1))
    except (KeyError, OSError):
        return np.nan
    return float(after[0] - before[0])


def ahead_of_utc(origin: datetime.datetime, seconds: Array, zone: str, *, summer: bool) -> Array:
    """Return by how many seconds a zone is ahead of UTC at local times after an origin, the earlier (`summer`) or later of an hour that comes twice; NaN where the time does not exist."""
    import pandas as pd

    wall = pd.DatetimeIndex(np.datetime64(origin, "us") + np.round(1e6 * seconds).astype("timedelta64[us]"))
    placed = wall.tz_localize(zone, ambiguous=np.full(len(wall), summer), nonexistent="NaT")
    return np.asarray((wall - placed.tz_convert(None)) / pd.Timedelta(seconds=1), dtype=float)
