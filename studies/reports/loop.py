"""Tables and pictures of a card's loops: bias over azimuth, noise, open loops, step responses, start-up, and a run."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from studies.instrument.display import display_name
from studies.instrument.units import unit_of
from studies.record import Record
from studies.reports import style
from studies.reports.columns import draw_columns
from studies.reports.digits import plain, to_error
from studies.results import Chapter, Column, Drawing, Fact, Facts, Figure, Sentence, Table
from studies.simulation.loop_study import BiasSlope, LoopStudy, answer_steps, bias_around, noise_over

LENGTHS = tuple(np.geomspace(0.01, 1e4, 25))
COLUMNS = ("time_s", "bias_deg_per_h", "measured_rate_deg_per_s", "pattern_angle_deg", "quadrature_V", "frequency_Hz")
MOST_POINTS = 3000  # drawn of a start
NAMES = {
    # of sources in the JSON: what people read
    "pickoff": "pick-off noise",
    "adc_step": "ADC quantization",
    "dac_step": "DAC quantization",
    "drive": "drive noise",
    "thermal": "thermomechanical noise",
    "turn of the drives": "drive misalignment",
    "gain ratios": "gain mismatch",
    "phase errors on the quadrature": "phase errors acting on quadrature",
    "skewed axes": "axis skew",
    "all": "total",
}
TIE = 0.01  # relative: effects on the bias that are called equal
UNIT = {"1": "", "°": "°"}
SMALLEST = 1e-4  # of the largest effect on the bias: smaller ones are not listed


def describe(payload: Mapping[str, Any]) -> str:
    """Return mode, temperature, frequency and damping in one line."""
    mode = {"force-rebalance": "Force-to-rebalance", "whole-angle": "Whole-angle"}[payload["mode"]]
    f, q = payload["frequency_Hz"], payload["quality_factor"]
    return f"{mode} mode at {payload['temperature_degC']:g} °C: {f:.2f} Hz, Q = {plain(q)}, decay time constant {plain(q / (np.pi * f))} s."


def loop_parts(study: LoopStudy, payload: dict[str, Any], run: Record | None) -> list[Chapter]:
    """What people read: the answer, bias, noise, stability, start-up, the run."""

    def named(key: str) -> list[dict[str, Any]]:
        return [one | {"name": NAMES.get(one["source"], one["source"])} for one in payload[key]]

    shown = {name: run[name] for name in COLUMNS if name in run} if run is not None else {}
    slopes = study.slopes
    moving = [asdict(s) | {"effect": s.effect} for s in slopes if s.effect > SMALLEST * slopes[0].effect]
    headroom, offset = study.instrument.loop.drive_headroom, study.instrument.loop.start_offset_Hz  # type: ignore[union-attr]
    start = f"Start from rest with {headroom:g} times the steady-state drive: phase locked after {study.start.locked:.3g} s, amplitude within 1 % after {study.start.ready:.4g} s."
    return [
        Chapter("Summary", [
            Sentence(f"Loops of {payload['card']}. {describe(payload)}", where="terminal"),
            Facts(_facts(study, payload), "page"),
            *_largest(slopes, study.sources[-1].sd),
        ]),
        Chapter("Bias", [
            Table("Bias by source, settled", named("bias"), "name: source | deg_per_h ± sd_deg_per_h: bias (°/h)",
                "± one standard deviation, from the card's uncertain values. The total includes the uncertainty of the splits and their axes, which affect several sources at once."),
            Figure(lambda: _around(study), "Bias by source over the azimuth of the standing wave; removing an error removes its curve."),
            Table("Sensitivity of the bias to the card's values", moving, [
                Column("key", "quantity", spell=display_name),
                "key: key of the card | value ± sd: value | slope: slope (°/h per unit of the key) .3 | effect: 1 σ effect (°/h) .3",
            ], "Largest first.", "page"),
        ]),
        Chapter("Rate noise", [
            Table("Rate noise by source", named("noise"),
                "name: source | deg_per_h_over_1s: 1 s average (°/h) .3 | deg_per_rt_h: angle random walk (°/√h) .3g | angle_arcsec: angle white noise (″) .3g",
                "Standard deviations. Over t the rate scatters by √(N²/t + 2Q²/t²): N, the angle random walk, is white noise of the rate, Q of the angle (IEEE 952)."),
            Figure(lambda: _noise(study), "Noise of the averaged rate: white angle noise falls as 1/t, white rate noise as 1/√t."),
        ]),
        Chapter("Stability and range", [
            Table("Stability margins", payload["margins"],
                "loop | paper: symbol in the BVG paper | crossover_Hz: gain crossover (Hz) .3g | phase_margin_deg: phase margin (°) .0f | gain_margin_dB: gain margin (dB) .1f"
                " | reversal_Hz: phase crossover (Hz) .3g"),
            Figure(lambda: _bode(study), "Open-loop frequency response. Dots: gain crossover; squares: phase crossover (−180°)."),
            Table("Actuator range in use", _ranges(study, payload),
                "loop | actuator: actuator and range | use: in use (%) ×100 .3g"),
        ]),
        Chapter("Step response", [Figure(lambda: _steps(study),
            "Command of each loop after a unit step of its input: rate, quadrature, resonance frequency, amplitude disturbance.")]),
        Chapter("Start-up", [start, Figure(lambda: _start(study),
            f"Start from rest, the oscillator {offset:g} Hz and 90° off resonance. Dotted: amplitude within 1 %; phase locked.")]),
        *([] if run is None else [Chapter("Simulated run", [Figure(lambda: draw_columns(shown), f"The record {run.path}.")])]),
    ]  # fmt: skip


def _ranges(study: LoopStudy, payload: dict[str, Any]) -> list[dict[str, Any]]:
    keys, use = study.instrument.loop, payload["range"]
    assert keys is not None
    stiff = keys.quadrature_control == "stiffness"
    force = f"force, {keys.rate_range_deg_per_s:g} °/s"
    turning = "rate" if keys.mode == "force-rebalance" else "self-precession"
    rows = [(turning, force, "rate"), ("quadrature", f"stiffness, {keys.quadrature_range_Hz:g} Hz" if stiff else force, "quadrature"),
            *([] if stiff else [(f"{turning} and quadrature", force, "across")]),
            ("amplitude", f"drive, {keys.drive_headroom:g} times the steady-state drive", "drive")]  # fmt: skip
    return [{"loop": a, "actuator": b, "use": use[key] if use[key] > 1e-5 else "< 0.001"} for a, b, key in rows]


def _facts(study: LoopStudy, payload: dict[str, Any]) -> list[Fact]:
    total, noise = study.sources[-1], payload["noise"]
    largest = max(study.sources[:-1], key=lambda one: one.sd).name
    single = [one for one in noise if one["source"] != "all"]
    loudest = max(single, key=lambda one: one["deg_per_rt_h"])["source"] if single else ""
    margins = payload["margins"]
    phase, gain = (min(m[key] for m in margins) for key in ("phase_margin_deg", "gain_margin_dB"))
    near = [
        m["loop"]
        for m in margins
        if m["phase_margin_deg"] < phase * (1 + TIE) or m["gain_margin_dB"] < gain * (1 + TIE)
    ]
    return [
        ("Bias", f"{' ± '.join(to_error(total.bias, total.sd))} °/h", f"largest uncertainty: {NAMES.get(largest, largest)}"),
        ("Angle random walk", f"{noise[-1]['deg_per_rt_h']:.3g} °/√h", f"largest source: {NAMES.get(loudest, 'none')}; angle white noise {noise[-1]['angle_arcsec']:.3g}″"),
        ("Smallest margins", f"{phase:.0f}°, {gain:.0f} dB", f"{' and '.join(near)} loop{'s' * (len(near) > 1)}"),
        ("Start-up", f"{study.start.ready:.3g} s", f"phase locked after {study.start.locked:.2g} s"),
    ]  # fmt: skip


def _largest(slopes: tuple[BiasSlope, ...], sd: float) -> list[str]:
    if not slopes or slopes[0].effect == 0:
        return []
    effect = slopes[0].effect
    equal = [one for one in slopes if one.effect > (1 - TIE) * effect]
    names = " and ".join(
        f"{display_name(one.key)} ({one.key}, ± {one.sd:.3g}{UNIT.get(unit := unit_of(one.key), f' {unit}')})"
        for one in equal
    )
    share, each = 100 * (effect / sd) ** 2 if sd > 0 else 0.0, " each" * (len(equal) > 1)
    return [
        f"Largest contribution{'s' * (len(equal) > 1)} to the uncertainty of the bias: {names}, {effect:.3g} °/h{each}, {share:.0f} % of the"
        f" variance{each}. A constant bias can be calibrated out; drift of these values with age or temperature changes the bias in proportion to the slopes."
    ]


def _around(study: LoopStudy) -> Drawing:
    azimuth = np.linspace(0.0, np.pi / 2, 181)
    with style.figure(height=3.4, x="azimuth of the wave (°)", y="bias (°/h)") as (made, axis):
        _draw_sources(axis, np.degrees(azimuth), bias_around(study, azimuth))
        at = np.degrees(study.angle % (np.pi / 2))
        axis.axvline(at, color=style.BLACK, linestyle=":", linewidth=1.0, label="azimuth of the card")
        axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=9)
        return made


def _noise(study: LoopStudy) -> Drawing:
    found = {name: np.where(values > 0, values, np.nan) for name, values in noise_over(study, LENGTHS).items()}
    with style.figure(height=3.4, x="averaging time (s)", y="standard deviation (°/h)") as (made, axis):
        axis.set(xscale="log", yscale="log")
        _draw_sources(axis, LENGTHS, found)
        return made


def _draw_sources(axis: Any, x: Any, found: Mapping[str, Any]) -> None:
    for name, values in found.items():
        sum_of_all = {"color": style.BLACK, "linewidth": 2.2} if name == "all" else {"linewidth": 1.4}
        axis.plot(x, values, label=NAMES.get(name, name), **sum_of_all)


def _bode(study: LoopStudy) -> Drawing:
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
    labels = ("loop gain", "phase (°)")
    with style.figure(2, 1, 4.6, "frequency (Hz)", labels, sharex=True) as (made, (upper, lower)):
        for words in drawn.values():
            name = words.split(", ")[0]
            margin = next(m for m in study.margins if m.loop == name)
            L = study.loops.open_loop(name, study.decay, f)
            phase = np.degrees(np.unwrap(np.angle(L)))
            phase -= 360 * np.round((np.interp(margin.crossover, f, phase) + 90) / 360)
            (line,) = upper.loglog(f, np.abs(L), label=words)
            dot = {"color": line.get_color(), "markersize": 5}
            lower.semilogx(f, phase)
            upper.plot(margin.crossover, 1.0, "o", **dot)
            lower.plot(margin.crossover, np.degrees(margin.phase) - 180, "o", **dot)
            lower.plot(margin.reversal, -180, "s", **dot)
        upper.axhline(1.0, color=style.BLACK, linewidth=0.8)
        lower.axhline(-180, color=style.BLACK, linewidth=0.8)
        lower.set(ylim=(-300, -60), yticks=[-270, -180, -90])
        return made


def _steps(study: LoopStudy) -> Drawing:
    with style.figure(height=3.0, x="time after the step (s)", y="command / final value") as (made, axis):
        for k, (name, (time, answer)) in enumerate(answer_steps(study).items()):
            dash = ("-", "-", "--", ":")[k % 4]
            axis.semilogx(time[1:], answer[1:], dash, label=name)
        axis.axhline(1.0, color=style.BLACK, linewidth=0.8)
        return made


def _start(study: LoopStudy) -> Drawing:
    start = study.start
    last = max(int(np.searchsorted(start.time, 1.6 * start.ready)), 2) if np.isfinite(start.ready) else None
    shown = slice(0, last, max((last or len(start.time)) // MOST_POINTS, 1))
    with style.figure(1, 2, height=2.8) as (made, (left, right)):
        left.plot(start.time[shown], start.amplitude[shown], color=style.BLUE)
        left.axvline(start.ready, color=style.BLACK, linestyle=":", linewidth=1.0)
        left.set(xlabel="time (s)", ylabel="amplitude / command")
        early = slice(0, max(int(np.searchsorted(start.time, 5 / study.loops.phase)), 2))
        right.plot(start.time[early], np.degrees(start.phase_error[early]), color=style.VERMILION)
        right.axvline(start.locked, color=style.BLACK, linestyle=":", linewidth=1.0)
        right.set(xlabel="time (s)", ylabel="phase error (°)")
        return made
