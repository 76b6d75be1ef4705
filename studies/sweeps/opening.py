"""Stores in folders: opened to read at any time, claimed by one run at a time (a lock), and mended then: damaged blocks are left out."""

import fcntl  # POSIX only, as pyproject.toml declares
import os
import warnings
from pathlib import Path
from typing import IO

from studies.errors import InputError, MissingEnvironment, numbered
from studies.files.writing import written_whole
from studies.sweeps.sealed import SealedFile
from studies.sweeps.store import FILE, Store, now_utc, say_damaged

LOCK = "lock"


def open_store(folder: str | Path) -> Store:
    """Open the store of a study for reading, also while it is being written."""
    path = Path(folder) / FILE
    if not os.path.isfile(path):
        raise InputError(f"{folder}: there is no study in it (no {FILE}); give the folder that was named with 'hrg study run --out'.")  # fmt: skip
    try:
        store = Store(path.open("rb", buffering=0), path)
    except OSError as error:
        raise MissingEnvironment(f"{path}: cannot be opened ({error.strerror}); check its rights and the disk.") from error  # fmt: skip
    if store.file.damaged:
        store.close()
        raise say_damaged(path)
    return store


def claim_store(folder: str | Path) -> Store:
    """Open or make the store of a study for writing, lock its folder, and leave out what is damaged."""
    path = Path(folder) / FILE
    if not path.parent.absolute().parent.exists():
        raise InputError(f"{folder}: there is no folder '{path.parent.parent}'; create it, or correct --out.")
    try:
        path.parent.mkdir(exist_ok=True)
        lock = (path.parent / LOCK).open("a+")
    except OSError as error:
        raise MissingEnvironment(f"{folder}: cannot be written ({error.strerror}); choose another place with --out.") from error  # fmt: skip
    try:
        _lock(lock, folder)
        path.open("ab").close()
        store = Store(path.open("r+b", buffering=0), path, lock)
        if store.file.damaged:
            _leave_out(store.file, path)
            count = len(store.file.damaged)
            warnings.warn(
                f"{path}: damaged in {numbered(count, 'place')}; the damaged cases are left out and computed again.",
                stacklevel=3,
            )
            store = Store(path.open("r+b", buffering=0), path, lock)
        store.file.cut()
    except OSError as error:
        lock.close()
        raise MissingEnvironment(f"{folder}: cannot be written ({error.strerror}); make room and run again.") from error
    except BaseException:
        lock.close()
        raise
    return store


def is_running(folder: str | Path) -> bool:
    """Return whether a run holds the folder's lock."""
    try:
        with (Path(folder) / LOCK).open() as lock:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except BlockingIOError:
        return True
    return False


def _lock(lock: IO[str], folder: str | Path) -> None:
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        lock.seek(0)
        owner = lock.read().strip() or "another process"
        raise InputError(f"{folder}: {owner} is running this study; wait, or use another folder with --out.") from None
    lock.truncate(0)
    lock.write(f"process {os.getpid()}, since {now_utc()},")
    lock.flush()


def _leave_out(file: SealedFile, path: Path) -> None:
    """Write the file anew without its damaged stretches, whole or not at all."""
    with written_whole(path) as new:
        at = 0
        for start, stop in [*file.damaged, (file.end, file.end)]:
            file.file.seek(at)
            while at < start:
                piece = file.file.read(min(1 << 20, start - at))
                new.write(piece)
                at += len(piece)
            at = stop
