"""Ring-down of one resonator: the free part of a record, its decay, nonlinear terms, and the values with intervals."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from compensation.arrays import Array, Complex
from compensation.constants import NINETY
from compensation.errors import CompensationError
from compensation.ringdown.answer import Curve, Estimate, RingDown
from compensation.ringdown.envelope import LEAST, Envelope
from compensation.ringdown.fit import DecayFit, drift_shapes
from compensation.ringdown.model import Decay
from compensation.ringdown.whiteness import Leftover
from compensation.ringdown.window import find_end, find_free, find_jump

RESOLVED = 3.0  # standard deviations above zero from which a split has an axis
CIRCULAR = -0.5  # product of the senses of two waves (1 and −1 of circles) below which they are a pattern that turns
LENGTHS = ("split_Hz", "damping_split_per_s")
DRAWS = 2000
ALIKE = 1e-6  # relative: two pick-offs differ by more, files of nine digits round to less
SAID_OF = {
    "hardening": "The frequency depends on the amplitude (cubic stiffness)",
    "thickening": "The damping depends on the amplitude",
}


def analyse_decay(envelope: Envelope, *, harmonic: int = 2) -> RingDown:
    """Find the free decay in an envelope and return its frequencies, Q and axes with intervals."""
    if len(envelope.values) == 2:
        x, y = envelope.values
        if np.linalg.norm(y - np.vdot(x, y) / np.vdot(x, x) * x) < ALIKE * np.linalg.norm(y):
            raise CompensationError("the two channels carry the same signal; give each pick-off its own column.")
    if (rows := envelope.time.size) < LEAST:
        raise CompensationError(
            f"the samples make {rows} amplitudes of whole periods; a decay needs {LEAST} or more: record longer or sample faster."
        )
    given = envelope
    if envelope.clipped:
        envelope = envelope.within(envelope.overload + envelope.width, float(envelope.time[-1]))
    if envelope.time.size < LEAST:
        raise CompensationError(
            f"{100 * given.clipped:.2g} % of the first samples are clipped at one end, and some until {given.overload:.4g} s: the amplifier is overloaded to the end; lower the gain."
        )
    jump = find_jump(envelope)
    if jump is not None:
        if jump > (envelope.time[0] + envelope.time[-1]) / 2:
            raise CompensationError(
                f"the phase jumps at {jump:.6g} s: the reference was lost, samples are missing without a gap in time_s, or a block is repeated."
                " Cut the file there and fit the longer part."
            )
        envelope = envelope.within(jump, float(envelope.time[-1]))
    found = find_free(envelope.within(envelope.time[0], find_end(envelope)))
    fit, left = found.fit, found.left
    _check_decays(fit)
    fit = replace(fit, covariance=fit.covariance * left.widening**2, widening=left.widening)
    estimates = _estimate(fit, harmonic)
    turning = _turning(fit, harmonic)
    lines = () if turning else _sources(fit)
    remarks = (*turning, *_remark(given, fit, left, jump, lines), *_undetermined(fit, estimates))
    time = fit.envelope.time
    curves = tuple(
        Curve(time, _level_dB(z), _level_dB(z - r), np.real(r))
        for z, r in zip(fit.envelope.values, fit.residual, strict=True)
    )
    window = (float(time[0]), float(time[-1]))
    return RingDown(estimates, remarks, tuple(fit.noise.tolist()), fit.widening, curves, window, lines)


def _level_dB(z: Complex) -> Array:
    return np.asarray(20 * np.log10(np.where(z == 0, np.nan, np.abs(z))))  # 0: a model below the rounding of the noise


def _turning(fit: DecayFit, harmonic: int) -> tuple[str, ...]:
    """Say that the pattern turns where the wave and what is taken for a line are circular, in opposite senses."""

    def sense(z: Complex) -> float:
        return float(2 * np.imag(np.conj(z[0]) * z[1]) / np.sum(np.abs(z) ** 2)) if z.size == 2 else 0.0

    sizes = np.array(fit.found.sizes)
    if not fit.one_mode or not sizes.size:
        return ()
    largest = int(np.argmax(np.sum(np.abs(sizes) ** 2, axis=1)))
    if sense(fit.start) * sense(sizes[largest]) > CIRCULAR:
        return ()
    apart = abs(fit.found.tones[largest] - fit.decay.detuning)
    turn = np.degrees(apart / 2 / harmonic)
    return (
        f"Two circular waves in opposite senses are {apart / (2 * np.pi):.3g} Hz apart: the pattern turns by {turn:.3g} °/s, so the gyro turns"
        " at that rate over its Bryan factor. Record it at rest: as it is, the rate changes every value.",
    )


def _sources(fit: DecayFit) -> tuple[float, ...]:
    """Return the frequencies (Hz) of the interference; two lines may be one source and its image."""
    found: list[float] = []
    for one in (fit.envelope.source_of(tone / (2 * np.pi)) for tone in fit.found.tones):
        if all(abs(one - other) > 2 / float(np.ptp(fit.envelope.time)) for other in found):
            found.append(one)
    return tuple(found)


def _check_decays(fit: DecayFit) -> None:
    rate, sd = fit.decay.decay, fit.sd("decay")
    if not rate > 2 * sd:
        span = fit.envelope.time[-1] - fit.envelope.time[0]
        raise CompensationError(
            f"nothing decays in the {span:.3g} s of this record (1/τ = {rate:.3g} ± {sd:.2g} 1/s); switch the drive off, or record longer."
        )


def _derive(decay: Decay, fit: DecayFit, harmonic: int) -> dict[str, Any]:
    """Return the values of a decay, or those of draws as arrays."""
    carrier = fit.envelope.carrier
    rates = decay.rates
    frequencies = carrier + rates.imag / (2 * np.pi)
    mean = carrier + decay.detuning / (2 * np.pi)
    found: dict[str, Any] = {"frequency_Hz": mean, "decay_time_s": 1 / decay.decay}
    if carrier > 0:
        found["inverse_q"] = decay.decay / (np.pi * mean)
    if not fit.one_mode:
        found |= {"frequency_1_Hz": frequencies[0], "frequency_2_Hz": frequencies[1]}
        if carrier > 0:
            found |= {
                f"q_{k}": -np.pi * f / rate.real for k, (f, rate) in enumerate(zip(frequencies, rates, strict=True), 1)
            }
        W, C = decay.stiffness_cos + 1j * decay.stiffness_sin, decay.damping_cos + 1j * decay.damping_sin
        if fit.summed:
            found["split_Hz"] = frequencies[0] - frequencies[1]
        else:
            found |= {
                "split_Hz": abs(W) / np.pi,
                "frequency_axis_deg": np.degrees(np.angle(W)) / (2 * harmonic),
                "damping_split_per_s": 2 * abs(C),
                "damping_axis_deg": np.degrees(np.angle(C)) / (2 * harmonic),
            }
    first = float(np.sum(np.abs(fit.start) ** 2))
    if "hardening" in fit.names:
        found["hardening_Hz"] = decay.hardening * first / (2 * np.pi)
    if "thickening" in fit.names:
        found["thickening_per_s"] = decay.thickening * first
    return found


def _estimate(fit: DecayFit, harmonic: int) -> dict[str, Estimate]:
    """Return every derived value with its interval, from draws; axes are cut where they are farthest from the value."""
    best = _derive(fit.decay, fit, harmonic)
    draws = _derive(fit.draw(DRAWS, np.random.default_rng(0)), fit, harmonic)
    found = {}
    for name, value in best.items():
        away = draws[name] - value
        if name.endswith("axis_deg"):
            period = 180 / harmonic
            value %= period
            away = (away + period / 2) % period - period / 2
        low, high = np.quantile(away, [0.05, 0.95])
        sd = float(np.sqrt(np.mean(away**2)))
        if name in LENGTHS and value < RESOLVED * sd:  # the length of a vector near zero has a limit above alone
            low, high = -value, float(np.quantile(away, 0.9))
        found[name] = Estimate(float(value), sd, float(value + low), float(value + high))
    for length, axis in zip(LENGTHS, ("frequency_axis_deg", "damping_axis_deg"), strict=True):
        if axis in found and found[length].value < RESOLVED * found[length].sd:  # any azimuth may be the axis
            value, half = found[axis].value, 90 / harmonic
            found[axis] = Estimate(value, half / float(np.sqrt(3)), value - half, value + half)
    return found


def _remark(
    envelope: Envelope, fit: DecayFit, left: Leftover, jump: float | None, lines: tuple[float, ...]
) -> list[str]:
    said = []
    first, start = float(envelope.time[0]), float(fit.envelope.time[0])
    if jump is not None:
        said.append(
            f"The phase jumps at {jump:.4g} s (reference or samples lost, a block repeated, or a drive switched): only the part after it is used."
        )
    if start - max(first, jump or first, envelope.overload) > 3 * fit.envelope.width:
        said.append(f"The first {start - first:.4g} s are no free decay (drive or transient) and are left out.")
    said += [f"{SAID_OF[name]}." for name in fit.terms.curved]
    if fit.terms.drift:
        phase = np.array(fit.found.drift) @ drift_shapes(fit.envelope, fit.terms.drift)
        course = np.gradient(phase, fit.envelope.time)
        said.append(
            f"The frequency drifts with time, by {np.ptp(course) / (2 * np.pi):.2g} Hz: the frequencies are means, weighted with the power of the decay."
        )
    if lines:
        at = ", ".join(f"{line:.8g}" for line in lines)
        said.append(f"Interference at {at} Hz is removed; find its source.")
    if envelope.clipped:
        said.append(
            f"{100 * envelope.clipped:.2g} % of the first samples are clipped at one end, some until {envelope.overload:.4g} s: this part is left out; lower the gain."
        )
    if envelope.lost > 0.001:
        said.append(f"{100 * envelope.lost:.2g} % of the samples are lost.")
    if left.widening > 1:
        said.append(
            f"The residual is not white noise: intervals are {left.widening:.3g} times as wide as the Cramér–Rao bound of white noise."
        )
    if left.early:
        said.append("The first rows of the window do not fit: no part of this record is a plain free decay.")
    if left.widening > 3:
        said.append("Poor fit: take the values as indications.")
    return said


def _undetermined(fit: DecayFit, estimates: Mapping[str, Estimate]) -> list[str]:
    said = []
    if fit.one_mode:
        said.append("Only one mode is seen: the other is not excited, or not resolved. The axes are not known.")
    if "split_Hz" in estimates:
        split = estimates["split_Hz"]
        width = 1 / (np.pi * estimates["decay_time_s"].value)
        if not split.value > RESOLVED * split.sd:
            said.append(f"The split is not resolved: below {split.high:.3g} Hz; its axis is not determined.")
        elif split.value < width:
            said.append(f"The split of {split.value:.3g} Hz is below the line width {width:.3g} Hz: the modes overlap.")
    if {"frequency_1_Hz", "split_Hz", "damping_axis_deg"} <= set(estimates):
        upper, lower, elastic = (estimates[name] for name in ("frequency_1_Hz", "frequency_2_Hz", "split_Hz"))
        less = elastic.value - (upper.value - lower.value)
        if less > NINETY * float(np.hypot(np.hypot(upper.sd, lower.sd), elastic.sd)):
            said.append(
                f"The two frequencies are {less:.2g} Hz closer than the split, which is of stiffness and mass alone: damping about another axis pulls them together."
            )
    if "damping_split_per_s" in estimates:
        split = estimates["damping_split_per_s"]
        if not split.value > RESOLVED * split.sd:
            said.append(f"The damping split is not resolved: below {split.high:.3g} 1/s; its axis is not determined.")
    return said
