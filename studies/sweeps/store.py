"""The store of a study: one SQLite file in its folder, one writer, whole batches or nothing.

Every case has a key, the hash of card, material, quantities, physics version and parameters. What is committed survives
kill -9 at any moment. A second runner on the same folder is refused by a lock that ends with its process.
"""

import fcntl  # POSIX only, as pyproject.toml declares
import json
import os
import sqlite3
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from hashlib import blake2b
from pathlib import Path
from types import TracebackType
from typing import IO, TYPE_CHECKING, Any, Self
from weakref import finalize

from studies.errors import InputError, MissingEnvironment
from studies.sweeps.canonical import find_changes, spell

if TYPE_CHECKING:
    from studies.sweeps.row import Row

FILE = "study.sqlite"
LOCK = "lock"
LAYOUT = 3  # of the tables; sqlite's user_version
SHOWN_CHANGES = 6
TABLES = """
CREATE TABLE study (
  id INTEGER PRIMARY KEY CHECK (id = 1), created_utc TEXT NOT NULL, identity TEXT NOT NULL, spec TEXT NOT NULL,
  spec_text TEXT NOT NULL, instrument TEXT NOT NULL, folder TEXT NOT NULL, cases INTEGER NOT NULL,
  repeats TEXT NOT NULL, seal BLOB NOT NULL);
CREATE TABLE run (
  id INTEGER PRIMARY KEY, started_utc TEXT NOT NULL, finished_utc TEXT, outcome TEXT, provenance TEXT NOT NULL,
  seal BLOB NOT NULL);
CREATE TABLE run_case (
  key BLOB PRIMARY KEY, position INTEGER UNIQUE, parameters TEXT NOT NULL,
  status TEXT NOT NULL CHECK (status IN ('ok', 'failed', 'lost')), remark TEXT NOT NULL, numbers BLOB NOT NULL,
  seconds REAL NOT NULL, run INTEGER NOT NULL REFERENCES run (id), seal BLOB NOT NULL) WITHOUT ROWID;
CREATE TABLE finding (name TEXT PRIMARY KEY, content TEXT NOT NULL, seal BLOB NOT NULL);
"""


@dataclass(frozen=True)
class Stored:
    """One computed case as the store has it; `position` is its place among the unique designs, None in a search."""

    key: bytes
    position: int | None
    parameters: Mapping[str, Any]
    status: str
    remark: str
    values: tuple[float, ...]
    errors: tuple[float, ...]
    seconds: float


class Store:
    """An open store; a context manager that closes it and frees its lock. One that is forgotten is closed too."""

    def __init__(self, connection: sqlite3.Connection, path: Path, lock: IO[str] | None = None) -> None:
        self.connection = connection
        self.path = path
        self.run = 0
        self.end = finalize(self, _end, connection, lock)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file and free the lock."""
        self.end()

    def begin_run(self, provenance: Mapping[str, Any]) -> None:
        """Note that a run starts, and on what."""
        about = (_now(), None, None, spell(provenance))
        with self._writing():
            cursor = self.connection.execute(
                f"INSERT INTO run ({_RUN}, seal) VALUES (?, ?, ?, ?, ?)", (*about, _seal(*about))
            )
        self.run = int(cursor.lastrowid or 0)

    def end_run(self, outcome: str) -> None:
        """Note how the run ended."""
        [(started, *_, provenance)] = self._read(f"SELECT {_RUN} FROM run WHERE id = ?", (self.run,))
        finished = _now()
        seal = _seal(started, finished, outcome, provenance)
        with self._writing():
            self.connection.execute(
                "UPDATE run SET finished_utc = ?, outcome = ?, seal = ? WHERE id = ?",
                (finished, outcome, seal, self.run),
            )

    def add(self, cases: "Iterable[tuple[bytes, int | None, str, Row]]") -> None:
        """Keep computed cases (key, position, spelled parameters, row) in one transaction."""
        rows = []
        for key, place, parameters, row in cases:
            numbers = _pack(row.values, row.errors)
            seal = _seal(key, place, parameters, row.status, row.remark, numbers)
            rows.append((key, place, parameters, row.status, row.remark, numbers, row.seconds, self.run, seal))
        with self._writing():
            self.connection.executemany("INSERT OR IGNORE INTO run_case VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", rows)

    def forget(self, *statuses: str) -> int:
        """Remove the cases of these statuses, to be computed again; return how many there were."""
        marks = ", ".join("?" * len(statuses))
        with self._writing():
            return self.connection.execute(f"DELETE FROM run_case WHERE status IN ({marks})", statuses).rowcount

    def forget_damaged(self) -> list[int]:
        """Remove the cases whose content no longer fits its seal (bit rot); return their positions."""
        rows = self._read(f"SELECT {_SEALED}, seal FROM run_case")
        found = [(row[0], row[1]) for row in rows if _seal(*row[:-1]) != row[-1]]
        if found:
            with self._writing():
                self.connection.executemany("DELETE FROM run_case WHERE key = ?", [(key,) for key, _ in found])
        return [place for _, place in found if place is not None]

    def keep_finding(self, name: str, content: Mapping[str, Any]) -> None:
        """Keep the outcome of a search under its name."""
        said = (name, spell(content))
        with self._writing():
            self.connection.execute("INSERT OR REPLACE INTO finding VALUES (?, ?, ?)", (*said, _seal(*said)))

    def findings(self) -> dict[str, Any]:
        """Return the outcomes of searches by name."""
        return {name: self._parse(content) for name, content in self._read_sealed("name, content", "finding")}

    def done(self) -> dict[int, bytes]:
        """Return the key of every computed position."""
        return dict(self._read("SELECT position, key FROM run_case WHERE position IS NOT NULL"))

    def find(self, key: bytes) -> Stored | None:
        """Return one case by its key."""
        for row in self._read(f"SELECT {_SEALED}, seconds, seal FROM run_case WHERE key = ?", (key,)):
            self._check_seal(row[:6], row[7])
            both = struct.unpack(f"<{len(row[5]) // 8}d", row[5])
            half = len(both) // 2
            return Stored(row[0], row[1], json.loads(row[2]), row[3], row[4], both[:half], both[half:], row[6])
        return None

    def rows(self) -> Iterator[tuple[int, str, str, str, bytes]]:
        """Give position, spelled parameters, status, remark and packed numbers of the sampled cases, by position."""
        query = f"SELECT {_SEALED}, seal FROM run_case WHERE position IS NOT NULL ORDER BY position"
        try:
            for row in self.connection.execute(query):
                self._check_seal(row[:6], row[6])
                yield row[1:6]
        except sqlite3.DatabaseError as error:
            raise _damaged(self.path, error) from error

    def _check_seal(self, sealed: Sequence[Any], seal: bytes) -> None:
        if _seal(*sealed) != seal:
            case = "a searched case" if sealed[1] is None else f"case {sealed[1]}"
            raise InputError(
                f"{self.path}: {case} is damaged (its content does not fit its seal). Run 'hrg study run' with the same"
                " folder again: it is computed anew."
            )

    def counts(self) -> dict[str, int]:
        """Return how many sampled cases there are of each status."""
        return dict(self._read("SELECT status, count(*) FROM run_case WHERE position IS NOT NULL GROUP BY status"))

    def reasons(self, most: int = 20) -> list[tuple[str, int]]:
        """Return the reasons of failures, the most frequent first."""
        return self._read(
            "SELECT remark, count(*) FROM run_case WHERE status <> 'ok' AND position IS NOT NULL"
            f" GROUP BY remark ORDER BY 2 DESC, 1 LIMIT {most:d}"
        )

    def seconds(self) -> float:
        """Return the total computing time of the sampled cases."""
        return float(self._read("SELECT total(seconds) FROM run_case WHERE position IS NOT NULL")[0][0])

    def about(self) -> dict[str, Any]:
        """Return what the study is: identity, spec, instrument, number of cases, when it was made."""
        rows = self._read_sealed(", ".join(_STUDY), "study")
        if not rows:
            raise InputError(f"{self.path.parent}: its study has not begun yet; run it again.")
        about = dict(zip(_STUDY, rows[0], strict=True))
        parsed = {key: self._parse(about[key]) for key in ("identity", "spec", "instrument")}
        return about | parsed | {"repeats": self._parse(about["repeats"], list)}

    def _parse(self, text: str, kind: type = dict) -> Any:
        try:
            found = json.loads(text)
        except (ValueError, TypeError) as error:
            raise _damaged(self.path, error) from error
        if not isinstance(found, kind):
            raise _damaged(self.path, f"{text!r:.60} stands where a JSON {kind.__name__} belongs")
        return found

    def runs(self) -> list[dict[str, Any]]:
        """Return the runs so far."""
        keys = ("started_utc", "finished_utc", "outcome", "provenance")
        found = [dict(zip(keys, row, strict=True)) for row in self._read_sealed(_RUN, "run")]
        return [one | {"provenance": self._parse(one["provenance"])} for one in found]

    def describe(self, about: Mapping[str, Any]) -> None:
        """Write what the study is; a later run may change only what no result depends on."""
        values = [about[key] if key in ("spec_text", "folder", "cases") else spell(about[key]) for key in _STUDY[1:]]
        old = self._read("SELECT created_utc FROM study")
        row = [old[0][0] if old else _now(), *values]
        with self._writing():
            self.connection.execute(
                f"INSERT OR REPLACE INTO study (id, {', '.join(_STUDY)}, seal) VALUES (1, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
                [*row, _seal(*row)],
            )

    def check_same(self, identity: Mapping[str, Any]) -> None:
        """Refuse to go on when the results so far belong to something else; InputError says what changed."""
        old = self._read_sealed(", ".join(_STUDY), "study")
        now = json.loads(spell(identity))  # as it would be read back: tuples have become lists
        changes = list(find_changes({**self._parse(old[0][1]), "base": now["base"]}, now)) if old else []
        if changes:
            shown = "; ".join(changes[:SHOWN_CHANGES])
            more = f"; and {len(changes) - SHOWN_CHANGES} more" if len(changes) > SHOWN_CHANGES else ""
            raise InputError(
                f"{self.path.parent}: holds results of a study that differs: {shown}{more}. Take another folder with"
                " --out, or undo the change."
            )

    def _read_sealed(self, columns: str, table: str) -> list[Any]:
        """Return rows that still say what was sealed."""
        rows = self._read(f"SELECT {columns}, seal FROM {table}")
        if any(_seal(*row[:-1]) != row[-1] for row in rows):
            raise _damaged(self.path, f"what it says of the {table} does not fit its seal")
        return [row[:-1] for row in rows]

    def _read(self, query: str, values: Sequence[Any] = ()) -> list[Any]:
        try:
            return self.connection.execute(query, values).fetchall()
        except sqlite3.DatabaseError as error:
            raise _damaged(self.path, error) from error

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            with self.connection:
                yield
        except sqlite3.OperationalError as error:
            raise MissingEnvironment(
                f"{self.path}: cannot be written ({error}); everything computed before is kept. Make room on the disk or give"
                " the folder its rights back, then run the same command again to resume."
            ) from error
        except sqlite3.DatabaseError as error:
            raise _damaged(self.path, error) from error


def _end(connection: sqlite3.Connection, lock: IO[str] | None) -> None:
    with suppress(sqlite3.ProgrammingError):  # forgotten by another thread than the one that opened it
        connection.close()
    if lock is not None:
        lock.close()


_STUDY = ("created_utc", "identity", "spec", "spec_text", "instrument", "folder", "cases", "repeats")
_RUN = "started_utc, finished_utc, outcome, provenance"


def open_store(folder: str | Path) -> Store:
    """Open the store of a study for reading, also while it is being written.

    Raises
    ------
    InputError
        There is no study in the folder, or its store is damaged.
    """
    path = Path(folder) / FILE
    if not os.path.isfile(path):
        raise InputError(f"{folder}: there is no study in it (no {FILE}); give the folder of 'hrg study run --out'.")
    connection = _connect(path, read_only=not os.access(folder, os.W_OK))
    if connection.execute("PRAGMA user_version").fetchone()[0] == 0:
        connection.close()
        raise InputError(f"{folder}: its study has not begun yet; run it again.")
    return Store(connection, path)


def claim_store(folder: str | Path) -> Store:
    """Open or make the store of a study for writing, and lock its folder.

    Raises
    ------
    InputError
        Another run works in the folder, or the store there is damaged.
    MissingEnvironment
        The folder cannot be written.
    """
    path = Path(folder) / FILE
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
        lock = (Path(folder) / LOCK).open("a+")
    except OSError as error:
        raise MissingEnvironment(
            f"{folder}: cannot be written ({error.strerror}); choose another place with --out."
        ) from error
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        lock.seek(0)
        owner = lock.read().strip() or "another process"
        lock.close()
        raise InputError(
            f"{folder}: {owner} is running this study; wait for it, or take another folder with --out."
        ) from None
    try:
        lock.truncate(0)
        lock.write(f"process {os.getpid()}, since {_now()},")
        lock.flush()
        store = Store(_connect(path), path, lock)
        with store._writing():
            store.connection.execute("PRAGMA journal_mode = WAL")
            store.connection.execute("PRAGMA synchronous = NORMAL")
        _make_tables(store)
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


def memory_store() -> Store:
    """Return a store that lives as long as the program."""
    store = Store(sqlite3.connect(":memory:"), Path(":memory:") / FILE)
    _make_tables(store)
    return store


def _connect(path: Path, read_only: bool = False) -> sqlite3.Connection:
    """Open the file; in a folder that cannot be written as it stands there, which needs no file beside it."""
    if read_only:
        connection = sqlite3.connect(f"{path.resolve().as_uri()}?immutable=1", uri=True, timeout=30.0)
    else:
        connection = sqlite3.connect(path, timeout=30.0)
    try:
        connection.execute("PRAGMA cache_size = -65536")
        complaints = connection.execute("PRAGMA quick_check(1)").fetchone()[0]
        layout = connection.execute("PRAGMA user_version").fetchone()[0]
    except sqlite3.OperationalError as error:
        connection.close()
        raise MissingEnvironment(f"{path}: cannot be opened ({error}); check its rights and the disk.") from error
    except sqlite3.DatabaseError as error:
        connection.close()
        raise _damaged(path, error) from error
    if complaints != "ok":
        connection.close()
        raise _damaged(path, complaints)
    if layout not in (0, LAYOUT):
        connection.close()
        raise InputError(
            f"{path}: was written by another version of the workbench (layout {layout}, here {LAYOUT}); read it with that"
            " one, or run the study again into another folder."
        )
    return connection


def _make_tables(store: Store) -> None:
    if store.connection.execute("PRAGMA user_version").fetchone()[0] == LAYOUT:
        return
    with store._writing():
        store.connection.execute("BEGIN IMMEDIATE")
        for statement in TABLES.split(";")[:-1]:
            store.connection.execute(statement)
        store.connection.execute(f"PRAGMA user_version = {LAYOUT}")


def _damaged(path: Path, reason: object) -> InputError:
    return InputError(
        f"{path}: the store is damaged ({reason}). Put a copy back in its place, or move it away and run the study again."
    )


_SEALED = "key, position, parameters, status, remark, numbers"


def _seal(*row: bytes | str | int | None) -> bytes:
    """Return a checksum of what a row says, so that a bit that flips on the disk is noticed."""
    return blake2b(repr(row).encode(), digest_size=8).digest()


def _pack(values: Sequence[float], errors: Sequence[float]) -> bytes:
    return struct.pack(f"<{2 * len(values)}d", *values, *errors)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
