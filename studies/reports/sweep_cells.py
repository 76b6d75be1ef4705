"""Cells of a study's tables: numbers as text, and the columns that a page is about."""

from typing import Any

import numpy as np

from studies.reports.digits import to_numerical_error
from studies.sweeps.quantity import Column
from studies.sweeps.results import Results


def main_columns(results: Results) -> list[Column]:
    """Return the first column of every quantity: those that are drawn."""
    return [asked.columns[0] for asked in results.study.asked]


def number(value: Any) -> str:
    """Return a cell: eight digits of a number, text as it is, nothing for nothing and for no end."""
    if isinstance(value, str):
        return value
    return "" if value is None or not np.isfinite(value) else f"{value:.8g}"


def to_error(value: float | None, error: float | None) -> str:
    """Return a number to the second digit of its numerical error."""
    if value is None or error is None or not np.isfinite(value) or not 0 < error < np.inf:
        return number(value)
    return to_numerical_error(value, error) if abs(value) < 1e9 else number(value)


def spread(deviation: float | None, mean: float | None) -> str:
    """Return three digits of a standard deviation, 0 for what rounding leaves."""
    if deviation is None or np.isnan(deviation):
        return ""
    return f"{deviation:.3g}" if mean is None or deviation > 1e-12 * abs(mean) else "0"


def within(value: float | None, deviation: float | None) -> str:
    """Return a number to a hundredth of the standard deviation about it, six digits of it without one, nothing for nothing."""
    if value is None or np.isnan(value):
        return ""
    return to_error(value, deviation / 3) if deviation and np.isfinite(deviation) else f"{value:.6g}"


def percent(share: float | None) -> str:
    """Return a share in per cent, nothing for nothing."""
    return "" if share is None else f"{100 * share:.2f} %"
