"""The workbench from Python, by the names that the command line uses: cards, profiles and records by path, name or object."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from math import inf
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shell.constants import zero_Celsius
from studies.errors import InputError
from studies.instrument.card import Card, Instrument, load_card
from studies.record import Record, Run, is_table, read_record

if TYPE_CHECKING:
    from studies.calibration.calibrate import Calibration
    from studies.diagnosis.table import TableDiagnosis
    from studies.inference.diagnosis import Inference
    from studies.inversion.invert import ModeCalibration
    from studies.planning.chamber import Chamber
    from studies.resonator.comparison import Comparison

Progress = Callable[[str], None]


def simulate(
    card: Card, profile: Run, *, row: float = 1.0, seed: int = 0, noise: bool = True, start: float = 0.0
) -> Record:
    """Return the record of a virtual run: `hrg simulate`.

    Args:
        card: Instrument, path, or name of a card that ships
        profile: A chamber profile in words ("step 20 -10 5h"), a profile file, or a record, or its path, whose housing
            column drives the run.
        row: Time between rows (s).
        seed: Of the noise.
        noise: False records what is true.
        start: Time (s) of a record whose readings tell how its gyro began; with 0 it begins settled.
    """
    from studies.calibration.start import begin
    from studies.simulation.chamber import load_drive
    from studies.simulation.virtual_gyro import simulate_run

    if not isinstance(row, Real) or not 0 < row < inf:
        raise InputError(f"row = {row!r}: give the time between rows, a number of seconds above 0.")
    if not isinstance(seed, Integral) or seed < 0:
        raise InputError(f"seed = {seed!r}: give a whole number, 0 or above.")
    if not isinstance(start, Real) or not 0 <= start < inf:
        raise InputError(f"start = {start!r}: give a number of seconds, 0 or above.")
    instrument, run = load_card(card), str(profile) if isinstance(profile, str | Path) else read_record(profile)
    driven = load_drive(run, None, 1 / row)
    if start:
        driven, _ = begin(instrument, run, driven, float(start))
    return simulate_run(instrument, driven, 1 / row, int(seed), noise).told()


def compare(*cards: Card) -> "Comparison":
    """Return designs side by side: `hrg compare`."""
    from studies.resonator.comparison import compare as compare_designs

    return compare_designs([load_card(card) for card in _flat(cards)])


def calibrate(
    card: Card, *data: Run, hold_out: int | None = None, exact: Sequence[str] = (), progress: Progress | None = None
) -> "Calibration | ModeCalibration":
    """Return the most probable values of a card, given data of one device: `hrg calibrate`.

    Args:
        card: Instrument, path, or name of a card that ships
        data: records and steady-state tables, or one table of modes; or their paths
        hold_out: Number of the record, from 1, that a second calibration without it predicts; the last of several
            unless given.
        exact: Values of the card that stay fixed.
        progress: Is told in a few words what comes next.
    """
    from studies.inversion.invert import invert
    from studies.inversion.readings import is_mode_table, read_modes

    data = tuple(_flat(data))
    tables = [one for one in data if is_mode_table(one)]
    if not tables:
        return calibrate_records(load_card(card), data, hold_out, exact, progress)
    if len(data) > 1:
        raise InputError("a table of modes is calibrated alone; calibrate the card that it gives with the others.")
    return invert(load_card(card), read_modes(tables[0]), exact, progress or (lambda _: None))


def calibrate_records(
    instrument: Instrument, data: Sequence[Run], hold_out: int | None, exact: Sequence[str], progress: Progress | None
) -> "Calibration":
    """Return the most probable values of a card, given records and steady-state tables."""
    from studies.calibration.calibrate import calibrate as find_values
    from studies.calibration.observed import read_settled

    tables = [one for one in data if is_table(one)]
    records = [read_record(one) for one in data if not is_table(one)]
    if not data:
        raise InputError("give at least one record or steady-state table to calibrate with.")
    if hold_out is not None and not 1 <= hold_out <= len(records):
        raise InputError(f"hold_out = {hold_out}: there are {len(records)} records, numbered from 1.")
    left = (hold_out or len(records)) - 1 if len(records) > 1 else None
    settled = [read_settled(one) for one in tables]
    return find_values(instrument, records, settled, left, exact, progress=progress or (lambda _: None))


def diagnose(*runs: Run, card: Card | None = None) -> "Inference | TableDiagnosis":
    """Return what a campaign shows and the simulation lacks, with its causes: `hrg diagnose`; `.verdict` is the outcome.

    Args:
        runs: records of one gyro, or one steady-state table; or their paths
        card: Its own simulation is the baseline.
    """
    from studies.diagnosis.table import diagnose_table

    runs = tuple(_flat(runs))
    if not runs:
        raise InputError("give the records of one gyro, or a steady-state table.")
    instrument = None if card is None else load_card(card)
    if any(is_table(one) for one in runs):
        if len(runs) > 1:
            raise InputError("a steady-state table is diagnosed alone; leave the other files out.")
        return diagnose_table(runs[0], instrument)
    return diagnose_records([read_record(one) for one in runs], instrument)


def diagnose_records(
    records: Sequence[Record],
    card: Instrument | None = None,
    chamber: "Chamber | None" = None,
    progress: Progress | None = None,
) -> "Inference":
    """Return what a campaign shows and the simulation lacks: the joint inference of all responses beside a card, or beside a polynomial card made from the records; with a `chamber`, the run that should come next in it."""
    from studies.calibration.misreading import check_readings
    from studies.inference.diagnosis import infer
    from studies.inference.polynomial_card import polynomial_card
    from studies.inference.records import driving, make_ready
    from studies.planning.next_run import suggest
    from studies.record.plausible import check_card_frequency
    from studies.resonator.law import law_of

    campaign, law = make_ready(records), None
    if card is None:
        card = polynomial_card(campaign.records)
    else:
        if card.polynomial is None:
            card.material.check(np.concatenate([driving(record) for record in campaign.records]) + zero_Celsius)
        law = law_of(card)
        for record in campaign.records:
            if "frequency_Hz" in record:
                check_card_frequency(card, record["frequency_Hz"], record.path, law)
        check_readings(card, campaign.records, law)
    tell = progress or (lambda words: None)
    found = infer(card, campaign, tell, law)
    return found if chamber is None else replace(found, advice=suggest(found, found.verdict, chamber, tell))


def _flat(given: Iterable[Any]) -> Iterator[Any]:
    for one in given:
        if isinstance(one, list | tuple):
            yield from one
        else:
            yield one
