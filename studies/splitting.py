"""The split of an instrument's pairs: what its imperfection and its electrodes make of them."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from shell.imperfection import CoupledHarmonics, Pair, Split, find_split
from studies.errors import naming

if TYPE_CHECKING:
    from shell.imperfection import Imperfection
    from shell.modes import Mode
    from studies.instrument.card import Instrument
    from studies.instrument.tables.electrodes import CardElectrodes
    from studies.instrument.tables.imperfection import CardImperfection


def is_imperfect(instrument: "Instrument") -> bool:
    """Whether the card says anything that could split a pair."""
    card: CardImperfection = instrument.part("imperfection")
    electrodes: CardElectrodes = instrument.part("electrodes")
    return card.fields is not None or card.split is not None or electrodes.are_charged


@dataclass(frozen=True)
class SplitPair:
    """A pair of an instrument at a temperature, split by all that its card says.

    imperfection, measured, electrodes : the parts; they add.
    """

    instrument: "Instrument"
    mode: "Mode"
    temperature: float

    @cached_property
    def pair(self) -> Pair:
        """The perfect pair."""
        return Pair(self.mode)

    @cached_property
    def imperfection(self) -> Split:
        """By the fields and masses of [imperfection], to first order."""
        with naming(f"{self.instrument.path} [imperfection]"):
            return find_split(self.pair, self._fields) if self._fields is not None else self._nothing

    @cached_property
    def measured(self) -> Split:
        """By [imperfection.split]: it keeps its share of f over temperature."""
        card: CardImperfection = self.instrument.part("imperfection")
        if card.split is None or card.split.harmonic != self.mode.harmonic:
            return self._nothing
        n = self.mode.harmonic
        wave = -card.split.hertz / self.mode.frequency * np.exp(2j * n * card.split.slow_axis)
        return Split(n, self.mode.frequency, 0.0, complex(wave))

    @cached_property
    def electrodes(self) -> Split:
        """By the voltages of [electrodes]."""
        card: CardElectrodes = self.instrument.part("electrodes")
        if not card.are_charged:
            return self._nothing
        with naming(f"{self.instrument.path} [electrodes]"):
            return card.on(self.pair, self.temperature).soften()

    @property
    def split(self) -> Split:
        """All of it, to first order."""
        parts = (self.imperfection, self.measured, self.electrodes)
        shift, wave = sum(p.shift for p in parts), sum(p.wave for p in parts)
        return Split(self.mode.harmonic, self.mode.frequency, float(shift), complex(wave))

    def of_every_order(self) -> Split:
        """The same with the fields and masses acting in every order, harmonics n ± m taking part."""
        if self._fields is None:
            return self.split
        _, elastic = self.instrument.at(self.temperature)
        with naming(f"{self.instrument.path} [imperfection]"):
            own = CoupledHarmonics(self.mode, elastic).solve(self._fields)
        rest = (self.measured, self.electrodes)
        shift, wave = own.shift + sum(p.shift for p in rest), own.wave + sum(p.wave for p in rest)
        return Split(self.mode.harmonic, self.mode.frequency, float(shift), complex(wave))

    @property
    def _fields(self) -> "Imperfection | None":
        card: CardImperfection = self.instrument.part("imperfection")
        return card.fields

    @property
    def _nothing(self) -> Split:
        return Split(self.mode.harmonic, self.mode.frequency, 0.0, 0j)
