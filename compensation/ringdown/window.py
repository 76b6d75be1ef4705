"""Window of a ring-down: from where one decay describes all that follows, to where it is lost in the noise."""

import numpy as np

from compensation.ringdown.envelope import Envelope, estimate_noise, thin
from compensation.ringdown.fit import carry_over
from compensation.ringdown.terms import Found, describes, fit_terms
from compensation.samples import block_means, robust_spread

LATER = (0.6, 0.35, 0.15)  # parts of the record after which a free decay is looked for, where the whole is none
EASY, NEXT = 3, 1  # terms that are tried on the whole before, and beside those known of a part
HALVINGS = 4
LEAST_ROWS = 64
SEARCH_ROWS, ROWS = 300, 1024
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
    """Return the time after the last jump of the channels' common phase at constant amplitude, seen in two turns alike, or None."""
    t, z = envelope.time, envelope.values
    size = np.sqrt(np.sum(np.abs(z) ** 2, axis=0))
    usual = max(float(np.sqrt(estimate_noise(z))), 1e-12 * float(size.max()))
    turn = np.angle(np.sum(z[:, 2:] * z[:, :-2].conj(), axis=0))
    if turn.size < NEAR:
        return None
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
    limit = np.maximum(JUMP, 8 * np.maximum(robust_spread(away), usual / np.maximum(loud, 1e-300)))
    jumps = steady & (np.abs(away) > limit)
    # a jump within a row shares itself out between the pair that ends and the pair that begins with it
    whole = np.abs(away[:-2] + away[2:] - away[1:-1]) < 0.2
    found = np.flatnonzero(jumps[1:-1] & whole)
    return float(t[pairs[found[-1] + 1 - (found[-1] - 1 in found)] + 2]) if found.size else None


def find_free(whole: Envelope) -> Found:
    """Return the fit from the first time from which one decay describes all that follows, found by halving."""
    first, last = float(whole.time[0]), float(whole.time[-1])
    judged: list[tuple[float, float, Found]] = []

    def describe(start: float, known: Found | None = None, rows: int = SEARCH_ROWS, most: int = 12) -> Found | None:
        tried = thin(whole.within(start, last), rows)
        if tried.time.size < LEAST_ROWS:
            return None
        found = fit_terms(
            tried, None if known is None else (known.fit.terms, carry_over(known.fit, tried)), NEXT if known else most
        )
        judged.append((found.left.widening + (10.0 if found.left.early else 0.0), start, found))
        return found if describes(found) else None

    best, good, bad = describe(first, most=EASY), first, first
    if best is None:
        for start in (first + part * (last - first) for part in (*LATER, 0.0)):
            found = describe(start, best)
            if found is None and best is not None:
                bad = start
                break
            best, good = (found, start) if found is not None else (best, good)
        for _ in range(HALVINGS if best is not None and good > bad else 0):
            middle = (bad + good) / 2
            found = describe(middle, best)
            bad, good, best = (middle, good, best) if found is None else (bad, middle, found)
    if best is None:
        if not judged:
            return fit_terms(thin(whole, ROWS))
        _, good, best = min(judged, key=lambda one: one[0])
    full = thin(whole.within(good, last), ROWS)
    if full.width == best.fit.envelope.width:
        return best
    return fit_terms(full, (best.fit.terms, carry_over(best.fit, full)))
