"""Decimation of a record by block averages, with spikes and missing samples left out and counted.

A block average is the anti-alias filter of stability analysis: its response sin(πfτ)/(πfτ) vanishes at every
multiple of the output rate, and the averages of white noise stay white. Sampling may be irregular.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compensation.arrays import Array
from compensation.errors import CompensationError
from compensation.samples import check_time
from compensation.spikes import NEIGHBOURS, find_spikes


@dataclass(frozen=True)
class Blocks:
    """Block averages: `time` (b,) mean time of each block, `columns` name → (b,), `counts` samples used (b,).

    `missing` rows with an empty value, `spikes` rows with a value that its neighbours contradict; blocks with
    fewer than half the usual number of samples are left out.
    """

    time: Array
    columns: Mapping[str, Array]
    counts: NDArray[np.intp]
    width: float
    missing: int
    spikes: int


def average_groups(values: Array, group: NDArray[np.intp], count: int = 0) -> Array:
    """Return the mean of the values of every group 0, 1, …, at least `count` of them; NaN of a group without values.

    Sums of differences from one value keep the digits that sums of large values lose.
    """
    if not values.size:
        return np.full(count, np.nan)
    middle = float(values[0])
    members = np.bincount(group, minlength=count)
    total = np.bincount(group, values - middle, len(members))
    return np.asarray(middle + np.divide(total, members, out=np.full(len(members), np.nan), where=members > 0))


def average_blocks(time: ArrayLike, columns: Mapping[str, ArrayLike], width: float) -> Blocks:
    """Average columns over blocks of `width` (s), any sampling; a row that lacks one of them (NaN) is left out of all."""
    t = np.asarray(time, dtype=np.float64)
    arrays = {name: np.asarray(column, dtype=np.float64) for name, column in columns.items()}
    check_time(t)
    for name, column in arrays.items():
        if column.shape != t.shape:
            raise CompensationError(f"'{name}' has {column.size} values for {t.size} times; they must be equally many.")
    if not width > 0:
        raise CompensationError(f"the length of a block must be positive, not {width:g} s.")
    present = np.all([np.isfinite(column) for column in arrays.values()], axis=0)
    if np.count_nonzero(present) < NEIGHBOURS:
        raise CompensationError(
            f"only {np.count_nonzero(present)} rows have a value in each of {', '.join(arrays)}; record more."
        )
    keep = present.copy()
    for column in arrays.values():
        keep[present] &= ~find_spikes(column[present])
    used = t[keep]
    edges = np.searchsorted(used, used[0] + width * np.arange(np.floor((used[-1] - used[0]) / width) + 2))
    counts = np.diff(edges)
    full = counts >= max(1.0, 0.5 * float(np.median(counts[counts > 0])))
    starts, counts = edges[:-1][full], counts[full]

    def mean(column: Array) -> Array:
        # Sums of differences from one value keep the digits that running sums of large values lose.
        total = np.concatenate([[0.0], np.cumsum(column[keep] - column[keep][0])])
        return np.asarray((total[starts + counts] - total[starts]) / counts + column[keep][0])

    return Blocks(
        time=mean(t),
        columns={name: mean(column) for name, column in arrays.items()},
        counts=counts,
        width=float(width),
        missing=int(np.count_nonzero(~present)),
        spikes=int(np.count_nonzero(present & ~keep)),
    )
