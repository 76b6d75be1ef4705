"""The store of a study: one file of sealed blocks, one writer, whole batches or nothing; of a case computed twice the later counts."""

import io
import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any, NamedTuple
from weakref import finalize

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array
from studies.errors import InputError, MissingEnvironment
from studies.sweeps.block import Cases, Row, pack, unpack, unpack_head
from studies.sweeps.provenance import digest, find_changes, spell
from studies.sweeps.sealed import SealedFile

FILE = "study.store"
SHOWN_CHANGES = 6
FOLLOWING = "design: "  # what of an identity follows from the rest, its hash


class Stretch(NamedTuple):
    """A block of sampled cases: where it stands, and from which to which place of the design it reaches."""

    at: int
    first: int
    last: int


class Store:
    """An open store; one that is forgotten is closed too."""

    def __init__(self, file: IO[bytes], path: Path, lock: IO[str] | None = None) -> None:
        self.file, self.path = SealedFile(file), path
        self.end = finalize(self, _end, file, lock)
        self.study: dict[str, Any] | None = None
        self.seconds = 0.0  # of the sampled cases
        self.judged = np.zeros(0, dtype=bool)  # columns of which some case has an error estimate
        self._of: set[str] = set()
        self.runs: list[dict[str, Any]] = []
        self.findings: dict[str, Any] = {}  # outcomes of searches by name
        self._stretches: list[Stretch] = []
        self.done = np.zeros(0, dtype=bool)  # for every design whether it is computed
        # status and remark of cases that failed or were warned of, by place
        self.remarks: dict[int, tuple[str, str]] = {}
        self._searched: dict[bytes, Row] = {}
        for block in self.file.scan():
            self._take(block.kind, block.at, block.content)

    def close(self) -> None:
        """Close the file and free the lock."""
        self.end()

    def begin_run(self, provenance: Mapping[str, Any]) -> None:
        """Note that a run starts, and on what."""
        self._write("run", {"started_utc": now_utc(), "provenance": provenance})

    def end_run(self, outcome: str) -> None:
        """Note how the run ended."""
        self._write("ended", {"finished_utc": now_utc(), "outcome": outcome})
        self.file.sync()

    def describe(self, about: Mapping[str, Any]) -> None:
        """Write what the study is; a later run may change only what no result depends on."""
        created = self.study["created_utc"] if self.study else now_utc()
        now = json.loads(spell({**about, "created_utc": created}))
        if now != self.study:
            self._write("study", now)

    def keep_finding(self, name: str, content: Mapping[str, Any]) -> None:
        """Keep the outcome of a search under its name."""
        self._write("finding", {"name": name, "content": content})

    def add(self, cases: Cases) -> None:
        """Keep computed cases, all of them or none."""
        self._append("cases", pack(cases, _name(self.about()["identity"])))

    def forget(self, *statuses: str) -> None:
        """Let the cases of these statuses be computed again; until then the file keeps what they were."""
        for place in [place for place, (status, _) in self.remarks.items() if status in statuses]:
            self.done[place] = False
            del self.remarks[place]
        self._searched = {key: one for key, one in self._searched.items() if one.status not in statuses}

    def find(self, design: Array) -> Row | None:
        """Return one design of a search."""
        return self._searched.get(design.tobytes())

    def read(self, columns: Sequence[int]) -> Iterator[tuple[NDArray[np.int64], Array]]:
        """Give the sampled cases in order, some thousand at a time: places, and some columns of `unpack` (columns, m)."""
        for group in self._groups():
            parts = []
            for stretch in group:
                content = self.file.read(stretch.at)
                if content is None:
                    raise say_damaged(self.path)
                parts.append(unpack(content, [0, *columns]))
            found = parts[0]
            if len(parts) > 1:
                found = np.concatenate(parts, axis=1)
                _, last = np.unique(found[0, ::-1], return_index=True)
                found = found[:, found.shape[1] - 1 - last]
            yield found[0].astype(np.int64), found[1:]

    def counts(self) -> dict[str, int]:
        """Return how many sampled cases there are of each status."""
        others = Counter(status for status, _ in self.remarks.values() if status != "ok")
        ok = int(self.done.sum()) - others.total()
        return ({"ok": ok} if ok else {}) | dict(others)

    def reasons(self, most: int = 20) -> list[tuple[str, int]]:
        """Return the reasons of failures, the most frequent first."""
        found = Counter(text for status, text in self.remarks.values() if status != "ok")
        return sorted(found.items(), key=lambda one: (-one[1], one[0]))[:most]

    def about(self) -> dict[str, Any]:
        """Return what the study is: identity, spec, instrument, number of cases, when it was made."""
        if self.study is None:
            raise InputError(f"{self.path}: holds no study yet, or the file was truncated. Run it again.")
        return self.study

    def check_same(self, identity: Mapping[str, Any]) -> None:
        """Refuse to go on when the results so far belong to something else; InputError says what changed."""
        now = json.loads(spell(identity))  # as it would be read back: tuples have become lists
        changes: list[str] = []
        if self.study is not None:
            changes = list(find_changes({**self.study["identity"], "base": now["base"]}, now))
            changes = [one for one in changes if not one.startswith(FOLLOWING)] or changes
        elif self._of - {_name(now)}:  # what the study is was damaged, its cases were not
            changes = ["its card, its quantities or its designs"]
        if changes:
            shown = "; ".join(changes[:SHOWN_CHANGES])
            more = f"; and {len(changes) - SHOWN_CHANGES} more" if len(changes) > SHOWN_CHANGES else ""
            raise InputError(f"{self.path.parent}: holds results of a study that differs: {shown}{more}. Use another folder with --out, or undo the change.")  # fmt: skip

    def _take(self, kind: str, at: int, content: bytes) -> None:
        """Take account of a block, read or written."""
        if kind == "cases":
            self._take_cases(at, content)
            return
        said = json.loads(content)
        if kind == "study":
            self.study = said
        elif kind == "run":
            self.runs.append({"finished_utc": None, "outcome": None, **said})
        elif kind == "ended" and self.runs:
            self.runs[-1] |= said
        elif kind == "finding":
            self.findings[said["name"]] = said["content"]

    def _take_cases(self, at: int, content: bytes) -> None:
        head = unpack_head(content)
        self._of.add(head["of"])
        self.judged = self.judged | head["judged"] if self.judged.size else np.array(head["judged"])
        if head["first"] < 0:
            self._take_searched(head, content)
            return
        places = unpack(content, [0])[0].astype(int)
        if head["last"] >= len(self.done):
            grown = np.zeros(max(head["last"] + 1, 2 * len(self.done)), dtype=bool)
            grown[: len(self.done)] = self.done
            self.done = grown
        if self.remarks:
            for place in self.remarks.keys() & set(places.tolist()):
                del self.remarks[place]
        self.done[places] = True
        for status, text, rows in head["remarks"]:
            self.remarks |= dict.fromkeys(places[rows].tolist(), (status, text))
        self.seconds += head["seconds"]
        self._stretches.append(Stretch(at, head["first"], head["last"]))

    def _take_searched(self, head: Mapping[str, Any], content: bytes) -> None:
        width = len(head["judged"])
        columns = unpack(content, range(1, len(head["sizes"]))).T
        notes = {row: (status, text) for status, text, rows in head["remarks"] for row in rows}
        for row, numbers in enumerate(columns):
            design, values, errors = np.split(numbers, [len(numbers) - 2 * width, len(numbers) - width])
            self._searched[design.tobytes()] = Row(*notes.get(row, ("ok", "")), values, errors)

    def _groups(self) -> Iterator[list[Stretch]]:
        """Give the blocks by their first place; together where they overlap, in the order in which they were written."""
        group: list[Stretch] = []
        last = -1
        for stretch in sorted(self._stretches, key=lambda one: one.first):
            if group and stretch.first > last:
                yield sorted(group)
                group = []
            group.append(stretch)
            last = max(last, stretch.last)
        if group:
            yield sorted(group)

    def _write(self, kind: str, said: Mapping[str, Any]) -> None:
        self._append(kind, spell(said).encode())

    def _append(self, kind: str, content: bytes) -> None:
        try:
            at = self.file.append(kind, content)
        except OSError as error:
            raise MissingEnvironment(
                f"{self.path}: cannot be written ({error.strerror}); everything computed before is kept. Make room on the disk or"
                " restore write access to the folder, then run the same command again to resume."
            ) from error
        self._take(kind, at, content)


def _end(file: IO[bytes], lock: IO[str] | None) -> None:
    file.close()
    if lock is not None:
        lock.close()


def memory_store() -> Store:
    """Return a store that lives as long as the program."""
    return Store(io.BytesIO(), Path(":memory:") / FILE)


def say_damaged(path: Path) -> InputError:
    """Return the error that names a damaged store and says how to mend it."""
    return InputError(f"{path}: the store is damaged. Run 'hrg study run' with the same spec and folder again: the damaged cases are computed again, the rest is kept.")  # fmt: skip


def _name(identity: Mapping[str, Any]) -> str:
    """Return a short hash of what results depend on."""
    return digest([identity["base"], identity["design"]])


def now_utc() -> str:
    """Return the time as ISO 8601, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")
