"""How much a compensation improves an output, fitted and held out: on rows, and on averages over 100 s, which show slow errors."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from compensation.arrays import Array
from compensation.decimation import average_groups
from compensation.errors import CompensationError

Run = TypeVar("Run")
AVERAGING, FEWEST = 100.0, 3  # seconds of the averages; how many have a standard deviation


@dataclass(frozen=True)
class Change:
    """Standard deviation of the output about its mean before, and rms after compensation, in the output's unit."""

    before: float
    after: float

    @property
    def ratio(self) -> float:
        """Times by which the output became better."""
        return self.before / self.after


@dataclass(frozen=True)
class Improvement:
    """The change of an output on its rows and on averages over 100 s (the rows, where they are slower than that)."""

    rows: Change
    averages: Change


def compare_outputs(times: Sequence[Array], before: Sequence[Array], after: Sequence[Array]) -> Improvement:
    """Return the improvement of an output that should be zero; its mean before counts as removed by calibration."""
    means: tuple[list[Array], list[Array]] = ([], [])
    for t, *outputs in zip(times, before, after, strict=True):
        _, block = np.unique(np.floor((t - t[0]) / AVERAGING), return_inverse=True)
        for found, y in zip(means, outputs, strict=True):
            found.append(average_groups(y, block))
    averages = [np.concatenate(found) for found in means]
    if averages[0].size < FEWEST:
        raise CompensationError(f"an improvement is judged on averages over {AVERAGING:g} s, of which it needs {FEWEST} or more, not {averages[0].size}; record longer.")  # fmt: skip
    return Improvement(_compare(np.concatenate(before), np.concatenate(after)), _compare(*averages))


def hold_out(runs: Sequence[Run], compensate: Callable[[Sequence[Run], Run], Array]) -> list[Array]:
    """Return the compensated output of each run, which was held out."""
    if len(runs) < 2:
        raise CompensationError("a held-out improvement needs two runs or more.")
    return [compensate([*runs[:i], *runs[i + 1 :]], run) for i, run in enumerate(runs)]


def _compare(before: Array, after: Array) -> Change:
    return Change(float(np.std(before)), float(np.sqrt(np.mean(after**2))))
