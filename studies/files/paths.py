"""Paths that a command reads and writes, also those in its TOML files and a study's spec that are files beside them."""

import json
import os
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType
from typing import Any

from studies.errors import InputError
from studies.sweeps.sealed import SealedFile

OUTPUTS = {
    # argument of a command that names what is written: how people give it
    **{name: f"--{name}" for name in ("out", "save", "report", "emit", "draft", "fmu", "c")},
    "map_file": "--map",
    "state_space": "--state-space",
}
SHIPPED = ("cards", "sweeps/templates", "examples")
STORE, STORE_FILES = "study.store", ("study.store", "lock")
# of a folder, or of a folder of folders
RECORDS = tuple(f"{folder}*.{kind}" for folder in ("", "*/") for kind in ("csv", "parquet", "toml"))
LONGEST_TOML = 2**22  # bytes

_read: dict[object, str] = {}
_written: set[str] | None = None  # while a command runs; from Python a file may be written again and again


def beside(path: str | Path, ending: str) -> Path:
    """Return the path of a file that is named after another: run.csv and -inner.csv give run-inner.csv."""
    return Path(path).with_name(f"{Path(path).stem}{ending}")


@contextmanager
def guarded(
    arguments: Mapping[str, Any], endings: Mapping[str, Iterable[str]] = MappingProxyType({})
) -> Iterator[list[Path]]:
    """Keep what a command reads from being overwritten by what it writes, while it runs; `endings`: of files written `beside` an output."""
    outputs = {name: value for name, value in arguments.items() if name in OUTPUTS and isinstance(value, str)}
    words = [word for name, value in arguments.items() if name not in OUTPUTS for word in _words(value)]
    global _written
    _written = set()
    read = []
    try:
        for word in words:
            for path in _read_with(word):
                read.append(path)
                same = _identity(path) == _identity(Path(word))
                _read.setdefault(_identity(path), word if same else f"{path} of {word}")
        seen: dict[object, str] = {}
        for name, value in outputs.items():
            given, target = f"{OUTPUTS[name]} {value}", Path(value)
            if not target.parent.is_dir():
                raise InputError(f"{given}: cannot be written: there is no folder '{target.parent}'; create it, or correct the path.")  # fmt: skip
            also = [beside(value, ending) for ending in endings.get(name, ())]
            written = [(target, given), *((path, f"{given} (which also writes {path})") for path in also)]
            for path, said in written if not _is_special(target) else ():
                _spare_read(path, said)
                if seen.setdefault(_identity(path), said) != said:
                    raise InputError(f"{seen[_identity(path)]} and {said}: two outputs in one file; name two files.")
        yield read
    finally:
        _read.clear()
        _written = None


def claim(path: Path) -> None:
    """Refuse to write a file that the running command reads, or has written already under another name."""
    if _written is None:
        return
    _spare_read(path, str(path))
    if str(path.resolve()) in _written and not _is_special(path):
        raise InputError(f"{path}: two outputs would be one file; name two files.")
    _written.add(str(path.resolve()))


def _spare_read(path: Path, given: str) -> None:
    read = _read.get(_identity(path))
    if read is not None and path.is_file():
        raise InputError(f"{given}: the same command reads this file ({read}), and writing it would destroy it; choose another name.")  # fmt: skip


def _words(value: object) -> Iterator[str]:
    """Yield what may be a path in an argument, such as A=a1.csv,a2.csv of a fleet."""
    for word in value if isinstance(value, tuple | list) else [value]:
        if isinstance(word, str):
            pieces = (part for piece in (word, word.partition("=")[2]) for part in piece.split(","))
            yield from dict.fromkeys(one for one in (word, *pieces) if one)


def _read_with(word: str) -> Iterator[Path]:
    """Yield the file that a word names, the files of a folder, or the card that ships under this name, and all that they lead to."""
    pending = [Path(word), *(Path(str(files("studies"))) / folder / f"{word}.toml" for folder in SHIPPED)]
    if _exists(pending[0]) and pending[0].is_dir():
        pending = list(_inside(pending[0]))
    seen = set()
    while pending:
        path = pending.pop()
        if _identity(path) in seen or not _exists(path) or not path.is_file():
            continue
        seen.add(_identity(path))
        yield path
        if path.suffix == ".toml" and path.stat().st_size < LONGEST_TOML:
            with suppress(OSError, ValueError, RecursionError):  # the command itself says what is wrong with it
                pending += [path.parent / text for text in _texts(tomllib.loads(path.read_text(encoding="utf-8-sig")))]


def _inside(folder: Path) -> Iterator[Path]:
    """Yield the files that make up a folder of a study, or of records."""
    if not (folder / STORE).is_file():
        yield from (path for pattern in RECORDS for path in folder.glob(pattern))
        return

    yield from (folder / name for name in STORE_FILES)
    with suppress(OSError, ValueError, TypeError, RecursionError), (folder / STORE).open("rb") as file:
        for block in SealedFile(file).scan():
            if block.kind == "study":
                study = json.loads(block.content)
                for text in (*_texts(study["spec"]), *_texts(study["instrument"])):
                    yield from (Path(study["folder"]) / text, Path(text))


def _texts(content: object) -> Iterator[str]:
    """Yield every text of a parsed document that could be the name of a file."""
    if isinstance(content, str):
        if 0 < len(content) < 4096 and "\0" not in content and "\n" not in content:
            yield content
    elif isinstance(content, dict | list):
        for item in content.values() if isinstance(content, dict) else content:
            yield from _texts(item)


def _identity(path: Path) -> object:
    """Return what two names of one file have in common."""
    with suppress(OSError, ValueError):
        status = path.stat()
        return status.st_dev, status.st_ino
    with suppress(OSError, ValueError):  # the current folder may have been removed
        return os.path.realpath(path)
    return str(path)


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):
        return False


def _is_special(path: Path) -> bool:
    """Return whether a path is a device or a pipe, which keeps what it is."""
    return _exists(path) and not path.is_file() and not path.is_dir()
