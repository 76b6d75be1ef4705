"""The chapters that any steady-state table gets: fit, inverse, order, and what lies outside the range."""

from typing import TYPE_CHECKING

import numpy as np

from compensation.errors import CompensationError
from compensation.frequency import misreading_degC
from studies.reports import style
from studies.reports.page import Block, Chapter, Facts, Picture, Table, Text, draw, render_page

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from compensation.frequency import FrequencyFit
    from studies.papers.hrg import FrequencyStudy

ORDERS = {1: "line", 2: "quadratic", 3: "cubic", 4: "quartic", 5: "quintic"}


def name_order(order: int) -> str:
    """Return the usual name of a polynomial of this order."""
    return ORDERS.get(order, f"polynomial of order {order}")


def frequency_page(study: "FrequencyStudy", source: str) -> str:
    """Return the page for a user's own steady-state table."""
    low, high = study.fit.temperature_range_degC
    lead = (
        f"{len(study.frequency)} settled points from {low:g} to {high:g} °C ({source}), fitted by a"
        f" {name_order(study.fit.order)} as in the HRG paper's equations (16)–(18)."
    )
    chapters = [
        Chapter("In short", [_facts(study)]),
        Chapter(
            "Fit and inverse", [coefficients_table(study), inverse_table(study), fit_figure(study), error_figure(study)]
        ),
        order_chapter(study),
    ]
    return render_page("Frequency over temperature", lead, chapters)


def _facts(study: "FrequencyStudy") -> Facts:
    fit = study.fit
    middle = float(np.mean(fit.temperature_range_degC))
    return Facts(
        [
            ("Slope in the middle", f"{float(fit.slope_ppm(middle)):.2f} ppm/°C", f"at {middle:g} °C"),
            ("Largest temperature error", f"{np.abs(study.error_degC).max():.3f} °C", "actual minus calculated"),
            ("Leave-one-out error", f"{fit.leave_one_out_rms:.4f} Hz", "rms on points the fit has not seen"),
            ("Order supported by the readings", name_order(study.orders.recommended), "F-test at the 5 % level"),
        ]
    )


def coefficients_table(study: "FrequencyStudy") -> Table:
    """Return the polynomial's coefficients with their standard errors."""
    rows = [
        [
            f"a{k}" if k else "f0",
            f"{c:.8g}" if k == 0 else f"{c:.6e}",
            f"{u:.2e}",
            "Hz" + (f"/°C^{k}" if k > 1 else "/°C" * k),
        ]
        for k, (c, u) in enumerate(zip(study.fit.coefficients, study.fit.standard_errors, strict=True))
    ]
    return Table(
        f"Coefficients about T0 = {study.fit.reference_temperature_degC:g} °C",
        ["Coefficient", "Value", "Standard error", "Unit"],
        rows,
    )


def inverse_table(study: "FrequencyStudy") -> Table:
    """Return the temperatures that the fit's inverse gives back."""
    rows = [
        [f"{f:.2f}", f"{T:g}", f"{c:.3f}", f"{e:+.3f}", f"{r:+.4f}"]
        for f, T, c, e, r in zip(
            study.frequency,
            study.temperature_degC,
            study.calculated_degC,
            study.error_degC,
            study.fit.residuals,
            strict=True,
        )
    ]
    columns = ["Frequency (Hz)", "Actual (°C)", "Calculated (°C)", "Error (°C)", "Fit residual (Hz)"]
    return Table("Temperature from frequency", columns, rows, "Error is actual minus calculated temperature.")


def fit_figure(study: "FrequencyStudy") -> Picture:
    """Draw the fitted curve over the measured points, with the residuals below (HRG paper, figure 4)."""
    low, high = study.fit.temperature_range_degC
    T = np.linspace(low, high, 200)
    with style.figure(2, height=4.6, sharex=True, height_ratios=(3, 1.2)) as (made, (upper, lower)):
        upper.plot(T, study.fit.frequency(T), color=style.BLUE, label=name_order(study.fit.order))
        upper.plot(study.temperature_degC, study.frequency, "o", color=style.BLACK, label="measured")
        upper.set_ylabel("frequency (Hz)")
        upper.ticklabel_format(axis="y", useOffset=False)
        upper.legend()
        lower.axhline(0, color=style.BLACK, linewidth=0.8)
        for fit, colour, mark in _fits(study):
            lower.plot(study.temperature_degC, 1e3 * fit.residuals, mark, color=colour, label=name_order(fit.order))
        lower.set_ylabel("residual (mHz)")
        lower.set_xlabel("temperature (°C)")
        lower.legend(fontsize=8)
    return draw(
        made,
        "Measured frequency, fitted curve and what the fit leaves.",
        "Frequency rising with temperature; residuals below.",
    )


def error_figure(study: "FrequencyStudy") -> Picture:
    """Draw the error of the calculated temperature (HRG paper, figure 5a)."""
    with style.figure(height=2.8) as (made, axes):
        axes.axhline(0, color=style.BLACK, linewidth=0.8)
        for fit, colour, mark in _fits(study):
            try:
                error = study.temperature_degC - fit.temperature(study.frequency)
            except CompensationError:
                continue
            axes.plot(study.temperature_degC, error, mark + "-", color=colour, label=name_order(fit.order))
        axes.set_xlabel("temperature (°C)")
        axes.set_ylabel("actual − calculated (°C)")
        axes.legend()
    return draw(
        made, "Error of the temperature that is calculated from the frequency.", "Temperature error over temperature."
    )


def order_chapter(study: "FrequencyStudy") -> Chapter:
    """Return the chapter that asks which order the readings call for, and what it means outside the range."""
    blocks: list[Block] = [order_table(study), Text(order_sentence(study), "note")]
    if study.next_fit is not None:
        blocks.append(_extrapolation(study, study.next_fit))
    return Chapter("Is the order high enough?", blocks)


def order_table(study: "FrequencyStudy") -> Table:
    """Return the fits of rising order and the F-test of each against the one before."""
    rows = []
    for fit, test in zip(study.orders.fits, [None, *study.orders.against_next], strict=False):
        rows.append(
            [
                name_order(fit.order),
                str(fit.degrees_of_freedom),
                f"{fit.sum_of_squares:.3e}",
                "" if fit.chi_squared is None else f"{fit.chi_squared:.3g}",
                f"{fit.leave_one_out_rms:.4f}",
                "" if test is None else f"{test.statistic:.3g}",
                "" if test is None else f"{test.p_value:.2g}",
            ]
        )
    columns = ["Order", "Free", "SSE (Hz²)", "χ² (rounding)", "Leave-one-out (Hz)", "F against lower", "p"]
    note = "χ² takes rounding to the last digit as the only noise; free is the number of degrees of freedom."
    return Table("Which order do the readings support?", columns, rows, note)


def order_sentence(study: "FrequencyStudy") -> str:
    """Say which order the readings support."""
    asked = study.orders.recommended
    chosen = name_order(study.fit.order)
    if asked == study.fit.order:
        return f"The next order does not improve on the {chosen} significantly: a {chosen} is sufficient for these readings."
    if asked < study.fit.order:
        return f"A {name_order(asked)} is sufficient: the {chosen} does not improve on it significantly."
    return (
        f"A {chosen} is not sufficient: its residuals show structure. A {name_order(asked)} is significantly better; its error on points"
        f" left out falls from {study.fit.leave_one_out_rms:.4f} to {study.orders.fits[asked - 1].leave_one_out_rms:.4f} Hz."
    )


def _extrapolation(study: "FrequencyStudy", other: "FrequencyFit") -> Picture:
    low, high = study.fit.temperature_range_degC
    T = np.linspace(low - 20, high + 20, 200)
    names = name_order(study.fit.order), name_order(other.order)
    # Which of the two holds out there is not known, so each is read at the other's frequency.
    both = {
        f"{names[0]} read at the frequency of the {names[1]}": (study.fit, other),
        f"{names[1]} read at the frequency of the {names[0]}": (other, study.fit),
    }
    ends = [np.sort(np.abs([misreading_degC(*pair, T[k]) for pair in both.values()])) for k in (0, -1)]
    with style.figure(height=2.8) as (made, axes):
        axes.axvspan(low, high, color=style.SKY, alpha=0.18, label="measured range")
        axes.axhline(0, color=style.BLACK, linewidth=0.8)
        for (label, pair), colour in zip(both.items(), (style.VERMILION, style.BLUE), strict=True):
            axes.plot(T, misreading_degC(*pair, T), color=colour, label=label)
        axes.set_xlabel("temperature (°C)")
        axes.set_ylabel("error of reading (°C)")
        axes.legend(fontsize=8)
    caption = (
        f"Outside the measured range the two fits part: their readings differ by {_between(ends[0])} at {low - 20:g} °C"
        f" and by {_between(ends[1])} at {high + 20:g} °C. Neither should be extrapolated."
    )
    return draw(
        made, caption, "Difference of two fits over temperature, small inside the measured range, large outside."
    )


def _between(ends: "NDArray[np.float64]") -> str:
    """Write the two readings' difference; a curve that turns round has none."""
    if not np.isfinite(ends).all():
        return "more than the range" if not np.isfinite(ends).any() else f"{np.nanmin(ends):.1f} °C or more"
    low, high = (f"{end:.1f}" for end in ends)
    return f"{low} °C" if low == high else f"{low} to {high} °C"


def _fits(study: "FrequencyStudy") -> "list[tuple[FrequencyFit, str, str]]":
    shown = [(study.fit, style.BLUE, "o")]
    if study.next_fit is not None:
        shown.append((study.next_fit, style.VERMILION, "s"))
    return shown
