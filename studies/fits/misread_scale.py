"""Records of rates that contradict each other: a thermometer in °F, an output in another unit or late, another gyro."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TypeAlias

import numpy as np
import scipy

from compensation.arrays import Array
from compensation.bell import BellChain, apply_chain
from compensation.bell_calibration import BellRun
from compensation.errors import CompensationError
from compensation.noise import white_rms
from studies.errors import InputError
from studies.record.misread import misreadings
from studies.record.one_gyro import NEXT, OTHERWISE

Runs: TypeAlias = tuple[BellRun, BellRun | None, BellRun | None]
"""Of several rates at one temperature; at rest, and at one rate, over temperature."""
Fit: TypeAlias = Callable[[BellRun, BellRun | None, BellRun | None], BellChain]

QUIET = 5.0  # times by which noise at rest and turning, or in the heat, may differ
LATE = 2.0  # s, from which an output counts as late, more than a filter or a rate table is
ROWS = 20000  # rows that show it
CLEAR = 5.0  # times what the runs leave by themselves, and
FAR = 5e-3  # part of the largest rate, that a contradiction leaves


def check_late(run: BellRun, path: str, output: str) -> None:
    """Refuse an output that follows the applied rate by a line only if it is moved in time."""
    time = np.linspace(run.time[0], run.time[-1], min(run.time.size, ROWS))
    x, y = np.interp(time, run.time, run.rate), np.interp(time, run.time, run.output)
    alike = np.abs(scipy.signal.correlate(y - y.mean(), x - x.mean(), method="fft"))
    by = int(np.argmax(alike)) - (time.size - 1)  # steps by which the output is behind
    late = by * (time[1] - time[0])
    if abs(late) < LATE or abs(by) > time.size // 2:
        return
    moved, kept = (x[: time.size - by], y[by:]) if by > 0 else (x[-by:], y[:by]), (x[abs(by) :], y[abs(by) :])
    if _off_line(*moved) < OTHERWISE * min(_off_line(x, y), _off_line(*kept)):
        raise InputError(
            f"{path}: {output} is {abs(late):.3g} s {'behind' if late > 0 else 'ahead of'} rate_deg_per_s, as by another clock:"
            " moved so, it is a line of the rate. Move one of the columns in time."
        )


def check_agreement(runs: Runs, paths: Sequence[str], column: str, output: str, fit: Fit) -> None:
    """Refuse runs that one chain does not hold for, though it does for each: by the reading that mends it, else by what they leave."""
    rates, *rest = runs
    there = [k for k, run in enumerate(runs) if run is not None]
    as_read, noise = _left(runs, fit), white_rms(rates.output)
    if len(there) == 1:
        return
    read: dict[str, Callable[[BellRun], BellRun]] = {
        f"{column} is in °F": lambda run: replace(run, temperature=(run.temperature - 32.0) / 1.8),
        f"{column} is of the opposite sign": lambda run: replace(run, temperature=-run.temperature),
    }
    for words, times in misreadings(output).items():
        read[f"{output} {words}"] = partial(_multiplied, times=times)
    tried = [
        (_left(_with(runs, k, change(run)), fit), f"{paths[k]}: {words}")
        for k, run in enumerate(runs)
        if run is not None
        for words, change in read.items()
        if noise / QUIET <= white_rms(change(run).output) <= QUIET * noise
    ]
    best = min(tried)[0]
    if best < OTHERWISE * as_read:
        which = "; or ".join(words for left, words in tried if left < NEXT * best)
        raise InputError(
            f"{which}: read so, one chain holds in all records, to {best:.2g} instead of {as_read:.2g} °/s (rms). Correct the column."
        )
    gain = float(np.polyfit(rates.rate, rates.output, 1)[0])
    alone = [_off_line(run.temperature, run.output, 2) / gain for run in rest if run is not None]
    own = float(np.sqrt(np.mean(np.square([_left((rates, None, None), fit), *alone]))))
    if np.isfinite(as_read) and as_read > max(CLEAR * own, FAR * float(np.max(np.abs(rates.rate)))):
        without, odd = min((_left(_with(runs, k, None), fit), paths[k]) for k in there[1:])
        named = (
            f" Without {odd} it leaves {without:.2g} °/s." if len(there) > 2 and without < OTHERWISE * as_read else ""
        )
        raise InputError(
            f"{', '.join(paths[k] for k in there)} contradict each other: one chain leaves {as_read:.2g} °/s (rms), and their own curves"
            f" {own:.2g} °/s.{named} Are all of one gyro, at the temperatures that they say? Leave out what is not."
        )


def _left(runs: Runs, fit: Fit) -> float:
    """Error (°/s) that one chain leaves, rms of runs that count alike; infinite where none can be fitted."""
    there = [run for run in runs if run is not None]
    try:
        chain = fit(*runs)
        told = [apply_chain(chain, run.time, run.output, run.temperature, extrapolate=True) for run in there]
    except CompensationError:
        return np.inf
    errors = (one.temperature_compensated - run.rate for one, run in zip(told, there, strict=True))
    known = [error[np.isfinite(error)] for error in errors]  # within a dead band none is told
    return float(np.sqrt(np.mean([np.mean(error**2) for error in known if error.size])))


def _with(runs: Runs, k: int, run: BellRun | None) -> Runs:
    rates, rest, turning = (run if j == k else own for j, own in enumerate(runs))
    assert rates is not None
    return rates, rest, turning


def _multiplied(run: BellRun, times: float) -> BellRun:
    return replace(run, output=times * run.output)


def _off_line(x: Array, y: Array, order: int = 1) -> float:
    """Rms of what a polynomial leaves."""
    return float(np.std(y - np.polyval(np.polyfit(x, y, order), x)))
