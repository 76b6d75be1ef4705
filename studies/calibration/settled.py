"""Level f and slope f'/f of a steady-state table beside the card's at the reference temperature, by one polynomial of the rows."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from compensation.arrays import Array
from shell.constants import zero_Celsius
from studies.calibration.observed import SETTLED, SettledTable
from studies.calibration.scatter import Scatter, find_scatter, largest_scatter
from studies.errors import InputError

if TYPE_CHECKING:
    from studies.calibration.problem import CardProblem

DEGREE = 3
FOREIGN = 6.0
"""Standard deviations beyond which a table is not of the card's gyro."""
NEAR, NEAR_LEVEL = 3.0, 2e-3
"""Standard deviations of the slope, and part of the level, within which another reading of the temperatures agrees."""
NOTABLE = 2.0
"""Standard deviations of the level from which on it is said what would bridge it."""
REVERSED = "with the opposite sign"
READ_AS: dict[str, Callable[[Array], Array]] = {
    "in °F": lambda T: (T - zero_Celsius - 32.0) / 1.8 + zero_Celsius,
    REVERSED: lambda T: 2.0 * zero_Celsius - T,
}
"""What a temperature column may have been, K: not in °C, or not with its sign."""


@dataclass(frozen=True)
class Compared:
    """A measured number beside the card's, with the standard deviations of the prediction and of the reading."""

    measured: float
    predicted: float
    sd: float
    reading_sd: float = 0.0

    @property
    def away(self) -> float:
        """Measured minus predicted in standard deviations."""
        return (self.measured - self.predicted) / float(np.hypot(self.sd, self.reading_sd))


@dataclass(frozen=True)
class SettledComparison:
    """A table beside a card."""

    path: str
    card: str
    temperature_degC: float
    # level_Hz, slope_ppm_per_degC: The slope is None of a table with one temperature, or where the card's material has
    # no temperature law.
    level_Hz: Compared
    slope_ppm_per_degC: Compared | None
    bridges: tuple[str, ...] = ()  # what would take up the difference of the level alone
    scatter: Scatter | None = None  # of rows that follow no law; a single such row is left out of level and slope

    def as_dict(self) -> dict[str, Any]:
        """Return the numbers, with the distances in standard deviations."""
        both = {"level_Hz": self.level_Hz, "slope_ppm_per_degC": self.slope_ppm_per_degC}
        return {"temperature_degC": self.temperature_degC} | {
            name: None if one is None else asdict(one) | {"away_sd": one.away} for name, one in both.items()
        }

    @property
    def sentences(self) -> tuple[str, ...]:
        """The comparison in words."""
        level, slope = self.level_Hz, self.slope_ppm_per_degC
        share = 100.0 * (level.measured / level.predicted - 1.0)
        row = None if self.scatter is None else self.scatter.row
        first = (
            f"Measured at {self.temperature_degC:.4g} °C{'' if row is None else f', without row {row + 1}'}: {level.measured:.2f} Hz"
            + ("" if slope is None else f", {slope.measured:.1f} ppm/°C")
        )
        first += f". {self.card} predicts {level.predicted:.2f} ± {level.sd:.2g} Hz" + (
            "." if slope is None else f", {slope.predicted:.1f} ± {slope.sd:.1f} ppm/°C."
        )
        second = (
            f"Difference in level: {level.measured - level.predicted:+.2f} Hz ({share:+.2g} %), {_apart(level.away)}"
            + (
                "."
                if slope is None
                else f"; in slope: {slope.measured - slope.predicted:+.1f} ppm/°C, {_apart(slope.away)}."
            )
        )
        return (first, second, *self.bridges)


def _apart(away: float) -> str:
    return f"{abs(away):.1f} standard deviations" if abs(away) >= 0.05 else "well within the uncertainty"


def compare_settled(problem: "CardProblem") -> tuple[SettledComparison, ...]:
    """Set every table beside the card as shipped."""
    if not problem.tables:
        return ()
    state = problem.evaluate(np.zeros(problem.count))
    found = []
    for table, rows in zip(problem.tables, problem.rows[SETTLED].slices, strict=True):
        slopes = state.slope[SETTLED][rows]
        scatter = find_scatter(table, problem.law.frequency(table.temperature, extrapolate=True))
        if scatter is not None and (k := scatter.row) is not None:
            T, f = np.delete(table.temperature, k), np.delete(table.frequency, k)
            table, slopes = replace(table, temperature=T, frequency=f), np.delete(slopes, k, axis=0)
        one = replace(_compare(problem, table, table.temperature, slopes), scatter=scatter)
        slope = one.slope_ppm_per_degC
        if slope is not None and abs(slope.away) > NEAR and scatter is None:
            words, other = _read_otherwise(problem, table, slopes)
            if abs(slope.away) > FOREIGN:
                raise InputError(
                    f"{table.path}: frequency_Hz changes by {slope.measured:.1f} ppm/°C at {one.temperature_degC:.4g} °C, where the"
                    f" card {one.card} predicts {slope.predicted:.1f} ± {slope.sd:.1f}: {abs(slope.away):.0f} standard deviations. "
                    + (
                        f"If the temperatures are read {words}, the table agrees with the card ({other:.1f} standard deviations);"
                        " correct temperature_degC."
                        if words
                        else "This table is of another gyro; give the card of the gyro that was measured."
                    )
                )
            if words:
                note = f"If the temperatures were {words}, the slope would be {other:.1f} standard deviations away: check their unit."
                one = replace(one, bridges=(*one.bridges, note))
        found.append(one)
    return tuple(found)


def _compare(problem: "CardProblem", table: SettledTable, temperature: Array, slopes: Array) -> SettledComparison:
    """Compare readings of a table whose rows were at some temperatures (K)."""
    predicted = problem.law.frequency(temperature, extrapolate=True)
    middle = float(np.clip(problem.instrument.reference_temperature, temperature.min(), temperature.max()))
    degree = min(DEGREE, len(np.unique(temperature)) - 1)
    width = max(float(np.ptp(temperature)), 1.0)
    weights = np.linalg.pinv(np.vander((temperature - middle) / width, degree + 1))
    read = min(table.scatter, largest_scatter(table, predicted))
    at, f = weights[-1], float(weights[-1] @ predicted)
    row = at @ slopes
    level = Compared(float(at @ table.frequency), f, float(np.linalg.norm(row)), read * float(np.linalg.norm(at)))
    slope = None
    if degree > 0:
        along = weights[-2] / width / f
        own = float(np.linalg.norm(along @ slopes - row * float(along @ predicted) / f))
        if own > 0:
            measured = float(weights[-2] @ table.frequency) / width / level.measured
            noise = read * float(np.linalg.norm(along))
            slope = Compared(1e6 * measured, 1e6 * float(along @ predicted), 1e6 * own, 1e6 * noise)
    bridges = _bridges(problem, level, row) if abs(level.away) > NOTABLE else ()
    return SettledComparison(table.path, problem.instrument.name, middle - zero_Celsius, level, slope, bridges)


def _bridges(problem: "CardProblem", level: Compared, row: Array) -> tuple[str, ...]:
    """Say which dimension or modulus, and which value within the card's tolerances, would bridge a difference of the level."""
    away = float(np.log(level.measured / level.predicted))
    law = problem.law
    by_h = float(
        law.shape.by_thickness(law.material.value("poisson_ratio", [problem.instrument.reference_temperature]))[0]
    )
    ways = (
        (by_h, "thicker walls", "thinner walls"),
        (-1.0, "larger dimensions", "smaller dimensions"),
        (0.5, "a higher Young's modulus", "a lower Young's modulus"),
    )
    said = [
        f"{more if away / power > 0 else less} ({100 * np.expm1(away / power):+.2g} %)" for power, more, less in ways
    ]
    text = [f"Any one of these would remove the difference in level: {', '.join(said)}."]
    names = problem.priors.names
    acting = [k for k, name in enumerate(names) if name.startswith(("resonator.", "material.", "mount."))]
    per_sd = np.linalg.solve(problem.priors.root.T, row[: len(names)]) / level.predicted
    best = max(acting, key=lambda k: abs(per_sd[k]), default=None)
    if best is not None and per_sd[best] != 0.0:
        text.append(
            f"Among the card's uncertain values, {names[best]} would remove it with a change of {abs(away / per_sd[best]):.1f} standard deviations."
        )
    if not any(name.startswith("resonator.") for name in names):
        text.append("The card states no tolerance of a dimension, as thickness_mm = { value = …, relative_sd = 0.02 }.")
    return tuple(text)


def _read_otherwise(problem: "CardProblem", table: SettledTable, slopes: Array) -> tuple[str, float]:
    """Return the reading of the temperatures with which a table agrees with the card, and its slope's standard deviations; empty where none does."""
    for words, read in READ_AS.items():
        other = _compare(problem, table, read(table.temperature), slopes)
        near, level = other.slope_ppm_per_degC, other.level_Hz
        alike = abs(level.measured / level.predicted - 1.0) < NEAR_LEVEL or abs(level.away) < NEAR
        if near is not None and abs(near.away) < NEAR and alike:
            return words, abs(near.away)
    return "", 0.0
