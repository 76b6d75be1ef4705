"""A heat path longer than one lag, of a gyro without a card: lags in series, part of whose heat is radiated, as a card of its own."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from studies.calibration.fit import CardFit, fit
from studies.calibration.priors import gather_priors
from studies.calibration.problem import CardProblem
from studies.inference.model import PRICE, Background, Linear
from studies.instrument.card import Instrument

Array = NDArray[np.float64]
FREQUENCY = "frequency_Hz"
LAGS = ("lag_s", "second_lag_s", "third_lag_s")
SHARE = "law.radiated_share"
PARTS = ((1.0,), (0.7, 0.3), (0.65, 0.3, 0.05))
"""Lags in series over the one lag that stood for them, where their priors are centred."""
LAG_WIDTH = 0.7
"""Standard deviation of the logarithm of each."""
RADIATED = {"value": 0.2, "sd": 0.2}
"""What is known of the radiated share."""
WORTH = 10.0
"""Log evidence that one more lag must bring."""

SURE_SHARE = 3.0
"""Standard deviations from which on a radiated share is named."""


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
        """Log prior of the choice: one for each lag beyond the first, and one for radiation."""
        return PRICE * self.lags

    @property
    def radiates(self) -> bool:
        """Whether the share is above 0 beyond its error."""
        share, sd = self.value(SHARE)
        return share > SURE_SHARE * sd

    def value(self, name: str) -> tuple[float, float]:
        """Return a value of the card and its standard deviation."""
        priors, count = self.fit.problem.priors, len(self.fit.problem.priors.values)
        slope = priors.slopes(self.fit.point[:count])
        own = slope[priors.names.index(name)]
        sd = float(np.sqrt(own @ self.fit.covariance[:count, :count] @ own))
        return priors.at(self.fit.point[:count])[name], sd


def with_lags(card: Instrument, lag: float, lags: int) -> Instrument:
    """Return a polynomial card with so many lags in series where one of `lag` s stood, and a radiated share."""
    given = {
        key: {"value": part * lag, "sd": LAG_WIDTH * part * lag}
        for key, part in zip(LAGS, PARTS[lags - 1], strict=False)
    }
    return card.with_table("law", {**card.content["law"], **given, "radiated_share": dict(RADIATED)})


def find_heat_path(
    baseline: CardFit, lags: int | None = None, progress: Callable[[str], None] = lambda _: None
) -> HeatPath:
    """Return the path of so many lags, else the likeliest one by the frequency, each further lag paid for, of a gyro calibrated with one."""
    whole = baseline.problem
    lean = replace(whole, runs=tuple(run.explaining((FREQUENCY,)) for run in whole.runs))
    lag = whole.priors.at(baseline.point[: len(whole.priors.values)])["law.lag_s"]
    best: HeatPath | None = None
    for number in (lags,) if lags else range(1, len(LAGS) + 1):
        progress(f"a heat path with {number} {'lag' if number == 1 else 'lags in series'} and radiation")
        path = _calibrated(lean, with_lags(whole.instrument, lag, number))
        if best is None or path.evidence > best.evidence + WORTH:
            best = path
        elif number > 2:
            break
    assert best is not None
    if whole.responses == lean.responses or not (best.lags > 1 or best.radiates):
        return best
    progress("the other responses beside it")
    return _calibrated(whole, best.card, best.fit.point if whole.starts == lean.starts else None)


def _calibrated(problem: CardProblem, card: Instrument, start: Array | None = None) -> HeatPath:
    path = HeatPath(card, fit(replace(problem, instrument=card, priors=gather_priors(card)), start))
    return replace(path, evidence=evidence_of(path.fit) + path.price)


def evidence_of(found: CardFit) -> float:
    """Log evidence of a calibrated card, no row taken for an outlier."""
    return Background(Linear.of(found).on_all_rows, (), found.noise).evidence


def slow_share(found: CardFit, name: str = FREQUENCY) -> float:
    """Rms of the slow noise of a response within a usual run over that of a row; 0 where it is not measured."""
    return found.rows[name].slow_share(found.noise[name]) if name in found.noise else 0.0


def residual_of(found: CardFit, name: str = FREQUENCY) -> float:
    """Rms of what a calibration leaves of a response that is measured."""
    return float(np.sqrt(np.mean(found.state.residual[name] ** 2)))
