"""A card calibrated against records: the most probable instrument, what is known of it, and how well it predicts."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from compensation.correlated import Noise
from studies.calibration.ahead import BIAS
from studies.calibration.estimates import SILENT, Estimate, estimate, find_groups
from studies.calibration.fit import CardFit, fit, stated_noise, whitened
from studies.calibration.observed import HOUSING, QUADRATURE, RESPONSES, SETTLED, ObservedRun, SettledTable, observe
from studies.calibration.priors import Priors, gather_priors
from studies.calibration.problem import JUMP, SHIFT, CardProblem, State, wide_law
from studies.errors import InputError
from studies.plausible import check_card_frequency
from studies.record import Record
from studies.shown import Shown
from studies.simulation.virtual_gyro import idle_effects

if TYPE_CHECKING:
    from pandas import DataFrame

    from studies.instrument.card import Instrument

Array = NDArray[np.float64]
Progress = Callable[[str], None]
UNITS = {"frequency_Hz": "Hz", "bias_deg_per_h": "°/h", "inverse_q": "1", QUADRATURE: "V", HOUSING: "K", SETTLED: "Hz"}
TURNED_ON = 2.0  # runs whose offsets are so much larger than the card states
CONTRADICTION = 5.0  # runs whose offsets are so much larger than what else the noise makes of a run's mean
MISFIT = 2.0  # residuals that are so much larger than their rows' white noise and what the card states of slow noise
START_STEPS = 3
DIGITS = 12  # of a correlation: the frequency knows two values together a thousand times better than each, and 1 − ρ² is the square
UNSETTLED, UNSETTLED_SD = 0.5, 4.0  # K and standard deviations by which a gyro had not settled at the start


@dataclass(frozen=True)
class Rung:
    """Residuals of one response (its unit, rms of block averages): with the card as shipped, calibrated, and the noise.

    The mean of a run's residual is left out of all three; `offset` is the rms of these means after the calibration.
    """

    as_shipped: float
    calibrated: float
    noise: float
    offset: float


@dataclass(frozen=True)
class LinearResponse:
    """A response as a linear problem about the calibrated values, one array per run (rows are block averages).

    measured − predicted = columns · δ + noise, δ the move of the coordinates from the calibrated point, with prior mean
    `prior_mean` and standard deviation `prior_sd`.

    Attributes
    ----------
    time, residual : per run, arrays (N,)
    columns : per run, arrays (N, p)
    names : p; the card's values, then the departures at the start of each run
    prior_mean, prior_sd : arrays (p,)
    """

    time: tuple[Array, ...]
    residual: tuple[Array, ...]
    columns: tuple[Array, ...]
    names: tuple[str, ...]
    prior_mean: Array
    prior_sd: Array


@dataclass(frozen=True)
class HeldOutRun:
    """How one run that the calibration has not seen is predicted: rms of block averages by response.

    Attributes
    ----------
    path : of its record
    chamber, housing : response -> (as shipped, calibrated); from the chamber alone nothing is refitted, from the housing the
        run's own offset and initial state
    stated : response -> rms standard deviation from the chamber that the calibrated values' own uncertainty leaves, and how
        the campaign's runs began, turned on and their chambers' clocks ran
    noise : response -> rms
    """

    path: str
    chamber: Mapping[str, tuple[float, float]]
    housing: Mapping[str, tuple[float, float]]
    stated: Mapping[str, float]
    noise: Mapping[str, float]


@dataclass(frozen=True, repr=False)
class Calibration(Shown):
    """A card and what records say of it.

    Attributes
    ----------
    card, instrument : Instrument
        As shipped; with the most probable values, their posterior widths and correlations.
    fit : Fit
    estimates : of every uncertain value
    groups : names of values that the data cannot separate
    ladder : response -> Rung
    held_out : HeldOut, where it was asked for
    warnings : in sentences
    """

    drawn_by = "studies.reports.calibration:residual_figure"

    card: "Instrument"
    instrument: "Instrument"
    fit: CardFit
    estimates: tuple[Estimate, ...]
    groups: tuple[tuple[str, ...], ...]
    ladder: Mapping[str, Rung]
    held_out: HeldOutRun | None
    warnings: tuple[str, ...]

    def __repr__(self) -> str:
        told = sum(one.told_by == "data" for one in self.estimates)
        residuals = ", ".join(f"{name} {rung.calibrated:.3g}" for name, rung in self.ladder.items())
        return f"Calibration({self.card.name}: {told} of {len(self.estimates)} values determined by the data; residuals {residuals})"

    def to_frame(self) -> "DataFrame":
        """Return one row an uncertain value, best known first: card, value, interval, shift, width, told by."""
        import pandas as pd

        rows = [asdict(one) | {"told_by": one.told_by} for one in sorted(self.estimates, key=lambda one: one.width)]
        columns = ["unit", "card", "value", "low", "high", "shift_sd", "width", "told_by"]
        return pd.DataFrame(rows).set_index("parameter")[columns]

    def baseline(self, response: str) -> LinearResponse:
        """Return a response as a linear problem, for what else may be in it."""
        problem, state = self.fit.problem, self.fit.state
        if response not in problem.responses or response == SETTLED:
            raise InputError(f"no record was calibrated in {response}; there are {', '.join(problem.responses)}.")
        rows = problem.rows[response]
        starts = [
            f"{name} of run {problem.parts[k].run + 1} ({problem.parts[k].name})" for k, name, _ in problem.starts
        ]
        return LinearResponse(
            time=rows.times,
            residual=tuple(state.residual[response][s] for s in rows.slices),
            columns=tuple(state.slope[response][s] for s in rows.slices),
            names=(*problem.priors.names, *starts),
            prior_mean=-state.point,
            prior_sd=np.ones(problem.count),
        )


def calibrate(
    instrument: "Instrument",
    records: Sequence[Record],
    tables: Sequence[SettledTable] = (),
    hold_out: int | None = None,
    exact: Sequence[str] = (),
    profile: bool = True,
    progress: Progress = lambda _: None,
) -> Calibration:
    """Find the most probable values of a card, given its uncertainties and records of the device.

    Parameters
    ----------
    instrument : Instrument
    records : sequence of Record
        Runs of one device.
    tables : sequence of SettledTable
        Steady-state tables of the same device.
    hold_out : int, optional
        Place of a record that a second calibration, without it, predicts.
    exact : names
        Values of the card that are not to move.
    profile : bool
        Whether intervals follow the likelihood where it is bent.

    Raises
    ------
    InputError, ThermalError, ShellError
        Records or a card that cannot be used.
    """
    if not records and not tables:
        raise InputError("nothing is calibrated without a record or a steady-state table.")
    loop = instrument.loop
    named = RESPONSES if loop is None else (*RESPONSES, QUADRATURE)
    turning = loop is not None and loop.mode == "whole-angle"
    runs, tables = observe(records, named, turning=turning), tuple(tables)
    for record in records:
        if "frequency_Hz" in record:
            check_card_frequency(instrument, record["frequency_Hz"], record.path)
    for table in tables:
        check_card_frequency(instrument, table.frequency, table.path)
    problem = _pose(instrument, runs, tables, exact)
    found = fit(problem, progress=progress)
    held_out = None
    if hold_out is not None and len(records) > 1:
        progress("held-out run")
        held_out = predict_held_out(instrument, runs, tables, hold_out, exact, found)
    if profile:
        progress("intervals")
    estimates = estimate(found, profile)
    ladder = _ladder(found)
    return Calibration(
        instrument,
        _calibrated(instrument, found, estimates),
        found,
        estimates,
        find_groups(found),
        ladder,
        held_out,
        _warn(found, estimates, ladder),
    )


def _pose(
    instrument: "Instrument", runs: tuple[ObservedRun, ...], tables: tuple[SettledTable, ...], exact: Sequence[str]
) -> CardProblem:
    priors = gather_priors(instrument, exact)
    known = {value.name for value in instrument.uncertain}
    for name in exact:
        if name not in known:
            from studies.errors import nearest

            raise InputError(
                f"{instrument.path}: '{name}' is no uncertain value of the card{nearest(name, sorted(known))}"
            )
    return CardProblem(instrument, priors, runs, wide_law(instrument, runs, tables), tables)


def _calibrated(instrument: "Instrument", found: CardFit, estimates: Sequence[Estimate]) -> "Instrument":
    """The card with posterior values, widths, correlations and intervals."""
    priors: Priors = found.problem.priors
    count = len(priors.values)
    moves = priors.slopes(found.point[:count])
    C = moves @ found.covariance[:count, :count] @ moves.T
    sd = np.sqrt(np.diag(C))
    R = np.clip(C / np.outer(sd, sd), -1.0, 1.0)
    np.fill_diagonal(R, 1.0)
    values = {}
    for one, prior in zip(estimates, priors.values, strict=True):
        ends = {"low": prior.low if prior.low != 0.0 else -np.inf, "high": prior.high}
        hard = {name: end for name, end in ends.items() if np.isfinite(end)}
        values[one.parameter] = {"value": one.value, "sd": one.sd, **hard}
    posterior = {
        "names": [one.parameter for one in estimates],
        "correlation": R.round(DIGITS).tolist(),
        "interval": [[one.low, one.high] for one in estimates],
    }
    return instrument.with_values(values | _turn_on(found)).with_table("posterior", posterior)


def _turn_on(found: CardFit) -> dict[str, float]:
    """What the runs show of the bias from turn-on to turn-on, where that is more than the noise within them makes of a mean."""
    if BIAS not in found.noise or len(found.problem.rows[BIAS].times) < 2:
        return {}
    offset = found.noise[BIAS].offset
    stated = found.problem.instrument.noise.bias_turn_on_deg_per_h > 0
    return {"noise.bias_turn_on_deg_per_h": offset} if stated or offset > _usual_mean(found, BIAS) else {}


def _ladder(found: CardFit) -> dict[str, Rung]:
    problem = found.problem
    shipped = problem.evaluate(np.zeros(problem.count), slopes=False)
    return {
        name: Rung(
            _spread(problem, shipped, name),
            _spread(problem, found.state, name),
            noise_rms(found, name),
            float(np.sqrt(np.mean([found.state.residual[name][s].mean() ** 2 for s in problem.rows[name].slices]))),
        )
        for name in problem.responses
    }


def _spread(problem: CardProblem, state: State, name: str) -> float:
    parts = [state.residual[name][s] - state.residual[name][s].mean() for s in problem.rows[name].slices]
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def noise_rms(found: CardFit, name: str, noise: Noise | None = None) -> float:
    """Rms of the noise about the mean of each run, as the fitted levels have it, or others."""
    rows, total, count = found.problem.rows[name], 0.0, 0
    levels = found.noise[name] if noise is None else noise
    for run, t in enumerate(rows.times):
        S = rows.covariance(run, levels)
        total += float(np.trace(S) - S.mean() * len(t))
        count += len(t)
    return float(np.sqrt(total / count))


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
    without = fit(problem, start)
    values = without.point[:count]
    inner = replace(whole.problem, runs=(replace(run, outer=None),), tables=())
    responses = [name for name in inner.responses if name not in (HOUSING, SETTLED)]
    by_housing = dict.fromkeys(responses, (0.0, 0.0))
    both = [_refit_start(inner, at, whole) for at in (np.zeros(count), values)]
    for name in responses:
        by_housing[name] = (_spread(inner, both[0], name), _spread(inner, both[1], name))
    by_chamber: dict[str, tuple[float, float]] = {}
    stated: dict[str, float] = {}
    if run.outer is not None:
        alone = replace(run, inner=run.outer, outer=None)
        outer = replace(whole.problem, runs=(alone,), tables=())
        as_shipped, calibrated = (
            np.concatenate([at, np.zeros(outer.count - count)]) for at in (np.zeros(count), values)
        )
        before, after = outer.evaluate(as_shipped, slopes=False), outer.evaluate(calibrated)
        C = block_diag(without.covariance[:count, :count], _usual_starts(whole, outer))
        spread = {name: np.mean(np.sum(J @ C * J, axis=1)) for name, J in after.slope.items()}
        stated = {name: float(np.sqrt(spread[name] + whole.noise[name].offset ** 2)) for name in responses}
        by_chamber = {name: (_rms(before.residual[name]), _rms(after.residual[name])) for name in responses}
    noise = {name: noise_rms(whole, name) for name in responses}
    return HeldOutRun(run.record.path, by_chamber, by_housing, stated, noise)


def _usual_starts(whole: CardFit, problem: CardProblem) -> Array:
    """Covariance of the free starts of a run of which only the chamber is known: mean squares over the campaign's runs.

    Where the campaign has none of a kind, such as a jump of the chamber, the prior's. What departs behind the housing is
    taken from where the measured housing drives, for frequency sees it there.
    """
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
    noise = {name: replace(whole.noise[name], offset=1e3 * whole.noise[name].white) for name in known.responses}
    start = np.zeros(known.count)
    for _ in range(START_STEPS):
        J, r = whitened(known, known.evaluate(start), noise, known.rows)
        start = np.clip(start + np.linalg.solve(J.T @ J + np.eye(len(start)), J.T @ r - start), *known.ends)
    return known.evaluate(start, slopes=False)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _warn(found: CardFit, estimates: Sequence[Estimate], ladder: Mapping[str, Rung]) -> tuple[str, ...]:
    warnings = []
    if not found.converged:
        warnings.append(
            f"the fit has not converged in {found.steps} steps: its values may still move and are no result."
        )
    for run in found.problem.runs:
        warnings += [f"{run.record.path}: {idle}" for idle in idle_effects(found.problem.instrument, run.inner)]
    warnings += [*_unsettled(found), *_misfit(found, ladder)]
    rows = found.problem.rows
    for name, rung in ladder.items():
        stated = found.problem.instrument.noise.bias_turn_on_deg_per_h if name == BIAS else 0.0
        usual = _usual_mean(found, name)
        if len(rows[name].times) > 1 and rung.offset > max(CONTRADICTION * usual, TURNED_ON * stated):
            warnings.append(
                f"the runs contradict each other in {name}: after the calibration their means lie {rung.offset:.3g}"
                f" {UNITS[name]} (rms) from the model, where the noise within a run explains {usual:.2g}"
                + (f" and the card states {stated:.3g} from turn-on to turn-on" if stated else "")
                + "; are they of one device"
                + ("?" if stated else " and one turn-on?")
            )
    for name, count in found.outliers.items():
        if count:
            warnings.append(
                f"{count} {'block' if count == 1 else 'blocks'} of {name} stood out of the noise and were given less weight."
            )
    stayed = [one.parameter for one in estimates if one.width >= SILENT]
    told = sum(rows[name].count for name in rows)
    if len(estimates) > told:
        warnings.append(
            f"{len(estimates)} uncertain values, but {told} data: {len(stayed)} of the values stayed at their prior:"
            f" {', '.join(stayed)}."
        )
    return tuple(warnings)


def _misfit(found: CardFit, ladder: Mapping[str, Rung]) -> list[str]:
    """Name the responses that the model does not follow: what it leaves stands out of what their rows scatter and the card states."""
    said = []
    for name, rung in ladder.items():
        slow = stated_noise(found.problem.instrument.noise, name) or Noise(0.0)
        usual = noise_rms(found, name, replace(slow, white=found.noise[name].white, offset=0.0))
        if rung.calibrated > MISFIT * usual:
            said.append(
                f"the model does not follow {name}: it leaves {rung.calibrated:.2g} {UNITS[name]} (rms), where the noise of the rows"
                f" is {usual:.2g}; the values carry this misfit. hrg diagnose with --card looks for what the card lacks."
            )
    return said


def _unsettled(found: CardFit) -> list[str]:
    """Name the runs that began in the midst of a change, with the part that was furthest from being settled."""
    problem, count = found.problem, len(found.problem.priors.values)
    spread = np.sqrt(np.diag(found.covariance)[count:])
    furthest: dict[int, tuple[float, str]] = {}
    for (k, name, sd), u, own in zip(problem.starts, found.point[count:], spread, strict=True):
        lump, away, run = name.removeprefix("initial."), float(sd * u), problem.parts[k].run
        known = abs(u) > UNSETTLED_SD * own and abs(away) > UNSETTLED
        if lump in ("base", "resonator") and known and abs(away) > abs(furthest.get(run, (0.0, ""))[0]):
            furthest[run] = away, lump
    return [
        f"{problem.runs[run].record.path}: the gyro had not settled when this run began: its {lump} was {abs(away):.2g} K"
        f" {'warmer' if away > 0 else 'colder'} than its {_settled_by(problem, run)}; a prediction from the chamber alone"
        " does not know of that."
        for run, (away, lump) in sorted(furthest.items())
    ]


def _settled_by(problem: CardProblem, run: int) -> str:
    one = problem.runs[run]
    return "chamber" if one.outer is None and one.inner.boundary == "chamber" else "housing"


def _usual_mean(found: CardFit, name: str) -> float:
    """Standard deviation of a run's mean by the noise without offsets."""
    rows = found.problem.rows[name]
    quiet = replace(found.noise[name], offset=0.0)
    return float(np.sqrt(np.mean([rows.covariance(run, quiet).mean() for run in range(len(rows.times))])))
