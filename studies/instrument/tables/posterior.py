"""`[posterior]`: how the uncertainties of a calibrated card go together; written by `hrg calibrate --save`.

[posterior]
names = ["thermal.mount_conductance_W_per_K", "thermal.base_heat_capacity_J_per_K"]   # keys of the card with an uncertainty
correlation = [[1.0, 0.9], [0.9, 1.0]]                                                # of their normal coordinates
interval = [[0.0101, 0.0123], [0.24, 0.31]]                                           # 90 %, in the unit of each key

A value's own sd and the correlations hold together near the most probable card: they are what a prediction's spread follows from.
Where the likelihood is bent the interval is not symmetric about the value, and may be many times as wide as that sd.
"""

from studies.instrument.registry import CardTable
from studies.schema.keys import Keys


class Correlations(Keys, frozen=True, kw_only=True):
    """Correlations of uncertain values."""

    names: tuple[str, ...] = ()
    correlation: tuple[tuple[float, ...], ...] = ()
    interval: tuple[tuple[float, float], ...] = ()
    note: str = ""

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
                raise ValueError(
                    f"interval of {name} must go from a lower to a higher number, not from {low:g} to {high:g}."
                )

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
