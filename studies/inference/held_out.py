"""Predictions of rows that a model has not seen: one record at a time, or of a single one a fifth, a thermal constant apart."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from compensation.arrays import Array
from compensation.noise import Noise
from studies.calibration.fit import IMPOSSIBLE
from studies.calibration.noise_levels import has_levels
from studies.inference.model import Linear, Term, solve_posterior, split
from studies.inference.signatures import Path, Signatures

Mask = NDArray[np.bool_]
BLOCKS = 5
STRAYED = 1.0
"""Error of −2 ln L up to which a linearisation is taken as it is."""
FREE = 1e3
"""Prior standard deviation of the offset of a run that is held out, in parts of the noise of its mean."""
KNOWN = 1.0
"""Standard deviation of a prediction, in parts of the noise, up to which the rest of the records predict a row."""
CARRIED_OFF = 2.0
"""Standard deviations by which slow noise carries a whole run off at most."""
TOLD = 2 / 3
"""Part of the rows that the other runs must tell, below which blocks in time are held out of the others."""
FEWEST = 0.5
"""Part of the rows from which on they speak for the records."""


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
class Unseen:
    """What a model leaves of rows that it has not seen, and which of them the other rows tell it."""

    residual: Array
    known: Mask

    @classmethod
    def of(cls, parts: Sequence[tuple[Array, Mask]]) -> "Unseen":
        """Join parts."""
        residuals, masks = zip(*parts, strict=True) if parts else ((np.empty(0),), (np.empty(0, dtype=bool),))
        return cls(np.concatenate(residuals), np.concatenate(masks))

    def beyond(self, told: Mask, other: "Unseen") -> "Unseen":
        """The same, with the rows that are not `told` as held out in another way."""
        return Unseen(np.where(told, self.residual, other.residual), told | other.known)

    def beside(self, other: "Unseen") -> tuple[float | None, float | None]:
        """Return the rms of both on the rows that both can predict; None where these are too few."""
        both = self.known & other.known
        if both.sum() < max(FEWEST * len(both), 1):
            return None, None
        first, second = (float(np.sqrt(np.mean(one.residual[both] ** 2))) for one in (self, other))
        return first, second


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

    def held_out(self, by_record: bool, rows: Mapping[str, Rows]) -> "dict[str, Unseen]":
        """Return what is left of rows that were held out; `rows`: what the model that has seen them leaves."""
        whole = self.mean()
        return self._by_record(whole, rows) if by_record else self._by_block(whole, rows)

    def _moved(self, rows: Mapping[str, Rows], name: str, step: Array) -> list[Array]:
        """Return what is left on the rows of each part after a step of the coordinates: what the step does is smooth."""
        change, level = self.linear.columns(self.terms, name) @ step, self.linear.rows[name]
        found = []
        for k, (t, rest) in enumerate(zip(rows[name].time, rows[name].residual, strict=True)):
            at, own = level.times[k], level.slices[k]
            left = rest - np.interp(t, at - at[0], change[own])
            found.append(left - self._level(name, k, float(left.mean())))
        return found

    def _level(self, name: str, k: int, mean: float) -> float:
        """Return the part of a run's mean that is its own: of a turn-on all, else what slow noise may carry a whole run off."""
        if has_levels(self.problem, name):
            return mean
        slow = self.linear.rows[name].covariance(k, replace(self.noise[name], white=0.0))
        most = CARRIED_OFF * float(np.sqrt(max(float(slow.mean()), 0.0)))
        return float(np.clip(mean, -most, most))

    def _by_record(self, whole: Array, rows: Mapping[str, Rows]) -> "dict[str, Unseen]":
        parts: dict[str, list[tuple[Array, Mask]]] = {name: [] for name in rows}
        for run in range(len(self.problem.runs)):
            keep = {
                name: [
                    np.full(len(self.problem.runs[part.run].responses[name].time), part.run != run)
                    for part in self.problem.members(name)
                ]
                for name in self.problem.responses
            }
            mean, C = self._trained(keep)
            step = self._restarted(mean, run, keep) - whole
            others = np.setdiff1d(np.arange(len(mean)), self._own(run))
            for name in rows:
                known = self._known(name, C[np.ix_(others, others)], others)
                moved = self._moved(rows, name, step)
                for k, part in enumerate(self.problem.members(name)):
                    if part.run == run:
                        parts[name].append((moved[k], self._near(name, k, rows[name].time[k], known)))
        return {name: Unseen.of(own) for name, own in parts.items()}

    def _known(self, name: str, C: Array, others: NDArray[np.intp]) -> Mask:
        """Blocks that a trained model predicts to `KNOWN` times the noise; the level of a run of its own is refitted."""
        X, level = self.linear.columns(self.terms, name)[:, others], self.linear.rows[name]
        if has_levels(self.problem, name):
            X = np.concatenate([X[own] - X[own].mean(axis=0) for own in level.slices])
        spread = np.sqrt(np.einsum("ij,jk,ik->i", X, C, X))
        noise = np.sqrt(level.variances(replace(self.noise[name], offset=0.0)))
        return np.asarray(spread < KNOWN * noise)

    def _near(self, name: str, k: int, time: Array, known: Mask) -> Mask:
        """Rows of a part whose blocks are known."""
        level = self.linear.rows[name]
        at = level.times[k]
        return np.asarray(known[level.slices[k]][np.clip(np.searchsorted(at - at[0], time), 0, len(at) - 1)])

    def _own(self, run: int) -> list[int]:
        """Coordinates of a run of its own: how it began."""
        first, at = len(self.problem.priors.values), self.linear.count
        own = [first + i for i, (k, _, _) in enumerate(self.problem.starts) if self.problem.parts[k].run == run]
        for term in self.terms:
            own += [at + len(term.members) + run] * term.starts
            at += len(term.unit)
        return own

    def _trained(self, keep: Mapping[str, Sequence[Mask]]) -> tuple[Array, Array]:
        seen = {name: own for name, own in keep.items() if any(mask.any() for mask in own)}
        return solve_posterior(*self.linear.stacked(self.terms, self.noise, seen), self.problem.ends)

    def _restarted(self, mean: Array, run: int, keep: Mapping[str, Sequence[Mask]]) -> Array:
        """Refit start and offset of a run that was held out."""
        own, mean = self._own(run), mean.copy()
        if not own:
            return mean
        mean[own] = 0.0
        seen = {name: [~mask for mask in masks] for name, masks in keep.items()}
        seen = {name: masks for name, masks in seen.items() if any(mask.any() for mask in masks)}
        noise = {
            name: replace(level, offset=FREE * level.white / self.linear.rows[name].span ** 0.5)
            for name, level in self.noise.items()
        }
        columns, rest = self.linear.stacked(self.terms, noise, seen)
        mean[own] = solve_posterior(columns[:, own], rest - columns @ mean)[0]
        return mean

    def _by_block(self, whole: Array, rows: Mapping[str, Rows]) -> "dict[str, Unseen]":
        tau, every = self.signatures.span.tau, np.arange(len(whole))
        found = {name: [(own.copy(), np.zeros(len(own), dtype=bool)) for own in rows[name].residual] for name in rows}
        for block in range(BLOCKS):
            keep = {
                name: [_outside(self.problem.runs[part.run].responses[name].time, block, tau) for part in self.problem.members(name)]
                for name in self.problem.responses
            }  # fmt: skip
            trained = all(any(mask.any() for mask in masks) for masks in keep.values())
            mean, C = self._trained(keep) if trained else (whole, np.zeros((0, 0)))
            for name in rows:
                blocks = np.zeros(self.linear.rows[name].count, dtype=bool)
                known = self._known(name, C, every) if trained else blocks
                for k, (t, rest) in enumerate(zip(rows[name].time, self._moved(rows, name, mean - whole), strict=True)):
                    inside = ~_outside(t, block, 0.0)
                    for own, block_of in zip(found[name][k], (rest, self._near(name, k, t, known)), strict=True):
                        own[inside] = block_of[inside]
        return {name: Unseen.of(own) for name, own in found.items()}


@dataclass(frozen=True)
class HeldOut:
    """What a model leaves of rows that it has not seen: of runs, or of blocks in time; `rows`: what it leaves of those that it has seen."""

    model: Model
    rows: Mapping[str, Rows]
    by_record: bool

    @cached_property
    def left(self) -> dict[str, Unseen]:
        """Of runs, or of blocks where runs cannot be held out."""
        return self.model.held_out(self.by_record, self.rows)

    @cached_property
    def blocks(self) -> dict[str, Unseen]:
        """Of blocks in time."""
        return self.model.held_out(False, self.rows)

    def beside(self, other: "HeldOut") -> dict[str, tuple[float | None, float | None]]:
        """Return the rms of both; where the other runs tell few rows of a run, the rest with a block in time."""
        found = {}
        for name in self.rows:
            one, two = self.left[name], other.left[name]
            told = one.known & two.known
            if self.by_record and told.mean() < TOLD:
                one, two = one.beyond(told, self.blocks[name]), two.beyond(told, other.blocks[name])
            found[name] = one.beside(two)
        return found


def on_rows(rows: Array, time: Array, values: Array) -> Array:
    """Return values at the rows of a record, between groups of rows on Akima's curve; beyond the ends, within groups, on a straight line."""
    if len(time) < 2 or np.array_equal(rows, time):
        return np.interp(rows, time, values)
    first, last = (values[1] - values[0]) / (time[1] - time[0]), (values[-1] - values[-2]) / (time[-1] - time[-2])
    beyond = first * np.minimum(rows - time[0], 0.0) + last * np.maximum(rows - time[-1], 0.0)
    inside = scipy.interpolate.Akima1DInterpolator(time, values)(np.clip(rows, time[0], time[-1]))
    return np.asarray(inside + beyond)


def _outside(time: Array, block: int, gap: float) -> Mask:
    """Rows outside a fifth of a run and so far from its ends."""
    length = np.ptp(time) * (1 + 1e-9)
    low, high = (time[0] + length * (block + end) / BLOCKS for end in (0, 1))
    return np.asarray((time < low - gap) | (time >= high + gap))
