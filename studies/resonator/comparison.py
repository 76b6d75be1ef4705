"""Designs side by side: what differs in their cards, and what that does to modes, slope, settling and loss."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from studies.errors import InputError, naming
from studies.instrument.settings import Setting, settings_of
from studies.progress import told
from studies.resonator.law import law_of
from studies.results.shown import Shown

if TYPE_CHECKING:
    from pandas import DataFrame

    from studies.instrument.card import Instrument

HARMONICS = (0, 1, 2, 3)
DRIVE = 2


@dataclass(frozen=True)
class Figure:
    """One quantity of one design: value and standard uncertainty, in `unit`; NaN where there is none."""

    name: str
    unit: str
    value: float
    uncertainty: float
    of: str = ""  # what it is a quantity of, where designs differ in that


@dataclass(frozen=True, repr=False)
class Comparison(Shown):
    """Designs and their figures, in one order; `differing` the keys of cards whose settings are not the same in all."""

    names: tuple[str, ...]
    figures: tuple[tuple[Figure, ...], ...]
    differing: Mapping[str, tuple[Setting, ...]]

    def __repr__(self) -> str:
        return f"Comparison({', '.join(self.names)}: {len(self.figures)} quantities, {len(self.differing)} keys differ)"

    def to_frame(self) -> "DataFrame":
        """Return one row a quantity, one column a design; uncertainties stand in columns of their own."""
        import pandas as pd

        rows = [
            {"quantity": row[0].name, "unit": row[0].unit}
            | {name: one.value for name, one in zip(self.names, row, strict=True)}
            | {f"± {name}": one.uncertainty for name, one in zip(self.names, row, strict=True)}
            for row in self.figures
        ]
        return pd.DataFrame(rows).set_index("quantity")


def compare(instruments: "Sequence[Instrument]") -> Comparison:
    """Compute the figures of designs and find the keys in which their cards differ."""
    known = [settings_of(one) for one in instruments]
    names = dict.fromkeys(name for one in known for name in one)
    differing = {name: tuple(one.get(name, Setting()) for one in known) for name in names}
    return Comparison(
        tuple(one.name for one in instruments),
        tuple(zip(*(tuple(_figures(one)) for one in told(instruments, "designs")), strict=True)),
        {key: row for key, row in differing.items() if any(one.counts != row[0].counts for one in row)},
    )


def _figures(instrument: "Instrument") -> Iterator[Figure]:
    from shell.law import mode_uncertainty
    from shell.modes import nearest_mode, solve_modes
    from studies.simulation.heat_path import behind_housing, build_network, slowest_lag

    T0, nothing = instrument.reference_temperature, float("nan")
    with naming(instrument.path):
        lowest = {n: solve_modes(*instrument.at(T0), n)[0] for n in HARMONICS}
        nearest = nearest_mode(lambda n, count: solve_modes(*instrument.at(T0), n, count), lowest[DRIVE])
        law = law_of(instrument, T0 - 1.0, T0 + 1.0)
    drive = lowest[DRIVE]
    for n, mode in lowest.items():
        own = mode.frequency * mode_uncertainty(mode, law.material, T0, T0)
        yield Figure(f"frequency, n = {n}", "Hz", mode.frequency, own)
    of = f"n = {nearest.harmonic}, index {nearest.index}"
    yield Figure("nearest other mode", "Hz", nearest.frequency - drive.frequency, nothing, of)
    yield Figure("Bryan factor", "1", drive.bryan_factor, nothing)
    yield Figure("modal mass", "g", 1e3 * drive.modal_mass, nothing)
    mean = float(np.mean([h for _, h in instrument.resonator.thickness]))
    per_micrometre = drive.frequency * drive.sensitivities.thickness / mean * 1e-6
    yield Figure("frequency per thickness", "Hz/µm", per_micrometre, nothing)
    at, known = np.array([T0]), not instrument.material.constant
    slope = (float(law.slope(at)[0]), float(law.slope_uncertainty(at)[0])) if known else (nothing, nothing)
    yield Figure("slope", "ppm/°C", 1e6 * slope[0], 1e6 * slope[1])
    try:
        lag = slowest_lag(behind_housing(build_network(instrument)), T0)
    except InputError:  # no source states the material's heat capacity or conductivity
        lag = nothing
    yield Figure("lag behind the housing", "s", lag, nothing)
