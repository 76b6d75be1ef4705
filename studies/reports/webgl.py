"""An interactive view of modes for a page, from one file of some 20 kB a mode; without WebGL2 the picture stays."""

import base64
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array
from shell.imperfection import Imperfection, Split
from shell.imperfection.surface import find_departures
from shell.modes import Mode
from shell.outline import Outline, trace_outlines
from shell.resonator import Resonator
from studies.results.page import Embedded, fill_template

Members = NDArray[np.int64]
HIGHEST = 12  # wave of the departures that is drawn
SPACING = 40  # points of the outline along the radius
KINK = np.radians(35.0)  # where the outline turns by more than this, the shading breaks


@dataclass(frozen=True, eq=False)
class Drawn:
    """How a split pair is drawn: its slower mode on its axis, both axes, the departures of the shape times a factor."""

    split: Split
    imperfection: Imperfection | None
    exaggeration: float


def view_modes(
    resonator: Resonator, modes: Sequence[Mode], title: str, png: bytes, alt: str, caption: str = "",
    splits: Sequence[Drawn | None] = (),
) -> Embedded:  # fmt: skip
    """Return an interactive view of modes (solid or shell) of one resonator; `png` stands in where WebGL2 is missing, and on paper."""
    import matplotlib as mpl

    size = resonator.size
    pairs = zip(modes, splits or [None] * len(modes), strict=True)
    described = [_describe(resonator, mode, split) for mode, split in pairs]
    line = trace_outlines(resonator, size / SPACING)[0]
    middle = float(line.z.max() + line.z.min()) / 2
    start, rim = resonator.at([0.0]), resonator.at([resonator.length])
    data = {
        "modes": described,
        "map": [[round(float(x), 4) for x in mpl.colormaps["cividis"](k / 15)[:3]] for k in range(16)],
        "middle": middle / size,
        "reach": float(np.hypot(line.r, line.z - middle).max()) / size,
        "opens_up": bool(rim.z[0] > start.z[0]),
    }
    html = fill_template(
        "mode_view.html",
        id="mode-" + hashlib.sha256(repr(data).encode()).hexdigest()[:12],
        title=title,
        data=data,
        alt=alt,
        picture="data:image/png;base64," + base64.b64encode(png).decode(),
        still="The interactive view needs a browser with scripts and WebGL2.",
    )
    return Embedded(html, caption)


def _describe(resonator: Resonator, mode: Mode, drawn: Drawn | None) -> dict[str, Any]:
    size = resonator.size
    outlines = trace_outlines(resonator, size / SPACING, mode)
    runs = [run for line in outlines for run in _split_at_kinks(line)]
    points = np.concatenate([_columns(line, members, size) for line, members in runs])
    energy = np.concatenate([line.energy.max(axis=0) for line in outlines])
    most = float(np.percentile(energy, 98))
    return {
        "label": f"n = {mode.harmonic}{f', {mode.label}' if mode.label else ''}: {drawn.split.frequencies[0] if drawn else mode.frequency:.2f} Hz",
        "harmonic": mode.harmonic,
        "runs": [len(members) for _, members in runs],
        "points": base64.b64encode(points.astype("<f4").tobytes()).decode(),
        "most": most,
        **(_imperfect(resonator, runs, drawn) if drawn else {}),
        "energy_legend": f"{most * 1e-12:.3g} J/m³ strain-energy density for 1 µm at the antinode",
    }


def outline_rows(resonator: Resonator, mode: Mode, size: float) -> list[Array]:
    """Return the runs of a mode's outline as the view draws them, each (points, 12), lengths over `size`."""
    lines = trace_outlines(resonator, resonator.size / SPACING, mode)
    return [_columns(line, members, size) for one in lines for line, members in _split_at_kinks(one)]


def _imperfect(resonator: Resonator, runs: list[tuple[Outline, Members]], drawn: Drawn) -> dict[str, Any]:
    """The slow axis (rad), where the axes lie on the rim, and the departures: for each wave and point its parts along r and z."""
    rim, size = resonator.at([resonator.length]), resonator.size
    found: dict[str, Any] = {
        "axis": drawn.split.slow_axis,
        "rim": [float(rim.r[0] + rim.thickness[0] / 2) / size, float(rim.z[0]) / size],
    }
    if drawn.imperfection is None or not drawn.exaggeration:
        return found
    places = ("position", "r", "z")
    x, r, z = (np.concatenate([getattr(line, name)[at] for line, at in runs]) for name in places)
    waves = {
        m: wave
        for m, wave in find_departures(resonator, drawn.imperfection, x, r, z).items()
        if m <= HIGHEST and np.abs(wave).max() > 0
    }
    parts = np.array([[wave[0].real, wave[0].imag, wave[1].real, wave[1].imag] for wave in waves.values()])
    scaled = np.moveaxis(parts, 2, 0) * (drawn.exaggeration / size)
    found["orders"] = list(waves)
    found["departures"] = base64.b64encode(scaled.astype("<f4").tobytes()).decode()
    return found


def _columns(line: Outline, members: Members, size: float) -> Array:
    """One row for each point: r, z and their slopes, the displacement and its slope, the two parts of the energy."""
    r, z = line.r[members] / size, line.z[members] / size
    shift = line.displacement[:, members]
    run = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(r), np.diff(z)))])
    slopes = np.gradient(np.stack([r, z, *shift]), run, axis=1)
    return np.column_stack([r, z, *slopes[:2], *shift, *slopes[2:], *line.energy[:, members]])


def _split_at_kinks(line: Outline) -> list[tuple[Outline, Members]]:
    """Runs of points without a kink; neighbouring runs share their end point."""
    closing = np.arange(len(line.r)) if line.on_axis else np.append(np.arange(len(line.r)), 0)
    heading = np.unwrap(np.arctan2(np.diff(line.z[closing]), np.diff(line.r[closing])))
    breaks = 1 + np.flatnonzero(abs(np.diff(heading)) > KINK)
    bounds = [0, *breaks.tolist(), len(closing) - 1]
    return [(line, closing[a : b + 1]) for a, b in pairwise(bounds)]
