"""What must be said with a calibration: that it has not converged, that runs contradict each other or the model does not follow."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from compensation.noise import Noise
from studies.calibration.ahead import BIAS
from studies.calibration.estimates import TOLD, Estimate
from studies.calibration.fit import CardFit
from studies.calibration.ladder import Rung, noise_rms, usual_mean
from studies.calibration.noise_levels import stated_noise
from studies.calibration.observed import NEIGHBOURS, SETTLED, UNITS, WORDS
from studies.calibration.problem import CardProblem
from studies.diagnosis.verdict import FAR
from studies.errors import numbered
from studies.instrument.display import display_name
from studies.simulation.virtual_gyro import idle_effects

TURNED_ON = 2.0  # runs whose offsets are so much larger than the card states
CONTRADICTION = 5.0  # runs whose offsets are so much larger than what else the noise makes of a run's mean
MISFIT = 2.0  # residuals that are so much larger than their rows' white noise and what the card states of slow noise
UNSETTLED, UNSETTLED_SD = 0.5, 4.0  # K and standard deviations by which a gyro had not settled at the start


def warn(found: CardFit, estimates: Sequence[Estimate], ladder: Mapping[str, Rung]) -> tuple[str, ...]:
    """Return the warnings of a calibration."""
    warnings = []
    if not found.converged:
        warnings.append(f"the fit did not converge in {found.steps} steps; its values are not final.")
    for run in found.problem.runs:
        warnings += [f"{run.record.path}: {idle}" for idle in idle_effects(found.problem.instrument, run.inner)]
    misfit = _misfit(found, ladder)
    warnings += [*_moved(estimates), *([] if misfit else _unsettled(found)), *misfit]
    rows = found.problem.rows
    for name, rung in ladder.items():
        stated = found.problem.instrument.noise.bias_turn_on_deg_per_h if name == BIAS else 0.0
        usual = usual_mean(found, name)
        if len(rows[name].times) > 1 and rung.offset > max(CONTRADICTION * usual, TURNED_ON * stated):
            warnings.append(
                f"the runs disagree in the {WORDS[name]}: after the calibration their means lie {rung.offset:.3g}{_unit(name)}"
                f" (rms) from the model, but the noise within a run explains only {usual:.2g}"
                + (f" and the card states {stated:.3g} from run to run" if stated else "")
                + (". Are they of one device?" if stated else ". Are they of one device and one turn-on?")
            )
    for name, count in found.outliers.items():
        if count:
            warnings.append(
                f"{numbered(count, 'block')} of the {WORDS[name]} {'is an outlier and was' if count == 1 else 'are outliers and were'} given less weight."
            )
    told = sum(rows[name].count for name in rows)
    if len(estimates) > told:
        warnings.append(f"{told} data points cannot determine {len(estimates)} uncertain values.")
    return tuple(warnings)


def _moved(estimates: Sequence[Estimate]) -> list[str]:
    """Name the values that the data move by more than two of their prior standard deviations, the furthest first."""
    far = sorted((one for one in estimates if abs(one.shift_sd) > FAR), key=lambda one: -abs(one.shift_sd))
    return [
        f"{display_name(one.parameter)} ({one.parameter}) moved by {one.shift_sd:+.1f} of the card's standard deviations, to {one.value:.4g}"
        f" ({one.low:.4g} … {one.high:.4g}): the card is wrong in this value, or in another with the same effect."
        for one in far
    ]


def _unit(name: str) -> str:
    return "" if UNITS[name] == "1" else f" {UNITS[name]}"


def _misfit(found: CardFit, ladder: Mapping[str, Rung]) -> list[str]:
    """Name the responses that the model does not follow: what it leaves stands out of what their rows scatter and the card states."""
    said = []
    for name, rung in ladder.items():
        slow = stated_noise(found.problem.instrument.noise, name) or Noise(0.0)
        usual = noise_rms(found, name, replace(slow, white=found.noise[name].white, offset=0.0))
        most = MISFIT * usual
        if name == SETTLED and NEIGHBOURS * (near := _near(found)) < most:
            usual, most = near, NEIGHBOURS * near
        if rung.calibrated > most:
            own, like = found.noise[name], ""
            if own.markov and not slow.markov:
                like = f" It looks like correlated noise of {own.markov:.2g}{_unit(name)} rms with a correlation time of {own.markov_time:.0f} s; the card states none."
            said.append(
                f"poor fit in the {WORDS[name]}: residual {rung.calibrated:.2g}{_unit(name)} (rms), noise {usual:.2g}.{like} The calibrated values"
                f" absorb part of this misfit; hrg diagnose --card looks for the missing effect."
            )
    return said


def _near(found: CardFit) -> float:
    """Largest noise that neighbouring readings of the tables show, Hz."""
    left, places = found.state.residual[SETTLED], found.problem.rows[SETTLED].slices
    return max(table.between_neighbours(left[own]) for table, own in zip(found.problem.tables, places, strict=True))


def _unsettled(found: CardFit) -> list[str]:
    """Name the runs that the fit begins in the midst of a change, where the data determine it, with the part that was furthest from being settled."""
    problem, count = found.problem, len(found.problem.priors.values)
    spread = np.sqrt(np.diag(found.covariance)[count:])
    furthest: dict[int, tuple[float, str]] = {}
    for (k, name, sd), u, own in zip(problem.starts, found.point[count:], spread, strict=True):
        lump, away, run = name.removeprefix("initial."), float(sd * u), problem.parts[k].run
        known = own < TOLD and abs(u) > UNSETTLED_SD * own and abs(away) > UNSETTLED
        if lump in ("base", "resonator") and known and abs(away) > abs(furthest.get(run, (0.0, ""))[0]):
            furthest[run] = away, lump
    return [
        f"{problem.runs[run].record.path}: the fit needs a {lump} that starts {abs(away):.2g} K"
        f" {'warmer' if away > 0 else 'colder'} than the {_settled_by(problem, run)}, as if the gyro had not settled when the run began."
        " A prediction from the chamber alone does not include this."
        for run, (away, lump) in sorted(furthest.items())
    ]


def _settled_by(problem: CardProblem, run: int) -> str:
    one = problem.runs[run]
    return "chamber" if one.outer is None and one.inner.boundary == "chamber" else "housing"
