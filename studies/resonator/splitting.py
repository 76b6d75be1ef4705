"""The split of an instrument's pairs: what its imperfection and its electrodes make of them."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from compensation.arrays import Array
from shell.elastic import Elastic
from shell.imperfection import CoupledHarmonics, Imperfection, Pair, Split, find_split
from shell.imperfection.split import shift_of
from shell.layout import Theory
from shell.modes import Mode, solve_modes
from shell.resonator import Resonator
from studies.errors import InputError, naming
from studies.instrument.card import Card, Instrument, load_card
from studies.instrument.tables.electrodes import CardElectrodes
from studies.instrument.tables.imperfection import CardImperfection

PLACES = 65  # along the meridian, where waves are held against the wall


@dataclass(frozen=True)
class SplitPair:
    """A pair of an instrument at a temperature, split by all that its card says, in parts that add."""

    instrument: Instrument
    mode: Mode
    temperature: float
    known: Pair | None = None  # the pair, if it has been made before

    @cached_property
    def pair(self) -> Pair:
        """The perfect pair."""
        return self.known or Pair(self.mode)

    @cached_property
    def imperfection(self) -> Split:
        """By the fields and masses of [imperfection], to first order."""
        with naming(f"{self.instrument.path} [imperfection]"):
            return find_split(self.pair, self._fields) if self._fields is not None else self._sum()

    @cached_property
    def measured(self) -> Split:
        """By [imperfection.split]: it keeps its share of f over temperature."""
        card: CardImperfection = self.instrument.part("imperfection")
        if card.split is None or card.split.harmonic != self.mode.harmonic:
            return self._sum()
        n = self.mode.harmonic
        wave = -card.split.split_Hz / self.mode.frequency * np.exp(2j * n * np.deg2rad(card.split.slow_axis_deg))
        return Split(n, self.mode.frequency, 0.0, complex(wave))

    @cached_property
    def electrodes(self) -> Split:
        """By the voltages of [electrodes]."""
        card: CardElectrodes = self.instrument.part("electrodes")
        if not card.are_charged:
            return self._sum()
        with naming(f"{self.instrument.path} [electrodes]"):
            return card.on(self.pair, self.temperature).soften()

    @property
    def split(self) -> Split:
        """All of it, the imperfection to first order."""
        return self._sum(self.imperfection, self.measured, self.electrodes)

    def of_every_order(self) -> Split:
        """The same with the fields and masses acting in every order, harmonics n ± m taking part."""
        if self._fields is None:
            return self.split
        _, elastic = self.instrument.at(self.temperature)
        with naming(f"{self.instrument.path} [imperfection]"):
            own = _coupled(self.mode, self.mode.resonator, elastic).solve(self._fields)
        return self._sum(own, self.measured, self.electrodes)

    @property
    def _fields(self) -> Imperfection | None:
        card: CardImperfection = self.instrument.part("imperfection")
        if card.fields is not None:
            _check_wall(self.instrument, card.fields)
        return card.fields

    def _sum(self, *parts: Split) -> Split:
        mean, z = sum(p.squares[0] for p in parts), sum(p.squares[1] for p in parts)
        return Split.of_squares(self.mode.harmonic, self.mode.frequency, float(mean), complex(z))


def _check_wall(instrument: Instrument, fields: Imperfection) -> None:
    """Refuse waves of the wall that would go through it."""
    position, wall = zip(*instrument.resonator.thickness, strict=True)
    at = np.linspace(0.0, 1.0, PLACES)
    faces = fields.faces()
    orders = {m for face in faces for m in face.orders if m > 0}
    deep = sum((np.abs(sum(face.wave(m, at) for face in faces)) for m in orders), np.zeros_like(at))
    wall_there = np.interp(at, position, wall)
    worst = int(np.argmax(deep / wall_there))
    if deep[worst] >= wall_there[worst]:
        raise InputError(
            f"{instrument.path} [imperfection]: the wall's waves have {1e6 * deep[worst]:.4g} µm where the wall has"
            f" {1e6 * wall_there[worst]:.4g} µm; their amplitudes must be smaller than the wall."
        )


@lru_cache(maxsize=8)
def solve_lowest(resonator: Resonator, elastic: Elastic, harmonic: int, theory: Theory) -> Mode:
    """The lowest mode; kept, since many values of a card leave it as it is."""
    return solve_modes(resonator, elastic, harmonic, theory=theory)[0]


@lru_cache(maxsize=8)
def solved_pair(resonator: Resonator, elastic: Elastic, harmonic: int) -> Pair:
    """The perfect pair of a harmonic, solved once."""
    return Pair(solve_lowest(resonator, elastic, harmonic, "solid"))


@lru_cache(maxsize=4)
def _coupled(mode: Mode, resonator: Resonator, elastic: Elastic) -> CoupledHarmonics:
    """The coupled harmonics of a pair, prepared once for all imperfections of one perfect resonator."""
    return CoupledHarmonics(mode, elastic)


@lru_cache(maxsize=64)
def _softening(pair: Pair, electrodes: CardElectrodes) -> tuple[float, float]:
    """Mean δ(ω²)/ω² by the card's own voltages, and per V² on all of the electrodes together, at the reference temperature."""
    charged = electrodes.on(pair, electrodes.reference_temperature)
    charged.soften()  # refuses voltages that pull in the shell
    return charged.mean, float(charged.per_square_volt[0].sum())


def reference_split(card: Card, harmonic: int = 2) -> SplitPair:
    """The pair of a harmonic at the card's reference temperature."""
    instrument = load_card(card)
    resonator, elastic = instrument.at(instrument.reference_temperature)
    pair = solved_pair(resonator, elastic, harmonic)
    return SplitPair(instrument, pair.mode, instrument.reference_temperature, pair)


def mean_changes(instrument: Instrument) -> tuple[float, float, float]:
    """Mean δ(ω²)/ω² of the n = 2 pair by the imperfection, by the card's own voltages, and per V² on all electrodes of a charged card."""
    electrodes: CardElectrodes = instrument.part("electrodes")
    card: CardImperfection = instrument.part("imperfection")
    if not electrodes.are_charged and card.fields is None:
        return 0.0, 0.0, 0.0
    whole = reference_split(instrument)
    with naming(f"{instrument.path} [electrodes]"):
        charged = _softening(whole.pair, electrodes) if electrodes.are_charged else (0.0, 0.0)
    return whole.imperfection.squares[0], *charged


def mean_shift(instrument: Instrument, temperature: Array, voltage_squared: Array | None = None) -> Array | float:
    """What imperfection and electrodes, as V²/g³ with a common V² or the card's voltages, add to the frequency of the n = 2 pair, relative."""
    imperfection, own, per_square_volt = mean_changes(instrument)
    if not own:
        return shift_of(imperfection)
    keys = instrument.part("electrodes").keys
    commanded = 0.0 if voltage_squared is None else voltage_squared - keys.voltage_V**2
    gap = 1 + keys.gap_expansion_per_K * (temperature - instrument.reference_temperature)
    change = imperfection + (own + per_square_volt * commanded) / gap**3
    if np.any(change <= -1):
        raise InputError(
            f"{instrument.path} [electrodes]: the commanded voltage pulls in the shell; lower it or widen the gap."
        )
    return shift_of(change)
