"""Checks of sampled columns for missing values, NaN and time that does not increase."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compensation.errors import CompensationError

REGULAR = 1e-3  # largest departure from an even grid, as a part of the mean step, that still counts as even sampling


def read_columns(**columns: ArrayLike) -> list[NDArray[np.float64]]:
    """Return the named columns as arrays of floats, all finite and of one length."""
    try:
        arrays = [np.atleast_1d(np.asarray(values, dtype=float)) for values in columns.values()]
    except (TypeError, ValueError):
        raise CompensationError(f"{' and '.join(columns)} must be columns of numbers.") from None
    for name, values in zip(columns, arrays, strict=True):
        if values.ndim != 1 or len(values) != len(arrays[0]):
            raise CompensationError(f"'{name}' has shape {values.shape}, but there are {len(arrays[0])} rows.")
        holes = np.flatnonzero(~np.isfinite(values))
        if len(holes):
            raise CompensationError(f"'{name}' has {len(holes)} missing or infinite values, the first in row {holes[0] + 1}; fill them or leave these rows out.")  # fmt: skip
    return arrays


def own_columns(run: Any) -> None:
    """Read every field of a frozen dataclass as a column of `read_columns`."""
    for name, values in zip(list(vars(run)), read_columns(**vars(run)), strict=True):
        object.__setattr__(run, name, values)


def block_means(values: NDArray[Any], size: int) -> NDArray[Any]:
    """Return the means of every `size` values in a row along the last axis; an incomplete block at the end is left out."""
    count = values.shape[-1] // size
    return np.asarray(values[..., : count * size].reshape(*values.shape[:-1], count, size).mean(axis=-1))


def robust_spread(values: NDArray[np.float64]) -> float:
    """Return 1.4826 median |x|, the standard deviation of normal values about 0 whatever a few others are."""
    return float(1.4826 * np.median(np.abs(values)))


def check_time(time: NDArray[np.float64]) -> None:
    """Raise unless `time` (s) has two rows or more, all finite, and increases strictly."""
    if len(time) < 2:
        raise CompensationError(f"'time' has {len(time)} {'row' if len(time) == 1 else 'rows'}; two or more are needed.")  # fmt: skip
    if not np.all(np.isfinite(time)):
        row = int(np.flatnonzero(~np.isfinite(time))[0])
        raise CompensationError(f"'time' is missing or infinite in row {row + 1}; every row needs its time.")
    back = np.flatnonzero(np.diff(time) <= 0)
    if len(back):
        raise CompensationError(f"'time' does not increase from row {back[0] + 1} to row {back[0] + 2}; sort it.")


def is_regular(time: NDArray[np.float64]) -> bool:
    """Tell whether `time` (s) lies on an even grid, to a thousandth of its step."""
    grid = np.linspace(time[0], time[-1], len(time))
    return bool(np.max(np.abs(time - grid)) <= REGULAR * (grid[1] - grid[0]))


def require_regular(time: NDArray[np.float64], purpose: str) -> float:
    """Return the even step of `time` (s), or raise naming the row where it is not even and the `purpose`."""
    check_time(time)
    step = float((time[-1] - time[0]) / (len(time) - 1))
    if not is_regular(time):
        steps = np.diff(time)
        row = int(np.argmax(np.abs(steps - np.median(steps))))
        raise CompensationError(
            f"{purpose} needs even sampling, but the step after row {row + 1} is {steps[row]:g} s where {np.median(steps):g} s is usual; resample the record or cut it at its gaps."
        )
    return step
