"""Isotropic elastic constants at one temperature: what the mechanics needs to know of a material."""

from dataclasses import dataclass

from shell.errors import ShellError


@dataclass(frozen=True)
class Elastic:
    """Young's modulus E (Pa), Poisson ratio nu (1) and density rho (kg/m³) at one temperature."""

    E: float
    nu: float
    rho: float

    def __post_init__(self) -> None:
        if not self.E > 0:
            raise ShellError(f"Young's modulus must be positive, not {self.E:g} Pa.")
        if not -1 < self.nu < 0.5:
            raise ShellError(f"Poisson's ratio must lie between -1 and 0.5 (exclusive), not {self.nu:g}.")
        if not self.rho > 0:
            raise ShellError(f"density must be positive, not {self.rho:g} kg/m³.")

    @property
    def G(self) -> float:
        """Shear modulus G = E / (2 (1 + nu)), in Pa."""
        return self.E / (2 * (1 + self.nu))
