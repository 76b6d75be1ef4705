"""The filtering paper's figures 3 and 5–7 for k = 500 Hz, ζ = 0.025, γ = 0.1, B = 3 Hz, with noise reduction as numbers.

"k = 500 Hz" is taken as 2π·500 rad/s and "B = 3 Hz" as 2π·3 rad/s. The paper gives neither its sampling step nor σ:
σ² = 2/B is taken, which gives the rate the variance 1 rad²/s². The Wiener case is sampled every 1 ms. For the Kalman
filter the step matters, because Q is per step: its rate estimate is "closer to the actual square pulse shape than the
measured output", as the paper says, only for steps below about 0.04 ms, so 0.02 ms is taken.
"""

from dataclasses import dataclass

import numpy as np

from compensation.arrays import Array
from compensation.demodulated import ErrorMap, map_integral_error, measure_rate, relate_rate_to_measured_rate
from compensation.kalman import LinearModel, expect_mean_nis, model_gyro, noise_of_estimate, run_filter
from compensation.sensitive_element import tune
from compensation.spectral import Spectrum, high_pass_spectrum, rate_spectrum, white_spectrum
from compensation.wiener import WienerFilter, design_wiener_filter, judge_filter, renormalise

K, ZETA, GAMMA, B = 2 * np.pi * 500.0, 0.025, 0.1, 2 * np.pi * 3.0
SIGMA = float(np.sqrt(2 / B))
STEP, KALMAN_STEP = 1e-3, 2e-5
PROCESS_NOISE, MEASUREMENT_NOISE = ((0.0, 0.0), (0.0, 2e-6)), 0.01
PULSE, LENGTH = 0.25, 1.5
STEPS = (1e-3, 5e-4, 2e-4, 1e-4, 5e-5)


@dataclass(frozen=True)
class Filtered:
    """A true rate, the gyro's output without and with noise, the filter's estimate, and the same without noise: rad/s over time (s)."""

    time: Array
    rate: Array
    output: Array
    noisy: Array
    estimate: Array
    clean_estimate: Array

    @property
    def noise_before(self) -> float:
        """Standard deviation (rad/s) of the added noise."""
        return float(np.std(self.noisy - self.output))

    @property
    def noise_after(self) -> float:
        """Standard deviation (rad/s) of what the filter leaves of the noise; the filters are linear."""
        return float(np.std(self.estimate - self.clean_estimate))

    @property
    def lag_error(self) -> float:
        """Rms difference (rad/s) of the estimate without any noise to the true rate: distortion of the pulses."""
        return float(np.sqrt(np.mean((self.clean_estimate - self.rate) ** 2)))

    @property
    def output_error(self) -> float:
        """Rms difference (rad/s) of the gyro's noise-free output to the true rate."""
        return float(np.sqrt(np.mean((self.output - self.rate) ** 2)))

    @property
    def error_before(self) -> float:
        """Rms difference (rad/s) of the noisy output to the true rate."""
        return float(np.sqrt(np.mean((self.noisy - self.rate) ** 2)))

    @property
    def error_after(self) -> float:
        """Rms difference (rad/s) of the estimate to the true rate: noise left and distortion of the pulses."""
        return float(np.sqrt(np.mean((self.estimate - self.rate) ** 2)))


@dataclass(frozen=True)
class WienerCase:
    """Optimum and renormalised filter for one noise, (35) or (36), with error variances, and the case simulated."""

    name: str
    optimum: WienerFilter
    renormalised: WienerFilter
    rate_variance: float


@dataclass(frozen=True)
class FilterStudy:
    """Figures 5–7: both Wiener cases, figure 5, and the Kalman run."""

    wiener: tuple[WienerCase, ...]
    figure5: Filtered
    figure6: Filtered  # estimate of the output
    figure7: Filtered  # estimate of the rate
    mean_nis: float
    nis_band: tuple[float, float]  # 95 %
    by_step: tuple[tuple[float, Filtered], ...]  # the rate estimate for other sampling steps (s)
    settled_noise: tuple[tuple[float, float], ...]  # rad/s, of output and rate by the settled filter


def make_pulses(step: float) -> tuple[Array, Array]:
    """Return times (s) and square pulses of 1 rad/s, `PULSE` seconds on and off, edges one step long."""
    time = np.arange(0.0, LENGTH, step)
    return time, np.where(np.floor(time / PULSE) % 2 == 1, 1.0, 0.0)


def study_error_map(points: int = 41) -> ErrorMap:
    """Return figure 3 for δk in 0.9…1.1 and δζ in 0.5…1.5; the paper prints neither range nor time."""
    return map_integral_error(np.linspace(0.9, 1.1, points), np.linspace(0.5, 1.5, points), k=K, zeta=ZETA)


def study_wiener() -> tuple[WienerCase, ...]:
    """Return (35) and (36) with the error before and after the renormalisation to G(0) W(0) = 1."""
    gyro, rate = relate_rate_to_measured_rate(K, ZETA), rate_spectrum(SIGMA, B)
    cases: list[tuple[str, Spectrum]] = [
        ("white noise, eq. (35)", white_spectrum(GAMMA, SIGMA)),
        ("high-pass noise, eq. (36)", high_pass_spectrum(GAMMA, SIGMA, B)),
    ]
    results = []
    for name, noise in cases:
        optimum = design_wiener_filter(gyro, rate, noise)
        scaled = judge_filter(renormalise(optimum.filter, gyro), gyro, rate, noise)
        results.append(WienerCase(name, optimum, scaled, rate.variance))
    return tuple(results)


def study_filters(seed: int = 5) -> FilterStudy:
    """Return the twins of figures 5–7: square pulses through the full dynamics (1), noise added, filtered."""
    generator = np.random.default_rng(seed)
    wiener = study_wiener()
    figure5 = _filter_wiener(wiener[0], generator)
    figure6, figure7, nis = _filter_kalman(KALMAN_STEP, generator)
    by_step = (*((step, _filter_kalman(step, generator)[1]) for step in STEPS), (KALMAN_STEP, figure7))
    band = expect_mean_nis(len(nis), 1)
    return FilterStudy(wiener, figure5, figure6, figure7, float(np.mean(nis)), band, by_step, settle_kalman())


def settle_kalman() -> tuple[tuple[float, float], ...]:
    """Return the noise (rad/s) in the settled estimates of output and rate, for the steps of `FilterStudy.by_step`."""
    spreads = (np.sqrt(np.diag(noise_of_estimate(_kalman_model(step)))) for step in (*STEPS, KALMAN_STEP))
    return tuple((float(output), float(rate)) for output, rate in spreads)


def _kalman_model(step: float) -> LinearModel:
    return model_gyro(K, ZETA, step, np.array(PROCESS_NOISE), MEASUREMENT_NOISE)


def _filter_wiener(case: WienerCase, generator: np.random.Generator) -> Filtered:
    """White noise of density γ²σ² has the variance γ²σ²/step in samples."""
    time, rate = make_pulses(STEP)
    output = measure_rate(tune(K, ZETA), time, rate)
    noisy = output + GAMMA * SIGMA / np.sqrt(STEP) * generator.standard_normal(len(time))
    estimate, clean = (case.renormalised.filter.simulate(time, values) for values in (noisy, output))
    return Filtered(time, rate, output, noisy, estimate, clean)


def _filter_kalman(step: float, generator: np.random.Generator) -> tuple[Filtered, Filtered, Array]:
    """The estimates of output and rate, and the normalised innovations squared."""
    model = _kalman_model(step)
    time, rate = make_pulses(step)
    output = measure_rate(tune(K, ZETA), time, rate)
    noisy = output + np.sqrt(MEASUREMENT_NOISE) * generator.standard_normal(len(time))
    run = run_filter(model, noisy, np.zeros(2), np.eye(2))
    clean = run_filter(model, output, np.zeros(2), np.eye(2)).states
    of_output, of_rate = (
        Filtered(time, truth, output, noisy, run.states[:, i], clean[:, i]) for i, truth in enumerate((output, rate))
    )
    return of_output, of_rate, run.nis
