"""The half-space that a stem stands on, cut into cells that grow away from the stem, with the absorbing layer around it."""

from itertools import pairwise

import numpy as np

from shell.damping.radiation import Layer
from shell.patches import Patch, straight, whole

GROWTH = 3.0  # of the cells away from the stem
PER_WAVE = 3  # cells over a shear wavelength
LAYER = 3  # cells across the absorbing layer


def lay_half_space(radii: list[float], surface: float, below: bool, wavelength: float) -> tuple[list[Patch], Layer]:
    """Cells of a half-space whose surface carries a stem.

    Parameters
    ----------
    radii : where the cells of the stem's end meet, from 0 to its radius, m.
    surface : height of the surface, m.
    below : whether the half-space fills z < surface.
    wavelength : of shear waves in it at the mode's frequency, m.
    """
    radius, step = radii[-1], radii[-1] - radii[-2]
    start, width = max(4 * radius, 0.5 * wavelength), wavelength
    columns = [*radii, *_grow(radius, step, start, wavelength), *(start + width * np.arange(1, LAYER + 1) / LAYER)]
    rows = [0.0, *_grow(0.0, step, start, wavelength), *(start + width * np.arange(1, LAYER + 1) / LAYER)]
    sign = -1.0 if below else 1.0
    patches = []
    for r_in, r_out in pairwise(columns):
        for near, far in pairwise(rows):
            low, high = sorted((surface + sign * near, surface + sign * far))
            corners = ((r_in, low), (r_out, low), (r_in, high), (r_out, high))
            patches.append(
                Patch(
                    straight(corners[0], corners[1]),
                    straight(corners[2], corners[3]),
                    straight(corners[0], corners[2]),
                    straight(corners[1], corners[3]),
                    whole(),
                    "base",
                )
            )
    return patches, Layer(start, width, surface, below, wavelength)


def _grow(first: float, step: float, last: float, wavelength: float) -> list[float]:
    """Places from `first` (left out) to `last`, in steps that grow up to a part of the wavelength."""
    at = [first]
    while at[-1] + 1.5 * step < last:
        at.append(at[-1] + step)
        step = min(GROWTH * step, wavelength / PER_WAVE)
    return [*at[1:], last]
