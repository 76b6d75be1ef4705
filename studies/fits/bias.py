"""A bias calibration from record files: both ways of selecting terms, held-out scores, Allan deviations."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np

from compensation.bias import FREQUENCY, TEMPERATURE, BiasFit, BiasRun, average_run, rate_run
from compensation.bias_memory import choose_memory, free_memory
from compensation.bias_selection import (
    HeldOutRows,
    Method,
    NoHeldOut,
    bias_stability,
    fit_bias,
    score_held_out,
    score_path,
)
from compensation.errors import CompensationError
from compensation.memory import NO_MEMORY, Memory
from studies.errors import InputError, naming
from studies.models import Model, compensate, source_of
from studies.models.kinds.bias import OUTPUTS, save_bias
from studies.record import COMPENSATED, Record
from studies.record.one_gyro import records_of_one_gyro
from studies.record.rest import TEMPERATURES, choose_column, require_rest
from studies.record.stability import Stability, read_stability, unbroken

Over = Literal["auto", "frequency", "temperature"]
METHODS: tuple[Method, ...] = ("guarded", "paper")
AVERAGING, ROWS = 100.0, 150  # s; rows that a run should leave
FEWEST = 3  # averages over AVERAGING that a run has at least: stability is their standard deviation
LOWEST_FREQUENCY = 100.0  # Hz
FEWEST_FOR_ALLAN = 30  # samples below which an Allan deviation says nothing


@dataclass(frozen=True)
class Judged:
    """One method: stability (before, after) on the runs it was fitted to, and its held-out score, if any."""

    method: Method
    fit: BiasFit
    training: tuple[float, float]
    held_out: HeldOutRows | None
    path_scores: tuple[float, ...]  # held-out deviation of each model on the path over that of a constant, if any

    @property
    def training_gain(self) -> float:
        """Improvement on the data that were fitted."""
        return self.training[0] / self.training[1]


@dataclass(frozen=True)
class BiasStudy:
    """Everything about one calibration: runs, both methods, `model` of the chosen one, Allan before and after."""

    output: str
    column: str  # what the bias is a function of
    runs: tuple[BiasRun, ...]
    judged: tuple[Judged, ...]
    model: Model
    before: Stability | None  # None of short runs
    after: Stability | None
    allan_step: float  # s, of the series
    no_held_out: str  # why there is no held-out score

    def by(self, method: Method) -> Judged:
        """Return what one method made of the runs."""
        return next(j for j in self.judged if j.method == method)


def study_bias(
    records: Sequence[Record], method: Method = "guarded", width: float | None = None, window: float | None = None, *,
    causal: bool = False, over: Over = "auto", progress: Callable[[str], None] = lambda _: None,
) -> BiasStudy:  # fmt: skip
    """Fit the bias model to records of a gyro at rest while its temperature changes; `width` and `window` of averages and rate in s."""
    records = records_of_one_gyro(records, progress)
    check_lengths(records)
    width = choose_width(records) if width is None else width
    if window is not None and window < 3 * width:
        raise InputError(f"--window {window:g}: the rate is taken over three averages of {width:g} s (--average) or more; give {3 * width:g} or more, or average less.")  # fmt: skip
    output, column = find_output(records), find_state(records, over)
    window = 3 * width if window is None else window
    variable = FREQUENCY if column == "frequency_Hz" else TEMPERATURE

    @lru_cache(maxsize=4096)
    def run_of(k: int, lag: float, play: float, start: float) -> BiasRun:
        with naming(records[k].path or "record"):
            return rate_run(averaged[k], window, causal=causal, memory=Memory(lag, play), start=start)

    def prepare(memory: Memory) -> list[BiasRun]:
        starts = memory.starts or (0.0,) * len(records)
        runs = [run_of(k, memory.lag, memory.play, float(start)) for k, start in enumerate(starts)]
        return [replace(run, memory=memory) for run in runs]

    everywhere = ", ".join(record.path or "record" for record in records)
    progress(f"averaging {sum(map(len, records)):,} rows over {width:g} s")
    averaged = []
    for record in records:
        with naming(record.path or "record"):
            averaged.append(average_run(record["time_s"], record[column], record[output], width, variable))
    runs = prepare(NO_MEMORY)
    if variable is TEMPERATURE:
        progress("looking for a lag and a loop between thermometer and bias")
        with naming(everywhere):
            runs = prepare(choose_memory(prepare))
    judged, why = [], ""
    for name in METHODS:
        progress(f"selecting terms stepwise ({name})")
        with naming(everywhere):
            fit = free_memory(fit_bias(runs, name), prepare)
        try:
            held_out = score_held_out(runs, name)
        except NoHeldOut as error:
            held_out, why = None, str(error)
        spreads = np.array([[bias_stability(run), bias_stability(run, fit.left(run))] for run in runs])
        before, after = np.sqrt(np.mean(spreads**2, axis=0)).tolist()  # on the fitted runs, root mean square over them
        judged.append(Judged(name, fit, (before, after), held_out, _score_path(runs, fit)))
    fit = next(j.fit for j in judged if j.method == method)
    sources, made_by = tuple(map(source_of, records)), f"hrg-workbench, hrg fit bias --method {method}"
    model = save_bias(fit, runs[0], output, column, sources, made_by)
    progress("Allan deviation before and after")
    longest = max(records, key=len)
    after = compensate(model, longest, extrapolate=True)[f"{COMPENSATED}{output}"]
    step, series = unbroken(longest["time_s"], {"before": longest[output], "after": after})
    long = min(map(len, series.values())) >= FEWEST_FOR_ALLAN
    spectra = [read_stability(values, step, 0.9) if long else None for values in series.values()]
    return BiasStudy(output, column, tuple(runs), tuple(judged), model, spectra[0], spectra[1], step, why)


def check_lengths(records: Sequence[Record]) -> None:
    """Refuse a run too short for the averages by which its stability is judged, as one whose time is in hours is."""
    for record in records:
        lasts = float(np.ptp(record["time_s"]))
        if lasts < FEWEST * AVERAGING:
            hint = " Is its time in hours or minutes? time_s is in seconds; 'hrg import' converts." * (
                lasts < AVERAGING
            )
            raise InputError(
                f"{record.path or 'record'}: lasts {lasts:.3g} s; bias stability is judged on averages over {AVERAGING:g} s, of which a run needs {FEWEST} or more.{hint}"
            )


def choose_width(records: Sequence[Record]) -> float:
    """Return AVERAGING, or what makes ROWS averages of the longest run where that is less (s)."""
    longest = max(float(np.ptp(record["time_s"])) for record in records)
    return min(AVERAGING, float(f"{longest / ROWS:.1g}"))


def find_output(records: Sequence[Record]) -> str:
    """Return the zero-rate output column that all records have."""
    for record in records:
        require_rest(record, "bias is fitted to runs at rest. Use hrg fit scale for runs with an applied rate.")
    return choose_column(records, tuple(OUTPUTS), "a bias")


def find_state(records: Sequence[Record], over: Over = "auto") -> str:
    """Return the column that the bias is a function of: the frequency, or a temperature where there is none."""
    if over == "temperature" or (over == "auto" and not all("frequency_Hz" in record for record in records)):
        return choose_column(records, TEMPERATURES, "a bias over temperature (no frequency in every record)")
    for record in records:
        where = record.path or "record"
        if "frequency_Hz" not in record:
            raise InputError(f"{where}: the column 'frequency_Hz' is missing; use --over temperature.")
        frequency = record["frequency_Hz"]
        typical = float(np.nanmedian(frequency)) if np.isfinite(frequency).any() else LOWEST_FREQUENCY
        if 0 < typical < LOWEST_FREQUENCY:
            raise InputError(f"{where}: frequency_Hz around {typical:g} is no resonator's; is it in kHz?")
    return "frequency_Hz"


def _score_path(runs: Sequence[BiasRun], fit: BiasFit) -> tuple[float, ...]:
    try:
        return fit.held_out or (score_path(runs, fit.selection) if fit.selection else ())
    except CompensationError:  # nothing can be held out, which `no_held_out` tells
        return ()
