r"""ln f of modes at values of a card, and its derivatives.

With E, ν, ρ of the material the derivatives are the mode's own energies, ∂ln f = ½ ∂ln E + S_ν ∂ν − ½ ∂ln ρ, exact and without
another solve; by each dimension it is a central difference of two solves.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from compensation.arrays import Array
from shell.modes import Mode, TheoryRangeWarning, solve_modes
from studies.calibration.priors import Priors
from studies.instrument.card import Instrument

STEP = 0.1  # prior standard deviations, of differences by a dimension


@dataclass(frozen=True, order=True)
class Which:
    """A mode: harmonic n, index among those of n, temperature (K)."""

    harmonic: int
    index: int
    temperature: float


@dataclass(frozen=True, eq=False)
class ModeModel:
    """Predictions of modes of one card."""

    # instrument, priors: the card, and what is uncertain of it.
    instrument: Instrument
    priors: Priors
    tolerance: float  # relative error that a solve may have
    _solved: dict[tuple[float, ...], tuple[Mode, ...]] = field(default_factory=dict)

    def predict(self, modes: Sequence[Which], u: Array) -> tuple[Array, Array]:
        """Return ln f of modes at a point, and the solver's relative errors."""
        found = [self._mode(one, u) for one in modes]
        return np.log([m.frequency for m in found]), np.array([m.relative_error_estimate for m in found])

    def derivatives(self, modes: Sequence[Which], u: Array) -> Array:
        """Return ∂ln f/∂u, (modes, coordinates)."""
        values, names = self.priors.at(u), self.priors.names
        J = np.zeros((len(modes), len(names)))
        for k, value in enumerate(self.priors.values):
            middle, step = values[value.name], STEP * value.sd
            low, high = max(middle - step, value.low), min(middle + step, value.high)
            below, above = ({**values, value.name: end} for end in (low, high))
            if value.name.startswith("material."):
                change = self._by_material(modes, u, below, above)
            else:
                change = np.log([self._at(m, above).frequency / self._at(m, below).frequency for m in modes])
            J[:, k] = change / (high - low)
        return np.asarray(J @ self.priors.slopes(u))

    def ladder(self, u: Array, highest: float, most: int, temperature: float) -> list[Which]:
        """Return all modes up to a frequency (Hz), at most so many harmonics beyond n = 2 and four of each."""
        found = []
        for n in range(most + 1):
            below = [one for one in self._lowest(n, temperature, self.priors.at(u), 4) if one.frequency <= highest]
            found += [Which(n, m.index, temperature) for m in below]
            if n > 2 and not below:
                break
        return found

    def _by_material(self, modes: Sequence[Which], u: Array, below: dict[str, float], above: dict[str, float]) -> Array:
        one, other = self.instrument.with_values(below), self.instrument.with_values(above)
        change = []
        for mode in modes:
            (body, a), (grown, b) = one.at(mode.temperature), other.at(mode.temperature)
            s = self._mode(mode, u).sensitivities
            size = np.log(grown.size / body.size)
            change.append(np.log(b.E / a.E) / 2 + s.nu * (b.nu - a.nu) - np.log(b.rho / a.rho) / 2 - size)
        return np.array(change)

    def _mode(self, which: Which, u: Array) -> Mode:
        return self._at(which, self.priors.at(u))

    def _at(self, which: Which, values: dict[str, float]) -> Mode:
        return self._lowest(which.harmonic, which.temperature, values, which.index + 1)[which.index]

    def _lowest(self, n: int, temperature: float, values: dict[str, float], count: int) -> tuple[Mode, ...]:
        key = (n, temperature, *values.values())
        if len(self._solved.get(key, ())) < count:
            body, elastic = self.instrument.with_values(values).at(temperature)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", TheoryRangeWarning)  # the error that is left counts as noise
                self._solved[key] = solve_modes(body, elastic, n, count, tolerance=self.tolerance)
        return self._solved[key]


@dataclass(frozen=True, eq=False)
class ModeFit:
    """The most probable point for one assignment; `residual` is measured minus predicted ln f, `noise` its deviation."""

    modes: tuple[Which, ...]
    point: Array
    covariance: Array
    residual: Array
    noise: Array
    cost: float
    converged: bool
