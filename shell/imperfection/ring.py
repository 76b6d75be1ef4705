r"""The imperfect inextensional ring: the smallest body in which waves of the mass split a pair, solved with all harmonics.

With v = Σ V_k sin kθ around the ring and w = -v_θ outwards (no stretch), for radius R, section A and bending stiffness EI

    ω² = (E I/(ρ A R⁴)) λ,   K_kk = π k² (k² - 1)²,   M_kl = ∫ (1 + p(θ)) (v_k v_l + w_k w_l) dθ,

λ = n² (n² - 1)²/(n² + 1) without the imperfection p. To first order a wave p = ε cos 2nθ splits the pair by (n² - 1)/(2 (n² + 1)) ε.
"""

from collections.abc import Sequence
from math import pi, sqrt

import numpy as np
import scipy

from shell.errors import ShellError
from shell.imperfection.field import Field, values_around
from shell.imperfection.split import Split


def ring_frequency(n: int, radius: float, thickness: float, E: float, rho: float) -> float:
    """Frequency (Hz) of a perfect ring of rectangular section, thickness h in its plane: I/A = h²/12."""
    value = n**2 * (n**2 - 1) ** 2 / (n**2 + 1)
    return sqrt(E * thickness**2 / (12 * rho) * value) / (2 * pi * radius**2)


def split_ring(
    n: int,
    density: Field | None = None,
    masses: Sequence[tuple[float, float]] = (),
    frequency: float = 1.0,
    highest: int = 24,
) -> Split:
    """The split of the pair n >= 2, every order of the imperfection included.

    Parameters
    ----------
    n : harmonic.
    density : relative change of the mass per length.
    masses : (mass over the mass of the ring, azimuth in rad) of point masses.
    frequency : of the perfect ring, Hz.
    highest : harmonics 0 ... highest take part.
    """
    if not 2 <= n <= highest - 2:
        raise ShellError(f"a ring bends in harmonics from 2 up; {n} asks for highest >= {max(n, 2) + 2}.")
    k = np.repeat(np.arange(1, highest + 1), 2)
    turned = np.tile([False, True], highest)

    def shapes(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        c, s = np.cos(np.multiply.outer(theta, k)), np.sin(np.multiply.outer(theta, k))
        v, w = np.where(turned, -c, s), np.where(turned, -k * s, -k * c)
        return np.column_stack([np.ones(len(theta)), v]), np.column_stack([np.zeros(len(theta)), w])

    waves = density.orders if density is not None else ()
    count = 2 * highest + max(waves, default=0) + 1
    theta = 2 * pi * np.arange(count) / count
    weight = np.full(count, 2 * pi / count)
    if density is not None:
        weight = weight * (1 + values_around(density, waves, np.ones(1), theta)[0][0])
    if masses:
        weight = np.concatenate([weight, [2 * pi * share for share, _ in masses]])
        theta = np.concatenate([theta, [azimuth for _, azimuth in masses]])
    v, w = shapes(theta)
    M = v.T @ (weight[:, None] * v) + w.T @ (weight[:, None] * w)
    stiffness = np.concatenate([[0.0], pi * k**2 * (k**2 - 1.0) ** 2])
    values, vectors = scipy.linalg.eigh(np.diag(stiffness), M)
    first = 2 * n - 1  # three rigid motions, then the pairs 2, 3, ...
    slow, fast = np.sqrt(values[first : first + 2])
    perfect = n * (n**2 - 1) / sqrt(n**2 + 1)
    one, other = vectors[2 * n - 1 : 2 * n + 1, first + 1]  # how the faster mode divides between the two of the pair
    turn = np.exp(2j * np.arctan2(other, one)) if fast > slow else 1.0
    return Split(n, frequency, float((slow + fast) / (2 * perfect) - 1), complex((fast - slow) / perfect * turn))
