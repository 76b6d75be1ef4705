"""Thermal constants of a resonator from records of its frequency and its housing's temperature."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from compensation.spikes import find_spikes
from shell.constants import zero_Celsius
from studies.calibration.lags.followers import make_series
from studies.calibration.lags.housing_run import HousingRun
from studies.calibration.lags.identification import FrequencyPolynomial, Identification, identify, identify_lags
from studies.errors import InputError, naming
from studies.record import Record
from studies.record.rest import LEAST_SPIKE, check_seconds

if TYPE_CHECKING:
    from studies.instrument.card import Instrument

SENSORS = ("housing_temperature_degC", "chamber_temperature_degC")


def fit_thermal_constants(
    records: Sequence[Record],
    instrument: "Instrument | None" = None,
    lags: int | None = None,
    confidence: float = 0.9,
    progress: Callable[[str], None] = lambda _: None,
) -> Identification:
    """Identify the lags of the resonator behind its housing, each run with an initial state of its own.

    Args:
        records: Runs with `frequency_Hz` and the temperature of the housing, else of the chamber.
        instrument: Gives curvature and cubic of the frequency over temperature; without it the curvature is fitted and
            the cubic is zero. The slope is always fitted.
        lags: Number of lags; as many as the record supports, up to three, when absent.
        confidence: Of the intervals.
        progress: Told in words what comes next.
    """
    if lags is not None and not 1 <= lags <= 5:
        raise InputError(f"--lags {lags}: the number of lags lies between 1 and 5.")
    runs = [_run(record) for record in records]
    law = _law(runs, instrument)
    with naming(", ".join(record.path or "record" for record in records)):
        if lags is None:
            return identify_lags(runs, law, confidence=confidence, progress=progress)
        span = max(float(np.ptp(run.time)) for run in runs)
        starts = span / 6 * 0.3 ** np.arange(lags)
        return identify(runs, make_series(*starts, longest=10 * span), law, confidence)


def _run(record: Record) -> HousingRun:
    sensor = next((name for name in SENSORS if name in record), None)
    if sensor is None or "frequency_Hz" not in record:
        raise InputError(
            f"{record.path}: thermal constants need frequency_Hz and {SENSORS[0]} (or {SENSORS[1]});"
            f" it has {', '.join(record.columns)}."
        )
    check_seconds(record.path, record["time_s"], record[sensor])
    frequency, housing = (
        np.where(find_spikes(record[name], LEAST_SPIKE), np.nan, record[name]) for name in ("frequency_Hz", sensor)
    )
    with naming(record.path):
        return HousingRun(record["time_s"], frequency, housing + zero_Celsius)


def _law(runs: Sequence[HousingRun], instrument: "Instrument | None") -> FrequencyPolynomial:
    """A free slope about the middle of what the housing covers, with the card's curvature or a free one."""
    ends = np.array([f(run.housing_temperature) for run in runs for f in (np.nanmin, np.nanmax)])
    low, high = float(ends.min()), float(ends.max())
    middle = (low + high) / 2
    if instrument is None:
        return FrequencyPolynomial(middle, slope=None, curvature=None)
    from studies.resonator.law import law_of

    law = law_of(instrument, low - 10, high + 10)
    T = np.linspace(law.lowest, law.highest, 61)
    cubic = np.polynomial.Polynomial.fit(T - middle, law.frequency(T), 3).convert().coef
    return FrequencyPolynomial(middle, slope=None, curvature=float(cubic[2]), cubic=float(cubic[3]))
