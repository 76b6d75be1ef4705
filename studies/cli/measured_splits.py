"""Measured splits and imbalance as options of `hrg trim`, or from a scan."""

import cmath
import re
from json import loads
from math import radians

from studies.errors import InputError
from studies.files.reading import read_bytes
from studies.instrument.card import Instrument
from studies.schema.reader import read_keys


def pair_splits(
    split: tuple[float, ...], axis: tuple[float, ...], harmonic: tuple[int, ...], error: float, card: Instrument
) -> list[tuple[int, float, float, float]]:
    """Return (harmonic, split in Hz, azimuth in rad, reading error in Hz) of the splits given as options, or of the card."""
    if not split and not axis:
        own = card.content.get("imperfection", {}).get("split")
        if own is not None:
            return [(int(own["harmonic"]), float(own["split_Hz"]), radians(own["slow_axis_deg"]), error)]
    if not split:
        raise InputError(
            "--split is missing: give the measured splits (Hz), each with its --axis (degrees), or a card with a measured split ('hrg fit ringdown --save')."
        )
    for option, given in (("--axis", axis), ("--harmonic", harmonic)):
        if len(given) != len(split):
            found = "is missing" if not given else f"has {len(given)} values"
            raise InputError(
                f"{option} {found}: give one for each --split, of which there {'is 1' if len(split) == 1 else f'are {len(split)}'}."
            )
    if min(harmonic) < 1:
        raise InputError(f"--harmonic {min(harmonic)}: split modes have n = 1 or higher.")
    return [(n, s, radians(a), error) for n, s, a in zip(harmonic, split, axis, strict=True)]


def read_scan(path: str, harmonic: tuple[int, ...]) -> list[tuple[int, float, float, float]]:
    """Return the same of the splits of a scan."""
    refused = InputError(f'{path}: is not output of hrg scan --json (schema "hrg.scan/1").')
    data = read_bytes(path)
    try:
        content = loads(data)
        if content["schema"] != "hrg.scan/1":
            raise refused
        entries = {entry["harmonic"]: entry for entry in content["splits"]}
    except ValueError as error:
        raise InputError(f"{path}: damaged JSON ({error}); write it again with hrg scan --json.") from None
    except (KeyError, TypeError, RecursionError):
        raise refused from None
    found = []
    for n in harmonic:
        if n not in entries:
            raise InputError(f"{path}: no split of n = {n}; it contains n = {', '.join(str(k) for k in entries)}.")
        try:
            axis, size = entries[n]["slow_axis_deg"], entries[n]["split_Hz"]
            if axis is None:
                raise InputError(
                    f"{path}: the split of n = {n} cannot be distinguished from 0; measure more accurately before cutting."
                )
            numbers = [size["value"], axis["value"], size["low"], size["high"]]
        except (KeyError, TypeError):
            raise refused from None
        split, degrees, low, high = (read_keys(x, float, f"{path}: the split of n = {n}") for x in numbers)
        found.append((n, split, radians(degrees), (high - low) / 3.29))
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
