"""Measured drives of a record on an even grid: its unbroken stretches, the temperature between rows, commands held."""

import numpy as np
from numpy.typing import NDArray

from shell.constants import zero_Celsius
from studies.effects.states import FloatArray, States

LONGEST_GAP = 900.0
"""Seconds without a temperature after which the thermal state is unknown, whatever it did before."""
UNKNOWN_HEAT = 50.0
"""Area between temperature and line, K s, that a gap may hide: 50 mK of the resonator at a time constant of 1000 s."""


def stretches(table: dict[str, FloatArray]) -> list[tuple[int, int]]:
    """Split where the temperature is unknown for long: the thermal state after the gap is anyone's guess."""
    time = table["time_s"]
    known = np.flatnonzero(np.isfinite(table["temperature"]))
    if known.size < 2:
        return []
    gaps = np.diff(time[known])
    usual = 20.0 * float(np.median(gaps))
    breaks: NDArray[np.intp] = np.array(
        [
            place
            for place in np.flatnonzero(gaps > min(usual, LONGEST_GAP))
            if gaps[place] > max(usual, LONGEST_GAP)
            or _unknown_heat(time[known], table["temperature"][known], int(place)) > UNKNOWN_HEAT
        ],
        dtype=np.intp,
    )
    begins = [known[0], *known[breaks + 1]]
    ends = [*(known[breaks] + 1), known[-1] + 1]
    return list(zip(map(int, begins), map(int, ends), strict=True))


def _unknown_heat(time: FloatArray, temperature: FloatArray, place: int) -> float:
    """Return how far the temperature may have strayed from a line during a gap, K s: slope changes times gap² / 12."""
    gap = time[place + 1] - time[place]
    chord = (temperature[place + 1] - temperature[place]) / gap
    strays = []
    for side in (slice(0, place + 1), slice(place + 1, None)):
        near = np.abs(time[side] - time[place]) < 2.0 * gap + 60.0
        t, values = time[side][near], temperature[side][near]
        strays.append(abs(np.polyfit(t, values, 1)[0] - chord) if t.size > 3 else 0.0)
    return float(max(strays) * gap**2 / 12.0)


def _between(grid: FloatArray, time: FloatArray, values: FloatArray) -> FloatArray:
    """Interpolate linearly; after the last row go on as between the last two."""
    out = np.interp(grid, time, values)
    if time.size > 1:
        late = (grid > time[-1]) & (grid < time[-1] + 2.0 * (time[-1] - time[-2]))
        out[late] += (values[-1] - values[-2]) / (time[-1] - time[-2]) * (grid[late] - time[-1])
    return np.asarray(out)


def _means_between(grid: FloatArray, time: FloatArray, values: FloatArray) -> FloatArray:
    """Means over the steps of a grid of the line through the rows."""
    half = 0.5 * (grid[1] - grid[0])
    edges = np.append(grid - half, grid[-1] + half)
    every = np.union1d(time, edges)
    line = _between(every, time, values)
    area = np.append(0.0, np.cumsum(0.5 * (line[1:] + line[:-1]) * np.diff(every)))
    return np.asarray(np.diff(area[np.searchsorted(every, edges)]) / (2.0 * half))


def _unbent(means: FloatArray) -> FloatArray:
    """Return what gives the same heat and the same moments of it: a mean, and the line to the next, flatten a bend by 1/8 of it."""
    return np.asarray(np.concatenate([means[:1], means[1:-1] - np.diff(means, 2) / 8.0, means[-1:]]))


def drives(
    run: int, record: int, grid: FloatArray, rows: int, offset: float, reference: float, table: dict[str, FloatArray]
) -> States:
    """Drives on the fine grid of so many `rows` a step: the temperature between its rows, commands held until they change."""
    time = table["time_s"]
    known = np.isfinite(table["temperature"])
    if known.sum() > 1.5 * grid.size:  # finer than the grid: the mean over a step, so that no heat is lost at a bend
        housing = _unbent(_means_between(grid, time[known], table["temperature"][known])) + zero_Celsius
    else:
        housing = _between(grid, time[known], table["temperature"][known]) + zero_Celsius

    def command(name: str) -> FloatArray | None:
        if name not in table or not (known := np.isfinite(table[name])).any():
            return None
        middle = 0.5 * (time[known][1:] + time[known][:-1])
        return np.asarray(table[name][known][np.searchsorted(middle, grid)])

    amplitude, voltage, angle = map(command, ("drive_amplitude_V", "electrode_bias_V", "pattern_angle_deg"))
    return States(
        run=run,
        time=grid,
        campaign_time=grid + offset,
        housing=housing,
        resonator=housing,
        tau=1.0,
        reference=reference,
        amplitude_squared=None if amplitude is None else amplitude**2,
        voltage_squared=None if voltage is None else voltage**2,
        quadrature=command("quadrature_V"),
        pattern_angle=None if angle is None else np.radians(angle),
        rows=rows,
        record=record,
    )
