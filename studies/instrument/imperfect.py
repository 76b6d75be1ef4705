"""Whether an instrument is a body of revolution, so that its pairs need no split."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from studies.instrument.card import Instrument
    from studies.instrument.tables.electrodes import CardElectrodes
    from studies.instrument.tables.imperfection import CardImperfection


def is_imperfect(instrument: "Instrument") -> bool:
    """Whether the card says anything that could split a pair."""
    card: CardImperfection = instrument.part("imperfection")
    electrodes: CardElectrodes = instrument.part("electrodes")
    return card.fields is not None or card.split is not None or electrodes.are_charged
