"""Which record serves which test: by what it shows, or by a comment line such as '# test: warm-up'."""

from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np

from studies.errors import InputError, nearest
from studies.record import Record
from studies.record.rest import LARGEST_REST, TEMPERATURES

Test = Literal["warm-up", "temperature", "scale-factor", "drift", "run-down", "transfer", "angle-storage"]
SPAN = 5.0  # span of temperature (K) from which a run at rest is one over temperature
HOUR = 3600.0
MOVING = 0.5  # part of the rows from which on an applied rate that changes is swept or shaken, not held at levels


def test_of(record: Record, output: str) -> Test | None:
    """Return the test that a record serves; None when it serves none."""
    for comment in record.comments:
        key, colon, name = (part.strip() for part in comment.partition(":"))
        if colon and key == "test":
            if name not in get_args(Test):
                raise InputError(f"{record.path}: '# {comment}' is not a known test{nearest(name, get_args(Test))}")
            return name  # type: ignore[return-value]
    if "vibration_amplitude_V" in record:
        return "run-down"
    turning = "rate_deg_per_s" in record and bool(np.any(np.abs(record["rate_deg_per_s"]) > LARGEST_REST))
    if turning:
        if "measured_rate_deg_per_s" not in record:
            return None
        moving = np.diff(record["rate_deg_per_s"]) != 0
        return "transfer" if np.mean(moving) > MOVING else "scale-factor"
    column = temperature_column(record)
    if column is not None and np.nanmax(record[column]) - np.nanmin(record[column]) >= SPAN:
        return "temperature"
    if output in record and length_of(record) >= HOUR:
        return "drift"
    return None


def length_of(record: Record) -> float:
    """Return the time (s) that the rows of a record stand for, each for a step."""
    return float(np.ptp(record["time_s"]) + np.median(np.diff(record["time_s"])))


def temperature_column(record: Record) -> str | None:
    """Return the temperature that a record is judged by: the housing's, the resonator's or the chamber's."""
    return next((name for name in TEMPERATURES if record.has_values(name)), None)


def sort_records(records: Sequence[Record], output: str) -> tuple[dict[Test, list[Record]], list[Record]]:
    """Return the records by test, and those that serve none."""
    found: dict[Test, list[Record]] = {}
    left: list[Record] = []
    for record in records:
        test = test_of(record, output)
        (left if test is None else found.setdefault(test, [])).append(record)
    return found, left
