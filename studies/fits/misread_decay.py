"""Lock-in files that are not what their columns say: phases in rad, one pick-off with its components exchanged, times in ms."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array, Complex
from compensation.errors import CompensationError
from compensation.ringdown.analysis import analyse_decay
from compensation.ringdown.answer import RingDown
from compensation.ringdown.envelope import Envelope, even_rows
from compensation.ringdown.terms import WHITE
from studies.errors import InputError
from studies.instrument.card import Instrument

WRAPS, ALIKE, COHERENT = 2, 0.3, 0.9
"""Jumps of a phase; rad by which they are as the other steps once 2π is taken off; and what those leave of the mean turn: noise in degrees leaves none."""
MIRRORED, APART = 0.5, 0.3
"""Overlap of the lines of two pick-offs, one mirrored about the reference, from which it is doubted where the fit explains them; and most of it that they have as read."""
BEST, IMPOSSIBLE = 2e8, 1e9
"""Q of annealed fused silica, the highest at room temperature (Ageev et al. 2004), and one that no shell has."""
FAR = 3.0
"""Standard deviations of a card's 1/Q from which on another one is doubted where a unit of time explains it."""
UNITS = {"minutes": 60.0, "hours": 3600.0, "milliseconds": 1e-3}  # s


def check_phase(path: object, name: str, amplitude: Array, phase: Array) -> None:
    """Refuse a phase that lies within one turn of 2π and jumps by 2π, where every row turns as the others: it is in rad."""
    known = np.isfinite(amplitude) & np.isfinite(phase)
    p, a = phase[known], amplitude[known]
    if p.size < 3 or not (np.max(np.abs(p)) < np.pi + 0.01 or (np.min(p) >= 0 and np.max(p) < 2 * np.pi + 0.01)):
        return
    steps, weight = np.diff(p), np.abs(a[1:] * a[:-1])
    turn = complex(weight @ np.exp(1j * steps)) / max(float(np.sum(weight)), 1e-300)
    jumps = np.abs(steps) > np.pi
    off = np.abs(np.angle(np.exp(1j * steps[jumps]) / turn)) if turn else np.array([np.inf])
    if np.count_nonzero(jumps) >= WRAPS and abs(turn) > COHERENT and np.median(off) < ALIKE:
        raise InputError(
            f"{path}: {name} lies between {np.min(p):.4g} and {np.max(p):.4g} and jumps by 2 π {np.count_nonzero(jumps)} times: it is in rad. Multiply the column by 57.29578."
        )


def doubt_exchange(
    path: object, envelope: Envelope, found: RingDown, harmonic: int, pairs: Sequence[tuple[str, str]]
) -> tuple[str, ...]:
    """Refuse one pick-off whose lines are those of the other one turned about the reference, if only so no interference is left; say so where both readings hold."""
    if len(envelope.values) != 2:
        return ()
    if _is_clean(found):
        rows = even_rows(envelope.time)[1]
        x, y = (_lines(z, rows) for z in envelope.values)
        mirrored = float(x @ np.roll(y[::-1], 1))
        if mirrored < MIRRORED or float(x @ y) > APART * mirrored:
            return ()
    polar = pairs[1][1].startswith("phase")
    cos, sin = envelope.values
    try:
        read_so = analyse_decay(
            replace(envelope, values=np.array([cos, (1 if polar else 1j) * sin.conj()])), harmonic=harmonic
        )
    except CompensationError:
        return ()
    if not _is_clean(read_so):
        return ()
    wrong = (
        f"{pairs[0][1]} or {pairs[1][1]} has the opposite sign"
        if polar
        else f"{' and '.join(pairs[0])}, or {' and '.join(pairs[1])}, are exchanged"
    )
    lines = "the lines of one pick-off are those of the other one mirrored about the reference"
    if _is_clean(found):
        return (f"Doubtful: {lines}. Either each pick-off sees one mode alone, or {wrong}; the split is then none.",)
    raise InputError(f"{path}: {lines}: {wrong}. Read so, one resonator explains both, without interference. Correct the columns of one pick-off.")  # fmt: skip


def _lines(z: Complex, rows: NDArray[np.int64]) -> Array:
    """Return the amplitude spectrum of one channel on its even grid, of unit length."""
    grid = np.zeros(int(rows[-1]) + 1, dtype=complex)
    grid[rows] = z
    size = np.abs(np.fft.fft(grid * np.hanning(grid.size)))
    return np.asarray(size / max(float(np.linalg.norm(size)), 1e-300))


def _is_clean(found: RingDown) -> bool:
    return not found.interference and found.widening < WHITE


def doubt_time(path: object, found: RingDown) -> tuple[str, ...]:
    """Refuse a Q that no shell has, as a time in ms makes it; say so of one above all that were measured."""
    loss = found.estimates.get("inverse_q")
    if loss is None or not 0 < loss.value < 1 / BEST:
        return ()
    said = f"Q is {1 / loss.value:.2g}, {1 / loss.value / BEST:.2g} times that of the best fused silica ({BEST:.0e}): is time_s in milliseconds? Then divide it by 1000."
    if 0 < loss.high < 1 / IMPOSSIBLE:
        raise InputError(f"{path}: {said}")
    return (said,)


def doubt_unit(path: object, found: RingDown, instrument: Instrument) -> str:
    """Say that a time is in another unit where that alone brings 1/Q to the card's; empty where it is likely as read."""
    own = found.estimates.get("inverse_q")
    loss = next((one for one in instrument.uncertain if one.name == "loss.inverse_q"), None)
    if own is None or loss is None or min(own.value, loss.value) <= 0:
        return ""
    away, spread = float(np.log(own.value / loss.value)), loss.sd / loss.value
    unit = next((name for name, size in UNITS.items() if abs(away - np.log(size)) < spread), None)
    if unit is None or abs(away) < FAR * spread:
        return ""
    times = f"multiply it by {UNITS[unit]:g}" if UNITS[unit] > 1 else f"divide it by {1 / UNITS[unit]:g}"
    return f"{path}: Q is {1 / own.value:.3g}, the card's {1 / loss.value:.3g}: is time_s in {unit}? Then {times}; if not, give [loss] inverse_q of the card a value, or an sd, that covers it."
