"""The CVG papers' equations as they are printed, and their motion integrated with the carrier: what the product is held against.

Numbers are those of the paper on demodulated dynamics; of the paper on cross-damping where a name says so.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from compensation.demodulated import expand_secondary, relate_rate_to_secondary
from compensation.motion import Motion, write_dynamics
from compensation.sensitive_element import SensitiveElement
from compensation.transfer import TransferFunction

Real = NDArray[np.float64]


def relate_drive_to_primary(element: SensitiveElement) -> TransferFunction:
    """A₁(s) / q₁₀(s) = 1 / ((s + jω)² + 2 ζ₁ k₁ (s + jω) + k₁²), in s²: first of eqs. (7); at s = 0 it is (8)."""
    e = element
    detuning = (e.k1 - e.omega) * (e.k1 + e.omega)
    damping = e.zeta1 * e.k1
    return TransferFunction((1.0,), (1.0, 2 * (damping + 1j * e.omega), detuning + 2j * e.omega * damping))


def relate_primary_to_secondary(element: SensitiveElement, rate: float) -> TransferFunction:
    """A₂(s) / A₁(s) = g₂ Ω (s + jω) / ((s + jω)² + 2 ζ₂ k₂ (s + jω) + k₂²) for a constant rate: second of eqs. (7).

    It holds while the primary still builds up, where (9) and all that follows from it take A₁ as settled.
    """
    gain = element.g2 * rate
    return TransferFunction((gain, 1j * gain * element.omega), expand_secondary(element))


def relate_rate_to_slow_secondary(element: SensitiveElement) -> TransferFunction:
    """W₂(s) with the second derivative of the amplitude neglected: eq. (16), single pole (17)."""
    e, A1 = element, element.primary_amplitude
    return TransferFunction((A1, 1j * A1 * e.g2 * e.omega), expand_secondary(e)[1:])


def find_poles(element: SensitiveElement) -> NDArray[np.complex128]:
    """s₁,₂ = −k₂ ζ₂ ± j k₂ √(1 − ζ₂²) − jω (1/s): eq. (15); the first is the slow one, the second is near −2jω."""
    e = element
    ring = e.k2 * np.sqrt(1 - e.zeta2**2)
    return np.array([-e.k2 * e.zeta2 + 1j * (ring - e.omega), -e.k2 * e.zeta2 - 1j * (ring + e.omega)])


def find_slow_pole(element: SensitiveElement) -> complex:
    """s₁ = −(k₂² − ω² + 2jωζ₂k₂) / (2 (ζ₂ k₂ + jω)) (1/s): eq. (17)."""
    slope, constant = expand_secondary(element)[1:]
    return complex(-constant / slope)


def respond_to_oscillating_rate(element: SensitiveElement, frequency: ArrayLike) -> tuple[Real, Real]:
    """Return amplitude A(λ) (m per rad/s) and phase φ(λ) (rad) of the secondary for the rate e^{jλt}: eq. (14).

    The phase is taken with the sign of numerator and denominator of (14), so it is right in all four quadrants.

    Parameters
    ----------
    element : SensitiveElement
        The oscillators.
    frequency : array
        Angular frequency λ of the rate (rad/s), of either sign: the response is not symmetric.
    """
    e, frequency = element, np.asarray(frequency, dtype=float)
    shifted = frequency + e.omega
    first, second = e.k1**2 - e.omega**2, e.k2**2 - shifted**2
    gain = e.q10 * (frequency + e.g2 * e.omega)
    amplitude = gain / np.sqrt(
        (second**2 + 4 * e.zeta2**2 * e.k2**2 * shifted**2) * (first**2 + 4 * e.zeta1**2 * e.k1**2 * e.omega**2)
    )
    delta = 2 * (e.k2 * e.zeta2 * shifted * first + e.k1 * e.zeta1 * e.omega * second)
    phase = np.arctan2(second * first - 4 * e.k1 * e.k2 * e.zeta1 * e.zeta2 * e.omega * shifted, delta)
    return amplitude, phase


def split_primary(element: SensitiveElement) -> tuple[float, float]:
    """Real and imaginary part of A₁ (m): eq. (19).

    The paper prints A₁ᵢ = −2 q₁₀ j ω k₁ ζ₁ / (…); the imaginary *part* is real, so the j there is a slip.
    """
    e = element
    detuning, damping = e.k1**2 - e.omega**2, 2 * e.omega * e.k1 * e.zeta1
    size = detuning**2 + damping**2
    return e.q10 * detuning / size, -e.q10 * damping / size


def split_secondary(element: SensitiveElement) -> tuple[TransferFunction, TransferFunction]:
    """Real-coefficient transfer functions from rate to Re A₂ and Im A₂ (m per rad/s): eqs. (21), (22).

    A₂ᵣ = (A₁ᵣ Mᵣᵣ + A₁ᵢ Mᵣᵢ) / P · Ω and A₂ᵢ = (A₁ᵣ Mᵢᵣ + A₁ᵢ Mᵢᵢ) / P · Ω, with M and P as in (22); there
    Mᵣᵣ = Mᵢᵢ and Mᵢᵣ = −Mᵣᵢ.
    """
    e = element
    A1R, A1I = split_primary(e)
    inner = np.array([1.0, 2 * e.k2 * e.zeta2, e.k2**2 - e.omega**2])
    outer = np.array([1.0, e.k2 * e.zeta2])
    along = np.polyadd(np.polymul([1, 0], inner), 2 * e.g2 * e.omega**2 * outer)
    across = e.omega * np.polysub(2 * np.polymul([1, 0], outer), e.g2 * inner)
    P = tuple(np.polyadd(4 * e.omega**2 * np.polymul(outer, outer), np.polymul(inner, inner)))
    return (
        TransferFunction(tuple(np.polyadd(A1R * along, A1I * across)), P),
        TransferFunction(tuple(np.polysub(A1I * along, A1R * across)), P),
    )


def relate_cross_damping_to_secondary(element: SensitiveElement) -> TransferFunction:
    """W₂ᶻ(s) = 2 A₁ j ω k₂ / ((s + jω)² + 2 ζ₂ k₂ (s + jω) + k₂²), in m per unit ζ₁₂: second of eqs. (6).

    Its companion, rate to secondary, is `relate_rate_to_secondary`; both with the denominator of (4)
    instead are the slow forms.
    """
    return TransferFunction((_drive_by_damping(element),), expand_secondary(element))


def relate_cross_damping_to_slow_secondary(element: SensitiveElement) -> TransferFunction:
    """The same with the second derivative of the amplitude neglected, m per unit ζ₁₂: the ζ₁₂ part of eq. (4)."""
    return TransferFunction((_drive_by_damping(element),), expand_secondary(element)[1:])


def relate_cross_damping_to_rate(element: SensitiveElement) -> TransferFunction:
    """Cross-damping to erroneous rate, rad/s per unit ζ₁₂: eq. (8).

    W(s) = W₂ᶻ(s) / W₂(0) = 2 k₂ (k₂² − ω² + 2 j k₂ ω ζ₂) / (g₂ (k₂² − ω² + 2 k₂ ζ₂ s + 2 j ω (s + k₂ ζ₂))),
    which takes W₂ᶻ in its slow form (4), not in the form (6).
    """
    return relate_cross_damping_to_slow_secondary(element) * (1 / relate_rate_to_secondary(element).steady_gain)


def _drive_by_damping(element: SensitiveElement) -> complex:
    return 2j * element.primary_amplitude * element.omega * element.k2


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
