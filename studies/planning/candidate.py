"""Candidates for the next run in the linear model of the records: the mean and covariance of their rows beforehand."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from compensation.arrays import Array
from compensation.noise_rows import Whitener
from studies.calibration.observed import RESPONSES, ObservedRun, observe
from studies.calibration.problem import CardProblem
from studies.effects.states import remembered
from studies.inference.background import Background
from studies.inference.hypothesis import Hypothesis
from studies.inference.inferred import Inferred
from studies.inference.linear import Term
from studies.inference.paths import trace
from studies.inference.signatures import Signatures
from studies.planning.programme import Programme
from studies.resonator.law import law_of
from studies.simulation.drive import COMMANDS, drive_by_schedule
from studies.simulation.virtual_gyro import simulate_run

if TYPE_CHECKING:
    from shell.law import FrequencyLaw
    from studies.instrument.card import Instrument

NEXT_DAY = 16 * 3600.0
"""From the end of the last run to the start of the next one, s."""
COARSE, MARGIN = 480, 30.0
"""Rows of a candidate; kelvin beyond its profile over which its law is known."""


@dataclass(frozen=True)
class Candidate:
    """One possible run."""

    programme: Programme
    signatures: Signatures  # of this run alone
    # array (M, p), by the card's values and then by the starts of this run, in rows of white noise of variance 1
    slopes: Array
    whiteners: dict[str, Whitener]  # response -> Whitener
    values: int  # number of the card's values

    def columns(self, term: Term) -> Array:
        """Return the columns of a term in white rows, in units of their priors."""
        found = self.signatures.columns(term.effect, term.shape, term.response)
        parts, members = [], list(term.members)
        for name, whitener in self.whiteners.items():
            rows = sum(place.stop - place.start for place in whitener.slices)
            own = np.zeros((rows, len(term.unit)))  # what other runs began with is not in this one
            if name in found:
                own[:, : len(members)] = found[name][:, members]
            parts.append(whitener(own * term.spread))
        return np.vstack(parts)

    def ahead(self, known: "Known") -> tuple[Array, Array]:
        """Return the mean of the rows about the card at its point, and J √Σ, the starts of the run included."""
        J = np.hstack([self.slopes[:, : self.values], *(self.columns(term) for term in known.model.terms)])
        return J @ known.mean, np.hstack([J @ known.root, self.slopes[:, self.values :]])


@dataclass(frozen=True)
class Known:
    """What the records leave of the card's values and of the coefficients of a model."""

    found: Inferred
    model: Hypothesis

    @cached_property
    def _kept(self) -> tuple[Array, Array]:
        linear = self.found.search.linear
        mean, C = Background(linear, self.model.terms, self.model.noise).posterior
        values = len(linear.problem.priors.values)
        keep = [*range(values), *range(linear.count, len(mean))]
        about = np.concatenate([self.found.numbers.point[:values], np.zeros(len(keep) - values)])
        return mean[keep] - about, C[np.ix_(keep, keep)]

    @property
    def mean(self) -> Array:
        """Mean about the point at which candidates are simulated."""
        return self._kept[0]

    @cached_property
    def root(self) -> Array:
        """Root of the covariance."""
        values, ways = np.linalg.eigh(self._kept[1])
        return np.asarray(ways * np.sqrt(np.maximum(values, 0.0)))


def simulate_candidates(found: Inferred, programmes: Sequence[Programme]) -> list[Candidate]:
    """Send programmes through the card as it was found."""
    old, past = found.search.linear.problem, [path.states for path in found.search.signatures.paths]
    values = len(old.priors.values)
    card = old.instrument_at(found.numbers.point)
    reached = np.concatenate([one.chamber.value for one in programmes])
    low, high = float(reached.min()) - MARGIN, float(reached.max()) + MARGIN
    law = old.law if low > old.law.lowest and high < old.law.highest else law_of(card, low, high)
    start = max(float(states.campaign_time[-1]) for states in past) + NEXT_DAY
    runs = [one.repeats or _simulated(one, card, law) for one in programmes]
    runs = [replace(run, inner=replace(run.inner, start=start)) for run in runs]
    here = CardProblem(old.instrument, old.priors, tuple(runs), law)
    point = np.concatenate([found.numbers.point[:values], np.zeros(here.count - values)])
    predicted = list(here.predictions(point))
    state, out = here.compare(point, predicted), []
    for k, (part, one) in enumerate(zip(here.parts, predicted, strict=True)):
        alone = replace(here, runs=(runs[part.run],))
        path = trace(card, replace(one, derivatives={}), len(old.runs))
        path = replace(path, states=replace(path.states, before=remembered([*past, path.states])[-1]))
        own = [*range(values), *(values + j for j, (of, _, _) in enumerate(here.starts) if of == k)]
        whiteners = {
            name: alone.rows[name].whitener(found.final.noise[name]) for name in part.responses if name in old.responses
        }
        places = {name: here.rows[name].slices[here.members(name).index(part)] for name in whiteners}
        slopes = np.vstack([whiteners[name](state.slope[name][place][:, own]) for name, place in places.items()])
        out.append(Candidate(programmes[part.run], Signatures(alone, point, (path,)), slopes, whiteners, values))
    return out


def _simulated(programme: Programme, card: "Instrument", law: "FrequencyLaw") -> ObservedRun:
    chamber = programme.chamber
    steady = {column: np.full(len(chamber.time), value) for column, value in programme.steady.items()}
    drive = drive_by_schedule(chamber, steady, COARSE / (chamber.end - chamber.start))
    moved = {
        name: (programme.drives[column].at(drive.time - drive.time[0]) * factor) ** power
        for name, (column, factor, power) in COMMANDS.items()
        if column in programme.drives
    }
    drive = replace(drive, commands={**drive.commands, **moved})
    record = simulate_run(card, drive, noise=False, law=law).record
    (run,) = observe([replace(record, path=programme.profile)])
    return replace(
        run, outer=None, responses={name: run.responses[name] for name in RESPONSES if name in run.responses}
    )


def unabsorbed(difference: Array, columns: Array) -> float:
    """Return Δᵀ (1 + J Jᵀ)⁻¹ Δ of white rows."""
    taken = columns.T @ difference
    inside = np.eye(columns.shape[1]) + columns.T @ columns
    return max(float(difference @ difference - taken @ np.linalg.solve(inside, taken)), 0.0)
