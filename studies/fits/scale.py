"""The compensation chain of a bell-shaped gyro as a study: runs sorted by what they show, figures after every step."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array
from compensation.bell import BellChain, Warming, apply_chain
from compensation.bell_calibration import BellRun, fit_chain
from compensation.decimation import average_blocks
from compensation.linearity import measure_nonlinearity, same_rate
from compensation.rate_law import CARRIED, LEAST, RateLaw
from compensation.samples import is_regular
from compensation.stability import allan_deviation
from studies.errors import InputError, naming
from studies.fits.misread_scale import Runs, check_agreement, check_late
from studies.fits.scale_law import BLOCKS, SWEPT, read_law, warming_of, without_warming
from studies.models.kinds.scale import RAW
from studies.record import Record
from studies.record.misread import named
from studies.record.rest import LARGEST_REST, MOST_ROWS, TEMPERATURES, choose_column, drop_spikes

STEPS = ("rough", "bias_compensated", "rate_compensated", "temperature_compensated", "filtered")
STEADY = 0.01  # part of the rate by which a rate table may waver and still turn at one rate
SHORT, LONG = 1.0, 100.0  # s, at which the random walk is read: a filter of 5 s changes the first, not the second


@dataclass(frozen=True)
class StepFigures:
    """One step of the chain judged; None where a run is too short."""

    step: str
    nonlinearity: float | None
    at_rest: float | None  # °/s, standard deviation
    turning: float | None  # °/s, the same
    bias_instability: float | None  # °/h at rest, the lowest Allan deviation over 0.664
    random_walk_1s: float | None  # °/√h at rest, read at 1 s
    random_walk_100s: float | None


@dataclass(frozen=True)
class ScaleStudy:
    """The chain, its runs, its figures on them, and rms error (°/s) before and after on blocks left out of the fit."""

    chain: BellChain
    runs: Runs
    output: str
    temperature_column: str
    left_out: int
    figures: list[StepFigures]
    error_before: float
    error_held_out: float
    averaged: bool  # a run was long: the fit and this error are of its block averages
    rough_run: bool = False  # the rough null and scale have a run of their own
    law: RateLaw | None = None
    warming: Warming | None = (
        None  # what the output differs by warming and cooling; the runs and figures are without it
    )
    from_table: tuple[str, ...] = ()  # the kinds of runs that were taken out of a rate table over temperature


def judge_steps(
    chain: BellChain, rates: BellRun, rest: BellRun | None = None, turning: BellRun | None = None
) -> list[StepFigures]:
    """Return the figures of merit after each step, on any runs; after the filter only where rows are even."""
    runs = (rates, rest, turning)
    even = all(is_regular(run.time) for run in runs if run is not None)
    static = chain if even else replace(chain, taps=np.empty(0))
    outputs = [
        None if run is None else apply_chain(static, run.time, run.output, run.temperature, extrapolate=True)
        for run in runs
    ]
    figures = []
    for step in STEPS if even else STEPS[:-1]:
        at_rates, at_rest, at_turning = (None if one is None else np.asarray(getattr(one, step)) for one in outputs)
        steady, nonlinearity = settled_rows(rates.rate, len(chain.taps) if step == "filtered" else 0), None
        assert at_rates is not None
        steady &= np.isfinite(at_rates)  # a dead band tells no rate, and no spread at rest
        at_rest, at_turning = (None if one is None or np.isnan(one).any() else one for one in (at_rest, at_turning))
        if len(np.unique(same_rate(rates.rate)[steady])) > 2:
            nonlinearity = measure_nonlinearity(rates.rate[steady], at_rates[steady])
        spreads = (None if one is None else float(np.std(one)) for one in (at_rest, at_turning))
        allan: tuple[float | None, ...] = (None, None, None)
        if rest is not None and at_rest is not None:
            allan = _read_allan((rest.time[-1] - rest.time[0]) / (len(rest.time) - 1), at_rest)
        figures.append(StepFigures(step, nonlinearity, *spreads, *allan))
    return figures


def settled_rows(rate: Array, rows: int) -> NDArray[np.bool_]:
    """Mark the rows at which the applied rate has been the same for `rows` rows, or since the start of the run."""
    index = np.arange(len(rate))
    begin = np.maximum.accumulate(np.where(np.r_[False, np.diff(same_rate(rate)) != 0], index, 0))
    return np.asarray((index - begin >= rows) | (begin == 0), dtype=bool)


def study_scale(records: Sequence[Record], cutoff: float | None, order: int) -> ScaleStudy:
    """Sort the records, fit the chain, and judge it."""
    output = choose_column(records, RAW, "a fit of the scale")
    column = choose_column(records, TEMPERATURES, "a fit of the scale over temperature")
    sorted_runs: dict[str, tuple[BellRun, str]] = {}
    tables: list[BellRun] = []
    read = [_read_run(record, output, column) for record in records]
    left_out = sum(missing for _, missing in read)
    for record, (run, _) in zip(records, read, strict=True):
        if np.ptp(run.rate) > LARGEST_REST:
            check_late(run, record.path, output)
    _check_applied({record.path: run for record, (run, _) in zip(records, read, strict=True)}, output)
    for record, (run, _) in zip(records, read, strict=True):
        kind = _classify(run, record.path)
        if kind == TABLES or (kind == next(iter(KINDS)) and kind in sorted_runs):
            tables.append(run)
            continue
        if kind in sorted_runs:
            raise InputError(f"{record.path} and {sorted_runs[kind][1]} are both runs {kind}; give only one of them.")
        sorted_runs[kind] = (run, record.path)
    several = next(iter(KINDS))
    law = read_law([*([sorted_runs[several][0]] if several in sorted_runs else []), *tables])
    warming = warming_of(law, [run for run, _ in sorted_runs.values()] + tables)
    if warming:
        sorted_runs = {kind: (without_warming(warming, run), path) for kind, (run, path) in sorted_runs.items()}
        tables = [without_warming(warming, run) for run in tables]
    from_table = []
    for table in (run for run in tables if np.ptp(run.temperature) > SWEPT):
        for kind, run in _parts_of(table).items():
            if kind not in sorted_runs:
                sorted_runs[kind] = (run, "the rate table over temperature")
                from_table.append(kind)
    if several not in sorted_runs:
        raise InputError(f"no record is a run {several}, which {KINDS[several]} needs, nor a rate table; add one.")
    rates, rest, turning = (sorted_runs[kind][0] if kind in sorted_runs else None for kind in KINDS)
    assert rates is not None
    rough = _thin(sorted_runs[ROUGH][0]) if ROUGH in sorted_runs else None
    runs = (rates, rest, turning)
    there = [run for run in runs if run is not None]
    sampling = float(np.median(np.diff((rest or rates).time)))
    if from_table:
        cutoff = None  # parts of a table are no even rows
    if cutoff is not None and not 0 < cutoff < 0.5 / sampling:
        slowest = sorted_runs[several if rest is None else list(KINDS)[1]][1]
        raise InputError(
            f"{slowest}: the FIR filter's cut-off of {cutoff:g} Hz is impossible at an output every {sampling:g} s;"
            f" give --cutoff {0.4 / sampling:.3g}, or --no-filter."
        )
    shortest = min(len(run.time) for run in there)
    if cutoff is not None and order >= shortest:
        raise InputError(f"a FIR filter of order {order} is longer than a run of {shortest} rows; lower --order.")
    thin = (_thin(rates), rest and _thin(rest), turning and _thin(turning))
    found = law.chosen.name if law and len(np.unique(same_rate(rates.rate))) >= LEAST else ""
    form = found if found in CARRIED else None
    if not from_table:
        paths = [sorted_runs[kind][1] if kind in sorted_runs else "" for kind in KINDS]
        check_agreement(thin, paths, column, output, partial(fit_chain, rough=rough, cutoff=None, form=form))
    with naming(", ".join(path for _, path in sorted_runs.values())):
        chain = fit_chain(*thin, rough=rough, cutoff=cutoff, order=order, sampling=sampling, form=form)
        before, after = _hold_out(thin, rough, form)
        figures = judge_steps(chain, rates, rest, turning)
    averaged = sum(len(run.time) for run in thin if run is not None) < sum(len(run.time) for run in there)
    judged = (figures, before, after, averaged, rough is not None, law, warming, tuple(from_table))
    return ScaleStudy(chain, runs, output, column, left_out, *judged)


ROUGH = "at rest and then at one rate"
"""The paper's run for the rough null and scale, equation (33); without one they come from the run of several rates."""
TABLES = "of several rates over temperature"  # for the law over rate and temperature only, as are further ones at one temperature
FEWEST = 20  # rows of a table that make a run
PLATEAU = 0.05  # part of a run's rows from which an applied rate counts as a plateau
KINDS = {
    "of several rates at one temperature": "equation (35)",
    "at rest over temperature": "equation (34)",
    "at one rate over temperature": "equation (36)",
}


def _parts_of(table: BellRun) -> dict[str, BellRun]:
    """Return what a rate table over temperature has of the three runs: near its middle temperature, at rest, at its fastest rate."""
    level = same_rate(table.rate)
    held, counts = np.unique(level, return_counts=True)
    held = held[counts > PLATEAU * level.size / len(held)]
    at_rest = np.abs(level) <= LARGEST_REST
    middle = np.abs(table.temperature - np.median(table.temperature)) < SWEPT / 2
    kinds = dict(zip(KINDS, (middle, at_rest, level == held[np.argmax(np.abs(held))]), strict=True))
    found = {}
    for kind, rows in kinds.items():
        part = BellRun(*(values[rows] for values in (table.time, table.output, table.temperature, table.rate)))
        spread = (
            len(np.unique(level[rows])) > 2 if rows is middle else len(part.time) and np.ptp(part.temperature) > SWEPT
        )
        if spread and len(part.time) > FEWEST:
            found[kind] = part
    return found


def _classify(run: BellRun, path: str) -> str:
    several, at_rest, turning = KINDS
    swept = float(np.ptp(run.temperature)) > SWEPT
    if np.ptp(run.rate) > max(LARGEST_REST, STEADY * np.max(np.abs(run.rate))):
        if swept:
            return TABLES
        levels, counts = np.unique(same_rate(run.rate), return_counts=True)
        held = levels[counts > PLATEAU * len(run.rate)]
        two = len(held) == 2 and float(np.min(np.abs(held))) <= LARGEST_REST
        return ROUGH if two else several
    if not swept:
        raise InputError(f"{path}: neither rate nor temperature changes; it cannot calibrate the chain.")
    return at_rest if abs(np.mean(run.rate)) <= LARGEST_REST else turning


def _check_applied(runs: Mapping[str, BellRun], output: str) -> None:
    """Refuse an applied rate with which an output changes as with one of the opposite sign or another unit; a measured rate by itself, counts beside the other runs."""
    lines = {path: np.polyfit(run.rate, run.output, 1) for path, run in runs.items() if np.ptp(run.rate) > LARGEST_REST}
    null = float(np.median([line[1] for line in lines.values()])) if lines else np.nan
    gains = {
        path: float(lines[path][0] if path in lines else (run.output.mean() - null) / run.rate.mean())
        for path, run in runs.items()
        if np.max(np.abs(run.rate)) > LARGEST_REST
    }
    for path, gain in gains.items():
        others = [1.0] if output != RAW[0] else [own for other, own in gains.items() if other != path]
        times = gain / (float(np.median(others)) or np.nan) if others else np.nan
        if found := named("rate_deg_per_s", times):
            which = " or ".join(gains) if output == RAW[0] and len(gains) == 2 and times < 0 else path
            raise InputError(
                f"{which}: rate_deg_per_s {found[0]}: {output} changes {times:.4g} times as much with it as"
                f" {'with that of the other records' if output == RAW[0] else 'it should'}. {found[1]}."
            )


def _read_run(record: Record, output: str, column: str) -> tuple[BellRun, int]:
    if "rate_deg_per_s" not in record:
        raise InputError(f"{record.path}: the column 'rate_deg_per_s' is missing; add the applied rate, 0 at rest.")
    columns = [record["time_s"], record[output], record[column], record["rate_deg_per_s"]]
    complete = np.all([np.isfinite(values) for values in columns], axis=0)
    complete = drop_spikes(complete, record[output], record[column])
    if np.count_nonzero(complete) < 2:
        raise InputError(f"{record.path}: no rows with {output}, {column} and rate_deg_per_s together.")
    time, raw, temperature, rate = (values[complete] for values in columns)
    return BellRun(time, raw, temperature, rate), int(np.count_nonzero(~complete))


def _thin(run: BellRun) -> BellRun:
    """Return a long run as block averages for the fit, without the blocks in which the applied rate changes."""
    if len(run.time) <= MOST_ROWS:
        return run
    width = (run.time[-1] - run.time[0]) / MOST_ROWS
    level = same_rate(run.rate)
    columns = {
        "output": run.output, "temperature": run.temperature, "rate": run.rate, "level": level,
        "square": level**2,
    }  # fmt: skip
    blocks = average_blocks(run.time, columns, width)
    mean = blocks.columns
    steady = mean["square"] - mean["level"] ** 2 <= 1e-9 * np.max(level**2, initial=1e-30)
    return BellRun(*(values[steady] for values in (blocks.time, mean["output"], mean["temperature"], mean["rate"])))


def _hold_out(runs: Runs, rough: BellRun | None = None, form: str | None = None) -> tuple[float, float]:
    """Rms error (°/s) of the rough and of the compensated rate on held-out fifths of every run, where the output tells it."""
    before, after = [], []
    for block in range(BLOCKS):
        (first, one), *rest = [(None, None) if run is None else _cut(run, block) for run in runs]
        assert first is not None
        chain = fit_chain(first, *(seen for seen, _ in rest), rough=rough, cutoff=None, form=form)
        for run in (unseen for unseen in (one, *(own for _, own in rest)) if unseen is not None):
            result = apply_chain(chain, run.time, run.output, run.temperature, extrapolate=True)
            before.append(result.rough - run.rate)
            after.append(result.temperature_compensated - run.rate)
    known = np.isfinite(np.concatenate(after))  # not within a dead band
    errors = [float(np.sqrt(np.mean(np.concatenate(parts)[known] ** 2))) for parts in (before, after)]
    return errors[0], errors[1]


def _cut(run: BellRun, block: int) -> tuple[BellRun, BellRun]:
    """The run without one fifth, and that fifth."""
    chosen = np.array_split(np.arange(len(run.time)), BLOCKS)[block]
    inside = np.zeros(len(run.time), dtype=bool)
    inside[chosen] = True
    columns = (run.time, run.output, run.temperature, run.rate)
    rest, part = (BellRun(*(values[rows] for values in columns)) for rows in (~inside, inside))
    return rest, part


def _read_allan(step: float, rate: Array) -> tuple[float | None, float | None, float | None]:
    if len(rate) * step < 10 * LONG:
        return None, None, None
    allan = allan_deviation(rate * 3600, step)
    curve = np.interp(np.log([SHORT, LONG]), np.log(allan.tau), np.log(allan.deviation))
    short, long = (np.exp(curve) * np.sqrt([SHORT, LONG]) / 60).tolist()
    return allan.bias_instability[0], short, long
