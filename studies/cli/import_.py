"""`hrg import`: laboratory files into the record format, by a map that states every change."""

from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from studies.cli.output import Answer, answers

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from studies.importing.mapping import ImportMap

    Columns = Mapping[str, NDArray[np.float64]]


@answers("hrg.import/1, with --draft hrg.import-draft/1")
def import_(
    *raw: str,
    map_: Annotated[str | None, Parameter(name="--map")] = None,
    out: str | None = None,
    draft: str | None = None,
    preview: str | None = None,
) -> Answer:
    """Bring laboratory files into the record format, or draft the map that says how.

    First 'hrg import RAW --draft MAP.toml', then read and correct the map, then 'hrg import RAW --map MAP.toml --out RUN.csv'.
    Several raw files, such as two loggers, are joined on their clocks onto the times of the first.
    What was changed is listed in the header of the record. Columns that name an axis make one record for each: RUN_x.csv,
    RUN_y.csv … All keys of a map: python -m pydoc studies.importing.mapping.

    Parameters
    ----------
    raw : str
        Raw files: text with any separator, or Excel workbooks; in the order of the map's [[file]] tables.
    map_ : str
        The map (schema hrg.map/1): columns, units, signs, clocks, resampling.
    out : str
        The record to write.
    draft : str
        Write a map drafted from the files instead; a file that exists is not overwritten.
    preview : str
        Write a page (HTML) that shows what was understood: every column over time, gaps, changes.
    """
    from studies.errors import InputError

    if not raw:
        raise InputError("the raw file is missing: 'hrg import RAW --draft MAP.toml' drafts a map from it.")
    if draft is not None and map_ is None and out is None:
        return (yield from _draft(raw, draft))
    if draft is not None or map_ is None or out is None:
        raise InputError("give either --draft MAP.toml, or both --map MAP.toml and --out RUN.csv.")
    return (yield from _import(raw, map_, out, preview))


def _draft(raw: tuple[str, ...], path: str) -> Answer:
    import os

    from studies.cli.output import say
    from studies.errors import InputError
    from studies.files.writing import write_text
    from studies.importing.draft import draft_map

    if os.path.exists(path):
        raise InputError(f"{path}: exists and is not overwritten; remove it or choose another name for the draft.")
    draft = draft_map(raw)
    write_text(path, draft.text)
    yield {"schema": "hrg.import-draft/1", "map": path, "mapped": draft.mapped, "left_over": draft.left_over}
    for note in draft.notes:
        say(note)
    say(
        f"{path}: drafted. Mapped: {', '.join(draft.mapped) or 'nothing'}. Left over: {', '.join(draft.left_over) or 'nothing'}."
    )
    say("Read it, correct what is marked with CHECK, then run hrg import with --map and --out.")


def _import(raw: tuple[str, ...], path: str, out: str, preview: str | None) -> Answer:
    from studies.cli.output import say
    from studies.files.writing import write_text
    from studies.importing.join import import_records
    from studies.importing.mapping import load_map
    from studies.record import write_record
    from studies.reports.preview import import_page

    import_map = load_map(path)
    if import_map.is_table:
        return (yield from _import_table(raw, import_map, out, preview))
    records = import_records(raw, import_map)
    files = {axis: _with_axis(out, axis) for axis in records}
    for axis, record in records.items():
        write_record(record, files[axis])
    if preview is not None:
        write_text(
            preview, import_page({files[axis]: record.columns for axis, record in records.items()}, record.comments)
        )
        say(f"preview: {preview}")
    described = [_payload(files[axis], record.columns, record.comments) for axis, record in records.items()]
    first = next(iter(records.values()))
    start = first.start.isoformat() if first.start else None
    more = {"axes": {axis: files[axis] for axis in records}} if len(records) > 1 else {}
    yield {"schema": "hrg.import/1", "start": start, **described[0], **more}
    for axis, record in records.items():
        _show(files[axis], record.columns)
    print("\n".join(record.comments))


def _import_table(raw: tuple[str, ...], import_map: "ImportMap", out: str, preview: str | None) -> Answer:
    from studies.cli.output import say
    from studies.errors import InputError
    from studies.files.writing import write_text
    from studies.importing.join import import_table
    from studies.reports.preview import import_page

    if len(raw) != 1:
        raise InputError(f"{import_map.path}: describes one table, but {len(raw)} raw files are given.")
    columns, notes = import_table(raw[0], import_map)
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    text = "".join(f"# {note}\n" for note in notes) + ",".join(columns) + "\n"
    write_text(out, text + "".join(",".join(f"{value:.12g}" for value in row) + "\n" for row in rows))
    if preview is not None:
        write_text(preview, import_page({out: columns}, notes))
        say(f"preview: {preview}")
    yield {"schema": "hrg.import/1", "start": None, **_payload(out, columns, notes)}
    _show(out, columns)
    print("\n".join(notes))


def _with_axis(out: str, axis: str) -> str:
    from pathlib import Path

    return str(Path(out).with_stem(f"{Path(out).stem}_{axis}")) if axis else out


def _payload(out: str, columns: "Columns", notes: "Sequence[str]") -> dict[str, Any]:
    import numpy as np

    return {
        "record": out,
        "rows": len(next(iter(columns.values()))),
        "columns": {name: {"missing": int(np.isnan(v).sum())} for name, v in columns.items()},
        "notes": list(notes),
    }


def _show(out: str, columns: "Columns") -> None:
    import numpy as np

    from studies.cli.output import print_table

    rows = []
    for name, values in columns.items():
        known = values[np.isfinite(values)]
        span = (f"{known.min():.8g}", f"{known.max():.8g}") if len(known) else ("", "")
        rows.append([name, *span, str(len(values) - len(known))])
    count = len(next(iter(columns.values())))
    print_table(f"{out}: {count} rows", ["Column", "Lowest", "Highest", "Missing"], rows)
