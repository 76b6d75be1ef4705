"""Window of a ring-down: from where one decay describes all that follows, to where it is lost in the noise."""

import numpy as np

from compensation.ringdown.envelope import Envelope, estimate_noise, thin
from compensation.ringdown.terms import examine_without_lines, extend, fit_modes, is_plain
from compensation.samples import block_means

LATER = (0.35, 0.6, 0.15)  # parts of the record at whose end a free decay is looked for, where the whole is none
HALVINGS = 4
LEAST_ROWS = 64
SEARCH_ROWS = 300
JUMP = 0.5  # radians from which a turn of the phase between rows is no drift
NEAR = 41


def find_end(envelope: Envelope) -> float:
    """Return the time after which the amplitude is below half of the noise of a row, for good."""
    z = envelope.values
    noise = estimate_noise(z)
    count = min(64, z.shape[1] // 8)
    size = z.shape[1] // count
    energy = block_means(np.sum(np.abs(z) ** 2, axis=0), size)[:count] - noise
    above = np.flatnonzero(energy > 0.25 * noise)
    last = int(above[-1]) + 1 if above.size else count
    return float(envelope.time[min(last * size, envelope.time.size) - 1])


def find_jump(envelope: Envelope) -> float | None:
    """Return the time after the last jump of the phase, common to the channels, that leaves the amplitude as it was; None without one.

    The turn over two rows is compared with that of the rows around: a jump turns two such pairs alike, a single bad row none.
    """
    t, z = envelope.time, envelope.values
    size = np.sqrt(np.sum(np.abs(z) ** 2, axis=0))
    usual = max(float(np.sqrt(estimate_noise(z))), 1e-12 * float(size.max()))
    turn = np.angle(np.sum(z[:, 2:] * z[:, :-2].conj(), axis=0))
    near = np.lib.stride_tricks.sliding_window_view(np.exp(1j * turn), NEAR)
    around = np.median(near.real, axis=1) + 1j * np.median(near.imag, axis=1)
    half = NEAR // 2
    away = np.angle(np.exp(1j * turn[half:-half]) * around.conj())
    pairs = np.arange(half, half + away.size)
    loud = np.minimum(size[pairs], size[pairs + 2])
    steady = np.abs(np.log(np.maximum(size[pairs + 2], 1e-300) / np.maximum(size[pairs], 1e-300))) < 0.3
    steady &= t[pairs + 2] - t[pairs] < 2.5 * float(np.median(np.diff(t)))
    level = np.median(np.lib.stride_tricks.sliding_window_view(size, NEAR), axis=1)[: loud.size]
    steady &= loud > 0.5 * level  # the phase of a beat turns by itself where it is low
    limit = np.maximum(JUMP, 8 * np.maximum(1.4826 * float(np.median(np.abs(away))), usual / np.maximum(loud, 1e-300)))
    jumps = steady & (np.abs(away) > limit)
    both = np.flatnonzero(jumps[1:] & jumps[:-1] & (np.abs(away[1:] - away[:-1]) < 0.2))
    return float(t[pairs[both[-1]] + 2]) if both.size else None


def find_start(whole: Envelope) -> float:
    """Return the first time from which one decay describes all that follows, its first rows as well as the rest.

    Where that is not the whole record, the last start that fails and the first that does are brought together by halving.
    """
    first, last = float(whole.time[0]), float(whole.time[-1])
    judged: list[tuple[float, float]] = []

    def describes(start: float) -> bool:
        tried = thin(whole.within(start, last), SEARCH_ROWS)
        if tried.time.size < LEAST_ROWS:
            return False
        fit = fit_modes(tried)
        left = examine_without_lines(tried, fit)
        if not is_plain(left):
            fit, left, _ = extend(tried, fit, left, ())
        judged.append((left.widening + (10.0 if left.early else 0.0), start))
        return is_plain(left)

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
