"""Table 1, Table 2 and figures 4 and 5 of the HRG paper (Sensors 2012, 12, 6434) beside first principles by the card `hrg-30mm`."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from compensation.arrays import Array
from compensation.decimation import average_groups
from compensation.frequency import FrequencyFit, OrderComparison, compare_orders, fit_frequency
from shell.constants import zero_Celsius
from shell.law import SlopeParts, build_law
from shell.materials import read_materials
from studies.files.columns import read_columns
from studies.instrument.card import Instrument
from studies.record import read_frequency_table
from studies.resonator.law import law_of

RESOLUTION = 0.01  # Hz, last printed digit of Table 1
CARD = "hrg-30mm"
TABLE1 = Path(__file__).with_name("hrg_table1.csv")


@dataclass(frozen=True)
class FrequencyStudy:
    """A steady-state table, its fits of rising order, and the temperatures that they give back."""

    temperature_degC: Array
    frequency: Array
    fit: FrequencyFit
    orders: OrderComparison  # all of them
    calculated_degC: Array  # from the fit's inverse
    local_degC: Array  # between neighbouring points, as the slopes
    local_slope_ppm: Array

    @property
    def error_degC(self) -> Array:
        """Actual minus calculated temperature, as in the paper's Table 2."""
        return self.temperature_degC - self.calculated_degC

    @property
    def next_fit(self) -> FrequencyFit | None:
        """The fit of the next order, where the readings allow one."""
        higher = [fit for fit in self.orders.fits if fit.order == self.fit.order + 1]
        return higher[0] if higher else None


@dataclass(frozen=True)
class PhysicsComparison:
    """What the material's published laws predict for a card, beside the measured table."""

    instrument: Instrument
    temperature: Array
    parts: SlopeParts  # 1/K, of the slope by the card's law, at the local temperatures and, last, at 20 °C
    slope_ppm: Array  # ppm/°C, their sum
    uncertainty_ppm: Array  # ppm/°C, its standard deviation by the law's prior
    laws: Sequence[tuple[str, float, float]]  # name, slope at 20 °C and its uncertainty (ppm/°C) of every published law
    curvature_measured: float  # ppm/°C², twice the quadratic coefficient of ln f
    curvature_law: float
    curvature_uncertainty: float


def printed_table1() -> tuple[Array, Array]:
    """Return temperatures (°C) and frequencies (Hz) of the paper's Table 1."""
    table = read_frequency_table(TABLE1)
    return table.values["temperature_degC"], table.values["frequency_Hz"]


def printed_table2() -> tuple[Array, Array]:
    """Return the calculated temperatures and the errors (°C) that the paper's Table 2 prints."""
    names = ("frequency_Hz", "actual_temperature_C", "calculated_temperature_C", "error_C")
    table = read_columns(Path(__file__).with_name("hrg_table2.csv"), names, required=names)
    return table.values["calculated_temperature_C"], table.values["error_C"]


def study_table(
    temperature_degC: Array, frequency: Array, order: int = 3, reference_temperature_degC: float = 0.0,
    resolution: float | None = None,
) -> FrequencyStudy:  # fmt: skip
    """Fit a steady-state table as the paper does (eqs. 16-18), invert it (Table 2), and test the next orders."""
    ascending = np.argsort(temperature_degC)
    T, f = temperature_degC[ascending], frequency[ascending]
    fit = fit_frequency(T, f, order, reference_temperature_degC, resolution)
    orders = compare_orders(T, f, order + 2, reference_temperature_degC, resolution)
    return FrequencyStudy(T, f, fit, orders, fit.temperature(f), *local_slopes(T, f))


def local_slopes(temperature_degC: Array, frequency: Array) -> tuple[Array, Array]:
    """Return mid temperatures (°C) and slopes over the local frequency (ppm/°C) between neighbours; readings at one temperature count as one."""
    T, reading = np.unique(temperature_degC, return_inverse=True)
    f = average_groups(frequency, reading)
    return (T[1:] + T[:-1]) / 2, 2e6 * np.diff(f) / np.diff(T) / (f[1:] + f[:-1])


def compare_physics(study: FrequencyStudy, instrument: Instrument) -> PhysicsComparison:
    """Set first-principles physics, the solid solver over the card's material law, beside a measured table."""
    T = study.temperature_degC + zero_Celsius
    law = law_of(instrument, float(T.min()), float(T.max()))
    at = np.append(study.local_degC, 20.0) + zero_Celsius
    laws = []
    for material in read_materials()[instrument.material.name].values():
        one = build_law(instrument.resonator, material, instrument.reference_temperature, at[-1], at[-1])
        laws.append((material.law, 1e6 * float(one.parts(at[-1]).total), 1e6 * float(one.slope_uncertainty(at[-1]))))

    def curvature(values: Array) -> float:
        return float(2e6 * np.polynomial.Polynomial.fit(study.temperature_degC, values, 2).convert().coef[2])

    moved, prior = law.derivatives(T), law.material.prior
    acting = [k for k, name in enumerate(prior.names) if name in moved]
    curvatures = np.array([curvature(moved[prior.names[k]]) for k in acting])
    sd = float(np.sqrt(curvatures @ prior.covariance[np.ix_(acting, acting)] @ curvatures))
    measured, predicted = curvature(np.log(study.frequency)), curvature(law.logarithm(T))
    parts, slope_sd = law.parts(at), 1e6 * law.slope_uncertainty(at)
    slope = np.asarray(1e6 * parts.total)
    return PhysicsComparison(instrument, at, parts, slope, slope_sd, laws, measured, predicted, sd)
