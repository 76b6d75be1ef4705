"""`hrg tcf`: frequency against temperature and its parts."""

from typing import Any

import numpy as np

from compensation.arrays import Array
from shell.constants import zero_Celsius
from shell.law import FrequencyLaw
from studies.cli.arguments import AnyTheory, Card, FromDegC, Harmonic, Step, ToDegC, lay_temperatures
from studies.cli.output import answers
from studies.errors import InputError
from studies.instrument.card import load_card
from studies.instrument.display import display_name
from studies.papers import hrg
from studies.record import read_frequency_table
from studies.reports import style
from studies.reports.scenes import live_chapter
from studies.resonator.law import check_slope_known, law_of
from studies.results import Column, Drawing, Figure, Result, Table, rows_of

MOST_HARMONIC = 50  # a law of a higher one takes minutes
PARTS = {"E": "E", "nu": "ν", "rho": "ρ", "h": "h", "r": "r", "base": "base"}
CAPTION = "Slope of the frequency with its standard deviation (band), and its contributions."
LEAST = 0.005  # ppm/°C, that is shown


@answers("hrg.tcf/1")
def tcf(
    card: Card,
    *,
    from_degC: FromDegC = -20.0,
    to_degC: ToDegC = 40.0,
    step: Step = 10.0,
    harmonic: Harmonic = 2,
    theory: AnyTheory = "solid",
    measured: str | None = None,
) -> Result:
    """Show the frequency over temperature, its slope in ppm/°C, and the contributions of E, ν, ρ, h, r and the [mount].

    Args:
        measured: A steady-state table (temperature_degC,frequency_Hz) to compare by its local slopes; for the card
            hrg-30mm, Table 1 of the HRG paper unless another is given.
    """
    if harmonic > MOST_HARMONIC and theory != "rayleigh":
        raise InputError(f"--harmonic {harmonic}: the law is solved up to n = {MOST_HARMONIC}; hrg modes goes higher.")
    temperatures = lay_temperatures(from_degC, to_degC, step)
    instrument = load_card(card)
    check_slope_known(instrument)
    T = instrument.material.check(temperatures)
    law = law_of(instrument, float(T[0]), float(T[-1]), theory, harmonic)
    points, moves = _points(law, T), _moves(law, T)
    local, source = _measured_slopes(instrument.name, measured)
    payload = {
        "card": instrument.name, "theory": theory, "harmonic": harmonic, "law": instrument.material.law,
        "relative_error": law.error, "points": points, "prior": moves, "measured": local,
    }  # fmt: skip
    parts = [name for name in PARTS if name != "base" or law.mount]
    note = (
        f"Slopes in ppm/°C; ±: one standard deviation, as card and material law ({instrument.material.law}) state it."
    )
    if law.mount:
        note += " Base: stress from the thermal mismatch of the card's [mount]."
    columns = [
        "temperature_degC: T (°C) .1f | frequency_Hz: f (Hz) .3f",
        *(f"parts_ppm_per_degC.{name}: {PARTS[name]} +.2f" for name in parts),
        "slope_ppm_per_degC ± uncertainty_ppm_per_degC: slope",
    ]
    shown = sorted({0, len(T) // 2, len(T) - 1})
    at = [f"at {points[k]['temperature_degC']:g} °C".replace("-", "−") for k in shown]
    moved = [f"moves_slope_ppm_per_degC.{k}: {words} +.2f" for k, words in zip(shown, at, strict=True)]
    uncertain = [one for one in moves if max(map(abs, one["moves_slope_ppm_per_degC"])) >= LEAST]
    return Result(
        payload,
        f"Frequency of {instrument.name} over temperature",
        f"Mode n = {harmonic}, {theory} theory: the slope of the frequency, and the contributions of elastic constants, density and dimensions.",
        [
            Table(f"{instrument.name}, n = {harmonic}, {theory}", points, columns, note),
            Figure(lambda: _curves(points, parts, local), CAPTION) if len(points) > 1 else None,
            Table("Uncertainty of the law: change of the slope by one standard deviation (ppm/°C)", uncertain,
                [Column("coefficient", "quantity", spell=display_name), "coefficient: key | sd: standard deviation .2g", *moved]),
            Table("Measured slope between adjacent points", local,
                "temperature_degC: T (°C) .1f | slope_ppm_per_degC: slope (ppm/°C) .2f", source),
            live_chapter(instrument, harmonic, theory),
        ],
    )  # fmt: skip


def _curves(points: list[dict[str, Any]], parts: list[str], local: list[dict[str, float]]) -> Drawing:
    T, slope, sd = (
        np.array([p[key] for p in points])
        for key in ("temperature_degC", "slope_ppm_per_degC", "uncertainty_ppm_per_degC")
    )
    with style.figure(height=4.0, x="temperature (°C)", y="ppm/°C") as (made, axis):
        axis.fill_between(T, slope - sd, slope + sd, color=style.BLACK, alpha=0.12, linewidth=0)
        axis.plot(T, slope, color=style.BLACK, linewidth=2.2, label="slope")
        colours = (style.BLUE, style.VERMILION, style.GREEN, style.ORANGE, style.PURPLE, style.SKY)
        for name, colour in zip(parts, colours, strict=False):
            axis.plot(T, [p["parts_ppm_per_degC"][name] for p in points], "--", color=colour, label=PARTS[name])
        if local:
            axis.plot(*zip(*(one.values() for one in local), strict=True), "k.", label="measured")
        axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        return made


def _points(law: FrequencyLaw, T: Array) -> list[dict[str, Any]]:
    parts = law.parts(T)
    rows = rows_of({
        "temperature_degC": T - zero_Celsius,
        "frequency_Hz": law.frequency(T),
        "slope_ppm_per_degC": 1e6 * parts.total,
        "uncertainty_ppm_per_degC": 1e6 * law.slope_uncertainty(T),
    })  # fmt: skip
    shares = rows_of({name: 1e6 * getattr(parts, name) for name in PARTS})
    return [row | {"parts_ppm_per_degC": share} for row, share in zip(rows, shares, strict=True)]


def _moves(law: FrequencyLaw, T: Array) -> list[dict[str, Any]]:
    """Return what one standard deviation of each open coefficient of the law moves the slope by."""
    slopes, prior = law.slope_derivatives(T), law.material.prior
    return [
        {"coefficient": name, "sd": float(sd), "moves_slope_ppm_per_degC": (1e6 * sd * slopes[name]).tolist()}
        for name, sd in zip(prior.names, prior.sd, strict=True)
        if name in slopes
    ]


def _measured_slopes(card: str, path: str | None) -> tuple[list[dict[str, float]], str]:
    """Return the slope between neighbouring points of a table, and of which gyro; empty without one."""
    if path is not None:
        table = read_frequency_table(path)
        T, f = table.values["temperature_degC"], table.values["frequency_Hz"]
    elif card == hrg.CARD:
        T, f = hrg.printed_table1()
    else:
        return [], ""
    at, slopes = hrg.local_slopes(T, f)
    source = path or "the gyro of the HRG paper (Sensors 2012, 12, 6434, Table 1)"
    return rows_of({"temperature_degC": at, "slope_ppm_per_degC": slopes}), f"Measured on {source}."
