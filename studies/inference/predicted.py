"""A model with effects on the records' own rows: its most probable numbers, what it makes of every response and what it leaves."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from compensation.arrays import Array
from compensation.noise import Noise
from studies.calibration.fit import IMPOSSIBLE
from studies.calibration.noise_levels import has_levels
from studies.inference.linear import Linear, Term, solve_posterior, split
from studies.inference.paths import Path
from studies.inference.signatures import Signatures

STRAYED = 1.0
"""Error of −2 ln L up to which a linearisation is taken as it is."""


@dataclass(frozen=True)
class Rows:
    """What a model leaves of one response on the rows of each record, spikes left out: times and residuals."""

    time: tuple[Array, ...]
    residual: tuple[Array, ...]

    @property
    def rms(self) -> float:
        """Root mean square."""
        return float(np.sqrt(np.mean(np.concatenate(self.residual) ** 2)))

    @property
    def within(self) -> float:
        """The same about the mean of each run."""
        return float(np.sqrt(np.mean(np.concatenate([own - own.mean() for own in self.residual]) ** 2)))


@dataclass(frozen=True)
class Kept:
    """A model with its numbers: the card's coordinates and the coefficients of its terms."""

    point: Array
    coefficients: tuple[Array, ...]


class Model:
    """Terms and noise in one linearised campaign, on the records' own rows."""

    def __init__(
        self, linear: Linear, signatures: Signatures, terms: Sequence[Term], noise: Mapping[str, Noise]
    ) -> None:
        self.linear, self.signatures, self.terms, self.noise = linear.bent(terms), signatures, tuple(terms), noise
        self.problem = linear.problem

    def kept(self, mean: Array) -> Kept:
        """Split coordinates into the card's and the coefficients of the terms."""
        count = self.linear.count
        point = self.problem.inside(np.clip(mean[:count], *self.problem.ends))
        return Kept(point, tuple(split(self.terms, mean[count:])))

    def strayed(self, mean: Array, left: Mapping[str, Array]) -> float:
        """Error of −2 ln L where straight lines end and the simulation leaves other blocks than they do."""
        linear = self.linear
        apart = {n: linear.target[n] - linear.columns(self.terms, n) @ mean - left[n] for n in linear.responses}
        return sum(float(np.sum(linear.rows[n].whiten(own, self.noise[n]) ** 2)) for n, own in apart.items())

    @cached_property
    def numbers(self) -> Kept | None:
        """Most probable numbers, where straight lines end or, where the simulation leaves less there, nearer to where they begin; None where nothing can be predicted."""
        mean, begin, count = self.mean(), self.signatures.point, self.linear.count
        found: list[tuple[float, Kept]] = []
        for part in (1.0, 0.5, 0.0):
            u = begin + part * (mean[:count] - begin)
            sizes = mean[count:] if part == 1.0 else self._sizes(u)
            numbers = self.kept(np.append(u, sizes))
            try:
                left = self.left(numbers)
            except IMPOSSIBLE:
                continue
            if part == 1.0 and self.strayed(mean, left) < STRAYED:
                return numbers
            rows = sum(float(np.sum(self.linear.rows[n].whiten(own, self.noise[n]) ** 2)) for n, own in left.items())
            found.append((rows + float(u @ u + sizes @ sizes), numbers))
        return min(found, key=lambda one: one[0])[1] if found else None

    def _sizes(self, u: Array) -> Array:
        """Most probable coefficients of the terms beside given values of the card."""
        X, r = self.linear.stacked(self.terms, self.noise)
        return solve_posterior(X[:, len(u) :], r - X[:, : len(u)] @ u)[0]

    def residuals(self, numbers: Kept, there: Signatures | None = None) -> dict[str, Rows]:
        """Return what is left of every response on the rows of all runs; `there`: the paths at these numbers, where they are known."""
        paths = (there or self.signatures.there(numbers.point)).paths
        found: dict[str, tuple[list[Array], list[Array]]] = {name: ([], []) for name in self.problem.responses}
        for k, part in enumerate(self.problem.parts):
            run, drive = self.problem.runs[part.run], paths[k].prediction.drive
            columns = dict(paths[k].prediction.columns)
            for term, values in zip(self.terms, numbers.coefficients, strict=True):
                for name, change in self.change(term, values, k, paths[k]).items():
                    columns[name] = columns[name] + change
            for name in part.responses:
                rows, own = run.own_rows[name]
                rest = own - on_rows(rows, drive.time - run.record["time_s"][0], columns[name])
                if has_levels(self.problem, name):  # from turn-on to turn-on
                    rest -= rest.mean()
                found[name][0].append(rows)
                found[name][1].append(rest)
        return {name: Rows(tuple(t), tuple(r)) for name, (t, r) in found.items() if r}

    def left(self, numbers: Kept, there: Signatures | None = None) -> dict[str, Array]:
        """Return what the simulation leaves of the blocks of every response, not what its straight lines do."""
        there = there or self.signatures.there(numbers.point)
        left = there.left()
        for term, size in zip(self.terms, numbers.coefficients, strict=True):
            for name, columns in there.columns_of(term).items():
                left[name] = left[name] - columns @ size
        return left

    def change(self, term: Term, values: Array, k: int, path: Path | None = None) -> dict[str, Array]:
        """Return what a term makes of the responses of a part at its predicted rows, along the path where it is linearised unless given."""
        path = path or self.signatures.paths[k]
        grid = self.signatures.on_grid(term.effect, term.members, term.starts)
        own = grid(path.states, term.shape, term.response) @ values
        found = path.changes(term.effect, own[:, None], term.response)
        return {name: change[:, 0] for name, change in found.items() if name in self.problem.parts[k].responses}

    def mean(self) -> Array:
        """Most probable coordinates."""
        return solve_posterior(*self.linear.stacked(self.terms, self.noise), self.problem.ends)[0]


def on_rows(rows: Array, time: Array, values: Array) -> Array:
    """Return values at the rows of a record, between groups of rows on Akima's curve; beyond the ends, within groups, on a straight line."""
    if len(time) < 2 or np.array_equal(rows, time):
        return np.interp(rows, time, values)
    first, last = (values[1] - values[0]) / (time[1] - time[0]), (values[-1] - values[-2]) / (time[-1] - time[-2])
    beyond = first * np.minimum(rows - time[0], 0.0) + last * np.maximum(rows - time[-1], 0.0)
    inside = scipy.interpolate.Akima1DInterpolator(time, values)(np.clip(rows, time[0], time[-1]))
    return np.asarray(inside + beyond)
