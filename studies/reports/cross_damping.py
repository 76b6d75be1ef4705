"""Runs before and after compensation of cross-damping, and the chapter on the CVG paper's figures 1 and 2 for `hrg reproduce`."""

import numpy as np

from compensation.cross_damping import CrossDampingModel, RestRun
from compensation.decimation import average_blocks
from compensation.improvement import AVERAGING
from shell.constants import zero_Celsius
from studies.papers import cvg_cross_damping as paper
from studies.papers.cvg_cross_damping import CrossDampingTwin
from studies.reports import style
from studies.results import Chapter, Drawing, Figure, Sentence, Table

SOURCES = ("Apostolyuk V., Chikovani V., Temperature error model in Coriolis vibratory gyroscopes: eqs. (1)–(10).",)


def twin_chapters(twin: CrossDampingTwin) -> list[Chapter]:
    """Return the chapter on figures 1 and 2 of the paper, from a virtual gyro, for the page of `hrg reproduce`."""
    unit = paper.DEG_PER_H
    low, middle, high = twin.spread
    told = (
        f'The paper gives the shape of ζ₁₂(T) and an improvement of "approximately {paper.PRINTED_IMPROVEMENT:g} times". The virtual gyro has that shape, scaled to'
        f" {paper.BIAS_AT_CALIBRATION:g} °/h at 20 °C, an angle random walk of {paper.RANDOM_WALK:g} °/√h, a bias random walk of"
        f" {paper.WANDER:g} °/h per √h, and a resonator that lags its sensor by {paper.LAG:g} s: typical values, not tuned to the published"
        f" factor. A model fitted to one run improves that run by a factor of {twin.study.training.rows.ratio:.1f} and the next run by"
        f" {twin.improvement.ratio:.1f}; over the noise seeds the factor on held-out runs is {middle:.1f} (90 %: {low:.1f}…{high:.1f})."
        " The result depends on the lag, which the paper does not give (see the table)."
    )
    shape = (
        "Only the shape is used: as absolute values the published coefficients would mean a bias of"
        f" {paper.count_bias_of_printed_values():.0f} rad/s at {paper.FREQUENCY:g} Hz. The filter (9) itself changes the"
        f" correction by at most {twin.study.memory / unit:.2g} °/h: its time constant is less than a second, while the temperature changes over minutes."
    )
    caption = "Temperature, and zero-rate output before and after compensation, 100 s averages."
    runs = (*twin.study.runs, twin.second)
    picture = Figure(lambda: draw_runs(runs, twin.study.model, unit, "°/h"), caption, "Runs over time.")
    title = "CVG figures 1 and 2: cross-damping compensation"
    return [Chapter(title, [told, picture, _determinants_table(twin), Sentence(shape, "note")])]


def _determinants_table(twin: CrossDampingTwin) -> Table:
    """Return what the improvement depends on: lag of the resonator and white noise."""
    rows = [(lag, *ratios) for lag, ratios in zip(twin.lags, twin.table, strict=True)]
    noises = [f"{k}: {noise:g} °/√h .1f" for k, noise in enumerate(twin.noises, 1)]
    note = (
        "Median over noise seeds, on held-out runs. Without a lag, the random walk of the bias sets the limit; with a lag, the"
        " temperature difference between sensor and resonator."
    )
    columns = ["0: Lag (s) g", *noises]
    return Table("Improvement factor by resonator lag and white noise", rows, columns, note)


def draw_runs(runs: tuple[RestRun, ...], model: CrossDampingModel, unit: float, name: str) -> Drawing:
    """Draw runs one after the other (CVG cross-damping paper, figures 1 and 2); `unit` in rad/s, called `name`."""
    labels, heights = ("temperature (°C)", f"zero-rate output ({name})"), (1, 2)
    with style.figure(2, 1, 4.8, "time (h)", labels, sharex=True, height_ratios=heights) as (made, (upper, lower)):
        begin = 0.0
        for i, run in enumerate(runs):
            after = model.compensate(run.time, run.rate, run.temperature, extrapolate=True)
            width = max(AVERAGING, 2 * float(np.median(np.diff(run.time))))
            blocks = average_blocks(run.time, {"T": run.temperature, "before": run.rate, "after": after}, width)
            means = blocks.columns
            hours = (blocks.time - run.time[0]) / 3600 + begin
            begin = hours[-1]
            upper.plot(hours, means["T"] - zero_Celsius, color=style.VERMILION)
            for when, colour in (("before", style.ORANGE), ("after", style.BLUE)):
                label = None if i else {"before": "uncompensated", "after": "compensated"}[when]
                lower.plot(hours, means[when] / unit, color=colour, linewidth=0.9, label=label)
        lower.axhline(0, color=style.BLACK, linewidth=0.8)
        return made
