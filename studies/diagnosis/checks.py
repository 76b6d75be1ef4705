"""Records that cannot be of one gyro in the stated units."""

from collections.abc import Sequence

import numpy as np

from studies.effects.states import FloatArray
from studies.errors import InputError
from studies.record import Record
from studies.record.plausible import check_one_gyro
from studies.record.rest import check_temperatures

FEWEST_BINS = 24
"""Values from which on the noise of a response can be told."""
MOST_LOSS = 30.0
"""Times by which 1/Q of one gyro may differ from record to record."""


def check_units(records: Sequence[Record], tables: Sequence[dict[str, FloatArray]]) -> list[str]:
    """Raise InputError when a column can hardly be in the unit that its name says; return the doubts about the time."""
    for record, table in zip(records, tables, strict=True):
        where = record.path or "record"
        if not 100.0 < (value := _level(table, "frequency_Hz", 1e3)) < 1e9:
            raise InputError(f"{where}: frequency_Hz is about {value:g}, not 100 Hz to 1 GHz. Is it in another unit?")
        if not 0.0 < (value := _level(table, "inverse_q", 1e-3)) < 0.1:
            raise InputError(f"{where}: inverse_q is about {value:g}, not between 0 and 0.1. Is it Q itself?")
    return [doubt for doubt in map(check_temperatures, records) if doubt]


def _level(table: dict[str, FloatArray], name: str, none: float) -> float:
    """Return the median of a column, or what stands for one without values."""
    known = table[name][np.isfinite(table[name])] if name in table else np.empty(0)
    return float(np.median(known)) if known.size else none


def check_device(records: Sequence[Record], tables: Sequence[dict[str, FloatArray]]) -> None:
    """Raise InputError when the records can hardly be of one gyro."""
    names = {record.instrument: record.path for record in records if record.instrument}
    if len(names) > 1:
        (one, first), (two, second), *_ = names.items()
        raise InputError(f"{second}: instrument '{two}' is not that of {first}, '{one}'; diagnose one gyro at a time.")
    check_one_gyro(
        [
            (record.path, table["temperature"], table["frequency_Hz"])
            for record, table in zip(records, tables, strict=True)
            if "frequency_Hz" in table
        ]
    )
    levels = [
        (float(np.nanmedian(table["inverse_q"])), record.path)
        for record, table in zip(records, tables, strict=True)
        if "inverse_q" in table and np.isfinite(table["inverse_q"]).any()
    ]
    if levels and max(levels)[0] > MOST_LOSS * min(levels)[0]:
        raise InputError(
            f"{max(levels)[1]}: inverse_q is about {max(levels)[0]:g}, in {min(levels)[1]} about {min(levels)[0]:g}; "
            "the records are of different gyros, or one is in another unit."
        )
    spreads = []
    for record, table in zip(records, tables, strict=True):
        if "bias_deg_per_h" in table and np.isfinite(table["bias_deg_per_h"]).sum() > FEWEST_BINS:
            known = table["bias_deg_per_h"][np.isfinite(table["bias_deg_per_h"])]
            noise = float(np.median(np.abs(np.diff(known))))
            if noise > 0:
                spreads.append((noise, record.path))
    if spreads and max(spreads)[0] > 150.0 * min(spreads)[0]:
        raise InputError(
            f"{max(spreads)[1]}: bias_deg_per_h is {max(spreads)[0] / min(spreads)[0]:.0f} times as noisy as in "
            f"{min(spreads)[1]}; one of the two is in another unit, or of another gyro."
        )
