"""Rows that no slow response and no noise of the usual size can have."""

import numpy as np

from studies.effects.states import FloatArray

WINDOW, LIMIT = 11, 6.0
"""Rows of the running median, and robust standard deviations (1.4826 times the median absolute deviation) of the limit."""
BEFORE = np.array([-0.4, -0.1, 0.2, 0.5, 0.8])
"""Weights of five rows whose least-squares line foretells the next one."""
ALONE = 4.0
"""How much further a row must stand out than the rows around it."""


def find_outliers(values: FloatArray) -> np.ndarray:
    """Return a mask of the rows that are outliers.

    A row is one when it deviates by more than six robust standard deviations from the running median of 11 rows, both as
    it is, so that the edge of a step is none, and beside the trend, so that the scale of the noise is right where the
    response is steep; or, for steep responses, to one side of the lines through the five rows before it and the five
    after it and of the mean of its neighbours, and four times as far as the rows around it.
    """
    present = np.isfinite(values)
    mask = np.zeros(values.shape, dtype=bool)
    kept = values[present]
    if kept.size < 3 * WINDOW:
        return mask
    bends = np.abs(np.diff(kept, 2))
    resolution = float(bends[bends > 0].min()) if (bends > 0).any() else 0.0
    mask[present] = _off_median(kept, resolution) | _off_lines(kept, resolution)
    return mask


def _limit(deviations: FloatArray, resolution: float) -> float:
    scale = 1.4826 * float(np.median(np.abs(deviations)))
    return max(LIMIT * (scale if scale else float(np.std(deviations))), 1.5 * resolution)


def _off_median(kept: FloatArray, resolution: float) -> np.ndarray:
    from scipy.ndimage import median_filter

    blocks = kept[: kept.size // WINDOW * WINDOW].reshape(-1, WINDOW)
    centres = (np.arange(len(blocks)) + 0.5) * WINDOW - 0.5
    trend = np.interp(np.arange(kept.size), centres, np.median(blocks, axis=1))
    level = kept - trend
    beside = level - median_filter(level, WINDOW, mode="nearest")
    plain = kept - median_filter(kept, WINDOW, mode="nearest")
    limit = _limit(beside, resolution)
    bend = np.abs(kept - 0.5 * (np.roll(kept, 1) + np.roll(kept, -1)))
    outlying = (np.abs(beside) > limit) & (np.abs(plain) > limit) & (bend > 0.75 * limit)
    half = WINDOW // 2
    outlying[:half] = _off_line(kept[:WINDOW], limit)[:half]
    outlying[-half:] = _off_line(kept[-WINDOW:], limit)[-half:]
    return outlying


def _off_line(values: FloatArray, limit: float) -> np.ndarray:
    """Rows at an end, where a running median is the end itself: off a robust line, alone among their neighbours."""
    from scipy.stats import theilslopes

    slope, level, _, _ = theilslopes(values)
    rest = np.abs(values - level - slope * np.arange(values.size))
    beside = [np.median(np.delete(rest[max(k - 2, 0) : k + 3], min(k, 2))) for k in range(rest.size)]
    return np.asarray(rest > np.maximum(limit, ALONE * np.array(beside)))


def _off_lines(kept: FloatArray, resolution: float) -> np.ndarray:
    """Rows off the lines before and after them: a median finds nothing where rows are further apart than the outlier."""
    reach = BEFORE.size
    windows = np.lib.stride_tricks.sliding_window_view(kept, 2 * reach + 1)
    middle = windows[:, reach]
    deviations = (
        middle - windows[:, :reach] @ BEFORE,
        middle - windows[:, :reach:-1] @ BEFORE,
        middle - 0.5 * (windows[:, reach - 1] + windows[:, reach + 1]),
    )
    out = np.zeros(kept.size, dtype=bool)
    one_side = np.abs(np.sum(np.sign(deviations), axis=0)) == len(deviations)  # at a kink the lines lie on both sides
    inside = one_side & np.all([np.abs(d) > _limit(d, resolution) for d in deviations], axis=0)
    out[reach:-reach] = inside & _alone(deviations[-1])
    return out


def _alone(deviations: FloatArray) -> np.ndarray:
    """Which rows stand out `ALONE` times as far as the three rows on each side."""
    size = np.pad(np.abs(deviations), 3, mode="edge")
    around = np.stack([size[k : k + deviations.size] for k in (0, 1, 2, 4, 5, 6)])
    return np.asarray(size[3:-3] > ALONE * np.median(around, axis=0))
