"""What a column of rates may hold in place of its own unit, and the factor that mends it."""

import numpy as np

RATES = {"°/s": 1.0, "°/h": 1 / 3600, "°/day": 1 / 86400, "rad/s": 180.0 / np.pi, "m°/h": 1e-3 / 3600}  # °/s in each
OWN = {"bias_deg_per_h": "°/h", "measured_rate_deg_per_s": "°/s", "rate_deg_per_s": "°/s"}
REVERSED = "has the opposite sign"
AS = 1.2  # times by which the factor of a misread rate may be missed: the scale over temperature, another gyro of the lot


def other_units(column: str) -> dict[str, float]:
    """Return unit -> by what a column that is in it must be multiplied; none of a column of another kind."""
    own = OWN.get(column)
    return {unit: size / RATES[own] for unit, size in RATES.items() if unit != own} if own else {}


def misreadings(column: str) -> dict[str, float]:
    """Return the same, worded, and with the opposite sign."""
    units = {f"is in {unit}": times for unit, times in other_units(column).items()}
    return {REVERSED: -1.0} | units if units else {}


def named(column: str, times: float) -> tuple[str, str] | None:
    """Return how a column that should be about as many times as large is misread, and the mend."""
    found = ((words, mend_by(own)) for words, own in misreadings(column).items() if 1 / AS < times / own < AS)
    return next(found, None)


def mend_by(times: float) -> str:
    """Say how to mend a column that must be multiplied by this."""
    return f"{'Multiply' if abs(times) >= 1 else 'Divide'} the column by {times if abs(times) >= 1 else 1 / times:.6g}"
