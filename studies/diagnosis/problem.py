"""One response of a campaign on the coarse grid: its rows, its noise models, and what the campaign covers."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from compensation.noise import white_rms
from studies.diagnosis.campaign import Campaign
from studies.diagnosis.noise import NoiseModels
from studies.diagnosis.response import RESPONSES, Response
from studies.effects import Effect, Span
from studies.effects.states import FloatArray


@dataclass(frozen=True)
class Problem:
    """The rows of one response on the coarse grid.

    Attributes
    ----------
    response : Response
    present : tuple of bool arrays
        Which steps of the grid have the response, run by run.
    values : (M,) array
        The present values, stacked.
    noise : NoiseModels
    sigma : float
        White noise of a step of the grid, from second differences: no slow effect reaches it.
    level : float
        Level of the response, in parts of which sizes count; 1 where they count in its unit.
    group : int
        Fine samples to a step.
    span : Span
    """

    response: Response
    present: tuple["np.ndarray", ...]
    values: FloatArray
    noise: NoiseModels
    sigma: float
    level: float
    group: int
    span: Span

    def stack(self, parts: Sequence[FloatArray]) -> FloatArray:
        """Stack the present rows of arrays given run by run."""
        return np.concatenate([part[mask] for part, mask in zip(parts, self.present, strict=True)])

    def size(self, effect: Effect) -> float:
        """Strong cases of an effect in this response, in the unit of its first coefficient."""
        own = effect.sizes[self.response.column]
        return own * self.level if self.response.relative and not effect.thermal else own

    @property
    def run(self) -> "np.ndarray":
        """Number of the run of every stacked row."""
        return np.repeat(np.arange(len(self.present)), [int(mask.sum()) for mask in self.present])

    def split(self, rows: FloatArray) -> list[FloatArray]:
        """Return stacked rows run by run, the present ones only."""
        return np.split(rows, np.cumsum([int(mask.sum()) for mask in self.present])[:-1])

    def unstack(self, rows: FloatArray) -> list[FloatArray]:
        """Return stacked rows run by run; missing ones are NaN."""
        out = []
        for mask, part in zip(self.present, self.split(rows), strict=True):
            own = np.full(mask.shape, np.nan)
            own[mask] = part
            out.append(own)
        return out


def pose(campaign: Campaign, column: str, tau: float, keep: Sequence["np.ndarray"] | None = None) -> Problem:
    """Set up the rows of one response; `keep` restricts them."""
    response = RESPONSES[column]
    present = [np.isfinite(run.responses[column]) for run in campaign.runs]
    if keep is not None:
        present = [mask & own for mask, own in zip(present, keep, strict=True)]
    values = np.concatenate([run.responses[column][m] for run, m in zip(campaign.runs, present, strict=True)])
    times = [run.time[m] for run, m in zip(campaign.runs, present, strict=True) if m.any()]
    rows = sum(int(np.isfinite(run.row_responses[column]).sum()) for run in campaign.runs)
    steps = sum(int(np.isfinite(run.responses[column]).sum()) for run in campaign.runs)
    level = abs(float(np.median(values))) if response.relative else 1.0
    return Problem(
        response,
        tuple(present),
        values,
        NoiseModels.of(times, max(rows / max(steps, 1), 1.0), campaign.step),
        white_level(campaign, column),
        level,
        campaign.group,
        span_of(campaign, tau),
    )


def white_level(campaign: Campaign, column: str) -> float:
    """Return the white noise of a step of the grid, from second differences."""
    parts = [run.responses[column] for run in campaign.runs]
    if (level := white_rms(*parts)) > 0.0:
        return level
    values = np.concatenate(parts)
    return max(1e-9 * float(np.nanmax(np.abs(values))), 1e-300)


def span_of(campaign: Campaign, tau: float) -> Span:
    """Return what a campaign covers."""
    housing = np.concatenate([run.states.housing for run in campaign.runs])
    starts = [run.states.campaign_time for run in campaign.runs]
    angles = [run.states.pattern_angle for run in campaign.runs]
    known = [angle for angle in angles if angle is not None]
    turns = bool(known) and len(known) == len(angles) and float(np.ptp(np.concatenate(known))) > 1e-3
    return Span(
        float(np.percentile(housing, 0.5)),
        float(np.percentile(housing, 99.5)),
        max(float(np.ptp(run.states.time)) for run in campaign.runs),
        max(float(t[-1]) for t in starts) - min(float(t[0]) for t in starts),
        campaign.step,
        tau,
        len(campaign.runs),
        tuple(run.time for run in campaign.runs),
        turns,
        campaign.timed,
    )
