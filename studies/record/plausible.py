"""Whether a record is of the gyro that a card or a model stands for: a question, with the sentence that confirms it."""

from typing import TYPE_CHECKING

import numpy as np

from compensation.arrays import Array
from shell.constants import zero_Celsius
from studies.errors import InputError
from studies.instrument.card import Instrument
from studies.resonator.law import check_slope_known, law_of

if TYPE_CHECKING:
    from shell.law import FrequencyLaw

ANOTHER = 0.2  # relative: no tolerance of one design makes so much
ALIKE = 0.03  # relative: what trimming, temperature and small errors of dimensions make of a frequency
AT_REST = 1e-5  # relative: frequencies that vary by less need no temperature law
SPREADS = 6.0  # standard deviations of the card's own frequency
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
    """Relative standard deviation of the card's frequency, by its material and by its dimensions."""
    T = instrument.reference_temperature
    squares = float(law_of(instrument, T, T).uncertainty(np.array([T]))[0]) ** 2
    for value in instrument.uncertain:
        if value.name.startswith(("resonator.", "law.f0")):
            moved = min(value.value + value.sd, value.high)
            moved = moved if moved > value.value else max(value.value - value.sd, value.low)
            squares += float(np.log(_frequency(instrument.with_values({value.name: moved})) / own)) ** 2
    return float(np.sqrt(squares))
