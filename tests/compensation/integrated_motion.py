"""The CVG papers' motion, equation (2), integrated through every cycle of the carrier: what the product is held against."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from compensation.motion import Motion, SensitiveElement, write_dynamics

Real = NDArray[np.float64]


def integrate_motion(
    element: SensitiveElement,
    time: ArrayLike,
    rate: ArrayLike,
    *,
    zeta12: ArrayLike | None = None,
    zeta21: ArrayLike | None = None,
    from_rest: bool = False,
    samples_per_cycle: int = 16,
    tolerance: float = 1e-10,
) -> Motion:
    """Integrate equation (2) through every carrier cycle.

    Parameters
    ----------
    element : SensitiveElement
        The oscillators.
    time, rate : array (N,)
        Times (s) and angular rate (rad/s) there, linear in between.
    zeta12, zeta21 : array (N,), optional
        Cross-damping (1) at these times; zero when left out.
    from_rest : bool
        Start with both motions at rest, instead of a settled primary and a resting secondary.
    samples_per_cycle : int
        Density of the returned displacements, an even grid.
    tolerance : float
        Relative tolerance of the integrator (Dormand–Prince 8(5,3)).

    Returns
    -------
    Motion
        Real displacements x₁, x₂.
    """
    t, Omega = np.asarray(time, dtype=float), np.asarray(rate, dtype=float)
    cross12, cross21 = (
        np.zeros_like(t) if zeta is None else np.asarray(zeta, dtype=float) for zeta in (zeta12, zeta21)
    )
    slopes = np.diff(Omega) / np.diff(t)
    omega, q10 = element.omega, element.q10

    def derivative(at: float, y: Real) -> Real:
        k = min(max(int(np.searchsorted(t, at, side="right")) - 1, 0), len(t) - 2)
        share = (at - t[k]) / (t[k + 1] - t[k])
        M = write_dynamics(
            element,
            Omega[k] + slopes[k] * (at - t[k]),
            slopes[k],
            cross12[k] + share * (cross12[k + 1] - cross12[k]),
            cross21[k] + share * (cross21[k + 1] - cross21[k]),
        )
        out: Real = M[:4, :4] @ y
        out[2] += q10 * np.sin(omega * at)
        return out

    A1 = 0j if from_rest else element.primary_amplitude * np.exp(1j * omega * t[0])
    start = [A1.imag, 0.0, (1j * omega * A1).imag, 0.0]
    step = 2 * np.pi / omega / samples_per_cycle
    grid = t[0] + step * np.arange(int((t[-1] - t[0]) / step * (1 + 1e-12)) + 1)
    solution = solve_ivp(
        derivative,
        (t[0], t[-1]),
        start,
        method="DOP853",
        t_eval=grid,
        rtol=tolerance,
        atol=tolerance * abs(element.primary_amplitude) * np.array([1, 1, omega, omega]),
        max_step=float(np.max(np.diff(t))),
    )
    assert solution.success, solution.message
    return Motion(grid, solution.y[0], solution.y[1])
