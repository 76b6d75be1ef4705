"""Whether a record is of the gyro that a card or a model stands for: a question, with the sentence that confirms it."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from compensation.arrays import Array
from compensation.noise import white_rms
from shell.constants import zero_Celsius
from studies.errors import InputError
from studies.instrument.card import Instrument
from studies.record import Record, drop_repeats
from studies.record.rest import TEMPERATURES, check_record
from studies.resonator.law import check_slope_known, law_of

if TYPE_CHECKING:
    from shell.law import FrequencyLaw

ANOTHER = 0.2  # relative: no tolerance of one design makes so much
ALIKE = 0.03  # relative: what trimming, temperature and small errors of dimensions make of a frequency
AT_REST = 1e-5  # relative: frequencies that vary by less need no temperature law
SPREADS = 6.0  # standard deviations of the card's own frequency
ONE_GYRO, STEEPEST = 5e-3, 3e-4  # relative, and 1/K: what one gyro does from run to run, and over temperature at most
UNITS = {"°/s": 3600.0, "°/day": 1 / 24, "rad/s": 3600.0 * 180.0 / np.pi}  # °/h in each
AS_NOISE, AS_CHANGES = 2.0, 4.0  # times by which noise and changes may differ from what a unit makes of another run's
SAME_GYRO = 0.01  # relative: one gyro over temperature, beyond the range of its model


def check_card_frequency(
    instrument: Instrument, frequency: Array, path: str, law: "FrequencyLaw | None" = None
) -> None:
    """Ask whether a record is of the card's gyro where its frequency lies far from the card's."""
    known = frequency[np.isfinite(frequency)]
    if not known.size:
        return
    if np.ptp(known) > AT_REST * np.median(known):
        check_slope_known(instrument)
    read, own = float(np.median(known)), _frequency(instrument, law)
    away = abs(float(np.log(max(read, 1e-9) / own)))
    if away <= ALIKE or away <= SPREADS * (spread := _spread(instrument, own)):
        return
    T = instrument.reference_temperature - zero_Celsius
    ask = (
        "is this a record of that gyro? If it is, give a dimension an uncertainty that covers the difference: [resonator]"
        f" thickness_mm = {{ value = …, relative_sd = {np.ceil(50 * away) / 100:g} }}."
    )
    raise InputError(
        f"{path}: frequency_Hz is near {read:.5g} Hz, but the card {instrument.name} resonates at {own:.5g} Hz at {T:g} °C,"
        f" known to {100 * spread:.2g} %: {ask if away < ANOTHER else 'this is not a record of that gyro; check the card and the file.'}"
    )


def check_one_gyro(readings: Sequence[tuple[str, Array | None, Array]]) -> None:
    """Refuse records of different gyros: path, temperature (°C; None where it is not known) and frequency (Hz) of each."""
    levels = []
    for path, T, f in readings:
        known = np.isfinite(f) if T is None else np.isfinite(T) & np.isfinite(f)
        if known.any():
            level, warm = float(np.median(f[known])), np.nan if T is None else float(np.median(T[known]))
            levels.append((level, warm, float(np.ptp(f[known])) / level, path))
    for near, warm, span, path in levels:
        for other, warmth, spanned, first in levels:
            moved = STEEPEST * abs(warm - warmth)
            if abs(float(np.log(near / other))) > ONE_GYRO + (moved if np.isfinite(moved) else span + spanned):
                at, there = (f" at {T:.3g} °C" if np.isfinite(T) else "" for T in (warm, warmth))
                raise InputError(
                    f"{path}: frequency_Hz is about {near:.6g} Hz{at}, in {first} about {other:.6g} Hz{there}:"
                    " no gyro changes so much. The records are of different gyros, or one is in another unit: give those of one."
                )


def check_one_unit(records: Sequence[Record], name: str = "bias_deg_per_h") -> None:
    """Refuse a bias whose noise (of a row of 1 s) and changes are in one record those of the others in another unit."""
    sizes = []
    for record in records:
        known = record[name][np.isfinite(record[name])]
        white = white_rms(known)
        changes = float(np.sqrt(max(float(np.var(known)) - white**2, 0.0))) if known.size else 0.0
        sizes.append((white * float(np.sqrt(np.median(np.diff(record["time_s"])))), changes))
    for k, record in enumerate(records):
        others = np.median(sizes[:k] + sizes[k + 1 :], axis=0) if len(records) > 1 else np.zeros(2)
        for unit, factor in UNITS.items():
            noise, changes = factor * np.array(sizes[k]) / np.maximum(others, 1e-300)
            if 1 / AS_NOISE < noise < AS_NOISE and 1 / AS_CHANGES < changes < AS_CHANGES:
                times = f"{max(factor, 1 / factor):.6g}"
                size, mend = ("less", "Multiply") if factor > 1 else ("more", "Divide")
                raise InputError(
                    f"{record.path or f'run {k + 1}'}: {name} scatters and changes {times} times {size} than in the other records, as in {unit}."
                    f" {mend} the column by {times}, or leave the record out if it is of another gyro."
                )


def records_of_one_gyro(records: Sequence[Record], say: Callable[[str], None]) -> list[Record]:
    """Return the records that a fit may take: one given twice counts once, which is said, and all are of one gyro."""

    def thermometer(record: Record) -> Array | None:
        return next((record[name] for name in TEMPERATURES if name in record), None)

    kept, repeated = drop_repeats(records)
    for sentence in (*repeated, *filter(None, map(check_record, kept))):
        say(sentence)
    check_one_gyro([(r.path or "a record", thermometer(r), r["frequency_Hz"]) for r in kept if "frequency_Hz" in r])
    return kept


def check_model_frequency(frequency: Array, lowest: float, highest: float, path: str, model: str) -> None:
    """Ask whether a record is of the gyro that a frequency model was fitted to."""
    known = frequency[np.isfinite(frequency)]
    if not known.size or ((known >= lowest * (1 - SAME_GYRO)) & (known <= highest * (1 + SAME_GYRO))).any():
        return
    raise InputError(
        f"{path}: frequency_Hz is near {np.median(known):.5g} Hz, but {model} was fitted to a gyro of {lowest:.5g} to {highest:.5g} Hz:"
        " is this a record of that gyro? If it is, fit a model to its own records (hrg fit frequency)."
    )


def _frequency(instrument: Instrument, law: "FrequencyLaw | None" = None) -> float:
    T = instrument.reference_temperature
    return float((law or law_of(instrument, T, T)).frequency(T))


def _spread(instrument: Instrument, own: float) -> float:
    """Relative standard deviation of the card's frequency, by its material's law and by the numbers that it states."""
    T = instrument.reference_temperature
    squares = float(law_of(instrument, T, T).uncertainty(np.array([T]))[0]) ** 2
    for value in instrument.uncertain:
        if value.name.startswith(("resonator.", "material.", "law.f0")) and ".deviation." not in value.name:
            moved = min(value.value + value.sd, value.high)
            moved = moved if moved > value.value else max(value.value - value.sd, value.low)
            squares += float(np.log(_frequency(instrument.with_values({value.name: moved})) / own)) ** 2
    return float(np.sqrt(squares))
