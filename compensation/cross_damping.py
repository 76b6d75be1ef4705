"""Bias of a Coriolis vibratory gyro from cross-damping that varies with temperature, and its compensation.

Equation numbers are those of the CVG cross-damping paper (Apostolyuk, Chikovani), whose (3) prints k₁ for k₂. The slow
model (8), (9) errs by 0.23 ζ in the complex amplitude and by 2.6 ζ² in its part in phase with a rate: 1e-3 of the bias
at ζ = 0.02. Only the product ζ₁₂ · 2k/g₂ is seen, so the *scale* of ζ₁₂ is as good as k; the printed (10) serves as the
shape ζ₁₂(T)/ζ₁₂(0) only.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from compensation.arrays import Array
from compensation.errors import CompensationError, require_runs
from compensation.noise_regression import correlated_covariance
from compensation.regression import fit_linear, refuse_constant_columns
from compensation.samples import check_time, own_columns, read_columns
from compensation.transfer import TransferFunction


def relate_cross_damping_to_rate_when_tuned(k: float, zeta: float, g2: float = 2.0) -> TransferFunction:
    """W(s) = 2 k² ζ / (g₂ (s + k ζ)), rad/s per unit ζ₁₂, for equal modes driven at resonance: eq. (9)."""
    if not (0 < k < 1e12 and 0 < zeta < 1 and g2 != 0):
        raise CompensationError("eq. (9) needs a positive natural frequency that a resonator can have, damping between 0 and 1, and g2 not zero.")  # fmt: skip
    return TransferFunction((2 * k**2 * zeta / g2,), (1.0, k * zeta))


def evaluate_cross_damping(coefficients: ArrayLike, shift: ArrayLike) -> Array:
    """ζ₁₂(T) = Σ ζᵢ Tⁱ: eq. (10), with T the shift (K) from the calibration temperature, ζᵢ in K⁻ⁱ."""
    shift = np.asarray(shift, dtype=float)
    return np.asarray(np.polynomial.polynomial.polyval(shift, np.asarray(coefficients, dtype=float)), dtype=float)


@dataclass(frozen=True)
class CrossDampingModel:
    """ζ₁₂(T) of one gyro, and its conversion to rate: eqs. (9), (10)."""

    coefficients: Array  # array (n + 1,), ζᵢ (K⁻ⁱ), constant first
    covariance: Array  # array (n + 1, n + 1), covariance of the coefficients
    calibration_temperature: float  # temperature (°C) from which T is counted
    k: float  # k, zeta, g2: natural frequency (rad/s), relative damping (1) and Coriolis coefficient (1) of eq. (9)
    zeta: float
    g2: float
    lowest: float  # lowest, highest: temperatures (°C) between which it is valid
    highest: float
    noise: float  # standard deviation (rad/s) of what the fit left

    def cross_damping(self, temperature: ArrayLike) -> Array:
        """Return ζ₁₂ (1) at a temperature (°C): eq. (10)."""
        return evaluate_cross_damping(self.coefficients, np.asarray(temperature) - self.calibration_temperature)

    def predict(self, time: ArrayLike, temperature: ArrayLike, *, extrapolate: bool = False) -> Array:
        """Return the erroneous rate (rad/s) over time: ζ₁₂(T(t)) through the filter (9), settled at the start."""
        t, T = read_columns(time=time, temperature=temperature)
        if not extrapolate and (T.min() < self.lowest or T.max() > self.highest):
            raise CompensationError(
                f"the temperature runs from {T.min():.2f} to {T.max():.2f} °C, but the model is valid from {self.lowest:.2f} to {self.highest:.2f} °C; allow extrapolation or fit a wider record."
            )
        return simulate_bias(t, self.cross_damping(T), self.k, self.zeta, self.g2)

    def compensate(
        self, time: ArrayLike, rate: ArrayLike, temperature: ArrayLike, *, extrapolate: bool = False
    ) -> Array:
        """Return the rate (rad/s) less its predicted cross-damping error; parameters as for `predict`."""
        _, Omega, _ = read_columns(time=time, rate=rate, temperature=temperature)
        return Omega - self.predict(time, temperature, extrapolate=extrapolate)

    def memory(self, time: ArrayLike, temperature: ArrayLike) -> float:
        """Return the largest part (rad/s) that the dynamics of (9) has in this profile beside 2k/g₂ ζ₁₂(T): below the noise it is not seen."""
        static = 2 * self.k / self.g2 * self.cross_damping(temperature)
        return float(np.max(np.abs(self.predict(time, temperature, extrapolate=True) - static)))


def simulate_bias(time: ArrayLike, cross_damping: ArrayLike, k: float, zeta: float, g2: float = 2.0) -> Array:
    """Return the erroneous rate (rad/s) that a history of ζ₁₂ causes, through eq. (9), settled at the start."""
    filter9 = relate_cross_damping_to_rate_when_tuned(k, zeta, g2)
    return np.asarray(filter9.simulate(time, cross_damping, settled=True), dtype=float)


@dataclass(frozen=True)
class RestRun:
    """One run of a gyro at rest: time (s), output (rad/s), temperature (°C); arrays (N,)."""

    time: Array
    rate: Array
    temperature: Array

    def __post_init__(self) -> None:
        own_columns(self)
        check_time(self.time)


def fit_cross_damping(
    runs: Sequence[RestRun], *, k: float, zeta: float, g2: float = 2.0, calibration_temperature: float = 20.0,
    order: int = 3,
) -> CrossDampingModel:  # fmt: skip
    """Fit ζ₁₂(T) to a gyro at rest, eq. (10) through eq. (9): columns Tⁱ after the filter, errors that wander (see `correlated`)."""
    require_runs(runs, RestRun, "RestRun")
    if order < 1:
        raise CompensationError(f"the polynomial of eq. (10) needs an order of 1 or more, not {order}.")
    if not runs:
        raise CompensationError("the cross-damping fit needs at least one run of the gyro at rest.")
    time, rate, temperature = (np.concatenate([getattr(r, n) for r in runs]) for n in ("time", "rate", "temperature"))
    refuse_constant_columns(temperature[:, None], ["temperature"])
    if len(rate) < order + 2:
        raise CompensationError(f"order {order} needs at least {order + 2} rows, not {len(rate)}; lower it.")
    size = float(np.max(np.abs(temperature - calibration_temperature)))
    shifts = [(run.time, (run.temperature - calibration_temperature) / size) for run in runs]
    powers = [np.concatenate([simulate_bias(t, x**i, k, zeta, g2) for t, x in shifts]) for i in range(order + 1)]
    fit = fit_linear(np.column_stack(powers), rate, [f"zeta_{i}" for i in range(order + 1)], constant=False)
    scale = size ** -np.arange(order + 1.0)
    return CrossDampingModel(
        coefficients=scale * fit.coefficients,
        covariance=scale[:, None] * correlated_covariance(fit, time) * scale,
        calibration_temperature=calibration_temperature,
        k=k,
        zeta=zeta,
        g2=g2,
        lowest=float(np.min(temperature)),
        highest=float(np.max(temperature)),
        noise=fit.standard_deviation,
    )
