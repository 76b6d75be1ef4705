"""The anisotropy of the damping is a vector: its length and axis enter the bias through components in which it is linear.

    a = A cos 4(θ − θ₀),   b = A sin 4(θ − θ₀),   θ₀ the card's axis

A pattern that stands at one azimuth sees only one direction of (a, b), so that neither A nor θ is known from it although
their product with a cosine is; and the sign of a cosine may be negative. The fit moves a and b, with a normal prior of the
same mean and spread; what A and θ may be is then summed over the plane of (a, b), with the priors that the card states:
ln A and θ normal, dlnA dθ = da db/(4 A²). Of a card that was calibrated a and b themselves are what is known, with
their standard deviations and correlations.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from compensation.arrays import Array

if TYPE_CHECKING:
    from studies.instrument.uncertain import UncertainValue

ANISOTROPY, AXIS = "bias.damping_anisotropy", "bias.damping_axis_deg"
PER_DEGREE = np.radians(4.0)
PERIOD = 90.0  # of an axis, °
POINTS = 601  # of the plane, along each principal axis
REACH = 6.0  # standard deviations, to each side
EDGE = 1e-9  # of the half period: an axis so near its end lies at both, not where rounding puts it
FIVE, NINETY_FIVE = 0.05, 0.95


@dataclass(frozen=True)
class Polar:
    """Most probable length or axis, its 90 % interval, and its posterior over its prior standard deviation."""

    value: float
    low: float
    high: float
    width: float


@dataclass(frozen=True)
class WavePosterior:
    """Length and axis; (x, y) at the most probable of them, their mean and covariance."""

    length: Polar
    axis: Polar
    best: Array
    mean: Array
    covariance: Array


@dataclass(frozen=True)
class WavePrior:
    """Priors of length and axis; coordinates (x, y) of unit variance of a = mean + spread_a x, b = spread_b y."""

    length: "UncertainValue"
    axis: "UncertainValue"
    sd: tuple[float, float] | None = None  # of a and b, where a calibration told them

    @property
    def moments(self) -> tuple[float, float, float]:
        """Mean of a, and standard deviations of a and b: as they were told, else of a log-normal length and a normal angle."""
        if self.sd is not None:
            return self.length.value, *self.sd
        s, turn = self.length.sd / self.length.value, self.axis.sd * PER_DEGREE
        mean = self.length.value * float(np.exp(s**2 / 2 - turn**2 / 2))
        square = self.length.value**2 * float(np.exp(2 * s**2))
        even = float(np.exp(-2 * turn**2))
        return mean, float(np.sqrt(square * (1 + even) / 2 - mean**2)), float(np.sqrt(square * (1 - even) / 2))

    def components(self, x: "float | Array", y: "float | Array") -> tuple["float | Array", "float | Array"]:
        """Return a and b."""
        mean, spread_a, spread_b = self.moments
        return mean + spread_a * x, spread_b * y

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Length and axis (°)."""
        a, b = self.components(x, y)
        length = max(float(np.hypot(a, b)), 1e-9 * self.length.value)
        return length, self.axis.value + float(np.arctan2(b, a) / PER_DEGREE)

    def slopes(self, x: float, y: float) -> Array:
        """∂(length, axis)/∂(x, y), (2, 2)."""
        return np.asarray(self.turned(x, y) / np.array([[1.0], [self.at(x, y)[0] * PER_DEGREE]]))

    def turned(self, x: float, y: float) -> Array:
        """∂/∂(x, y), (2, 2), of the components along the axis that is there and across it."""
        phi = (self.at(x, y)[1] - self.axis.value) * PER_DEGREE
        turn = np.array([[np.cos(phi), np.sin(phi)], [-np.sin(phi), np.cos(phi)]])
        return np.asarray(turn * self.moments[1:])

    def posterior(self, information: Array, mean: Array, prior: Array) -> WavePosterior:
        """Length and axis, from the data's information (2, 2) on (x, y) and the mean that it has beside that of a normal prior; once of what is asked again, as where no data tell of either."""
        return self._posterior(*(part.tobytes() for part in (information, mean, prior)))

    @lru_cache(maxsize=16)  # noqa: B019  of priors, which are few
    def _posterior(self, *given: bytes) -> WavePosterior:
        information, mean, prior = (np.frombuffer(part).reshape(-1, 2) for part in given)
        mean = mean[0]
        pull = (information + prior) @ mean
        strength, ways = np.linalg.eigh(information)
        told = strength > 1.0
        middle = np.where(told, (ways.T @ pull) / np.maximum(strength, 1.0), 0.0)
        reach = REACH * np.where(told, 1 / np.sqrt(np.maximum(strength, 1.0)), 1.0)
        line = np.linspace(-1.0, 1.0, POINTS)
        p, q = np.meshgrid(middle[0] + reach[0] * line, middle[1] + reach[1] * line)
        x, y = ways[0, 0] * p + ways[0, 1] * q, ways[1, 0] * p + ways[1, 1] * q
        a, b = (np.asarray(part) for part in self.components(x, y))
        A = np.maximum(np.hypot(a, b), 1e-12 * self.length.value)
        angle = np.arctan2(b, a) / PER_DEGREE
        log = np.log(A / self.length.value)
        likely = pull[0] * x + pull[1] * y - (strength[0] * p**2 + strength[1] * q**2) / 2
        if self.sd is None:
            turned = [-(((angle + turn) / self.axis.sd) ** 2) / 2 for turn in (-PERIOD, 0.0, PERIOD)]
            polar = likely - (log * self.length.value / self.length.sd) ** 2 / 2 + np.logaddexp.reduce(turned)
        else:
            polar = likely - (prior[0, 0] * x**2 + prior[1, 1] * y**2) / 2 - prior[0, 1] * x * y + 2 * log
        inside = (A >= self.length.low) & (A <= self.length.high)
        polar = np.where(inside, polar, -np.inf) if inside.any() else polar
        weight = np.exp(polar - polar.max()) / A**2
        weight /= weight.sum()
        best = np.unravel_index(int(np.argmax(polar + 1e-9 * (angle > 0))), polar.shape)
        spread = self.length.sd / self.length.value
        middle = np.array([(weight * x).sum(), (weight * y).sum()])
        away = np.array([x - middle[0], y - middle[1]])
        edge = np.abs(angle) > PERIOD / 2 * (1 - EDGE)
        both, shares = np.append(angle, -angle[edge]), np.append(np.where(edge, 0.5, 1.0) * weight, weight[edge] / 2)
        return WavePosterior(
            _summed(A, weight, float(A[best]), _deviation(log, weight) / spread),
            _summed(
                self.axis.value + both,
                shares,
                self.axis.value + float(angle[best]),
                _deviation(both, shares) / self.axis.sd,
            ),
            np.array([x[best], y[best]]),
            middle,
            np.einsum("iab,jab,ab->ij", away, away, weight),
        )


def _deviation(values: Array, weight: Array) -> float:
    middle = float((weight * values).sum())
    return float(np.sqrt((weight * (values - middle) ** 2).sum()))


def _summed(values: Array, weight: Array, best: float, width: float) -> Polar:
    order = np.argsort(values, axis=None)
    total = np.cumsum(weight.ravel()[order])
    ordered = values.ravel()[order]
    low, high = (float(ordered[min(int(np.searchsorted(total, part)), total.size - 1)]) for part in (FIVE, NINETY_FIVE))
    return Polar(best, min(low, best), max(high, best), min(width, 1.0))
