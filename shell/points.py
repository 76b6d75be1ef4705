"""The middle surface of a resonator: samples of it, and points at heights over them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from shell.quadrature import Array


@dataclass(frozen=True)
class MiddleSurface:
    """Places of the middle surface, m and 1/m: `position` 0 ... 1 (rim), `normal_r / r` the second curvature, slope dh/ds."""

    position: Array
    r: Array
    z: Array
    tangent_r: Array
    tangent_z: Array
    curvature: Array
    thickness: Array
    thickness_slope: Array

    @property
    def normal_r(self) -> Array:
        """Radial component of the unit normal."""
        return -self.tangent_z

    @property
    def normal_z(self) -> Array:
        """Axial component of the unit normal."""
        return self.tangent_r


@dataclass(frozen=True)
class MeridianPoints(MiddleSurface):
    """Samples of it along the meridian, m."""

    arc_length: Array

    def along_face(self, eta: float) -> tuple[Array, Array]:
        """Change of r and z at a height η per arc length of the middle surface, (1 + κ ζ) t + η h'/2 n."""
        stretch, rise = 1 + self.curvature * eta * self.thickness / 2, eta * self.thickness_slope / 2
        return stretch * self.tangent_r + rise * self.normal_r, stretch * self.tangent_z + rise * self.normal_z

    def at_heights(self, eta: ArrayLike) -> tuple[Array, Array]:
        """R and z at heights η, (points, heights)."""
        zeta = np.multiply.outer(self.thickness / 2, np.asarray(eta))
        return self.r[:, None] + zeta * self.normal_r[:, None], self.z[:, None] + zeta * self.normal_z[:, None]
