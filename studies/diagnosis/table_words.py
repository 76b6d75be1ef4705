"""What a steady-state table says in words: its own shape, how it was approached, what to measure next."""

from typing import TYPE_CHECKING

import numpy as np
import scipy

from compensation.decimation import average_groups
from studies.effects.states import FloatArray

if TYPE_CHECKING:
    from studies.calibration.scatter import Scatter

DOUBTFUL = 0.05
"""p of the fourth order below which a cubic is said not to be sufficient."""
TURN = 0.1
"""Part of the covered range that a table must go back for its order to show a direction."""
MORE = "measure at five or more, from below and from above."
SOAK = "the soak time shows whether the resonator had settled, the thermometer distinguishes a scale error from a curvature of f"


def next_table(T: FloatArray, loose: "Scatter | None" = None) -> str:
    """Return what to measure next, which is not what the table has already; rows that follow no law first."""
    if loose is not None:
        again = "two of the temperatures again: readings that repeat are right, and of this gyro"
        return (
            f"Measure {again if loose.row is None else f'row {loose.row + 1} again, and close to it on either side'}."
        )
    if _turns(T):
        return f"Repeat the table with two soak times and a second thermometer: {SOAK}."
    return (
        "Approach the same temperatures from above and from below, with two soak times and a second thermometer: the direction "
        f"shows hysteresis and stress, {SOAK}."
    )


def table_sentences(T: FloatArray, f: FloatArray, rounding: float) -> list[str]:
    """Return what readings (°C, Hz) show by themselves: their local slope, whether a cubic is enough, from where they were approached."""
    out = []
    order = np.argsort(T, kind="stable")
    t, g = _merged(T[order], f[order])
    if t.size >= 5:
        local = np.diff(g) / np.diff(t) / (0.5 * (g[1:] + g[:-1])) * 1e6
        lowest = int(np.argmin(local))
        if t.size <= 30 and 0 < lowest < local.size - 1:
            middle = 0.5 * (t[lowest] + t[lowest + 1])
            out.append(
                f"The local slope falls to {local[lowest]:.1f} ppm/°C near {middle:.0f} °C and rises again to {local[-1]:.1f} ppm/°C."
            )
    if 7 <= T.size and t.size >= 7:
        cubic, quartic, ratio, chance = compare_cubic(T, f, rounding)
        said = "a cubic is not sufficient" if chance < DOUBTFUL else "a cubic is sufficient"
        if cubic < T.size * rounding**2:
            out.append("A cubic fits within the rounding of the readings; a cubic is sufficient.")
        else:
            out.append(
                f"Sum of squares left by a cubic and by a quartic: {cubic:.3g} and {quartic:.3g} Hz²; F(1, {T.size - 5}) = {ratio:.3g},"
                f" p = {chance:.2g}: {said}."
            )
    both = _turns(T)
    out.append(
        f"{T.size} rows, "
        + (
            "rising and falling in temperature: in the order of the file they would show hysteresis, but not ageing or a linear scale error."
            if both
            else "listed in one direction of temperature: they cannot distinguish hysteresis from curvature or show ageing or a linear scale"
            " error, and incomplete settling would bias the slope. The file does not say how each temperature was approached."
        )
    )
    return out


def compare_cubic(T: FloatArray, f: FloatArray, rounding: float) -> tuple[float, float, float, float]:
    """Return the sums of squares (Hz²) of a cubic and a quartic through seven readings or more, F of the fourth order and its p."""
    cubic, quartic = (float(np.sum((f - np.polyval(np.polyfit(T, f, p), T)) ** 2)) for p in (3, 4))
    freedom = T.size - 5
    ratio = max((cubic - quartic) / max(quartic / freedom, rounding**2), 0.0)
    return cubic, quartic, ratio, float(scipy.special.fdtrc(1, freedom, ratio))


def bends_beyond_a_cubic(T: FloatArray, f: FloatArray, rounding: float) -> bool:
    """Whether the readings ask for a fourth order beyond their rounding."""
    if np.unique(T).size < 7:
        return False
    cubic, _, _, chance = compare_cubic(T, f, rounding)
    return cubic >= T.size * rounding**2 and chance < DOUBTFUL


def _merged(T: FloatArray, f: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Average readings at one temperature."""
    distinct, place = np.unique(T, return_inverse=True)
    return distinct, average_groups(f, place)


def _turns(T: FloatArray) -> bool:
    """Whether the rows go up and down again by more than a tenth of their range."""
    wide = TURN * float(np.ptp(T))
    back_down = float((np.maximum.accumulate(T) - T).max())
    back_up = float((T - np.minimum.accumulate(T)).max())
    return min(back_down, back_up) > wide
