"""Chapters on demodulated dynamics and optimal filters: the CVG filtering paper's figures 3 and 5–7."""

import numpy as np

from compensation.demodulated import ErrorMap, respond_to_oscillating_rate
from compensation.sensitive_element import SensitiveElement, tune
from studies.papers.cvg_filters import ZETA, Filtered, FilterStudy, K
from studies.reports import style
from studies.results import Chapter, Column, Drawing, Figure, Table

PAPER = "Demodulated dynamics and optimal noise filtering for Coriolis vibratory gyroscopes"
SOURCES = (f"Apostolyuk V., {PAPER}: eqs. (1)–(41).",)
RESPONSES = (
    "A rate that oscillates at λ acts like an excitation shifted by λ. With matched modes the response is largest for a constant"
    " rate and falls off above kζ. With split modes it is largest where λ equals the frequency difference, on one side only."
)
APART, LIGHT = 1.02, 0.2
WIENER = (
    "name: Noise",
    Column(lambda case: case.optimum.error / case.rate_variance, "Error, optimum", form=".4f"),
    Column(lambda case: case.renormalised.error / case.rate_variance, "Error, as printed", form=".4f"),
    Column(lambda case: case.renormalised.distortion / case.rate_variance, "Distortion part", form=".4f"),
    Column(lambda case: case.renormalised.noise / case.rate_variance, "Noise part", form=".4f"),
    "optimum.filter.steady_gain.real: G(0) of the optimum .4f",
)
WIENER_NOTE = (
    "Error variance divided by the variance of the rate. The printed filters are the optimum scaled to G(0) W(0) = 1, which removes"
    " the error for a constant rate but increases the mean square error."
)
STEPS = (
    "0.0: Step (ms) ×1e3 g | 1.1: Noise of the estimate (rad/s) .4f | 0.1.lag_error: Lag error (rad/s) .3f"
    " | 0.1.output_error: Lag error of the output (rad/s) .3f"
)
STEPS_NOTE = (
    "Noise: standard deviation of the settled filter, from its Riccati equation. Lag errors: rms for pulses of 0.25 s."
    " The paper gives Q per step but not the step."
)


def filter_chapters(study: FilterStudy, error_map: ErrorMap) -> list[Chapter]:
    """Return the chapters for the responses (13), (14), figure 3, the Wiener filters with figure 5, and the Kalman filter with figures 6, 7."""
    responses = (
        "Amplitude and phase (14) of the secondary mode per unit rate, k = 500 Hz, the same excitation for all gyros."
    )
    simplified = "Integral error (26) of the simplified transfer function (24) relative to the full equations (1)."
    five, six, (output_noise, rate_noise) = study.figure5, study.figure6, study.settled_noise[-1]
    pulses = (
        "Square pulses through the full dynamics (1) with white noise (γ = 0.1, B = 3 Hz), filtered by eq. (35)."
        f" Noise {five.noise_before:.3f} → {five.noise_after:.3f} rad/s (factor {five.noise_before / five.noise_after:.1f});"
        f" error relative to the true rate {five.error_before:.3f} → {five.error_after:.3f} rad/s, of which {five.lag_error:.3f}"
        " from the lag of the filter."
    )
    kalman = (
        f"Kalman filter with the paper's Q and R, sampled every {1e3 * (six.time[1] - six.time[0]):g} ms: output noise"
        f" {six.noise_before:.4f} → {output_noise:.4f} rad/s once settled (factor {six.noise_before / output_noise:.0f}); noise of the"
        f" rate estimate {rate_noise:.4f} rad/s."
    )
    cases = "Wiener filters for k = 500 Hz, ζ = 0.025, γ = 0.1, B = 3 Hz"
    steps = list(zip(study.by_step, study.settled_noise, strict=True))
    return [
        Chapter("CVG equations (13), (14): response to an oscillating rate", [
            Figure(draw_responses, responses, "Amplitude and phase over the frequency of the rate."),
            RESPONSES,
        ]),
        Chapter("CVG figure 3: accuracy of the simplified dynamics", [
            Figure(lambda: draw_error_map(error_map), simplified, "A map of the error, least where both modes agree."),
            map_sentence(error_map),
        ]),
        Chapter("CVG equations (35), (36), figure 5: Wiener filter", [
            Table(cases, study.wiener, WIENER, WIENER_NOTE),
            Figure(lambda: draw_filtered(five), pulses, "Square pulses, a noisy output and a filtered one."),
        ]),
        Chapter("CVG equations (37)–(41), figures 6 and 7: Kalman filter", [
            Figure(lambda: draw_kalman(study), kalman, "Output and rate with their estimates over time."),
            Table("Rate estimate by sampling step", steps, STEPS, STEPS_NOTE),
            kalman_sentence(study),
        ]),
    ]  # fmt: skip


def draw_responses() -> Drawing:
    """Draw amplitude and phase (14) over the frequency of the rate, of both signs, for three gyros."""
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
            amplitude, phase = respond_to_oscillating_rate(gyro, 2 * np.pi * frequency)
            still, _ = respond_to_oscillating_rate(tuned, 0.0)
            upper.semilogy(frequency, amplitude / still, label=name)
            lower.plot(frequency, np.degrees(np.unwrap(phase)))
        return made


def draw_error_map(error_map: ErrorMap) -> Drawing:
    """Draw figure 3, the integral error over the ratios of frequency and damping."""
    with style.figure(height=3.8, x="δk = k₂/k₁", y="δζ = ζ₂/ζ₁") as (made, axes):
        grid, levels = (error_map.frequency_ratio, error_map.damping_ratio), np.arange(-6.0, 0.51, 0.5)
        shades = axes.contourf(*grid, np.log10(error_map.error), levels=levels, cmap="viridis", extend="both")
        made.colorbar(shades, ax=axes, label="log₁₀ (J / ∫A² dt)")
        axes.plot([1.0], [1.0], "+", color="white", markersize=10)
        axes.grid(visible=False)
        return made


def map_sentence(error_map: ErrorMap) -> str:
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


def draw_filtered(case: Filtered) -> Drawing:
    """Draw true rate, noisy output and estimate over time."""
    rows = style.few_rows(len(case.time))
    with style.figure(height=3.4, x="time (s)", y="rate (rad/s)") as (made, axes):
        axes.plot(case.time[rows], case.noisy[rows], color="#b8bec6", linewidth=0.6, label="noisy output")
        axes.plot(case.time[rows], case.rate[rows], "--", color=style.BLACK, linewidth=1.0, label="true rate")
        axes.plot(case.time[rows], case.estimate[rows], color=style.BLUE, label="Wiener filter")
        axes.legend(ncols=3, loc="upper right")
        return made


def draw_kalman(study: FilterStudy) -> Drawing:
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


def kalman_sentence(study: FilterStudy) -> str:
    """Say what the filter's own statistics say of the pulses."""
    low, high = study.nis_band
    inside = "inside" if low <= study.mean_nis <= high else "outside"
    return (
        f"The mean normalised innovation squared is {study.mean_nis:.2f}, {inside} its 95 % band {low:.3f} … {high:.3f}. Square pulses"
        " are not the random walk that Q assumes, so the filter is overconfident at every edge."
    )
