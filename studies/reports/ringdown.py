"""Page of ring-downs: values, decays with what the fit leaves, 1/Q over pressure."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from compensation.ringdown.analysis import Estimate
from studies.reports.page import Chapter, Picture, Table, Text, draw, render_page
from studies.reports.style import BLUE, ORANGE, few_rows, figure
from studies.ringdown import Decay, GasLaw

SHOWN = {
    # estimate: words, unit
    "frequency_1_Hz": ("Frequency of the upper mode", "Hz"),
    "frequency_2_Hz": ("Frequency of the lower mode", "Hz"),
    "frequency_Hz": ("Mean frequency", "Hz"),
    "split_Hz": ("Frequency split", "Hz"),
    "frequency_axis_deg": ("Axis of the upper mode", "°"),
    "q_1": ("Q of the upper mode", ""),
    "q_2": ("Q of the lower mode", ""),
    "inverse_q": ("Mean 1/Q", ""),
    "decay_time_s": ("Decay time of the amplitude", "s"),
    "damping_split_per_s": ("Damping split Δ(1/τ)", "1/s"),
    "damping_axis_deg": ("Axis of most damping", "°"),
    "hardening_Hz": ("Frequency shift by the amplitude, at the start", "Hz"),
    "thickening_per_s": ("Extra damping by the amplitude, at the start", "1/s"),
    "drift_Hz_per_s": ("Drift of the frequency", "Hz/s"),
}


def decay_tables(decays: Sequence[Decay], gas: GasLaw | None) -> list[Table]:
    """Return what is found: every value of one decay, or a row for each of several, and the law over pressure."""
    tables = [_one(decay) for decay in decays if decay.phased is not None and len(decays) <= 3]
    if len(decays) > 1 or not tables:
        tables.append(_many(decays))
    if gas is not None:
        rows = [
            ["1/Q without gas", f"{gas.inverse_q0:.4g} ± {gas.inverse_q0_sd:.2g}"],
            ["growth with pressure (1/Pa)", f"{gas.slope:.4g} ± {gas.slope_sd:.2g}"],
            ["scatter between decays", f"{100 * gas.scatter:.2g} %"],
        ]
        tables.append(Table("1/Q over pressure", ["value", "with its standard deviation"], rows))
    return tables


def _one(decay: Decay) -> Table:
    assert decay.phased is not None
    found = decay.phased
    rows = [
        [f"{words} ({unit})" if unit else words, _digits(found.estimates[name]), *_interval(found.estimates[name])]
        for name, (words, unit) in SHOWN.items()
        if name in found.estimates
    ]
    start, end = found.window
    return Table(
        f"Ring-down {Path(decay.path).name}",
        ["quantity", "value", "low", "high"],
        rows,
        f"90 % intervals. Free decay from {start:.4g} to {end:.4g} s of the record; noise of a row {np.sqrt(np.mean(found.fit.noise**2)):.3g}. "
        + (
            f"Intervals are {found.fit.widening:.2g} times the Cramér–Rao bound of white noise."
            if found.fit.widening > 1
            else "Intervals are at the Cramér–Rao bound."
        ),
    )


def _many(decays: Sequence[Decay]) -> Table:
    rows = []
    for decay in decays:
        window = (decay.phased or decay.trace).window  # type: ignore[union-attr]
        q = decay.inverse_q
        rows.append(
            [
                Path(decay.path).name,
                "" if decay.frequency is None else f"{decay.frequency:.8g}",
                "" if q is None else f"{1 / q[0]:.4g}",
                "" if q is None else f"{1 / q[2]:.4g}",
                "" if q is None else f"{1 / q[1]:.4g}",
                f"{window[0]:.4g} to {window[1]:.4g}",
            ]
        )
    return Table(
        "Decays", ["file", "frequency (Hz)", "Q", "low", "high", "free decay (s)"], rows, "90 % intervals."
    )


def _digits(e: Estimate) -> str:
    """The value to two digits of its standard deviation."""
    if not e.sd > 0 or not np.isfinite(e.sd):
        return f"{e.value:.6g}"
    places = 1 - int(np.floor(np.log10(e.sd)))
    return f"{e.value:.{places}f}" if 0 <= places <= 9 and abs(e.value) < 1e7 else f"{e.value:.{_figures(e)}g}"


def _figures(e: Estimate) -> int:
    return int(np.clip(2 + np.floor(np.log10(abs(e.value) / e.sd + 1e-300)), 2, 15))


def _interval(e: Estimate) -> tuple[str, str]:
    return _digits(Estimate(e.low, e.sd, e.low, e.high)), _digits(Estimate(e.high, e.sd, e.low, e.high))


def ringdown_page(decays: Sequence[Decay], gas: GasLaw | None) -> str:
    """Return the page of ring-downs as HTML."""
    remarks = [Text(f"{Path(d.path).name}: {remark}", "warning") for d in decays for remark in d.remarks]
    chapters = [Chapter("Result", [*decay_tables(decays, gas), *remarks])]
    if gas is not None:
        chapters.append(Chapter("Pressure", [_pressure(decays, gas)]))
    chapters.append(Chapter("Decays", [_picture(decay) for decay in decays]))
    return render_page(
        "Ring-down", f"{len(decays)} free decay{'s' if len(decays) > 1 else ''} of one resonator.", chapters
    )


def _picture(decay: Decay) -> Picture:
    with figure(2, 1, height=4.6, sharex=True) as (drawn, (top, bottom)):
        if decay.phased is not None and decay.envelope is not None:
            rows = few_rows(decay.envelope.time.size)
            top.semilogy(decay.envelope.time[rows], np.abs(decay.envelope.values[:, rows]).T, ".", markersize=1.5)
            fit = decay.phased.fit
            rows = few_rows(fit.envelope.time.size)
            model = np.abs(fit.envelope.values - fit.residual)[:, rows]
            top.semilogy(fit.envelope.time[rows], model.T, color=ORANGE, linewidth=1)
            bottom.plot(fit.envelope.time[rows], fit.residual.real[:, rows].T, ".", markersize=1.5)
            bottom.set_ylabel("data less fit")
        else:
            assert decay.trace is not None
            assert decay.time is not None
            assert decay.amplitude is not None
            rows = few_rows(decay.time.size)
            t, level = decay.time[rows], 20 * np.log10(decay.amplitude[rows])
            line = 20 * np.log10(decay.trace.amplitude) - 20 / np.log(10) * decay.trace.decay * (
                t - decay.trace.window[0]
            )
            used = (t >= decay.trace.window[0]) & (t <= decay.trace.window[1])
            top.plot(t, level, color=BLUE, linewidth=0.8)
            top.plot(t[used], line[used], color=ORANGE, linewidth=1.4)
            bottom.plot(t[used], (level - line)[used], color=BLUE, linewidth=0.8)
            bottom.set_ylabel("data less fit (dB)")
        top.set_ylabel("power (dB)" if decay.trace is not None else "amplitude")
        bottom.set_xlabel("time (s)")
    name = Path(decay.path).name
    return draw(drawn, f"{name}: the record, the fitted decay (orange) and what the fit leaves.", f"Decay of {name}.")


def _pressure(decays: Sequence[Decay], gas: GasLaw) -> Picture:
    rows = [
        (d.notes["pressure_Pa"], d.inverse_q) for d in decays if d.inverse_q is not None and "pressure_Pa" in d.notes
    ]
    p, y = np.array([p for p, _ in rows]), np.array([q for _, q in rows])
    with figure() as (drawn, axes):
        axes.errorbar(p, y[:, 0], [y[:, 0] - y[:, 1], y[:, 2] - y[:, 0]], fmt="o", color=BLUE, markersize=4)
        grid = np.geomspace(max(p[p > 0].min() / 2, 1e-12), p.max() * 1.5, 200)
        axes.loglog(grid, gas.inverse_q0 + gas.slope * grid, color=ORANGE)
        axes.set_xlabel("pressure (Pa)")
        axes.set_ylabel("1/Q")
    return draw(drawn, "1/Q over pressure with the law 1/Q₀ + s p of free-molecular gas.", "1/Q over pressure.")
