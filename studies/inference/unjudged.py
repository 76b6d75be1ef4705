"""Records that say too little: every response is listed with why it is not judged."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from studies.diagnosis.seen import SeenResponse
from studies.diagnosis.verdict import Verdict, overall
from studies.inference.records import Campaign
from studies.inference.verdict import skipped_results
from studies.results.shown import Shown

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True, repr=False)
class Unjudged(Shown):
    """A campaign without a response that can be fitted."""

    drawn_by = "studies.reports.diagnosis_pictures:ladder"

    campaign: Campaign
    with_card: bool

    def __repr__(self) -> str:
        return f"Diagnosis({self.verdict})"

    def to_frame(self) -> "DataFrame":
        """Return one row a response."""
        return self.verdict.to_frame()

    @cached_property
    def verdict(self) -> Verdict:
        """The outcome of the contract."""
        results = skipped_results(self.campaign)
        return Verdict(overall([one.verdict for one in results.values()]), (), results, None, self.campaign.notes)

    @property
    def labels(self) -> list[str]:
        """Names of the records."""
        return list(self.campaign.paths)

    @property
    def shown_responses(self) -> list[str]:
        """Responses that were fitted: none."""
        return []

    def seen(self, response: str) -> SeenResponse:
        """Return what pages show of a response: there is none."""
        raise KeyError(response)
