"""Pictures of a scan: unwrapped maps and circumferential harmonics."""

import numpy as np

from studies.reports.style import BLUE, ORANGE, figure
from studies.results import Drawing
from studies.scan import Scan


def maps(scan: Scan) -> Drawing:
    """Return maps of wall and middle surface, or of the one face."""
    names = ["wall", "offset"] if len(scan.faces) == 2 else list(scan.faces)
    with figure(len(names), 1, 2.5 * len(names), squeeze=False) as (made, axes):
        for ax, name in zip(axes[:, 0], names, strict=True):
            x, theta, values = scan.map_of(name)
            shown = 1e6 * (values - values.mean(axis=1, keepdims=True))
            most = max(float(abs(shown).max()), 1e-6)
            image = ax.pcolormesh(
                np.rad2deg(theta), x, shown, cmap="RdBu_r", vmin=-most, vmax=most, shading="nearest", rasterized=True
            )
            made.colorbar(image, ax=ax, label="µm")
            ax.set(title={"wall": "wall thickness, mean of each circle removed", "offset": "middle surface"}.get(name, f"{name} face"),
                   xlabel="azimuth (°)", ylabel="position (1: rim)", xticks=range(0, 361, 45))  # fmt: skip
            ax.grid(False)
        return made


def harmonics(scan: Scan) -> Drawing:
    """Return the amplitudes of the harmonics at the rim."""
    quantity = "wall" if len(scan.faces) == 2 else next(iter(scan.faces))
    rim = max(w.position for w in scan.waves)
    with figure(1, 1, 3.2) as (made, ax):
        for q, colour, shift in ((quantity, BLUE, -0.15), ("offset", ORANGE, 0.15)):
            mine = [w for w in scan.waves if w.quantity == q and w.position == rim and w.order > 0]
            if not mine:
                continue
            order, value, low, high = np.array([
                (w.order, *(1e6 * getattr(w.amplitude, key) for key in ("value", "low", "high"))) for w in mine
            ]).T  # fmt: skip
            ax.bar(order + shift, value, 0.28, color=colour, label="middle surface" if q == "offset" else q)
            reach = np.maximum([value - low, high - value], 0)
            ax.errorbar(order + shift, value, reach, fmt="none", ecolor="black", capsize=2)
        ax.set(xlabel="circumferential harmonic", ylabel="amplitude at the rim (µm)", yscale="log")
        return made
