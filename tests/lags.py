"""A first-order lag for planted truths, row by row: no code of the product's."""

import numpy as np


def lag(time, drive, tau):
    """Return y of tau dy/dt = x - y, settled at first, exactly for an x that is linear between its rows."""
    time, drive = np.asarray(time, float), np.asarray(drive, float)
    keep = np.exp(-np.diff(time) / tau)
    behind = np.diff(drive) / np.diff(time) * tau  # what y is behind a ramp at last
    y = [drive[0]]
    for own, old, new in zip(keep, drive[:-1] - behind, drive[1:] - behind, strict=True):
        y.append(new + own * (y[-1] - old))
    return np.array(y)
