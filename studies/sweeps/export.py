"""The table of a study for other programs: CSV, a Parquet file, or a data set of many; some thousand cases in memory at a time."""

import csv
import io
import json
from collections.abc import Iterator
from itertools import chain, islice
from pathlib import Path
from typing import Any

from studies.errors import InputError
from studies.files.parquet import is_parquet
from studies.files.paths import beside
from studies.files.reading import load_library
from studies.files.writing import check_folder, write_text, written_whole
from studies.sweeps.results import Results

UNITS = ".units.json"  # of a table of results, beside it
GROUP = 32_768  # cases in a row group of a Parquet file


def export_results(results: Results, path: str | Path, part_rows: int = 1_000_000) -> Path:
    """Write the table (a folder of Parquet files without an ending) with every digit, and `NAME.units.json`, whose path is returned."""
    if is_parquet(path):
        _write_parquet(_tables(results, path, GROUP), path)
    elif Path(path).suffix:
        _write_csv(results, path)
    else:
        folder = check_folder(path)
        if any(folder.glob("*.parquet")):
            raise InputError(f"{path}: the folder holds Parquet files; choose another one, so that no old part stays.")
        groups = -(-part_rows // GROUP)
        tables = _tables(results, path, -(-part_rows // groups))
        for number, first in enumerate(tables):
            _write_parquet(chain([first], islice(tables, groups - 1)), folder / f"part-{number:05d}.parquet")
    units = beside(path, UNITS)
    attributes = {"study": results.study.name, "units": results.units}
    write_text(units, json.dumps(attributes, indent=2, ensure_ascii=False) + "\n")
    return units


def _tables(results: Results, path: str | Path, rows: int) -> Iterator[Any]:
    """Give the table in pieces of so many rows, the last one shorter; units stand with the columns."""
    arrow = load_library("pyarrow", path, "Parquet")
    kept, count, units, schema = [], 0, results.units, None
    for frame in results.frames():
        table = arrow.Table.from_pandas(frame, schema, preserve_index=False)
        if schema is None:
            fields = (f.with_metadata({"unit": units[f.name]}) if f.name in units else f for f in table.schema)
            schema = arrow.schema(list(fields), {"study": results.study.name})
        kept.append(table.cast(schema))
        count += table.num_rows
        while count >= rows:
            whole = arrow.concat_tables(kept)
            yield whole.slice(0, rows)
            count -= rows
            kept = [whole.slice(rows)] if count else []  # an empty one would keep all rows before it
    if schema is None:
        raise InputError(f"{path}: nothing to export: no design of the study has been computed.")
    if count:
        yield arrow.concat_tables(kept)


def _write_parquet(tables: Iterator[Any], path: str | Path) -> None:
    parquet = load_library("pyarrow.parquet", path, "Parquet")
    first = next(tables)
    with written_whole(path) as file, parquet.ParquetWriter(file, first.schema, compression="zstd") as writer:
        for table in chain([first], tables):
            writer.write_table(table)


def _write_csv(results: Results, path: str | Path) -> None:
    with written_whole(path) as file:
        text = io.TextIOWrapper(file, "utf-8", newline="")
        csv.writer(text, lineterminator="\n").writerow(map(_harmless, results.header))
        for frame in results.frames():
            for name in frame.select_dtypes(exclude="number"):
                frame[name] = frame[name].map(_harmless)
            frame.to_csv(text, header=False, index=False, lineterminator="\n")
        text.flush()
        text.detach()


def _harmless(cell: str) -> str:
    """Return a text that no spreadsheet takes for a formula."""
    return f"'{cell}" if cell.startswith(("=", "+", "-", "@", "\t")) else cell
