"""Rows of a steady-state table that follow no law: mixed up, of two gyros, or one of them mistyped.

Readings less the card's law, with level, slope and curvature free: the rms r of what is left is set against what temperature
changes over the range, and each row against the others. Without row k, of leverage h, Σr² falls by r_k² / (1 − h), and the row lies
t_k = r_k / s √(1 − h) from where the others, which then leave s, expect it (Student's t; any of n rows with n times its probability).
"""

from dataclasses import dataclass

import numpy as np
import scipy

from compensation.arrays import Array
from shell.constants import zero_Celsius
from studies.calibration.observed import LEAST_SCATTER, THERMOMETER, SettledTable

PART = 0.01  # of what temperature changes: measured tables leave a quarter to a half of it
ROUNDINGS = 10.0
SURE = 1e-4  # probability below which a row lies as far from the others by chance
CLEARLY = 2.0  # times less that is left without one row than without any other


@dataclass(frozen=True)
class Scatter:
    """Rows that scatter by more than a thermometer and the law's shape explain (Hz)."""

    path: str
    rms: float
    limit: float
    swing: float
    row: int | None  # that alone makes it, with its reading
    reading: str
    without: float

    @property
    def sentence(self) -> str:
        """The scatter, and what makes it."""
        if self.row is not None:
            why = f"Row {self.row + 1} ({self.reading}) alone makes it: without it {self.without:.2g} Hz remain. Is it mistyped?"
        else:
            why = "No single row makes it. Are the rows mixed up, or of two gyros? Until then level and slope say little of the gyro."
        return (
            f"The rows of {self.path} scatter by {self.rms:.3g} Hz (rms) about the law with level, slope and curvature free:"
            f" {100 * self.rms / max(self.swing, 1e-9):.3g} % of the {self.swing:.3g} Hz that temperature changes over their range. {why}"
        )


def largest_scatter(table: SettledTable, predicted: Array) -> float:
    """Return what rows of a table may scatter, Hz: part of what temperature changes, and the errors of their readings."""
    swing, width = float(np.ptp(predicted)), max(float(np.ptp(table.temperature)), 1e-9)
    least = max(LEAST_SCATTER * float(np.median(table.frequency)), ROUNDINGS * table.rounding)
    return max(PART * swing, THERMOMETER * swing / width, least)


def find_scatter(table: SettledTable, predicted: Array) -> Scatter | None:
    """Return the scatter of rows about a law (Hz, of the rows); None where there is none to speak of or too few rows show it."""
    T, limit = table.temperature, largest_scatter(table, predicted)
    free = len(T) - 3
    if free < 2 or len(np.unique(T)) < 3:
        return None
    rest, leverage = table.beside_parabola(table.frequency - predicted)
    rms = float(np.sqrt(rest @ rest / free))
    fall = rest**2 / np.maximum(1.0 - leverage, 1e-9)
    without = np.sqrt(np.maximum(rest @ rest - fall, 0.0) / (free - 1))
    k = int(np.argmin(without))
    alone = without[k] < limit and without[k] * CLEARLY < np.delete(without, k).min()
    lone = fall[k] ** 0.5 / max(float(without[k]), table.rounding / ROUNDINGS)
    chance = 2.0 * len(T) * float(scipy.special.stdtr(free - 1, -lone))
    odd = chance < SURE and abs(rest[k]) > ROUNDINGS * table.rounding
    if rms <= limit and not odd:
        return None
    reading = f"{T[k] - zero_Celsius:.4g} °C, {table.frequency[k]:.2f} Hz"
    row = k if odd or alone else None
    return Scatter(table.path, rms, limit, float(np.ptp(predicted)), row, reading, float(without[k]))
