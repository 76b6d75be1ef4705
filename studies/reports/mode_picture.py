"""The mode shapes of an instrument as blocks of a report: a view to turn, a picture where that cannot be, or the remedy."""

from collections.abc import Sequence
from math import degrees
from typing import TYPE_CHECKING

from shell.constants import zero_Celsius
from studies.instrument.card import Instrument
from studies.reports.scenes import ModeScene, show_mode
from studies.results import Sentence

if TYPE_CHECKING:
    from studies.results.page import Block

THEORIES = {
    "solid": "three-dimensional elasticity",
    "shell": "Naghdi shell theory",
    "rayleigh": "Rayleigh's closed form",
}


def mode_blocks(instrument: "Instrument", harmonics: Sequence[int] = (2, 3)) -> "list[Block]":
    """Return the interactive view of the lowest mode of each harmonic, with the picture of the first one behind it."""
    return view_blocks([show_mode(instrument, n) for n in harmonics])


def view_blocks(shown: "Sequence[ModeScene]", remark: str = "") -> "list[Block]":
    """Return the interactive view of modes of one instrument at one temperature."""
    from shell.render import NoOpenGL, render_png
    from studies.reports.webgl import Drawn, view_modes

    first = shown[0]
    caption = (
        f"{first.instrument.name} at {first.temperature - zero_Celsius:g} °C: mode shapes of {THEORIES[first.mode.theory]}, on the solid"
        f" of the card with its thickness, rim and stem. The displacement is exaggerated.{remark}"
    )
    for one in shown:
        if one.split is not None:
            times = f"{one.exaggeration:.0f} times as large"
            larger = f"; the departures of the shape are drawn {times}" if one.exaggeration else ""
            caption += (
                f" n = {one.mode.harmonic}: the slower mode of the pair, which is split by {1e3 * one.split.hertz:.4g} mHz, on its"
                f" axis at {degrees(one.split.slow_axis):.4g}°{larger}."
            )
    blocks: list[Block] = []
    try:
        png = render_png(first.scene())
    except NoOpenGL as error:
        png = None
        blocks.append(Sentence(f"The still picture of the mode is missing: {error}", "warning"))
    lobes = 2 * first.mode.harmonic
    alt = f"The resonator with its rim bent into {lobes} lobes, nodes between them."
    splits = [None if one.split is None else Drawn(one.split, one.imperfection, one.exaggeration) for one in shown]
    view = view_modes(first.resonator, [one.mode for one in shown], first.title, png, alt, caption, splits)
    return [view, *blocks]
