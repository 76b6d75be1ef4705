"""Records that a command takes together: each once, without what a stuck logger wrote, of one gyro, and all read in one way."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from compensation.noise import white_rms
from studies.errors import InputError
from studies.record import Record
from studies.record.misread import mend_by, other_units
from studies.record.one_law import ANY_PATH, LEVELLED, Course, Followed, Law, course_of, likeliest
from studies.record.repeated import drop_repeats
from studies.record.rest import DRIVING, check_record, without_spikes, without_stuck

HOUSING, CHAMBER, _ = DRIVING
FREQUENCY, BIAS, RATE = "frequency_Hz", "bias_deg_per_h", "measured_rate_deg_per_s"
ONE_GYRO, STEEPEST = 5e-3, 3e-4  # relative, and 1/K: what one gyro does from run to run, and over temperature at most
TIMES = {
    "by 2: a counter of half periods, or a divider": 2.0,
    "by 1000: one is in kHz": 1e3,
    "by 2 π: one is in rad/s": 2.0 * np.pi,
}
AS_NOISE, AS_CHANGES = 2.0, 4.0  # times by which noise and changes may differ from what a unit makes of another run's
WELL = 0.01  # of an output's changes (rms): where one law leaves no more, all runs are read alike
CLEAR = 2.0  # times white noise (squares) that it must leave besides
OTHERWISE = 0.4  # of what one law leaves (rms): left with one run read otherwise; of 210 campaigns by others none had less than 0.7
ALONE, FAR = 0.1, 5e-5  # of the same: left with a run apart; and by how much of the frequency it is then
APART, NEXT = 0.25, 2.0
"""Likewise by a law of any heat path, which leaves less; and times as much with any other run apart."""
FARTHER = 3e-4  # of the frequency, from which on that law tells: jumps and ageing are less
SHIFTS = tuple(sign * 900.0 * 2.0**k for k in range(4) for sign in (1, -1))  # s, by which one of two clocks may be off
FINER = tuple(2.0 ** (k / 8) for k in range(-8, 9))
EVEN = 1.5  # times by which a shift that is none of these must be better
KEPT = 0.6  # likewise, of the rows that a moved run still has
BEND = 0.1  # of the changes of a frequency: a temperature in another unit would bend its law to its needs
LAW, ONE, CUBIC = replace(ANY_PATH, bend=BEND), Law(bend=BEND), replace(ANY_PATH, cubic=True)
SOONER = 100.0  # s, by which a bias at most follows the resonator's own frequency; other parts are further lags


def records_of_one_gyro(records: Sequence[Record], say: Callable[[str], None]) -> list[Record]:
    """Return the records that a command may take together, and say what is left out or doubted."""
    return runs_of_one_gyro(records, say)[0]


def runs_of_one_gyro(records: Sequence[Record], say: Callable[[str], None]) -> tuple[list[Record], int | None]:
    """Return the same, and which of them lies apart from the law of the others."""
    kept, said = drop_repeats(records)
    said += filter(None, map(check_record, kept))
    kept = [without_stuck(record) for record in kept]
    seen = [without_spikes(record) for record in kept]
    check_one_gyro(seen)
    check_one_unit(seen)
    odd = run_apart(seen)
    check_one_law(seen, odd and odd[0])
    if odd is not None:
        k, away = odd
        said.append(
            f"{_path(kept, k)}: {FREQUENCY} is {away:+.2g} Hz from what the other records have at the same temperatures:"
            " another gyro, or something done between the runs? If so, leave it out."
        )
    for sentence in said:
        say(sentence)
    return kept, odd and odd[0]


def check_one_gyro(records: Sequence[Record]) -> None:
    """Refuse records of which one has another frequency than any gyro of the others."""
    levels = []
    for record in records:
        if FREQUENCY in record and (known := np.isfinite(f := record[FREQUENCY])).any():
            T = next(
                (own[known & np.isfinite(own)] for name in DRIVING if (own := record.columns.get(name)) is not None),
                f[:0],
            )
            level, warm = float(np.median(f[known])), float(np.median(T)) if T.size else np.nan
            levels.append((level, warm, float(np.ptp(f[known])) / level, record.path or "a record"))
    usual = float(np.median([level for level, *_ in levels])) if levels else np.nan
    for one, other in combinations(levels, 2):
        moved = STEEPEST * abs(one[1] - other[1])
        allowed = ONE_GYRO + (moved if np.isfinite(moved) else one[2] + other[2])
        apart = abs(float(np.log(one[0] / other[0])))
        if apart > allowed:
            (odd, warm, _, path), (level, warmth, _, first) = sorted(
                (one, other), key=lambda own: -abs(float(np.log(own[0] / usual)))
            )
            at, there = (f" at {T:.3g} °C" if np.isfinite(T) else "" for T in (warm, warmth))
            words = next((words for words, times in TIMES.items() if abs(abs(np.log(times)) - apart) < allowed), "")
            raise InputError(
                f"{path}: frequency_Hz is about {odd:.6g} Hz{at}, in {first} about {level:.6g} Hz{there}:"
                f" no gyro changes so much{words and f' ({words})'}. The records are of different gyros, or one is in another unit: give those of one."
            )


def check_one_unit(records: Sequence[Record]) -> None:
    """Refuse a bias whose noise (of a row of 1 s) and changes are in one record those of the others in another unit."""
    sizes, records = [], [record for record in records if BIAS in record and len(record) > 1]
    for record in records:
        known = record[BIAS][np.isfinite(record[BIAS])]
        white = white_rms(known)
        changes = float(np.sqrt(max(float(np.var(known)) - white**2, 0.0))) if known.size else 0.0
        sizes.append((white * float(np.sqrt(np.median(np.diff(record["time_s"])))), changes))
    for k in range(len(records) if len(records) > 1 else 0):
        others = np.median(sizes[:k] + sizes[k + 1 :], axis=0)
        for unit, factor in other_units(BIAS).items():
            noise, changes = factor * np.array(sizes[k]) / np.maximum(others, 1e-300)
            if 1 / AS_NOISE < noise < AS_NOISE and 1 / AS_CHANGES < changes < AS_CHANGES:
                times, size = f"{max(factor, 1 / factor):.6g}", "less" if factor > 1 else "more"
                raise InputError(
                    f"{_path(records, k)}: {BIAS} scatters and changes {times} times {size} than in the other records, as in {unit}."
                    f" {mend_by(factor)}, or leave the record out if it is of another gyro."
                )


def check_one_law(records: Sequence[Record], odd: int | None = None) -> None:
    """Refuse a run that follows the law of the others only with a column read otherwise: in °F, of the opposite sign, exchanged, or moved in time.

    The frequency follows the temperatures, the housing its chamber, and a bias the frequency, or the temperatures where there is none;
    one whose frequency lies apart (`odd`) does not.
    """
    bias, drive = _bias_of(records), _drive_of(records)
    own = next((name for name in (FREQUENCY, *DRIVING) if len(_courses(records, name, bias)[1]) > 1), "")
    for pair in ((drive, FREQUENCY), (CHAMBER, HOUSING)):
        _check_pair(records, *pair)
    _check_pair([record for k, record in enumerate(records) if k != odd], own, bias)


def _check_pair(records: Sequence[Record], drive: str, output: str) -> None:
    members, runs = _courses(records, drive, output)
    if len(runs) < 2 or _holds_well(runs, as_read := _follow(runs, drive, output), 0.0):
        return
    readings: list[tuple[str, Sequence[Course]]] = []
    if drive != FREQUENCY and output != HOUSING:
        readings += [
            (f"{drive} is in °F", [replace(run, drive=(run.drive - 32.0) / 1.8) for run in runs]),
            (f"{drive} is of the opposite sign", [replace(run, drive=-run.drive) for run in runs]),
        ]
        readings += [
            (f"{drive} is exchanged with {other}", there)
            for other in DRIVING
            if other != drive and len(there := _courses(records, other, output)[1]) == len(runs)
        ]
    if output not in (FREQUENCY, HOUSING):
        readings.append((f"{output} has the opposite sign", [replace(run, output=-run.output) for run in runs]))
    tried = [
        (_follow(_with(runs, k, other), drive, output), k, words)
        for words, others in readings
        for k, other in enumerate(others)
    ]
    if not _holds_well(runs, as_read):
        tried += [one for one in _moved(runs, as_read, drive, output) if one < min(tried, default=(as_read,))]
    k = _better(runs, as_read, [one for one, *_ in tried]) if tried else None
    if k is None:
        return
    told: dict[str, list[str]] = {}
    for one, run, words in tried:
        if one.left < NEXT * tried[k][0].left:
            told.setdefault(words, []).append(_path(records, members[run]))
    which = "; or ".join(f"{' or '.join(paths)}: {words}" for words, paths in told.items())
    raise InputError(
        f"{which}: read so, one law of {drive} holds in all runs. Correct the column, and others of that file if they are alike,"
        " or leave the record out if it is of another gyro."
    )


def _moved(runs: Sequence[Course], as_read: Followed, drive: str, output: str) -> list[tuple[Followed, int, str]]:
    """Return the run that one law holds with if two of its columns were logged by clocks a quarter of an hour or more apart, if there is one."""

    def move(k: int, by: float) -> tuple[Followed, int, float, list[Course]] | None:
        both = runs[k].earlier(by)
        return both and (_follow(_with(runs, k, both[0]), drive, output), k, by, _with(runs, k, both[1]))

    tried = list(filter(None, (move(k, by) for by in SHIFTS for k in range(len(runs)))))
    if not tried or _better(runs, as_read, [one for one, *_ in tried]) is None:
        return []
    _, k, by, _ = min(tried, key=lambda one: one[0])
    closer = filter(None, (move(k, by * times) for times in FINER if abs(by * times) >= SHIFTS[0]))
    # of the rows that both have: those left out, at a start that fades, may have made the misfit
    kept = [(best, by, there, _follow(there, drive, output)) for best, _, by, there in closer]
    best, by, there, as_kept = min(
        kept, key=lambda one: (1.0 if one[1] in SHIFTS else EVEN) * one[0].left ** 2 / one[3].left
    )
    if _better(runs, as_read, [best], APART) is None or _better(there, as_kept, [best], KEPT) is None:
        return []
    words = (
        f"{drive} is about {abs(by) / 3600:.2g} h {'behind' if by > 0 else 'ahead of'} {output}, as by another clock"
    )
    return [(best, k, words)]


def run_apart(records: Sequence[Record]) -> tuple[int, float] | None:
    """Return which record lies far from the law of the others, and by how many Hz; None where none does."""
    members, runs = _courses(records, _drive_of(records), FREQUENCY)
    if len(runs) < 2:
        return None
    for law, part, far in ((ONE, ALONE, FAR), (LEVELLED, APART, FARTHER)):
        as_read = likeliest(runs, law)
        if _holds_well(runs, as_read, 0.0):
            continue
        alone = [likeliest(runs, law, [k]) for k in range(len(runs))]
        k = _better(runs, as_read, alone, part, 0.0)
        if (
            k is not None
            and abs(alone[k].apart) > far * runs[k].output.mean()
            and (law is ONE or _alone(alone[:k] + alone[k + 1 :], alone[k]))
        ):
            return members[k], alone[k].apart
    return None


def _alone(others: Sequence[Followed], best: Followed) -> bool:
    """Whether no other model comes near to the best one."""
    return all(NEXT * best.left < one.left for one in others)


def _follow(runs: Sequence[Course], drive: str, output: str) -> Followed:
    """Return what one law leaves: of a bias a cubic, each run with a level of its own, as they turn on; else one level and little bend."""
    if output in (FREQUENCY, HOUSING):
        return likeliest(runs, LAW)
    return likeliest(runs, replace(CUBIC, longest=SOONER) if drive == FREQUENCY else CUBIC, range(1, len(runs)))


def _bias_of(records: Sequence[Record]) -> str:
    """Return the column of the output at rest, "" where there is none."""
    turned = any("rate_deg_per_s" in record for record in records)
    return BIAS if any(BIAS in record for record in records) else RATE * (not turned)


def _drive_of(records: Sequence[Record]) -> str:
    return next((name for name in DRIVING if all(name in record for record in records)), "")


def _with(runs: Sequence[Course], k: int, other: Course) -> list[Course]:
    return [*runs[:k], other, *runs[k + 1 :]]


def _white(runs: Sequence[Course]) -> float:
    return white_rms(*(run.output for run in runs)) ** 2


def _holds_well(runs: Sequence[Course], as_read: Followed, well: float = WELL) -> bool:
    """Whether one law leaves hardly more than white noise, or than a small part of the changes."""
    return as_read.left**2 < max(CLEAR * _white(runs), (well * _changes(runs)) ** 2)


def _changes(runs: Sequence[Course]) -> float:
    return float(np.std(np.concatenate([run.output for run in runs])))


def _better(
    runs: Sequence[Course], as_read: Followed, tried: Iterable[Followed], part: float = OTHERWISE, well: float = WELL
) -> int | None:
    """Return which of some models leaves so small a part of what one law leaves, smaller where that holds well; white noise apart. None where none does."""
    if _holds_well(runs, as_read, 0.0):
        return None
    white = _white(runs)
    left = [one.left**2 - white for one in tried]
    k = int(np.argmin(left))
    part *= min(1.0, as_read.left / max(well * _changes(runs), 1e-300)) ** 2
    return k if left[k] < part**2 * (as_read.left**2 - white) else None


def _courses(records: Sequence[Record], drive: str, output: str) -> tuple[list[int], list[Course]]:
    """Return the places and courses of the records that have both columns."""
    found = {
        k: course
        for k, record in enumerate(records)
        if drive in record and output in record and (course := course_of(record, drive, output, len(records)))
    }
    return list(found), list(found.values())


def _path(records: Sequence[Record], k: int) -> str:
    return records[k].path or f"run {k + 1}"
