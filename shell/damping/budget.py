"""The loss budget of a mode: 1/Q over temperature as a sum of parts, each with source and interval."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from shell.damping.anelastic import activated_loss
from shell.damping.faces import Vibration
from shell.damping.film import Film, check_film, film_internal_loss, film_thermoelastic_loss
from shell.damping.gas import Gas, gas_loss, mean_free_path
from shell.damping.heat import Heat
from shell.damping.thermoelastic import heat_flow
from shell.errors import ShellError
from shell.quadrature import Array

NORMAL_90 = 1.6448536269514722  # a 90 % interval is ± this many standard deviations
STEP = 0.5  # K, for slopes over temperature
FREE = 10.0  # free path over the radius beyond which molecules count as free


HeatLaw = Callable[[float], Heat]


@dataclass(frozen=True)
class LossCause:
    """One cause of loss: its name, 1/Q at temperatures (K), relative standard uncertainty, source, and `advice` how to lower it."""

    name: str
    inverse_q: Callable[[Vibration, Array], Array]
    relative_sd: float
    source: str
    advice: str = ""


@dataclass(frozen=True, eq=False)
class LossPart:
    """One part of a budget over its temperatures: 1/Q and d ln(1/Q)/dT (1/K), with relative uncertainty and source."""

    name: str
    inverse_q: Array
    slope: Array
    relative_sd: float
    source: str
    advice: str = ""

    @property
    def interval(self) -> tuple[Array, Array]:
        """90 % interval of 1/Q, lognormal so that it stays positive."""
        return _interval(self.inverse_q, self.relative_sd)


@dataclass(frozen=True, eq=False)
class Budget:
    """1/Q of one mode over temperatures (K), and its parts, largest first."""

    temperatures: Array
    parts: tuple[LossPart, ...]

    @property
    def inverse_q(self) -> Array:
        """The sum of the parts."""
        return np.asarray(sum((part.inverse_q for part in self.parts), np.zeros(len(self.temperatures))))

    @property
    def sd(self) -> Array:
        """Standard uncertainty of the sum, the parts taken as independent."""
        squares = sum(((one.relative_sd * one.inverse_q) ** 2 for one in self.parts), np.zeros(len(self.temperatures)))
        return np.asarray(np.sqrt(squares))

    @property
    def interval(self) -> tuple[Array, Array]:
        """90 % interval of 1/Q."""
        return _interval(self.inverse_q, self.sd / self.inverse_q)

    @property
    def slope(self) -> Array:
        """D ln(1/Q)/dT, 1/K."""
        return np.asarray(sum(part.slope * part.inverse_q for part in self.parts) / self.inverse_q)

    @property
    def first(self) -> LossPart:
        """The part to attack first: the largest on the mean."""
        return self.parts[0]

    @property
    def least_known(self) -> LossPart:
        """The part whose uncertainty is largest."""
        return max(self.parts, key=lambda part: float(np.mean(part.inverse_q)) * part.relative_sd)

    def without(self, name: str) -> Array:
        """Q if one part were not there; infinite where it is all."""
        rest = self.inverse_q - next(part.inverse_q for part in self.parts if part.name == name)
        with np.errstate(divide="ignore"):
            return np.asarray(1 / rest)


def loss_budget(vibration: Vibration, causes: Sequence[LossCause], temperatures: ArrayLike) -> Budget:
    """Sum the causes over temperatures (K)."""
    T = vibration.material.check(np.atleast_1d(np.asarray(temperatures, dtype=float)))
    if not causes:
        raise ShellError("a loss budget needs at least one cause of loss.")
    low, high = (np.clip(T + step, vibration.material.lowest, vibration.material.highest) for step in (-STEP, STEP))
    everywhere = np.concatenate([T, low, high])
    parts = []
    for cause in causes:
        now, before, after = np.split(cause.inverse_q(vibration, everywhere), 3)
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = np.where(now > 0, (after - before) / (high - low) / now, 0.0)
        parts.append(LossPart(cause.name, now, slope, cause.relative_sd, cause.source, cause.advice))
    return Budget(T, tuple(sorted(parts, key=lambda part: -float(np.mean(part.inverse_q)))))


def thermoelastic_cause(
    vibration: Vibration, heat: HeatLaw, relative: tuple[float, float, float], source: str
) -> LossCause:
    """Heat through the wall; `relative` are the relative uncertainties of expansion, capacity and conductivity."""
    T = vibration.reference
    at = heat(T)
    x = np.sqrt(vibration.solution.eigenvalue) * at.capacity / at.conductivity
    nodes = x * np.exp(np.array([-0.05, 0.0, 0.05]))  # temperature moves x by a few per cent
    flows = np.log([heat_flow(vibration.solution, float(node)) for node in nodes])
    law = np.polynomial.Polynomial.fit(np.log(nodes / x), flows, 2)
    by_x = float(law.deriv()(0.0))
    sd = float(np.hypot(np.hypot(2 * relative[0], (by_x - 1) * relative[1]), by_x * relative[2]))

    def inverse_q(vibration: Vibration, temperatures: Array) -> Array:
        found = []
        for temperature, omega in zip(temperatures, vibration.omega(temperatures), strict=True):
            now = heat(float(temperature))
            flow = np.exp(law(np.log(omega * now.capacity / now.conductivity / x)))
            found.append(now.expansion**2 * temperature / now.capacity * flow / vibration.strain_energy)
        return np.array(found)

    advice = "a wall much thinner or much thicker than the thermal diffusion length, or a material with a lower expansion coefficient"
    return LossCause("thermoelastic", inverse_q, float(np.hypot(sd, 0.02)), source, advice)


def bulk_cause(coefficient: float, exponent: float, relative_sd: float, source: str) -> LossCause:
    """Loss of the material's volume, φ = c f^b, f in Hz (Penn et al., Phys. Lett. A 352 (2006) 3, gr-qc/0507097)."""

    def inverse_q(v: Vibration, T: Array) -> Array:
        return coefficient * (v.omega(T) / (2 * np.pi)) ** exponent

    return LossCause("bulk", inverse_q, relative_sd, source, "choose another glass or alloy; anneal it")


def surface_cause(depth: float, relative_sd: float, source: str) -> LossCause:
    """Loss of the damaged surface, of depth times loss (m): 1/Q = (d φ_s) ∫ σ : ε dA / ∫ σ : ε dV (S/V misses threefold in bending)."""

    def inverse_q(v: Vibration, T: Array) -> Array:
        return np.full(len(T), depth * sum(face.integrate(face.energy) for face in v.surfaces) / v.strain_energy)

    advice = "polish and etch the faces; subsurface grinding damage reaches deeper than the roughness"
    return LossCause("surface", inverse_q, relative_sd, source, advice)


def film_causes(
    name: str, film: Film, heat: HeatLaw | None, relative: tuple[float, float], source: str
) -> list[LossCause]:
    """A film's own loss, and the heat between it and the wall; `relative` uncertainties are of thickness and of the film's loss."""

    def internal(v: Vibration, T: Array) -> Array:
        check_film(film, v.thinnest)
        return np.full(len(T), film_internal_loss(film, v))

    advice = "a thinner film, no film where the mode bends, or a metal with less loss"
    found = [LossCause(f"{name} film", internal, float(np.hypot(*relative)), source, advice)]
    if film.heat is not None and heat is not None:

        def thermoelastic(v: Vibration, T: Array) -> Array:
            check_film(film, v.thinnest)
            return np.array([film_thermoelastic_loss(film, v, heat(float(t)), float(t)) for t in T])

        sd = float(np.hypot(relative[0], 0.2))  # films differ from the bulk whose constants they are given
        advice = "a thinner film, or a metal with less expansion"
        found.append(LossCause(f"{name} film, heat", thermoelastic, sd, source, advice))
    return found


def gas_cause(
    vibration: Vibration, gas: Gas, pressure: float, relative_sd: float, accommodation: float = 1.0
) -> LossCause:
    """Gas at a pressure (Pa) at the reference temperature, sealed in: p ∝ T; uncertain by a tenth where molecules fly far, else a half."""
    if not pressure >= 0:
        raise ShellError(f"the gas pressure must be 0 or positive, not {pressure:g} Pa.")
    flight = mean_free_path(gas, pressure, vibration.reference) if pressure > 0 else np.inf
    model_sd = 0.1 if flight > FREE * vibration.resonator.size else 0.5

    def inverse_q(v: Vibration, T: Array) -> Array:
        return np.array([gas_loss(v, gas, pressure * t / v.reference, float(t), accommodation) for t in T])

    source, sd = f"{gas.name} at {pressure:g} Pa, sealed", float(np.hypot(relative_sd, model_sd))
    return LossCause("gas", inverse_q, sd, source, "pump, bake and getter")


def activated_cause(height: float, energy: float, peak: float, relative_sd: float, source: str) -> LossCause:
    """A Debye peak of height 1/Q at T_p (K) with an activation energy (eV)."""
    if not height >= 0:
        raise ShellError(f"the height of an activated loss must be 0 or positive, not {height:g}.")
    advice = "another glass (OH, alkali), or a working temperature away from the peak"
    return LossCause("activated", lambda v, T: activated_loss(height, energy, peak, T), relative_sd, source, advice)


def constant_cause(name: str, inverse_q: float, relative_sd: float, source: str, advice: str = "") -> LossCause:
    """A loss that does not change with temperature."""
    if not inverse_q >= 0:
        raise ShellError(f"the loss '{name}' must be 0 or positive, not {inverse_q:g}.")
    return LossCause(name, lambda v, T: np.full(len(T), inverse_q), relative_sd, source, advice)


def _interval(value: Array, relative_sd: Array | float) -> tuple[Array, Array]:
    spread = np.exp(NORMAL_90 * np.sqrt(np.log1p(np.asarray(relative_sd) ** 2)))
    return np.asarray(value / spread), np.asarray(value * spread)
