"""A chamber profile from words (`thermal.profile`) or from a file `time_s,chamber_temperature_degC`; a record as a drive."""

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from shell.constants import zero_Celsius
from studies.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray

    from studies.instrument.card import Instrument
    from studies.record import Record
    from studies.simulation.drive import Boundary, Drive
    from thermal.profile import Profile


def load_profile(text: "str | Record") -> "Profile":
    """Read a profile from a record, or a CSV file, when there is one of that name, else from words; kelvin in the result."""
    from studies.record import read_profile
    from thermal.profile import Profile, parse_profile

    if isinstance(text, str) and Path(text).suffix != ".csv" and not os.path.isfile(text):
        return parse_profile(text)
    table = read_profile(text if isinstance(text, str) else text.to_frame())
    if len(table.values["time_s"]) < 2:
        raise InputError(f"{text}: a profile needs at least two rows.")
    return Profile(table.values["time_s"], table.values["chamber_temperature_degC"] + zero_Celsius)


def load_schedule(text: "str | Record") -> "tuple[Profile, Mapping[str, NDArray[np.float64]]]":
    """Read a chamber profile (K) and the commands beside it, by the names of a record's columns; words have none."""
    import numpy as np

    from studies.record import PROFILE_COLUMNS, read_record
    from studies.simulation.drive import COMMAND_COLUMNS
    from thermal.profile import Profile

    columns = columns_of(text)
    commands = [name for name in columns if name in COMMAND_COLUMNS]
    if not commands or not set(PROFILE_COLUMNS) <= set(columns):
        return load_profile(text), {}
    record = read_record(text)
    for name in record.columns:
        if not np.isfinite(record[name]).all():
            raise InputError(f"{text}: {name} has empty cells; a profile needs every value.")
    if len(record) < 2:
        raise InputError(f"{text}: a profile needs at least two rows.")
    chamber = Profile(record["time_s"], record["chamber_temperature_degC"] + zero_Celsius)
    return chamber, {name: record[name] for name in commands}


def load_drive(text: "str | Record", boundary: "Boundary | None" = None, rate: float = 1.0) -> "Profile | Drive":
    """Read what drives a run: a profile, its commands at `rate` rows per second, or a record's measured column, the
    housing's if it has one.
    """
    from studies.record import read_record
    from studies.simulation.drive import drive_by_record, drive_by_schedule

    if is_record(text):
        return drive_by_record(read_record(text), boundary)
    if boundary == "housing":
        raise InputError(f"{text}: only a record has a housing column to impose; leave out --boundary housing.")
    chamber, commands = load_schedule(text)
    moment = read_record(text).moment if columns_of(text) else None
    if not commands and moment is None:
        return chamber
    return replace(drive_by_schedule(chamber, commands, rate), moment=moment, source=str(text))


def is_record(text: "str | Record") -> bool:
    """Whether something is a measured run, which has other columns than a profile and its commands."""
    from studies.record import PROFILE_COLUMNS
    from studies.simulation.drive import COMMAND_COLUMNS

    columns = set(columns_of(text))
    return bool(columns) and not set(PROFILE_COLUMNS) <= columns <= {*PROFILE_COLUMNS, *COMMAND_COLUMNS}


def columns_of(text: "str | Record") -> list[str]:
    """Return the columns of a record or a file; words have none."""
    from studies.record import names_of

    return names_of(text) if not isinstance(text, str) or os.path.isfile(text) else []


def check_profile(profile: "Profile", instrument: "Instrument") -> None:
    """Raise when the profile leaves the range of the card's material law."""
    if instrument.polynomial is not None:
        return
    material = instrument.material
    profile.require_within(material.lowest, material.highest, f"the range of {material.name}, law '{material.law}'")
