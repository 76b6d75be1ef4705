"""A value over a lot: devices x_d ~ N(μ, τ²), each known from its records as m_d ± s_d, and who is far from the others.

    m_d ~ N(μ, τ² + s_d²):  μ = Σ w_d m_d / Σ w_d,  w_d = 1/(τ² + s_d²)
    −2 ln L(τ) = Σ ln(τ² + s_d²) + ln Σ w_d + Σ w_d (m_d − μ)²

the restricted likelihood (Patterson & Thompson 1971, Biometrika 58, 545), with the prior 1/(τ + s̄): where the s_d are small, what the
others predict of a device is Student's t of n − 1 degrees of freedom (Jeffreys). In general it is the mean over τ of
N(μ, τ² + s_d² + 1/Σw), and likewise for the mean of a batch. A chance counts as many times as there were devices, or batches, and values
to look at.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy

from compensation.arrays import Array
from studies.fleet.device import Measured

# Scatters that are tried, in parts of the range of the values: three may stand close by chance.
GRID = np.geomspace(1e-3, 1e3, 100)
CHANCE = 0.01  # chance, with all looks counted, below which a device or a batch is odd
FEWEST = 4  # devices from which on values tell who is odd
CLEAR = 2.0  # scatter of the others, beyond which a batch is more than another batch


@dataclass(frozen=True)
class Population:
    """Mean with its standard deviation, and scatter, of a value over devices; with how likely each scatter is."""

    mean: float
    mean_sd: float
    scatter: float
    scatters: Array
    weights: Array
    means: Array
    known: Array

    @classmethod
    def of(cls, value: Array, sd: Array) -> "Population":
        """Fit a population."""
        most = float(np.ptp(value)) + float(sd.max())
        scatters = most * GRID
        total = scatters[:, None] ** 2 + sd**2
        known = (1.0 / total).sum(axis=1)
        means = (value / total).sum(axis=1) / known
        deviance = np.log(total).sum(axis=1) + np.log(known) + ((value - means[:, None]) ** 2 / total).sum(axis=1)
        weights = np.exp(-0.5 * (deviance - deviance.min())) * scatters / (scatters + float(np.median(sd)))
        weights /= weights.sum()
        k = int(np.argmin(deviance))
        scatter = float(scatters[k]) if k else 0.0
        return cls(float(means[k]), float(known[k] ** -0.5), scatter, scatters, weights, means, known)

    def surprise(self, value: Array, sd: Array) -> float:
        """Return the chance of another device, or of several with a mean, as far away."""
        weight = 1.0 / (self.scatters[:, None] ** 2 + sd**2)
        own = (value * weight).sum(axis=1) / weight.sum(axis=1)
        far = np.abs(own - self.means) / np.sqrt(1.0 / weight.sum(axis=1) + 1.0 / self.known)
        return float(self.weights @ (2.0 * scipy.special.ndtr(-far)))


@dataclass(frozen=True)
class Quantity:
    """One value over the lot."""

    name: str  # with its unit
    of: Mapping[str, Measured]  # serial -> Measured
    looks: int  # devices times values that were looked at
    batches: Mapping[str, str] = field(default_factory=dict)  # serial -> batch

    def among(self, serials: Iterable[str]) -> Population:
        """Return the population of some devices."""
        return Population.of(*self._arrays(serials))

    def _arrays(self, serials: Iterable[str]) -> tuple[Array, Array]:
        own = [self.of[serial] for serial in serials]
        return np.array([one.value for one in own]), np.array([one.sd for one in own])

    @cached_property
    def bad_batches(self) -> dict[str, float]:
        """Batches that are far from the rest, with the counted chance: the farthest first, each against what then remains."""
        found: dict[str, float] = {}
        while True:
            rest = [s for s in self.of if self.batches.get(s, "") not in found]
            named = sorted({self.batches.get(s, "") for s in rest} - {""})
            chances = {name: self._batch_chance(name, rest) for name in named}
            worst = min(named, key=lambda name: chances[name], default=None)
            if worst is None or chances[worst] >= CHANCE:
                return found
            found[worst] = chances[worst]

    def _batch_chance(self, name: str, among: list[str]) -> float:
        """Counted chance of a batch; of all but its farthest device too, for one device makes no batch."""
        inside = [s for s in among if self.batches.get(s) == name]
        rest = [s for s in among if self.batches.get(s) != name]
        if len(inside) < 3 or len(rest) < max(3, len(inside)):
            return 1.0
        others = self.among(rest)
        far = max(inside, key=lambda s: abs(self.of[s].value - others.mean))
        chances = []
        for own in (inside, [s for s in inside if s != far]):
            value, sd = self._arrays(own)
            apart = abs(self.among(own).mean - others.mean)
            chances.append(others.surprise(value, sd) if apart > CLEAR * others.scatter else 1.0)
        return min(1.0, max(chances) * self.looks * len(set(self.batches.values())) / len(self.of))

    @property
    def odd(self) -> dict[str, float]:
        """Devices that are far from the others, with the counted chance: the farthest first, each against what then remains."""
        return self._judged[0]

    @property
    def farthest(self) -> tuple[float, str]:
        """The counted chance of the device that is the farthest of those that are not odd, 1 where none can be judged."""
        return min(((chance, s) for s, chance in self._judged[1].items()), default=(1.0, ""))

    @cached_property
    def _judged(self) -> tuple[dict[str, float], dict[str, float]]:
        found: dict[str, float] = {}
        chances: dict[str, float] = {}
        while len(rest := self._usual(found)) >= FEWEST:
            chances = {
                s: self.among([o for o in rest if o != s]).surprise(*self._arrays([s])) * self.looks for s in rest
            }
            worst = min(rest, key=lambda s: chances[s])
            if chances[worst] >= CHANCE:
                break
            found[worst] = chances.pop(worst)
        return found, chances

    def _usual(self, odd: Mapping[str, float]) -> list[str]:
        return [s for s in self.of if s not in odd and self.batches.get(s, "") not in self.bad_batches]

    @cached_property
    def population(self) -> Population:
        """The devices that are like each other."""
        return self.among(self._usual(self.odd))

    def with_lot(self, serial: str) -> Measured:
        """Return the value of a device with the others as its prior; an odd one stands alone."""
        own = self.of[serial]
        others = [s for s in self._usual(self.odd) if s != serial]
        if serial in self.odd or self.batches.get(serial, "") in self.bad_batches or not others:
            return own
        lot = self.among(others)
        w, v = own.sd**-2, 1.0 / float(lot.weights @ (lot.scatters**2 + 1.0 / lot.known))
        return Measured((w * own.value + v * lot.mean) / (w + v), float((w + v) ** -0.5))
