"""Records of a fleet, from the words of a command or from a manifest."""

import tomllib
from collections.abc import Sequence
from pathlib import Path

from studies.errors import InputError
from studies.record import Record, read_record


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
        paths |= _read_manifest(manifest, set(paths))
    return {name: [read_record(path) for path in own] for name, own in paths.items()}


def _read_manifest(manifest: str, known: set[str]) -> dict[str, list[str]]:
    try:
        content = tomllib.loads(Path(manifest).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"{manifest}: not a readable list of devices: {error}.") from None
    table = content.get("devices")
    if set(content) != {"devices"} or not isinstance(table, dict):
        raise InputError(
            f'{manifest}: the file needs one table [devices], with lines such as A = ["a1.csv", "a2.csv"].'
        )
    out = {}
    for name, files in table.items():
        if not (isinstance(files, list) and files and all(isinstance(one, str) for one in files)) or name in known:
            raise InputError(
                f'{manifest}: {name} needs a list of records, each named once, such as ["a1.csv", "a2.csv"].'
            )
        out[name] = [str(Path(manifest).parent / one) for one in files]
    return out
