"""The page of a temperature that was read from a frequency, like the HRG paper's figure 5."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from studies.reports import style
from studies.reports.page import Chapter, Facts, Picture, Text, draw, render_page

if TYPE_CHECKING:
    from studies.record import Record

SOURCES = ("Wang X. et al., Sensors 2012, 12, 6434 (the HRG paper), eqs. (16)–(18), Table 2, figure 5.",)
OTHERS = {
    "housing_temperature_degC": ("housing", style.ORANGE),
    "chamber_temperature_degC": ("chamber", style.GREEN),
}


def temperature_page(
    record: "Record", found: NDArray[np.float64], run: str, model: str, facts: Mapping[str, float]
) -> str:
    """Return the page for one record."""
    cells = [
        ("From", f"{facts['lowest_degC']:.3f} °C", "lowest"),
        ("To", f"{facts['highest_degC']:.3f} °C", "highest"),
        ("Curve", f"± {facts['curve_uncertainty_K']:.2g} K", "one standard deviation of the fitted f(T)"),
    ]
    note = (
        "The curve was fitted to settled readings. The frequency shows the resonator's own temperature, as the mode"
        " weighs it; the housing runs ahead of it while the temperature changes."
    )
    lead = f"The resonator's temperature in {run}, read from its frequency with {model}."
    chapters = [Chapter("Temperature over time", [Facts(cells), _figure(record, found), Text(note, "note")])]
    return render_page("The resonator as its own thermometer", lead, chapters, SOURCES)


def _figure(record: "Record", found: NDArray[np.float64]) -> Picture:
    rows = style.few_rows(len(record))
    hours = record["time_s"][rows] / 3600
    with style.figure(height=3.6) as (made, axes):
        for column, (label, colour) in OTHERS.items():
            if column in record:
                axes.plot(hours, record[column][rows], color=colour, linewidth=0.9, label=label)
        axes.plot(hours, found[rows], color=style.BLUE, label="resonator, from its frequency")
        axes.set_xlabel("Time (h)")
        axes.set_ylabel("Temperature (°C)")
        axes.legend()
        return draw(made, "Temperature of the resonator over time.", "Temperatures over time.")
