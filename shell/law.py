"""The frequency law: f of one mode over temperature, with its parts, its derivatives, its error and its places.

A free resonator of one material expands evenly, so by dimensions, for every theory,

    f(T) = √(E(T)/ρ(T)) Φ(ν(T)) / g(T),      g = exp ∫ α dT the growth of lengths since the reference temperature,

and only Φ, a smooth function of one number, needs the solver. Thermal mismatch with the base (shell.material) adds s ε(T) to ln f,
s by the mode in its stress (shell.prestress). The slope has five parts (HRG paper eq. 15), and s ε' by the base,

    d ln f/dT = ½ E'/E + (∂ ln f/∂ν) ν' − ½ ρ'/ρ + (∂ ln f/∂ ln h) h'/h + (∂ ln f/∂ ln r) r'/r,

with ∂ ln f/∂ ln h + ∂ ln f/∂ ln r = −1 and h'/h = r'/r = α. For a temperature that varies along the meridian, to first
order in its unevenness, δ ln f = Σ sensitivity (T(s) − T_mean) over the stations, the stress of uneven expansion included.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from shell.constants import zero_Celsius
from shell.elastic import Elastic
from shell.errors import ShellError
from shell.layout import Theory
from shell.material import Material, Mount
from shell.modes import Mode, solve_modes
from shell.prestress import Prestress, check_mount
from shell.property import coefficient_names, powers
from shell.quadrature import Array
from shell.resonator import Resonator
from shell.shape_factor import ShapeFactor, interpolate_shape, ratios_to_cover, shape_of
from shell.solution import AlongMeridian

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

SPACING = 1.0  # K, of the knots of ln f(T)
ACTING = ("shear_modulus", "youngs_modulus", "poisson_ratio", "density", "expansion")


@dataclass(frozen=True, eq=False)
class SlopeParts:
    """What each quantity's own change with temperature contributes to d ln f/dT: arrays like the temperatures, 1/K."""

    E: Array
    nu: Array
    rho: Array
    h: Array
    r: Array
    base: Array

    @property
    def total(self) -> Array:
        """The slope d ln f/dT, 1/K."""
        return np.asarray(self.E + self.nu + self.rho + self.h + self.r + self.base)


def slope_parts(
    material: Material, temperature: ArrayLike, by_nu: Array, by_thickness: Array, base: ArrayLike = 0.0
) -> SlopeParts:
    """The parts of d ln f/dT (HRG paper eq. 15, and the base's) at temperatures (K)."""
    alpha = material.value("expansion", temperature)
    return SlopeParts(
        E=0.5 * material.log_slope("youngs_modulus", temperature),
        nu=np.asarray(by_nu * material.slope("poisson_ratio", temperature)),
        rho=-0.5 * material.log_slope("density", temperature),
        h=np.asarray(by_thickness * alpha),
        r=np.asarray((-1 - by_thickness) * alpha),
        base=np.broadcast_to(np.asarray(base, dtype=float), alpha.shape),
    )


@dataclass(frozen=True, eq=False)
class FrequencyLaw:
    """Frequency of the lowest mode of one harmonic over temperature."""

    material: Material  # its laws give E, ν, ρ and the growth of lengths
    reference_temperature: float  # K, dimensions hold here
    # lowest, highest: K, where the law holds.
    lowest: float
    highest: float
    # theory, harmonic: of the shell solver; n.
    theory: Theory
    harmonic: int
    shape: ShapeFactor
    mode: Mode  # the mode at the reference temperature: Bryan factor, energies, shape
    prestress: Prestress  # what expansion does to it through stress
    mount: Mount | None = None  # a base with another expansion than the resonator

    def frequency(self, temperature: ArrayLike, *, extrapolate: bool = False) -> Array:
        """Frequency (Hz) at even temperatures of the resonator (K), or to `extrapolate` a little beyond the range, as fits try."""
        return np.asarray(np.exp(self.logarithm(temperature, extrapolate=extrapolate)))

    def inside(self, temperature: ArrayLike) -> Array:
        """Return temperatures (K) with those beyond the law's range at its ends."""
        return np.asarray(np.clip(temperature, self.lowest, self.highest))

    def logarithm(self, temperature: ArrayLike, *, extrapolate: bool = False) -> Array:
        """Return ln f, f in Hz; arguments as in `frequency`."""
        T = np.asarray(temperature, dtype=float)
        return np.asarray(self._spline(T if extrapolate else self._check(T)))

    def slope(self, temperature: ArrayLike) -> Array:
        """Return d ln f/dT, 1/K."""
        return np.asarray(self._spline(self._check(temperature), 1))

    def parts(self, temperature: ArrayLike) -> SlopeParts:
        """The five parts of d ln f/dT (HRG paper eq. 15), and that of the base."""
        T = self._check(temperature)
        nu = self.material.value("poisson_ratio", T)
        base = 0.0 if self.mount is None else self.prestress.by_base * self.mount.strain_slope(self.material, T)
        return slope_parts(self.material, T, self.shape.by_nu(nu), self.shape.by_thickness(nu), base)

    def derivatives(self, temperature: ArrayLike) -> dict[str, Array]:
        """Derivative of ln f(T) by every coefficient of the material's deviation that acts on it, by its name."""
        return self._derivatives(self._check(temperature))

    def uncertainty(self, temperature: ArrayLike) -> Array:
        """Standard deviation of ln f(T) by the material's prior."""
        return self._spread(self.derivatives(temperature))

    def slope_derivatives(self, temperature: ArrayLike) -> dict[str, Array]:
        """Return the derivative of d ln f/dT by every coefficient, as `derivatives` does for ln f."""
        step = 0.05
        T = np.clip(self._check(temperature), self.material.lowest + step, self.material.highest - step)
        ahead, behind = self._derivatives(T + step), self._derivatives(T - step)
        return {name: (ahead[name] - behind[name]) / (2 * step) for name in ahead}

    def slope_uncertainty(self, temperature: ArrayLike) -> Array:
        """Standard deviation of d ln f/dT by the material's prior, 1/K."""
        return self._spread(self.slope_derivatives(temperature))

    @property
    def error(self) -> float:
        """Relative error of f against the exact solution of the theory for this material: solver and interpolation."""
        return self.solver_error + self.interpolation_error

    @property
    def solver_error(self) -> float:
        """Relative error of the solves against the exact solution of their theory."""
        return self.shape.solver_error

    @cached_property
    def interpolation_error(self) -> float:
        """Relative error of f against the solver: between the Poisson's ratios and between the knots."""
        T = np.linspace(self.lowest, self.highest, 1 + 3 * len(self._knots))
        return self.shape.error + float(np.abs(self._spline(T) - self._exact(T)).max())

    @property
    def bryan_factor(self) -> float:
        """Precession of the standing wave per angle of rotation, at the reference temperature."""
        return self.mode.bryan_factor

    @property
    def along(self) -> AlongMeridian:
        """What each station of the meridian contributes to d ln f by E, ρ and ν, at the reference temperature."""
        return self.mode.along

    def sensitivity(self, temperature: float | None = None) -> Array:
        """What each station of the meridian contributes to d ln f/dT (1/K), stress and base included; they add up to the slope."""
        T = self.reference_temperature if temperature is None else temperature
        kinetic, nu, growth, base = self.uneven_slopes(T)
        return np.asarray(
            0.5 * self.along.elastic * self.material.log_slope("youngs_modulus", T)
            + kinetic * self.along.kinetic
            + nu * self.along.nu
            + growth * self.prestress.shares
            + base * self.prestress.held
        )

    def uneven_slopes(self, temperature: float) -> Array:
        """What multiplies temperatures weighed with the shares of kinetic energy, −½ (ρ'/ρ + 3 α), ν, ν', expansion, α, and base, 1/K."""
        alpha = float(self.material.value("expansion", temperature))
        density = float(self.material.log_slope("density", temperature))
        base = self.prestress.by_base * (self.mount.expansion if self.mount else alpha)
        return np.array(
            [-0.5 * (density + 3 * alpha), float(self.material.slope("poisson_ratio", temperature)), alpha, base]
        )

    @cached_property
    def uneven(self) -> Array:
        """The same at the reference temperature."""
        return self.uneven_slopes(self.reference_temperature)

    def between(self, lowest: float, highest: float) -> "FrequencyLaw":
        """Return the law between two temperatures (K), as far as it goes."""
        return replace(self, lowest=max(lowest, self.lowest), highest=min(highest, self.highest))

    def with_material(self, material: Material) -> "FrequencyLaw":
        """Return the law of the same resonator with another material; nothing is solved again."""
        nu = material.value("poisson_ratio", np.linspace(self.lowest, self.highest, 41))
        low, high = self.shape.lowest, self.shape.highest
        if not (nu.min() >= low - 1e-9 and nu.max() <= high + 1e-9):
            raise ShellError(
                f"Poisson's ratio {nu.min():.4f} to {nu.max():.4f} leaves the range {low:.4f} to {high:.4f} for which this frequency law was solved: build the law anew with this material."
            )
        return replace(self, material=material)

    def _check(self, temperature: ArrayLike) -> Array:
        T = np.asarray(temperature, dtype=float)
        if T.size and not (T.min() >= self.lowest - 1e-6 and T.max() <= self.highest + 1e-6):
            self.material.check(T)
            raise ShellError(
                f"the resonator reaches {T.min() - zero_Celsius:.2f} to {T.max() - zero_Celsius:.2f} °C, but its frequency"
                f" is known from {self.lowest - zero_Celsius:.2f} to {self.highest - zero_Celsius:.2f} °C only."
            )
        return self.inside(T)

    def _exact(self, T: Array) -> Array:
        """Ln f at temperatures, the material evaluated at each."""
        E, nu, rho = (self.material.value(name, T) for name in ("youngs_modulus", "poisson_ratio", "density"))
        growth = self.material.growth(T, self.reference_temperature)
        base = 0.0 if self.mount is None else self.prestress.by_base * self.mount.strain(self.material, T)
        return np.asarray(0.5 * np.log(E / rho) + self.shape.logarithm(nu) - np.log(growth) + base)

    @cached_property
    def _knots(self) -> Array:
        low = max(self.lowest - SPACING, self.material.lowest)
        high = min(self.highest + SPACING, self.material.highest)
        return np.linspace(low, high, 9 + int((high - low) / SPACING))

    @cached_property
    def _spline(self) -> "CubicSpline":
        from scipy.interpolate import CubicSpline

        return CubicSpline(self._knots, self._exact(self._knots))

    def _derivatives(self, T: Array) -> dict[str, Array]:
        found: dict[str, Array] = {}
        weights, about = self._elastic_weights(T), self.material.reference
        for name in (name for name in ACTING if name in self.material.properties):
            if name == "expansion":  # ln f holds −∫ α from the reference, and 3/2 ∫ α from where the density is stated
                at_density = self.material.properties["density"].numbers["at_degC"] + zero_Celsius
                # the integrals of 1, x and ½ x² from the reference of the deviation
                x = (T - about, np.asarray(at_density - about), np.asarray(self.reference_temperature - about))
                since = ((one, one**2 / 2, one**3 / 6) for one in x)
                moved = [t / 2 - 1.5 * d + r for t, d, r in zip(*since, strict=True)]
                if self.mount is not None:
                    by_base = self.mount.by_expansion(self.material, T)
                    moved = [one + self.prestress.by_base * e for one, e in zip(moved, by_base, strict=True)]
            else:
                moved = [weights[name] * power for power in powers(T - about)]
            found |= {f"{name}.{c}": value for c, value in zip(coefficient_names(name), moved, strict=True)}
        return found

    def _elastic_weights(self, T: Array) -> dict[str, Array]:
        """∂ ln f by the logarithm of each modulus that the law states, by ν itself, and by ln ρ, at constant others."""
        nu = self.material.value("poisson_ratio", T)
        by_nu, half = self.shape.by_nu(nu), np.full_like(T, 0.5)
        stated = self.material.properties
        if "shear_modulus" not in stated:
            found = {"youngs_modulus": half, "poisson_ratio": by_nu}
        elif "youngs_modulus" not in stated:  # ln E = ln G + ln 2 (1 + ν)
            found = {"shear_modulus": half, "poisson_ratio": by_nu + 0.5 / (1 + nu)}
        else:  # ν = E/2G − 1
            found = {"youngs_modulus": half + by_nu * (1 + nu), "shear_modulus": -by_nu * (1 + nu)}
        return {**found, "density": -half}

    def _spread(self, derivatives: Mapping[str, Array]) -> Array:
        prior = self.material.prior
        acting = [k for k, name in enumerate(prior.names) if name in derivatives]
        if not acting:
            return np.zeros_like(next(iter(derivatives.values())))
        J = np.stack([derivatives[prior.names[k]] for k in acting])
        return np.asarray(np.sqrt(np.einsum("i...,ij,j...->...", J, prior.covariance[np.ix_(acting, acting)], J)))


def build_law(
    resonator: Resonator, material: Material, reference_temperature: float, lowest: float, highest: float,
    theory: Theory = "solid", harmonic: int = 2, mount: Mount | None = None,
) -> FrequencyLaw:  # fmt: skip
    """Solve the mode at a few Poisson's ratios and build its frequency law over the wanted range (K), within the material's.

    A range of one temperature takes a single solve. The mount's expansion is for the solid theory and n >= 1.
    """
    if mount is not None:
        check_mount(resonator, theory, harmonic)
    lowest, highest = max(lowest, material.lowest), min(highest, material.highest)
    material.check([lowest, highest])

    def solve(elastic: Elastic) -> Mode:
        return solve_modes(resonator, elastic, harmonic, theory=theory)[0]

    elastic = material.elastic(lowest if lowest == highest else reference_temperature)
    mode = solve(elastic)
    low, high = ratios_to_cover(material, np.linspace(lowest, highest, 41), elastic.nu)
    if lowest == highest or high - low < 1e-9:
        shape = shape_of(mode, resonator, elastic)
    else:
        shape = interpolate_shape(mode, resonator, elastic, low, high, solve)
    return FrequencyLaw(
        material, reference_temperature, lowest, highest, theory, harmonic, shape, mode, Prestress(mode), mount
    )


def mode_uncertainty(mode: Mode, material: Material, reference_temperature: float, temperature: float) -> float:
    """Return the standard deviation of ln f of a mode solved at a temperature (K), by the material's prior."""
    shape = shape_of(mode, mode.resonator, material.elastic(temperature))
    at = (reference_temperature, temperature, temperature)
    law = FrequencyLaw(material, *at, mode.theory, mode.harmonic, shape, mode, Prestress(mode))
    return float(law.uncertainty(temperature))
