"""The chapter that sets the paper's improvement beside twins: paper, ours on the training run, ours held out."""

from collections.abc import Sequence

import numpy as np

from compensation.bias import SELECTED_BY_THE_PAPER, TERMS
from studies.papers.bias_twin import METHODS, PAPER_AFTER, PAPER_BEFORE, TwinFit, spread
from studies.reports import style
from studies.reports.bias import METHOD, SYMBOLS
from studies.results import Chapter, Column, Drawing, Figure, Table

Twins = Sequence[tuple[TwinFit, ...]]


def twin_chapters(twins: Twins) -> list[Chapter]:
    """Return the chapter on figure 6 of the HRG paper for the page of `hrg reproduce`."""
    paper = _fits(twins, "paper", 1)
    before, after = (np.median([fit.training[k] for fit in paper]) for k in (0, 1))
    cooling = spread([fit.cooling.gain for fit in paper])
    mended = sum(fit.warming.gain < 1 for fit in _fits(twins, "guarded", 3))
    harmed = sum(fit.warming.gain < 1 for fit in paper)
    told = (
        f"The paper fits six of nine terms to one cooling run and reports the improvement on the same run: {PAPER_BEFORE} →"
        f" {PAPER_AFTER} °/h, a factor of {PAPER_BEFORE / PAPER_AFTER:.2f}. Its data are not published, so {len(twins)} virtual gyros"
        f" with typical loss, gradients, hysteresis and noise replace them; nothing was tuned to the published figures (median"
        f" {before:.2g} → {after:.2g} °/h). On a second cooling run the same models reduce the bias variation by a factor of"
        f" {cooling.median:.2f} (median). On a warming run they make {harmed} of the {len(twins)} gyros worse than without"
        f" compensation. Models fitted to three runs (cooling and warming), with terms selected for autocorrelated noise, make"
        f" {mended or 'none'} of the {len(twins)} gyros worse."
    )
    caption = "Each marker is one virtual gyro, fitted to one cooling run as in the paper. Below the dotted line compensation makes the bias worse."
    alt = "Improvement on held-out runs against improvement on the training run."
    scatter = Figure(lambda: _draw_gains(twins), caption, alt)
    title = "Figure 6: compensated bias on held-out runs"
    return [Chapter(title, [told, _trace_figure(twins), twin_table(twins), scatter, terms_table(twins)])]


def _trace_figure(twins: Twins) -> Figure:
    """Return figure 6 (a) and (b) of the virtual gyro whose improvement on its run is the median one."""
    ranked = sorted(_fits(twins, "paper", 1), key=lambda fit: fit.training_gain)
    fit = ranked[len(ranked) // 2]
    before, after = fit.training
    caption = (
        f"Figure 6 for the virtual gyro with the median improvement, cooled from 25 to −20 °C: (a) output and model, (b) compensated"
        f" output. Bias {before:.3g} → {after:.3g} °/h, a factor of {fit.training_gain:.2f}; in the paper {PAPER_BEFORE} → {PAPER_AFTER} °/h."
    )
    return Figure(
        lambda: _draw_trace(fit), caption, "Bias over time with the model, and the compensated bias below it."
    )


def _draw_trace(fit: TwinFit) -> Drawing:
    time, bias, left = fit.trace
    hours = time / 3600
    with style.figure(2, height=4.4, x="time (h)", y="bias (°/h)", sharex=True) as (made, (upper, lower)):
        upper.plot(hours, bias, color=style.BLUE, linewidth=0.8, label="output")
        upper.plot(hours, bias - left, color=style.VERMILION, label="model, eq. (22)")
        lower.plot(hours, left, color=style.BLUE, linewidth=0.8, label="compensated")
        middle, span = float(np.mean(left)), float(np.ptp(bias)) or 1.0  # the scale of (a)
        lower.set_ylim(middle - 0.6 * span, middle + 0.6 * span)
        return made


IMPROVEMENT = (
    "Selection",
    Column("fitted", "Fitted to"),
    Column("training", "On the training run"),
    Column("cooling", "Held out: new cooling run"),
    Column("warming", "Held out: warming run"),
)


def twin_table(twins: Twins) -> Table:
    """Return the table paper / ours on the training run / ours held out: median and 90 % range over the gyros."""
    printed = {"training": f"{PAPER_BEFORE / PAPER_AFTER:.2f}", "cooling": "not given", "warming": "not given"}
    rows = [{"selection": "the paper's gyro", "fitted": "1 cooling"} | printed]
    for method in METHODS:
        for runs, label in ((1, "1 cooling"), (3, "cooling, warming, cooling")):
            fits = _fits(twins, method, runs)
            gains = {
                "training": _words([fit.training_gain for fit in fits]),
                "cooling": _words([fit.cooling.gain for fit in fits]),
                "warming": _words([fit.warming.gain for fit in fits]),
            }
            rows.append({"selection": f"virtual gyros, {METHOD[method]}", "fitted": label} | gains)
    note = "Factor by which the standard deviation of 100 s averages falls: median (5 % … 95 % range of the gyros; number that got worse)."
    return Table("Improvement of the bias stability", rows, IMPROVEMENT, note)


def terms_table(twins: Twins) -> Table:
    """Return how often each term was selected from one cooling run."""
    rows = [
        {"number": f"k{number}", "term": SYMBOLS[name], "printed": "yes" if name in SELECTED_BY_THE_PAPER else "no"}
        | {m: f"{sum(name in fit.terms for fit in _fits(twins, m, 1))} of {len(twins)}" for m in METHODS}
        for number, name in enumerate(TERMS, 1)
    ]
    columns = [Column("number", ""), Column("term", "Term"), Column("printed", "In eq. (22)")]
    columns += [Column(method, f"Virtual gyros, {METHOD[method]}") for method in METHODS]
    return Table("How often a term is selected from one cooling run", rows, columns)


def _draw_gains(twins: Twins) -> Drawing:
    """Draw every gyro's improvement, held out against training."""
    paper = _fits(twins, "paper", 1)
    training = [fit.training_gain for fit in paper]
    x, y = (f"improvement factor, {run} run" for run in ("training", "held-out"))
    with style.figure(height=3.6, x=x, y=y) as (made, axes):
        axes.loglog(training, [fit.cooling.gain for fit in paper], "o", markersize=5, label="new cooling run")
        axes.loglog(training, [fit.warming.gain for fit in paper], "x", markersize=6, label="warming run")
        ends = [0.1, 1.2 * max(training)]
        axes.plot(ends, ends, color=style.BLACK, linewidth=0.8)
        axes.axhline(1.0, color=style.BLACK, linewidth=0.8, linestyle=":")
        printed = PAPER_BEFORE / PAPER_AFTER
        axes.axvline(printed, color=style.ORANGE, linestyle="--", label=f"paper: {printed:.2f} on its training run")
        axes.set_xlim(0.9, ends[1])
        return made


def _fits(twins: Twins, method: str, runs: int) -> list[TwinFit]:
    return [fit for fits in twins for fit in fits if fit.method == method and fit.runs == runs]


def _words(gains: Sequence[float]) -> str:
    found, harmed = spread(gains), sum(gain < 1 for gain in gains)
    worse = f"; {harmed} of {len(gains)} worse" if harmed else ""
    return f"{found.median:.2f} ({found.low:.2f}…{found.high:.2f}{worse})"
