"""The quantities of an acceptance test, in the order of IEEE Std 1431-2004, and the tests that ask for other equipment."""

from dataclasses import dataclass


@dataclass(frozen=True)
class TestedQuantity:
    """One number of the test: its key in a file of limits, section of the standard, words, unit, and which side is good.

    `needs` says what record gives it; of an `upper` limit the size of the value must stay below it, of a lower one above.
    """

    key: str
    section: str
    words: str
    unit: str
    needs: str
    upper: bool = True


WARM = "a record from power-on with its output, marked by the line '# test: warm-up'"
THERMAL = "a record at rest over temperatures that span 5 °C or more"
RATES = "a record with rate_deg_per_s of three rates or more, both signs, and measured_rate_deg_per_s"
REST = "a record of an hour or more at rest and at one temperature (within 5 °C)"
RUN_DOWN = "a record with vibration_amplitude_V while the drive is off"
SHAKEN = "a record of a swept or shaken rate, rate_deg_per_s and measured_rate_deg_per_s at even rows"
STORED = "a record with pattern_angle_deg of a whole-angle gyro and a gap where its power was off, marked '# test: angle-storage'"
LIFE = "three records or more at rest with '# start', over the stated life"
SEAL = "two records or more with inverse_q and '# start', a day or more apart"

QUANTITIES = (
    TestedQuantity("inverse_q_trend_per_year", "12.3", "growth of 1/Q, as a leak makes it", "1/year", SEAL),
    TestedQuantity("warm_up_time_s", "12.5–12.6", "warm-up time, into the band of the final output", "s", WARM),
    TestedQuantity("bias_temperature_slope_deg_per_h_per_K", "12.8", "bias over temperature", "deg/h/K", THERMAL),
    TestedQuantity(
        "bias_temperature_rate_deg_per_h_s_per_K", "12.8", "bias over rate of temperature", "deg/h/(K/s)", THERMAL
    ),
    TestedQuantity(
        "bias_temperature_residual_deg_per_h", "12.8", "what both leave, rms of means over 100 s", "deg/h", THERMAL
    ),
    TestedQuantity("frequency_temperature_slope_ppm_per_K", "12.8", "frequency over temperature", "ppm/K", THERMAL),
    TestedQuantity("scale_factor_error_ppm", "12.9", "scale factor less one", "ppm", RATES),
    TestedQuantity(
        "scale_factor_nonlinearity_ppm", "12.9", "largest departure from the line, of full scale", "ppm", RATES
    ),
    TestedQuantity(
        "scale_factor_asymmetry_ppm", "12.9", "scale factor of positive less that of negative rates", "ppm", RATES
    ),
    TestedQuantity("bias_deg_per_h", "12.11", "bias", "deg/h", REST),
    TestedQuantity(
        "bias_repeatability_deg_per_h",
        "12.11",
        "bias from run to run, standard deviation",
        "deg/h",
        REST + ", twice or more",
    ),
    TestedQuantity("angle_random_walk_deg_per_rt_h", "12.11", "angle random walk", "deg/√h", REST),
    TestedQuantity(
        "bias_instability_deg_per_h", "12.11", "bias instability, lowest Allan deviation over 0.664", "deg/h", REST
    ),
    TestedQuantity("rate_random_walk_deg_per_h_per_rt_h", "12.11", "rate random walk", "deg/h/√h", REST),
    TestedQuantity("angle_storage_error_deg", "12.13", "angle after an interruption less that foretold", "deg", STORED),
    TestedQuantity("run_down_time_s", "12.14", "run-down time, to 1/e of the amplitude", "s", RUN_DOWN, upper=False),
    TestedQuantity(
        "quality_factor", "12.14", "Q, from the run-down", "", RUN_DOWN + ", and its frequency_Hz", upper=False
    ),
    TestedQuantity("bandwidth_Hz", "12.15", "bandwidth, where the gain has fallen by 3 dB", "Hz", SHAKEN, upper=False),
    TestedQuantity("delay_ms", "12.15", "delay of the output within half of the band", "ms", SHAKEN),
    TestedQuantity("bias_trend_deg_per_h_per_year", "12.18", "bias over the time of the records", "deg/h/year", LIFE),
)
BY_KEY = {quantity.key: quantity for quantity in QUANTITIES}

ELSEWHERE = (
    # section, test, what would be needed
    ("12.3", "leak rate", "a leak detector with its tracer gas: records show the growth of 1/Q alone"),
    ("12.18", "life", "records until its end: a trend over shorter runs is an indication"),
)
