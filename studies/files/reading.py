"""Files that a user names: read with one sentence where that fails, and found by bare name where they ship."""

import hashlib
import importlib
import logging
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path
from typing import Any

from studies.errors import InputError, MissingEnvironment, nearest

MOST_BYTES = 2 * 1024**3  # a record at 200 Hz over a month is smaller; a table of numbers takes about as much in memory

ANY_SIZE = 1 << 62  # bytes of a file that is never held as a whole
PORTION = 1 << 23  # bytes that are looked through at once


def as_path(given: object) -> Path:
    """Return what names a file as a path."""
    if not isinstance(given, str | Path):
        raise InputError(f"{given!r:.60}: give a path or a name, not {type(given).__name__}.")
    return Path(given)


def read_bytes(path: str | Path, most: int = MOST_BYTES, first: int = -1) -> bytes:
    """Return the content, or its first bytes, of a file; raise as `opened`."""
    with opened(path, most) as file:
        return file.read(first)


@contextmanager
def opened(path: str | Path, most: int = MOST_BYTES) -> Iterator[BufferedReader]:
    """Open a regular file of at most so many bytes for reading."""
    try:
        with check_file(path, most).open("rb") as file:
            yield file
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from error


def digest(path: str | Path, most: int = MOST_BYTES) -> str:
    """Return the SHA-256 of a file."""
    with opened(path, most) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def check_file(path: str | Path, most: int = MOST_BYTES) -> Path:
    """Return the path of a regular file of at most so many bytes; raise as `opened` for anything else."""
    try:
        about = as_path(path).stat()
        if stat.S_ISDIR(about.st_mode):
            raise InputError(f"{path}: is a folder; give the name of a file.")
        if not stat.S_ISREG(about.st_mode):
            raise InputError(f"{path}: is a device or a pipe, not a file; save what it gives and name that file.")
        if about.st_size > most:
            raise InputError(f"{path}: has {about.st_size / 1e6:,.0f} MB, above the limit of {most / 1e6:,.0f} MB; split it or record at a lower rate.")  # fmt: skip
        return Path(path)
    except InputError:
        raise
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file.") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from error
    except ValueError as error:
        raise InputError(f"{str(path)!r}: cannot be the name of a file ({error}).") from error


def load_library(name: str, path: str | Path, kind: str) -> Any:
    """Return a library of the extra `formats`, which is wanted for a file of some kind."""
    own = name.partition(".")[0]
    try:
        library = importlib.import_module(name)
    except ImportError:
        raise MissingEnvironment(f"{path}: {kind} needs {own}: pip install 'hrg-workbench[formats]'.") from None
    for logger in [one for one in logging.root.manager.loggerDict if one.partition(".")[0] == own]:
        logging.getLogger(logger).setLevel(logging.CRITICAL)  # what is wrong is told once, in a sentence
    return library


def list_shipped(folder: Path) -> dict[str, Path]:
    """Return name -> path of the TOML files that ship in a folder of the package."""
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def find_shipped(name: str | Path, shipped: dict[str, Path], kind: str) -> Path:
    """Return the path of a TOML file that is given by path, or by the bare name of one that ships."""
    path = as_path(name)
    if path.suffix == ".toml" or path.exists() or len(path.parts) > 1:
        return path
    if str(name) not in shipped:
        raise InputError(f"there is no built-in {kind} '{name}' (give the path of your own){nearest(str(name), shipped)}")  # fmt: skip
    return shipped[str(name)]
