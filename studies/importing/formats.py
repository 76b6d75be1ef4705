"""How each format gives its channels: TDMS (npTDMS), MDF (asammdf), HDF5 and MATLAB 7.3 (h5py), MATLAB to 7.2 (scipy), Parquet (pyarrow)."""

import datetime
import importlib
import logging
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studies.errors import InputError, MissingEnvironment
from studies.files.reading import opened

Array = NDArray[np.float64]
KINDS = {
    ".tdms": "TDMS",
    ".mf4": "MDF",
    ".mdf": "MDF",
    ".h5": "HDF5",
    ".hdf5": "HDF5",
    ".mat": "MATLAB",
    ".parquet": "Parquet",
}
STEPS = ("dt", "wf_increment", "increment", "sample_period", "sampling_period", "sample_interval", "sampling_interval", "sample_period_s")  # fmt: skip
RATES = ("fs", "sample_rate", "sampling_rate", "samplerate", "sampling_frequency", "sample_rate_hz")
STARTS = ("start", "start_time", "wf_start_time")
UNITS = ("unit", "units", "unit_string")
NUMBERS = "iufb"
MOST_WIDE = 64  # columns of a matrix that are channels
OBJECT = "holds objects, not numbers, and is not opened: save it as plain numbers"
MATLAB = "is of a class that only MATLAB reads (datetime, table, object): save it as a plain vector"


@dataclass(frozen=True)
class Clock:
    """The clock of channels: `step` (s) of even rows or what reads the seconds of the first so many (−1: all), when it started.

    Channels whose clocks have one `key` have the same times.
    """

    key: str
    step: float | None = None
    read: Callable[[int], Array] | None = None
    start: datetime.datetime | None = None

    def seconds(self, rows: int, first: int = -1) -> Array:
        """Return the seconds of all rows, or of the first."""
        count = rows if first < 0 else min(rows, first)
        if self.step is not None:
            return np.asarray(self.step * np.arange(count))
        assert self.read is not None
        return self.read(-1 if first < 0 else count)


@dataclass(frozen=True)
class Channel:
    """One channel: group, name, unit, rows, what reads the first so many values (−1: all), its clock, or why it cannot be read."""

    group: str
    name: str
    unit: str
    rows: int
    read: Callable[[int], Array] = field(repr=False)
    clock: Clock | None = None
    refused: str = ""


def load_library(name: str, path: str | Path, kind: str) -> Any:
    """Return a library of the extra `formats`."""
    logging.getLogger(name.split(".")[0]).setLevel(logging.CRITICAL)  # what is wrong is told once, in a sentence
    try:
        return importlib.import_module(name)
    except ImportError:
        raise MissingEnvironment(f"{path}: {kind} needs {name}: pip install 'hrg-workbench[formats]'.") from None


def read_tdms(path: str, files: ExitStack) -> Iterator[Channel]:
    """Channels of a TDMS file; waveforms have their own clock, and a channel of time stamps is that of its group."""
    nptdms = load_library("nptdms", path, "TDMS")
    file = nptdms.TdmsFile.open(files.enter_context(opened(path)))
    if file.file_status.incomplete_final_segment:
        raise InputError(
            f"{path}: is cut off within its last block; copy it again, or stop the recording before copying."
        )
    for group in file.groups():
        stamps = next((c for c in group.channels() if c.dtype is not None and c.dtype.kind == "M"), None)
        for channel in group.channels():
            if channel.dtype is not None and channel.dtype.kind in NUMBERS and len(channel):
                clock = even_clock(channel.properties) or (
                    _stamp_clock(group.name, stamps) if stamps is not None else None
                )
                yield Channel(
                    group.name, channel.name, find_unit(channel.properties), len(channel), _tdms_values(channel), clock
                )


def _tdms_values(channel: Any) -> Callable[[int], Array]:
    return lambda n: np.asarray(channel.read_data(0, None if n < 0 else n), dtype=float)


def _stamp_clock(key: str, stamps: Any) -> Clock | None:
    first = stamps.read_data(0, 1)[:1]
    if not len(first) or np.isnat(first[0]):
        return None

    def read(n: int) -> Array:
        return np.asarray(
            (stamps.read_data(0, None if n < 0 else n) - first[0]) / np.timedelta64(1, "ns") * 1e-9, dtype=float
        )

    return Clock(f"stamps of {key}", read=read, start=_moment(first[0]))


def read_mdf(path: str, files: ExitStack) -> Iterator[Channel]:
    """Channels of an MDF file, with the master channel of their group as clock; readings marked invalid are missing."""
    file = files.enter_context(load_library("asammdf", path, "MDF").MDF(path))
    names: dict[str, int] = {}
    for place, group in enumerate(file.groups):
        master, rows = file.masters_db.get(place), int(group.channel_group.cycles_nr)
        name = getattr(group.channel_group, "acq_name", "") or f"group {place + 1}"
        names[name] = names.get(name, 0) + 1
        name = f"{name} #{names[name]}" if names[name] > 1 else name
        clock = None if master is None else Clock(name, read=_mdf_times(file, place), start=file.header.start_time)
        for index, channel in enumerate(group.channels):
            if index == master or not rows:
                continue
            read = _mdf_values(file, place, index)
            if file.get(group=place, index=index, record_count=1).samples.dtype.kind in NUMBERS:
                yield Channel(name, channel.name, str(channel.unit or ""), rows, read, clock)


def _mdf_times(file: Any, place: int) -> Callable[[int], Array]:
    return lambda n: np.asarray(file.get_master(place, record_count=None if n < 0 else n), dtype=float)


def _mdf_values(file: Any, place: int, index: int) -> Callable[[int], Array]:
    def read(n: int) -> Array:
        signal = file.get(
            group=place, index=index, record_count=None if n < 0 else n,
            ignore_invalidation_bits=True,
        )  # fmt: skip
        values = np.array(signal.samples, dtype=float)
        if (invalid := getattr(signal, "invalidation_bits", None)) is not None:
            values[np.asarray(invalid, dtype=bool)] = np.nan
        return values

    return read


def read_hdf5(path: str, files: ExitStack) -> Iterator[Channel]:
    """Channels of an HDF5 file: datasets of one or two dimensions, fields of compound ones, by group."""
    h5py = load_library("h5py", path, "HDF5")
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
            yield Channel(group, name, "", 0, _nothing, refused=MATLAB)
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
        own = _attributes(array)
        if array.dtype.kind in "OV" and not array.dtype.names:
            yield Channel(group, name, "", 0, _nothing, refused=MATLAB if "MATLAB_class" in own else OBJECT)
            continue
        if "MATLAB_object_decode" in own:
            yield Channel(group, name, "", 0, _nothing, refused=MATLAB)
            continue
        if own.get("MATLAB_class") == b"char" or array.ndim not in (1, 2):
            continue
        clock, unit = even_clock({**about, **single, **own}), find_unit(own)
        if array.dtype.names:
            for field in array.dtype.names:
                if array.dtype[field].kind in NUMBERS and array.ndim == 1:
                    yield Channel(group, f"{name}.{field}", "", array.shape[0], _slice(array, field=field), clock)
        elif array.dtype.kind in NUMBERS and array.ndim == 1:
            yield Channel(group, name, unit, array.shape[0], _slice(array), clock)
        elif array.dtype.kind in NUMBERS and min(array.shape) <= MOST_WIDE:
            along = int(np.argmax(array.shape))
            wide = array.shape[1 - along]
            for k in range(wide):
                yield Channel(
                    group,
                    f"{name}[{k + 1}]" if wide > 1 else name,
                    unit,
                    array.shape[along],
                    _slice(array, along, k),
                    clock,
                )


def _attributes(item: Any) -> dict[str, Any]:
    """Return the attributes that say something here; others may be anything, or damaged."""
    found = getattr(item, "attrs", {})
    said = (*STEPS, *RATES, *STARTS, *UNITS, "matlab_class", "matlab_object_decode")
    return {name: found[name] for name in found if name.lower() in said}


def _slice(array: Any, along: int | None = None, place: int = 0, field: str = "") -> Callable[[int], Array]:
    def read(n: int) -> Array:
        part = slice(None if n < 0 else n)
        if field:
            return np.asarray(array[part][field], dtype=float)
        if along is None:
            return np.asarray(array[part], dtype=float)
        return np.asarray(array[part, place] if along == 0 else array[place, part], dtype=float)

    return read


def read_parquet(path: str, files: ExitStack) -> Iterator[Channel]:
    """Columns of a Parquet file; the first one of time stamps is the clock of the others."""
    file = files.enter_context(load_library("pyarrow.parquet", path, "Parquet").ParquetFile(path))
    rows, schema = file.metadata.num_rows, file.schema_arrow
    kinds = [str(one.type) for one in schema]
    stamps = next((one.name for one, kind in zip(schema, kinds, strict=True) if kind.startswith("timestamp")), None)
    clock = None
    if stamps is not None and rows:
        first = _parquet_column(file, stamps, 1)[0]
        clock = Clock(
            stamps,
            read=lambda n: (_parquet_column(file, stamps, n) - first) / np.timedelta64(1, "ns") * 1e-9,
            start=_moment(first),
        )
    for one, kind in zip(schema, kinds, strict=True):
        if kind.startswith(("double", "float", "int", "uint", "bool", "halffloat")):
            about = {key.decode(): value.decode(errors="replace") for key, value in (one.metadata or {}).items()}
            yield Channel("", one.name, find_unit(about), rows, _parquet_values(file, one.name), clock)


def _parquet_values(file: Any, name: str) -> Callable[[int], Array]:
    return lambda n: np.asarray(_parquet_column(file, name, n), dtype=float)


def _parquet_column(file: Any, name: str, rows: int) -> Any:
    if rows < 0:
        return file.read(columns=[name]).column(0).to_numpy()
    return next(file.iter_batches(batch_size=max(rows, 1), columns=[name])).column(0).to_numpy(zero_copy_only=False)


def even_clock(about: Mapping[str, Any]) -> Clock | None:
    """Return the clock that properties such as dt, wf_increment or sample_rate state."""
    known = {str(name).lower(): value for name, value in about.items()}
    step = next((_number(known[name]) for name in STEPS if name in known), None)
    rate = next((_number(known[name]) for name in RATES if name in known), None)
    step = step or (1 / rate if rate else None)
    if step is None or not 0 < step < np.inf:
        return None
    start = next((moment for name in STARTS if name in known and (moment := _moment(known[name])) is not None), None)
    return Clock(f"{step!r} s from {start}", step=step, start=start)


def find_unit(about: Mapping[str, Any]) -> str:
    """Return the unit that properties state."""
    known = {str(name).lower(): value for name, value in about.items()}
    found = next((known[name] for name in UNITS if name in known), "")
    return found.decode(errors="replace") if isinstance(found, bytes) else str(found)


def _number(value: Any) -> float | None:
    try:
        return float(np.asarray(value).flat[0])
    except (TypeError, ValueError, IndexError):
        return None


def _moment(value: Any) -> datetime.datetime | None:
    """Return a moment (UTC) of a stamp; None where it is none, or the zero of a clock that was never set."""
    try:
        if isinstance(value, np.datetime64):
            found = value.astype("datetime64[us]").item()
        else:
            found = datetime.datetime.fromisoformat(value.decode() if isinstance(value, bytes) else str(value))
    except (ValueError, UnicodeDecodeError):
        return None
    if not isinstance(found, datetime.datetime) or found.year < 1970:
        return None
    return found if found.tzinfo is not None else found.replace(tzinfo=datetime.UTC)


def _nothing(_: int) -> Array:
    return np.empty(0)


READERS: Mapping[str, Callable[[str, ExitStack], Iterator[Channel]]] = {
    "TDMS": read_tdms,
    "MDF": read_mdf,
    "HDF5": read_hdf5,
    "MATLAB": read_matlab,
    "Parquet": read_parquet,
}
