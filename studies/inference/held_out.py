"""Predictions of rows that a model has not seen, on the records' own rows.

One record is left out at a time, and its own start and offset are refitted; of a single record, or beside effects that other runs know
nothing of, a fifth of each run with a gap of one thermal constant on both sides.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from compensation.noise import Noise
from compensation.spikes import find_spikes
from studies.inference.model import Linear, Term, solve_posterior
from studies.inference.signatures import Signatures
from studies.simulation.prediction import predict

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
OWN_OFFSET = "bias_deg_per_h"
BLOCKS = 5
FREE = 1e3
"""Prior standard deviation of the offset of a run that is held out, in parts of the noise of its mean."""
KNOWN = 1.5
"""Standard deviation of a prediction, in parts of the noise, up to which the rest of the records predict a row."""
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
        self.linear, self.signatures, self.terms, self.noise = linear, signatures, tuple(terms), noise
        self.problem = linear.problem

    def kept(self, mean: Array) -> Kept:
        """Split coordinates into the card's and the coefficients of the terms."""
        count, coefficients, at = self.linear.count, [], self.linear.count
        for term in self.terms:
            coefficients.append(mean[at : at + len(term.unit)] * term.spread)
            at += len(term.unit)
        point = np.clip(mean[:count], *self.problem.ends)
        values = len(self.problem.priors.values)
        return Kept(np.concatenate([self.problem.priors.inside(point[:values]), point[values:]]), tuple(coefficients))

    def residuals(self, numbers: Kept, runs: Sequence[int] | None = None) -> dict[str, Rows]:
        """Return what is left of every response on the rows of some runs."""
        instrument = self.problem.instrument_at(numbers.point)
        law = self.problem.law_at(instrument)
        found: dict[str, tuple[list[Array], list[Array]]] = {name: ([], []) for name in self.problem.responses}
        for k, part in enumerate(self.problem.parts):
            if runs is not None and part.run not in runs:
                continue
            record, drive = self.problem.runs[part.run].record, self.problem.drive_at(numbers.point, k)
            columns = dict(predict(instrument, drive, (), law).columns)
            for term, values in zip(self.terms, numbers.coefficients, strict=True):
                for name, change in self.change(term, values, k).items():
                    columns[name] = columns[name] + change
            rows = np.asarray(record["time_s"], dtype=float)
            for name in part.responses:
                own = np.asarray(record[name], dtype=float)
                good = np.isfinite(own) & ~find_spikes(own)
                rest = own[good] - np.interp(rows[good], drive.time, columns[name])
                if name == OWN_OFFSET:  # from turn-on to turn-on
                    rest = rest - rest.mean()
                found[name][0].append(rows[good] - rows[0])
                found[name][1].append(rest)
        return {name: Rows(tuple(t), tuple(r)) for name, (t, r) in found.items() if r}

    def change(self, term: Term, values: Array, k: int) -> dict[str, Array]:
        """Return what a term makes of the responses of a part at its predicted rows."""
        path = self.signatures.paths[k]
        own = np.asarray(term.effect.columns(path.states, term.shape, term.response))[:, term.members] @ values
        found = path.changes(term.effect, own[:, None], term.response)
        return {name: change[:, 0] for name, change in found.items() if name in self.problem.parts[k].responses}

    def mean(self) -> Array:
        """Most probable coordinates."""
        X, r, _ = self.linear.whitened(self.terms, self.noise)
        return solve_posterior(np.vstack(list(X.values())), np.concatenate(list(r.values())))[0]

    def held_out(self, by_record: bool) -> dict[str, float | None]:
        """Return the rms of what is left of rows that were held out; None where too few of them can be predicted."""
        whole = self.mean()
        rows = self.residuals(self.kept(whole))
        return self._by_record(whole, rows) if by_record else self._by_block(whole, rows)

    def _moved(self, rows: Mapping[str, Rows], name: str, step: Array) -> list[Array]:
        """Return what is left on the rows of each part after a step of the coordinates: what the step does is smooth."""
        change, level = self.linear.columns(self.terms, name) @ step, self.linear.rows[name]
        found = []
        for t, rest, own, at in zip(rows[name].time, rows[name].residual, level.slices, level.times, strict=True):
            left = rest - np.interp(t, at - at[0], change[own])
            found.append(left - left.mean() if name == OWN_OFFSET else left)
        return found

    def _by_record(self, whole: Array, rows: Mapping[str, Rows]) -> dict[str, float | None]:
        squares: dict[str, list[Array]] = {name: [] for name in rows}
        for run in range(len(self.problem.runs)):
            keep = {
                name: [
                    np.full(len(self.problem.runs[part.run].responses[name].time), part.run != run)
                    for part in self.problem.members(name)
                ]
                for name in self.problem.responses
            }
            mean, _ = self._trained(keep)
            step = self._restarted(mean, run, keep) - whole
            for name in rows:
                parts = zip(self.problem.members(name), self._moved(rows, name, step), strict=True)
                squares[name] += [rest**2 for part, rest in parts if part.run == run]
        return {name: float(np.sqrt(np.mean(np.concatenate(own)))) if own else None for name, own in squares.items()}

    def _trained(self, keep: Mapping[str, Sequence[Mask]]) -> tuple[Array, Array]:
        seen = {name: own for name, own in keep.items() if any(mask.any() for mask in own)}
        X, r, _ = self.linear.whitened(self.terms, self.noise, seen)
        return solve_posterior(np.vstack(list(X.values())), np.concatenate(list(r.values())))

    def _restarted(self, mean: Array, run: int, keep: Mapping[str, Sequence[Mask]]) -> Array:
        """Refit start and offset of a run that was held out."""
        problem = self.problem
        first = len(problem.priors.values)
        own = [first + i for i, (k, _, _) in enumerate(problem.starts) if problem.parts[k].run == run]
        mean = mean.copy()
        if not own:
            return mean
        mean[own] = 0.0
        seen = {name: [~mask for mask in masks] for name, masks in keep.items()}
        seen = {name: masks for name, masks in seen.items() if any(mask.any() for mask in masks)}
        noise = {
            name: replace(level, offset=FREE * level.white / self.linear.rows[name].span ** 0.5)
            for name, level in self.noise.items()
        }
        X, r, _ = self.linear.whitened(self.terms, noise, seen)
        columns, rest = np.vstack(list(X.values())), np.concatenate(list(r.values()))
        mean[own] = solve_posterior(columns[:, own], rest - columns @ mean)[0]
        return mean

    def _by_block(self, whole: Array, rows: Mapping[str, Rows]) -> dict[str, float | None]:
        tau = self.signatures.span.tau
        squares: dict[str, list[Array]] = {name: [] for name in self.problem.responses}
        asked = dict.fromkeys(self.problem.responses, 0)
        for block in range(BLOCKS):
            keep = {
                name: [_outside(self.problem.runs[part.run].responses[name].time, block, tau) for part in self.problem.members(name)]
                for name in self.problem.responses
            }  # fmt: skip
            if not all(any(mask.any() for mask in masks) for masks in keep.values()):
                continue
            mean, C = self._trained(keep)
            for name in rows:
                X = self.linear.columns(self.terms, name)
                spread = np.sqrt(np.einsum("ij,jk,ik->i", X, C, X))
                level = self.linear.rows[name]
                noise = np.sqrt(
                    np.concatenate([np.diag(level.covariance(k, replace(self.noise[name], offset=0.0))) for k in range(len(level.times))])
                )  # fmt: skip
                known = spread < KNOWN * noise
                moved = self._moved(rows, name, mean - whole)
                for t, rest, at, place in zip(rows[name].time, moved, level.times, level.slices, strict=True):
                    inside = ~_outside(t, block, 0.0)
                    near = known[place][np.clip(np.searchsorted(at - at[0], t), 0, len(at) - 1)]
                    asked[name] += int(inside.sum())
                    squares[name].append(rest[inside & near] ** 2)
        found: dict[str, float | None] = {}
        for name, parts in squares.items():
            seen = np.concatenate(parts) if parts else np.empty(0)
            enough = seen.size >= FEWEST * max(asked[name], 1)
            found[name] = float(np.sqrt(np.mean(seen))) if enough and seen.size else None
        return found


def _outside(time: Array, block: int, gap: float) -> Mask:
    """Rows outside a fifth of a run and so far from its ends."""
    length = np.ptp(time) * (1 + 1e-9)
    low, high = (time[0] + length * (block + end) / BLOCKS for end in (0, 1))
    return np.asarray((time < low - gap) | (time >= high + gap))
