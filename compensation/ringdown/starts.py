"""Where the fit of a decay starts: exponentials of the averaged envelope (matrix pencil), and the two largest spectral lines."""

import numpy as np

from compensation.arrays import Array, Complex
from compensation.ringdown.envelope import Envelope
from compensation.ringdown.model import Decay
from compensation.samples import block_means

COARSE = 256  # rows of the averaged envelope on which starting points are looked for


def find_starts(envelope: Envelope, modes: int) -> list[Decay]:
    """Return starting points: exponentials of the averaged envelope (matrix pencil), and the two largest spectral lines."""
    time, z = envelope.time - envelope.time[0], envelope.values
    rates = [_pencil(time, z, modes), _lines(time, z, modes)]
    return [_from_rates(time, z, one) for one in rates if one is not None]


def _from_rates(time: Array, z: Complex, rates: Complex) -> Decay:
    """Return the decay with these eigenvalues and the axes that their amplitudes have."""
    mean = complex(np.mean(rates))
    if rates.size == 1:
        return Decay(mean.imag, max(-mean.real, 0.1 / time[-1]))
    half = complex(rates[0] - rates[1]) / 2
    a, b = half, 0j
    if z.shape[0] == 2:
        basis = np.exp(np.outer(time, rates))
        parts = np.linalg.lstsq(basis, z.T, rcond=None)[0]  # rows: modes; columns: channels
        u, v = parts / np.maximum(np.linalg.norm(parts, axis=1, keepdims=True), 1e-300)
        turned = v[::-1] * np.array([1, -1])  # what lies across the second is the first, seen again
        shape = u if np.linalg.norm(parts[0]) >= np.linalg.norm(parts[1]) else turned
        square = shape @ shape
        if abs(square) > 1e-3:
            a = half * (shape[0] ** 2 - shape[1] ** 2) / square
            b = half * 2 * shape[0] * shape[1] / square
    return Decay(mean.imag, max(-mean.real, 0.1 / time[-1]), -a.real, -b.real, a.imag, b.imag)


def _pencil(time: Array, z: Complex, modes: int) -> Complex | None:
    """Return the exponents of the averaged rows: eigenvalues of a shift on the signal space of a Hankel matrix."""
    count = min(COARSE, time.size // 2)
    size = time.size // count
    rows = block_means(z, size)[:, :count]
    step = float(time[size] - time[0])
    length = count // 3
    hankel = np.concatenate([np.lib.stride_tricks.sliding_window_view(row, length) for row in rows], axis=0)
    space = np.linalg.svd(hankel, full_matrices=False)[2][:modes].T
    poles = np.linalg.eigvals(np.linalg.lstsq(space[:-1], space[1:], rcond=None)[0])
    if not np.all(np.isfinite(poles)) or np.any(np.abs(poles) < 1e-12):
        return None
    return np.asarray(np.log(poles) / step)


def _lines(time: Array, z: Complex, modes: int) -> Complex | None:
    """Return the exponents of the largest spectral lines: the second is looked for in what the first leaves."""
    step = float(np.median(np.diff(time)))
    grid = np.rint(time / step).astype(int)
    rest = np.zeros((z.shape[0], int(grid[-1]) + 1), dtype=complex)
    rest[:, grid] = z
    energy = np.sum(np.abs(rest) ** 2, axis=0)
    half = np.flatnonzero(np.cumsum(energy) >= 0.63 * np.sum(energy))[0] + 1
    decay = 1 / (2 * half * step)
    t = step * np.arange(rest.shape[1])
    found: list[complex] = []
    for _ in range(modes):
        power = np.sum(np.abs(np.fft.fft(rest, 2 * rest.shape[1], axis=1)) ** 2, axis=0)
        at = int(np.argmax(power))
        found.append(complex(-decay, 2 * np.pi * float(np.fft.fftfreq(power.size, step)[at])))
        basis = np.exp(np.outer(t, np.array(found)))
        rest[:, grid] = z - (basis @ np.linalg.lstsq(basis[grid], z.T, rcond=None)[0]).T[:, grid]
    return np.array(found)
