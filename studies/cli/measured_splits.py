"""Measured splits and imbalance as options of `hrg trim`, or from a scan."""

import cmath
import re
from math import radians

import msgspec

from studies.errors import InputError, numbered
from studies.files.reading import read_bytes
from studies.instrument.card import Instrument

READING_ERROR = 1e-4  # Hz
Measured = tuple[int, float, float, float]
"""A split: harmonic, size (Hz), azimuth (rad), reading error (Hz)."""


def pair_splits(
    split: tuple[float, ...], axis: tuple[float, ...], harmonic: tuple[int, ...], error: float | None, card: Instrument
) -> list[Measured]:
    """Return the splits given as options, or of the card."""
    if not split and not axis:
        own = card.content.get("imperfection", {}).get("split")
        if own is not None:
            error = (float(own.get("split_error_Hz", 0.0)) or READING_ERROR) if error is None else error
            return [(int(own["harmonic"]), float(own["split_Hz"]), radians(own["slow_axis_deg"]), error)]
    error = READING_ERROR if error is None else error
    if not split:
        raise InputError("--split is missing: give the measured splits (Hz), each with its --axis (degrees), or a card with a measured split ('hrg fit ringdown --save').")  # fmt: skip
    for option, given in (("--axis", axis), ("--harmonic", harmonic)):
        if len(given) != len(split):
            found = "is missing" if not given else f"has {numbered(len(given), 'value')}"
            raise InputError(f"{option} {found}: give one for each --split, of which there {'is 1' if len(split) == 1 else f'are {len(split)}'}.")  # fmt: skip
    if min(harmonic) < 1:
        raise InputError(f"--harmonic {min(harmonic)}: split modes have n = 1 or higher.")
    return [(n, s, radians(a), error) for n, s, a in zip(harmonic, split, axis, strict=True)]


def read_scan(path: str, harmonic: tuple[int, ...]) -> list[Measured]:
    """Return the same of the splits of a scan."""
    entries: dict[int, tuple[float, float | None, float]] = {}
    found = []
    try:
        scan = msgspec.json.decode(read_bytes(path))
        for one in scan["splits"] if scan["schema"] == "hrg.scan/1" else scan["splits of a scan"]:
            value, low, high = (float(one["split_Hz"][key]) for key in ("value", "low", "high"))
            axis = None if one["slow_axis_deg"] is None else radians(one["slow_axis_deg"]["value"])
            entries[int(one["harmonic"])] = value, axis, (high - low) / 3.29
    except (msgspec.MsgspecError, KeyError, TypeError, ValueError, RecursionError):
        raise InputError(f'{path}: is not output of hrg scan --json (schema "hrg.scan/1").') from None
    for n in harmonic:
        if n not in entries:
            raise InputError(f"{path}: no split of n = {n}; it contains n = {', '.join(map(str, entries))}.")
        value, axis, sd = entries[n]
        if axis is None:
            raise InputError(f"{path}: the split of n = {n} may be 0; measure more accurately before cutting.")
        found.append((n, value, axis, sd))
    return found


def read_unbalance(words: tuple[str, ...]) -> dict[int, complex]:
    """Return the mass imbalance (kg) by harmonic."""
    found = {}
    for word in words:
        match = re.fullmatch(r"([123]):([0-9.]+(?:e-?[0-9]+)?)@(-?[0-9.]+)", word)
        try:
            k, size, angle = match.groups() if match else ("", "", "")
            found[int(k)] = 1e-9 * float(size) * cmath.exp(1j * int(k) * radians(float(angle)))
            if not cmath.isfinite(found[int(k)]):
                raise ValueError
        except ValueError:
            raise InputError(f"--unbalance {word}: write k:µg@degrees, such as 1:120@35, with k 1, 2 or 3.") from None
    return found
