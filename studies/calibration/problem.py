"""The least-squares problem of a calibration: predictions of all runs, their derivatives, and what else is free.

Coordinates, all of unit prior variance: the card's uncertain values, then each run's departures from settled at its
start. Frequency, bias and 1/Q are driven by the measured housing where there is one; the chamber then explains the housing.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from compensation.arrays import Array
from compensation.noise import white_rms
from compensation.noise_rows import NoiseRows
from compensation.spikes import find_step
from studies.calibration.observed import HOUSING, QUADRATURE, RESPONSES, SETTLED, ObservedRun, SettledTable
from studies.calibration.priors import Priors
from studies.resonator.law import law_of, moved_law
from studies.simulation.drive import Drive
from studies.simulation.heat_path import build_network, slowest_lag
from studies.simulation.prediction import Prediction, predict
from studies.simulation.variations import JUMP, KINK, SHIFT, Variations
from thermal.sweeping import LONGEST_ROW

if TYPE_CHECKING:
    from shell.law import FrequencyLaw
    from studies.instrument.card import Instrument

MOST_JUMPS = 24  # of a run whose times are free, each for itself
KNOTS = 5  # in a block
SOAK = 1e3  # time from one row of a table to the next, in that of a reading
FARTHEST = 180.0  # s between knots at most: temperatures are exact to microkelvins there
Progress = Callable[[str], None]


@dataclass(frozen=True)
class Part:
    """One drive of one run: its prediction, and the responses that it explains."""

    run: int
    name: str
    drive: Drive
    responses: tuple[str, ...]


@dataclass(frozen=True)
class State:
    """Residuals and derivatives of every response at one point, stacked over the runs that have it."""

    point: Array  # array (p,), independent coordinates
    residual: Mapping[str, Array]  # response -> array (M,), measured minus predicted
    # response -> array (M, p) by the coordinates; empty when not asked for
    slope: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class CardProblem:
    """An instrument, what is uncertain of it, and the runs."""

    instrument: "Instrument"
    priors: Priors
    runs: tuple[ObservedRun, ...]
    law: "FrequencyLaw"
    tables: tuple[SettledTable, ...] = ()
    levels: bool = False
    """Whether the frequency, too, may have a level of each run; of a law made from the records alone that is misfit."""

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """Drives of all runs in order."""
        found = []
        for number, run in enumerate(self.runs):
            inner = tuple(name for name in (*RESPONSES, QUADRATURE) if name in run.responses)
            if inner:
                found.append(Part(number, "inner", run.inner, inner))
            if run.outer is not None and HOUSING in run.responses:
                found.append(Part(number, "outer", run.outer, (HOUSING,)))
        return tuple(found)

    @cached_property
    def starts(self) -> tuple[tuple[int, str, float], ...]:
        """What is free of each run, with its prior sd: departures (K), the chamber's clock and its jumps (s), kinks of the housing there."""
        away = [start_spread(run, self.instrument, self.law) for run in self.runs]
        found = [
            (k, f"initial.{lump}", away[part.run])
            for k, part in enumerate(self.parts)
            for lump in departing(self.instrument, part.drive)
        ]
        for k, part in enumerate(self.parts):
            if part.drive.boundary == "housing":
                found += [(k, f"{KINK}{row}", size) for row, size in self.runs[part.run].kinks.items()]
            else:
                row = float(np.median(np.diff(part.drive.profile.time)))
                jumps, begin = part.drive.profile.jumps, part.drive.profile.start
                if 0 < len(jumps) <= MOST_JUMPS:
                    found += [(k, f"{JUMP}{i}", row / np.sqrt(3)) for i, at in enumerate(jumps) if at > begin]
                elif len(jumps):
                    found.append((k, SHIFT, 0.5 * row))
        return tuple(found)

    @property
    def count(self) -> int:
        """Number of coordinates."""
        return len(self.priors.values) + len(self.starts)

    @property
    def bending(self) -> int:
        """Number of coordinates in which it bends: all."""
        return self.count

    @cached_property
    def ends(self) -> tuple[Array, Array]:
        """Least and largest coordinates: those of values, and of a jump that was after the row before it and not after its own, where the model has a kink."""
        jumps = np.array([name.startswith(JUMP) for _, name, _ in self.starts], dtype=bool)
        low, high = self.priors.free_ends
        return (
            np.append(low, np.where(jumps, -np.sqrt(3.0), -np.inf)),
            np.append(high, np.where(jumps, 0.0, np.inf)),
        )

    def inside(self, point: Array) -> Array:
        """Nearest coordinates whose values respect their bounds."""
        count = len(self.priors.values)
        return np.concatenate([self.priors.inside(point[:count]), point[count:]])

    @cached_property
    def responses(self) -> tuple[str, ...]:
        """Responses that any run has, and the settled frequencies of tables."""
        found = tuple(n for n in (*RESPONSES, QUADRATURE, HOUSING) if any(n in part.responses for part in self.parts))
        return (*found, SETTLED) if self.tables else found

    def members(self, response: str) -> tuple[Part, ...]:
        """Parts that explain a response, in the order of its rows."""
        return tuple(part for part in self.parts if response in part.responses)

    @cached_property
    def digits(self) -> Mapping[str, float]:
        """Step to which the readings of every response are rounded, as they are in its own rows."""
        return {
            name: find_step(np.concatenate([self.runs[part.run].own_rows[name][1] for part in self.members(name)]))
            for name in self.responses
            if name != SETTLED
        }

    @cached_property
    def rows(self) -> Mapping[str, NoiseRows]:
        """Rows of every response, for its noise."""
        found = {
            name: NoiseRows.of(
                [self.runs[part.run].responses[name].time for part in self.members(name)],
                [self.runs[part.run].responses[name].span for part in self.members(name)],
            )
            for name in self.responses
            if name != SETTLED
        }
        if self.tables:
            readings = [np.ones(len(table.frequency)) for table in self.tables]
            found[SETTLED] = NoiseRows.of([SOAK * np.cumsum(one) for one in readings], readings)
        return found

    def instrument_at(self, point: Array) -> "Instrument":
        """Return the instrument with the values of a point."""
        return self.instrument.with_values(self.priors.at(point[: len(self.priors.values)]))

    def law_at(self, instrument: "Instrument") -> "FrequencyLaw":
        """Return the law of an instrument of this problem."""
        if any(value.name.startswith("resonator.") for value in self.priors.values):
            return law_of(instrument, self.law.lowest, self.law.highest, self.law.theory)
        return moved_law(self.law, instrument)

    def drive_at(self, point: Array, k: int) -> Drive:
        """Return the drive of a part with the departures of a point."""
        offset = len(self.priors.values)
        free = {name: sd * float(point[offset + i]) for i, (part, name, sd) in enumerate(self.starts) if part == k}
        shift = free.pop(SHIFT, 0.0)
        jumps = {int(name.removeprefix(JUMP)): free.pop(name) for name in [*free] if name.startswith(JUMP)}
        kinks = {int(name.removeprefix(KINK)): free.pop(name) for name in [*free] if name.startswith(KINK)}
        initial = {name.removeprefix("initial."): value for name, value in free.items()}
        return replace(self.parts[k].drive, initial=initial, shift=shift, jumps=jumps, kinks=kinks)

    def knots(self, part: Part) -> float:
        """Distance (s) of the knots of what radiation adds: some in every block of a long run, whose blocks are long."""
        blocks = max(len(self.runs[part.run].responses[name].time) for name in part.responses)
        return float(np.clip(np.ptp(part.drive.time) / (KNOTS * blocks), LONGEST_ROW, FARTHEST))

    def evaluate(self, point: Array, slopes: bool = True) -> State:
        """Predict all runs and compare."""
        return self.compare(point, self.predictions(point, slopes), slopes)

    def predictions(self, point: Array, slopes: bool = True) -> Iterator[Prediction]:
        """Yield what is predicted of every part."""
        varied = self.varied(point)
        for k, part in enumerate(self.parts):
            names = [*self.priors.names, *(name for one, name, _ in self.starts if one == k)] if slopes else []
            drive, wanted, here = self.drive_at(point, k), varied.with_names(names), varied.here
            yield predict(here.instrument, drive, wanted, here.law, self.knots(part), part.responses == (HOUSING,))

    def compare(self, point: Array, predictions: Iterable[Prediction], slopes: bool = True) -> State:
        """Set the predictions of every part beside what was measured."""
        scale = self.priors.slopes(point[: len(self.priors.values)])
        residual: dict[str, list[Array]] = {name: [] for name in self.responses}
        slope: dict[str, list[Array]] = {name: [] for name in self.responses}
        for k, (part, prediction) in enumerate(zip(self.parts, predictions, strict=True)):
            for name in part.responses:
                blocks = self.runs[part.run].responses[name]
                residual[name].append(blocks.value - blocks.average(prediction.columns[name]))
                if slopes:
                    slope[name].append(self._slopes(k, name, prediction, scale))
        if self.tables:
            varied = self.varied(point)
            law = varied.here.law
            for table in self.tables:
                residual[SETTLED].append(table.frequency - law.frequency(table.temperature, extrapolate=True))
                if slopes:
                    slope[SETTLED].append(self._settled_slopes(table, varied, scale))
        return State(
            point,
            {name: np.concatenate(found) for name, found in residual.items()},
            {name: np.concatenate(found) for name, found in slope.items()} if slopes else {},
        )

    def varied(self, point: Array) -> Variations:
        """Return the instrument with the values of a point, its law and damping, and its neighbours."""
        instrument = self.instrument_at(point)
        return Variations(instrument, self.law_at(instrument), self.priors.names)

    def _slopes(self, k: int, response: str, prediction: Prediction, scale: Array) -> Array:
        blocks = self.runs[self.parts[k].run].responses[response]
        J = np.zeros((len(blocks.value), self.count))
        slopes, places = self.along(k, response, prediction, scale)
        J[:, places] = blocks.average(slopes)
        return J

    def along(self, k: int, column: str, prediction: Prediction, scale: Array) -> tuple[Array, list[int]]:
        """Return how a column of a part's prediction goes with the coordinates that reach it, and their places."""
        by, count, nothing = prediction.derivatives, len(self.priors.values), np.zeros((len(prediction.housing), 0))
        values = np.column_stack([nothing, *(by[name][column] for name in self.priors.names)]) @ scale
        own = [(count + i, name, sd) for i, (one, name, sd) in enumerate(self.starts) if one == k]
        starts = [sd * by[name][column] for _, name, sd in own]
        return np.column_stack([values, *starts]), [*range(count), *(place for place, _, _ in own)]

    def _settled_slopes(self, table: SettledTable, varied: Variations, scale: Array) -> Array:
        columns = np.zeros((len(table.frequency), len(self.priors.values)))
        for k, name in enumerate(self.priors.names):
            if name.startswith(("material.", "mount.", "resonator.", "law.")):
                below, above = varied.sides(name)
                high, low = (side.law.frequency(table.temperature, extrapolate=True) for side in (above, below))
                columns[:, k] = (high - low) / (above.distance - below.distance)
        J = np.zeros((len(table.frequency), self.count))
        J[:, : len(scale)] = columns @ scale
        return J


def departing(instrument: "Instrument", drive: Drive) -> list[str]:
    """Return the parts of an instrument whose temperature at the start of a run may depart from the settled one."""
    absent = () if instrument.polynomial is None else instrument.polynomial.absent
    return [lump for lump in drive.departing if lump not in absent]


def wide_law(
    instrument: "Instrument", runs: Sequence[ObservedRun], tables: Sequence[SettledTable] = (), margin: float = 30.0,
    whole: "FrequencyLaw | None" = None,
) -> "FrequencyLaw":  # fmt: skip
    """Build the law over all that the runs reach, and so much more that trial states stay within it; from the `whole` law where that is known."""
    ends = [instrument.reference_temperature, *(float(T) for table in tables for T in table.temperature)]
    for run in runs:
        for drive in (run.inner, run.outer):
            if drive is not None:
                ends += [float(drive.profile.value.min()), float(drive.profile.value.max())]
    low, high = min(ends) - margin, max(ends) + margin
    return law_of(instrument, low, high) if whole is None else whole.between(low, high)


MOST_SPREAD = 10.0  # K: a run may begin in the midst of a change
LEAST_SPREAD = 0.05  # K, of a chamber that holds
WINDOW = 0.2  # of the slowest time constant, over which a rate is taken
LEAST_ROWS = 5
CARE = 2.0  # times what the card's time constant makes of a rate: it may be that much slower


def start_spread(run: ObservedRun, instrument: "Instrument", law: "FrequencyLaw") -> float:
    """Prior standard deviation (K) of what each part departs from rest at the start of a run."""
    if "frequency_Hz" not in run.responses:
        return MOST_SPREAD
    reference = instrument.reference_temperature
    lag = slowest_lag(build_network(instrument, boundary="housing"), reference)
    below, above = law.frequency(np.array([reference - 1.0, reference + 1.0]))
    frequency = run.responses["frequency_Hz"]
    rates = [_rate(frequency.time, frequency.value, WINDOW * lag) / abs(float(above - below) / 2)]
    if run.inner.boundary == "housing":
        rates.append(_rate(run.inner.profile.time, run.inner.profile.value, WINDOW * lag))
    return float(np.clip(CARE * lag * max(rates), LEAST_SPREAD, MOST_SPREAD))


def _rate(time: Array, value: Array, window: float) -> float:
    """Rate (per s) that the first rows leave likely, rms: of a straight line through them, and of its noise."""
    count = min(max(int(np.searchsorted(time - time[0], window)), LEAST_ROWS), len(time))
    t = time[:count] - time[:count].mean()
    spread = white_rms(value)
    return float(np.hypot(t @ value[:count] / (t @ t), spread / np.sqrt(t @ t)))
