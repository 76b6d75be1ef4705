"""How the gyro of a record began: what nobody knows of it, and what the first readings tell.

A run that is simulated begins settled at its first temperature. One that was measured seldom did: each part of its heat path
departs from that by what came before, with the prior of a calibration; readings of frequency, bias and 1/Q make it a posterior.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from compensation.arrays import Array
from compensation.noise import white_rms
from studies.calibration.ahead import spread_along, spread_of_prediction
from studies.calibration.fit import covariance_at, descend, fit
from studies.calibration.observed import MOST_BLOCKS, RESPONSES, observe
from studies.calibration.priors import Priors
from studies.calibration.problem import MOST_SPREAD, CardProblem, departing, wide_law
from studies.errors import InputError
from studies.record import Record, read_record
from studies.simulation.chamber import is_record
from studies.simulation.drive import Drive
from studies.simulation.holes import straight
from studies.simulation.prediction import predict

if TYPE_CHECKING:
    from shell.law import FrequencyLaw
    from studies.instrument.card import Instrument
    from studies.simulation.prediction import Prediction
    from thermal.profile import Profile

INITIAL = "initial."
FEWEST = 5  # blocks of readings


@dataclass(frozen=True)
class Start:
    """Departures of the parts from having settled: the most probable (K), and a root of their covariance (K)."""

    departures: Mapping[str, float]
    root: Array  # array (parts, parts), covariance = root rootᵀ

    @property
    def rows(self) -> list[tuple[str, float, float]]:
        """Every part, its departure and the standard deviation of that, K."""
        widths = np.linalg.norm(self.root, axis=1)
        return [(part, T, float(sd)) for (part, T), sd in zip(self.departures.items(), widths, strict=True)]

    def spread(self, instrument: "Instrument", drive: "Drive", law: "FrequencyLaw") -> dict[str, Array]:
        """Return √diag(J C Jᵀ) of every column of a predicted run, C of its start."""
        return spread_along(instrument, drive, [INITIAL + part for part in self.departures], self.root, law)


def misread(instrument: "Instrument", predicted: "Prediction", law: "FrequencyLaw") -> dict[str, Array]:
    """Return what one draw of the noise of the housing's readings, which drive a run, changes in every column; that of the first is how the run began."""
    drive, read = predicted.drive, predicted.drive.profile.value
    noise = white_rms(read) if drive.boundary == "housing" else 0.0
    draw = np.append(0.0, np.random.default_rng(0).standard_normal(len(read) - 1))
    return _otherwise(instrument, predicted, replace(drive.profile, value=read + noise * draw), law)


def unrecorded(instrument: "Instrument", predicted: "Prediction", law: "FrequencyLaw") -> dict[str, Array]:
    """Return what straight lines over the holes of a record that drives a run, for its curves, change in every column."""
    drive = predicted.drive
    return _otherwise(instrument, predicted, straight(drive.profile, drive.holes), law) if drive.holes else {}


def _otherwise(
    instrument: "Instrument", predicted: "Prediction", profile: "Profile", law: "FrequencyLaw"
) -> dict[str, Array]:
    """Return what another profile changes in every column."""
    found = predict(instrument, replace(predicted.drive, profile=profile), law=law).columns
    return {c: own - predicted.columns[c] for c, own in found.items()}


def begin(
    instrument: "Instrument", run: "str | Record", driven: "Profile | Drive", readings: float
) -> "tuple[Drive, Start]":
    """Let a record, which drives a run, begin as its first `readings` (s) tell; with 0 s settled, and the width is the prior's."""
    if not (isinstance(driven, Drive) and is_record(run)):
        raise InputError(f"{run}: a profile begins settled; only the readings of a record tell how its gyro began.")
    found = find_start(instrument, read_record(run), driven, readings)
    return replace(driven, initial=found.departures), found


def find_start(instrument: "Instrument", record: "Record", drive: "Drive", readings: float = 0.0) -> Start:
    """Find how the gyro of a record, which drives a run, began: by its first `readings` (s) and the values of the card, else by its prior."""
    if not any(record.has_values(name) for name in RESPONSES):
        if readings:
            raise InputError(
                f"{record.path}: no reading of {', '.join(RESPONSES)} tells how the run began; leave out --start."
            )
        parts = departing(instrument, drive)
        return Start(dict.fromkeys(parts, 0.0), MOST_SPREAD * np.eye(len(parts)))
    (run,) = observe([record])
    imposed = run.outer if drive.boundary == "chamber" and run.outer is not None else run.inner
    run = replace(run, inner=imposed, outer=None, kinks={}).explaining(RESPONSES)
    problem = CardProblem(instrument, Priors((), np.eye(0)), (run,), wide_law(instrument, (run,)))
    starts = [
        (k, name.removeprefix(INITIAL), sd)
        for k, (_, name, sd) in enumerate(problem.starts)
        if name.startswith(INITIAL)
    ]
    point, covariance = _read(problem, readings) if readings else (np.zeros(problem.count), np.eye(problem.count))
    own, sd = [k for k, _, _ in starts], np.array([sd for _, _, sd in starts])
    root = np.asarray(np.linalg.cholesky(np.outer(sd, sd) * covariance[np.ix_(own, own)]))
    return Start({part: float(sd * point[k]) for k, part, sd in starts}, root)


def _read(problem: CardProblem, readings: float) -> tuple[Array, Array]:
    """Most probable coordinates and their covariance by first readings, whose level may be off by what the card does not know of it."""
    (run,) = problem.runs
    if readings > (lasts := float(np.ptp(run.inner.time))):
        raise InputError(
            f"{run.record.path}: --start of {readings:g} s is longer than the record, {lasts:g} s; give less."
        )
    first = {name: blocks.until(run.inner.time[0] + readings) for name, blocks in run.responses.items()}
    first = {name: blocks for name, blocks in first.items() if len(blocks.time) >= FEWEST}
    if not first:
        row = float(np.ptp(run.inner.time)) / MOST_BLOCKS
        raise InputError(
            f"{run.record.path}: its first {readings:g} s hold fewer than {FEWEST} means of {row:.3g} s; give --start a longer time."
        )
    seen = replace(problem, runs=(replace(run, responses=first),))
    found = fit(seen)
    known = spread_of_prediction(problem.instrument, run.inner, problem.law)
    noise = {
        name: replace(own, offset=max(own.offset, float(np.sqrt(np.mean(first[name].average(known[name]) ** 2)))))
        for name, own in found.noise.items()
    }
    state = descend(seen, found.state, noise, found.rows)
    return state.point, covariance_at(seen, state, noise, found.rows)
