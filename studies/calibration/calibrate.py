"""A card calibrated against records: the most probable instrument, what is known of it, and how well it predicts."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from compensation.arrays import Array
from shell.constants import zero_Celsius
from shell.errors import ShellError
from studies.calibration.agreement import keep_agreeing, put_back
from studies.calibration.apart import fit_explained
from studies.calibration.estimates import Estimate, OfEstimates, estimate, find_groups, over_the_wave, posterior_card
from studies.calibration.fit import CardFit, descend, fit
from studies.calibration.ladder import Rung, build_ladder, noise_rms, spread_of
from studies.calibration.levels import LEVELS, turn_on, with_level_spread, without_idle_levels
from studies.calibration.misreading import check_loss, check_readings
from studies.calibration.observed import HOUSING, QUADRATURE, RESPONSES, SETTLED, ObservedRun, SettledTable, observe
from studies.calibration.priors import Priors, check_exact, gather_priors
from studies.calibration.problem import CardProblem, State, wide_law
from studies.calibration.remarks import warn
from studies.calibration.settled import SettledComparison, compare_settled
from studies.errors import InputError
from studies.record import Record, with_bias
from studies.record.one_gyro import records_of_one_gyro
from studies.record.plausible import check_card_frequency
from studies.record.repeated import repeats
from studies.simulation.variations import JUMP, SHIFT

if TYPE_CHECKING:
    from studies.instrument.card import Instrument

Progress = Callable[[str], None]


@dataclass(frozen=True)
class HeldOutRun:
    """How one held-out run is predicted: rms of block averages by response."""

    path: str  # of its record
    # chamber, housing: response -> (as shipped, calibrated); from the chamber alone nothing is refitted, from the
    # housing the run's own offset and initial state
    chamber: Mapping[str, tuple[float, float]]
    housing: Mapping[str, tuple[float, float]]
    # response -> rms standard deviation from the chamber that the calibrated values' own uncertainty leaves, and how
    # the campaign's runs began, turned on and their chambers' clocks ran
    stated: Mapping[str, float]
    noise: Mapping[str, float]  # response -> rms


@dataclass(frozen=True, repr=False)
class Calibration(OfEstimates):
    """A card and what records say of it."""

    drawn_by = "studies.reports.calibration:residual_figure"

    # card, instrument: As shipped; with the most probable values, their posterior widths and correlations.
    card: "Instrument"
    instrument: "Instrument"
    fit: CardFit
    estimates: tuple[Estimate, ...]  # of every uncertain value
    groups: tuple[tuple[str, ...], ...]  # names of values that the data cannot separate
    ladder: Mapping[str, Rung]  # response -> Rung
    held_out: HeldOutRun | None  # HeldOut, where it was asked for
    warnings: tuple[str, ...]  # in sentences
    settled: tuple[SettledComparison, ...] = ()  # level and slope of every table beside the card as shipped

    def __repr__(self) -> str:
        residuals = ", ".join(f"{name} {rung.calibrated:.3g}" for name, rung in self.ladder.items())
        return f"Calibration({self.card.name}: {self.determined}; residuals {residuals})"

    @property
    def unsaved(self) -> str | None:
        """Why it makes no card: rows of a table follow no law, it has not converged, has learnt nothing, or needs values that the card all but excludes."""
        for one in self.settled:
            if one.scatter is not None:
                if one.scatter.row is not None:
                    return f"row {one.scatter.row + 1} of {one.path} does not follow the others. Correct or remove it"
                return f"the rows of {one.path} follow no law of temperature"
        if not self.fit.converged:
            return "the fit did not converge. Keep more values fixed (--exact), or leave out the run that differs most"
        if all(one.told_by == "prior" for one in self.estimates):
            return "the data determine none of the card's values"
        if self.excluded:
            return f"{self.excluded}. Give the value that may be wrong a tolerance in the card, or check that the data are of this gyro"
        return None


def calibrate(
    instrument: "Instrument",
    records: Sequence[Record],
    tables: Sequence[SettledTable] = (),
    hold_out: int | None = None,
    exact: Sequence[str] = (),
    profile: bool = True,
    progress: Progress = lambda _: None,
    keep: bool = True,
) -> Calibration:
    """Find the most probable values of a card, given its uncertainties and records of the device.

    Args:
        hold_out: Place of a record that a second calibration, without it, predicts.
        exact: Values of the card that are not to move.
        keep: Whether values with which the data agree stay as the card has them (`keep_agreeing`).
        profile: Whether intervals follow the likelihood where it is bent.
    """
    if not records and not tables:
        raise InputError("no data given; calibration needs a record or a steady-state table.")
    given = [with_bias(record) for record in records]
    doubts: list[str] = []
    records = records_of_one_gyro(given, doubts.append)
    if hold_out is not None:  # the one that a repeated record repeats
        held = given[hold_out % len(given)]
        hold_out = next((k for k, one in enumerate(records) if repeats(one, held)), 0)
    tables = [one for k, one in enumerate(tables) if not any(one.repeats(other) for other in tables[:k])]
    loop = instrument.loop
    named = RESPONSES if loop is None else (*RESPONSES, QUADRATURE)
    turning = loop is not None and loop.mode == "whole-angle"
    runs, tables = observe(records, named, turning=turning), tuple(tables)
    for record in records:
        check_loss(instrument, record)
        if "frequency_Hz" in record:
            check_card_frequency(instrument, record["frequency_Hz"], record.path)
    for table in tables:
        check_card_frequency(instrument, table.frequency, table.path)
    try:
        problem = _pose(instrument, runs, tables, exact)
    except ShellError:
        check_readings(instrument, records)  # a temperature beyond the law may be one in °F
        raise
    check_readings(instrument, records, problem.law)
    settled = compare_settled(problem)
    likeliest, apart = fit_explained(problem, progress)
    likeliest = without_idle_levels(likeliest)
    found, held_out = with_level_spread(likeliest), None
    if hold_out is not None and len(records) > 1:
        progress("held-out run")
        held_out = predict_held_out(instrument, found.problem.runs, tables, hold_out, exact, found)
    if profile:
        progress("computing the intervals")
    estimates, kept = estimate(found, profile), keep_agreeing(found) if keep else found
    if kept is found:
        _, point, _, covariance = over_the_wave(problem.priors, found.point, found.covariance)
    else:
        estimates, found, point, covariance = put_back(estimates, kept), kept, kept.point, kept.covariance
    levels: dict[str, object] = {key: found.noise[name].offset for name, key in LEVELS.items() if name in found.noise}
    found = replace(found, noise=likeliest.noise)
    ladder = build_ladder(found)
    return Calibration(
        instrument,
        posterior_card(
            instrument, problem.priors, point, covariance, estimates, turn_on(found), levels | _covered(problem)
        ),
        found,
        estimates,
        find_groups(problem.priors, found.covariance),
        ladder,
        held_out,
        (
            *apart,
            *doubts,
            *(one.scatter.sentence for one in settled if one.scatter),
            *warn(found, estimates, ladder),
        ),
        settled,
    )


def _covered(problem: CardProblem) -> dict[str, object]:
    """Temperatures that the polynomial of a card stands on, of these records and of those that its card knows, and the responses that none of them has."""
    if problem.instrument.polynomial is None:
        return {}
    told = problem.instrument.part("posterior")
    known = told.covered_degC or ()
    every = [*(run.inner.profile.value for run in problem.runs), *(one.temperature for one in problem.tables)]
    ends = [*known, *(float(end(T)) - zero_Celsius for T in every for end in (np.min, np.max))]
    covered = {"covered_degC": [round(min(ends), 2), round(max(ends), 2)]}
    unseen = [name for name in told.unseen if name not in problem.responses]
    return covered | ({"unseen": unseen} if unseen else {})


def _pose(
    instrument: "Instrument", runs: tuple[ObservedRun, ...], tables: tuple[SettledTable, ...], exact: Sequence[str]
) -> CardProblem:
    check_exact(instrument, exact)
    priors = gather_priors(instrument, exact)
    return CardProblem(
        instrument, priors, runs, wide_law(instrument, runs, tables), tables, instrument.polynomial is None
    )


def predict_held_out(
    instrument: "Instrument",
    runs: tuple[ObservedRun, ...],
    tables: tuple[SettledTable, ...],
    place: int,
    exact: Sequence[str],
    whole: CardFit,
) -> HeldOutRun:
    """Calibrate without one run and predict it."""
    seen = tuple(run for k, run in enumerate(runs) if k != place % len(runs))
    run = runs[place % len(runs)]
    count = len(whole.problem.priors.values)
    problem = replace(whole.problem, runs=seen)
    start = np.concatenate([whole.point[:count], np.zeros(problem.count - count)])
    without = with_level_spread(without_idle_levels(fit(problem, start)))
    values = keep_agreeing(without).point[:count]
    inner = replace(whole.problem, runs=(replace(run, outer=None),), tables=())
    responses = [name for name in inner.responses if name not in (HOUSING, SETTLED)]
    by_housing = dict.fromkeys(responses, (0.0, 0.0))
    both = [_refit_start(inner, at, whole) for at in (np.zeros(count), values)]
    for name in responses:
        by_housing[name] = (spread_of(inner, both[0], name), spread_of(inner, both[1], name))
    by_chamber: dict[str, tuple[float, float]] = {}
    stated: dict[str, float] = {}
    if run.outer is not None:
        alone = replace(run, inner=run.outer, outer=None)
        outer = replace(whole.problem, runs=(alone,), tables=())
        as_shipped, calibrated = (
            np.concatenate([at, np.zeros(outer.count - count)]) for at in (np.zeros(count), values)
        )
        before, after = outer.evaluate(as_shipped, slopes=False), outer.evaluate(calibrated)
        C = scipy.linalg.block_diag(without.covariance[:count, :count], _usual_starts(whole, outer))
        spread = {name: np.mean(np.sum(J @ C * J, axis=1)) for name, J in after.slope.items()}
        stated = {name: float(np.sqrt(spread[name] + without.noise[name].offset ** 2)) for name in responses}
        by_chamber = {name: (_rms(before.residual[name]), _rms(after.residual[name])) for name in responses}
    noise = {name: noise_rms(whole, name) for name in responses}
    return HeldOutRun(run.record.path, by_chamber, by_housing, stated, noise)


def _usual_starts(whole: CardFit, problem: CardProblem) -> Array:
    """Covariance of the free starts of a run of which only the chamber is known: mean squares over the campaign's runs, else the prior's."""
    count, seen = len(whole.problem.priors.values), whole.problem
    units = np.array([sd for _, _, sd in seen.starts])
    point, C = units * whole.point[count:], np.outer(units, units) * whole.covariance[count:, count:]
    square = np.outer(point, point) + C
    names = [name for _, name, _ in problem.starts]
    begin = [name for name in names if name.startswith("initial.")]
    found = np.diag([sd**2 for _, _, sd in problem.starts])
    usual = []
    for run in range(len(seen.runs)):
        at: dict[str, int] = {}
        for place, (k, name, _) in enumerate(seen.starts):
            if seen.parts[k].run == run:
                at.setdefault(name, place)
        if set(begin) <= set(at):
            usual.append(square[np.ix_(*2 * [[at[name] for name in begin]])])
    if usual:
        own = [names.index(name) for name in begin]
        found[np.ix_(own, own)] = np.mean(usual, axis=0)
    for kind in (JUMP, SHIFT):
        others = [square[i, i] for i, (_, name, _) in enumerate(seen.starts) if name.startswith(kind)]
        for place, name in enumerate(names):
            if name.startswith(kind) and others:
                found[place, place] = np.mean(others)
    scale = np.array([sd for _, _, sd in problem.starts])
    return np.asarray(found / np.outer(scale, scale))


def _refit_start(problem: CardProblem, point: Array, whole: CardFit) -> State:
    """Residuals with the values of a point and the run's own initial state refitted."""
    instrument = problem.instrument_at(point)
    known = replace(problem, instrument=instrument, priors=Priors((), np.eye(0)), law=problem.law_at(instrument))
    noise = {
        name: replace(whole.noise[name], offset=1e3 * whole.noise[name].white / known.rows[name].span ** 0.5)
        for name in known.responses
    }
    return descend(known, known.evaluate(np.zeros(known.count)), noise, known.rows)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
