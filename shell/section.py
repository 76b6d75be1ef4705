"""A mode on its cross-section as a plain drawing, where no three-dimensional picture can or need be made."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from shell.sampling import ShapePatch

SWING = 0.12  # of the largest extent, that the largest displacement is drawn as


def draw_section(patches: "Sequence[ShapePatch]", harmonic: int, title: str) -> "Figure":
    """Return the meridian section at rest and at full swing, (r, z) in mm; `patches` as `Mode.shape` gives them.

    Right of the axis the azimuth θ = 0, where u_r and u_z are largest; left of it θ = 180°, where cos nθ is (−1)ⁿ.
    """
    from matplotlib.figure import Figure

    extent = max(float(max(np.max(p.r), np.ptp(p.z))) for p in patches)
    largest = max(float(np.max(np.hypot(p.u_r, p.u_z))) for p in patches)
    size = 0.0 if largest == 0.0 else SWING * extent / largest
    figure = Figure(figsize=(5.6, 4.2), layout="constrained")
    axes = figure.subplots()
    for side, sign in ((1.0, 1.0), (-1.0, (-1.0) ** harmonic)):
        for move, colour, style in ((0.0, "#8a929c", "-"), (size, "#0072B2", "-"), (-size, "#0072B2", ":")):
            for p in patches:
                r, z = p.r + sign * move * p.u_r, p.z + sign * move * p.u_z
                for edge in ((0, slice(None)), (-1, slice(None)), (slice(None), 0), (slice(None), -1)):
                    axes.plot(1e3 * side * r[edge], 1e3 * z[edge], style, color=colour, linewidth=0.9)
    axes.set_aspect("equal")
    axes.set_xlabel("r (mm)")
    axes.set_ylabel("z (mm)")
    axes.set_title(f"{title} (displacement exaggerated)", fontsize=10, loc="left")
    return figure
