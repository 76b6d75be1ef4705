"""The chapter that sets Rayleigh's closed form beside shell theory and the solid."""

import numpy as np

from studies.papers import theories
from studies.reports import style
from studies.results import Chapter, Column, Drawing, Figure, Table

FREQUENCIES = (
    Column("ratio", "h/R", form="g"),
    Column("rayleigh", "Rayleigh", "Hz", ".3f"),
    Column("shell", "Shell", "Hz", ".3f"),
    Column("solid", "Solid", "Hz", ".3f"),
    Column("excess", "Rayleigh above solid", "%", "+.2f", scale=100.0),
    Column("coefficient", "Relative excess / √(h/R)", form=".3f"),
)
SLOPES = ("Theory", Column("slope", "Slope", form=".2f", scale=1e6))


def theories_chapter() -> Chapter:
    """Return the chapter: frequencies over thickness, how the excess closes, and the slope by theory."""
    rows = theories.compare_theories()
    limit = theories.thin_limit(rows[-1], rows[-2])
    at = next(row for row in rows if row.ratio == 0.06)
    slopes = [{"theory": theory, "slope": slope} for theory, slope in theories.slopes_by_theory().items()]
    return Chapter("Comparison of theories", [
        f"Rayleigh's closed form, equation (13) of the paper, ignores the free edge. At h/R = 0.06 it is {100 * at.excess:.1f} % above the"
        f" solid model. The excess falls only as √(h/R), with a coefficient that tends to {limit:.2f}. All other frequencies and slopes of"
        " silica on this page come from the solid model.",
        Table("Free hemisphere of 15 mm radius, n = 2", rows, FREQUENCIES),
        Figure(lambda: _draw(rows, limit),
            "The excess of Rayleigh's form falls as √(h/R); shell theory is within 0.1 % of the solid model everywhere.",
            "Differences of the theories over thickness, double logarithmic."),
        Table("Slope at 20 °C by theory (ppm/°C), h/R = 0.06, default law", slopes, SLOPES,
            "The free edge changes the slope by several ppm/°C from Rayleigh's simple rule, ½ G′/G + ½ α."),
    ])  # fmt: skip


def _draw(rows: list[theories.TheoryComparison], limit: float) -> Drawing:
    ratio = np.array([r.ratio for r in rows])
    apart = [100 * abs(r.shell / r.solid - 1) for r in rows]
    with style.figure(height=2.9, x="h/R", y="relative difference (%)") as (made, axes):
        axes.loglog(ratio, [100 * r.excess for r in rows], "o-", color=style.BLUE, label="Rayleigh above solid")
        axes.loglog(ratio, apart, "s-", color=style.GREEN, label="shell against solid")
        axes.loglog(ratio, 100 * limit * np.sqrt(ratio), ":", color=style.BLACK, label=f"{limit:.2f} √(h/R)")
        return made
