"""The chapter that sets Rayleigh's closed form beside shell theory and the solid."""

import numpy as np

from studies.papers import theories
from studies.reports import style
from studies.reports.page import Chapter, Picture, Table, Text, draw


def theories_chapter() -> Chapter:
    """Return the chapter: frequencies over thickness, how the excess closes, and the slope by theory."""
    rows = theories.compare_theories()
    limit = theories.thin_limit(rows[-1], rows[-2])
    slopes = theories.slopes_by_theory()
    at = next(row for row in rows if row.ratio == 0.06)
    columns = [
        "h/R",
        "Rayleigh (Hz)",
        "Shell (Hz)",
        "Solid (Hz)",
        "Rayleigh above solid (%)",
        "Relative excess / √(h/R)",
    ]
    cells = [
        [
            f"{r.ratio:g}",
            f"{r.rayleigh:.3f}",
            f"{r.shell:.3f}",
            f"{r.solid:.3f}",
            f"{100 * r.excess:+.2f}",
            f"{r.coefficient:.3f}",
        ]
        for r in rows
    ]
    slope_rows = [[theory, f"{1e6 * slope:.2f}"] for theory, slope in slopes.items()]
    return Chapter(
        "Comparison of theories",
        [
            Text(
                f"Rayleigh's closed form, equation (13) of the paper, ignores the free edge. At h/R = 0.06 it is"
                f" {100 * at.excess:.1f} % above the solid model. The excess falls only as √(h/R), with a coefficient that"
                f" tends to {limit:.2f}. All other frequencies and slopes of silica on this page"
                " come from the solid model."
            ),
            Table("Free hemisphere of 15 mm radius, n = 2", columns, cells),
            _closing_figure(rows, limit),
            Table(
                "Slope at 20 °C by theory (ppm/°C), h/R = 0.06, default law",
                ["Theory", "Slope"],
                slope_rows,
                "The free edge changes the slope by several ppm/°C from Rayleigh's simple rule, ½ G′/G + ½ α.",
            ),
        ],
    )


def _closing_figure(rows: list[theories.TheoryComparison], limit: float) -> Picture:
    ratio = np.array([r.ratio for r in rows])
    with style.figure(height=2.9, x="h/R", y="relative difference (%)") as (made, axes):
        axes.loglog(ratio, [100 * r.excess for r in rows], "o-", color=style.BLUE, label="Rayleigh above solid")
        axes.loglog(
            ratio,
            [100 * abs(r.shell / r.solid - 1) for r in rows],
            "s-",
            color=style.GREEN,
            label="shell against solid",
        )
        axes.loglog(ratio, 100 * limit * np.sqrt(ratio), ":", color=style.BLACK, label=f"{limit:.2f} √(h/R)")
    return draw(
        made,
        "The excess of Rayleigh's form falls as √(h/R); shell theory is within 0.1 % of the solid model everywhere.",
        "Differences of the theories over thickness, double logarithmic.",
    )
