"""How each format gives its channels: TDMS (npTDMS), MDF (asammdf), HDF5 and MATLAB 7.3 (h5py), MATLAB to 7.2 (scipy), Parquet (pyarrow)."""

import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from compensation.arrays import Array
from studies.errors import InputError
from studies.files.reading import ANY_SIZE, load_library, opened
from studies.files.stored import PORTION
from studies.importing.channel import RATES, STARTS, STEPS, UNITS, Channel, Clock, even_clock, find_unit, stamp_clock

NUMBERS = "iufb"
MOST_WIDE = 64  # columns of a matrix that are channels
OBJECT = "holds objects, not numbers, and is not opened: save it as plain numbers"
MATLAB = "is of a class that only MATLAB reads (datetime, table, object): save it as a plain vector"

PROBE = """
import sys, h5py
def read(_, item):
    list(item.attrs.items())
    if isinstance(item, h5py.Dataset) and item.ndim < 3:
        shape = item.shape or (0,)
        along = shape.index(max(shape))
        for k in range(0, shape[along], 1 << 18):
            item[(slice(None),) * along + (slice(k, k + (1 << 18)),)]
        item.shape or item[()]
with h5py.File(sys.argv[1], "r") as file:
    file.visititems(read)
"""
FRAGMENT = 1 << 24  # bytes of an MDF file at once
PATIENCE, PACE = 20.0, 1e7  # s for which the library may read a file, and bytes for which it gets a second more


class _Stream:
    """The values of a channel that a library gives in portions, read on from where they were."""

    def __init__(self, begin: Callable[[], Iterator[Any]]) -> None:
        self.begin, self.parts = begin, begin()
        self.at, self.left = 0, np.empty(0)  # place of what is left of a portion

    def read(self, begin: int, end: int) -> Any:
        """Return the values from one row to before another."""
        if begin < self.at:
            self.parts, self.at, self.left = self.begin(), 0, np.empty(0)
        found = [self.left]
        while self.at + sum(map(len, found)) < end and (part := next(self.parts, None)) is not None:
            found.append(part)
            while len(found) > 1 and self.at + len(found[0]) <= begin:
                self.at += len(found.pop(0))
        values = np.concatenate(found) if len(found) > 1 else found[0]
        self.left, first = values[end - self.at :], begin - self.at
        values, self.at = values[first : end - self.at], end
        return values


def read_tdms(path: str, files: ExitStack) -> Iterator[Channel]:
    """Channels of a TDMS file; waveforms have their own clock, and a channel of time stamps is that of its group."""
    nptdms = load_library("nptdms", path, "TDMS")
    file = nptdms.TdmsFile.open(files.enter_context(opened(path, ANY_SIZE)))
    if file.file_status.incomplete_final_segment:
        raise InputError(f"{path}: is cut off within its last block; copy it again after the recording.")
    for group in file.groups():
        numbers = [c for c in group.channels() if c.dtype is not None and c.dtype.kind in NUMBERS and len(c)]
        stamps = next((c for c in group.channels() if c.dtype is not None and c.dtype.kind == "M" and len(c)), None)
        common = None if stamps is None else stamp_clock(group.name, partial(_tdms_values, stamps), utc=True)
        for channel in numbers:
            about = channel.properties
            read, clock = partial(_tdms_values, channel), even_clock(about) or common
            yield Channel(group.name, channel.name, find_unit(about), len(channel), read, clock)


def _tdms_values(channel: Any, begin: int, end: int) -> Any:
    return channel.read_data(begin, end - begin)


def read_mdf(path: str, files: ExitStack) -> Iterator[Channel]:
    """Channels of an MDF file, with the master channel of their group as clock; readings marked invalid are missing."""
    file = files.enter_context(load_library("asammdf", path, "MDF").MDF(files.enter_context(opened(path, ANY_SIZE))))
    file.configure(read_fragment_size=FRAGMENT)
    names: dict[str, int] = {}
    for place, group in enumerate(file.groups):
        master, rows = file.masters_db.get(place), int(group.channel_group.cycles_nr)
        name = getattr(group.channel_group, "acq_name", "") or f"group {place + 1}"
        names[name] = names.get(name, 0) + 1
        name = f"{name} #{names[name]}" if names[name] > 1 else name
        times = partial(_mdf_times, file, place)
        clock = None if master is None else Clock(name, times, start=file.header.start_time)
        for index, channel in enumerate(group.channels):
            if index == master or not rows:
                continue
            read = _Stream(partial(_mdf_values, file, place, index)).read
            if file.get(group=place, index=index, record_count=1).samples.dtype.kind in NUMBERS:
                yield Channel(name, channel.name, str(channel.unit or ""), rows, read, clock)


def _mdf_times(file: Any, place: int, begin: int, end: int) -> Array:
    return np.asarray(file.get_master(place, record_offset=begin, record_count=end - begin), dtype=float)


def _mdf_values(file: Any, place: int, index: int) -> Iterator[Array]:
    for samples, invalid in file.iter_get(group=place, index=index, samples_only=True):
        values = np.array(samples, dtype=float)
        if invalid is not None:
            values[np.asarray(invalid, dtype=bool)] = np.nan
        yield values


def read_hdf5(path: str, files: ExitStack) -> Iterator[Channel]:
    """Channels of an HDF5 file: datasets of one or two dimensions, fields of compound ones, by group."""
    h5py = load_library("h5py", path, "HDF5")
    _probe(path, Path(path).stat().st_size, Path(path).stat().st_mtime_ns)
    file = files.enter_context(h5py.File(path, "r"))
    found: dict[str, dict[str, Any]] = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and not name.startswith("#"):
            group, _, own = name.rpartition("/")
            found.setdefault(group, {})[own] = item

    file.visititems(visit)
    for group, items in found.items():
        about = {**_attributes(file), **_attributes(file[group or "/"])}
        yield from from_arrays(group, items, about)


@cache
def _probe(path: str, size: int, _: int) -> None:
    """Read a file in a process of its own first: on some damaged ones the HDF5 library never ends, or crashes."""
    try:
        command = [sys.executable, "-c", PROBE, path]
        status = subprocess.run(command, capture_output=True, timeout=PATIENCE + size / PACE, check=False).returncode
    except subprocess.TimeoutExpired:
        status = -1
    if status not in (0, 1):  # 1: an error that this process tells
        raise InputError(f"{path}: damaged, so that the HDF5 library hangs or crashes on it; copy or export it again.")


def read_matlab(path: str, files: ExitStack) -> Iterator[Channel]:
    """Channels of a .mat file: vectors, columns of matrices, fields of structures as groups; 7.3 is HDF5."""
    with open(path, "rb") as file:
        if b"MATLAB 7.3" in file.read(128):
            yield from read_hdf5(path, files)
            return
    from scipy.io import loadmat

    yield from _from_structure("", loadmat(path, mat_dtype=True, verify_compressed_data_integrity=True))


def _from_structure(group: str, items: Mapping[str, Any]) -> Iterator[Channel]:
    arrays = {name: value for name, value in items.items() if isinstance(value, np.ndarray)}
    yield from from_arrays(group, {name: value for name, value in arrays.items() if not value.dtype.names}, {})
    for name, value in arrays.items():
        if not value.dtype.names:
            continue
        inside = f"{group}/{name}" if group else name
        if type(value).__name__ == "MatlabOpaque" or value.size != 1:
            yield Channel(group, name, refused=MATLAB)
        else:
            yield from _from_structure(inside, {field: value.flat[0][field] for field in value.dtype.names})


def from_arrays(group: str, items: Mapping[str, Any], about: Mapping[str, Any]) -> Iterator[Channel]:
    """Yield the channels of named arrays of one group; single numbers such as fs or dt, and attributes, tell of all of them."""
    single = {
        name: np.asarray(a[...]).flat[0]
        for name, a in items.items()
        if a.dtype.kind in NUMBERS and np.prod(a.shape) == 1
    }
    for name, array in items.items():
        own, kind, shape = _attributes(array), array.dtype.kind, array.shape
        clock, unit = even_clock({**about, **single, **own}), find_unit(own)
        if "MATLAB_object_decode" in own or (kind in "OV" and not array.dtype.names):
            yield Channel(group, name, refused=MATLAB if "MATLAB_class" in own else OBJECT)
        elif own.get("MATLAB_class") == b"char" or len(shape) not in (1, 2):
            continue
        elif array.dtype.names:
            for part in array.dtype.names:
                if array.dtype[part].kind in NUMBERS and len(shape) == 1:
                    yield Channel(group, f"{name}.{part}", "", shape[0], partial(_field, array, part), clock)
        elif kind in NUMBERS and (len(shape) == 1 or min(shape) <= MOST_WIDE):
            along = int(np.argmax(shape))
            wide = 1 if len(shape) == 1 else shape[1 - along]
            for k in range(wide):
                own_name = f"{name}[{k + 1}]" if wide > 1 else name
                yield Channel(group, own_name, unit, shape[along], partial(_row, array, along, k), clock)


def _attributes(item: Any) -> dict[str, Any]:
    """Return the attributes that say something here; others may be anything, or damaged."""
    found = getattr(item, "attrs", {})
    said = (*STEPS, *RATES, *STARTS, *UNITS, "matlab_class", "matlab_object_decode")
    return {name: found[name] for name in found if name.lower() in said}


def _field(array: Any, part: str, begin: int, end: int) -> Array:
    return np.asarray(array[begin:end][part], dtype=float)


def _row(array: Any, along: int, place: int, begin: int, end: int) -> Array:
    some = slice(begin, end)
    where = some if len(array.shape) == 1 else (some, place) if along == 0 else (place, some)
    return np.asarray(array[where], dtype=float)


def read_parquet(path: str, files: ExitStack) -> Iterator[Channel]:
    """Columns of a Parquet file; the first one of time stamps is the clock of the others."""
    file = files.enter_context(load_library("pyarrow.parquet", path, "Parquet").ParquetFile(path))
    rows, schema = file.metadata.num_rows, file.schema_arrow
    clock = None
    for one in schema:
        if str(one.type).startswith("timestamp") and rows and clock is None:
            clock = stamp_clock(
                one.name, _Stream(partial(_parquet_values, file, one.name)).read, utc="tz=" in str(one.type)
            )
    for one in schema:
        if str(one.type).startswith(("double", "float", "int", "uint", "bool", "halffloat")):
            about = {key.decode(): value.decode(errors="replace") for key, value in (one.metadata or {}).items()}
            yield Channel(
                "", one.name, find_unit(about), rows, _Stream(partial(_parquet_values, file, one.name)).read, clock
            )


def _parquet_values(file: Any, name: str) -> Iterator[Any]:
    for part in file.iter_batches(batch_size=PORTION, columns=[name]):
        yield part.column(0).to_numpy(zero_copy_only=False)


READERS: Mapping[str, tuple[str, Callable[[str, ExitStack], Iterator[Channel]]]] = {
    ".tdms": ("TDMS", read_tdms),
    **dict.fromkeys((".mf4", ".mdf"), ("MDF", read_mdf)),
    **dict.fromkeys((".h5", ".hdf5"), ("HDF5", read_hdf5)),
    ".mat": ("MATLAB", read_matlab),
    ".parquet": ("Parquet", read_parquet),
}
