"""The filtering paper's figures 3 and 5–7 for k = 2π·500 rad/s, ζ = 0.025, γ = 0.1, B = 2π·3 rad/s, with noise reduction as numbers.

The paper gives neither step nor σ: σ² = 2/B gives the rate the variance 1 rad²/s²; the Wiener case is sampled every 1
ms, the Kalman filter, whose Q is per step, every 0.02 ms: it follows the pulse as printed only below 0.04 ms.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from compensation import demodulated
from compensation.arrays import Array
from compensation.kalman import LinearModel, expect_mean_nis, model_gyro, noise_of_estimate, run_filter
from compensation.motion import SensitiveElement, tune
from compensation.spectral import high_pass_spectrum, rate_spectrum, white_spectrum
from compensation.wiener import WienerFilter, design_wiener_filter, judge_filter, renormalise
from studies.reports import style
from studies.results import Chapter, Drawing, Figure, Table

K, ZETA, GAMMA, B = 2 * np.pi * 500.0, 0.025, 0.1, 2 * np.pi * 3.0
SIGMA = float(np.sqrt(2 / B))
STEP, KALMAN_STEP = 1e-3, 2e-5
PROCESS_NOISE, MEASUREMENT_NOISE = ((0.0, 0.0), (0.0, 2e-6)), 0.01
PULSE, LENGTH = 0.25, 1.5
STEPS = (1e-3, 5e-4, 2e-4, 1e-4, 5e-5)


def error_of(name: str) -> Any:
    """Return as a property the rms difference (rad/s) of a series to the true rate."""
    return property(lambda case: float(np.sqrt(np.mean((getattr(case, name) - case.rate) ** 2))))


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

    lag_error = error_of("clean_estimate")  # distortion of the pulses
    output_error = error_of("output")
    error_before = error_of("noisy")
    error_after = error_of("estimate")  # noise left, and distortion


@dataclass(frozen=True)
class WienerCase:
    """Optimum and renormalised filter for one noise, (35) or (36); their error variances are parts of that of the rate, which is 1."""

    name: str
    optimum: WienerFilter
    renormalised: WienerFilter


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


def study_error_map(points: int = 41) -> demodulated.ErrorMap:
    """Return figure 3 for δk in 0.9…1.1 and δζ in 0.5…1.5; the paper prints neither range nor time."""
    return demodulated.map_integral_error(np.linspace(0.9, 1.1, points), np.linspace(0.5, 1.5, points), k=K, zeta=ZETA)


def study_wiener() -> tuple[WienerCase, ...]:
    """Return (35) and (36) with the error before and after the renormalisation to G(0) W(0) = 1."""
    gyro, rate = demodulated.relate_rate_to_measured_rate(K, ZETA), rate_spectrum(SIGMA, B)
    noises = {
        "white noise, eq. (35)": white_spectrum(GAMMA, SIGMA),
        "high-pass noise, eq. (36)": high_pass_spectrum(GAMMA, SIGMA, B),
    }
    optima = {name: design_wiener_filter(gyro, rate, noise) for name, noise in noises.items()}
    return tuple(
        WienerCase(name, one, judge_filter(renormalise(one.filter, gyro), gyro, rate, noises[name]))
        for name, one in optima.items()
    )


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
    output = demodulated.measure_rate(tune(K, ZETA), time, rate)
    noisy = output + GAMMA * SIGMA / np.sqrt(STEP) * generator.standard_normal(len(time))
    estimate, clean = (case.renormalised.filter.simulate(time, values) for values in (noisy, output))
    return Filtered(time, rate, output, noisy, estimate, clean)


def _filter_kalman(step: float, generator: np.random.Generator) -> tuple[Filtered, Filtered, Array]:
    """The estimates of output and rate, and the normalised innovations squared."""
    model = _kalman_model(step)
    time, rate = make_pulses(step)
    output = demodulated.measure_rate(tune(K, ZETA), time, rate)
    noisy = output + np.sqrt(MEASUREMENT_NOISE) * generator.standard_normal(len(time))
    run = run_filter(model, noisy, np.zeros(2), np.eye(2))
    clean = run_filter(model, output, np.zeros(2), np.eye(2)).states
    of_output = Filtered(time, output, output, noisy, run.states[:, 0], clean[:, 0])
    return of_output, Filtered(time, rate, output, noisy, run.states[:, 1], clean[:, 1]), run.nis


PAPER = "Demodulated dynamics and optimal noise filtering for Coriolis vibratory gyroscopes"
SOURCES = (f"Apostolyuk V., {PAPER}: eqs. (1)–(41).",)
RESPONSES = (
    "A rate that oscillates at λ acts like an excitation shifted by λ. With matched modes the response is largest for a constant"
    " rate and falls off above kζ. With split modes it is largest where λ equals the frequency difference, on one side only."
)
APART, LIGHT = 1.02, 0.2
WIENER = (
    "name: Noise | optimum.error: Error, optimum .4f | renormalised.error: Error, as printed .4f"
    " | renormalised.distortion: Distortion part .4f | renormalised.noise: Noise part .4f | optimum.filter.steady_gain.real: G(0) of the optimum .4f"
)
WIENER_NOTE = (
    "Error variance divided by the variance of the rate. The printed filters are the optimum scaled to G(0) W(0) = 1, which removes"
    " the error for a constant rate but increases the mean square error."
)
BY_STEP = "0.0: Step (ms) ×1e3 g | 1.1: Noise of the estimate (rad/s) .4f | 0.1.lag_error: Lag error (rad/s) .3f | 0.1.output_error: Lag error of the output (rad/s) .3f"
STEPS_NOTE = "Noise: standard deviation of the settled filter, from its Riccati equation. Lag errors: rms for pulses of 0.25 s. The paper gives Q per step but not the step."


def filter_chapters(study: FilterStudy, error_map: demodulated.ErrorMap) -> list[Chapter]:
    """Return the chapters for the responses (13), (14), figure 3, the Wiener filters with figure 5, and the Kalman filter with figures 6, 7."""
    five, six, (output_noise, rate_noise) = study.figure5, study.figure6, study.settled_noise[-1]
    pulses = (
        "Square pulses through the full dynamics (1) with white noise (γ = 0.1, B = 3 Hz), filtered by eq. (35)."
        f" Noise {five.noise_before:.3f} → {five.noise_after:.3f} rad/s (factor {five.noise_before / five.noise_after:.1f});"
        f" error relative to the true rate {five.error_before:.3f} → {five.error_after:.3f} rad/s, of which {five.lag_error:.3f} from the lag of the filter."
    )
    kalman = (
        f"Kalman filter with the paper's Q and R, sampled every {1e3 * (six.time[1] - six.time[0]):g} ms: output noise"
        f" {six.noise_before:.4f} → {output_noise:.4f} rad/s once settled (factor {six.noise_before / output_noise:.0f}); noise of the rate estimate {rate_noise:.4f} rad/s."
    )
    steps = list(zip(study.by_step, study.settled_noise, strict=True))
    return [
        Chapter("CVG equations (13), (14): response to an oscillating rate", [
            Figure(_draw_responses, "Amplitude and phase (14) of the secondary mode per unit rate, k = 500 Hz, the same excitation for all gyros.",
                "Amplitude and phase over the frequency of the rate."),
            RESPONSES,
        ]),
        Chapter("CVG figure 3: accuracy of the simplified dynamics", [
            Figure(lambda: _draw_error_map(error_map),
                "Integral error (26) of the simplified transfer function (24) relative to the full equations (1).", "A map of the error, least where both modes agree."),
            _map_sentence(error_map),
        ]),
        Chapter("CVG equations (35), (36), figure 5: Wiener filter", [
            Table("Wiener filters for k = 500 Hz, ζ = 0.025, γ = 0.1, B = 3 Hz", study.wiener, WIENER, WIENER_NOTE),
            Figure(lambda: _draw_filtered(five), pulses, "Square pulses, a noisy output and a filtered one."),
        ]),
        Chapter("CVG equations (37)–(41), figures 6 and 7: Kalman filter", [
            Figure(lambda: _draw_kalman(study), kalman, "Output and rate with their estimates over time."),
            Table("Rate estimate by sampling step", steps, BY_STEP, STEPS_NOTE),
            _kalman_sentence(study),
        ]),
    ]  # fmt: skip


def _draw_responses() -> Drawing:
    tuned = tune(K, ZETA)
    gyros = {
        f"matched modes, ζ = {ZETA:g}": tuned,
        f"k₂ = {APART:g} k₁": SensitiveElement(K, APART * K, ZETA, ZETA, tuned.omega),
        f"matched modes, ζ = {LIGHT * ZETA:g}": tune(K, LIGHT * ZETA),
    }
    frequency = np.linspace(-60.0, 60.0, 1201)
    labels = ("A(λ) / A(0) of the matched gyro", "phase (°)")
    with style.figure(2, 1, 4.6, "frequency of the rate λ/2π (Hz)", labels, sharex=True) as (made, (upper, lower)):
        for name, gyro in gyros.items():
            amplitude, phase = demodulated.respond_to_oscillating_rate(gyro, 2 * np.pi * frequency)
            still, _ = demodulated.respond_to_oscillating_rate(tuned, 0.0)
            upper.semilogy(frequency, amplitude / still, label=name)
            lower.plot(frequency, np.degrees(np.unwrap(phase)))
        return made


def _draw_error_map(error_map: demodulated.ErrorMap) -> Drawing:
    """Draw figure 3, the integral error over the ratios of frequency and damping."""
    with style.figure(height=3.8, x="δk = k₂/k₁", y="δζ = ζ₂/ζ₁") as (made, axes):
        grid, levels = (error_map.frequency_ratio, error_map.damping_ratio), np.arange(-6.0, 0.51, 0.5)
        shades = axes.contourf(*grid, np.log10(error_map.error), levels=levels, cmap="viridis", extend="both")
        made.colorbar(shades, ax=axes, label="log₁₀ (J / ∫A² dt)")
        axes.plot([1.0], [1.0], "+", color="white", markersize=10)
        axes.grid(visible=False)
        return made


def _map_sentence(error_map: demodulated.ErrorMap) -> str:
    """Say what the paper leaves open, and how far the error reaches in numbers."""

    def at(ratio: float, damping: float) -> float:
        i = int(np.argmin(np.abs(error_map.damping_ratio - damping)))
        j = int(np.argmin(np.abs(error_map.frequency_ratio - ratio)))
        return float(np.sqrt(error_map.error[i, j]))

    return (
        "The paper states neither the range nor the integration time. Here the transient lasts five time constants, and J is"
        " divided by the integral of the squared amplitude of the tuned gyro. The rms error of the amplitude is"
        f" {100 * at(1.0, 1.0):.2f} % when tuned, {100 * at(1.02, 1.0):.0f} % at δk = 1.02, {100 * at(1.0, 1.2):.0f} % at δζ = 1.2"
        f" and {100 * at(1.02, 0.8):.0f} % at δk = 1.02 with δζ = 0.8: lower damping compensates for detuning along the dark arc."
    )


def _draw_filtered(case: Filtered) -> Drawing:
    rows = style.few_rows(len(case.time))
    with style.figure(height=3.4, x="time (s)", y="rate (rad/s)") as (made, axes):
        axes.plot(case.time[rows], case.noisy[rows], color="#b8bec6", linewidth=0.6, label="noisy output")
        axes.plot(case.time[rows], case.rate[rows], "--", color=style.BLACK, linewidth=1.0, label="true rate")
        axes.plot(case.time[rows], case.estimate[rows], color=style.BLUE, label="Wiener filter")
        axes.legend(ncols=3, loc="upper right")
        return made


def _draw_kalman(study: FilterStudy) -> Drawing:
    """Draw figure 6 (output and its estimate) above figure 7 (true rate, output, estimated rate)."""
    six, seven = study.figure6, study.figure7
    rows = style.few_rows(len(six.time))
    with style.figure(2, height=5.4, sharex=True, x="time (s)") as (made, (upper, lower)):
        upper.plot(six.time[rows], six.noisy[rows], color="#b8bec6", linewidth=0.6, label="noisy output")
        upper.plot(six.time[rows], six.output[rows], ":", color=style.BLACK, label="output without noise")
        upper.plot(six.time[rows], six.estimate[rows], color=style.BLUE, label="estimate of the output")
        lower.plot(seven.time[rows], seven.rate[rows], color=style.BLACK, linewidth=1.0, label="true rate")
        lower.plot(seven.time[rows], seven.output[rows], "--", color=style.ORANGE, label="output without noise")
        lower.plot(seven.time[rows], seven.estimate[rows], color=style.BLUE, label="estimate of the rate")
        for axes in (upper, lower):
            axes.legend(ncols=3, loc="upper right", fontsize=8)
            axes.set(ylabel="rate (rad/s)", ylim=(-0.5, 1.75))
        return made


def _kalman_sentence(study: FilterStudy) -> str:
    low, high = study.nis_band
    inside = "inside" if low <= study.mean_nis <= high else "outside"
    return (
        f"The mean normalised innovation squared is {study.mean_nis:.2f}, {inside} its 95 % band {low:.3f} … {high:.3f}. Square pulses"
        " are not the random walk that Q assumes, so the filter is overconfident at every edge."
    )
