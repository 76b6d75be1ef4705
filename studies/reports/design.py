"""Pictures of an optimisation: how it went, the front, the section of the best design."""

from typing import TYPE_CHECKING

import numpy as np

from studies.reports import style
from studies.results import Drawing

if TYPE_CHECKING:
    from studies.design.answer import Answer
    from studies.instrument.card import Instrument


def history(found: "Answer") -> Drawing:
    """The best so far, and the excess of every design over its limits."""
    over, t = found.history.T
    count = np.arange(1, len(over) + 1)
    held = over == 0
    best = np.minimum.accumulate(np.where(held, t, np.inf))
    labels = ("objective, scaled", "excess, scaled")
    with style.figure(2, 1, 4.2, "design", labels, sharex=True) as (made, (top, low)):
        top.plot(count[held], t[held], ".", color=style.SKY, label="keeps all limits")
        top.plot(count[np.isfinite(best)], best[np.isfinite(best)], color=style.BLUE, label="best so far")
        if held.any():
            spread = np.ptp(t[held]) or 1.0
            top.set_ylim(t[held].min() - 0.1 * spread, t[held].max() + 0.1 * spread)
        low.semilogy(count, np.maximum(over, 1e-9), ".", color=style.VERMILION)
        return made


def front(found: "Answer") -> Drawing:
    """The first two objectives: every design that keeps the limits, the front, the design that is handed out."""
    columns = {column.name: column for column in found.task.study.columns}
    names = [one.column for one in found.task.keys.objective[:2]]
    titles = [f"{columns[n].label}{f' ({columns[n].unit})' if columns[n].unit != '1' else ''}" for n in names]
    a, b = (found.place(name) for name in names)
    held = found.history[:, 0] == 0
    with style.figure(height=3.8, x=titles[0], y=titles[1]) as (made, axis):
        axis.plot(found.values[held, a], found.values[held, b], ".", color=style.SKY, label="keeps all limits")
        axis.plot(found.front_values[:, a], found.front_values[:, b], "o-", color=style.BLUE, label="front")
        axis.plot(found.after[a], found.after[b], "*", color=style.VERMILION, markersize=13, label="best design")
        for c, scale in ((a, axis.set_xscale), (b, axis.set_yscale)):
            if (found.values[held, c] > 0).all() and np.ptp(np.log10(found.values[held, c])) > 1:
                scale("log")
        return made


def section(instrument: "Instrument") -> Drawing:
    """The section with the swing of the mode n = 2."""
    from shell.modes import solve_modes

    return solve_modes(*instrument.at(instrument.reference_temperature), 2)[0].plot()
