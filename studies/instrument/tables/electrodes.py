"""`[electrodes]`: electrodes over a face of the shell, their gap and voltages."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np

from studies.instrument.registry import CardTable
from studies.schema.keys import Keys, Note, number, says

if TYPE_CHECKING:
    from shell.electrodes import Electrodes
    from shell.imperfection import Pair


class GapWave(Keys, frozen=True, kw_only=True):
    """A wave of the gap around."""

    order: Annotated[int, number("crests around", least=1, most=40)]
    amplitude_percent: Annotated[float, number("of the gap", above=-100.0, below=100.0, example=2.0)]
    azimuth_deg: Annotated[float, number("of a crest")] = 0.0


class ElectrodeKeys(Keys, frozen=True, kw_only=True):
    """Equal electrodes around a face."""

    face: Annotated[
        Literal["inner", "outer"], says("of the shell; inner: towards the axis, of a flat disc the lower one")
    ] = "inner"
    gap_um: Annotated[float, number("at the reference temperature", above=0.0, relative_sd=0.05)] = 100.0
    count: Annotated[int, number("equal electrodes around", least=1, most=256)] = 16
    coverage: Annotated[float, number("share of the circle", above=0.0, most=1.0)] = 0.8
    azimuth_deg: Annotated[float, number("of the middle of the first one")] = 0.0
    first: Annotated[float, number("they begin at this position of the meridian", least=0.0, below=1.0)] = 0.6
    last: Annotated[float, number("and end at this one; 1: rim", above=0.0, most=1.0)] = 1.0
    voltage_V: Annotated[float, number("of all; 0: none")] = 0.0
    trim_V: Annotated[
        tuple[float, ...],
        says("added in squares: what each has besides, in order; 0 where the list ends", example=[0.0, 30.0]),
    ] = ()
    resistance_ohm: Annotated[float, number("in series with each electrode (film, lead, source): bias currents damp", above=0.0, example=1e4)] | None = None  # fmt: skip
    gap_expansion_per_K: Annotated[float, number("(1/g) dg/dT")] = 0.0
    gap_wave: tuple[GapWave, ...] = ()
    note: Note = ""

    def __post_init__(self) -> None:
        if not self.first < self.last:
            raise ValueError(f"first must be below last, not {self.first:g} and {self.last:g}.")
        if len(self.trim_V) > self.count:
            raise ValueError(f"trim_V has {len(self.trim_V)} voltages for {self.count} electrodes.")


@dataclass(frozen=True)
class CardElectrodes:
    """Electrodes of a card; they act on a mode once it is solved."""

    keys: ElectrodeKeys
    reference_temperature: float

    @property
    def are_charged(self) -> bool:
        """Whether any electrode has a voltage."""
        return bool(self.keys.voltage_V or any(self.keys.trim_V))

    def on(self, pair: "Pair", temperature: float) -> "Electrodes":
        """Return them over a mode's face at a temperature (K)."""
        from shell.electrodes import Electrodes, ring_of_electrodes
        from shell.imperfection import Field, wave

        k = self.keys
        trims = np.zeros(k.count)
        trims[: len(k.trim_V)] = k.trim_V
        volts = np.sqrt(k.voltage_V**2 + trims**2)
        patches = ring_of_electrodes(k.count, k.coverage, volts.tolist(), np.deg2rad(k.azimuth_deg), k.first, k.last)
        gap = 1e-6 * k.gap_um * (1 + k.gap_expansion_per_K * (temperature - self.reference_temperature))
        waves = (wave(w.order, w.amplitude_percent / 100, np.deg2rad(w.azimuth_deg)) for w in k.gap_wave)
        return Electrodes(pair, patches, gap, sum(waves, Field()), k.face)


TABLE = CardTable(
    "electrodes",
    ElectrodeKeys,
    build=lambda keys, place: CardElectrodes(keys, place.reference_temperature),
    optional=True,
)
