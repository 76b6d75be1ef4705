"""Quantities of an acceptance test, in the order of IEEE Std 1431-2004, and the file of their limits, `schema = "hrg.limits/1"`."""

from dataclasses import dataclass
from typing import Annotated, Any

import msgspec

from studies.schema.keys import Keys, number, says

SCHEMA = "hrg.limits/1"


@dataclass(frozen=True)
class TestedQuantity:
    """One number of the test: its key in a file of limits, section of the standard, words, unit, and which side is good."""

    key: str
    section: str
    words: str
    unit: str
    needs: str  # what record gives it
    upper: bool = True  # the size of the value must stay below the limit, else above


WARM = "a record of the output from power-on, marked '# test: warm-up'"
THERMAL = "a record at rest over a temperature range of 5 K or more"
RATES = "a record with rate_deg_per_s (three or more rates, both signs) and measured_rate_deg_per_s"
REST = "a record of an hour or more at rest and at constant temperature (within 5 K)"
RUN_DOWN = "a free decay, or a record of vibration_amplitude_V with the drive off"
SHAKEN = "a record of a swept or random rate with rate_deg_per_s and measured_rate_deg_per_s, evenly sampled"
STORED = "a record of pattern_angle_deg of a whole-angle gyro with a gap while its power was off, marked '# test: angle-storage'"
LIFE = "three or more records at rest with '# start', over the stated life"
SEAL = "two or more records with inverse_q and '# start', a day or more apart"

RATE = "bias_temperature_rate_deg_per_h_s_per_K"
REPEATED = f"two or more records{REST.removeprefix('a record')}"
QUANTITIES = tuple(
    TestedQuantity(*one)
    for one in (
        ("inverse_q_trend_per_year", "12.3", "growth of 1/Q (leak indication)", "1/year", SEAL),
        ("warm_up_time_s", "12.5–12.6", "warm-up time", "s", WARM),
        ("bias_temperature_slope_deg_per_h_per_K", "12.8", "bias sensitivity to temperature", "deg/h/K", THERMAL),
        (RATE, "12.8", "bias sensitivity to temperature rate", "deg/h/(K/s)", THERMAL),
        ("bias_temperature_residual_deg_per_h", "12.8", "bias residual after both, rms of 100 s averages", "deg/h", THERMAL),
        ("frequency_temperature_slope_ppm_per_K", "12.8", "frequency sensitivity to temperature", "ppm/K", THERMAL + ", with frequency_Hz"),
        ("scale_factor_error_ppm", "12.9", "scale factor error", "ppm", RATES),
        ("scale_factor_nonlinearity_ppm", "12.9", "scale factor nonlinearity, of full scale", "ppm", RATES),
        ("scale_factor_asymmetry_ppm", "12.9", "scale factor asymmetry, positive minus negative rates", "ppm", RATES),
        ("bias_deg_per_h", "12.11", "bias", "deg/h", REST),
        ("bias_repeatability_deg_per_h", "12.11", "run-to-run bias repeatability, standard deviation", "deg/h", REPEATED),
        ("angle_random_walk_deg_per_rt_h", "12.11", "angle random walk", "deg/√h", REST),
        ("bias_instability_deg_per_h", "12.11", "bias instability, minimum of the Allan deviation divided by 0.664", "deg/h", REST),
        ("rate_random_walk_deg_per_h_per_rt_h", "12.11", "rate random walk", "deg/h/√h", REST),
        ("angle_storage_error_deg", "12.13", "angle storage error after a power interruption", "deg", STORED),
        ("run_down_time_s", "12.14", "run-down time to 1/e of the amplitude", "s", RUN_DOWN, False),
        ("quality_factor", "12.14", "Q from the run-down", "", RUN_DOWN + ", and its frequency_Hz", False),
        ("bandwidth_Hz", "12.15", "bandwidth (−3 dB)", "Hz", SHAKEN, False),
        ("delay_ms", "12.15", "output delay, of slow rates", "ms", SHAKEN),
        ("bias_trend_deg_per_h_per_year", "12.18", "bias drift over the records", "deg/h/year", LIFE),
    )
)  # fmt: skip

ELSEWHERE = (
    # section, test, what would be needed
    ("12.3", "leak rate", "a leak detector with a tracer gas; records show only the growth of 1/Q"),
    ("12.18", "life", "records to end of life; a trend over shorter runs is only an indication"),
)


class WarmUp(Keys, frozen=True, kw_only=True):
    """When the output counts as settled."""

    band_deg_per_h: Annotated[float, number("about the final output; three times the scatter of its means unless given", above=0.0)] | None = None  # fmt: skip


def _declare_quantities() -> Any:
    def check(limits: Any) -> None:
        if not any(getattr(limits, key) is not None for key in limits.__struct_fields__):
            raise ValueError("no limit is given; add one, such as bias_deg_per_h = 5.0.")

    def declare(q: TestedQuantity) -> Any:
        return Annotated[float, number(f"{q.words}; {'at most, in size' if q.upper else 'at least'}", above=0.0)] | None

    fields: list[Any] = [(q.key, declare(q), None) for q in QUANTITIES]
    own: dict[str, Any] = {"bases": (Keys,), "namespace": {"__post_init__": check}}
    return msgspec.defstruct("QuantityLimits", fields, **own, frozen=True, kw_only=True)


QuantityLimits: Any = _declare_quantities()


class Limits(Keys, frozen=True, kw_only=True):
    """What an acceptance test is judged by."""

    schema: Annotated[str, says("kind of file")] = SCHEMA
    limits: QuantityLimits
    warm_up: WarmUp = WarmUp()

    def of(self, key: str) -> float | None:
        """Return the limit of a quantity, None where it has none."""
        limit: float | None = getattr(self.limits, key)
        return limit
