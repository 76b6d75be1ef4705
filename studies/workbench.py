"""The workbench from Python, by the names that the command line uses: cards, profiles and records by path, name or object."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from studies.instrument.card import Instrument, load_card
from studies.record import Record, read_record

if TYPE_CHECKING:
    from studies.comparison import Comparison

Card = Instrument | str | Path
Run = Record | str | Path


def simulate(card: Card, profile: str, *, rate: float = 1.0, seed: int = 0, noise: bool = True) -> Record:
    """Return the record of a virtual run: `hrg simulate`.

    Parameters
    ----------
    card : Instrument, path, or name of a card that ships
    profile : str
        A chamber profile in words ("step 20 -10 5h"), a profile file, or a record whose housing column drives the run.
    rate : float
        Rows per second.
    seed : int
        Of the noise.
    noise : bool
        False records what is true.

    Raises
    ------
    InputError
        An unusable card or profile.
    """
    from studies.simulation.chamber import load_drive
    from studies.simulation.virtual_gyro import simulate_run

    return simulate_run(open_card(card), load_drive(profile, None, rate), rate, seed, noise).record


def compare(*cards: Card) -> "Comparison":
    """Return designs side by side: `hrg compare`."""
    from studies.comparison import compare as compare_designs

    return compare_designs([open_card(card) for card in cards])


def open_card(card: Card) -> Instrument:
    """Return the instrument that a card, its path or its name stands for."""
    return card if isinstance(card, Instrument) else load_card(card)


def open_records(runs: Run | Sequence[Run]) -> list[Record]:
    """Return the records that records or their paths stand for."""
    several = [runs] if isinstance(runs, Record | str | Path) else list(runs)
    return [run if isinstance(run, Record) else read_record(run) for run in several]
