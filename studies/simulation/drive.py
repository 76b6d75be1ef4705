"""What a run is driven with: its rows, the boundary that is imposed, its commands, and how it begins."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from compensation.applied_rate import AppliedRate
from compensation.arrays import Array
from compensation.decimation import bend_of_means
from shell.constants import zero_Celsius
from studies.errors import InputError
from studies.record import Record
from studies.record.rest import check_temperatures
from studies.simulation.heat_path import SENSOR
from studies.simulation.holes import bridge_holes
from thermal.profile import Profile

Boundary = Literal["chamber", "housing"]
COLUMN: dict[Boundary, str] = {"chamber": "chamber_temperature_degC", "housing": "housing_temperature_degC"}
COMMANDS = {
    # field of the effects' states: (column, factor, power)
    "amplitude_squared": ("drive_amplitude_V", 1.0, 2),
    "voltage_squared": ("electrode_bias_V", 1.0, 2),
    "quadrature": ("quadrature_V", 1.0, 1),
    "pattern_angle": ("pattern_angle_deg", np.pi / 180.0, 1),
}
RATE = "rate_deg_per_s"
COMMAND_COLUMNS = (*(column for column, _, _ in COMMANDS.values()), RATE)
"""Columns beside the chamber's that a profile may have."""
LUMPS = ("housing", "base", "stem", "resonator")
"""Parts of the heat path whose temperature at the start may depart from the settled one."""
MOST_BOUNDARY_ROWS, IN_ROW = 20_000, 8  # of a run, and of a housing in each row that is predicted: it has no corners
MOST_ROWS = 40_000_000
LEAST_JUMP = 0.5  # K from one row to the next, and
STEEP = 20.0  # times the usual change near it: a set point that jumps, rather than a ramp


@dataclass(frozen=True)
class Drive:
    """Everything that a prediction is told of one run."""

    time: Array  # array (N,), s: Rows that are wanted, increasing, any sampling
    # "chamber" or "housing": What is imposed: the chamber, or the housing as its sensor reads it, lag included.
    boundary: Boundary
    profile: Profile  # temperature of the boundary over all the rows
    # How far (K) the "housing", the "base", the "stem" and the "resonator" depart at the start from having settled at
    # the first value, and the reading of the housing's "sensor" from the housing.
    initial: Mapping[str, float] = field(default_factory=dict)
    # Amplitude and voltage squared (V²), quadrature (V), pattern angle (rad) at the rows; what is absent does not move.
    commands: Mapping[str, Array] = field(default_factory=dict)
    shift: float = 0.0  # how much later than its profile says the boundary changes: the clock of a chamber
    start: float = 0.0  # since the start of the first run of the campaign
    moment: float | None = None  # s, POSIX: of the first row, where the record says it
    rate: AppliedRate | None = None  # that is applied, rad/s
    # whether a row has the mean of the rate, and of what a free wave shows, to the next; else what is at its moment
    means: bool = False
    wander: Array | float = 0.0  # array (N,), rad/s: noise of the rate, means to the next row, that turns a free wave
    source: str = ""  # file that the commands and the rate are from
    # How much later (s) single jumps of the profile are, in their order from 0: between which two rows they were is all
    # that is known.
    jumps: Mapping[int, float] = field(default_factory=dict)
    # How far (K) the profile departs from the straight line midway between the row before and row k, by k: what a
    # measured housing did between two rows when its chamber jumped, or in a hole of its record.
    kinks: Mapping[int, float] = field(default_factory=dict)
    holes: Mapping[int, float] = field(
        default_factory=dict
    )  # how far it may (sd), in holes of the record, by the first row in each

    def __post_init__(self) -> None:
        for name in self.initial:
            if name not in self.departing:
                raise InputError(f"a drive by the {self.boundary} has no '{name}'; it has {', '.join(self.departing)}.")

    @property
    def applied(self) -> Array:
        """Return the rate of the rows, rad/s."""
        if self.rate is None:
            return np.zeros(len(self.time))
        return self.rate.means(self.time) if self.means else self.rate.at(self.time)

    @property
    def lumps(self) -> tuple[str, ...]:
        """Parts whose initial temperature is free."""
        return LUMPS if self.boundary == "chamber" else LUMPS[1:]

    @property
    def departing(self) -> tuple[str, ...]:
        """All that is free at the start: the lumps, and the sensor of a housing that is predicted."""
        return (*self.lumps, SENSOR) if self.boundary == "chamber" else self.lumps

    def kinked(self, profile: Profile) -> Profile:
        """Profile of the same rows with its kinks."""
        if not self.kinks:
            return profile
        after = np.array(sorted(self.kinks))
        t, T = profile.time, profile.value
        middle = (T[after - 1] + T[after]) / 2 + [self.kinks[int(k)] for k in after]
        return Profile(np.insert(t, after, (t[after - 1] + t[after]) / 2), np.insert(T, after, middle))

    def kink_shape(self, k: int) -> Profile:
        """Change of the profile for 1 K of the kink before row k."""
        t = self.profile.time
        times = np.unique([t[0], t[k - 1], (t[k - 1] + t[k]) / 2, t[k], t[-1]])
        return Profile(times, (times == (t[k - 1] + t[k]) / 2).astype(float))

    @property
    def imposed(self) -> Profile:
        """Profile of the boundary with its shifts, over all the rows."""
        if self.shift == 0 and not any(self.jumps.values()):
            return self.profile
        t, T = self.profile.time + self.shift, self.profile.value
        for k, later in self.jumps.items():
            t, T = _move_jump(t, T, k, later)
        if t[0] > self.time[0]:
            t, T = np.insert(t, 0, self.time[0]), np.insert(T, 0, T[0])
        if t[-1] < self.time[-1]:
            t, T = np.append(t, self.time[-1]), np.append(T, T[-1])
        return Profile(t, T)


def _move_jump(t: Array, T: Array, k: int, later: float) -> tuple[Array, Array]:
    """Rows with the jump of number k moved, at most halfway to its neighbours; rows that it passes get its other value."""
    after = np.flatnonzero(np.diff(t) == 0) + 1
    at = int(after[k])
    low = t[0] if k == 0 else (t[after[k - 1]] + t[at]) / 2
    high = t[-1] if k == len(after) - 1 else (t[after[k + 1]] + t[at]) / 2
    time = float(np.clip(t[at] + later, low, high))
    rest, values = np.delete(t, [at - 1, at]), np.delete(T, [at - 1, at])
    values[(rest >= time) & (rest < t[at])] = T[at]
    values[(rest <= time) & (rest > t[at])] = T[at - 1]
    rest, values = rest[rest != time], values[rest != time]
    place = int(np.searchsorted(rest, time))
    return np.insert(rest, place, [time, time]), np.insert(values, place, T[at - 1 : at + 1])


def drive_by_profile(profile: Profile, time: Array) -> Drive:
    """Impose a chamber profile."""
    return Drive(time, "chamber", profile)


def drive_by_schedule(profile: Profile, columns: Mapping[str, Array], rate: float) -> Drive:
    """Impose a chamber profile, with commands and applied rate, linear between its times, at `rate` rows per second."""
    time = rows_of(profile, rate)
    commands = {
        name: (np.interp(time, profile.time, columns[column]) * factor) ** power
        for name, (column, factor, power) in COMMANDS.items()
        if column in columns
    }
    rate_applied = AppliedRate(profile.time, np.radians(columns[RATE])) if RATE in columns else None
    return Drive(time, "chamber", profile, commands=commands, rate=rate_applied)


def rows_of(profile: Profile, rate: float) -> Array:
    """Return the times (s) of the rows of a run through a profile, `rate` per second."""
    if not (np.isfinite(rate) and rate > 0):
        raise InputError("the time between rows must be positive and finite.")
    count = np.floor((profile.end - profile.start) * rate * (1 + 1e-12)) + 1
    if count > MOST_ROWS:
        raise InputError(
            f"rows every {1 / rate:g} s make {count / 1e6:.3g} million rows, more than the {MOST_ROWS / 1e6:.0f} million allowed; raise --row."
        )
    if count < 2:
        raise InputError(f"rows every {1 / rate:g} s make a single row of this profile; lower --row.")
    return np.minimum(profile.start + np.arange(int(count)) / rate, profile.end)


def drive_by_record(record: Record, boundary: Boundary | None = None, time: Array | None = None) -> Drive:
    """Impose a measured column of a record, the housing's or the chamber's, gaps bridged by lines; of very many rows, means."""
    if boundary is None:
        boundary = "chamber" if COLUMN["housing"] not in record and COLUMN["chamber"] in record else "housing"
    if COLUMN[boundary] not in record:
        raise InputError(
            f"{record.path}: no temperature drives the run; add the column {COLUMN['housing']} or {COLUMN['chamber']}."
            if not any(column in record for column in COLUMN.values())
            else f"{record.path}: the column {COLUMN[boundary]} is missing; choose the other boundary, or add it."
        )
    rows = record["time_s"]
    values = record[COLUMN[boundary]]
    known = np.isfinite(values)
    if np.count_nonzero(known) < 2:
        raise InputError(f"{record.path}: {COLUMN[boundary]} has fewer than two values.")
    check_temperatures(record)
    t, T = rows[known], values[known] + zero_Celsius
    if boundary == "chamber":
        t, T = _with_jumps(t, T, _settled_at(record))
    few = MOST_BOUNDARY_ROWS if time is None or boundary == "chamber" else IN_ROW * len(time)
    t, T, width = _thinned(t, T, min(few, MOST_BOUNDARY_ROWS))
    if boundary == "housing" and width.any():  # of a smooth curve, what it is in their middle
        T = T - bend_of_means(t, T, width)
    if t[0] > rows[0]:
        t, T = np.insert(t, 0, rows[0]), np.insert(T, 0, T[0])
    if t[-1] < rows[-1]:
        t, T = np.append(t, rows[-1]), np.append(T, T[-1])
    profile, holes = bridge_holes(Profile(t, T)) if boundary == "housing" else (Profile(t, T), {})
    commands = {
        name: (_held(rows, record[column]) * factor) ** power
        for name, (column, factor, power) in COMMANDS.items()
        if record.has_values(column)
    }
    if time is not None:
        commands = {name: np.interp(time, rows, values) for name, values in commands.items()}
    turned = None
    if record.has_values(RATE):  # means to the next row
        turned = AppliedRate.steps(rows, np.radians(_held(rows, record[RATE])))
    return Drive(
        rows if time is None else time,
        boundary,
        profile,
        moment=record.moment,
        commands=commands,
        holes=holes,
        rate=turned,
        source=record.path,
    )


def _held(rows: Array, values: Array) -> Array:
    """Return a commanded column with the value of the nearest row, in time, where it is missing: a command is held."""
    known = np.isfinite(values)
    if known.all():
        return values
    t, own = rows[known], values[known]
    middles = (t[1:] + t[:-1]) / 2
    return np.asarray(np.where(known, values, own[np.searchsorted(middles, rows)]))


def _settled_at(record: Record) -> float | None:
    """Temperature (K) of the housing when the record begins, where it is measured."""
    if COLUMN["housing"] not in record:
        return None
    first = record[COLUMN["housing"]][: max(1, len(record) // 1000)]
    return float(np.nanmedian(first)) + zero_Celsius if np.isfinite(first).any() else None


def _with_jumps(t: Array, T: Array, settled: float | None) -> tuple[Array, Array]:
    """Rows of a set point: where it jumps between two rows, it does so at the second, and at the start from `settled`."""
    step = np.abs(np.diff(T))
    near = np.array([np.median(step[max(k - 5, 0) : k + 6]) for k in np.flatnonzero(step > LEAST_JUMP)])
    after = np.flatnonzero(step > LEAST_JUMP)[step[step > LEAST_JUMP] > STEEP * near] + 1
    t, T = np.insert(t, after, t[after]), np.insert(T, after, T[after - 1])
    if settled is not None and abs(T[0] - settled) > LEAST_JUMP:
        t, T = np.insert(t, 0, t[0]), np.insert(T, 0, settled)
    return t, T


def _thinned(t: Array, T: Array, most: int) -> tuple[Array, Array, Array]:
    """Means of rows that are too many, and how wide these are (s), the first and the last kept; jumps stay where they are."""
    if len(t) <= most:
        return t, T, np.zeros(len(t))
    size = int(np.ceil(len(t) / most))
    jumps = np.flatnonzero(np.diff(t) == 0) + 1
    edges = np.unique(np.concatenate([np.arange(0, len(t), size), jumps]))
    counts = np.diff(np.append(edges, len(t)))
    means = np.add.reduceat(np.array([t, T]), edges, axis=1) / counts
    width = np.sqrt(np.add.reduceat((t - np.repeat(means[0], counts)) ** 2, edges) / counts)
    sides = np.sort(np.concatenate([[0], jumps - 1, jumps, [len(t) - 1]])).astype(np.intp)
    both = np.hstack([[*means, width], [t[sides], T[sides], np.zeros(len(sides))]])
    both = both[:, np.lexsort((np.concatenate([edges, sides]), both[0]))]
    t, T, width = both[:, np.concatenate([[True], np.diff(both[:2], axis=1).any(axis=0)])]
    return t, T, width
