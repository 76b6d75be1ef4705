"""`[noise]`: what a virtual record is read with, as levels that are read off an Allan deviation; 0 switches a noise off."""

from typing import Annotated

from studies.instrument.registry import CardTable
from studies.schema.keys import Keys, Note, number, says

Level = Annotated[float, number(least=0.0)]


class NoiseKeys(Keys, frozen=True, kw_only=True):
    """Noise levels, the housing sensor's lag, and the rounding of the record."""

    frequency_white_Hz: Annotated[Level, says("Allan deviation at 1 s")] = 2e-3
    frequency_flicker_Hz: Annotated[Level, says("flat part of the Allan deviation")] = 2e-4
    frequency_walk_Hz: Annotated[Level, says("random walk: standard deviation of the change in 1 s")] = 1e-5
    frequency_markov_Hz: Annotated[Level, says("rms of correlated (Gauss–Markov) noise, IEEE Std 952")] = 0.0
    frequency_markov_s: Annotated[float, number("its correlation time", above=0.0)] = 300.0
    bias_white_deg_per_rt_h: Annotated[Level, says("angle random walk")] = 0.02
    bias_flicker_deg_per_h: Annotated[Level, says("flat Allan deviation (0.664 of the bias instability)")] = 0.1
    bias_walk_deg_per_h_per_rt_h: Annotated[Level, says("rate random walk: sd of the change in 1 h")] = 0.01
    bias_turn_on_deg_per_h: Annotated[Level, says("sd of the offset from run to run; 0: not specified")] = 0.0
    bias_markov_deg_per_h: Annotated[Level, says("rms of correlated (Gauss–Markov) noise")] = 0.0
    bias_markov_s: Annotated[float, number("its correlation time", above=0.0)] = 300.0
    inverse_q_white: Annotated[Level, says("relative, Allan deviation at 1 s")] = 0.01
    pattern_angle_white_deg: Annotated[Level, says("of a measured azimuth (whole angle), Allan deviation at 1 s; it also walks as the bias does")] = 3e-5  # fmt: skip
    quadrature_white_V: Annotated[Level, says("Allan deviation at 1 s, of a card with loops")] = 1e-4
    housing_white_K: Annotated[Level, says("of the housing sensor, Allan deviation at 1 s")] = 5e-3
    housing_lag_s: Annotated[float, number("of the housing sensor", least=0.0, relative_sd=0.5)] = 10.0
    frequency_resolution_Hz: Annotated[Level, says("rounding of what is recorded; 0 keeps every digit")] = 0.0
    bias_resolution_deg_per_h: Annotated[Level, says("likewise")] = 0.0
    housing_resolution_degC: Annotated[Level, says("likewise")] = 0.0
    note: Note = ""


SILENT = NoiseKeys(**{key: 0.0 for key in NoiseKeys.__struct_fields__ if key != "note"})  # type: ignore[arg-type]
"""No noise, no lag, no rounding."""

TABLE = CardTable("noise", NoiseKeys)
