"""Records written for other programs: MATLAB, TDMS, MDF, HDF5, Parquet, with units and what the record's header says."""

from collections.abc import Callable, Mapping
from io import BytesIO
from typing import IO, Any

from studies.files.writing import written_whole
from studies.importing.formats import load_library
from studies.instrument.units import unit_of
from studies.record import Record, header_notes, write_record

GROUP = "record"


def export_record(record: Record, kind: str, path: str) -> None:
    """Write a record in another format, whole or not at all; MissingEnvironment where the library that writes it is not installed."""
    if kind in ("csv", "parquet"):
        write_record(record, path)
        return
    with written_whole(path) as file:
        WRITERS[kind](record, file)


def _unit(name: str) -> str:
    return "s" if name == "time_s" else unit_of(name).removeprefix("1")


def write_matlab(record: Record, file: IO[bytes]) -> None:
    """A .mat file (version 5): a column vector for each column, and `notes`."""
    from scipy.io import savemat

    columns = {name: values[:, None] for name, values in record.columns.items()}
    made = BytesIO()
    savemat(made, {**columns, "notes": "\n".join(header_notes(record))}, do_compression=True, long_field_names=True)  # type: ignore[arg-type]
    file.write(made.getvalue())


def write_tdms(record: Record, file: IO[bytes]) -> None:
    """A TDMS file: one group with a channel for each column."""
    nptdms = load_library("nptdms", "--to tdms", "TDMS")
    about = {"instrument": record.instrument, "source": record.source, "notes": "\n".join(header_notes(record))}
    channels = [
        nptdms.ChannelObject(GROUP, name, values, {"unit_string": _unit(name)})
        for name, values in record.columns.items()
    ]
    with nptdms.TdmsWriter(file) as writer:
        writer.write_segment([nptdms.RootObject(about), nptdms.GroupObject(GROUP), *channels])


def write_hdf5(record: Record, file: IO[bytes]) -> None:
    """An HDF5 file: a dataset for each column."""
    h5py = load_library("h5py", "--to hdf5", "HDF5")
    with h5py.File(file, "w") as out:
        out.attrs["notes"] = "\n".join(header_notes(record))
        for name, values in record.columns.items():
            out.create_dataset(name, data=values, compression="gzip").attrs["unit"] = _unit(name)


def write_mdf(record: Record, file: IO[bytes]) -> None:
    """An MDF 4 file: one group, with the time as its master."""
    asammdf = load_library("asammdf", "--to mf4", "MDF")
    time = record["time_s"]
    with asammdf.MDF(version="4.10") as out:
        if record.start is not None:
            out.start_time = record.start
        signals: list[Any] = [
            asammdf.Signal(values, time, name=name, unit=_unit(name))
            for name, values in record.columns.items()
            if name != "time_s"
        ]
        out.append(signals, comment="; ".join(header_notes(record)))
        made = BytesIO()
        out.save(made)
        file.write(made.getvalue())


WRITERS: Mapping[str, Callable[[Record, IO[bytes]], None]] = {
    "mat": write_matlab,
    "tdms": write_tdms,
    "hdf5": write_hdf5,
    "mf4": write_mdf,
}
