"""Tables and pictures of a card's loops: margins, step response, start-up, bias and noise by source, and a run."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.reports import style
from studies.reports.digits import plain
from studies.reports.page import Block, Picture, draw
from studies.results import Blocks, Chapter, Column, Facts, Sentence, Table
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
SHARED_NOTE = "±: one standard deviation, from the card's uncertain values; all: with their common axes and split."
LENGTHS = tuple(np.geomspace(0.01, 1e4, 25))
COLUMNS = {
    # of a run, as far as it has them: label of the axis
    "bias_deg_per_h": "bias (°/h)",
    "measured_rate_deg_per_s": "rate (°/s)",
    "pattern_angle_deg": "azimuth (°)",
    "quadrature_V": "quadrature (V)",
    "frequency_Hz": "frequency (Hz)",
}
MARGINS = (
    Column("loop", "loop"),
    Column("paper", "name in the paper"),
    Column("crossover_Hz", "gain crossover", "Hz", ".3g"),
    Column("phase_margin_deg", "phase margin", "°", ".0f"),
    Column("gain_margin_dB", "gain margin", "dB", ".1f"),
    Column("reversal_Hz", "phase crossover", "Hz", ".3g"),
)
SOURCES = (Column("source", "source"), Column("deg_per_h", "bias", "°/h"), Column("sd_deg_per_h", "±", "°/h", digits=2))
NOISE = (
    Column("source", "source"),
    Column("deg_per_h_over_1s", "over 1 s", "°/h", digits=3),
    Column("deg_per_rt_h", "angle random walk", "°/√h", digits=3),
)
RANGES = (
    Column("loop", "loop"),
    Column("actuator", "actuator and range"),
    Column("use", "in use", "%", digits=3, scale=100.0),
)
SLOPES = (
    Column("key", "key of the card"),
    Column("value", "value"),
    Column("sd", "±", digits=3),
    Column("slope", "°/h per unit", digits=3),
    Column("effect", "effect", "°/h", digits=3),
)
SMALLEST = 1e-4  # of the largest effect on the bias: smaller ones are not listed
MOST_POINTS = 3000  # drawn of a run; longer ones are averaged


def loop_lead(study: "LoopStudy", temperature_degC: float) -> str:
    """Return what the page is about."""
    mode = study.instrument.loop.mode if study.instrument.loop is not None else ""
    return (
        f"The loops that read {study.instrument.name} in {MODES[mode]} mode at {temperature_degC:g} °C: {study.frequency:.2f} Hz,"
        f" Q = {plain(1 / study.inverse_q)}, decay time constant of the vibration {plain(1 / study.decay)} s."
    )


def loop_parts(study: "LoopStudy", payload: dict[str, Any], run: "Record | None" = None) -> list[Chapter]:
    """Return what people read of the loops, of which `payload` holds the numbers."""
    keys, start = study.instrument.loop, study.start
    begun = (
        f"From rest with {keys.drive_headroom if keys is not None else 0.0:g} times the holding drive: locked after {start.locked:.3g} s,"
        f" amplitude within 1 % after {start.ready:.4g} s."
    )
    noise = [row | {"source": NOISE_NAMES[row["source"]]} for row in payload["noise"]]
    chapters = [
        Chapter("In short", [Facts(_facts(study)), *_weakest(study)]),
        Chapter("Where drift comes from", [
            Table("Bias by source, settled", payload["bias"], SOURCES, SHARED_NOTE),
            Blocks(lambda: [_around_figure(study)]), *_slopes(study),
        ]),
        Chapter("Noise of the rate", [
            Table("Noise of the rate by source", noise, NOISE, "°/√h from a mean over 100 s."), Blocks(lambda: [_noise_figure(study)]),
        ]),
        Chapter("Margins", [
            Table("Margins", payload["margins"], MARGINS, begun), Blocks(lambda: [_bode(study)]),
            Table("Range of the actuators in use", _ranges(study), RANGES),
        ]),
        Chapter("Step response", [Blocks(lambda: [_steps(study)])]),
        Chapter("Start-up", [Blocks(lambda: [_start(study)])]),
    ]  # fmt: skip
    return [*chapters, *([Chapter("A run through the loops", [Blocks(lambda: _run(run))])] if run is not None else [])]


def _ranges(study: "LoopStudy") -> list[dict[str, Any]]:
    """The parts of the actuators' ranges that the settled loops use."""
    keys, use = study.instrument.loop, study.use
    assert keys is not None
    stiff = keys.quadrature_control == "stiffness"
    force = f"force, {keys.rate_range_deg_per_s:g} °/s"
    found = [
        ("rate" if keys.mode == "force-rebalance" else "self-precession", force, use.rate),
        ("quadrature", f"stiffness, {keys.quadrature_range_Hz:g} Hz" if stiff else force, use.quadrature),
        *([] if stiff else [("rate and quadrature together", force, use.across)]),
        ("amplitude", f"drive, {keys.drive_headroom:g} times the holding drive", use.drive),
    ]
    return [{"loop": loop, "actuator": actuator, "use": float(np.max(part))} for loop, actuator, part in found]


def _facts(study: "LoopStudy") -> list[tuple[str, str, str]]:
    total = study.sources[-1]
    single = [(name, one) for name, (one, _) in study.noise.items() if name != "all"]
    loudest = NOISE_NAMES[max(single, key=lambda pair: pair[1])[0]] if single else "none"
    phase = min(study.margins, key=lambda m: m.phase)
    gain = min(study.margins, key=lambda m: m.gain)
    largest = max(study.sources[:-1], key=lambda one: one.sd)
    return [
        ("Bias", f"{plain(total.bias)} ± {plain(total.sd, 2)} °/h", f"largest contribution to the ±: {largest.name}"),
        ("Angle random walk", f"{study.noise['all'][1]:.3g} °/√h", f"largest source over 1 s: {loudest}"),
        (
            "Smallest margins",
            f"{np.degrees(phase.phase):.0f}°, {20 * np.log10(gain.gain):.0f} dB",
            f"{phase.loop} loop" if phase.loop == gain.loop else f"{phase.loop} loop, {gain.loop} loop",
        ),
        ("Amplitude ready", f"{study.start.ready:.3g} s", f"phase locked after {study.start.locked:.2g} s"),
    ]


def _weakest(study: "LoopStudy") -> list[Sentence]:
    """What to attack first."""
    slopes = bias_slopes(study)
    if not slopes or slopes[0].effect == 0:
        return []
    total, first = study.sources[-1].sd, slopes[0]
    share = (first.effect / total) ** 2 if total > 0 else 0.0
    return [
        Sentence(
            f"Attack first: {first.key}. Its uncertainty (± {first.sd:.3g}) contributes {first.effect:.3g} °/h,"
            f" {100 * share:.0f} % of the variance of the bias. A steady bias can be calibrated; drift with age or temperature follows"
            " these slopes."
        )
    ]


def _slopes(study: "LoopStudy") -> list[Table]:
    slopes = bias_slopes(study)
    rows = [asdict(one) | {"effect": one.effect} for one in slopes if one.effect > SMALLEST * slopes[0].effect]
    return [
        Table(
            "Sensitivity of the bias, largest effect first", rows, SLOPES, "The unit is that of the key's name.", "page"
        )
    ]


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
        words = "The bias over the azimuth of the wave, by source: the part that vanishes without that error."
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
        words = "Open loops over frequency. Dots: gain crossover, with the phase margin above −180°; squares: phase crossover."
        return draw(made, words, words)


def _steps(study: "LoopStudy") -> Picture:
    with style.figure(height=3.0) as (made, axis):
        for k, (name, (time, answer)) in enumerate(answer_steps(study).items()):
            dash = ("-", "-", "--", ":")[k % 4]
            axis.semilogx(time[1:], answer[1:], dash, color=COLOURS[k], label=name)
        axis.axhline(1.0, color=style.BLACK, linewidth=0.8)
        axis.set_xlabel("time after the step (s)")
        axis.set_ylabel("command, over its final value")
        axis.legend(fontsize=9)
        words = (
            "Command of each loop after a step of its disturbance: rate, quadrature, frequency, drive of the amplitude."
        )
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
