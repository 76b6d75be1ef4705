"""Gaps of a record: where a column has no values for longer than its usual step."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
LONG = 10.0  # usual steps between two values that make a gap, whatever the rows between them hold
SKIPPED = 1.5  # the same where rows between them are empty


def find_gaps(time: Array, values: Array) -> Array:
    """Return begin and end of every gap of a column, (k, 2): the times of the values beside it, or the ends of the record."""
    rows = np.flatnonzero(np.isfinite(values))
    if rows.size < 2:
        return np.array([[time[0], time[-1]]]) if time.size > 1 else np.empty((0, 2))
    steps = np.diff(time[rows])
    usual = float(np.median(steps))
    at = np.flatnonzero((steps > LONG * usual) | ((np.diff(rows) > 1) & (steps > SKIPPED * usual)))
    inner = np.column_stack([time[rows[at]], time[rows[at + 1]]])
    ends = [(time[0], time[rows[0]]), (time[rows[-1]], time[-1])]
    outer = [end for end in ends if end[1] - end[0] > usual / 2]
    found = np.concatenate([inner, np.array(outer).reshape(-1, 2)])
    return np.asarray(found[np.argsort(found[:, 0])])
