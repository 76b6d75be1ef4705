"""Kalman filter of a sampled linear system (x, P, F, C, Q, R as usual), and the model of a gyro by the CVG paper on optimal filtering."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from compensation.arrays import Array
from compensation.errors import CompensationError
from compensation.transfer import run_states

SETTLED = 1e-13  # relative change of the covariance in one step below which it has settled
_NOT_STEADY = "this model has no steady filter: a persistent state is not observed, or no process noise drives it."


@dataclass(frozen=True)
class LinearModel:
    """x⁺ = F x + w, z = C x + v: eq. (37)."""

    transition: Array  # array (n, n), F
    measurement: Array  # array (m, n), C
    process_noise: Array  # array (n, n), Q, covariance of w over one step
    measurement_noise: Array  # array (m, m), R, covariance of v

    def __post_init__(self) -> None:
        for name in ("transition", "measurement", "process_noise", "measurement_noise"):
            object.__setattr__(self, name, np.atleast_2d(np.asarray(getattr(self, name), dtype=float)))
        n, m = self.transition.shape[0], self.measurement.shape[0]
        if self.transition.shape != (n, n) or self.measurement.shape != (m, n):
            raise CompensationError("the transition must be square and the measurement matrix as wide as it.")
        for name, size in (("process_noise", n), ("measurement_noise", m)):
            matrix = getattr(self, name)
            if matrix.shape != (size, size) or not np.allclose(matrix, matrix.T) or np.linalg.eigvalsh(matrix)[0] < 0:
                raise CompensationError(f"{name} must be a symmetric, non-negative {size} by {size} matrix.")
        if np.linalg.eigvalsh(self.measurement_noise)[0] <= 0:
            raise CompensationError("measurement_noise must be positive: a perfect measurement needs no filter.")


def model_gyro(k: float, zeta: float, step: float, process_noise: ArrayLike, measurement_noise: float) -> LinearModel:
    """Return the model of a tuned gyro with states (Ω measured, Ω₀ true), Ω₀ a random walk: eqs. (37)–(40), A = ((−kζ, kζ), (0, 0))."""
    if not (k > 0 and zeta > 0 and step > 0):
        raise CompensationError("the gyro model needs a positive natural frequency, damping and sampling step.")
    kept = np.exp(-k * zeta * step)
    return LinearModel(
        np.array([[kept, 1 - kept], [0.0, 1.0]]),
        np.array([[1.0, 0.0]]),
        np.asarray(process_noise, dtype=float),
        np.array([[measurement_noise]]),
    )


def predict(model: LinearModel, x: Array, P: Array) -> tuple[Array, Array]:
    """Return state and covariance one step on: F x, F P Fᵀ + Q."""
    F = model.transition
    return F @ x, F @ P @ F.T + model.process_noise


def weigh(model: LinearModel, P: Array) -> tuple[Array, Array, Array]:
    """Return the gain K, the innovation's S = C P Cᵀ + R, and the covariance after, (1 − K C) P (1 − K C)ᵀ + K R Kᵀ (Joseph)."""
    C, R = model.measurement, model.measurement_noise
    S = C @ P @ C.T + R
    K = np.asarray(np.linalg.solve(S, C @ P).T, dtype=float)
    kept = np.eye(len(P)) - K @ C
    return K, S, kept @ P @ kept.T + K @ R @ K.T


@dataclass(frozen=True)
class KalmanRun:
    """States (N, n) and covariances (N, n, n) after each measurement, innovations (N, m), their covariances (N, m, m)."""

    states: Array
    covariances: Array
    innovations: Array
    innovation_covariances: Array

    @property
    def nis(self) -> Array:
        """Normalised innovation squared νᵀ S⁻¹ ν (N,): chi-squared with m degrees of freedom if the model is right."""
        solved = np.linalg.solve(self.innovation_covariances, self.innovations[..., None])[..., 0]
        return np.asarray(np.einsum("ni,ni->n", self.innovations, solved), dtype=float)


def run_filter(model: LinearModel, measurements: ArrayLike, start: ArrayLike, covariance: ArrayLike) -> KalmanRun:
    """Filter evenly sampled measurements z, (N,) or (N, m), the first one step after `start`; leave gaps to `predict`."""
    z = np.asarray(measurements, dtype=float)
    z = z[:, None] if z.ndim == 1 else z
    m, n = model.measurement.shape
    if z.ndim != 2 or z.shape[1] != m:
        raise CompensationError(f"a measurement of this model has {m} values, not the shape {z.shape}.")
    holes = np.flatnonzero(~np.all(np.isfinite(z), axis=1))
    if len(holes):
        raise CompensationError(f"measurement {holes[0] + 1} is missing or infinite; predict over the gap instead.")
    x, P = np.asarray(start, dtype=float), np.asarray(covariance, dtype=float)
    if x.shape != (n,) or P.shape != (n, n):
        raise CompensationError(f"the start needs {n} states and a {n} by {n} covariance, not {x.shape} and {P.shape}.")
    states, covariances = np.empty((len(z), n)), np.empty((len(z), n, n))
    innovations, spreads = np.empty((len(z), m)), np.empty((len(z), m, m))
    F, C = model.transition, model.measurement
    settled = False
    for i, row in enumerate(z):
        K, S, after = weigh(model, predict(model, x, P)[1])
        settled, P, before = bool((np.abs(after - P) <= SETTLED * np.abs(P)).all()), after, F @ x
        x = before + K @ (row - C @ before)
        states[i], covariances[i], innovations[i], spreads[i] = x, P, row - C @ before, S
        if settled:  # the covariance does not depend on the data; once it repeats itself x⁺ = (1 − K C) F x + K z
            rest = slice(i + 1, None)
            states[rest] = run_states((np.eye(n) - K @ C) @ F, K @ z[rest].T, x)[:, 1:].real.T
            covariances[rest], spreads[rest] = P, S
            innovations[rest] = z[rest] - states[i:-1] @ (C @ F).T
            break
    return KalmanRun(states, covariances, innovations, spreads)


def settle(model: LinearModel) -> tuple[Array, Array, Array]:
    """Return gain K and the settled covariances before, P = F P Fᵀ − F P Cᵀ (C P Cᵀ + R)⁻¹ C P Fᵀ + Q, and after a measurement."""
    from scipy.linalg import LinAlgError, solve_discrete_are

    C, R = model.measurement, model.measurement_noise
    try:
        P = np.asarray(solve_discrete_are(model.transition.T, C.T, model.process_noise, R), dtype=float)
    except LinAlgError as error:
        raise CompensationError(_NOT_STEADY) from error
    K, _, after = weigh(model, P)
    if np.max(np.abs(np.linalg.eigvals((np.eye(len(P)) - K @ C) @ model.transition))) > 1 - 1e-12:
        raise CompensationError(_NOT_STEADY)
    return K, P, after


def noise_of_estimate(model: LinearModel) -> Array:
    """Return the settled estimate's covariance by measurement noise alone: N = A N Aᵀ + K R Kᵀ, A = (1 − K C) F."""
    from scipy.linalg import solve_discrete_lyapunov

    K = settle(model)[0]
    A = (np.eye(len(K)) - K @ model.measurement) @ model.transition
    return np.asarray(solve_discrete_lyapunov(A, K @ model.measurement_noise @ K.T), dtype=float)


def expect_mean_nis(rows: int, degrees: int, probability: float = 0.95) -> tuple[float, float]:
    """Return the band of the mean of `rows` NIS (over time) or NEES (of independent runs) values, from chi-squared."""
    from scipy.special import chdtri

    beside = (1 - probability) / 2
    low, high = chdtri(rows * degrees, 1 - beside), chdtri(rows * degrees, beside)
    return float(low) / rows, float(high) / rows
