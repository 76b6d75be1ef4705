"""Thermal mismatch with the base, which stresses the resonator."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shell.material import Material

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mount:
    """The body that the held face of the resonator is joined to, stiff beside it."""

    expansion: float  # 1/K, of the base
    joined_at: float  # K, the temperature at which the joint is free of stress

    def strain(self, material: Material, temperature: ArrayLike) -> Array:
        """Growth of the base beyond the resonator's own since they were joined: ε = ∫ (α_base - α) dT."""
        T = np.asarray(temperature, dtype=float)
        return np.asarray(self.expansion * (T - self.joined_at) - np.log(material.growth(T, self.joined_at)))

    def strain_slope(self, material: Material, temperature: ArrayLike) -> Array:
        """Dε/dT, 1/K."""
        return np.asarray(self.expansion - material.value("expansion", temperature))

    def by_expansion(self, material: Material, temperature: Array) -> list[Array]:
        """Derivatives of ε by the value, slope and curvature of the deviation of the resonator's expansion."""
        about = material.reference
        since = (temperature - about, np.asarray(self.joined_at - about))
        ends = [(x, x**2 / 2, x**3 / 6) for x in since]
        return [s - t for t, s in zip(*ends, strict=True)]
