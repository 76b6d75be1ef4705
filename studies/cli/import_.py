"""`hrg import`: laboratory files into the record format, by a map that states every change."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from compensation.arrays import Array
from studies.cli.arguments import Files
from studies.cli.output import answers
from studies.errors import InputError
from studies.files.writing import write_numbers, write_text
from studies.importing.draft import draft_map
from studies.importing.join import import_records, import_table
from studies.importing.mapping import LoadedMap, load_map
from studies.record import write_record
from studies.record.survey import find_range
from studies.reports.columns import draw_columns
from studies.reports.survey import COLUMNS
from studies.results import Chapter, Column, Figure, Result, Sentence, Table, row_of, rows_of

Columns = Mapping[str, Array]

FIRST_ROWS = 5


@answers("hrg.import/1, with --draft hrg.import-draft/1")
def import_(
    *raw: Files,
    map_: Annotated[str | None, Parameter(name="--map")] = None,
    out: str | None = None,
    draft: str | None = None,
) -> Result:
    """Convert laboratory files to the record format, or draft the map that describes the conversion.

    First 'hrg import RAW --draft MAP.toml', then read and correct the map, then 'hrg import RAW --map MAP.toml --out RUN.csv'.
    Several raw files, such as those of two loggers, are joined by their clocks on the times of the first. The header of the
    record lists every change; --report shows each column over time. Columns that name an axis give one record per axis:
    RUN_x.csv, RUN_y.csv … All keys of a map: hrg keys map.

    The draft of a TDMS, MDF, HDF5, MATLAB or Parquet file lists its groups and channels with their units; channels of another rate
    are brought onto the times of the first group (mean, nearest, linear or previous). Spikes, stuck readings and dropouts to 0 are
    counted and left as they are, unless the map says drop. Raw decays become files for hrg fit ringdown (pickoff_cos_V, power_dBm …). An --out that ends in .parquet is a Parquet file.

    Args:
        raw: Text with any separator (.gz too), Excel workbooks, TDMS, MDF, HDF5, MATLAB or Parquet, in the map's order.
        map_: The map (schema hrg.map/1): columns, units, signs, clocks, resampling.
        out: The record to write (.csv or .parquet).
        draft: Draft a map from the files instead; an existing file is not overwritten.
    """
    if draft is not None and map_ is None and out is None:
        return _draft(raw, draft)
    if draft is not None or map_ is None or out is None:
        raise InputError("give either --draft MAP.toml, or both --map MAP.toml and --out RUN.csv.")
    return _import(raw, map_, out)


def _draft(raw: tuple[str, ...], path: str) -> Result:
    if os.path.exists(path):
        raise InputError(f"{path}: exists and is not overwritten; remove it or choose another name for the draft.")
    draft = draft_map(raw)
    write_text(path, draft.text)
    mapped, left = (", ".join(names) or "none" for names in (draft.mapped, draft.left_over))
    return Result(
        {"schema": "hrg.import-draft/1", "map": path, **row_of(draft, "mapped", "left_over")},
        "Draft of a map",
        "What was recognized in the raw files.",
        [
            *(Sentence(note, "note") for note in draft.notes),
            f"{path}: drafted. Mapped columns: {mapped}. Unmapped columns: {left}.",
            "Next: read the map, correct the lines marked CHECK, then run hrg import with --map and --out."
            if draft.mapped
            else "No column was recognised. Next: in the map, take the # off the blocks of columns that belong to the record and fill in 'to' and 'unit'.",
        ],
    )


def _import(raw: tuple[str, ...], path: str, out: str) -> Result:
    import_map = load_map(path)
    if import_map.is_table:
        return _import_table(raw, import_map, out)
    records = import_records(raw, import_map, str(Path(out).parent))
    files = {axis: str(Path(out).with_stem(f"{Path(out).stem}_{axis}")) if axis else out for axis in records}
    for axis, record in records.items():
        write_record(record, files[axis])
    first = next(iter(records.values()))
    start, more = first.start.isoformat() if first.start else None, {"axes": files} if len(records) > 1 else {}
    return _show({files[axis]: record.columns for axis, record in records.items()}, first.comments, start, more)


def _import_table(raw: tuple[str, ...], import_map: LoadedMap, out: str) -> Result:
    if len(raw) != 1:
        raise InputError(f"{import_map.path}: describes one table, but {len(raw)} raw files are given.")
    columns, notes = import_table(raw[0], import_map)
    write_numbers(out, columns, ".12g", notes)
    return _show({out: columns}, notes, None, {})


def _show(records: Mapping[str, Columns], notes: Sequence[str], start: str | None, more: dict[str, Any]) -> Result:
    out, columns = next(iter(records.items()))
    payload: dict[str, Any] = {"start": start, "record": out, "rows": len(next(iter(columns.values())))}
    chapters = []
    for name, found in records.items():
        looked = [find_range(key, values, found.get("time_s")) for key, values in found.items()]
        missing = {"columns": {one.name: {"missing": one.missing} for one in looked}}
        payload = {**payload, **({} if "columns" in payload else missing)}
        ranges = [one.as_row() for one in looked]
        rows = rows_of({key: values[:FIRST_ROWS] for key, values in found.items()})
        caption = "All columns." + (" Shaded: no values." if "time_s" in found else "")
        chapters.append(Chapter(name, [
            Figure(lambda found=found: draw_columns(found), caption),  # type: ignore[misc]
            Table(f"{name}: {len(next(iter(found.values()))):,} rows", ranges, COLUMNS),
            Table("First rows", rows, [Column(key, key, form=".10g") for key in found], where="page"),
        ]))  # fmt: skip
    payload |= {"notes": notes, **more}
    checks = [Sentence(note, "note") for note in notes if "CHECK" in note]
    chapters.append(Chapter("Changes", [Sentence("\n".join(notes), "source")]))
    lead = "The data as converted. Compare them with what you know about the run before you use them."
    return Result(payload, "Import", lead, [*checks, *chapters])
