"""Predictions of rows that a model has not seen: one record at a time, or of a single one a fifth, a thermal constant apart."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array
from studies.calibration.noise_levels import has_levels
from studies.inference.linear import solve_posterior
from studies.inference.predicted import Model, Rows

Mask = NDArray[np.bool_]
BLOCKS = 5
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
class HeldOut:
    """What a model leaves of rows that it has not seen: of runs, or of blocks in time; `rows`: what it leaves of those that it has seen."""

    model: Model
    rows: Mapping[str, Rows]
    by_record: bool

    @cached_property
    def left(self) -> dict[str, Unseen]:
        """Of runs, or of blocks where runs cannot be held out."""
        return self._by_record(self.model.mean()) if self.by_record else self.blocks

    @cached_property
    def blocks(self) -> dict[str, Unseen]:
        """Of blocks in time."""
        return self._by_block(self.model.mean())

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

    def _moved(self, name: str, step: Array) -> list[Array]:
        """Return what is left on the rows of each part after a step of the coordinates: what the step does is smooth."""
        change, level = self.model.linear.columns(self.model.terms, name) @ step, self.model.linear.rows[name]
        found = []
        for k, (t, rest) in enumerate(zip(self.rows[name].time, self.rows[name].residual, strict=True)):
            at, own = level.times[k], level.slices[k]
            left = rest - np.interp(t, at - at[0], change[own])
            found.append(left - self._level(name, k, float(left.mean())))
        return found

    def _level(self, name: str, k: int, mean: float) -> float:
        """Return the part of a run's mean that is its own: of a turn-on all, else what slow noise may carry a whole run off."""
        if has_levels(self.model.problem, name):
            return mean
        slow = self.model.linear.rows[name].covariance(k, replace(self.model.noise[name], white=0.0))
        most = CARRIED_OFF * float(np.sqrt(max(float(slow.mean()), 0.0)))
        return float(np.clip(mean, -most, most))

    def _by_record(self, whole: Array) -> "dict[str, Unseen]":
        parts: dict[str, list[tuple[Array, Mask]]] = {name: [] for name in self.rows}
        for run in range(len(self.model.problem.runs)):
            keep = {
                name: [
                    np.full(len(self.model.problem.runs[part.run].responses[name].time), part.run != run)
                    for part in self.model.problem.members(name)
                ]
                for name in self.model.problem.responses
            }
            mean, C = self._trained(keep)
            step = self._restarted(mean, run, keep) - whole
            others = np.setdiff1d(np.arange(len(mean)), self._own(run))
            for name in self.rows:
                known = self._known(name, C[np.ix_(others, others)], others)
                moved = self._moved(name, step)
                for k, part in enumerate(self.model.problem.members(name)):
                    if part.run == run:
                        parts[name].append((moved[k], self._near(name, k, self.rows[name].time[k], known)))
        return {name: Unseen.of(own) for name, own in parts.items()}

    def _known(self, name: str, C: Array, others: NDArray[np.intp]) -> Mask:
        """Blocks that a trained model predicts to `KNOWN` times the noise; the level of a run of its own is refitted."""
        X, level = self.model.linear.columns(self.model.terms, name)[:, others], self.model.linear.rows[name]
        if has_levels(self.model.problem, name):
            X = np.concatenate([X[own] - X[own].mean(axis=0) for own in level.slices])
        spread = np.sqrt(np.einsum("ij,jk,ik->i", X, C, X))
        noise = np.sqrt(level.variances(replace(self.model.noise[name], offset=0.0)))
        return np.asarray(spread < KNOWN * noise)

    def _near(self, name: str, k: int, time: Array, known: Mask) -> Mask:
        """Rows of a part whose blocks are known."""
        level = self.model.linear.rows[name]
        at = level.times[k]
        return np.asarray(known[level.slices[k]][np.clip(np.searchsorted(at - at[0], time), 0, len(at) - 1)])

    def _own(self, run: int) -> list[int]:
        """Coordinates of a run of its own: how it began."""
        first, at = len(self.model.problem.priors.values), self.model.linear.count
        own = [
            first + i for i, (k, _, _) in enumerate(self.model.problem.starts) if self.model.problem.parts[k].run == run
        ]
        for term in self.model.terms:
            own += [at + len(term.members) + run] * term.starts
            at += len(term.unit)
        return own

    def _trained(self, keep: Mapping[str, Sequence[Mask]]) -> tuple[Array, Array]:
        seen = {name: own for name, own in keep.items() if any(mask.any() for mask in own)}
        return solve_posterior(
            *self.model.linear.stacked(self.model.terms, self.model.noise, seen), self.model.problem.ends
        )

    def _restarted(self, mean: Array, run: int, keep: Mapping[str, Sequence[Mask]]) -> Array:
        """Refit start and offset of a run that was held out."""
        own, mean = self._own(run), mean.copy()
        if not own:
            return mean
        mean[own] = 0.0
        seen = {name: [~mask for mask in masks] for name, masks in keep.items()}
        seen = {name: masks for name, masks in seen.items() if any(mask.any() for mask in masks)}
        noise = {
            name: replace(level, offset=FREE * level.white / self.model.linear.rows[name].span ** 0.5)
            for name, level in self.model.noise.items()
        }
        columns, rest = self.model.linear.stacked(self.model.terms, noise, seen)
        mean[own] = solve_posterior(columns[:, own], rest - columns @ mean)[0]
        return mean

    def _by_block(self, whole: Array) -> "dict[str, Unseen]":
        tau, every = self.model.signatures.span.tau, np.arange(len(whole))
        found = {
            name: [(own.copy(), np.zeros(len(own), dtype=bool)) for own in self.rows[name].residual]
            for name in self.rows
        }
        for block in range(BLOCKS):
            keep = {
                name: [_outside(self.model.problem.runs[part.run].responses[name].time, block, tau) for part in self.model.problem.members(name)]
                for name in self.model.problem.responses
            }  # fmt: skip
            trained = all(any(mask.any() for mask in masks) for masks in keep.values())
            mean, C = self._trained(keep) if trained else (whole, np.zeros((0, 0)))
            for name in self.rows:
                blocks = np.zeros(self.model.linear.rows[name].count, dtype=bool)
                known = self._known(name, C, every) if trained else blocks
                for k, (t, rest) in enumerate(zip(self.rows[name].time, self._moved(name, mean - whole), strict=True)):
                    inside = ~_outside(t, block, 0.0)
                    for own, block_of in zip(found[name][k], (rest, self._near(name, k, t, known)), strict=True):
                        own[inside] = block_of[inside]
        return {name: Unseen.of(own) for name, own in found.items()}


def _outside(time: Array, block: int, gap: float) -> Mask:
    """Rows outside a fifth of a run and so far from its ends."""
    length = np.ptp(time) * (1 + 1e-9)
    low, high = (time[0] + length * (block + end) / BLOCKS for end in (0, 1))
    return np.asarray((time < low - gap) | (time >= high + gap))
