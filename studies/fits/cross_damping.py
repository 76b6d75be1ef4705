"""A cross-damping calibration as a study: the fit, what it improves, and its improvement on held-out data."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from compensation.arrays import Array
from compensation.cross_damping import CrossDampingModel, RestRun, fit_cross_damping
from compensation.errors import CompensationError
from compensation.improvement import Improvement, compare_outputs, hold_out

LEAST_ROWS = 50
APART = 3.0  # times what is left of a run that is fitted, from which what is left of it held out contradicts the others
BLOCKS = 5  # parts into which a single run is cut, each to be predicted from the others


@dataclass(frozen=True)
class CrossDampingStudy:
    """The model, the runs, the improvement on them, and the improvement on runs or blocks left out."""

    model: CrossDampingModel
    runs: tuple[RestRun, ...]
    training: Improvement
    held_out: Improvement

    @property
    def is_useful(self) -> bool:
        """Whether the compensation improves averages of held-out data."""
        return self.held_out.averages.ratio > 1.0

    @property
    def memory(self) -> float:
        """Largest part of the compensation (rad/s) that is due to the dynamics of eq. (9)."""
        return max(self.model.memory(run.time, run.temperature) for run in self.runs)


def study_cross_damping(
    runs: Sequence[RestRun], *, k: float, zeta: float, calibration_temperature: float = 20.0, order: int = 3
) -> CrossDampingStudy:
    """Fit ζ₁₂(T) and judge it; parameters as for `compensation.cross_damping.fit_cross_damping`."""

    def fit(chosen: Sequence[RestRun]) -> CrossDampingModel:
        return fit_cross_damping(chosen, k=k, zeta=zeta, calibration_temperature=calibration_temperature, order=order)

    def compensate(chosen: Sequence[RestRun], run: RestRun) -> Array:
        return fit(chosen).compensate(run.time, run.rate, run.temperature, extrapolate=True)

    model = fit(runs)
    if len(runs) == 1 and len(runs[0].time) < LEAST_ROWS:
        raise CompensationError(f"{len(runs[0].time)} rows are too few to hold some out; record {LEAST_ROWS} or more.")
    after = [model.compensate(run.time, run.rate, run.temperature) for run in runs]
    training = compare_outputs([run.time for run in runs], [run.rate for run in runs], after)
    if training.rows.before == 0 or training.rows.after == 0:
        raise CompensationError("the output is constant: no error varies with temperature; check the column.")
    pieces = runs if len(runs) > 1 else split_run(runs[0], BLOCKS)
    left = hold_out(pieces, compensate)
    if len(runs) > 1:
        refuse_contradiction(runs, after, left)
    held_out = compare_outputs([piece.time for piece in pieces], [piece.rate for piece in pieces], left)
    return CrossDampingStudy(model, tuple(runs), training, held_out)


def refuse_contradiction(runs: Sequence[RestRun], fitted: Sequence[Array], left: Sequence[Array]) -> None:
    """Refuse runs that at temperatures of the others are worse for what is fitted to these."""
    rows = []
    for k, (run, *outputs) in enumerate(zip(runs, fitted, left, strict=True)):
        others = np.concatenate([other.temperature for other in [*runs[:k], *runs[k + 1 :]]])
        shared = (run.temperature >= others.min()) & (run.temperature <= others.max())
        rows.append(np.stack([run.rate, *outputs])[:, shared])
    before, used, held_out = np.concatenate(rows, axis=1)
    if not before.size:
        return
    spread, *sizes = (
        3600 * np.degrees(size) for size in (np.std(before), *(np.sqrt(np.mean(one**2)) for one in (used, held_out)))
    )
    if sizes[1] > max(spread, APART * sizes[0]):
        raise CompensationError(
            f"they contradict each other: at the same temperatures a fit to the others leaves {sizes[1]:.3g} °/h of a run, {sizes[0]:.3g} where it is fitted"
            f" and {spread:.3g} without any. Is one in another unit, of the opposite sign or of another gyro? Correct it, or leave it out."
        )


def split_run(run: RestRun, parts: int) -> list[RestRun]:
    """Return the run cut into parts of equal length, in order of time."""
    pieces = np.array_split(np.arange(len(run.time)), parts)
    return [RestRun(run.time[piece], run.rate[piece], run.temperature[piece]) for piece in pieces]
