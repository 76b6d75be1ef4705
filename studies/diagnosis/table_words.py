"""What a steady-state table says in words: its own shape, how it was approached, what to measure next."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import scipy

from compensation.arrays import Array
from compensation.decimation import average_groups
from shell.constants import zero_Celsius
from studies.calibration.observed import SettledTable
from studies.diagnosis.table_forms import Form, each_once
from studies.diagnosis.verdict import Shift
from studies.instrument.display import display_name

if TYPE_CHECKING:
    from studies.calibration.scatter import Scatter
    from studies.calibration.settled import SettledComparison

DOUBTFUL = 0.05
"""p of the fourth order below which a cubic is said not to be sufficient."""
TURN = 0.1
"""Part of the covered range that a table must go back for its order to show a direction."""
TOUCHED = 0.05
"""Prior standard deviations from which on it is said that the data move a value."""
TIE = 0.1
"""Evidence within which two forms explain a table equally."""
MORE = "measure at five or more, from below and from above."
SOAK = "the soak time shows whether the resonator had settled, the thermometer distinguishes a scale error from a curvature of f"
ONE_WAY = (
    "listed in one direction of temperature: they cannot distinguish hysteresis from curvature or show ageing or a linear scale"
    " error, and incomplete settling would bias the slope. The file does not say how each temperature was approached."
)
BOTH_WAYS = "rising and falling in temperature: in the order of the file they would show hysteresis, but not ageing or a linear scale error."


def law_sentences(table: SettledTable, law: float, ratio: float, base: tuple[float, float]) -> list[str]:
    """Return what the default law leaves (Hz, rms), its curvature and a free one."""
    slope = abs(float(np.polyfit(table.temperature, table.frequency, 1)[0]))
    return [
        f"Residual with the curvature of the law (fused silica, the default law): {law:.3f} Hz rms, "
        f"equivalent to a temperature error of {law / max(slope, 1e-12):.2f} K.",
        f"The measured curvature is {ratio:.1f} times the law's. With a free curvature the residual is {base[0]:.3f} Hz rms "
        f"({base[1]:.3f} Hz leave-one-out); rounding alone would give {table.rounding:.4f} Hz.",
    ]


def card_sentences(
    compared: "SettledComparison", shifts: Sequence[Shift], table: SettledTable, law: float, base: tuple[float, float]
) -> list[str]:
    """Return level and slope beside the card's, what the calibration moved, and what the card leaves before and after it (Hz, rms)."""
    far = [
        f"{display_name(one.parameter)} ({one.shift_sd:+.2f} standard deviations)"
        for one in shifts[:2]
        if abs(one.shift_sd) > TOUCHED
    ]
    return [
        *compared.sentences,
        *([f"Largest changes in the calibration: {', '.join(far)}."] if far else []),
        f"Residual with the card as given, rms over the rows: {law:.3f} Hz; calibrated: {base[0]:.3f} Hz;"
        f" rounding alone would give {table.rounding:.4f} Hz.",
    ]


def drift_sentence(left: float, white: float) -> str:
    """Say that rows (rms left, Hz) wander more than their neighbours' white noise."""
    return (
        f"The rows drift: the residual is {left:.3g} Hz rms, but neighbouring rows agree to {white:.2g} Hz. One table"
        " cannot distinguish a drift between the rows from a slow effect of temperature."
    )


def step_sentence(left: float, near: float, beside: str = "") -> str:
    """Say that what is left (rms, Hz), beside a form or none, is far above what readings at neighbouring temperatures leave."""
    return (
        f"The residual{f' beside {beside}' if beside else ''} of {left:.3g} Hz rms is not noise: readings at neighbouring temperatures agree to {near:.2g} Hz. Rows of two"
        " gyros or of two sessions look like this, and so does a narrow effect of temperature."
    )


def short_sentence(forms: Sequence[Form], left: float, needed: float) -> str:
    """Say how far the nearest form is from being a cause."""
    return (
        f"The remaining residual of {left:.3g} Hz rms is treated as noise: the evidence of {_nearest(forms)} is"
        f" {forms[0].evidence:.1f}; a cause needs {needed:.0f}."
    )


def unproven_sentence(forms: Sequence[Form], left: float, table: SettledTable, needed: float) -> str:
    """Say that something is missing, and that what comes nearest is not proven."""
    return (
        f"The remaining residual of {left:.3g} Hz rms is {left / table.rounding:.0f} times what rounding leaves, so something is missing."
        f" What comes nearest, {_nearest(forms)}, has an evidence of {forms[0].evidence:.1f}: less than the {needed:.0f} that proves a"
        " cause, so the set of causes is given with its probability and none of them is proven."
    )


def _nearest(forms: Sequence[Form]) -> str:
    return " and ".join(one.words for one in each_once(forms, placed=True) if one.evidence > forms[0].evidence - TIE)


def next_table(table: SettledTable, loose: "Scatter | None" = None) -> str:
    """Return what to measure next, which is not what the table has already; rows that follow no law first."""
    if loose is not None:
        again = "two of the temperatures again: readings that repeat are right, and of this gyro"
        return (
            f"Measure {again if loose.row is None else f'row {loose.row + 1} again, and close to it on either side'}."
        )
    if _turns(table.temperature):
        return f"Repeat the table with two soak times and a second thermometer: {SOAK}."
    return (
        "Approach the same temperatures from above and from below, with two soak times and a second thermometer: the direction "
        f"shows hysteresis and stress, {SOAK}."
    )


def table_sentences(table: SettledTable) -> list[str]:
    """Return what readings show by themselves: their local slope, whether a cubic is enough, from where they were approached."""
    out = []
    T, place = np.unique(table.temperature - zero_Celsius, return_inverse=True)
    f, rows = average_groups(table.frequency, place), len(table.frequency)
    if 5 <= T.size <= 30:
        local = np.diff(f) / np.diff(T) / (0.5 * (f[1:] + f[:-1])) * 1e6
        lowest = int(np.argmin(local))
        if 0 < lowest < local.size - 1:
            out.append(
                f"The local slope falls to {local[lowest]:.1f} ppm/°C near {0.5 * (T[lowest] + T[lowest + 1]):.0f} °C and rises"
                f" again to {local[-1]:.1f} ppm/°C."
            )
    if T.size >= 7:
        cubic, quartic, ratio, chance = compare_cubic(table)
        if cubic < rows * table.rounding**2:
            out.append("A cubic fits within the rounding of the readings; a cubic is sufficient.")
        else:
            out.append(
                f"Sum of squares left by a cubic and by a quartic: {cubic:.3g} and {quartic:.3g} Hz²; F(1, {rows - 5}) = {ratio:.3g},"
                f" p = {chance:.2g}: a cubic is {'not ' if chance < DOUBTFUL else ''}sufficient."
            )
    return [*out, f"{rows} rows, {BOTH_WAYS if _turns(table.temperature) else ONE_WAY}"]


def compare_cubic(table: SettledTable) -> tuple[float, float, float, float]:
    """Return the sums of squares (Hz²) of a cubic and a quartic through seven readings or more, F of the fourth order and its p."""
    x, f = table.middled, table.frequency
    cubic, quartic = (float(np.sum((f - np.polyval(np.polyfit(x, f, p), x)) ** 2)) for p in (3, 4))
    ratio = max((cubic - quartic) / max(quartic / (x.size - 5), table.rounding**2), 0.0)
    return cubic, quartic, ratio, float(scipy.special.fdtrc(1, x.size - 5, ratio))


def bends_beyond_a_cubic(table: SettledTable) -> bool:
    """Whether the readings ask for a fourth order beyond their rounding."""
    if np.unique(table.temperature).size < 7:
        return False
    cubic, _, _, chance = compare_cubic(table)
    return cubic >= len(table.frequency) * table.rounding**2 and chance < DOUBTFUL


def _turns(T: Array) -> bool:
    """Whether the rows go up and down again by more than a tenth of their range."""
    wide = TURN * float(np.ptp(T))
    back_down = float((np.maximum.accumulate(T) - T).max())
    back_up = float((T - np.minimum.accumulate(T)).max())
    return min(back_down, back_up) > wide
