"""Decimation of a record by block averages, an anti-alias filter sin(πfτ)/(πfτ); spikes and missing samples are counted."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compensation.arrays import Array
from compensation.errors import CompensationError
from compensation.samples import check_time
from compensation.spikes import NEIGHBOURS, find_spikes

GAP = 3.0  # usual distances of rows, across which the bend of a curve is not known


@dataclass(frozen=True)
class Blocks:
    """Block averages at mean times (b,), of `counts` samples; `missing` and `spikes` are rows left out, half-empty blocks too."""

    time: Array
    columns: Mapping[str, Array]
    counts: NDArray[np.intp]
    width: float
    missing: int
    spikes: int


def average_groups(values: Array, group: NDArray[np.intp], count: int = 0) -> Array:
    """Return the mean of every group 0, 1, … (NaN of an empty one), summing differences from one value to keep digits."""
    if not values.size:
        return np.full(count, np.nan)
    middle = float(values[0])
    members = np.bincount(group, minlength=count)
    total = np.bincount(group, values - middle, len(members))
    return np.asarray(middle + np.divide(total, members, out=np.full(len(members), np.nan), where=members > 0))


def curvature(time: Array, column: Array) -> Array:
    """Return the second derivative of columns (N,) or (N, p) over uneven times, by three points; none across a gap."""
    step = np.diff(time)
    usual = (step <= GAP * np.median(step)).astype(float)
    behind = (slice(None), *[None] * (column.ndim - 1))
    slope = np.diff(column, axis=0) / step[behind]
    inner = 2.0 * np.diff(slope, axis=0) / (step[1:] + step[:-1])[behind] * (usual[1:] * usual[:-1])[behind]
    return np.concatenate([inner[:1], inner, inner[-1:]])


def bend_of_means(time: Array, column: Array, width: Array) -> Array:
    """Return what means of rows of a curve y, their times scattered by σ = `width` (s), have beyond its middle: σ² y''/2."""
    return np.asarray(0.5 * width.reshape(-1, *[1] * (column.ndim - 1)) ** 2 * curvature(time, column))


def average_blocks(time: ArrayLike, columns: Mapping[str, ArrayLike], width: float) -> Blocks:
    """Average columns over blocks of `width` (s), any sampling; a row that lacks one of them (NaN) is left out of all."""
    t = np.asarray(time, dtype=np.float64)
    arrays = {name: np.asarray(column, dtype=np.float64) for name, column in columns.items()}
    check_time(t)
    for name, column in arrays.items():
        if column.shape != t.shape:
            raise CompensationError(
                f"'{name}' has {column.size} value{'s' * (column.size != 1)} for {t.size} times; they must be equally many."
            )
    if not width > 0:
        raise CompensationError(f"the length of a block must be positive, not {width:g} s.")
    present = np.all([np.isfinite(column) for column in arrays.values()], axis=0)
    if np.count_nonzero(present) < NEIGHBOURS:
        raise CompensationError(f"only {(there := np.count_nonzero(present))} row{'s have' if there != 1 else ' has'} a value in each of {', '.join(arrays)}; record more.")  # fmt: skip
    keep = present.copy()
    for column in arrays.values():
        keep[present] &= ~find_spikes(column[present])
    used = t[keep]
    starts = used[0] + width * np.arange(np.floor((used[-1] - used[0]) / width) + 1)
    block = np.searchsorted(starts, used, side="right") - 1
    counts = np.bincount(block, minlength=len(starts))
    full = counts >= max(1.0, 0.5 * float(np.median(counts[counts > 0])))

    def mean(column: Array) -> Array:
        return average_groups(column[keep], block, len(starts))[full]

    return Blocks(
        time=mean(t),
        columns={name: mean(column) for name, column in arrays.items()},
        counts=counts[full],
        width=float(width),
        missing=int(np.count_nonzero(~present)),
        spikes=int(np.count_nonzero(present & ~keep)),
    )
