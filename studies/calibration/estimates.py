"""What a fit says of each value: how far it moved, how well it is known, and what it cannot be told apart from."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

from compensation.arrays import Array
from compensation.constants import NINETY
from studies.calibration.fit import CardFit, whitened
from studies.calibration.priors import Priors, from_standard, to_standard
from studies.calibration.valley import find_bend, follow
from studies.calibration.wave import Polar
from studies.instrument.display import display_name
from studies.instrument.uncertain import UncertainValue
from studies.results.shown import Shown

if TYPE_CHECKING:
    from pandas import DataFrame

    from studies.instrument.card import Instrument

NONLINEAR = ("thermal.", "noise.", "effect.", "resonator.")
"""Values whose intervals are looked at beyond the straight line."""
BENT = 0.25  # relative departure of the objective at the ends of an interval from its parabola, beyond which it is profiled
TOLD = 0.5  # posterior over prior width up to which the data has said what the value is
SILENT = 0.95  # and from which it stayed at its prior
EXCLUDED = 6.0  # prior standard deviations that no value of a right card is away
INSEPARABLE = 0.9  # correlation, of two values that share what is known of them


@dataclass(frozen=True)
class Estimate:
    """One value of the card."""

    # parameter, unit: name of the key, and its unit
    parameter: str
    unit: str
    # card, value, low, high: what the card said, the most probable value, and its 90 % interval
    card: float
    value: float
    low: float
    high: float
    sd: float  # posterior standard deviation, as a card states it
    shift_sd: float  # how far it moved, in prior standard deviations
    width: float  # posterior over prior standard deviation
    bound: str | None  # "low" or "high" where the value has reached a hard bound
    interval: str  # "profile" where the interval follows the likelihood's curvature

    @classmethod
    def of(
        cls, value: UncertainValue, number: float, shift: float, sd: float, ends: Sequence[float],
        bound: str | None = None, interval: str = "normal", width: float | None = None,
    ) -> "Estimate":  # fmt: skip
        """Make one of how far the value moved, its standard deviation and the ends of its interval, in coordinates of unit prior variance."""
        low, high = (float(np.clip(from_standard(value, end), value.low, value.high)) for end in ends)
        scale = value.sd * (number / value.value if value.logarithmic else 1.0)
        span = min(low, number), max(high, number)
        return cls(value.name, value.unit, value.value, number, *span, sd * scale, shift, width or sd, bound, interval)

    @property
    def told_by(self) -> str:
        """Who says so: the data, the prior, or both."""
        return "data" if self.width <= TOLD else "prior" if self.width >= SILENT else "both"


class OfEstimates(Shown):
    """A result that is values of a card."""

    estimates: tuple[Estimate, ...]

    @property
    def determined(self) -> str:
        """How many of the values the data determine, in words."""
        told = sum(one.told_by == "data" for one in self.estimates)
        return f"{told} of {len(self.estimates)} values determined by the data"

    @property
    def excluded(self) -> str:
        """Which values are where the card all but excludes them, in words; empty where none is."""
        far = [one.parameter for one in self.estimates if abs(one.shift_sd) > EXCLUDED]
        named = ", ".join(f"{display_name(name)} ({name})" for name in far)
        return named and f"{named} would have to move by more than {EXCLUDED:g} of the card's standard deviations"

    def to_frame(self) -> "DataFrame":
        """Return one row an uncertain value, best known first: card, value, interval, shift, width, told by."""
        import pandas as pd

        rows = [asdict(one) | {"told_by": one.told_by} for one in sorted(self.estimates, key=lambda one: one.width)]
        columns = ["unit", "card", "value", "low", "high", "shift_sd", "width", "told_by"]
        return pd.DataFrame(rows).set_index("parameter")[columns]


def estimate(fit: CardFit, profile: bool = True) -> tuple[Estimate, ...]:
    """Return the estimates of all values of the card."""
    priors = fit.problem.priors
    polar, best, mean, covariance = over_the_wave(priors, fit.point, fit.covariance)
    z, bounds, at = priors.standard(best), priors.bound(best), priors.at(best)
    middle = priors.standard(mean)
    C = priors.covariance(covariance)
    J, _ = whitened(fit.problem, fit.state, fit.noise, fit.rows)
    bend = find_bend(fit, J) if profile else None
    found = []
    seen = bool(J[:, priors.pair].any())
    for k, value in enumerate(priors.values):
        if k in polar:
            found.append(_told_polar(value, polar[k], seen))
            continue
        sd = float(np.sqrt(C[k, k]))
        ends, kind = (float(middle[k]) - NINETY * sd, float(middle[k]) + NINETY * sd), "normal"
        if profile and value.name.startswith(NONLINEAR) and sd < SILENT:
            ends, kind = _profiled(fit, k, J, ends)
        wide = sd
        if bend is not None and kind == "normal" and max(abs(bend.low[k]), abs(bend.high[k])) > BENT * sd:
            ends, kind = (ends[0] + float(bend.low[k]), ends[1] + float(bend.high[k])), "profile"
            wide = float(bend.sd[k])
        found.append(Estimate.of(value, at[value.name], float(z[k]), sd, ends, bounds[k], kind, wide))
    return tuple(found)


def over_the_wave(priors: Priors, point: Array, covariance: Array) -> tuple[dict[int, Polar], Array, Array, Array]:
    """Length and axis of the damping's anisotropy by their places; the coordinates' most probable values, mean and covariance over all that these may be."""
    count = len(priors.values)
    point, C, pair = point[:count], covariance[:count, :count], priors.pair
    if priors.wave is None:
        return {}, point, point, C
    seen = priors.root[pair]  # the components of unit prior variance
    before, after = (np.asarray(np.linalg.inv(seen @ own @ seen.T)) for own in (np.eye(count), C))
    found = priors.wave.posterior(after - before, seen @ point, before)
    gain = C @ seen.T @ after
    best, mean = (point + gain @ (there - seen @ point) for there in (found.best, found.mean))
    polar = dict(zip(pair, (found.length, found.axis), strict=True))
    return polar, best, mean, C + gain @ (found.covariance - seen @ C @ seen.T) @ gain.T


def _told_polar(value: UncertainValue, one: Polar, seen: bool) -> Estimate:
    if not seen:
        return Estimate.of(value, value.value, 0.0, 1.0, (-NINETY, NINETY))
    sd = one.width * value.sd * (one.value / value.value if value.logarithmic else 1.0)
    shift = to_standard(value, one.value)
    return Estimate(
        value.name, value.unit, value.value, one.value, one.low, one.high, sd, shift, one.width, None, "profile"
    )


def _profiled(fit: CardFit, k: int, J: Array, ends: tuple[float, float]) -> tuple[tuple[float, float], str]:
    """Ends of an interval in z, each where the least objective with value k held has risen by 2.71."""
    problem, priors = fit.problem, fit.problem.priors
    count = len(priors.values)
    row = np.zeros(problem.count)
    row[:count] = priors.root[k]
    toward = fit.covariance @ row
    way = toward / np.sqrt(row @ toward)  # one standard deviation of value k
    bend = np.zeros(problem.count)  # of the valley: the others at t are t² of it off the straight way
    limits = priors.values[k]
    lowest, highest = (to_standard(limits, end) for end in (limits.low, limits.high))
    centre = float(fit.away[k])

    def rise(t: float) -> float:
        """Rise along the valley; a parabola's where it cannot be followed."""
        nonlocal bend
        point, risen = follow(fit, J, row, fit.point + t * way + t**2 * bend, (1 + BENT) * t**2)
        if not np.isfinite(risen):
            return t**2
        bend = (point - fit.point - t * way) / t**2
        return risen

    found, kind = [], "normal"
    for sign, end in zip((-1.0, 1.0), ends, strict=True):
        t = NINETY
        if not lowest <= end <= highest:
            found.append(end)
            continue
        for _ in range(3):
            ratio = rise(sign * t) / t**2
            if abs(ratio * t**2 / NINETY**2 - 1) < BENT:
                break
            kind = "profile"
            t *= float(np.clip(NINETY / (t * np.sqrt(max(ratio, 1e-3))), 0.4, 2.0))
        found.append(centre + sign * t * (abs(end - centre) / NINETY))
    return (found[0], found[1]), kind


def find_groups(priors: Priors, covariance: Array) -> tuple[tuple[str, ...], ...]:
    """Return groups of values that the data ties together but cannot tell apart: |correlation| above 0.9."""
    count, C = len(priors.values), priors.covariance(covariance)
    sd = np.sqrt(np.diag(C))
    tied = np.abs(C / np.outer(sd, sd)) > INSEPARABLE
    groups, left = [], set(range(count))
    while left:
        group, front = set(), {left.pop()}
        while front:
            k = front.pop()
            group.add(k)
            near = {int(j) for j in np.flatnonzero(tied[k])} - group
            front |= near
            left -= near
        if len(group) > 1:
            groups.append(tuple(priors.names[k] for k in sorted(group)))
    return tuple(groups)


DIGITS = 12  # of a correlation: the frequency knows two values together a thousand times better than each, and 1 − ρ² is the square


def posterior_card(
    instrument: "Instrument",
    priors: Priors,
    point: Array,
    covariance: Array,
    estimates: Sequence[Estimate],
    more: dict[str, float] | None = None,
    levels: dict[str, object] | None = None,
) -> "Instrument":
    """Return the card with posterior values, widths, correlations and intervals; `more` are further values of it, `levels` of its runs."""
    count, pair = len(priors.values), priors.pair
    moves = priors.slopes(point[:count])
    if priors.wave is not None:
        seen = priors.root[pair]
        moves[pair] = priors.wave.turned(*(seen @ point[:count])) @ seen
    C = moves @ covariance[:count, :count] @ moves.T
    sd = np.sqrt(np.diag(C))
    R = np.clip(C / np.outer(sd, sd), -1.0, 1.0)
    np.fill_diagonal(R, 1.0)
    values = {}
    for k, (one, prior) in enumerate(zip(estimates, priors.values, strict=True)):
        ends = {"low": prior.low if prior.low != 0.0 else -np.inf, "high": prior.high}
        hard = {name: end for name, end in ends.items() if np.isfinite(end)}
        values[one.parameter] = {"value": one.value, "sd": one.sd if k in pair else float(sd[k]), **hard}
    posterior: dict[str, object] = {
        "names": [one.parameter for one in estimates],
        "correlation": R.round(DIGITS).tolist(),
        "interval": [[one.low, one.high] for one in estimates],
        **(levels or {}),
    }
    if priors.wave is not None:
        posterior["anisotropy_sd"] = sd[pair].tolist()
    return instrument.with_values(values | (more or {})).with_table("posterior", posterior)
