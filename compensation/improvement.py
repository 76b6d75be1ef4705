"""How much a compensation improves an output, on the data it was fitted to and on data it has not seen."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from compensation.errors import CompensationError

Run = TypeVar("Run")
Real = NDArray[np.float64]


@dataclass(frozen=True)
class Improvement:
    """Standard deviation of the output about its mean before, and rms after compensation, in the output's unit."""

    before: float
    after: float

    @property
    def ratio(self) -> float:
        """Times by which the output became better."""
        return self.before / self.after


def compare_outputs(before: Real, after: Real) -> Improvement:
    """Return the improvement of an output that should be zero; its mean before counts as removed by calibration."""
    return Improvement(float(np.std(before)), float(np.sqrt(np.mean(after**2))))


def hold_out(
    runs: Sequence[Run], output: Callable[[Run], Real], compensate: Callable[[Sequence[Run], Run], Real]
) -> Improvement:
    """Return the improvement on runs that the compensation has not seen, each left out once.

    Parameters
    ----------
    runs : sequence
        Two runs or more.
    output : callable
        Run to its output.
    compensate : callable
        (Runs to fit, run to compensate) to the compensated output of the latter.

    Raises
    ------
    CompensationError
        With fewer than two runs: nothing would be left to fit.
    """
    if len(runs) < 2:
        raise CompensationError("a held-out improvement needs two runs or more.")
    after = [compensate([*runs[:i], *runs[i + 1 :]], run) for i, run in enumerate(runs)]
    return compare_outputs(np.concatenate([output(run) for run in runs]), np.concatenate(after))
