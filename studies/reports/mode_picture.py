"""The mode shape of an instrument as a block of a report; where the machine cannot draw, the remedy instead."""

from typing import TYPE_CHECKING

from studies.reports.page import Block, Text, embed_png

if TYPE_CHECKING:
    from studies.instrument.card import Instrument


def mode_blocks(instrument: "Instrument", harmonic: int = 2) -> list[Block]:
    """Return the picture of the lowest mode of a harmonic, or a sentence that says how to get it."""
    from shell.modes import solve_modes
    from shell.render import NoOpenGL, render_png

    elastic = instrument.material.elastic(instrument.reference_temperature)
    mode = solve_modes(instrument.resonator, elastic, harmonic=harmonic)[0]
    caption = (
        f"{instrument.name}, n = {harmonic}, {mode.frequency:.2f} Hz at"
        f" {instrument.reference_temperature - 273.15:g} °C, from the solid solver; grey: undeformed. The displacement is"
        " exaggerated, the rim is free."
    )
    try:
        png = render_png(mode.surface)
    except NoOpenGL as error:
        return [Text(f"The picture of the mode is missing: {error}", "warning")]
    return [embed_png(png, caption, f"The resonator with its rim bent into {2 * harmonic} lobes.")]
