"""The mode shapes of an instrument as blocks of a report: a view to turn, a picture where that cannot be, or the remedy."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from studies.reports.page import Block, Text

if TYPE_CHECKING:
    from studies.instrument.card import Instrument


def mode_blocks(instrument: "Instrument", harmonics: Sequence[int] = (2, 3)) -> list[Block]:
    """Return the interactive view of the lowest mode of each harmonic, with the picture of the first one behind it."""
    import numpy as np

    from shell.modes import solve_modes
    from shell.render import NoOpenGL, compose_scene, render_png
    from shell.surface import build_surface
    from studies.reports.webgl import view_modes

    temperature = instrument.reference_temperature
    resonator, elastic = instrument.at(temperature)
    modes = [solve_modes(resonator, elastic, n, tolerance=1e-4)[0] for n in harmonics]
    first = modes[0]
    title = f"{instrument.name}, n = {first.harmonic}, {first.frequency:.2f} Hz"
    caption = (
        f"{instrument.name} at {temperature - 273.15:g} °C: the lowest mode of each harmonic from the solid solver, with the"
        " thickness, rim and stem of the card. The displacement is exaggerated."
    )
    surface = build_surface(resonator, first)
    moved = np.linalg.norm(surface.displacement, axis=1)
    scene = compose_scene(surface, moved, "displacement (µm, for 1 µm at the antinode)", title)
    blocks: list[Block] = []
    try:
        png = render_png(scene)
    except NoOpenGL as error:
        png = None
        blocks.append(Text(f"The still picture of the mode is missing: {error}", "warning"))
    alt = f"The resonator with its rim bent into {2 * first.harmonic} lobes, nodes between them."
    return [view_modes(resonator, modes, title, png, alt, caption), *blocks]
