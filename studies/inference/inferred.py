"""What a card and records say together, before it is judged."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from studies.calibration.fit import CardFit
from studies.inference.background import Background
from studies.inference.heat_path import HeatPath
from studies.inference.hypothesis import Hypothesis, Outcome
from studies.inference.lack_of_fit import Leftover
from studies.inference.predicted import Kept, Model, Rows
from studies.inference.records import CLEAR, Campaign, drift_of
from studies.inference.search import Search
from studies.instrument.card import Instrument


@dataclass(frozen=True, repr=False)
class Inferred:
    """What a card and records say together: by response `shipped` rms, `plain` and final `rows`, `left` lack of fit,
    `held_out`, heat `path`.
    """

    card: Instrument
    fit: CardFit
    search: Search
    outcome: Outcome
    left: Mapping[str, Leftover]
    shipped: Mapping[str, float]
    plain: Mapping[str, Rows]
    rows: Mapping[str, Rows]
    held_out: Mapping[str, tuple[float | None, float | None]]
    unknown: tuple[float, ...]
    campaign: Campaign
    path: HeatPath | None = None

    @property
    def final(self) -> Hypothesis:
        """The model with the named effects."""
        return self.outcome.final

    @cached_property
    def clock(self) -> tuple[float, float] | None:
        """Drift of the gyro's clock against a reference, Hz a day, with its standard deviation; None without one."""
        return drift_of(self.campaign.records)

    @property
    def clock_drifts(self) -> bool | None:
        """Whether the gyro's clock drifts against a reference; None without one."""
        return None if self.clock is None else abs(self.clock[0]) > CLEAR * self.clock[1]

    @cached_property
    def background(self) -> Background:
        """The final model, solved."""
        return Background(self.search.linear, self.final.terms, self.final.noise)

    @cached_property
    def model(self) -> Model:
        """The final model on the records' rows."""
        return Model(self.search.linear, self.search.signatures, self.final.terms, self.final.noise)

    @cached_property
    def numbers(self) -> Kept:
        """Its most probable numbers."""
        return self.model.numbers or self.model.kept(self.background.posterior[0])
