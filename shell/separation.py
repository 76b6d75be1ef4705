"""The nearest other mode: a parasitic mode close to the drive mode couples to it under vibration."""

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from shell.modes import Mode

HARMONICS = range(5)


def nearest_mode(
    solve: "Callable[[int, int], Sequence[Mode]]", own: "Mode", harmonics: Iterable[int] = HARMONICS, least: int = 2
) -> "Mode":
    """Return the mode nearest in frequency to `own` among some harmonics.

    Every harmonic is solved until a mode lies above `own`: the nearest below and above are then both known.
    solve(harmonic, count) gives at least the `count` lowest modes of a harmonic, in order of frequency.
    """
    others: list[Mode] = []
    for n in harmonics:
        count, found = least, solve(n, least)
        while found[-1].frequency <= own.frequency:
            count *= 2
            found = solve(n, count)
        others += [mode for mode in found if (mode.harmonic, mode.index) != (own.harmonic, own.index)]
    return min(others, key=lambda mode: abs(mode.frequency - own.frequency))
