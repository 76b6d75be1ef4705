"""A value over a lot: devices x_d ~ N(μ, τ²), each known from its records as m_d ± s_d, and who is far from the others.

    m_d ~ N(μ, τ² + s_d²):  μ = Σ w_d m_d / Σ w_d,  w_d = 1/(τ² + s_d²)
    −2 ln L(τ) = Σ ln(τ² + s_d²) + ln Σ w_d + Σ w_d (m_d − μ)²

the restricted likelihood (Patterson & Thompson 1971, Biometrika 58, 545), with the prior 1/(τ + s̄): where the s_d are small, what the
others predict of a device is Student's t of n − 1 degrees of freedom (Jeffreys). In general it is the mean over τ of
N(μ, τ² + s_d² + 1/Σw), and likewise for the mean of a batch. A chance counts as many times as there were devices, or batches, and values
to look at. A trend with the date of the devices is a straight line, weighted by w_d.

Of a few devices that is too little: of five one has to be 20 scatters away. But a lot has many values, and ln τ of each, over what the
card leaves it, is like those of the others: N(m, v²), with m and v as likely as the other values of the other devices make them (variances
of many quantities from few samples each: Smyth 2004, Stat. Appl. Genet. Mol. Biol. 3, 3). Where they are unlike, v is wide and Student's t stays.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import date
from functools import cached_property

import numpy as np
import scipy

from compensation.arrays import Array
from compensation.regression import fit_linear
from studies.fleet.device import Measured

# Scatters that are tried, in parts of the range of the values: three may stand close by chance.
GRID = np.geomspace(1e-3, 1e3, 100)
CHANCE = 0.01  # chance, with all looks counted, below which a device or a batch is odd
CENTRES, WIDTHS = np.linspace(np.log(1e-5), np.log(1e2), 33), np.array([0.35, 0.7, 1.4, 2.8])
"""Values of m and v that are tried."""
FEWEST = 4  # devices from which on values tell who is odd
DATES, MONTH = 5, 30.0  # dates from which on a lot may have a trend, and days of which it is told
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
    def of(cls, value: Array, sd: Array, prior: Array | None = None) -> "Population":
        """Fit a population; `prior` weighs the scatters of its grid."""
        scatters = _grid(value, sd)
        total = scatters[:, None] ** 2 + sd**2
        known = (1.0 / total).sum(axis=1)
        means = (value / total).sum(axis=1) / known
        deviance = np.log(total).sum(axis=1) + np.log(known) + ((value - means[:, None]) ** 2 / total).sum(axis=1)
        prior = scatters / (scatters + float(np.median(sd))) if prior is None else prior
        weights = np.exp(-0.5 * (deviance - deviance.min())) * prior
        k = int(np.argmin(deviance))
        scatter = float(scatters[k]) if k else 0.0
        weights /= max(weights.sum(), 1e-300)
        return cls(float(means[k]), float(known[k] ** -0.5), scatter, scatters, weights, means, known)

    def surprise(self, value: Array, sd: Array) -> float:
        """Return the chance of another device, or of several with a mean, as far away."""
        weight = 1.0 / (self.scatters[:, None] ** 2 + sd**2)
        own = (value * weight).sum(axis=1) / weight.sum(axis=1)
        far = np.abs(own - self.means) / np.sqrt(1.0 / weight.sum(axis=1) + 1.0 / self.known)
        return float(self.weights @ (2.0 * scipy.special.ndtr(-far)))


def _grid(value: Array, sd: Array) -> Array:
    return np.asarray((float(np.ptp(value)) + float(sd.max())) * GRID)


def _usual(scatters: Array, scale: float) -> Array:
    """Return how likely the scatters of a grid are for every m and v, (centres × widths, grid): the ends stand for all beyond."""
    middle = 0.5 * (np.log(scatters[1:]) + np.log(scatters[:-1])) - np.log(scale)
    below = scipy.special.ndtr((middle - CENTRES[:, None, None]) / WIDTHS[:, None])
    return np.diff(below.reshape(-1, len(middle)), prepend=0.0, append=1.0)


@dataclass(frozen=True)
class Scatters:
    """What the values of a lot say of each other's scatter."""

    of: Mapping[str, Mapping[str, Measured]]  # name -> serial -> Measured
    known: dict[str, dict[str, Array]] = field(default_factory=dict, init=False, compare=False)

    @cached_property
    def scales(self) -> dict[str, float]:
        """What the card leaves each value, 0 where that is not known."""
        return {name: float(np.median([one.open for one in own.values()])) for name, own in self.of.items()}

    def prior(self, name: str, serial: str, value: Array, sd: Array) -> Array | None:
        """Return the prior of a value's scatter, by other values of other devices than one; None without one."""
        if self.scales[name] <= 0.0:
            return None
        if serial not in self.known:
            self.known[serial] = {n: own for n in self.of if (own := self._evidence(n, serial)) is not None}
        likely = sum((own for n, own in self.known[serial].items() if n != name), np.zeros(CENTRES.size * WIDTHS.size))
        weights = np.exp(likely - likely.max())
        return np.asarray(weights @ _usual(_grid(value, sd), self.scales[name]) / weights.sum())

    def _evidence(self, name: str, without: str) -> Array | None:
        """Log likelihood of every m and v by one value."""
        own = [one for serial, one in self.of[name].items() if serial != without]
        if len(own) < FEWEST - 1 or self.scales[name] <= 0.0:
            return None
        value, sd = np.array([one.value for one in own]), np.array([one.sd for one in own])
        flat = Population.of(value, sd, np.ones_like(GRID))
        return np.asarray(np.log(_usual(flat.scatters, self.scales[name]) @ flat.weights + 1e-300))


@dataclass(frozen=True)
class Trend:
    """Change of a value in `MONTH` days of the date of a device, its standard deviation, and the counted chance of such a change."""

    per_month: float
    sd: float
    chance: float


@dataclass(frozen=True)
class Quantity:
    """One value over the lot."""

    name: str  # with its unit
    of: Mapping[str, Measured]  # serial -> Measured
    looks: int  # devices times values that were looked at
    batches: Mapping[str, str] = field(default_factory=dict)  # serial -> batch
    scatters: Scatters | None = None  # of all values of the lot

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

    def trend(self, made: Mapping[str, date]) -> "Trend | None":
        """Return the change with the dates of the usual devices, weighted as for their mean; None where the counted chance is not small."""
        own = [s for s in self._usual(self.odd) if s in made]
        days = np.array([made[s].toordinal() for s in own], dtype=float)
        if len(set(days)) < DATES:
            return None
        value, sd = self._arrays(own)
        w = 1.0 / np.hypot(max(self.population.scatter, 1e-3 * float(sd.max())), sd)
        X = np.column_stack([np.ones_like(days), (days - days.mean()) / MONTH]) * w[:, None]
        fit = fit_linear(X, value * w, ("mean", "date"), constant=False)
        slope, error = float(fit.coefficients[1]), float(fit.standard_errors[1])
        far = abs(slope) / max(error, 1e-300)
        chance = 2.0 * float(scipy.special.stdtr(fit.degrees_of_freedom, -far)) * self.looks / len(self.of)
        return Trend(slope, error, chance) if chance < CHANCE else None

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
            chances = {s: self._chance(s, [o for o in rest if o != s]) for s in rest}
            worst = min(rest, key=lambda s: chances[s])
            if chances[worst] >= CHANCE:
                break
            found[worst] = chances.pop(worst)
        return found, chances

    def _chance(self, serial: str, others: list[str]) -> float:
        known = self._arrays(others)
        prior = None if self.scatters is None else self.scatters.prior(self.name, serial, *known)
        return Population.of(*known, prior).surprise(*self._arrays([serial])) * self.looks

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
