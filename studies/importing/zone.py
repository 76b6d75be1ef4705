"""Local stamps of a named time zone: the hour that comes twice in autumn is told apart by the order of the rows."""

import datetime
from collections.abc import Callable
from typing import TYPE_CHECKING

from studies.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


def place_in_zone(
    origin: datetime.datetime, seconds: "Array", zone: str, place: Callable[[int], str]
) -> "tuple[datetime.datetime, Array, int]":
    """Return the origin with its offset from UTC, true seconds (N,) after it, and how many rows lie in an hour that comes twice."""
    import numpy as np

    rows = np.flatnonzero(np.isfinite(seconds))
    ahead, doubtful = _utc_offsets(origin, seconds[rows], zone)
    skipped = np.flatnonzero(np.isnan(ahead))
    if len(skipped):
        raise InputError(
            f"{place(int(rows[skipped[0]]))}: this time does not exist in {zone}, whose clocks skip that hour; a logger that"
            " stays on winter time needs a fixed zone, such as timezone = 'Etc/GMT-1' for one hour ahead of UTC."
        )
    true = seconds.copy()
    true[rows] -= ahead - ahead[0]
    return origin.replace(tzinfo=datetime.timezone(datetime.timedelta(seconds=float(ahead[0])))), true, doubtful


def _utc_offsets(origin: datetime.datetime, seconds: "Array", zone: str) -> "tuple[Array, int]":
    """Return by how many seconds the zone's clocks are ahead of UTC at each local time; NaN where the time does not exist."""
    import numpy as np
    import pandas as pd

    wall = pd.DatetimeIndex(np.datetime64(origin, "us") + np.round(1e6 * seconds).astype("timedelta64[us]"))

    def ahead(summer: bool) -> "Array":
        placed = wall.tz_localize(zone, ambiguous=np.full(len(wall), summer), nonexistent="NaT")
        return np.asarray((wall - placed.tz_convert(None)) / pd.Timedelta(seconds=1), dtype=float)

    first, second = ahead(summer=True), ahead(summer=False)
    twice = np.flatnonzero(first > second)
    for block in np.split(twice, np.flatnonzero(np.diff(twice) > 1) + 1) if len(twice) else []:
        start = _second_pass(seconds, int(block[0]), int(block[-1]))
        first[start : block[-1] + 1] = second[start : block[-1] + 1]
    return first, len(twice)


def _second_pass(seconds: "Array", begin: int, end: int) -> int:
    """Return the row of a block in the repeated hour that begins the second pass: where stamps step back, else by the
    smaller step beside it.
    """
    import numpy as np

    back = np.flatnonzero(np.diff(seconds[begin : end + 1]) < 0)
    if len(back):
        return begin + int(back[0]) + 1
    before = seconds[begin] - seconds[begin - 1] if begin else np.inf
    after = seconds[end + 1] - seconds[end] if end + 1 < len(seconds) else np.inf
    return begin if after < before else end + 1
