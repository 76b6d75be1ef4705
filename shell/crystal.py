r"""Crystals for an isotropic solver: the mean over all directions, and its bounds.

Equal strain in all directions gives Voigt's moduli from the stiffness C, equal stress Reuss's from the compliance S = C⁻¹:

    9 K_V = Σ_{i,j≤3} C_ij,     15 G_V = Σ_{i≤3} C_ii - (C₁₂ + C₁₃ + C₂₃) + 3 (C₄₄ + C₅₅ + C₆₆),
    1/K_R = Σ_{i,j≤3} S_ij,     15/G_R = 4 Σ_{i≤3} S_ii - 4 (S₁₂ + S₁₃ + S₂₃) + 3 (S₄₄ + S₅₅ + S₆₆).

Every mean over directions lies between them; Hill's (Proc. Phys. Soc. A 65 (1952) 349) is half their sum. The constants go
with temperature as C (1 + s x + q x²), and the means follow them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from shell.property import STEP, Property
from shell.quadrature import Array

SYSTEMS = {"cubic": ("C11", "C12", "C44"), "trigonal": ("C11", "C12", "C13", "C14", "C33", "C44")}
AXES = {"cubic": ("[001]", "[111]"), "trigonal": ("c",)}
"""Directions of the crystal that may lie along the axis of the resonator."""


@dataclass(frozen=True)
class Crystal:
    """Elastic constants of a crystal over temperature."""

    system: str  # system, axis: of `SYSTEMS`, and what lies along the resonator's axis
    axis: str
    at: float  # °C, where the constants hold
    constants: Mapping[str, float]  # Pa, by name
    # slope, curvature: s (1/K) and q (1/K²) of each; empty where no source states them
    slope: Mapping[str, float] = field(default_factory=dict)
    curvature: Mapping[str, float] = field(default_factory=dict)
    # uncertainty, slope_uncertainty: standard uncertainties of constants and slopes
    uncertainty: Mapping[str, float] = field(default_factory=dict)
    slope_uncertainty: Mapping[str, float] = field(default_factory=dict)

    def stiffness(self, x: float = 0.0) -> Array:
        """C, (6, 6) in Pa, x kelvin above `at`."""
        c = {
            name: value * (1 + self.slope.get(name, 0.0) * x + self.curvature.get(name, 0.0) * x**2)
            for name, value in self.constants.items()
        }
        C, C11, C12, C44 = np.zeros((6, 6)), c["C11"], c["C12"], c["C44"]
        C13, C33, C14 = c.get("C13", C12), c.get("C33", C11), c.get("C14", 0.0)
        C66 = C44 if self.system == "cubic" else (C11 - C12) / 2
        C[:3, :3] = [[C11, C12, C13], [C12, C11, C13], [C13, C13, C33]]
        C[3:, 3:] = np.diag([C44, C44, C66])
        C[0, 3] = C[3, 0] = C[4, 5] = C[5, 4] = C14
        C[1, 3] = C[3, 1] = -C14
        return C

    @property
    def spread(self) -> float:
        """Half the distance of Voigt's from Reuss's Young's modulus, over their mean; 0 in an isotropic body."""
        voigt, reuss = (engineering(*pair)[0] for pair in bounds_of(self.stiffness()))
        return (voigt - reuss) / (voigt + reuss)

    @property
    def note(self) -> str:
        """What an isotropic solver makes of it."""
        mean = f"a crystal, solved as the mean of all directions (Voigt-Reuss-Hill, E within ±{100 * self.spread:.2g} %)"  # fmt: skip
        if self.axis == "[001]":
            return f"{mean}. Along [001] its pair n = 2 splits: only hrg modes computes that, for shells without stem or clamp."
        return f"{mean}. Along its threefold axis the pair n = 2 does not split; the split of n = 3 is not modelled."

    def properties(self) -> dict[str, Property]:
        """Hill's E and ν over temperature, uncertain by the bounds and by the constants."""
        middle = self._course(self)
        off = [(self._course(self, 0) - self._course(self, 1)) / 2]  # Voigt's from Reuss's
        moved = [replace(self, constants=_moved(self.constants, one, sd)) for one, sd in self.uncertainty.items()]
        moved += [replace(self, slope=_moved(self.slope, one, sd)) for one, sd in self.slope_uncertainty.items()]
        off += [self._course(crystal) - middle for crystal in moved]
        sd = np.linalg.norm(off, axis=0)
        source = f"Voigt-Reuss-Hill mean of the {self.system} crystal's constants"
        found = {}
        for k, (name, relative) in enumerate((("youngs_modulus", True), ("poisson_ratio", False))):
            value, slope, curvature = middle[k]
            value, by = (float(np.exp(value)), 1.0) if relative else (float(value), float(value))
            a, b, c = map(float, sd[k] if self.slope else [sd[k][0], 0.0, 0.0])
            form, numbers = self._form(value, slope / by, curvature / by + (slope**2 if relative else 0.0))
            found[name] = Property(form, numbers, {}, source, relative, (a, b, c))
        return found

    def _form(self, value: float, slope: float, curvature: float) -> tuple[str, dict[str, float]]:
        """The form whose relative slope and second derivative these are."""
        if not self.slope:
            return "constant", {"value": value}
        if not self.curvature:
            return "linear", {"value": value, "at_degC": self.at, "slope": float(slope)}
        top = -slope / curvature
        return "parabola", {
            "value": value,
            "at_degC": self.at,
            "rise": float(slope * top / 2),
            "maximum_degC": float(self.at + top),
        }

    @staticmethod
    def _course(crystal: "Crystal", bound: int | None = None) -> Array:
        """Value, slope and second derivative of ln E and of ν, (2, 3), of Hill's mean or of one of the bounds."""
        at = []
        for x in (-STEP, 0.0, STEP):
            C = crystal.stiffness(x)
            E, nu = hill(C) if bound is None else engineering(*bounds_of(C)[bound])
            at.append([np.log(E), nu])
        low, middle, high = np.array(at)
        return np.stack([middle, (high - low) / (2 * STEP), (low + high - 2 * middle) / STEP**2], axis=1)


def _moved(numbers: Mapping[str, float], name: str, by: float) -> Mapping[str, float]:
    return {**numbers, name: numbers[name] + by}


def bounds_of(C: Array) -> tuple[tuple[float, float], tuple[float, float]]:
    """Bulk and shear modulus after Voigt and after Reuss."""
    S = np.asarray(np.linalg.inv(C), dtype=float)

    def sums(M: Array) -> tuple[float, float, float]:
        return float(np.trace(M[:3, :3])), float(M[0, 1] + M[0, 2] + M[1, 2]), float(np.trace(M[3:, 3:]))

    (c, c_mixed, c_shear), (s, s_mixed, s_shear) = sums(C), sums(S)
    voigt = (c + 2 * c_mixed) / 9, (c - c_mixed + 3 * c_shear) / 15
    reuss = 1 / (s + 2 * s_mixed), 15 / (4 * s - 4 * s_mixed + 3 * s_shear)
    return voigt, reuss


def engineering(K: float, G: float) -> tuple[float, float]:
    """E and ν from bulk and shear modulus."""
    return 9 * K * G / (3 * K + G), (3 * K - 2 * G) / (6 * K + 2 * G)


def hill(C: Array) -> tuple[float, float]:
    """E and ν of the Voigt-Reuss-Hill mean."""
    (K_V, G_V), (K_R, G_R) = bounds_of(C)
    return engineering((K_V + K_R) / 2, (G_V + G_R) / 2)
