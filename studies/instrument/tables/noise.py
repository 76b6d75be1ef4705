"""`[noise]`: what a virtual record is read with, as levels that are read off an Allan deviation.

[noise]                              # every key may be left out; a level of 0 switches that noise off
frequency_white_Hz = 2e-3            # Allan deviation at 1 s
frequency_flicker_Hz = 2e-4          # flat part of the Allan deviation
frequency_walk_Hz = 1e-5             # random walk: standard deviation of the change in 1 s
bias_white_deg_per_rt_h = 0.02       # angle random walk
bias_flicker_deg_per_h = 0.1         # flat part of the Allan deviation (0.664 of the bias instability)
bias_walk_deg_per_h_per_rt_h = 0.01  # rate random walk: standard deviation of the change in 1 h
bias_turn_on_deg_per_h = 0.0         # standard deviation of the offset that each run has of its own; 0: nothing is said of it
inverse_q_white = 0.01               # relative, Allan deviation at 1 s
pattern_angle_white_deg = 3e-5       # of a measured azimuth (whole angle), Allan deviation at 1 s; it walks besides as the bias does
quadrature_white_V = 1e-4            # Allan deviation at 1 s, of a card with loops
housing_white_K = 5e-3               # of the housing sensor, Allan deviation at 1 s
housing_lag_s = 10.0                 # of the housing sensor; known to ± 50 % unless stated
frequency_resolution_Hz = 0.0        # rounding of what is recorded; 0 keeps every digit
bias_resolution_deg_per_h = 0.0
housing_resolution_degC = 0.0
"""

from typing import Annotated

from studies.instrument.registry import CardTable
from studies.schema.keys import Keys, number

Level = Annotated[float, number(least=0.0)]


class NoiseKeys(Keys, frozen=True, kw_only=True):
    """Noise levels, the housing sensor's lag, and the rounding of the record."""

    frequency_white_Hz: Level = 2e-3
    frequency_flicker_Hz: Level = 2e-4
    frequency_walk_Hz: Level = 1e-5
    bias_white_deg_per_rt_h: Level = 0.02
    bias_flicker_deg_per_h: Level = 0.1
    bias_walk_deg_per_h_per_rt_h: Level = 0.01
    bias_turn_on_deg_per_h: Level = 0.0
    inverse_q_white: Level = 0.01
    pattern_angle_white_deg: Level = 3e-5
    quadrature_white_V: Level = 1e-4
    housing_white_K: Level = 5e-3
    housing_lag_s: Annotated[float, number(least=0.0, relative_sd=0.5)] = 10.0
    frequency_resolution_Hz: Level = 0.0
    bias_resolution_deg_per_h: Level = 0.0
    housing_resolution_degC: Level = 0.0
    note: str = ""


SILENT = NoiseKeys(**{key: 0.0 for key in NoiseKeys.__struct_fields__ if key != "note"})  # type: ignore[arg-type]
"""No noise, no lag, no rounding."""

TABLE = CardTable("noise", NoiseKeys)
