"""What a reference clock says: it settles what a record of the frequency alone cannot, a drifting clock or an ageing gyro."""

from collections.abc import Sequence

import numpy as np

from studies.inference.records import REFERENCE
from studies.record import Record, place_in_time

CLEAR = 4.0
"""Standard deviations at which a drift of the clock is believed."""
INDEPENDENT = 10.0
"""Neighbouring rows share slow noise: one row in so many counts as independent."""


def drift_of(records: Sequence[Record]) -> tuple[float, float] | None:
    """Return the drift of the gyro's clock against the reference, Hz a day, and its standard deviation; None where a record has none."""
    starts, _ = place_in_time(records)
    days, errors = [], []
    for record, start in zip(records, starts, strict=True):
        if REFERENCE not in record or "frequency_Hz" not in record:
            return None
        days.append((record["time_s"] - record["time_s"][0] + start) / 86400.0)
        errors.append(record["frequency_Hz"] - record[REFERENCE])
    t, error = np.concatenate(days), np.concatenate(errors)
    known = np.isfinite(error)
    if known.sum() < INDEPENDENT:
        return None
    slope, level = np.polyfit(t[known], error[known], 1)
    rest = error[known] - slope * t[known] - level
    spread = np.sqrt(INDEPENDENT * np.mean(rest**2) / known.sum()) / max(float(np.std(t[known])), 1e-300)
    return float(slope), float(spread)


def settle(names: Sequence[str], judge: str, equals: Sequence[str], drifts: bool | None) -> list[str]:
    """Return the names that could stand for one cause without those that the reference clock (`judge`, its `equals`) excludes."""
    pair = {judge, *equals}
    if drifts is None or not pair & set(names):
        return list(names)
    left = [name for name in names if name not in pair or (name == judge) == drifts]
    return left or list(names)
