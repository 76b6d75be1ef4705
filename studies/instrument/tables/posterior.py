"""`[posterior]`: how the uncertainties of a calibrated card go together, near its values; written by `hrg calibrate --save`."""

from typing import Annotated

from studies.instrument.registry import CardTable
from studies.schema.keys import Keys, Note, number, says

COMPONENTS = "of the components of bias.damping_anisotropy along its axis and across it, which the correlations of length and axis then mean"


class Correlations(Keys, frozen=True, kw_only=True):
    """Correlations of uncertain values."""

    names: Annotated[tuple[str, ...], says("keys of the card with an uncertainty")] = ()
    correlation: Annotated[tuple[tuple[float, ...], ...], says("of their normal coordinates")] = ()
    interval: Annotated[tuple[tuple[float, float], ...], says("90 %, in the unit of each key")] = ()
    anisotropy_sd: Annotated[tuple[float, float] | None, says(COMPONENTS)] = None
    frequency_level_Hz: Annotated[float, number("sd of how far the level of a further run may lie from the card's, as the runs tell it", least=0.0)] = 0.0  # fmt: skip
    bias_level_deg_per_h: Annotated[float, number("likewise", least=0.0)] = 0.0
    covered_degC: Annotated[tuple[float, float] | None, says("temperatures of the records, beyond which [law] is a guess")] = None  # fmt: skip
    unseen: Annotated[tuple[str, ...], says("responses that no record had, of which [law] says nothing")] = ()
    note: Note = ""

    def __post_init__(self) -> None:
        count = len(self.names)
        if len(self.correlation) != count or any(len(row) != count for row in self.correlation):
            raise ValueError(f"correlation must be a square table of {count} by {count} numbers, one for each name.")
        if any(not -1.0 <= rho <= 1.0 for row in self.correlation for rho in row):
            raise ValueError("correlation must hold numbers from -1 to 1.")
        if len(self.interval) not in (0, count):
            raise ValueError(f"interval must be {count} pairs of numbers [low, high], one for each name.")
        for name, (low, high) in self.intervals.items():
            if not low <= high:
                raise ValueError(f"interval of {name} must go from low to high, not from {low:g} to {high:g}.")

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """90 % intervals by name; none where the card does not say them."""
        return dict(zip(self.names, self.interval, strict=False))

    @property
    def pairs(self) -> dict[tuple[str, str], float]:
        """Correlations by pairs of names."""
        return {
            (one, other): self.correlation[i][j]
            for i, one in enumerate(self.names)
            for j, other in enumerate(self.names[:i])
        }


TABLE = CardTable("posterior", Correlations)
