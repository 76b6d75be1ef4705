"""Records that a command takes together: each once, without what a stuck logger wrote, of one gyro, and all read in one way."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from compensation.noise import white_rms
from studies.errors import InputError
from studies.record import Record
from studies.record.one_law import ANY_PATH, Course, Followed, Law, course_of, likeliest
from studies.record.repeated import drop_repeats
from studies.record.rest import DRIVING, check_record, without_stuck

FREQUENCY, BIAS, RATE = "frequency_Hz", "bias_deg_per_h", "measured_rate_deg_per_s"
ONE_GYRO, STEEPEST = 5e-3, 3e-4  # relative, and 1/K: what one gyro does from run to run, and over temperature at most
UNITS = {"°/s": 3600.0, "°/day": 1 / 24, "rad/s": 3600.0 * 180.0 / np.pi, "m°/h": 1e-3}  # °/h in each
AS_NOISE, AS_CHANGES = 2.0, 4.0  # times by which noise and changes may differ from what a unit makes of another run's
WELL = 0.01  # of an output's changes (rms): where one law leaves no more, all runs are read alike
CLEAR = 2.0  # times white noise (squares) that it must leave besides
OTHERWISE = 0.4  # of what one law leaves (rms): left with one run read otherwise; of 210 campaigns by others none had less than 0.7
ALONE, FAR = 0.1, 5e-5  # of the same: left with a run apart; and by how much of the frequency it is then
BEND = 0.1  # of the changes of a frequency: a temperature in another unit would bend its law to its needs
LAW, ONE = replace(ANY_PATH, bend=BEND), Law(bend=BEND)


def records_of_one_gyro(records: Sequence[Record], say: Callable[[str], None]) -> list[Record]:
    """Return the records that a command may take together, and say what is left out or doubted."""
    kept, said = drop_repeats(records)
    said += filter(None, map(check_record, kept))
    check_one_gyro(kept)
    check_one_unit(kept)
    check_one_sign(kept)
    check_one_reading(kept)
    if (odd := run_apart(kept)) is not None:
        k, away = odd
        said.append(
            f"{_path(kept, k)}: {FREQUENCY} is {away:+.2g} Hz from what the other records have at the same temperatures:"
            " another gyro, or something done between the runs? If so, leave it out."
        )
    for sentence in said:
        say(sentence)
    return [without_stuck(record) for record in kept]


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
    for near, warm, span, path in levels:
        for other, warmth, spanned, first in levels:
            moved = STEEPEST * abs(warm - warmth)
            if abs(float(np.log(near / other))) > ONE_GYRO + (moved if np.isfinite(moved) else span + spanned):
                at, there = (f" at {T:.3g} °C" if np.isfinite(T) else "" for T in (warm, warmth))
                raise InputError(
                    f"{path}: frequency_Hz is about {near:.6g} Hz{at}, in {first} about {other:.6g} Hz{there}:"
                    " no gyro changes so much. The records are of different gyros, or one is in another unit: give those of one."
                )


def check_one_unit(records: Sequence[Record]) -> None:
    """Refuse a bias whose noise (of a row of 1 s) and changes are in one record those of the others in another unit."""
    sizes, records = [], [record for record in records if BIAS in record]
    for record in records:
        known = record[BIAS][np.isfinite(record[BIAS])]
        white = white_rms(known)
        changes = float(np.sqrt(max(float(np.var(known)) - white**2, 0.0))) if known.size else 0.0
        sizes.append((white * float(np.sqrt(np.median(np.diff(record["time_s"])))), changes))
    for k in range(len(records) if len(records) > 1 else 0):
        others = np.median(sizes[:k] + sizes[k + 1 :], axis=0)
        for unit, factor in UNITS.items():
            noise, changes = factor * np.array(sizes[k]) / np.maximum(others, 1e-300)
            if 1 / AS_NOISE < noise < AS_NOISE and 1 / AS_CHANGES < changes < AS_CHANGES:
                times = f"{max(factor, 1 / factor):.6g}"
                size, mend = ("less", "Multiply") if factor > 1 else ("more", "Divide")
                raise InputError(
                    f"{_path(records, k)}: {BIAS} scatters and changes {times} times {size} than in the other records, as in {unit}."
                    f" {mend} the column by {times}, or leave the record out if it is of another gyro."
                )


def check_one_sign(records: Sequence[Record]) -> None:
    """Refuse a bias that follows one law of the frequency, or of the temperature, in all runs only with its sign changed in one."""
    output = BIAS if any(BIAS in record for record in records) else RATE
    if output == RATE and any("rate_deg_per_s" in record for record in records):
        return
    for drive in (FREQUENCY, *DRIVING):
        members, runs = _courses(records, drive, output)
        if len(runs) > 1:
            levels = range(1, len(runs))
            turned = _put_in(runs, [replace(run, output=-run.output) for run in runs])
            k = _better(runs, likeliest(runs, ANY_PATH, levels), (likeliest(one, ANY_PATH, levels) for one in turned))
            if k is not None:
                which = [_path(records, one) for one in (members if len(runs) == 2 else members[k : k + 1])]
                raise InputError(
                    f"{' or '.join(which)}: {output} has the opposite sign: with it changed, one law of {drive} holds in all runs."
                    " Change it where it is wrong, or leave the record out if it is of another gyro."
                )
            return


def check_one_reading(records: Sequence[Record]) -> None:
    """Refuse temperatures of one run that are in °F, have the opposite sign or are those of another column."""
    drive = _drive_of(records)
    members, runs = _courses(records, drive, FREQUENCY)
    if len(runs) < 2:
        return
    as_read = likeliest(runs, LAW)
    readings = [
        ("is in °F", [replace(run, drive=(run.drive - 32.0) / 1.8) for run in runs]),
        ("is of the opposite sign", [replace(run, drive=-run.drive) for run in runs]),
    ]
    readings += [
        (f"is exchanged with {other}", there)
        for other in DRIVING
        if other != drive and len(there := _courses(records, other, FREQUENCY)[1]) == len(runs)
    ]
    for words, others in readings:
        k = _better(runs, as_read, (likeliest(one, LAW) for one in _put_in(runs, others)))
        if k is not None:
            raise InputError(
                f"{_path(records, members[k])}: {drive} {words}: read so, one law holds in all runs. Correct it, and other temperatures of that file if they are alike."
            )


def run_apart(records: Sequence[Record]) -> tuple[int, float] | None:
    """Return which record lies far from the law of the others, and by how many Hz; None where none does."""
    members, runs = _courses(records, _drive_of(records), FREQUENCY)
    if len(runs) < 2:
        return None
    k = _better(runs, likeliest(runs, ONE), (likeliest(runs, ONE, [k]) for k in range(len(runs))), ALONE, 0.0)
    away = 0.0 if k is None else likeliest(runs, ONE, [k]).apart
    return (members[k], away) if k is not None and abs(away) > FAR * runs[k].output.mean() else None


def _drive_of(records: Sequence[Record]) -> str:
    return next((name for name in DRIVING if all(name in record for record in records)), "")


def _put_in(runs: Sequence[Course], others: Sequence[Course]) -> list[list[Course]]:
    """Return the runs with another in the place of each in turn."""
    return [[*runs[:k], other, *runs[k + 1 :]] for k, other in enumerate(others)]


def _better(
    runs: Sequence[Course], as_read: Followed, tried: Iterable[Followed], part: float = OTHERWISE, well: float = WELL
) -> int | None:
    """Return which of some models leaves so small a part of what one law leaves, if that does not hold well; white noise apart. None where none does."""
    white = white_rms(*(run.output for run in runs)) ** 2
    if as_read.left**2 < max(CLEAR * white, (well * float(np.std(np.concatenate([run.output for run in runs])))) ** 2):
        return None
    left = [one.left**2 - white for one in tried]
    k = int(np.argmin(left))
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
