"""Signatures of effects in the rows of a calibration: what each adds to every response, driven by the card's own simulation.

An effect on a response adds its columns there. One on the resonator's temperature, dT, changes every response by
∂y/∂T dT + ∂y/∂Ṫ dṪ, the slopes by differences of the read-out at the temperatures that the card predicts.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from compensation.arrays import Array
from shell.constants import zero_Celsius
from studies.calibration.problem import CardProblem, Part
from studies.effects import Effect, Span, library
from studies.effects.states import States, remembered
from studies.simulation.heat_path import slowest_lag
from studies.simulation.prediction import Prediction
from studies.simulation.response import Temperatures, read_out

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from studies.inference.model import Term
    from studies.instrument.card import Instrument

WARMER, FASTER, LOSSIER = 0.01, 1e-6, 0.01
"""Steps of temperature (K), of its rate (K/s) and of 1/Q (relative) for the slopes of the read-out."""
VARIES = 1e-3
"""Relative change from which on a drive varies."""


SHARE = "law.radiated_share"
"""A value that only a card with a heat path of its own has."""
DIRECT, WARMED, DAMPED = "direct", "warmed", "damped"
"""Ways in which an effect reaches a response: by itself, through the temperature, through the anisotropy of damping."""


def _gradient(count: int, step: float) -> "csr_array":
    """Differences of an even grid, as `numpy.gradient` takes them."""
    from scipy.sparse import csr_array, lil_array

    G = lil_array((count, count))
    inner = np.arange(1, count - 1)
    G[inner, inner + 1], G[inner, inner - 1] = 0.5 / step, -0.5 / step
    for row, (before, after) in ((0, (0, 1)), (count - 1, (count - 2, count - 1))):
        G[row, before], G[row, after] = -1.0 / step, 1.0 / step
    return csr_array(G)


@dataclass(frozen=True)
class Path:
    """One run as the card predicts it: its states on an even grid, and by response the slopes per K, per K/s and by 1/Q."""

    instrument: "Instrument"
    states: States
    prediction: Prediction

    @property
    def time(self) -> Array:
        """Predicted rows, s since the first."""
        return np.asarray(self.prediction.drive.time - self.prediction.drive.time[0])

    @cached_property
    def by_temperature(self) -> dict[str, Array]:
        """Slopes per K."""
        return self._slopes(WARMER, np.array([WARMER, 0.0, 0.0]))

    @cached_property
    def by_rate(self) -> dict[str, Array]:
        """Slopes per K/s."""
        return self._slopes(FASTER, np.array([0.0, FASTER, 0.0]))

    @cached_property
    def by_loss(self) -> Array:
        """Slope of the bias by 1/Q."""
        more = LOSSIER * float(np.median(self.prediction.columns["inverse_q"]))
        return self._slopes(more, np.array([0.0, 0.0, more]))["bias_deg_per_h"]

    def _slopes(self, step: float, change: Array) -> dict[str, Array]:
        """Central differences of the read-out, for a change of temperature, rate and 1/Q."""
        found = self.prediction

        def read(warmer: float, faster: float, lossier: float) -> dict[str, Array]:
            value, rate = found.temperatures.value.copy(), found.temperatures.rate.copy()
            value[:, 1] += warmer
            rate[:, 1] += faster
            at = Temperatures(value, rate)
            return read_out(self.instrument, found.law, found.drive, at, self.states.tau, found.damping, lossier)

        below, above = read(*-change), read(*change)
        return {name: (above[name] - below[name]) / (2 * step) for name in above}

    def onto_rows(self, values: Array) -> Array:
        """Return columns of the even grid at the predicted rows."""
        if self.time.shape == self.states.time.shape and np.allclose(self.time, self.states.time, rtol=0.0, atol=1e-6):
            return values
        return np.stack([np.interp(self.time, self.states.time, column) for column in values.T], axis=1)

    @cached_property
    def interpolation(self) -> "csr_array":
        """What takes values of the even grid to the predicted rows, linear between them."""
        from scipy.sparse import csr_array

        even, rows = self.states.time, self.time
        before = np.clip(np.searchsorted(even, rows, side="right") - 1, 0, len(even) - 2)
        part = np.clip((rows - even[before]) / self.states.step, 0.0, 1.0)
        place = np.arange(len(rows))
        entries = np.concatenate([1.0 - part, part])
        return csr_array((entries, (np.tile(place, 2), np.concatenate([before, before + 1]))), (len(rows), len(even)))

    def changes(self, effect: Effect, own: Array, response: str) -> dict[str, Array]:
        """Return what the columns of an effect on the even grid make of every response at the predicted rows."""
        here = self.onto_rows(own)
        if effect.thermal:
            faster = self.onto_rows(np.gradient(own, self.states.step, axis=0))
            return {
                name: by_T[:, None] * here + self.by_rate[name][:, None] * faster
                for name, by_T in self.by_temperature.items()
            }
        if response == "inverse_q":
            return {response: here, "bias_deg_per_h": self.by_loss[:, None] * here}
        return {response: here}


def trace(instrument: "Instrument", found: Prediction, run: int) -> Path:
    """Return the path of one run, as it is predicted, through the states of a card."""
    drive, time = found.drive, found.drive.time - found.drive.time[0]
    even = np.linspace(0.0, time[-1], int(np.ceil(time[-1] / np.median(np.diff(time)))) + 1)
    standing = {"pattern_angle": np.full(len(time), np.radians(instrument.bias.pattern_angle_deg))}
    commands = {name: np.interp(even, time, values) for name, values in (standing | dict(drive.commands)).items()}
    states = States(
        run=run,
        time=even,
        campaign_time=even + drive.start,
        housing=np.interp(even, time, found.housing),
        resonator=np.interp(even, time, found.columns["resonator_temperature_degC"]) + zero_Celsius,
        known_rate=np.interp(even, time, found.temperatures.rate[:, 1]),
        tau=slowest_lag(found.network, instrument.reference_temperature),
        reference=instrument.reference_temperature,
        **commands,
    )
    return Path(instrument, states, found)


def memory_of(effect: Effect, shape: Sequence[float]) -> float:
    """Return the time constant, s, with which an effect forgets what came before a run."""
    return float(shape[[one.name for one in effect.shape].index(effect.memory)])


def starts_of(effect: Effect, states: States, shape: Sequence[float], runs: int, wide: float) -> Array:
    """Return what an effect with memory had at the start of each run, on the even grid: as much as the covered range would give it."""
    out = np.zeros((states.time.size, runs))
    out[:, states.run] = wide * np.exp(-(states.time - states.time[0]) / memory_of(effect, shape))
    return out


@dataclass(frozen=True)
class Signatures:
    """Paths of all runs of a calibration at one point."""

    problem: CardProblem
    point: Array
    paths: tuple[Path, ...]
    _made: "dict[tuple[str, str], csr_array]" = field(default_factory=dict, init=False, repr=False, compare=False)

    @classmethod
    def at(cls, problem: CardProblem, point: Array, predicted: Iterable[Prediction] | None = None) -> "Signatures":
        """Trace all runs with the values of a point, as they are predicted there."""
        instrument = problem.instrument_at(point)
        predicted = problem.predictions(point, slopes=False) if predicted is None else predicted
        paths = [trace(instrument, one, part.run) for one, part in zip(predicted, problem.parts, strict=True)]
        past = remembered([path.states for path in paths])
        return cls(
            problem,
            point,
            tuple(
                replace(path, states=replace(path.states, before=turns))
                for path, turns in zip(paths, past, strict=True)
            ),
        )

    def there(self, point: Array) -> "Signatures":
        """Paths at another point, these where it is the same."""
        return self if np.array_equal(point, self.point) else Signatures.at(self.problem, point)

    def read_by(self, point: Array, warms: bool) -> "Signatures":
        """Paths at another point whose values move the law, and the temperatures only if it `warms`."""
        if warms and self.problem.instrument.polynomial is None:
            return Signatures.at(self.problem, point)
        here, paths = self.problem.varied(point).here, []
        for path in self.paths:
            read = replace(path.prediction, law=here.law, damping=here.damping)
            paths.append(replace(path, instrument=here.instrument, prediction=read))
        return Signatures(self.problem, point, tuple(paths))

    def left(self) -> dict[str, Array]:
        """What the card alone leaves of the blocks of every response."""
        predicted = (path.prediction for path in self.paths)
        return dict(self.problem.compare(self.point, predicted, slopes=False).residual)

    @property
    def states(self) -> list[States]:
        """States of all runs."""
        return [path.states for path in self.paths]

    @cached_property
    def span(self) -> Span:
        """What the campaign covers."""
        states = self.states
        housing = np.concatenate([s.housing for s in states])
        low, high = np.percentile(housing, (0.5, 99.5))
        first = [self.problem.runs[part.run].responses[part.responses[0]].time for part in self.problem.parts]
        begins, ends = [s.campaign_time[0] for s in states], [s.campaign_time[-1] for s in states]
        angles = np.concatenate([np.zeros(1) if s.pattern_angle is None else s.pattern_angle for s in states])
        return Span(
            temperature_low=float(low),
            temperature_high=float(high),
            longest_run=max(float(np.ptp(s.time)) for s in states),
            campaign_length=float(max(ends) - min(begins)),
            step=max(float(np.median(np.diff(t))) for t in first),
            tau=max(s.tau for s in states),
            runs=len(states),
            bins=tuple(first),
            turns=bool(np.ptp(angles) > VARIES),
            timed=len(states) == 1 or all(run.record.start is not None for run in self.problem.runs),
        )

    def away(self, other: "Signatures") -> float:
        """How far the resonator's temperature is from that of other paths, over its range."""
        own = np.concatenate([path.states.resonator for path in self.paths])
        return float(
            np.abs(own - np.concatenate([p.states.resonator for p in other.paths])).max() / max(np.ptp(own), 1e-3)
        )

    def size(self, effect: Effect, response: str) -> float:
        """Return how large the first coefficient is in strong cases, K or the unit of the response."""
        if effect.thermal or response == "bias_deg_per_h":
            return effect.sizes[response]
        parts = [self.problem.runs[part.run].responses[response].value for part in self.problem.members(response)]
        return effect.sizes[response] * abs(float(np.median(np.concatenate(parts))))

    def applicable(self, effects: "Mapping[str, Effect] | None" = None) -> Iterator[tuple[Effect, str]]:
        """Yield the effects that can act here, with the response where each counts: drives that vary, shapes that fit."""
        for effect in (library() if effects is None else effects).values():
            if not all(self._varies(name) for name in effect.needs) or effect.name in self._taken:
                continue
            for response in effect.sizes:
                there = response in self.problem.responses
                if there and not (effect.thermal and response != "frequency_Hz"):
                    yield effect, response

    @property
    def _taken(self) -> tuple[str, ...]:
        """Effects for which a heat path of several lags has values: of lags in series, and of a sensor that may be late."""
        names = self.problem.priors.names
        own = (one.name for one in library().values() if one.card_key.startswith("law.") or one.card_key in names)
        return tuple(own) if SHARE in names else ()

    def _varies(self, drive: str) -> bool:
        parts = [getattr(path.states, drive) for path in self.paths]
        if any(part is None for part in parts):
            return False
        values = np.concatenate(parts)
        return bool(np.ptp(values) > VARIES * max(float(np.abs(values).max()), 1e-12))

    def columns(
        self, effect: Effect, shape: tuple[float, ...], response: str, states: Sequence[States] = ()
    ) -> dict[str, Array]:
        """Return what the members of an effect make of each response, stacked over its rows, in `states` beside the paths if given."""
        grids = [effect.columns(one, shape, response).T for one in states or self.states]
        there = np.any([own.any(axis=1) for own in grids], axis=0)
        made, found = self.made_of(np.hstack([own[there] for own in grids]).T, effect, response), {}
        for name, own in made.items():
            found[name] = np.zeros((len(own), len(there)))
            found[name][:, there] = own
        return found

    def made_of(self, own: Array, effect: Effect, response: str) -> dict[str, Array]:
        """Return what columns of an effect on the even grids of all runs make of each response."""
        kinds = dict.fromkeys(self.problem.responses, WARMED) if effect.thermal else {response: DIRECT}
        if (
            response == "inverse_q"
            and not effect.thermal
            and self._leaks
            and "bias_deg_per_h" in self.problem.responses
        ):
            kinds["bias_deg_per_h"] = DAMPED
        return {name: self._operator(name, kind) @ own for name, kind in kinds.items()}

    def of_term(
        self, effect: Effect, shape: tuple[float, ...], response: str, members: Sequence[int], starts: bool
    ) -> dict[str, Array]:
        """Return what some members make of each response, beside them what every run began with where the effect remembers it."""
        return self.columns(replace(effect, columns=self.on_grid(effect, members, starts)), shape, response)

    def columns_of(self, term: "Term", states: Sequence[States] = ()) -> dict[str, Array]:
        """Return the columns of a term along these paths, or in `states` beside them."""
        effect = replace(term.effect, columns=self.on_grid(term.effect, term.members, term.starts))
        return self.columns(effect, term.shape, term.response, states)

    def on_grid(
        self, effect: Effect, members: Sequence[int], starts: bool
    ) -> Callable[[States, Sequence[float], str], Array]:
        """Return what gives these columns on the even grid of a run."""

        def columns(states: States, shape: Sequence[float], response: str) -> Array:
            own = np.asarray(effect.columns(states, shape, response)).T[list(members)].T
            if not starts:
                return own
            began = starts_of(effect, states, shape, len(self.problem.runs), self.span.temperature_range)
            return np.hstack([own, began])

        return columns

    def remembers(self, effect: Effect, shape: tuple[float, ...]) -> bool:
        """Whether an effect keeps what came before a run for longer than the resonator does."""
        return bool(effect.memory) and memory_of(effect, shape) > self.span.tau

    def _operator(self, name: str, way: str) -> "csr_array":
        """What takes a column on the even grids of all parts to the means of the blocks of a response; made once."""
        if (name, way) not in self._made:
            from scipy.sparse import block_diag

            each = zip(self.problem.parts, self.paths, strict=True)
            self._made[name, way] = block_diag([self._block(part, path, name, way) for part, path in each], "csr")
        return self._made[name, way]

    def _block(self, part: Part, path: Path, name: str, way: str) -> "csr_array":
        from scipy.sparse import csr_array, diags_array

        onto = path.interpolation
        if name not in part.responses:
            return csr_array((0, onto.shape[1]))
        blocks = self.problem.runs[part.run].responses[name]
        sizes = np.diff(np.append(blocks.edges, len(blocks.rows)))
        place = np.repeat(np.arange(len(sizes)), sizes)
        mean = csr_array((1.0 / blocks.counts[place], (place, blocks.rows)), (len(sizes), len(path.time)))
        if way != DIRECT:
            along = path.by_loss if way == DAMPED else path.by_temperature[name]
            found = mean @ diags_array(along) @ onto
            if way == WARMED and np.any(path.by_rate[name]):
                slope = _gradient(len(path.states.time), path.states.step)
                found = found + mean @ diags_array(path.by_rate[name]) @ onto @ slope
            return csr_array(found)
        return csr_array(mean @ onto)

    @cached_property
    def _leaks(self) -> bool:
        """Whether 1/Q reaches the bias."""
        return any(np.any(path.by_loss) for path in self.paths)
