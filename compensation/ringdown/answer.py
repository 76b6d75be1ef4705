"""What any ring-down gives, of phased amplitudes, a trace without phase, or a spectrum: values with intervals, and curves to draw."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import exp

from compensation.arrays import Array
from compensation.constants import NINETY


@dataclass(frozen=True)
class Estimate:
    """A value with the standard deviation that the bound allows, and its 90 % interval; NaN where nothing determines it."""

    value: float
    sd: float
    low: float
    high: float

    @classmethod
    def normal(cls, value: float, sd: float, reach: float = NINETY) -> "Estimate":
        """Of a normal distribution."""
        return cls(value, sd, value - reach * sd, value + reach * sd)

    @classmethod
    def relative(cls, value: float, sd: float) -> "Estimate":
        """Of a normal distribution of the logarithm."""
        return cls(value, value * sd, value * exp(-NINETY * sd), value * exp(NINETY * sd))

    def over(self, unit: float) -> "Estimate":
        """In another unit."""
        return Estimate(self.value / unit, self.sd / unit, self.low / unit, self.high / unit)


@dataclass(frozen=True)
class Curve:
    """One channel over time (s) or frequency (Hz): level and fitted level (dB), and the residual."""

    x: Array
    level: Array
    fitted: Array
    residual: Array


@dataclass(frozen=True)
class RingDown:
    """Results of one decay or spectrum."""

    # `frequency_1_Hz` (the higher), `frequency_2_Hz`, `q_1`, `q_2`, `frequency_Hz`, `inverse_q`, `decay_time_s` (of a trace
    # `decay_per_s`); of two channels `split_Hz`, `frequency_axis_deg`, `damping_split_per_s`, `damping_axis_deg`; where they are seen
    # `hardening_Hz`, and `thickening_per_s`, at the first amplitude
    estimates: Mapping[str, Estimate]
    remarks: tuple[str, ...]  # what is not as it should be, a sentence each
    noise: tuple[float, ...]  # standard deviation of a row of each channel; of a spectrum the relative scatter
    widening: float  # standard deviations over the Cramér–Rao bound of white noise; of a spectrum its misfit
    curves: tuple[Curve, ...]
    window: tuple[float, float] | None = None  # seconds of the record that are free decay above the noise
    interference: tuple[float, ...] = ()  # Hz, of lines that are no decay
