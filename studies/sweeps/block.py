"""Designs of a study and what became of them, as columns, for travel to workers and (zlib over bytes of equal weight) for the store."""

import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array


@dataclass(frozen=True)
class Batch:
    """Designs to be computed together."""

    # array (m,) of int, among the designs of the study, ascending; -1 for a design of a search
    places: NDArray[np.int64]
    designs: Array  # array (m, parameters), texts as their place in the parameter's values, -1 for the nominal one

    def __len__(self) -> int:
        return len(self.places)

    def part(self, first: int, last: int) -> "Batch":
        """Return some of the designs."""
        return Batch(self.places[first:last], self.designs[first:last])

    def cases(self) -> "list[Batch]":
        """Return each design alone."""
        return [self.part(k, k + 1) for k in range(len(self))]


class Row(NamedTuple):
    """What became of one design: `remark` is the reason of a failure, or a warning of the solver."""

    status: str
    remark: str
    values: Array
    errors: Array


class Remark(NamedTuple):
    """A status other than "ok", or a warning of the solver, and the rows of a block that it is about."""

    status: str
    text: str
    rows: list[int]


@dataclass(frozen=True)
class Cases:
    """Computed designs: values and errors (m, columns), NaN where there are none, and the seconds that they took."""

    batch: Batch
    values: Array
    errors: Array
    seconds: float
    remarks: tuple[Remark, ...] = ()

    @property
    def failed(self) -> int:
        """The number of those that are not ok."""
        return sum(len(remark.rows) for remark in self.remarks if remark.status != "ok")


def join(parts: Sequence[Cases]) -> Cases:
    """Return cases one after the other."""
    if len(parts) == 1:
        return parts[0]
    starts = accumulate((len(part.batch) for part in parts), initial=0)
    rows: dict[tuple[str, str], list[int]] = {}
    for start, part in zip(starts, parts, strict=False):
        for status, text, places in part.remarks:
            rows.setdefault((status, text), []).extend(start + place for place in places)
    return Cases(
        Batch(np.concatenate([p.batch.places for p in parts]), np.concatenate([p.batch.designs for p in parts])),
        np.concatenate([p.values for p in parts]),
        np.concatenate([p.errors for p in parts]),
        sum(p.seconds for p in parts),
        tuple(Remark(*key, where) for key, where in rows.items()),
    )


def pack(cases: Cases, of: str) -> bytes:
    """Return the content of a block; `of` says of which study its results are."""
    batch = cases.batch
    columns = np.vstack([batch.places.astype(float), batch.designs.T, cases.values.T, cases.errors.T])
    streams = []
    for column in columns:
        packer = zlib.compressobj(1, zlib.DEFLATED, zlib.MAX_WBITS, 9, zlib.Z_RLE)
        planes = np.ascontiguousarray(column.astype("<f8").view(np.uint8).reshape(-1, 8).T)
        streams.append(packer.compress(planes.tobytes()) + packer.flush())
    head = {
        "of": of,
        "rows": len(batch),
        "first": int(batch.places[0]),
        "last": int(batch.places[-1]),
        "seconds": cases.seconds,
        "judged": np.isfinite(cases.errors).any(axis=0).tolist(),
        "remarks": cases.remarks,
        "sizes": [len(stream) for stream in streams],
    }
    return json.dumps(head, separators=(",", ":")).encode() + b"\n" + b"".join(streams)


def unpack_head(content: bytes) -> dict[str, Any]:
    """Return what a block says of itself."""
    found: dict[str, Any] = json.loads(content[: content.index(b"\n")])
    return found


def unpack(content: bytes, columns: Sequence[int]) -> Array:
    """Return some columns of a block, array (columns, rows): 0 the places, then designs, values, errors."""
    start = content.index(b"\n") + 1
    head = unpack_head(content)
    ends = list(accumulate(head["sizes"], initial=start))
    found = np.empty((len(columns), head["rows"]))
    for row, column in zip(found, columns, strict=True):
        planes = np.frombuffer(zlib.decompress(content[ends[column] : ends[column + 1]]), np.uint8).reshape(8, -1)
        row[:] = np.ascontiguousarray(planes.T).view("<f8").ravel()
    return found


def decode(coding: Sequence[tuple[str, Sequence[str]]], designs: Array) -> dict[str, NDArray[Any]]:
    """Return the parameters of designs by name, arrays (m,); `coding`: names, each with its texts, the nominal one last."""
    return {name: np.array(t)[designs[:, k].astype(int)] if t else designs[:, k] for k, (name, t) in enumerate(coding)}


def each_design(columns: Mapping[str, NDArray[Any]], count: int) -> list[dict[str, Any]]:
    """Return the parameters of every design by name."""
    lists = {name: values.tolist() for name, values in columns.items()}
    return [{name: values[place] for name, values in lists.items()} for place in range(count)]
