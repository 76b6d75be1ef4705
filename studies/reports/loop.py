"""The page of a card's loops: margins, answers to a step, start-up, where drift comes from, noise by source, and a run."""

from typing import TYPE_CHECKING

import numpy as np

from compensation.controllers import Loops
from studies.reports import style
from studies.reports.page import Block, Chapter, Facts, Picture, Table, Text, draw, render_page
from studies.simulation.loop_study import answer_steps, bias_around, bias_slopes, noise_over

if TYPE_CHECKING:
    from studies.record import Record
    from studies.simulation.loop_study import LoopStudy

COLOURS = (style.BLUE, style.VERMILION, style.GREEN, style.PURPLE, style.ORANGE, style.SKY, style.YELLOW)
NOISE_NAMES = {
    "pickoff": "pick-off noise",
    "adc_step": "ADC steps",
    "dac_step": "DAC steps",
    "drive": "drive noise",
    "thermal": "thermomechanical",
    "all": "all",
}
MODES = {"force-rebalance": "force-to-rebalance", "whole-angle": "whole-angle"}
SHARED_NOTE = (
    "± one standard deviation, from the card's uncertain values; all: with the axes and the split that they share."
)
LENGTHS = tuple(np.geomspace(0.01, 1e4, 25))
COLUMNS = {
    # of a run, as far as it has them: label of the axis
    "bias_deg_per_h": "bias (°/h)",
    "measured_rate_deg_per_s": "rate (°/s)",
    "pattern_angle_deg": "azimuth (°)",
    "quadrature_V": "quadrature (V)",
    "frequency_Hz": "frequency (Hz)",
}
SMALLEST = 1e-4  # of the largest effect on the bias: smaller ones are not listed
MOST_POINTS = 3000  # drawn of a run; longer ones are averaged


def loop_page(study: "LoopStudy", temperature_degC: float, run: "Record | None" = None) -> str:
    """Return the page."""
    mode = study.instrument.loop.mode if study.instrument.loop is not None else ""
    lead = (
        f"The loops that read {study.instrument.name} in {MODES[mode]} mode at {temperature_degC:g} °C: {study.frequency:.2f} Hz,"
        f" Q = {_short(1 / study.inverse_q)}, the vibration decays with a time constant of {_short(1 / study.decay)} s."
    )
    chapters = [
        Chapter("In short", [_facts(study), *_weakest(study)]),
        Chapter("Where drift comes from", [sources_table(study), _around_figure(study), *_slopes(study)]),
        Chapter("Noise of the rate", [noise_table(study), _noise_figure(study)]),
        Chapter("Margins", [margins_table(study), _bode(study), range_table(study)]),
        Chapter("Answer to a step", [_steps(study)]),
        Chapter("Start-up", [_start(study)]),
    ]
    if run is not None:
        chapters.append(Chapter("A run through the loops", _run(run)))
    return render_page(f"Loops of {study.instrument.name}", lead, chapters)


def margins_table(study: "LoopStudy") -> Table:
    """Return crossover and margins of each loop, and how a start goes."""
    rows = [
        [
            m.loop,
            Loops.PAPER[m.loop],
            f"{m.crossover:.3g}",
            f"{np.degrees(m.phase):.0f}",
            f"{20 * np.log10(m.gain):.1f}",
            f"{m.reversal:.3g}",
        ]
        for m in study.margins
    ]
    columns = ["loop", "paper", "gain 1 at Hz", "phase margin °", "gain margin dB", "turns over at Hz"]
    keys = study.instrument.loop
    headroom = keys.drive_headroom if keys is not None else 0.0
    note = (
        f"From rest with {headroom:g} times the holding drive: locked after {study.start.locked:.3g} s, amplitude within 1 % after"
        f" {study.start.ready:.4g} s."
    )
    return Table("Margins", columns, rows, note)


def sources_table(study: "LoopStudy") -> Table:
    """Return the bias of each source at the card's azimuth."""
    rows = [[one.name, f"{one.bias:.4g}", f"{one.sd:.2g}"] for one in study.sources]
    return Table("Bias by source, settled", ["source", "°/h", "± °/h"], rows, SHARED_NOTE)


def range_table(study: "LoopStudy") -> Table:
    """Return the parts of the actuators' ranges that the settled loops use."""
    keys, use = study.instrument.loop, study.use
    assert keys is not None
    stiff = keys.quadrature_control == "stiffness"
    force = f"force, {keys.rate_range_deg_per_s:g} °/s"
    rows = [
        ["rate" if keys.mode == "force-rebalance" else "self-precession", force, _percent(use.rate)],
        ["quadrature", f"stiffness, {keys.quadrature_range_Hz:g} Hz" if stiff else force, _percent(use.quadrature)],
        ["amplitude", f"drive, {keys.drive_headroom:g} times what holds it", _percent(use.drive)],
    ]
    if not stiff:
        rows.insert(2, ["rate and quadrature together", force, _percent(use.across)])
    return Table("Range of the actuators in use", ["loop", "actuator and range", "in use"], rows)


def _percent(part: np.ndarray) -> str:
    return f"{100 * float(np.max(part)):.3g} %"


def noise_table(study: "LoopStudy") -> Table:
    """Return the noise of each source."""
    rows = [[NOISE_NAMES[name], f"{one:.3g}", f"{walk:.3g}"] for name, (one, walk) in study.noise.items()]
    note = "°/√h from a mean over 100 s."
    return Table("Noise of the rate by source", ["source", "°/h over 1 s", "°/√h"], rows, note)


def _facts(study: "LoopStudy") -> Facts:
    total = study.sources[-1]
    single = [(name, one) for name, (one, _) in study.noise.items() if name != "all"]
    loudest = NOISE_NAMES[max(single, key=lambda pair: pair[1])[0]] if single else "none"
    phase = min(study.margins, key=lambda m: m.phase)
    gain = min(study.margins, key=lambda m: m.gain)
    largest = max(study.sources[:-1], key=lambda one: one.sd)
    return Facts(
        [
            ("Bias", f"{total.bias:.3g} ± {total.sd:.2g} °/h", f"most of the ±: {largest.name}"),
            ("Angle random walk", f"{study.noise['all'][1]:.3g} °/√h", f"loudest over 1 s: {loudest}"),
            (
                "Least margins",
                f"{np.degrees(phase.phase):.0f}°, {20 * np.log10(gain.gain):.0f} dB",
                f"{phase.loop} loop" if phase.loop == gain.loop else f"{phase.loop} loop, {gain.loop} loop",
            ),
            ("Amplitude ready", f"{study.start.ready:.3g} s", f"phase locked after {study.start.locked:.2g} s"),
        ]
    )


def _weakest(study: "LoopStudy") -> list[Text]:
    """What to attack first."""
    slopes = bias_slopes(study)
    if not slopes or slopes[0].effect == 0:
        return []
    total, first = study.sources[-1].sd, slopes[0]
    share = (first.effect / total) ** 2 if total > 0 else 0.0
    return [
        Text(
            f"Attack first: `{first.key}`. What is not known of it (± {first.sd:.3g}) is worth {first.effect:.3g} °/h,"
            f" {100 * share:.0f} % of the variance of the bias. A steady bias can be calibrated; what drifts by age or temperature"
            " drifts by these slopes."
        )
    ]


def _slopes(study: "LoopStudy") -> list[Block]:
    slopes = bias_slopes(study)
    found = [one for one in slopes if one.effect > SMALLEST * slopes[0].effect]
    if not found:
        return []
    rows = [[one.key, f"{one.value:.4g}", f"{one.sd:.3g}", f"{one.slope:.3g}", f"{one.effect:.3g}"] for one in found]
    columns = ["Value of the card", "Now", "±", "°/h per its unit", "Worth (°/h)"]
    return [Table("What moves the bias, largest first", columns, rows, "The unit is that of the key's name.")]


def _around_figure(study: "LoopStudy") -> Picture:
    azimuth = np.linspace(0.0, np.pi / 2, 181)
    parts = bias_around(study, azimuth)
    with style.figure(height=3.4) as (made, axis):
        for k, (name, values) in enumerate(parts.items()):
            strong = name == "all"
            axis.plot(
                np.degrees(azimuth),
                values,
                color=style.BLACK if strong else COLOURS[k % len(COLOURS)],
                linewidth=2.2 if strong else 1.4,
                label=name,
            )
        at = np.degrees(study.angle % (np.pi / 2))
        axis.axvline(at, color=style.BLACK, linestyle=":", linewidth=1.0, label="the card's azimuth")
        axis.set_xlabel("azimuth of the wave (°)")
        axis.set_ylabel("bias (°/h)")
        axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=9)
        words = "The bias over the azimuth of the wave, by source: what goes when that error is mended."
        return draw(made, words, words)


def _noise_figure(study: "LoopStudy") -> Picture:
    found = noise_over(study, LENGTHS)
    with style.figure(height=3.4) as (made, axis):
        for k, (name, values) in enumerate(found.items()):
            strong = name == "all"
            axis.loglog(
                LENGTHS,
                np.where(values > 0, values, np.nan),
                color=style.BLACK if strong else COLOURS[k % len(COLOURS)],
                linewidth=2.2 if strong else 1.4,
                label=NOISE_NAMES[name],
            )
        axis.set_xlabel("time over which the rate is averaged (s)")
        axis.set_ylabel("standard deviation (°/h)")
        axis.legend(fontsize=9)
        words = "Noise of the averaged rate by source: white in angle it falls as 1/t, white in rate as 1/√t."
        return draw(made, words, words)


def _bode(study: "LoopStudy") -> Picture:
    half = study.loops.sampling / 2
    low = min(m.crossover for m in study.margins) / 30
    f = np.geomspace(low, half * (1 - 1e-6), 600)
    drawn: dict[tuple[float, ...], str] = {}
    for m in study.margins:  # loops of the same bandwidth share a line
        key = (getattr(study.loops, m.loop), study.decay if m.loop != "phase" else 0.0)
        near = next((k for k in drawn if np.allclose(k[0], key[0]) and m.crossover > 30 * study.decay), None)
        if near is None:
            drawn[key] = m.loop
        else:
            drawn[near] += f", {m.loop}"
    with style.figure(2, 1, height=4.6, sharex=True) as (made, (upper, lower)):
        for k, words in enumerate(drawn.values()):
            name = words.split(", ")[0]
            margin = next(m for m in study.margins if m.loop == name)
            L = study.loops.open_loop(name, study.decay, f)
            phase = np.degrees(np.unwrap(np.angle(L)))
            phase -= 360 * np.round((np.interp(margin.crossover, f, phase) + 90) / 360)
            upper.loglog(f, np.abs(L), color=COLOURS[k], label=words)
            lower.semilogx(f, phase, color=COLOURS[k])
            upper.plot(margin.crossover, 1.0, "o", color=COLOURS[k], markersize=5)
            lower.plot(margin.crossover, np.degrees(margin.phase) - 180, "o", color=COLOURS[k], markersize=5)
            lower.plot(margin.reversal, -180, "s", color=COLOURS[k], markersize=5)
        upper.axhline(1.0, color=style.BLACK, linewidth=0.8)
        lower.axhline(-180, color=style.BLACK, linewidth=0.8)
        lower.set_ylim(-300, -60)
        lower.set_yticks([-270, -180, -90])
        upper.set_ylabel("loop gain")
        lower.set_ylabel("phase (°)")
        lower.set_xlabel("frequency (Hz)")
        upper.legend(fontsize=9)
        words = "Open loops over frequency. Dots: gain 1, the phase margin is the way down to −180°; squares: where the phase passes −180°."
        return draw(made, words, words)


def _steps(study: "LoopStudy") -> Picture:
    with style.figure(height=3.0) as (made, axis):
        for k, (name, (time, answer)) in enumerate(answer_steps(study).items()):
            dash = ("-", "-", "--", ":")[k % 4]
            axis.semilogx(time[1:], answer[1:], dash, color=COLOURS[k], label=name)
        axis.axhline(1.0, color=style.BLACK, linewidth=0.8)
        axis.set_xlabel("time after the jump (s)")
        axis.set_ylabel("command, over what it comes to")
        axis.legend(fontsize=9)
        words = "What each loop commands after what it holds has jumped: rate, quadrature, frequency, drive of the amplitude."
        return draw(made, words, words)


def _start(study: "LoopStudy") -> Picture:
    start = study.start
    keys = study.instrument.loop
    last = max(int(np.searchsorted(start.time, 1.6 * start.ready)), 2) if np.isfinite(start.ready) else None
    shown = slice(0, last, max((last or len(start.time)) // MOST_POINTS, 1))
    with style.figure(1, 2, height=2.8) as (made, (left, right)):
        left.plot(start.time[shown], start.amplitude[shown], color=style.BLUE)
        left.axvline(start.ready, color=style.BLACK, linestyle=":", linewidth=1.0)
        left.set_xlabel("time (s)")
        left.set_ylabel("amplitude over its command")
        early = slice(0, max(int(np.searchsorted(start.time, 5 / study.loops.phase)), 2))
        right.plot(start.time[early], np.degrees(start.phase_error[early]), color=style.VERMILION)
        right.axvline(start.locked, color=style.BLACK, linestyle=":", linewidth=1.0)
        right.set_xlabel("time (s)")
        right.set_ylabel("phase error (°)")
        offset = keys.start_offset_Hz if keys is not None else 0.0
        words = (
            f"From rest, the oscillator {offset:g} Hz and a quarter cycle off: the amplitude, ready at the dotted line, and the"
            " phase of the oscillator, locked there."
        )
        return draw(made, words, words)


def _run(run: "Record") -> list[Block]:
    names = [name for name in COLUMNS if name in run]
    time = run["time_s"] / 3600
    width = max(len(time) // MOST_POINTS, 1)
    count = len(time) // width * width

    def thinned(values: np.ndarray) -> np.ndarray:
        return np.asarray(values[:count].reshape(-1, width).mean(axis=1))

    with style.figure(len(names), 1, height=1.35 * len(names) + 0.5, sharex=True, squeeze=False) as (made, axes):
        for k, (axis, name) in enumerate(zip(axes[:, 0], names, strict=True)):
            axis.plot(thinned(time), thinned(run[name]), linewidth=0.8, color=COLOURS[k % len(COLOURS)])
            axis.set_ylabel(COLUMNS[name], fontsize=9)
            axis.ticklabel_format(axis="y", useOffset=False)
        axes[-1, 0].set_xlabel("time (h)")
        words = f"The record {run.path}" + (f", means of {width} rows." if width > 1 else ".")
        return [draw(made, words, "The columns of the run over time.")]


def _short(value: float) -> str:
    return f"{value:.3g}".replace("e+0", "e").replace("e+", "e")
