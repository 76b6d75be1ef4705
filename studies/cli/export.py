"""`hrg export`: a record for other programs.

With --json one object, schema `hrg.export/1`: `record`, `to`, `out`, `rows`, `columns`.
"""

from pathlib import Path
from typing import Literal

from studies.cli.output import answers
from studies.errors import InputError
from studies.record import read_record
from studies.results import Result, Sentence

ENDINGS = {"csv": (".csv",), "parquet": (".parquet",), "mat": (".mat",), "tdms": (".tdms",), "mf4": (".mf4",), "hdf5": (".h5", ".hdf5")}  # fmt: skip


@answers("hrg.export/1", page=False)
def export(run: str, *, to: Literal["parquet", "mat", "tdms", "csv", "mf4", "hdf5"], out: str) -> Result:
    """Write a record for other programs; 'hrg import' reads all of these formats back to the last digit.

    Parameters
    ----------
    run : str
        The record (CSV or Parquet).
    to : str
        Format: Parquet, MATLAB (.mat, version 5), TDMS, CSV, MDF 4 or HDF5. Units and notes of the record go with it.
    out : str
        File to write.
    """
    if Path(out).suffix.lower() not in ENDINGS[to]:
        raise InputError(f"--out {out}: give a name that ends in {ENDINGS[to][0]} for --to {to}.")
    record = read_record(run)
    from studies.exporting import export_record

    export_record(record, to, out)
    payload = {"schema": "hrg.export/1", "record": run, "to": to, "out": out, "rows": len(record), "columns": list(record.columns)}  # fmt: skip
    said = f"{out}: {len(record):,} rows of {', '.join(record.columns)}."
    return Result(payload, "Export", parts=[Sentence(said)])
