"""Signatures of effects in the rows of a calibration: what each adds to every response, driven by the card's own simulation.

An effect on a response adds its columns there. One on the resonator's temperature, dT, changes every response by
∂y/∂T dT + ∂y/∂Ṫ dṪ, the slopes by differences of the read-out at the temperatures that the card predicts.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from compensation.arrays import Array
from studies.calibration.problem import CardProblem, Part
from studies.effects import Effect, Span, library
from studies.effects.states import States, remembered
from studies.inference.linear import PRICE, Columns, Shapes, Term
from studies.inference.paths import Path, memory_of, starts_of, trace
from studies.inference.shapes import chosen, leading
from studies.simulation.prediction import Prediction

if TYPE_CHECKING:
    from scipy.sparse import csr_array

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

    def shapes_of(self, effects: Iterable[tuple[Effect, str]]) -> list[Shapes]:
        """Return the columns of all shapes of some effects, in seven digits: whatever leads is computed anew."""
        found = []
        for _, pairs in groupby(effects, lambda one: id(one[0]) if one[0].alike else one):
            (effect, *_), responses = zip(*pairs, strict=True)
            found += self.shapes(effect, responses)
        return found

    def shapes(self, effect: Effect, responses: Sequence[str], alone: Sequence[tuple[float, ...]] = ()) -> list[Shapes]:
        """Return those of one effect, whose columns are the same of these responses; of some shapes `alone`, or of all that are scanned."""
        grids = {name: [tuple(shape) for shape in effect.grid(self.span, name)] for name in responses}
        scanned = {name: dict.fromkeys(alone or chosen(effect, grid)) for name, grid in grids.items()}
        first = {name: leading(effect, len(grid)) for name, grid in grids.items()}
        groups: dict[tuple[str, tuple[int, ...]], list[tuple[tuple[float, ...], Columns]]] = {}
        for shape in dict.fromkeys(shape for shapes in scanned.values() for shape in shapes):
            runs = [effect.columns(one, shape, responses[0]).T for one in self.states]
            for name in (one for one in responses if shape in scanned[one]):
                own = [run[first[name]] for run in runs]
                there = np.any([run.any(axis=1) for run in own], axis=0)
                if taken := effect.of_law(shape):
                    there &= ~np.isin(first[name], taken)
                members = tuple(k for k, seen in zip(first[name], there, strict=True) if seen)
                if members:
                    columns = self.made_of(np.hstack([run[there] for run in own]).T, effect, name)
                    kept = {n: X.astype(np.float32) for n, X in columns.items()}
                    groups.setdefault((name, members), []).append((shape, kept))
        found = []
        for (name, members), made in sorted(groups.items(), key=lambda one: responses.index(one[0][0])):
            stacked = {n: np.stack([columns[n] for _, columns in made], axis=1) for n in made[0][1]}
            found.append(Shapes(effect, name, tuple(shape for shape, _ in made), members, stacked, len(grids[name])))
        return found

    def unit(self, effect: Effect, response: str, members: Sequence[int]) -> Array:
        """Prior standard deviations of members in a strong case."""
        return np.asarray(effect.spread[list(members)] * self.size(effect, response))

    def term(
        self,
        effect: Effect,
        response: str,
        shape: tuple[float, ...],
        price: float = PRICE,
        members: tuple[int, ...] = (),
    ) -> Term:
        """Return a term with some members of the effect, or all that have a prior."""
        members = members or effect.members(shape)
        starts = self.remembers(effect, shape)
        columns = self.of_term(effect, shape, response, members, starts)
        unit = self.unit(effect, response, members)
        if starts:
            unit = np.append(unit, np.full(len(self.problem.runs), unit[0]))
        return Term(effect, response, shape, columns, members, unit, 1.0, price)

    def moved(self, term: Term, shape: tuple[float, ...]) -> Term:
        """Return a term with another shape."""
        own = self.term(term.effect, term.response, shape, term.price, term.members)
        return replace(own, scale=term.scale, bend=term.bend)

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
