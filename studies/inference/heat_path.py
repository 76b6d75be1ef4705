"""A heat path longer than one lag, as a card of its own: without one, lumps in series with radiation along and past them; of a card, its own with a second mass on the base."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from compensation.arrays import Array
from compensation.noise import white_rms
from studies.calibration.fit import CardFit, fit
from studies.calibration.priors import gather_priors
from studies.calibration.problem import CardProblem
from studies.diagnosis.verdict import Interval
from studies.inference.generic_forms import any_lags
from studies.inference.housing import evidence_of, set_housing_apart
from studies.inference.hypothesis import Hypothesis
from studies.inference.linear import PRICE, Linear, Shapes
from studies.inference.records import HOUSING, driving
from studies.inference.search import Search
from studies.inference.signatures import SHARE, Signatures
from studies.instrument.card import Instrument
from studies.simulation.heat_path import build_network, slowest_lag
from studies.simulation.variations import LAG

FREQUENCY = "frequency_Hz"
LAGS = ("lag_s", "second_lag_s", "third_lag_s")
DIRECT, DELAY = "law.direct_share", "law.delay_s"
PATHS = (
    ([(1.0,)], False),
    ([(0.7, 0.3)], False),
    ([(0.7, 0.3), (0.3, 0.7)], True),
    ([(0.65, 0.05, 0.3)], True),
)
"""Lags in series over the one lag that stood for them, in the orders where their priors may be centred, and whether they have what `OF_LUMPS` says."""
LAG_WIDTH = 0.7
"""Standard deviation of the logarithm of each."""
RADIATED = {"value": 0.3, "sd": 0.3}
"""What is known of the radiated share."""
OF_LUMPS = {
    "direct_share": {"value": 0.5, "sd": 0.5},
    "base_radiated_share": {"value": 0.2, "sd": 0.2},
    "capacity_ratio": {"value": 0.1, "sd": 0.1},
    "capacity_slope_per_K": {"value": 1e-3, "sd": 1e-3},
    "base_capacity_slope_per_K": {"value": 0.0, "sd": 1e-3},
}
"""The same of what lumps have besides, where plain lags in series leave slow noise; all but `OF_ONE` only where there are several."""
OF_ONE = "capacity_slope_per_K"
SENSOR, LATENESS = LAG, {"value": 5.0, "sd": 20.0}
"""The sensor of the housing, and what is known of its lag (s) where the resonator is ahead of it."""
MASS = ("thermal.second_mass_J_per_K", "thermal.second_mass_conductance_W_per_K")
MASS_SHARE = 0.2
"""Of the heat capacity of the base, about which the prior of a second mass is centred, as slow as the path itself."""
WORTH = 10.0
"""Log evidence that one more lag must bring."""
FOLLOWED = 3.0
"""Slow noise within a run over that of a row, up to which no more is asked of a path."""
THERMOMETER = 4.0
"""Times what the noise of the housing's readings makes, up to which what is left is that."""
STRAINED = 0.01
"""Chance below which values of a card's heat path are so far from it that they may stand for a part that it lacks."""
SURE_SHARE = 3.0
"""Standard deviations from which on a radiated share, or a late sensor, is named; and of the prior, by which a resonator is ahead of its sensor."""


@dataclass(frozen=True)
class HeatPath:
    """A card with lags in series, its fit and log `evidence`, choices paid for; `lead` is that ahead of one lag with other effects."""

    card: Instrument
    fit: CardFit
    evidence: float = 0.0
    lead: float = 0.0
    housing: float = 0.0  # of the log evidence, what the rows of the housing add that stand apart
    beside: tuple[Array, Array] | None = None  # coordinates and their covariance beside the effects that were found

    @property
    def lags(self) -> int:
        """How many there are, or stand out: the resonator's and the second mass's."""
        law = self.card.polynomial
        return 2 if law is None else len(law.lags)

    @property
    def price(self) -> float:
        """Log prior of the choice: one for each lag beyond the first, one for radiation, and one for a sensor that may be late."""
        return PRICE * (self.lags + (SENSOR in self.fit.problem.priors.names))

    @property
    def departs(self) -> bool:
        """Whether it is other than one lag behind a prompt sensor."""
        return self.lags > 1 or self.radiates or self.is_late

    @property
    def radiates(self) -> bool:
        """Whether the share is above 0 beyond its error."""
        return self._is_sure(SHARE)

    @property
    def is_late(self) -> bool:
        """Whether the sensor of the housing is slow beyond its error, and no lag as slow: by 1 + s τ over 1 + s τ′, τ ≈ τ′, a path beside another one is written."""
        if not self._is_sure(SENSOR):
            return False
        own, lags = self.interval(SENSOR), [self.interval(f"law.{key}") for key in LAGS[: self.lags]]
        return self.lags == 1 or not any(own.low < lag.high and lag.low < own.high for lag in lags)

    def _is_sure(self, name: str) -> bool:
        """Whether a value that no card of a user states is above 0 beyond its error."""
        if self.card.polynomial is None or name not in self.fit.problem.priors.names:
            return False
        value, sd = self.value(name)
        return value > SURE_SHARE * sd

    def value(self, name: str, over: str = "") -> tuple[float, float]:
        """Return a value of the card, or its ratio to another one, and its standard deviation."""
        priors, (point, C) = self.fit.problem.priors, self.beside or (self.fit.point, self.fit.covariance)
        count = len(priors.values)
        slope, at = priors.slopes(point[:count]), priors.at(point[:count])
        value, own = at[name], slope[priors.names.index(name)]
        if over:
            value, own = value / at[over], (own - value / at[over] * slope[priors.names.index(over)]) / at[over]
        return value, float(np.sqrt(own @ C[:count, :count] @ own))

    def interval(self, name: str) -> Interval:
        """Return a value of the card with its 90 % interval, within the bounds that it has."""
        priors = self.fit.problem.priors
        own = priors.values[priors.names.index(name)]
        return Interval.about(*self.value(name), own.low, own.high)

    def evidence_for(self, name: str) -> float:
        """Return −2 ln of what speaks against a value of 0, alone or beside effects, and no more than for the path."""
        alone, beside = (value / sd for value, sd in (replace(self, beside=None).value(name), self.value(name)))
        return min(max(alone, beside) ** 2, 2.0 * self.evidence)


def with_second_mass(
    whole: CardFit, found: CardFit, progress: Callable[[str], None] = lambda _: None
) -> HeatPath | None:
    """Return a card, calibrated as a `whole` and as `found` with the housing apart, with another part on its base, calibrated; None where it is no likelier, or where the card has one."""
    card, thermal = whole.problem.instrument, whole.problem.instrument.thermal
    if thermal.second_mass_J_per_K is not None:
        return None
    progress("a second mass on the base")
    capacity = MASS_SHARE * thermal.base_heat_capacity_J_per_K
    lag = slowest_lag(build_network(card), card.reference_temperature)
    numbers = (capacity, capacity / lag)
    added = {name.partition(".")[2]: {"value": one, "sd": one} for name, one in zip(MASS, numbers, strict=True)}
    own = card.with_table("thermal", {**card.content.get("thermal", {}), **added})
    there = fit(replace(whole.problem, instrument=own, priors=gather_priors(own)), progress=progress)
    kept, gain = set_housing_apart(there), evidence_of(there) - evidence_of(whole)
    path = HeatPath(own, kept, housing=gain - evidence_of(kept) + evidence_of(found))
    return path if gain + path.price > 0.0 else None


def with_lags(card: Instrument, lags: Sequence[float], lumps: bool) -> Instrument:
    """Return a polynomial card with such lags (s) in series, and radiation; if `lumps`, with all that so many lumps have, and a cubic law."""
    law = dict(card.content["law"])
    law |= {key: {"value": lag, "sd": LAG_WIDTH * lag} for key, lag in zip(LAGS, lags, strict=False)}
    law |= {"radiated_share": dict(RADIATED)}
    law |= {key: dict(known) for key, known in OF_LUMPS.items() if lumps and (len(lags) > 1 or key == OF_ONE)}
    law |= cubic_of(card) if lumps else {}
    return card.with_table("law", law)


def with_late_sensor(card: Instrument) -> Instrument:
    """Return a card whose sensor of the housing may be late."""
    return card.with_table("noise", {**card.content.get("noise", {}), "housing_lag_s": dict(LATENESS)})


def cubic_of(card: Instrument) -> dict[str, Any]:
    """Return the cubic term of a card's law as wide as its slope and bend make likely, where both are free and it is not."""
    width = {one.name: one.sd for one in card.uncertain}
    slope, bend, free = (width.get(f"law.{key}", 0.0) for key in ("a1_per_K", "a2_per_K2", "a3_per_K3"))
    return {"a3_per_K3": {"value": 0.0, "sd": bend**2 / slope}} if slope and bend and not free else {}


def find_heat_path(
    baseline: CardFit,
    lags: int | None,
    tried: dict[tuple[int, bool], HeatPath],
    progress: Callable[[str], None] = lambda _: None,
) -> HeatPath:
    """Return the path of so many lags, else the likeliest one by the frequency, each further lag paid for, of a gyro calibrated with one; what was `tried` is kept there."""
    whole = baseline.problem
    lean = replace(whole, runs=tuple(run.explaining((FREQUENCY,)) for run in whole.runs))
    lag = whole.priors.at(baseline.point[: len(whole.priors.values)])["law.lag_s"]
    best: HeatPath | None = None
    followed = False
    for orders, lumps in PATHS:
        number = len(orders[0])
        if lags not in (None, number) or followed:
            continue
        words = f"a heat path with {number} {'lag' if number == 1 else 'lags in series'} and radiation"
        cards = [with_lags(whole.instrument, [part * lag for part in parts], lumps) for parts in orders]
        path = tried.get((number, lumps)) if lags else None
        if path is None:
            progress(words)
            path = max((_calibrated(lean, card) for card in cards), key=lambda one: one.evidence)
            if number == 1 and lags is None and wanders(path.fit):
                grows = _calibrated(lean, with_lags(whole.instrument, [lag], True))
                path = grows if grows.evidence > path.evidence + WORTH else path
            if wanders(path.fit) or is_ahead(path.fit):
                progress(f"{words}, its sensor late")
                path = max(path, _calibrated(lean, with_late_sensor(path.card)), key=lambda one: one.evidence)
            tried[number, lumps] = path
        if best is None or path.evidence > best.evidence + WORTH * (path.lags - best.lags):
            best = path
            still = number == 1 or slow_share(path.fit) < FOLLOWED
            followed = leaves_thermometer_noise(path.fit) or (still and lags_would_bring(_linearised(path.fit)) < WORTH)
    assert best is not None
    if whole.responses == lean.responses or not best.departs:
        return best
    progress("the other responses beside it")
    return _calibrated(whole, best.card, best.fit.point if whole.starts == lean.starts else None)


def _calibrated(problem: CardProblem, card: Instrument, start: Array | None = None) -> HeatPath:
    path = HeatPath(card, fit(replace(problem, instrument=card, priors=gather_priors(card)), start))
    return replace(path, evidence=evidence_of(path.fit) + path.price)


def _linearised(found: CardFit) -> Search:
    """A search without effects of its own."""
    return Search(Linear.of(found), Signatures.at(found.problem, found.point), found.noise, [])


def is_ahead(found: CardFit) -> bool:
    """Whether the resonator is ahead of its sensor, by more than clocks and sensors usually make; without a delay, whether slow noise may be that."""
    priors = found.problem.priors
    if DELAY not in priors.names or FREQUENCY not in found.noise:
        return wanders(found)
    return bool(found.away[priors.names.index(DELAY)] < -SURE_SHARE)


def is_strained(found: CardFit) -> bool:
    """Whether the values of the heat path are so far from the card's as if they stood for another part."""
    own = np.array([name.startswith("thermal.") for name in found.problem.priors.names], dtype=bool)
    away = found.away[own]
    return bool(away @ away > scipy.special.chdtri(max(own.sum(), 1), STRAINED))


def lags_would_bring(search: Search, beside: Hypothesis | None = None) -> float:
    """Log evidence that lags of any lengths and shares would bring in a linearised campaign, or beside effects: a heat path of any form, to first order."""
    return _best(search, search.signatures.shapes_of([(any_lags(search.signatures.span), FREQUENCY)]), beside)


def effects_would_bring(search: Search) -> float:
    """The same of the best effect on the frequency that is no lag itself."""
    lag = f"law.{LAGS[1]}"
    return _best(search, [own for own in search.bank if own.response == FREQUENCY and own.effect.card_key != lag])


def _best(search: Search, bank: Sequence[Shapes], beside: Hypothesis | None = None) -> float:
    now = beside or Hypothesis((), search.noise, 0.0)
    return max((one.gain for one in search.scan(now, bank)), default=-np.inf)


def left_rms(found: CardFit) -> float:
    """Rms of the frequency that a fit leaves, Hz, about the mean of each run: slow noise carries the level off."""
    runs = [found.state.residual[FREQUENCY][own] for own in found.rows[FREQUENCY].slices]
    return float(np.sqrt(np.mean(np.concatenate([rest - rest.mean() for rest in runs]) ** 2)))


def by_thermometer(found: CardFit) -> float:
    """Return what the noise σ of the housing's readings, rows h apart, makes of the frequency behind the first lag: f₀a₁ σ √(h/2τ), Hz."""
    priors, records = found.problem.priors, [run.record for run in found.problem.runs]
    at = priors.at(found.point[: len(priors.values)])
    read = [white_rms(driving(record)) if HOUSING in record else 0.0 for record in records]  # a chamber does ripple
    rows = [float(np.median(np.diff(record["time_s"]))) for record in records]
    made = np.mean([sigma**2 * h / (2.0 * at[f"law.{LAGS[0]}"]) for sigma, h in zip(read, rows, strict=True)])
    return float(abs(at["law.f0_Hz"] * at["law.a1_per_K"]) * np.sqrt(made))


def leaves_thermometer_noise(found: CardFit) -> bool:
    """Whether a path leaves no more than the noise of the housing's readings makes: a longer one would follow the frequency closer only for smoothing that."""
    return left_rms(found) < THERMOMETER * by_thermometer(found)


def wanders(found: CardFit) -> bool:
    """Whether a path leaves slow noise that the noise of the housing's readings does not make."""
    return slow_share(found) > FOLLOWED and not leaves_thermometer_noise(found)


def slow_share(found: CardFit, name: str = FREQUENCY) -> float:
    """Rms of the slow noise of a response within a usual run over that of a row; 0 where it is not measured."""
    return found.rows[name].slow_share(found.noise[name]) if name in found.noise else 0.0
