"""`hrg export`: a record for other programs: MATLAB, TDMS, MDF, HDF5, Parquet, with units and what the record's header says."""

from collections.abc import Callable, Mapping
from io import BytesIO
from pathlib import Path
from typing import IO, Any, Literal

from studies.cli.arguments import Out, Run
from studies.cli.output import answers
from studies.errors import InputError
from studies.files.reading import load_library
from studies.files.writing import written_whole
from studies.instrument.units import unit_of
from studies.record import Record, read_record, write_record
from studies.results import Result, Sentence

ENDINGS = {"csv": (".csv",), "parquet": (".parquet",), "mat": (".mat",), "tdms": (".tdms",), "mf4": (".mf4",), "hdf5": (".h5", ".hdf5")}  # fmt: skip

UNDATED = ("mat", "tdms", "hdf5")
"""Formats in which a record's time has no clock that began at a date."""


@answers("hrg.export/1", page=False)
def export(run: Run, *, to: Literal["parquet", "mat", "tdms", "csv", "mf4", "hdf5"], out: Out) -> Result:
    """Write a record for other programs; 'hrg import' reads all of these formats back to the last digit.

    Args:
        to: Format: Parquet, MATLAB (.mat, version 5), TDMS, CSV, MDF 4 or HDF5, with units and notes of the record.
    """
    if Path(out).suffix.lower() not in ENDINGS[to]:
        raise InputError(f"--out {out}: give a name that ends in {ENDINGS[to][0]} for --to {to}.")
    record = read_record(run)
    if to in WRITERS:
        with written_whole(out) as file:
            WRITERS[to](record, file)
    else:
        write_record(record, out)
    payload = {"record": run, "to": to, "out": out, "rows": len(record), "columns": list(record.columns)}  # fmt: skip
    parts = [Sentence(f"{out}: {len(record):,} rows of {', '.join(record.columns)}.")]
    if record.start is not None and to in UNDATED:
        moment = record.start.isoformat()
        parts.append(Sentence(f"Its start is in the notes only; hrg import takes it from the map: start = {moment}."))
    return Result(payload, "Export", parts=parts)


GROUP = "record"


def _unit(name: str) -> str:
    return "s" if name == "time_s" else unit_of(name).removeprefix("1")


def write_matlab(record: Record, file: IO[bytes]) -> None:
    """A .mat file (version 5): a column vector for each column, and `notes`."""
    from scipy.io import savemat

    columns = {name: values[:, None] for name, values in record.columns.items()}
    made = BytesIO()
    savemat(made, {**columns, "notes": "\n".join(record.notes)}, do_compression=True, long_field_names=True)  # type: ignore[arg-type]
    file.write(made.getvalue())


def write_tdms(record: Record, file: IO[bytes]) -> None:
    """A TDMS file: one group with a channel for each column."""
    nptdms = load_library("nptdms", "--to tdms", "TDMS")
    about = {"instrument": record.instrument, "source": record.source, "notes": "\n".join(record.notes)}
    channels = [nptdms.ChannelObject(GROUP, key, y, {"unit_string": _unit(key)}) for key, y in record.columns.items()]
    with nptdms.TdmsWriter(file) as writer:
        writer.write_segment([nptdms.RootObject(about), nptdms.GroupObject(GROUP), *channels])


def write_hdf5(record: Record, file: IO[bytes]) -> None:
    """An HDF5 file: a dataset for each column."""
    h5py = load_library("h5py", "--to hdf5", "HDF5")
    with h5py.File(file, "w") as out:
        out.attrs["notes"] = "\n".join(record.notes)
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
        out.append(signals, comment="; ".join(record.notes))
        made = BytesIO()
        out.save(made)
        file.write(made.getvalue())


WRITERS: Mapping[str, Callable[[Record, IO[bytes]], None]] = {
    "mat": write_matlab,
    "tdms": write_tdms,
    "hdf5": write_hdf5,
    "mf4": write_mdf,
}
