"""Complex amplitudes of a decay, from raw samples of the carrier or from a lock-in amplifier.

Raw samples x(t) = Re{z e^{2πi f_c t}} are mixed with e^{−2πi f_c t} and averaged over blocks of whole carrier periods; the
average of an exponential over a block is corrected where it is fitted. Blocks with lost samples count what they have. What a block
that holds no whole number of periods leaves of the image z* e^{−4πi f_c t} is taken out: left in, it looks like a second mode.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compensation.arrays import Array, Complex
from compensation.errors import CompensationError

LEAST = 16  # amplitudes of a decay
MOST_BLOCKS = 4096
CHUNK = 1 << 18
PASSES = 3  # each takes the image out with the amplitudes of the one before, straight between the blocks
WRITTEN = 0.5  # part of a step by which the times of an even grid may be off for their few digits


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

    def within(self, start: float, end: float) -> "Envelope":
        """The rows between two times (s)."""
        keep = (self.time >= start) & (self.time <= end)
        return replace(self, time=self.time[keep], values=self.values[:, keep])


def find_carrier(samples: ArrayLike, rate: float) -> float:
    """Return the frequency (Hz) of the largest line of evenly sampled raw data: strongest 2¹⁸ rows, Hann window, parabola of the log."""
    x = np.asarray(samples, dtype=np.float64)
    length = min(x.size, CHUNK)
    starts = range(0, x.size - length + 1, max(length, 1))
    at = max(starts, key=lambda k: float(np.var(x[k : k + length])))
    stretch = x[at : at + length]
    stretch = np.nan_to_num(stretch - np.nanmean(stretch))
    spectrum = np.abs(np.fft.rfft(stretch * np.hanning(length)))
    peak = int(np.argmax(spectrum[1:-1])) + 1
    left, middle, right = np.log(spectrum[peak - 1 : peak + 2] + 1e-300)
    curve = left - 2 * middle + right
    return float((peak + (0.5 * (left - right) / curve if curve else 0.0)) * rate / length)


def mix_down(time: ArrayLike, channels: ArrayLike, carrier: float | None = None) -> Envelope:
    """Return the complex amplitudes of raw samples (channels, N); the carrier (Hz) is the largest line unless given."""
    t = np.asarray(time, dtype=np.float64)
    x = np.atleast_2d(np.asarray(channels, dtype=np.float64))
    if t.size < 64:
        raise CompensationError(f"a decay of raw samples needs 64 rows or more, not {t.size}.")
    step, rows = even_rows(t)
    t = t[0] + step * rows if np.max(np.abs(t - t[0] - step * rows)) < WRITTEN * step else t
    rate = 1 / step
    if carrier is None:
        carrier = find_carrier(x[int(np.argmax(np.nanvar(x, axis=1)))], rate)
    if not 0 < carrier < rate / 2:
        raise CompensationError(f"the frequency {carrier:.6g} Hz is not below half the sampling rate {rate:.6g} Hz.")
    if not np.nanvar(x, axis=1).any():
        raise CompensationError("the samples are all 0 or alike: nothing was recorded; check the pick-off.")
    period = rate / carrier  # in samples
    # the block holds a whole number of half periods as nearly as may be
    least = max(t.size / MOST_BLOCKS, 8 * period)
    sizes = np.arange(int(np.ceil(least)), int(np.ceil(1.3 * least + 2 * period)) + 1)
    size = int(sizes[int(np.argmin(np.abs(np.sin(2 * np.pi * sizes / period)) / sizes))])
    if 2 * min(carrier, rate / 2 - carrier) * size < 0.5 * rate:
        raise CompensationError(
            f"the line at {carrier:.6g} Hz and its image in samples at {rate:.6g} Hz fall together; sample at another rate."
        )
    block = rows // size
    count = int(block[-1]) + 1
    fine = np.all(np.isfinite(x), axis=0) & ~_stuck(x, period)
    clipped, after = _clipped(x)
    true = fine & (np.arange(t.size) >= after)
    level = np.mean(x[:, true if true.any() else fine], axis=1, keepdims=True)
    weight = np.bincount(block, fine, count)
    middle = np.bincount(block, fine * (t - t[0]), count) / np.maximum(weight, 1)
    keep = weight >= 0.5 * size
    keep[-1] &= (int(rows[-1]) + 1) % size == 0  # a part of a block is no row like the others
    if np.count_nonzero(keep) < 2:
        raise CompensationError("fewer than two blocks of eight periods have half of their samples; record longer.")
    ends = middle[keep][[0, -1]] + size * step * np.array([-1, 1])
    knots = np.concatenate([ends[:1], middle[keep], ends[1:]])
    values = np.zeros((x.shape[0], np.count_nonzero(keep)), dtype=complex)
    for _ in range(PASSES):
        around = np.concatenate(
            [2 * values[:, :1] - values[:, 1:2], values, 2 * values[:, -1:] - values[:, -2:-1]], axis=1
        )
        total = np.zeros((x.shape[0], count), dtype=complex)
        for k in range(0, t.size, CHUNK):
            part = slice(k, k + CHUNK)
            turn = np.exp(-2j * np.pi * carrier * (t[part] - t[0]))
            first = int(block[part][0])
            index = block[part] - first
            places = slice(first, first + int(index[-1]) + 1)
            for c in range(x.shape[0]):
                # x = Re{z e^{iωt}}, so 2 x e^{−iωt} is z + z* e^{−2iωt}
                image = np.interp(t[part] - t[0], knots, around[c]).conj() * turn**2
                terms = np.where(fine[part], 2 * (x[c, part] - level[c]) * turn - image, 0.0)
                total[c, places] += np.bincount(index, terms.real) + 1j * np.bincount(index, terms.imag)
        values = total[:, keep] / weight[keep]
    return Envelope(
        middle[keep], values, carrier, size * step, clipped, float(t[max(after, 1) - 1] - t[0]),
        1 - float(np.sum(weight)) / int(rows[-1] + 1), (size * step) ** 2 / 12,
    )  # fmt: skip


def even_rows(time: Array) -> "tuple[float, NDArray[np.int64]]":
    """Return the step of evenly sampled rows (s), however few digits their times are written with, and the place of each row."""
    step = float(time[-1] - time[0]) / (time.size - 1)
    whole = np.arange(time.size)
    if (
        np.max(np.abs(time - time[0] - step * whole)) < 0.5 * step
    ):  # no row is lost: the line of all times, free of their digits
        middle = whole - whole.mean()
        return float(middle @ (time - time[0]) / (middle @ middle)), whole
    between = np.diff(time)
    rows = np.concatenate([[0.0], np.cumsum(np.rint(between / np.median(between)))])
    step = float((time[-1] - time[0]) / rows[-1])
    return step, np.rint((time - time[0]) / step).astype(np.int64)


def from_lock_in(time: ArrayLike, amplitudes: ArrayLike, carrier: float = 0.0) -> Envelope:
    """Return the complex amplitudes of a lock-in's rows, averaged to a few thousand blocks where there are more."""
    t = np.asarray(time, dtype=np.float64)
    z = np.atleast_2d(np.asarray(amplitudes, dtype=np.complex128))
    keep = np.isfinite(t) & np.all(np.isfinite(z), axis=0) & ~_stuck(z, 1.0)
    lost = 1 - float(np.mean(keep))
    t, z = t[keep], z[:, keep]
    if t.size < LEAST:
        raise CompensationError(f"a decay needs {LEAST} rows or more with a value in every channel, not {t.size}.")
    step = float(np.median(np.diff(t)))
    between = np.diff(t) / step
    if np.median(np.abs(between - 1)) < 0.01:  # an even clock: rows may be absent
        lost = max(lost, 1 - t.size / (1 + float(np.sum(np.rint(between)))))
    return thin(Envelope(t - t[0], z, carrier, step, lost=lost), MOST_BLOCKS)


def estimate_noise(values: Complex) -> float:
    """Return the variance of white noise, summed over channels, from second differences; the median of |n|² is ln 2 times its mean."""
    return float(np.sum(np.median(np.abs(np.diff(values, 2, axis=1)) ** 2, axis=1)) / (6 * np.log(2)))


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
