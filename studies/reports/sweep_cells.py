"""Cells of a study's tables: numbers as text, and the columns that a page is about."""

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from studies.sweeps.quantity import Column
    from studies.sweeps.results import Results


def main_columns(results: "Results") -> "list[Column]":
    """Return the first column of every quantity: those that are drawn."""
    return [asked.columns[0] for asked in results.study.asked]


def number(value: Any) -> str:
    """Return a cell: eight digits of a number, text as it is, nothing for nothing."""
    if isinstance(value, str):
        return value
    return "" if value is None or np.isnan(value) else f"{value:.8g}"


def short(value: float | None) -> str:
    """Return six digits of a number, nothing for nothing."""
    return "" if value is None or np.isnan(value) else f"{value:.6g}"


def percent(share: float | None) -> str:
    """Return a share in per cent, nothing for nothing."""
    return "" if share is None else f"{100 * share:.2f} %"
