"""Complex amplitudes of a decay, from raw samples of the carrier or from a lock-in amplifier.

Raw samples x(t) = level + Re{z e^{2πi f_c t}} are fitted over blocks of whole carrier periods by least squares, at their own times where these are on no
even grid; the average of an exponential over a block is corrected where it is fitted. Samples that are lost leave the rest as it is, and
neither they nor a part of a period lets the level or the image z* e^{−4πi f_c t} into z, where it would look like a second mode.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from compensation.arrays import Array, Complex
from compensation.errors import CompensationError

LEAST = 16  # amplitudes of a decay
MOST_BLOCKS = 4096
CHUNK = 1 << 18
LENGTHS = (1 << 12, 1 << 15, CHUNK)  # of rows in which the line is looked for: a decay may be short in its record
PASSES = 3  # each takes the image out as the amplitudes of the one before change within the blocks
WRITTEN = 0.75  # of the last digit by which the times of an even grid may be off: half of it, and the error of the line of all times
FEWEST, APART = 12, 20  # samples of a block; steps from which a distance between samples is a gap
NEAR, OFF = 0.01, 0.25
"""Parts of a frequency that is given: a line as far from it counts half its power; the most that a card or a designer may be off."""
ABOVE = 30.0  # times the median power of a spectrum, which noise alone passes nowhere
ALONE = 0.7  # part of a block's samples above which what is left of the image e^{−2iωt} cannot be told from the wave
SHORTEST = (0.01, 0.1, 0.5)
"""Parts of the distances between rows, of which the shortest that is a step of a grid is taken."""
GRID = 0.2  # standard deviation of the distances (steps) on a grid; that of distances of any length is 0.29


@dataclass(frozen=True)
class Envelope:
    """Complex amplitudes about a carrier."""

    time: Array  # array (rows,), s, middle of each block, from the first sample of the record
    # array (channels, rows) z of each channel, in the unit of the record, by rows; NaN where a block has no samples
    values: Complex
    carrier: float  # Hz, the frequency that turns e^{2πi f t}: f_c of raw samples, the reference of a lock-in
    width: float  # s, length of a block
    # part of the raw samples at the ends of their range where the record is flat there; 0 of a lock-in
    clipped: float = 0.0
    overload: float = 0.0  # s, of the last sample that is clipped
    lost: float = 0.0  # part of the time without samples
    spread: float = 0.0  # s², variance of the times that a row averages; 0 of a lock-in's own rows
    bin: float = 0.0  # Hz, step of `power`
    power: Array | None = None  # spectrum of the last raw samples, where the decay is weakest

    def within(self, start: float, end: float) -> "Envelope":
        """The rows between two times (s)."""
        keep = (self.time >= start) & (self.time <= end)
        return replace(self, time=self.time[keep], values=self.values[:, keep])

    def source_of(self, line: float) -> float:
        """Return the frequency (Hz) of the interference that a line (Hz from the carrier) in the blocks is, folded or not.

        Of all that fold onto it, f_c + line + m/width, it is the one whose raw power, less what a block averages out, is largest.
        """
        if self.power is None:
            return self.carrier + line
        reach = int((self.bin * self.power.size + self.carrier) * self.width)
        found = self.carrier + line + np.arange(-reach, reach + 1) / self.width
        place = np.rint(np.abs(found) / self.bin).astype(int)
        found, place = found[place < self.power.size - 1], place[place < self.power.size - 1]
        near = np.max([self.power[np.abs(place + k)] for k in (-1, 0, 1)], axis=0)
        return float(np.abs(found[np.argmax(near * np.sinc((found - self.carrier) * self.width) ** 2)]))


def find_carrier(samples: ArrayLike, rows: NDArray[np.int64], rate: float, about: float | None = None) -> float:
    """Return the frequency (Hz) of the largest line of raw samples that stand at, or near, the `rows` of an even grid.

    Of the strongest rows of several lengths those in which it stands highest above the median; Hann window, parabola of the log;
    a lost row counts as zero. A frequency `about` that of the line says in which zone of half the rate it is, and which line is
    meant: the nearer a line, the more its power counts.
    """
    x = np.asarray(samples, dtype=np.float64)
    x = x - np.mean(x)
    seen = 0.0 if about is None else alias_of(about, rate)

    def look(length: int, about: float | None) -> tuple[float, float, float]:
        """Return what a line counts, its power over the median, and its frequency (Hz)."""
        at = int(np.argmax(np.bincount(rows // length, x**2)))
        power = _spectrum(x, rows, at * length, length)
        power /= np.median(power) + 1e-300
        away = np.arange(power.size) * rate / length - seen
        counts = power if about is None else power / (1 + (away / (NEAR * about)) ** 2)
        peak = int(np.argmax(counts[1:-1])) + 1
        left, middle, right = 0.5 * np.log(power[peak - 1 : peak + 2] + 1e-300)
        curve = left - 2 * middle + right
        place = peak + (0.5 * (left - right) / curve if curve else 0.0)
        return float(counts[peak]), float(power[peak]), float(place * rate / length)

    lengths = sorted({min(int(rows[-1]) + 1, length) for length in LENGTHS})
    _, above, found = max(look(length, about) for length in lengths)
    if about is None:
        return found
    if abs(found - seen) > OFF * about or above < ABOVE:
        *_, largest = max(look(length, None) for length in lengths)
        raise CompensationError(
            f"no line of the samples is within {100 * OFF:g} % of the {about:.6g} Hz given; their largest is at {largest:.6g} Hz."
            " Correct or leave out --frequency, or the reference in the file."
        )
    return about + (found - seen) * (1.0 if about % rate <= rate / 2 else -1.0)


def _spectrum(x: Array, rows: NDArray[np.int64], first: int, length: int) -> Array:
    """Return the power of the samples in `length` rows of an even grid from the `first`, by a Hann window."""
    here = (rows >= first) & (rows < first + length)
    stretch = np.bincount(rows[here] - first, x[here], length)
    return np.asarray(np.abs(np.fft.rfft(stretch * np.hanning(length))) ** 2)


def mix_down(time: ArrayLike, channels: ArrayLike, carrier: float | None = None) -> Envelope:
    """Return the complex amplitudes of raw samples (channels, N) about their largest line, or the one that a `carrier` (Hz) is about.

    One above half of the sampling rate is found in its alias.
    """
    t = np.asarray(time, dtype=np.float64)
    x = np.atleast_2d(np.asarray(channels, dtype=np.float64))
    if t.size < 64:
        raise CompensationError(f"a decay of raw samples needs 64 rows or more, not {t.size}.")
    step, rows = even_rows(t)
    clock = step * (rows - np.mean(rows)) + np.mean(t)
    away = float(np.max(np.abs(t - clock)))
    t = clock - clock[0] if away < WRITTEN * _digit(t) else t - t[0]
    rate, span, known = 1 / step, int(rows[-1]) + 1, np.all(np.isfinite(x), axis=0)
    if np.count_nonzero(known) < 64:
        raise CompensationError(
            f"{np.count_nonzero(known)} rows have a value of every pick-off; a decay needs 64 or more."
        )
    variances = np.var(x[:, known], axis=1)
    if not variances.any():
        raise CompensationError("the samples are all 0 or alike: nothing was recorded; check the pick-off.")
    carrier = find_carrier(x[int(np.argmax(variances)), known], rows[known], rate, carrier)
    seen = alias_of(carrier, rate)  # Hz, where these rows hold it
    period = rate / max(seen, rate / t.size)  # in rows of the grid
    clipped, after = _clipped(x)
    overload = float(t[max(after, 1) - 1])
    fine = known & ~_stuck(x, period)
    if np.count_nonzero(fine) < 64:
        raise CompensationError("fewer than 64 samples differ from those before them; check the pick-off.")
    true = fine & (np.arange(t.size) >= after)
    x = x - np.mean(x[:, true if true.any() else fine], axis=1, keepdims=True)
    t, x, rows = t[fine], x[:, fine], rows[fine]
    between = np.diff(t)
    sparse = max(float(np.mean(between[between < APART * np.median(between)])) / step, 1.0)  # rows for each sample
    # the block holds a whole number of half periods as nearly as may be
    least = max(sparse * t.size / MOST_BLOCKS, 8 * period, FEWEST * sparse)
    sizes = np.arange(int(np.ceil(least)), int(np.ceil(1.3 * least + 2 * period)) + 1)
    size = int(sizes[int(np.argmin(np.abs(np.sin(2 * np.pi * sizes / period)) / sizes))])
    if seen * t.size < rate or (rate - 2 * seen) * size < 0.5 * rate:
        raise CompensationError(
            f"the line at {carrier:.6g} Hz and its image in samples at {rate:.6g} Hz fall together; sample at another rate."
        )
    block, count = rows // size, (span - 1) // size + 1

    parts = [slice(k, k + CHUNK) for k in range(0, t.size, CHUNK)]

    def add(terms: Complex, part: slice) -> Complex:
        return np.asarray(
            np.bincount(block[part], terms.real, count) + 1j * np.bincount(block[part], terms.imag, count)
        )

    def turn(part: slice) -> Complex:
        return np.asarray(np.exp(-2j * np.pi * carrier * t[part]))

    # x = level + Re{z e^{iωt}} in a block of N samples: Σ 2x e^{−iωt} = 2p level + N z + q z*, Σ x = N level + Re{p* z}
    weight = np.bincount(block, minlength=count)
    middle = np.bincount(block, t, count) / np.maximum(weight, 1)
    p, q = (sum((add(turn(part) ** power, part) for part in parts), np.zeros(count, complex)) for power in (1, 2))
    of_level = p / np.maximum(weight, 1)
    own, image = weight - np.abs(p) * np.abs(of_level), q - p * of_level
    keep = (weight >= 0.5 * size / sparse) & (np.abs(image) < ALONE * own)
    keep[-1] &= span % size == 0  # a part of a block is no row like the others
    if np.count_nonzero(keep) < 4:
        raise CompensationError("fewer than four blocks of eight periods have half of their samples; record longer.")
    values = np.zeros((x.shape[0], count), dtype=complex)
    for c, _ in np.ndindex(x.shape[0], PASSES):
        course = scipy.interpolate.CubicSpline(middle[keep], values[c, keep])
        total = np.zeros(count, complex)
        for part in parts:
            e = turn(part)
            slope = course(t[part]) - values[c, block[part]]
            flat = x[c, part] - (slope * e.conj()).real
            total += add(2 * x[c, part] * e - slope.conj() * e**2 - 2 * of_level[block[part]] * flat, part)
        values[c] = (own * total - image * total.conj()) / np.where(keep, own**2 - np.abs(image) ** 2, 1.0)
    lost = 1 - float(np.sum(weight)) * (sparse if away > GRID * step else 1.0) / span
    length = min(span, CHUNK)
    power = np.sum([_spectrum(one, rows, span - length, length) for one in x], axis=0)
    return Envelope(
        middle[keep], values[:, keep], carrier, size * step, clipped, overload, max(lost, 0.0),
        (size * step) ** 2 / 12, rate / length, power,
    )  # fmt: skip


def alias_of(frequency: float, rate: float) -> float:
    """Return the frequency (Hz) below half of the sampling rate at which samples hold one."""
    return abs((frequency + rate / 2) % rate - rate / 2)


def even_rows(time: Array) -> "tuple[float, NDArray[np.int64]]":
    """Return the step of evenly sampled rows (s), however few digits their times are written with, and the place of each row.

    Rows that stand on no even grid, or on several, get the nearest places of one.
    """
    step = float(time[-1] - time[0]) / (time.size - 1)
    whole = np.arange(time.size)
    if np.max(np.abs(time - time[0] - step * whole)) < 0.5 * step:  # no row is lost
        rows = whole
    else:
        between = np.diff(time)
        for share in SHORTEST:
            step = float(np.quantile(between, share))
            for _ in range(4):
                count = np.rint(between / step)
                near = (count > 0) & (count < APART)
                step = float(np.sum(between[near]) / np.sum(count[near]))
            if np.std((between / step - count)[near]) < GRID:
                break
        rows = np.cumsum(np.r_[0.0, np.rint(between / step)])
        step = float((time[-1] - time[0]) / rows[-1])
        rows = np.rint((time - time[0]) / step).astype(np.int64)
    middle = rows - rows.mean()  # the line of all times is free of their digits
    return float(middle @ (time - time[0]) / (middle @ middle)), rows


def _digit(time: Array) -> float:
    """Return the step (s) in which the last times are written: a power of ten, or that of single or double precision."""
    last = time[-(time.size // 10 + 1) :]
    least = float(np.spacing(np.max(np.abs(time))))
    if np.array_equal(last, last.astype(np.float32)):
        return float(np.spacing(np.float32(last[-1])))
    decimal = (10.0**-k for k in range(16) if np.all(np.abs(last - np.round(last, k)) <= 2 * least))
    return max(next(decimal, 0.0), 4 * least)


def from_lock_in(time: ArrayLike, amplitudes: ArrayLike, carrier: float = 0.0) -> Envelope:
    """Return the complex amplitudes of a lock-in's rows, averaged to a few thousand blocks where there are more."""
    t = np.asarray(time, dtype=np.float64)
    z = np.atleast_2d(np.asarray(amplitudes, dtype=np.complex128))
    held = _stuck(z, 1.0)
    keep = np.isfinite(t) & np.all(np.isfinite(z), axis=0) & ~held
    lost = 1 - float(np.mean(keep))
    t, z = t[keep], z[:, keep]
    if t.size < LEAST:
        raise CompensationError(
            f"a decay needs {LEAST} rows or more with a value in every channel, not {t.size}"
            + (
                f"; {np.count_nonzero(held)} rows repeat the one before or are 0: nothing was measured."
                if held.any()
                else "."
            )
        )
    step = float(np.median(np.diff(t)))
    between = np.diff(t) / step
    if np.median(np.abs(between - 1)) < 0.01:  # an even clock: rows may be absent
        lost = max(lost, 1 - t.size / (1 + float(np.sum(np.rint(between)))))
    return thin(Envelope(t - t[0], z, carrier, step, lost=lost), MOST_BLOCKS)


def estimate_noise(values: Complex) -> float:
    """Return the variance of white noise, summed over channels, from second differences of what does not turn from row to row; the median of |n|² is ln 2 times its mean."""
    turn = np.angle(np.vdot(values[:, :-1], values[:, 1:]))  # a line off the reference
    still = values * np.exp(-1j * turn * np.arange(values.shape[1]))
    return float(np.sum(np.median(np.abs(np.diff(still, 2, axis=1)) ** 2, axis=1)) / (6 * np.log(2)))


def thin(envelope: Envelope, rows: int) -> Envelope:
    """Average neighbouring rows down to `rows`, as far as that costs no more than 0.2 % of the signal's power; never across a gap."""
    t, z, noise = envelope.time, envelope.values, estimate_noise(envelope.values)
    signal = max(float(np.sum(np.mean(np.abs(z) ** 2, axis=1))) - noise, 1e-300)
    size = z.shape[1] // rows
    while size > 1:
        block = even_rows(t)[1] // size
        _, first, count = np.unique(block, return_index=True, return_counts=True)
        full = count > size / 2
        full[-1] &= count[-1] == size
        means = np.add.reduceat(z, first, axis=1)[:, full] / count[full]
        whole = float(np.sum(np.abs(means) ** 2 @ count[full])) / float(np.sum(count[full]))
        if whole - noise * full.sum() / float(np.sum(count[full])) > 0.998 * signal:
            time = (np.add.reduceat(t, first) / count)[full]
            spread = envelope.spread + (size**2 - 1) / 12 * envelope.width**2
            return replace(envelope, time=time, values=means, width=envelope.width * size, spread=spread)
        size //= 2
    return envelope


def _stuck(x: Array | Complex, most: float) -> NDArray[np.bool_]:
    """Mark runs of more than `most` rows that repeat the row before them, or are zero, in all channels: no measurement."""
    same = np.all(x[:, 1:] == x[:, :-1], axis=0)
    ends = np.flatnonzero(np.diff(np.r_[False, same, False].astype(np.int8)))
    found = np.zeros(x.shape[1], dtype=bool)
    for first, last in ends.reshape(-1, 2):  # rows first … last are equal
        if last - first >= most:
            found[first + bool(np.any(x[:, first])) : last + 1] = True
    return found


def _clipped(x: Array) -> tuple[float, int]:
    """Part of the first samples that stand at an end of their range, beyond what a sine leaves there, and the row after the last of them."""
    worst, after = 0.0, 0
    for channel in (*x, *-x):
        loudest = (fine := channel[np.isfinite(channel)])[: max(fine.size // 10, 64)]
        if not fine.size or not (span := float(np.ptp(fine))):
            continue
        step = float(np.min(np.diff(np.unique(loudest)), initial=span))
        sine = np.sqrt(4 * step / span) / np.pi  # of few digits stands at its peak
        at_end = channel >= float(fine.max()) - 1e-6 * span
        part = float(np.mean(at_end[np.isfinite(channel)][: loudest.size]))
        if part > max(0.005, 1.2 * sine):
            worst, after = max(worst, part), max(after, int(np.flatnonzero(at_end)[-1]) + 1)
    return worst, after
