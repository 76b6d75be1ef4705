"""The point beside effects where a linear model of values, starts and effects holds: the steps of a calibration, with the effects in it.

Coordinates are the card's u, then the effects' coefficients c in units of their priors; in given noise every step lets

    Q(u, c) = |L⁻¹ (r(u) − Σ X_k(u) c_k)|² + |u|² + |c|²   fall.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from compensation.arrays import Array
from compensation.noise import Noise
from compensation.noise_rows import NoiseRows
from studies.calibration.fit import CardFit, descend
from studies.calibration.problem import State
from studies.effects.states import Lags, States
from studies.inference.linear import TOLD, Linear, Term, solve_posterior, split
from studies.inference.signatures import Signatures
from studies.simulation.drive import COLUMN, Boundary
from studies.simulation.heat_path import build_network
from studies.simulation.prediction import Prediction
from studies.simulation.response import lags_of
from studies.simulation.variations import heats

Along = Mapping[str, tuple[Array, list[int]]]
"""By state: how it goes with the coordinates that reach a run, and their places."""
STEP = 1e-3
"""Prior standard deviations, for differences."""
STATES = {"housing": COLUMN["housing"], "resonator": "resonator_temperature_degC"}
"""What of the states goes with the coordinates, and the column of a prediction that tells how."""
OF_SLOPE = ("law.a", "material.")
"""Values that the slope of the frequency over temperature depends on."""


def relinearise(
    start: CardFit, linear: Linear, point: Array, terms: Sequence[Term], noise: Mapping[str, Noise]
) -> "Linearised":
    """Return the model where its values are most probable beside some effects, from a point about which it is linear."""
    X, r = linear.stacked(terms, noise)
    own = X[:, linear.count :]
    sizes = solve_posterior(own, r - X[:, : linear.count] @ point)[0] if terms else np.zeros(0)
    beside = Beside(start, tuple(terms))
    rows, noise = dict(start.rows), dict(noise)
    if start.told is not None:
        rows[TOLD] = NoiseRows.of([np.arange(len(start.told), dtype=np.float64)], [np.ones(len(start.told))])
        noise[TOLD] = Noise(1.0)
    found = descend(beside, beside.evaluate(np.append(point, sizes)), noise, rows)
    assert isinstance(found, Linearised)
    return found


@dataclass(frozen=True)
class Linearised(State):
    """A state with the model that is linear about it, the paths there and the effects along them."""

    linear: Linear = field(kw_only=True)
    signatures: Signatures = field(kw_only=True)
    terms: tuple[Term, ...] = field(kw_only=True)

    @property
    def values(self) -> Array:
        """Coordinates of the card."""
        return self.point[: self.linear.count]


@dataclass(frozen=True)
class Beside:
    """The least-squares problem of a calibration with effects in it."""

    start: CardFit
    terms: tuple[Term, ...]

    @property
    def responses(self) -> tuple[str, ...]:
        """Those of the calibration, and what else is told."""
        return self.start.problem.responses + (() if self.start.told is None else (TOLD,))

    @property
    def count(self) -> int:
        """Number of coordinates."""
        return self.start.problem.count + sum(len(term.unit) for term in self.terms)

    @property
    def bending(self) -> int:
        """Number of the card's coordinates: in the effects' sizes it is straight."""
        return self.start.problem.count

    @property
    def ends(self) -> tuple[Array, Array]:
        """Least and largest coordinates."""
        low, high = self.start.problem.ends
        free = np.full(self.count - len(low), np.inf)
        return np.append(low, -free), np.append(high, free)

    def inside(self, point: Array) -> Array:
        """Nearest coordinates within the bounds of the values."""
        count = self.start.problem.count
        return np.append(self.start.problem.inside(point[:count]), point[count:])

    def evaluate(self, point: Array, slopes: bool = True) -> State:
        """Predict all runs with the effects and compare."""
        problem = self.start.problem
        predicted = list(problem.predictions(point[: problem.count], slopes))
        card = problem.compare(point[: problem.count], predicted, slopes)
        residual, terms = dict(card.residual), self.terms
        if (told := self.start.told) is not None:
            residual[TOLD] = told[:, -1] - told[:, :-1] @ card.point
        if not terms and not slopes:
            return State(point, residual)
        paths = Signatures.at(problem, card.point, (replace(one, derivatives={}) for one in predicted))
        terms = tuple(replace(one, columns=paths.columns_of(one), bend={}) for one in terms)
        sizes = split(terms, point[problem.count :])
        for term, size in zip(terms, sizes, strict=True):
            residual |= {name: residual[name] - columns @ size for name, columns in term.columns.items()}
        if not slopes:
            return State(point, residual)
        terms = self._bent(paths, predicted, card.point, terms, sizes) if terms else ()
        linear = Linear.of(replace(self.start, state=card))
        bent = linear.bent(terms)
        slope = {name: bent.columns(terms, name) for name in problem.responses}
        if (told := linear.told_beside(terms)) is not None:
            slope[TOLD] = told[:, :-1]
        return Linearised(point, residual, slope, linear=linear, signatures=paths, terms=terms)

    def _bent(
        self,
        paths: Signatures,
        predicted: Sequence[Prediction],
        point: Array,
        terms: Sequence[Term],
        sizes: Sequence[Array],
    ) -> tuple[Term, ...]:
        """Return terms that know how what they do goes with the card's values and with the starts of runs."""
        problem = self.start.problem
        names, count = problem.priors.names, problem.count
        thermal = any(term.effect.thermal for term in terms)
        scale = problem.priors.slopes(point[: len(names)])
        along = [
            {state: problem.along(k, column, one, scale) for state, column in STATES.items()}
            for k, one in enumerate(predicted)
        ]
        own = [
            {name: columns @ size for name, columns in term.columns.items()}
            for term, size in zip(terms, sizes, strict=True)
        ]
        bends = [{name: np.zeros((len(change), count + 1)) for name, change in changes.items()} for changes in own]
        every = [one for ways in along for one in ways.values()]
        for places in self._directions():
            aside = point + STEP * np.isin(np.arange(count), places)
            value = names[places[0]] if places[0] < len(names) else ""
            anew = thermal and value.startswith(OF_SLOPE)
            if not (anew or heats(value) or any(own[:, np.isin(to, places)].any() for own, to in every)):
                continue
            there = paths.read_by(aside, heats(value)) if anew else paths
            moved = [] if anew else self._moved(paths, along, aside, places, heats(value))
            for term, size, plain, bend in zip(terms, sizes, own, bends, strict=True):
                for response, columns in there.columns_of(term, moved).items():
                    change = (columns @ size - plain[response]) / STEP
                    for k in places:
                        reached = self._rows_of(response, k)
                        bend[response][reached, k] = change[reached]
        for bend in bends:
            for columns in bend.values():
                columns[:, -1] = columns[:, :-1] @ point
        return tuple(replace(term, bend=bend) for term, bend in zip(terms, bends, strict=True))

    def _directions(self) -> list[list[int]]:
        """Places of the coordinates that move at once: each value, and one start of each run, for runs know nothing of each other."""
        problem = self.start.problem
        values = len(problem.priors.names)
        parts = [part for part, _, _ in problem.starts]
        turns: dict[int, list[int]] = {}
        for i, part in enumerate(parts):
            turns.setdefault(parts[:i].count(part), []).append(values + i)
        return [*([k] for k in range(values)), *turns.values()]

    def _moved(
        self, paths: Signatures, along: Sequence[Along], aside: Array, places: Sequence[int], heated: bool
    ) -> list[States]:
        """Return the states of all runs a step of some coordinates `aside`, with the lags where the heat path may be another."""
        problem, found, lags = self.start.problem, [], dict[Boundary, Lags]()
        if heated:
            card = problem.instrument_at(aside)
            for boundary in {part.drive.boundary for part in problem.parts}:
                network = build_network(card, boundary=boundary)
                lags[boundary] = lags_of(card, paths.paths[0].prediction.law, network)
        for path, ways in zip(paths.paths, along, strict=True):
            states, steps = path.states, {}
            for state, (slopes, own) in ways.items():
                step = STEP * slopes[:, np.isin(own, places)].sum(axis=1)
                steps[state] = np.interp(states.time, path.time, step)
            anew = lags.get(path.prediction.drive.boundary, states.lags)
            there = states.warmed(steps["resonator"])
            found.append(replace(there, housing=states.housing + steps["housing"], lags=anew))
        return found

    def _rows_of(self, response: str, k: int) -> slice:
        """Rows of a response that a coordinate reaches: those of its run, or all."""
        problem = self.start.problem
        if k < len(problem.priors.names):
            return slice(None)
        own = problem.parts[problem.starts[k - len(problem.priors.names)][0]]
        members = problem.members(response)
        return problem.rows[response].slices[members.index(own)] if own in members else slice(0, 0)
