"""A chamber profile from words (`thermal.profile`) or from a file `time_s,chamber_temperature_degC`."""

from pathlib import Path
from typing import TYPE_CHECKING

from studies.errors import InputError

if TYPE_CHECKING:
    from studies.instrument.card import Instrument
    from thermal.profile import Profile

ZERO_CELSIUS = 273.15


def load_profile(text: str) -> "Profile":
    """Read a profile from a CSV file, when there is one of that name, else from words; kelvin in the result."""
    from studies.record import read_profile
    from thermal.profile import Profile, parse_profile

    if Path(text).suffix != ".csv" and not Path(text).is_file():
        return parse_profile(text)
    table = read_profile(text)
    if len(table.values["time_s"]) < 2:
        raise InputError(f"{text}: a profile needs at least two rows.")
    return Profile(table.values["time_s"], table.values["chamber_temperature_degC"] + ZERO_CELSIUS)


def check_profile(profile: "Profile", instrument: "Instrument") -> None:
    """Raise when the profile leaves the range of the card's material law."""
    material = instrument.material
    profile.require_within(material.lowest, material.highest, f"the range of {material.name}, law '{material.law}'")
