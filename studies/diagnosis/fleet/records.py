"""Records of a fleet, from the words of a command or from a manifest."""

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Annotated

from studies.errors import InputError
from studies.record import Record, read_record
from studies.schema.keys import Keys, says
from studies.schema.reader import read_keys, read_toml


class Manifest(Keys, frozen=True, kw_only=True):
    """The devices of a fleet."""

    devices: Annotated[
        dict[str, Annotated[tuple[str, ...], says("records", least=1)]], says('lines such as A = ["a1.csv", "a2.csv"]')
    ]


def read_fleet(devices: Sequence[str] = (), manifest: str | None = None) -> dict[str, list[Record]]:
    """Read the records of a fleet: from words such as "A=a1.csv,a2.csv", or from a TOML file with a table [devices].

    Raises
    ------
    InputError
        A device twice, without records, or a file that says something else.
    """
    paths: dict[str, list[str]] = {}
    for words in devices:
        name, equals, files = words.partition("=")
        if not (name and equals and files) or name in paths:
            raise InputError(f"--device {words}: give a unique name and its records, as in A=a1.csv,a2.csv.")
        paths[name] = files.split(",")
    if manifest is not None:
        paths |= _read_manifest(manifest, paths)
    return {name: [read_record(path) for path in own] for name, own in paths.items()}


def _read_manifest(manifest: str, known: Collection[str]) -> dict[str, list[str]]:
    devices = read_keys(read_toml(manifest), Manifest, manifest).devices
    if twice := sorted(set(devices) & set(known)):
        raise InputError(f"{manifest} [devices]: {twice[0]} is given by --device too; name each device once.")
    return {name: [str(Path(manifest).parent / one) for one in files] for name, files in devices.items()}
