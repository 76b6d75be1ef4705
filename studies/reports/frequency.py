"""Parts of any page about a steady-state table: fit, inverse, order, and extrapolation."""

import numpy as np

from compensation.arrays import Array
from compensation.errors import CompensationError
from compensation.frequency import FrequencyFit, misreading_degC
from studies.models.kinds.frequency import valid_range
from studies.papers.hrg import FrequencyStudy
from studies.reports import style
from studies.reports.digits import raised
from studies.results import Column, Drawing, Facts, Figure, Head, Part, Table, row_of, rows_of

SOURCES = ("Wang X. et al., Sensors 2012, 12, 6434 (the HRG paper), eqs. (16)–(18), Table 2, figures 4 and 5.",)
ORDERS = {1: "straight line", 2: "quadratic", 3: "cubic", 4: "quartic", 5: "quintic"}
BEYOND = 20.0  # °C outside the measured range, where the extrapolation is shown


def name_order(order: int) -> str:
    """Return the usual name of a polynomial of this order."""
    return ORDERS.get(order, f"polynomial of order {order}")


def facts(study: FrequencyStudy) -> Facts:
    """Return the numbers that carry the answer."""
    fit = study.fit
    middle = float(np.mean(fit.temperature_range_degC))
    return Facts([
        (f"Slope at {round(middle, 1) + 0.0:g} °C", f"{float(fit.slope_ppm(middle)):.2f} ppm/°C", "middle of the range"),
        ("Largest temperature error", f"{np.abs(study.error_degC).max():.3f} K", "temperature from frequency"),
        ("Leave-one-out error", f"{fit.regression.leave_one_out_rms:.4f} Hz", "rms of points left out of the fit"),
        ("Order supported by the data", name_order(study.orders.recommended), "F-test at the 5 % level"),
    ])  # fmt: skip


def coefficients_table(study: FrequencyStudy, settled: bool = False) -> Table:
    """Return the polynomial's coefficients with their standard errors, which of settled parts are bounds."""
    rows = [
        {"name": f"a{k}" if k else "f0", "value": c, "error": u, "unit": "Hz" + f"/°C{raised(k) * (k > 1)}" * (k > 0)}
        for k, (c, u) in enumerate(zip(study.fit.coefficients, study.fit.standard_errors, strict=True))
    ]
    columns = "name: Coefficient | value ± error: Value | Unit"
    low, high = valid_range(study.fit)
    errors = "standard errors;"
    if settled and study.fit.regression.variance == study.fit.regression.least_variance:
        errors = "errors that allow every part what the least settled one may be off, so bounds rather than scatter;"
    note = f"With {errors} a saved model has all digits and is valid from {low:.4g} to {high:.4g} °C, a little beyond the data."
    return Table(f"Coefficients about T0 = {study.fit.reference_temperature_degC:g} °C", rows, columns, note)


def inverse_table(study: FrequencyStudy) -> Table:
    """Return the temperatures that the inverse of the fit gives."""
    found = row_of(study, "frequency", calculated="calculated_degC", error="error_degC")
    actual, residual = np.round(study.temperature_degC, 3), study.fit.regression.residuals
    rows = rows_of({**found, "actual": actual, "residual": residual})
    columns = "frequency: Frequency (Hz) .2f | actual: Actual (°C) g | calculated: Calculated (°C) .3f | error: Error (K) +.3f | residual: Fit residual (Hz) +.4f"
    return Table("Temperature from frequency", rows, columns, "Error: actual minus calculated temperature.")


def order_table(study: FrequencyStudy, settled: bool = False) -> Table:
    """Return the fits of rising order and the F-test of each against the one before."""
    rows = list(zip(study.orders.fits, [None, *study.orders.against_next], strict=False))
    columns: Head = [
        Column(lambda row: name_order(row[0].order), "Order"),
        "0.regression.degrees_of_freedom: Degrees of freedom | 0.regression.sum_of_squares: Sum of squares (Hz²) .3e | 0.chi_squared: χ² .3g"
        " | 0.regression.leave_one_out_rms: Leave-one-out error (Hz) .4f | 1.statistic: F .3g | 1.p_value: p .2g",
    ]
    noise = "rounding to the last digit is the only noise"
    if settled:  # the resolution stands for the error of the parts
        noise = f"every settled part is uncertain by {(study.fit.resolution or 0.0) / np.sqrt(12.0):.2g} Hz, as the least certain one"
    note = f"χ² assumes that {noise}. F and p test each order against the one below."
    return Table("Polynomials of rising order", rows, columns, note)


def order_sentence(study: FrequencyStudy) -> str:
    """Say which order the data support."""
    asked, order = study.orders.recommended, study.fit.order
    if asked == order == len(study.orders.fits):
        return f"A {name_order(order)} is needed; too few temperatures are given to test a higher order."
    if asked <= order:
        other = name_order(order + 1 if asked == order else order)
        return f"A {name_order(asked)} is sufficient: a {other} is not significantly better."
    before, after = (study.orders.fits[n - 1].regression.leave_one_out_rms for n in (order, asked))
    return f"A {name_order(order)} is not sufficient: a {name_order(asked)} is significantly better. The leave-one-out error changes from {before:.4f} to {after:.4f} Hz."


def order_parts(study: FrequencyStudy, settled: bool = False) -> list[Part]:
    """Return what shows the order that the data support, and what that means outside the measured range."""
    return [order_table(study, settled), _extrapolation(study, study.next_fit) if study.next_fit else None]


def fit_figure(study: FrequencyStudy) -> Figure:
    """Return the fitted curve over the measured points, with the residuals below (HRG paper, figure 4)."""

    def draw() -> Drawing:
        T = np.linspace(*study.fit.temperature_range_degC, 200)
        labels, heights = ("frequency (Hz)", "residual (mHz)"), (3, 1.2)
        with style.figure(2, 1, 4.6, "temperature (°C)", labels, sharex=True, height_ratios=heights) as (made, axes):
            upper, lower = axes
            upper.plot(T, study.fit.frequency(T), color=style.BLUE, label=name_order(study.fit.order))
            upper.plot(study.temperature_degC, study.frequency, "o", color=style.BLACK, label="measured")
            upper.ticklabel_format(axis="y", useOffset=False)
            lower.axhline(0, color=style.BLACK, linewidth=0.8)
            for fit, colour, mark in _fits(study):
                residual = 1e3 * fit.regression.residuals
                lower.plot(study.temperature_degC, residual, mark, color=colour, label=name_order(fit.order))
            return made

    return Figure(draw, "Measured frequency, fitted curve and residuals.", "Frequency and residuals over temperature.")


def error_figure(study: FrequencyStudy) -> Figure:
    """Return the error of the calculated temperature (HRG paper, figure 5a)."""

    def draw() -> Drawing:
        with style.figure(height=2.8, x="temperature (°C)", y="actual − calculated (K)") as (made, axes):
            axes.axhline(0, color=style.BLACK, linewidth=0.8)
            for fit, colour, mark in _fits(study):
                try:
                    error = study.temperature_degC - fit.temperature(study.frequency)
                except CompensationError:
                    continue
                axes.plot(study.temperature_degC, error, mark + "-", color=colour, label=name_order(fit.order))
            return made

    caption = "Error of the temperature calculated from the frequency."
    return Figure(draw, caption, "Temperature error over temperature.")


def _extrapolation(study: FrequencyStudy, other: FrequencyFit) -> Figure:
    low, high = study.fit.temperature_range_degC
    names = name_order(study.fit.order), name_order(other.order)
    # Which of the two holds out there is not known, so each is read at the other's frequency.
    pairs = ((study.fit, other, names, style.VERMILION), (other, study.fit, names[::-1], style.BLUE))

    def differ(T: float) -> str:
        return _most(np.abs([misreading_degC(one, two, T) for one, two, *_ in pairs]))

    def draw() -> Drawing:
        T = np.linspace(low - BEYOND, high + BEYOND, 200)
        with style.figure(height=2.8, x="temperature (°C)", y="reading error (K)") as (made, axes):
            axes.axvspan(low, high, color=style.SKY, alpha=0.18, label="measured range")
            axes.axhline(0, color=style.BLACK, linewidth=0.8)
            for one, two, (reader, truth), colour in pairs:
                label = f"read by the {reader} if the {truth} is true"
                axes.plot(T, misreading_degC(one, two, T), color=colour, label=label)
            return made

    caption = (
        f"Difference of the temperatures that the two polynomials give. Outside the measured range they differ by up to {differ(low - BEYOND)}"
        f" at {low - BEYOND:.3g} °C and up to {differ(high + BEYOND)} at {high + BEYOND:.3g} °C: use neither outside the measured range."
    )
    return Figure(draw, caption, "Difference of two fits: small inside the measured range, large outside.")


def _most(ends: Array) -> str:
    """Write the difference of two readings; a curve that turns has none beyond its turning point."""
    if not np.isfinite(ends).all():
        return "more than the range" if not np.isfinite(ends).any() else f"{np.nanmin(ends):.1f} K or more"
    return f"{ends.max():.2g} K"


def _fits(study: FrequencyStudy) -> list[tuple[FrequencyFit, str, str]]:
    both = ((study.fit, style.BLUE, "o"), (study.next_fit, style.VERMILION, "s"))
    return [(fit, colour, mark) for fit, colour, mark in both if fit is not None]
