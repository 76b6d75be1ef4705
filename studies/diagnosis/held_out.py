"""What a model is worth: residuals on the records' own rows, and on rows that the fit has not seen."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from studies.diagnosis.baseline import Baseline, Followed, Lagged, Tangent, first_stretches
from studies.diagnosis.campaign import Campaign
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.model import Fit, fit
from studies.diagnosis.noise import SHARES
from studies.diagnosis.problem import pose
from studies.diagnosis.terms import inexact_columns, term_columns
from studies.effects.states import FloatArray

BLOCKS = 5
FEWEST = 40
SETTLED = 0.02
"""Kelvin by which a refitted initial state may still move."""
CARRIED_OFF = 3.0
"""Standard deviations of its level by which noise may carry a run."""
WARMEST = 60.0
"""Kelvin by which a run may start away from equilibrium."""
NEIGHBOUR = 0.1
"""Part of the covered range within which rows that are held out must find the temperature of rows of the fit: a law is not
asked about temperatures that it has never seen."""
KNOWN = 1.5
"""Standard deviation of what is foretold, in parts of the noise, up to which the rest of the record foretells a row."""
FEWEST_FORETOLD = 0.5
"""Part of the rows from which on they speak for the record."""
ALIKE = 0.005
"""Relative difference of two held-out residuals that says nothing."""
LOST = 0.05
"""Relative rise of what is left by which causes are refused together: an offset that is refitted to a run may make some of it."""
KNOWN_START = 0.5
"""Part of the initial state's signature in a block from which on it is refitted there."""


@dataclass(frozen=True)
class Score:
    """Residual rms on the rows of the fit and on rows that it has not seen (None where that cannot be had).

    `foretold` is the part of the rows that the second is about: those that the rows of the fit can foretell.
    """

    residual_rms: float
    held_out_rms: float | None
    foretold: float = 1.0
    parts: "Parts | None" = None


def rms(parts: Sequence[FloatArray]) -> float:
    """Root mean square of what is finite."""
    values = np.concatenate([part[np.isfinite(part)] for part in parts] or [np.empty(0)])
    return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")


class OnRows:
    """A fitted model on the records' own rows."""

    def __init__(self, model: Fit, campaign: Campaign) -> None:
        """Compute its columns on the fine grid."""
        self.model, self.campaign = model, campaign
        self.tangent: Tangent = fine(model.baseline, campaign).tangent()

    def columns(self, k: int) -> tuple[FloatArray, FloatArray]:
        """Return the columns of run `k` on its rows, (rows, p), and what is added to the measured values there."""
        run, view = self.campaign.runs[k], self.tangent.views[k]
        parts = [self.tangent.columns[k]]
        for term in self.model.terms:
            own = term_columns(term, view, 1, self.model.problem.response.column)
            parts.append(own[:, np.flatnonzero(term.effect.spread > 0)])
        parts += [inexact_columns(term, view, self.model.problem, 1) for term in self.model.terms if term.about]
        table = np.concatenate([*parts, self.tangent.shift[k][:, None]], axis=1)
        time = run.states.time
        rows = np.stack([np.interp(run.row_time, time, column) for column in table.T], axis=1)
        return rows[:, :-1], rows[:, -1]

    def free(self, columns: FloatArray, places: Sequence[int], level: float) -> FloatArray:
        """Return the columns that are refitted: some of the model's, and a level."""
        return np.concatenate([columns[:, list(places)], np.ones((columns.shape[0], int(level > 0.0)))], axis=1)

    def residual(
        self, k: int, free: Sequence[int] = (), inside: "np.ndarray | None" = None, level: float = 0.0
    ) -> FloatArray:
        """Return what is left of run `k`; the columns `free`, and a level up to `level`, are refitted on the rows `inside`.

        An initial state far from equilibrium bends the law: it is refitted about where it was found.
        """
        run = self.campaign.runs[k]
        inside = np.ones(run.row_time.size, dtype=bool) if inside is None else inside
        rows, start, names = self, 0.0, self.model.tangent.names
        begin = names.index(f"start@{k}") if f"start@{k}" in names else -1
        limits = {begin: WARMEST} | dict.fromkeys(self.model.starts_of(k), CARRIED_OFF * CONSTANTS["inexact"])
        most = np.array([limits.get(place, np.inf) for place in free] + [level] * (level > 0.0))
        for _ in range(4):
            columns, shift = rows.columns(k)
            coefficients = self.model.solved.coefficients.copy()
            coefficients[list(free)] = 0.0
            rest = (run.row_responses[self.model.problem.response.column] + shift - columns @ coefficients)[inside]
            known = np.isfinite(rest)
            own = self.free(columns[inside], free, level)
            if not own.size or known.sum() <= own.shape[1]:
                return np.asarray(rest)
            found = _within(own[known], rest[known], most)
            rest = rest - own @ found
            places = [n for n, place in enumerate(free) if place == begin]
            if not places or abs(found[places[0]] - start) < SETTLED:
                break
            start = float(found[places[0]])
            rows = self._started(k, start)
        return np.asarray(rest)

    def uncertainty(
        self, k: int, free: Sequence[int], inside: "np.ndarray | None" = None, level: float = 0.0
    ) -> FloatArray:
        """Return the standard deviation of what is foretold of run `k`, in parts of the noise, `free` refitted there.

        A level is refitted as well where what is unknown of the run's level is within its limit.
        """
        columns = self.columns(k)[0]
        columns = columns if inside is None else columns[inside]
        solved, noise = self.model.solved, self.model.problem.noise
        covariance = np.delete(np.delete(solved.covariance, list(free), axis=0), list(free), axis=1)
        other = np.delete(columns, list(free), axis=1)
        mean = other.mean(axis=0)
        own = self.free(columns, free, level if mean @ covariance @ mean <= level**2 else 0.0)
        own = np.linalg.qr(own[:, own.any(axis=0)])[0]
        other = other - own @ (own.T @ other)
        spread = np.einsum("ij,jk,ik->i", other, covariance, other)
        row = noise.rows + noise.floor + SHARES[solved.share] * noise.bases[solved.kind].within
        return np.asarray(np.sqrt(np.maximum(spread, 0.0) / (solved.variance * row)))

    def temperature(self, k: int) -> FloatArray:
        """Return the temperature of run `k` on its rows, K."""
        run = self.campaign.runs[k]
        return np.interp(run.row_time, run.states.time, self.tangent.views[k].seen.resonator)

    def known(self, keep: Sequence["np.ndarray"]) -> FloatArray:
        """Return the temperatures of the steps of the grid that were kept, sorted, K."""
        parts = []
        for run, view, own in zip(self.campaign.runs, self.tangent.views, keep, strict=True):
            parts.append(np.interp(run.time[own], run.states.time, view.seen.resonator))
        return np.sort(np.concatenate(parts))

    def _started(self, k: int, start: float) -> "OnRows":
        """Return the same model with run `k` linearised about another initial state, K."""
        baseline = self.model.baseline
        if not isinstance(baseline, Lagged) or baseline.warmer is None:
            return self
        fading = baseline.states[k].with_lag(baseline.tau).fading
        warmer, starts = list(baseline.warmer), list(baseline.starts)
        warmer[k] = warmer[k] + (start - starts[k]) * fading
        starts[k] = start
        moved = replace(baseline, warmer=tuple(warmer), starts=tuple(starts))
        return OnRows(replace(self.model, baseline=moved), self.campaign)


def _within(columns: FloatArray, rest: FloatArray, most: FloatArray) -> FloatArray:
    """Least squares, no coefficient beyond its limit: no gyro starts so far from equilibrium, no noise has such a level."""
    found = np.linalg.lstsq(columns, rest, rcond=None)[0]
    limited = np.clip(found, -most, most)
    if np.any(limited != found):
        held = np.isfinite(most)
        limited[~held] = np.linalg.lstsq(columns[:, ~held], rest - columns[:, held] @ limited[held], rcond=None)[0]
    return np.asarray(limited)


def fine(baseline: Baseline, campaign: Campaign) -> Baseline:
    """Return the baseline on the fine grid."""
    if isinstance(baseline, Followed):
        return replace(
            baseline,
            group=1,
            reading=baseline.whole,
            instead=tuple(_finer(campaign, baseline.instead)),
            missed=tuple(_finer(campaign, baseline.missed)),
        )
    return replace(baseline, group=1)  # type: ignore[type-var]


def _finer(campaign: Campaign, parts: Sequence[FloatArray]) -> list[FloatArray]:
    from scipy.interpolate import interp1d

    return [
        np.asarray(
            interp1d(run.time, part, axis=0, bounds_error=False, fill_value=(part[0], part[-1]))(run.states.time), float
        )
        for run, part in zip(campaign.runs, parts, strict=True)
    ]


def residuals(model: Fit, campaign: Campaign) -> list[FloatArray]:
    """Return what a model leaves of every run on its own rows."""
    rows = OnRows(model, campaign)
    return [rows.residual(k) for k in range(len(campaign.runs))]


def own_columns(model: Fit, k: int) -> list[int]:
    """Return which columns belong to run `k` alone: its record's offset and its initial state, of effects with memory too."""
    first = first_stretches([view.fine for view in model.tangent.views])[k]
    own = {place for place, name in enumerate(model.tangent.names) if name.endswith(f"@{k}")}
    own |= {place for place, name in enumerate(model.tangent.names) if name == f"offset@{first}"}
    return sorted(own) + model.starts_of(k)


def level_of(model: Fit) -> float:
    """Return how far the noise of a model may carry a whole run, beside the level which the model gives it; 0 if nowhere."""
    if any(name.startswith("offset@") for name in model.tangent.names):
        return 0.0
    solved, problem = model.solved, model.problem
    basis = problem.noise.bases[solved.kind]
    means = [
        basis.rotate(np.where(problem.run == k, 1.0 / max(np.sum(problem.run == k), 1), 0.0))
        for k in set(problem.run.tolist())
    ]
    variance = np.mean([mean**2 @ basis.eigenvalues for mean in means])
    return CARRIED_OFF * float(np.sqrt(solved.variance * SHARES[solved.share] * variance))


def score(model: Fit, campaign: Campaign, like: "Parts | None" = None, judge: Fit | None = None) -> Score:
    """Return training and held-out residual, the latter of the rows that the model can foretell, or another one, `like`.

    One record is left out at a time, the rest is fitted anew; of the record that was left out only its own offset and
    initial state are refitted, and a level where the noise has one, that of `judge` where another model knows it better.
    With one record, blocks in time are left out, one thermal constant more on both sides. Rows at temperatures that the
    rest does not come near are not asked for.
    """
    training = rms(residuals(model, campaign))
    parts = (
        by_record(model, campaign, level_of(judge or model)) if len(campaign.records) > 1 else by_block(model, campaign)
    )
    parts = _of(parts, like)
    foretold = _share(parts)
    return Score(training, _rms_or_none(parts) if foretold >= FEWEST_FORETOLD else None, foretold, parts)


def score_both(plain: Fit, final: Fit, campaign: Campaign) -> tuple[Score, Score]:
    """Return the scores of a baseline and of the model with causes beside it, on rows that the latter can foretell."""
    extended = score(final, campaign, judge=final)
    return score(plain, campaign, extended.parts, final), extended


def is_worse(before: Score, after: Score) -> bool:
    """Whether a model leaves more than the baseline, on rows that were held out or, where there are none, on its own."""
    pairs = (before.held_out_rms, after.held_out_rms), (before.residual_rms, after.residual_rms)
    one, two = pairs[0] if None not in pairs[0] else pairs[1]
    return bool(one is not None and two is not None and two > one * (1.0 + LOST))


Parts = list[tuple[FloatArray, "np.ndarray"]]
"""What is left of rows that were held out, and which of them the rows of the fit can foretell."""


@dataclass(frozen=True)
class Compared:
    """Held-out residuals of a model and of another one, on the same rows; `sure` where the parts agree which is smaller."""

    before: float
    after: float
    sure: bool

    @property
    def pays(self) -> bool:
        """Whether the second is smaller."""
        return self.after < self.before


def compare(one: Parts | None, two: Parts | None) -> Compared | None:
    """Compare two models on the rows that both can foretell, or else that the second can; None where they are few.

    Rows that the first cannot foretell speak for the second where it is nearer to them. They do not speak against it: that the
    first came near them was chance, for it said that it did not know them. A difference is sure where its sum over the parts is
    larger than its scatter from part to part, and not a matter of digits.
    """
    if one is None or two is None:
        return None
    both: Parts = [(rest, a & b) for (rest, a), (_, b) in zip(one, two, strict=True)]
    if not (fair := _share(both) >= FEWEST_FORETOLD):
        both = [(rest, b) for (rest, _), (_, b) in zip(one, two, strict=True)]
    if _share(both) < FEWEST_FORETOLD:
        return None
    other = _of(two, both) or []
    before, after = _rms_or_none(both), _rms_or_none(other)
    if before is None or after is None or (not fair and after > before):
        return None
    gains = np.array([_squares(own) - _squares(its) for own, its in zip(both, other, strict=True)])
    sure = abs(after - before) > ALIKE * before and abs(gains.sum()) > float(np.sqrt(np.sum(gains**2)))
    return Compared(before, after, bool(sure))


def _squares(part: tuple[FloatArray, "np.ndarray"]) -> float:
    rest, near = part
    return float(np.nansum(np.where(near, rest, 0.0) ** 2))


def _of(parts: Parts | None, like: Parts | None) -> Parts | None:
    """Return what is left with the rows that another model can foretell."""
    if parts is None or like is None:
        return parts
    return [(rest, near) for (rest, _), (_, near) in zip(parts, like, strict=True)]


def _rms_or_none(parts: Parts | None) -> float | None:
    value = rms([rest[near] for rest, near in parts or []])
    return value if np.isfinite(value) else None


def _share(parts: Parts | None) -> float:
    if not parts:
        return 1.0
    finite = [np.isfinite(rest) for rest, _ in parts]
    asked = sum(int((own & near).sum()) for own, (_, near) in zip(finite, parts, strict=True))
    return asked / max(sum(int(own.sum()) for own in finite), 1)


def by_record(model: Fit, campaign: Campaign, level: float = 0.0) -> Parts | None:
    """Leave one record out at a time; a level of its own, up to `level`, is refitted."""
    out: Parts = []
    for record in campaign.records:
        keep = [np.full(run.time.shape, run.record != record) for run in campaign.runs]
        rows = _trained(model, campaign, keep)
        if rows is None:
            return None
        known = rows.known(keep)
        for k, run in enumerate(campaign.runs):
            if run.record == record:
                own = own_columns(rows.model, k)
                near = _near(rows.temperature(k), known) & (rows.uncertainty(k, own, level=level) <= KNOWN)
                out.append((rows.residual(k, own, level=level), near))
    return out


def by_block(model: Fit, campaign: Campaign) -> Parts | None:
    """Leave one block of every run out at a time, with a gap on both sides."""
    gap = getattr(model.baseline, "tau", None) or model.tangent.views[0].fine.tau
    out: Parts = []
    longest = max(float(np.ptp(run.row_time)) for run in campaign.runs)
    if longest / BLOCKS < 2.0 * campaign.step or (len(campaign.runs) == 1 and longest < 4.0 * gap):
        return None
    for block in range(BLOCKS):
        ends = [
            tuple(run.row_time[0] + np.ptp(run.row_time) * part / BLOCKS for part in (block, block + 1))
            for run in campaign.runs
        ]
        keep = [
            (run.time < low - gap) | (run.time > high + gap)
            for run, (low, high) in zip(campaign.runs, ends, strict=True)
        ]
        rows = _trained(model, campaign, keep)
        if rows is None:
            return None
        known = rows.known(keep)
        for k, run in enumerate(campaign.runs):
            low, high = ends[k]
            inside = (run.row_time >= low) & (run.row_time < high + (1e-9 if block < BLOCKS - 1 else 1.0))
            if inside.any():
                own = _start_within(rows, k, inside)
                near = _near(rows.temperature(k)[inside], known) & (rows.uncertainty(k, own, inside) <= KNOWN)
                out.append((rows.residual(k, own, inside), near))
    return out


def _near(temperature: FloatArray, known: FloatArray) -> "np.ndarray":
    """Which temperatures have a known one within a part of the range that both cover."""
    if not known.size:
        return np.zeros(temperature.shape, dtype=bool)
    range_ = max(known[-1], temperature.max()) - min(known[0], temperature.min())
    after = np.clip(np.searchsorted(known, temperature), 1, max(known.size - 1, 1))
    nearest = np.minimum(
        np.abs(temperature - known[after - 1]), np.abs(temperature - known[np.minimum(after, known.size - 1)])
    )
    return np.asarray(nearest <= NEIGHBOUR * range_)


def _trained(model: Fit, campaign: Campaign, keep: Sequence["np.ndarray"]) -> OnRows | None:
    if sum(int((own & kept).sum()) for own, kept in zip(model.problem.present, keep, strict=True)) < FEWEST:
        return None
    problem = pose(campaign, model.problem.response.column, model.problem.span.tau, keep)
    problem = replace(problem, sigma=model.problem.sigma, level=model.problem.level)
    # The delay that every model tolerates is nothing that rows could teach: it stays where it is. So do the sizes of the effects:
    # rows that do not show an effect leave it open, and found anew, its size would vanish with its uncertainty.
    baseline = model.baseline
    if isinstance(baseline, (Lagged, Followed)) and baseline.delay is None:
        baseline = replace(baseline, delay=model.values()["delay"])
    terms = [term if term.about else replace(term, named=False) for term in model.terms]  # exact where it was
    return OnRows(fit(problem, baseline, terms, 4, model.solved.scales, release=False, sized=True), campaign)


def _start_within(rows: OnRows, k: int, inside: "np.ndarray") -> list[int]:
    """Return the initial state where a block holds most of it: other rows know next to nothing of it."""
    names = rows.model.tangent.names
    if f"start@{k}" not in names:
        return []
    place = names.index(f"start@{k}")
    start = rows.columns(k)[0][:, place]
    return [place] if np.linalg.norm(start[inside]) >= KNOWN_START * np.linalg.norm(start) else []
