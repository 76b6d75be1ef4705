"""`hrg import`: laboratory files into the record format, by a map that states every change."""

from typing import Annotated

from cyclopts import Parameter


def import_(
    *raw: str,
    map_: Annotated[str | None, Parameter(name="--map")] = None,
    out: str | None = None,
    draft: str | None = None,
    json: bool = False,
) -> int:
    """Bring laboratory files into the record format, or draft the map that says how.

    First 'hrg import RAW --draft MAP.toml', then read and correct the map, then 'hrg import RAW --map MAP.toml --out RUN.csv'.
    Several raw files, such as two loggers, are joined on their clocks onto the times of the first.
    What was changed is listed in the header of the record. All keys of a map: python -m pydoc studies.importing.mapping.

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
    json : bool
        Print one JSON object (schema hrg.import/1): rows, columns, missing values, notes.
    """
    from studies.errors import InputError

    if not raw:
        raise InputError("the raw file is missing: 'hrg import RAW --draft MAP.toml' drafts a map from it.")
    if draft is not None and map_ is None and out is None:
        return _draft(raw, draft, json)
    if draft is not None or map_ is None or out is None:
        raise InputError("give either --draft MAP.toml, or both --map MAP.toml and --out RUN.csv.")
    return _import(raw, map_, out, json)


def _draft(raw: tuple[str, ...], path: str, json: bool) -> int:
    from pathlib import Path

    from studies.cli.output import print_json, say
    from studies.errors import InputError
    from studies.files.writing import write_text
    from studies.importing.draft import draft_map

    if Path(path).exists():
        raise InputError(f"{path}: exists and is not overwritten; remove it or choose another name for the draft.")
    draft = draft_map(raw)
    write_text(path, draft.text)
    if json:
        print_json({"schema": "hrg.import-draft/1", "map": path, "mapped": draft.mapped, "left_over": draft.left_over})
        return 0
    say(
        f"{path}: drafted. Mapped: {', '.join(draft.mapped) or 'nothing'}. Left over: {', '.join(draft.left_over) or 'nothing'}."
    )
    say("Read it, correct what is marked with CHECK, then run hrg import with --map and --out.")
    return 0


def _import(raw: tuple[str, ...], path: str, out: str, json: bool) -> int:
    import numpy as np

    from studies.cli.output import print_json, print_table
    from studies.importing.join import import_record
    from studies.importing.mapping import load_map
    from studies.record import write_record

    record = import_record(raw, load_map(path))
    write_record(record, out)
    if json:
        print_json(
            {
                "schema": "hrg.import/1",
                "record": out,
                "rows": len(record),
                "start": record.start.isoformat() if record.start else None,
                "columns": {name: {"missing": int(np.isnan(v).sum())} for name, v in record.columns.items()},
                "notes": list(record.comments),
            }
        )
        return 0
    rows = []
    for name, values in record.columns.items():
        known = values[np.isfinite(values)]
        span = (f"{known.min():.8g}", f"{known.max():.8g}") if len(known) else ("", "")
        rows.append([name, *span, str(len(values) - len(known))])
    print_table(f"{out}: {len(record)} rows", ["Column", "Lowest", "Highest", "Missing"], rows)
    print("\n".join(record.comments))
    return 0
