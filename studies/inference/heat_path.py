"""A heat path longer than one lag, of a gyro without a card: lumps in series, with radiation along and past them, as a card of its own."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from studies.calibration.fit import CardFit, fit
from studies.calibration.priors import gather_priors
from studies.calibration.problem import CardProblem
from studies.inference.generic_forms import any_lags
from studies.inference.model import PRICE, Background, Linear
from studies.inference.search import Hypothesis, Search
from studies.inference.signatures import SHARE, Signatures
from studies.instrument.card import Instrument
from studies.simulation.variations import LAG

Array = NDArray[np.float64]
FREQUENCY = "frequency_Hz"
LAGS = ("lag_s", "second_lag_s", "third_lag_s")
DIRECT, DELAY = "law.direct_share", "law.delay_s"
PATHS = (
    ((1.0,), False),
    ((0.7, 0.3), False),
    ((0.7, 0.3), True),
    ((0.3, 0.7), True),
    ((0.65, 0.05, 0.3), True),
)
"""Lags in series over the one lag that stood for them, where their priors are centred, and whether they have what `OF_LUMPS` says."""
LAG_WIDTH = 0.7
"""Standard deviation of the logarithm of each."""
RADIATED = {"value": 0.3, "sd": 0.3}
"""What is known of the radiated share."""
OF_LUMPS = {
    "direct_share": {"value": 0.5, "sd": 0.5},
    "base_radiated_share": {"value": 0.2, "sd": 0.2},
    "capacity_ratio": {"value": 0.1, "sd": 0.1},
    "capacity_slope_per_K": {"value": 1e-3, "sd": 1e-3},
}
"""The same of what lumps have besides, where plain lags in series leave slow noise."""
SENSOR, LATENESS = LAG, {"value": 5.0, "sd": 20.0}
"""The sensor of the housing, and what is known of its lag (s) where the resonator is ahead of it."""
WORTH = 10.0
"""Log evidence that one more lag must bring."""
FOLLOWED = 3.0
"""Slow noise within a run over that of a row, up to which no more is asked of a path."""
SURE_SHARE = 3.0
"""Standard deviations from which on a radiated share, or a late sensor, is named; and of the prior, by which a resonator is ahead of its sensor."""


@dataclass(frozen=True)
class HeatPath:
    """A card with lags in series, its fit and log `evidence`, choices paid for; `lead` is that ahead of one lag with other effects."""

    card: Instrument
    fit: CardFit
    evidence: float = 0.0
    lead: float = 0.0

    @property
    def lags(self) -> int:
        """How many there are."""
        law = self.card.polynomial
        assert law is not None
        return len(law.lags)

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
        share, sd = self.value(SHARE)
        return share > SURE_SHARE * sd

    @property
    def is_late(self) -> bool:
        """Whether the sensor of the housing is slow beyond its error."""
        late, sd = self.value(SENSOR) if SENSOR in self.fit.problem.priors.names else (0.0, 1.0)
        return late > SURE_SHARE * sd

    def value(self, name: str) -> tuple[float, float]:
        """Return a value of the card and its standard deviation."""
        priors, count = self.fit.problem.priors, len(self.fit.problem.priors.values)
        slope = priors.slopes(self.fit.point[:count])
        own = slope[priors.names.index(name)]
        sd = float(np.sqrt(own @ self.fit.covariance[:count, :count] @ own))
        return priors.at(self.fit.point[:count])[name], sd


def with_lags(card: Instrument, lags: Sequence[float], lumps: bool, late: bool = False) -> Instrument:
    """Return a polynomial card with such lags (s) in series, and radiation; if `lumps`, with all that lumps have, and a cubic law; a sensor may be `late`."""
    law = dict(card.content["law"])
    law |= {key: {"value": lag, "sd": LAG_WIDTH * lag} for key, lag in zip(LAGS, lags, strict=False)}
    law |= {"radiated_share": dict(RADIATED)} | (OF_LUMPS if lumps else {})
    slope, bend = (law.get(key, {}).get("sd", 0.0) for key in ("a1_per_K", "a2_per_K2"))
    if lumps and slope and bend:
        law["a3_per_K3"] = {"value": 0.0, "sd": bend**2 / slope}
    if late:
        card = card.with_table("noise", card.content["noise"] | {"housing_lag_s": dict(LATENESS)})
    return card.with_table("law", law)


def find_heat_path(
    baseline: CardFit, lags: int | None = None, progress: Callable[[str], None] = lambda _: None
) -> HeatPath:
    """Return the path of so many lags, else the likeliest one by the frequency, each further lag paid for, of a gyro calibrated with one."""
    whole = baseline.problem
    lean = replace(whole, runs=tuple(run.explaining((FREQUENCY,)) for run in whole.runs))
    lag = whole.priors.at(baseline.point[: len(whole.priors.values)])["law.lag_s"]
    best: HeatPath | None = None
    followed = False
    for parts, lumps in PATHS:
        number, own = len(parts), [part * lag for part in parts]
        if lags not in (None, number) or followed:
            continue
        words = f"a heat path with {number} {'lag' if number == 1 else 'lags in series'} and radiation"
        progress(words)
        path = _calibrated(lean, with_lags(whole.instrument, own, lumps))
        if is_ahead(path.fit):
            progress(f"{words}, its sensor late")
            late = _calibrated(lean, with_lags(whole.instrument, own, lumps, True))
            path = max(path, late, key=lambda one: one.evidence)
        if best is None or path.evidence > best.evidence + WORTH * (path.lags - best.lags):
            best = path
            followed = slow_share(path.fit) < FOLLOWED or (
                number == 1 and lags_would_bring(_linearised(path.fit)) < WORTH
            )
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


def evidence_of(found: CardFit) -> float:
    """Log evidence of a calibrated card, no row taken for an outlier."""
    return Background(Linear.of(found).on_all_rows, (), found.noise).evidence


def is_ahead(found: CardFit) -> bool:
    """Whether the resonator is ahead of its sensor, by more than clocks and sensors usually make; without a delay, whether slow noise may be that."""
    priors = found.problem.priors
    if DELAY not in priors.names or FREQUENCY not in found.noise:
        return slow_share(found) > FOLLOWED
    k = priors.names.index(DELAY)
    return bool(priors.standard(found.point[: len(priors.values)])[k] < -SURE_SHARE)


def lags_would_bring(search: Search) -> float:
    """Log evidence that lags of any lengths and shares would bring in a linearised campaign: a heat path of any form, to first order."""
    plain = Hypothesis((), search.noise, 0.0)
    seen = search.scan(plain, search.shapes_of([(any_lags(search.signatures.span), FREQUENCY)]))
    return max((one.gain for one in seen), default=-np.inf)


def slow_share(found: CardFit, name: str = FREQUENCY) -> float:
    """Rms of the slow noise of a response within a usual run over that of a row; 0 where it is not measured."""
    return found.rows[name].slow_share(found.noise[name]) if name in found.noise else 0.0
