"""Ring-down of one resonator: the free part of a record, its decay, what of it is not linear, and the values with intervals."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from compensation.errors import CompensationError
from compensation.ringdown.envelope import Envelope, estimate_noise, thin
from compensation.ringdown.fit import DecayFit, fit_decay
from compensation.ringdown.model import Decay
from compensation.ringdown.whiteness import Leftover, examine

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
LATER = (0.35, 0.6, 0.15)
"""Parts of the record at whose end a free decay is looked for, where the whole is none."""
HALVINGS = 4
LEAST_ROWS = 64
SEARCH_ROWS, ROWS = 300, 1024
PAYS = 20.0
"""Least fall of −2 ln L, over the widening², for which a rate beyond the linear ones is named (e^-10 of odds)."""
WHITE = 1.3
LENGTHS = ("split_Hz", "damping_split_per_s")
RESOLVED = 3.0
"""Standard deviations above zero from which a split has an axis."""
LINES = 3
DRAWS = 2000
BEYOND = {
    "hardening": "The frequency depends on the amplitude (cubic stiffness)",
    "thickening": "The damping depends on the amplitude",
    "chirp": "The frequency drifts with time",
}


@dataclass(frozen=True)
class Estimate:
    """A value with the standard deviation that the bound allows, and its 90 % interval; NaN where nothing determines it."""

    value: float
    sd: float
    low: float
    high: float


@dataclass(frozen=True)
class RingDown:
    """What one decay says.

    Attributes
    ----------
    estimates : mapping
        `frequency_1_Hz` (the higher), `frequency_2_Hz`, `q_1`, `q_2`, `frequency_Hz`, `inverse_q`, `decay_time_s`;
        of two channels `split_Hz`, `frequency_axis_deg`, `damping_split_per_s`, `damping_axis_deg`; where they are seen
        `hardening_Hz`, `thickening_per_s`, at the first amplitude, and `drift_Hz_per_s`.
    fit : DecayFit
        The decay within `window`.
    window : (float, float)
        Seconds of the record that are free decay above the noise.
    remarks : tuple of str
        What is not as it should be, a sentence each.
    """

    estimates: Mapping[str, Estimate]
    fit: DecayFit
    window: tuple[float, float]
    remarks: tuple[str, ...]
    lines: tuple[float, ...] = ()


def analyse_decay(envelope: Envelope, *, harmonic: int = 2, confidence: float = 0.9) -> RingDown:
    """Find the free decay in an envelope and return its frequencies, Q and axes with intervals.

    Parameters
    ----------
    envelope : Envelope
        Of the whole record.
    harmonic : int
        n: a pattern at the azimuth θ has the amplitudes cos nθ and sin nθ in the two channels.
    confidence : float
        Of the intervals.

    Raises
    ------
    CompensationError
        A record without a decay, or two channels that are one.
    """
    _check(envelope)
    end = _find_end(envelope)
    whole = envelope.within(envelope.time[0], end)
    start = _find_start(whole)
    free = thin(whole.within(start, end), ROWS)
    fit, beyond, lines = _fit_all(free)
    left = examine(free.time, fit.residual)
    _check_decays(fit)
    fit = replace(fit, covariance=fit.covariance * left.widening**2, widening=left.widening)
    estimates = _estimate(fit, harmonic, confidence)
    remarks = (*_remark(envelope, fit, left, beyond, lines, start), *_undetermined(fit, estimates))
    return RingDown(estimates, fit, (float(free.time[0]), float(free.time[-1])), remarks, tuple(lines))


def _check(envelope: Envelope) -> None:
    z = envelope.values
    if z.shape[0] == 2:
        x, y = z
        gain = np.vdot(x, y) / np.vdot(x, x)
        if np.linalg.norm(y - gain * x) < 1e-9 * np.linalg.norm(y):
            raise CompensationError("the two channels are one and the same signal; give each pick-off its own column.")


def _find_end(envelope: Envelope) -> float:
    """Return the time after which the amplitude is below half of the noise of a row, for good."""
    z = envelope.values
    noise = estimate_noise(z)
    count = min(64, z.shape[1] // 8)
    size = z.shape[1] // count
    energy = np.sum(np.abs(z[:, : count * size]) ** 2, axis=0).reshape(count, size).mean(axis=1) - noise
    above = np.flatnonzero(energy > 0.25 * noise)
    last = int(above[-1]) + 1 if above.size else count
    return float(envelope.time[min(last * size, envelope.time.size) - 1])


def _find_start(whole: Envelope) -> float:
    """Return the first time from which one decay describes all that follows, its first rows as well as the rest.

    Where that is not the whole record, the last start that fails and the first that does are brought together by halving.
    """
    first, last = float(whole.time[0]), float(whole.time[-1])
    judged: list[tuple[float, float]] = []

    def describes(start: float) -> bool:
        tried = thin(whole.within(start, last), SEARCH_ROWS)
        if tried.time.size < LEAST_ROWS:
            return False
        fit = _fit_modes(tried)
        left = _examine_without_lines(tried, fit)
        if not _plain(left):
            fit, left, _ = _extend(tried, fit, left, ())
        judged.append((left.widening + (10.0 if left.early else 0.0), start))
        return _plain(left)

    if describes(first):
        return first
    good = next((start for part in LATER if describes(start := first + part * (last - first))), None)
    if good is None:
        return min(judged)[1] if judged else first
    bad = max((start for _, start in judged if start < good), default=first)
    for _ in range(HALVINGS):
        middle = (bad + good) / 2
        bad, good = (bad, middle) if describes(middle) else (middle, good)
    return good


def _plain(left: Leftover) -> bool:
    return not left.early and left.widening < WHITE


def _examine_without_lines(envelope: Envelope, fit: DecayFit) -> Leftover:
    """Examine a residual less its largest lines: interference is no reason to shorten the window."""
    residual = fit.residual
    for _ in range(LINES):
        left = examine(envelope.time, residual)
        if left.line is None:
            break
        tone = np.exp(2j * np.pi * left.line * envelope.time)
        residual = residual - np.outer(np.mean(residual * tone.conj(), axis=1), tone)
    return examine(envelope.time, residual)


def _extend(
    envelope: Envelope, fit: DecayFit, left: Leftover, beyond: tuple[str, ...]
) -> tuple[DecayFit, Leftover, tuple[str, ...]]:
    """Add rates beyond the linear ones, the best first, while they pay."""
    modes = 1 if fit.one_mode else 2
    while len(beyond) < len(BEYOND):
        rivals = {
            name: fit_decay(envelope, extra=(*beyond, name), modes=modes, starts=[fit.decay])
            for name in BEYOND
            if name not in beyond
        }
        name = min(rivals, key=lambda one: rivals[one].cost)
        after = examine(envelope.time, rivals[name].residual)
        if not fit.cost - rivals[name].cost > PAYS * after.widening**2:
            break
        fit, left, beyond = rivals[name], after, (*beyond, name)
    return fit, left, beyond


def _fit_all(envelope: Envelope) -> tuple[DecayFit, tuple[str, ...], list[float]]:
    """Fit one mode or two, the rates beyond the linear ones that pay, and lines that are no decay."""
    lines: list[float] = []
    data = envelope
    fit = _fit_modes(data)
    left = examine(data.time, fit.residual)
    beyond: tuple[str, ...] = ()
    while not _plain(left) or left.line is not None:
        fit, left, beyond = _extend(data, fit, left, beyond)
        if left.line is None or len(lines) == LINES:
            break
        lines.append(left.line)
        data, fit = _without_lines(envelope, fit, lines, beyond)
        left = examine(data.time, fit.residual)
    return replace(fit, envelope=envelope), beyond, lines


def _fit_modes(envelope: Envelope) -> DecayFit:
    """Two channels: two modes, which one mode is too. One channel: the second mode where it pays."""
    if envelope.values.shape[0] == 2:
        return fit_decay(envelope)
    one = fit_decay(envelope, modes=1)
    two = fit_decay(envelope, modes=2)
    left = examine(envelope.time, two.residual)
    apart = np.abs(np.diff(two.decay.rates)[0]) > 0
    return two if apart and one.cost - two.cost > PAYS * left.widening**2 and np.all(two.decay.rates.real < 0) else one


def _without_lines(
    envelope: Envelope, fit: DecayFit, lines: list[float], beyond: tuple[str, ...]
) -> tuple[Envelope, DecayFit]:
    """Take lines of constant amplitude out of the data, in turn with the decay."""
    data = envelope
    for _ in range(3):
        left = envelope.values - (data.values - fit.residual)
        step = 1 / (envelope.time[-1] - envelope.time[0])
        tones = np.zeros_like(left)
        for k, line in enumerate(lines):
            near = line + step * np.linspace(-1, 1, 81)
            basis = np.exp(2j * np.pi * np.outer(near, envelope.time))
            power = np.sum(np.abs((left - tones) @ basis.conj().T) ** 2, axis=0)
            lines[k] = float(near[int(np.argmax(power))])
            tone = np.exp(2j * np.pi * lines[k] * envelope.time)
            tones += np.outer(np.mean((left - tones) * tone.conj(), axis=1), tone)
        data = replace(envelope, values=envelope.values - tones)
        fit = fit_decay(data, extra=beyond, modes=1 if fit.one_mode else 2, starts=[fit.decay])
    return data, fit


def _check_decays(fit: DecayFit) -> None:
    rate, sd = fit.decay.decay, fit.sd("decay")
    if not rate > 2 * sd:
        span = fit.envelope.time[-1] - fit.envelope.time[0]
        raise CompensationError(
            f"nothing decays in the {span:.3g} s of this record (1/τ = {rate:.3g} ± {sd:.2g} 1/s); record a free ring-down, longer."
        )


def _derive(decay: Decay, fit: DecayFit, harmonic: int) -> dict[str, float]:
    carrier = fit.envelope.carrier
    rates = decay.rates
    frequencies = carrier + rates.imag / (2 * np.pi)
    mean = carrier + decay.detuning / (2 * np.pi)
    found = {"frequency_Hz": mean, "decay_time_s": 1 / decay.decay}
    if carrier > 0:
        found["inverse_q"] = decay.decay / (np.pi * mean)
    if not fit.one_mode:
        found |= {"frequency_1_Hz": frequencies[0], "frequency_2_Hz": frequencies[1]}
        if carrier > 0:
            found |= {
                f"q_{k}": -np.pi * f / rate.real for k, (f, rate) in enumerate(zip(frequencies, rates, strict=True), 1)
            }
        W, C = complex(decay.stiffness_cos, decay.stiffness_sin), complex(decay.damping_cos, decay.damping_sin)
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
    if "chirp" in fit.names:
        found["drift_Hz_per_s"] = decay.chirp / (2 * np.pi)
    return found


def _estimate(fit: DecayFit, harmonic: int, confidence: float) -> dict[str, Estimate]:
    """Return every derived value with its interval, from draws; axes are cut where they are farthest from the value."""
    best = _derive(fit.decay, fit, harmonic)
    draws = [_derive(one, fit, harmonic) for one in fit.draw(DRAWS, np.random.default_rng(0))]
    found = {}
    for name, value in best.items():
        away = np.array([one[name] for one in draws]) - value
        if name.endswith("axis_deg"):
            period = 180 / harmonic
            value %= period
            away = (away + period / 2) % period - period / 2
        low, high = np.quantile(away, [(1 - confidence) / 2, (1 + confidence) / 2])
        sd = float(np.sqrt(np.mean(away**2)))
        if name in LENGTHS and value < RESOLVED * sd:  # the length of a vector near zero has a limit above alone
            low, high = -value, float(np.quantile(away, confidence))
        found[name] = Estimate(float(value), sd, float(value + low), float(value + high))
    for length, axis in zip(LENGTHS, ("frequency_axis_deg", "damping_axis_deg"), strict=True):
        if axis in found and found[length].value < RESOLVED * found[length].sd:  # any azimuth may be the axis
            value, half = found[axis].value, 90 / harmonic
            found[axis] = Estimate(value, half / float(np.sqrt(3)), value - half, value + half)
    return found


def _remark(
    envelope: Envelope, fit: DecayFit, left: Leftover, beyond: tuple[str, ...], lines: list[float], start: float
) -> list[str]:
    said = []
    first = float(envelope.time[0])
    if start > first:
        said.append(
            f"The first {start - first:.4g} s are no free decay (drive, transient or release) and are left out."
        )
    said += [f"{BEYOND[name]}." for name in beyond]
    for line in lines:
        said.append(f"Interference at {envelope.carrier + line:.6g} Hz is taken out; find its source.")
    if envelope.clipped:
        said.append(
            f"{100 * envelope.clipped:.2g} % of the first samples are clipped: the early decay is distorted; lower the gain."
        )
    if envelope.lost > 0.001:
        said.append(f"{100 * envelope.lost:.2g} % of the samples are lost.")
    if left.widening > 1:
        said.append(
            f"What the fit leaves is not white noise: intervals are {left.widening:.3g} times as wide as the Cramér–Rao bound of white noise."
        )
    if left.early:
        said.append("The first rows of the window still miss the fit: no part of this record is a plain free decay.")
    if left.widening > 3:
        said.append("Poor fit: take the values as indications.")
    return said


def _undetermined(fit: DecayFit, estimates: Mapping[str, Estimate]) -> list[str]:
    said = []
    if "split_Hz" in estimates:
        split = estimates["split_Hz"]
        width = 1 / (np.pi * estimates["decay_time_s"].value)
        if not split.value > RESOLVED * split.sd:
            said.append(f"The split is not resolved: below {split.high:.3g} Hz; its axis is not determined.")
        elif split.value < width:
            said.append(
                f"The split of {split.value:.3g} Hz is less than the line width of {width:.3g} Hz: the modes overlap."
            )
    if "damping_split_per_s" in estimates:
        split = estimates["damping_split_per_s"]
        if not split.value > RESOLVED * split.sd:
            said.append(f"The damping split is not resolved: below {split.high:.3g} 1/s; its axis is not determined.")
    return said
