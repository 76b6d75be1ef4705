"""Limits of an acceptance test.

schema = "hrg.limits/1"
[limits]                                    # any of the quantities that hrg acceptance lists
angle_random_walk_deg_per_rt_h = 0.01       # at most, in size; run_down_time_s and quality_factor: at least
bias_deg_per_h = 5.0
[warm_up]                                   # may be left out
band_deg_per_h = 1.0                        # about the final output; three times the scatter of its means unless given
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from studies.acceptance.quantities import BY_KEY
from studies.errors import InputError
from studies.files.toml import TomlTable, read_toml

SCHEMA = "hrg.limits/1"


@dataclass(frozen=True)
class Limits:
    """Limits by quantity, in its unit; the band of the warm-up (deg/h)."""

    limits: Mapping[str, float] = field(default_factory=dict)
    warm_up_band: float | None = None
    path: str = ""


def read_limits(path: str | Path) -> Limits:
    """Read a file of limits.

    Raises
    ------
    InputError
        A quantity that no acceptance test has, or a limit that is not a positive number.
    """
    top = TomlTable(read_toml(path, SCHEMA), str(path), ("schema", "limits", "warm_up"))
    section = top.section("limits", BY_KEY)
    limits = {key: section.number(key, above=0.0) for key in section.values}
    if not limits:
        raise InputError(f"{path} [limits]: no limit is given; add one, such as bias_deg_per_h = 5.0.")
    band = None
    if "warm_up" in top:
        band = top.section("warm_up", ("band_deg_per_h",)).number("band_deg_per_h", above=0.0)
    return Limits(limits, band, str(path))
