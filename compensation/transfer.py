"""Transfer functions with real or complex coefficients (of demodulated dynamics), as values: response, poles, time simulation."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from compensation.arrays import Complex
from compensation.errors import CompensationError
from compensation.samples import check_time, is_regular

SAME_STEP = 1e-9  # part of the usual step by which two steps may differ and still share one matrix exponential


@dataclass(frozen=True)
class TransferFunction:
    """A rational function W(s) = numerator(s) / denominator(s)."""

    # numerator, denominator: tuple of complex, coefficients, highest power of s (1/s) first
    numerator: tuple[complex, ...]
    denominator: tuple[complex, ...]

    def __post_init__(self) -> None:
        for name in ("numerator", "denominator"):
            try:
                coefficients = np.trim_zeros(np.atleast_1d(np.asarray(getattr(self, name), dtype=complex)), "f")
            except (TypeError, ValueError):
                raise CompensationError(f"the {name} of a transfer function takes numbers.") from None
            if not np.all(np.isfinite(coefficients)):
                raise CompensationError(f"the {name} of a transfer function has a coefficient that is not finite.")
            object.__setattr__(self, name, tuple(coefficients.tolist()) or (0j,))
        if self.denominator == (0j,):
            raise CompensationError("the denominator of a transfer function is zero.")

    def __call__(self, s: ArrayLike) -> Any:
        """Return W(s) at any complex s (1/s)."""
        s = np.asarray(s, dtype=complex)
        return np.polyval(self.numerator, s) / np.polyval(self.denominator, s)

    def __mul__(self, other: "TransferFunction | complex") -> "TransferFunction":
        """Return the two in series, or this one times a number."""
        if not isinstance(other, TransferFunction):
            return TransferFunction(tuple(other * np.asarray(self.numerator)), self.denominator)
        return TransferFunction(
            tuple(np.polymul(self.numerator, other.numerator)), tuple(np.polymul(self.denominator, other.denominator))
        )

    def respond(self, frequency: ArrayLike) -> Any:
        """Return the frequency response W(jλ) at the angular frequencies `frequency` (rad/s, any sign)."""
        return self(1j * np.asarray(frequency, dtype=float))

    @property
    def is_real(self) -> bool:
        """Whether all coefficients are real, so that a real input gives a real output."""
        return not np.any(np.imag(self.numerator)) and not np.any(np.imag(self.denominator))

    @cached_property
    def poles(self) -> Complex:
        """Zeros of the denominator (1/s)."""
        return np.roots(self.denominator).astype(complex)

    @cached_property
    def zeros(self) -> Complex:
        """Zeros of the numerator (1/s)."""
        return np.roots(self.numerator).astype(complex)

    @property
    def is_stable(self) -> bool:
        """Whether every pole lies to the left of the imaginary axis."""
        return bool(np.all(self.poles.real < 0))

    @property
    def steady_gain(self) -> complex:
        """W(0), what remains of a constant input."""
        if self.denominator[-1] == 0:
            raise CompensationError("the transfer function has a pole at s = 0, so it has no steady gain.")
        return complex(self.numerator[-1] / self.denominator[-1])

    def cancel(self, tolerance: float = 1e-7) -> "TransferFunction":
        """Return the same function without pairs of pole and zero that agree to `tolerance`, relative to the pole."""
        zeros, poles = list(self.zeros), []
        for pole in self.poles:
            near = [zero for zero in zeros if abs(zero - pole) <= tolerance * abs(pole)]
            if near:
                zeros.remove(near[0])
            else:
                poles.append(pole)
        pair = []
        for first, roots in ((self.numerator[0], zeros), (self.denominator[0], poles)):
            polynomial = np.atleast_1d(first * np.poly(roots))
            pair.append(tuple((polynomial.real if self.is_real else polynomial).tolist()))
        return TransferFunction(*pair)

    def realise(self) -> tuple[Complex, Complex, Complex, complex]:
        """Return A, B, C, D of ẋ = A x + B u, y = C x + D u: the companion form in time units of the fastest pole."""
        n = len(self.denominator) - 1
        if len(self.numerator) > n + 1:
            raise CompensationError("the numerator has a higher degree than the denominator: not causal.")
        scale = float(np.max(np.abs(self.poles), initial=0.0)) or 1.0
        powers = scale ** np.arange(n, -1, -1.0)
        denominator = np.asarray(self.denominator) * powers
        numerator = np.zeros(n + 1, dtype=complex)
        numerator[n + 1 - len(self.numerator) :] = self.numerator
        numerator = numerator * powers / denominator[0]
        denominator = denominator / denominator[0]
        A = np.diag(np.ones(max(n - 1, 0), dtype=complex), -1)[:n, :n] if n else np.zeros((0, 0), complex)
        if n:
            A[0] = -denominator[1:]
        B = np.eye(n, 1, dtype=complex)[:, 0]
        D = complex(numerator[0])
        C: Complex = numerator[1:] - D * denominator[1:]
        return np.asarray(scale * A, complex), np.asarray(scale * B, complex), C, D

    def simulate(self, time: ArrayLike, values: ArrayLike, *, settled: bool = False) -> NDArray[Any]:
        """Return the output for an input linear between samples, exactly; `settled` starts at rest under the first value."""
        t, u = np.asarray(time, dtype=float), np.asarray(values)
        check_time(t)
        if u.shape != t.shape or not np.all(np.isfinite(u)):
            raise CompensationError("the input of a simulation needs one finite value for every time.")
        A, B, C, D = self.realise()
        x0 = np.zeros(len(B), dtype=complex)
        if settled:
            if self.denominator[-1] == 0:
                raise CompensationError("a transfer function with a pole at s = 0 has no settled start.")
            x0 = np.linalg.solve(A, -B * u[0]).astype(complex)
        x = _march(A, B, t, u, x0)
        y = C @ x + D * u
        return y.real if self.is_real and not np.iscomplexobj(u) else y


def _step(A: Complex, B: Complex, steps: NDArray[np.float64]) -> tuple[Complex, Complex, Complex]:
    """Φ, Γ₀, Γ₁ of x⁺ = Φ x + Γ₀ u + Γ₁ (u⁺ − u) for each step, from one augmented matrix exponential."""
    from scipy.linalg import expm

    n = len(B)
    if n == 1 and A[0, 0] != 0:  # one pole: e^x, (e^x − 1) B/a and the ramp's (e^x − 1 − x) B/(a x), x = a Δt
        x = A[0, 0] * steps
        grown = np.expm1(x)
        short = np.abs(x) < 1e-4  # where the ramp's difference loses digits: x/2 + x²/6 + x³/24
        slow = np.where(short, x * (0.5 + x / 6 + x**2 / 24), (grown - x) / np.where(short, 1.0, x))
        return np.exp(x)[:, None, None], (grown * B[0] / A[0, 0])[:, None], (slow * B[0] / A[0, 0])[:, None]
    augmented = np.zeros((len(steps), n + 2, n + 2), dtype=complex)
    augmented[:, :n, :n] = A * steps[:, None, None]
    augmented[:, :n, n] = B * steps[:, None]
    augmented[:, n, n + 1] = 1.0
    exponential: Complex = np.asarray(expm(augmented), dtype=complex)
    return exponential[:, :n, :n], exponential[:, :n, n], exponential[:, :n, n + 1]


def run_states(transition: NDArray[Any], forcing: NDArray[Any], start: NDArray[Any]) -> NDArray[Any]:
    """States x_{k+1} = A x_k + f_k, (n, rows + 1): by Schur's form of A a chain of first-order recursions."""
    from scipy.linalg import rsf2csf, schur

    T, Z = schur(transition) if len(transition) else (transition, transition)
    if np.isrealobj(T) and np.diag(T, -1).any():  # a pair of complex poles is a block
        T, Z = rsf2csf(T, Z)
    forced, z = Z.conj().T @ forcing, np.empty((len(T), forcing.shape[1] + 1), dtype=np.result_type(T, forcing, start))
    z[:, 0] = Z.conj().T @ start
    for i in reversed(range(len(T))):
        z[i] = recur(T[i, i], np.r_[z[i, 0], forced[i] + T[i, i + 1 :] @ z[i + 1 :, :-1]])
    return np.asarray(Z @ z)


def _march(A: Complex, B: Complex, t: NDArray[np.float64], u: NDArray[Any], x0: Complex) -> Complex:
    """States on any grid; equal steps share one matrix exponential."""
    steps, kind = np.array([(t[-1] - t[0]) / (len(t) - 1)]), np.zeros(len(t) - 1, dtype=np.intp)
    if not is_regular(t):
        grain = SAME_STEP * float(np.median(np.diff(t)))
        steps, kind = np.unique(np.maximum(np.round(np.diff(t) / grain), 1) * grain, return_inverse=True)
    transition, held, ramp = _step(A, B, steps)
    forcing = held[kind].T * u[:-1] + ramp[kind].T * np.diff(u)
    if len(steps) == 1:
        return np.asarray(run_states(transition[0], forcing, x0), dtype=complex)
    if len(B) == 1:
        return recur(transition[kind, 0, 0], np.r_[x0, forcing[0]])[None]
    x = [x0]
    for k, push in zip(kind, forcing.T, strict=True):
        x.append(transition[k] @ x[-1] + push)
    return np.array(x).T


def recur(pole: ArrayLike, forced: ArrayLike) -> NDArray[Any]:
    """Return y_k = pole · y_{k−1} + forced_k from rest, along the first axis of one column or of several; one pole, or one a step."""
    forced = np.asarray(forced)
    is_complex = np.iscomplexobj(pole) or np.iscomplexobj(forced)
    columns = forced.astype(complex if is_complex else float).reshape(len(forced), -1)
    band = np.ones((2, len(columns)), order="F", dtype=columns.dtype)
    band[1, :-1] = -np.asarray(pole)
    solve = scipy.linalg.lapack.ztbtrs if is_complex else scipy.linalg.lapack.dtbtrs
    return np.asarray(solve(band, columns, uplo="L", diag="U")[0]).reshape(forced.shape)
