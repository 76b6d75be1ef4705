"""`hrg keys`: the keys of the files that people write, from their declaration."""

from collections.abc import Iterator
from importlib import import_module
from typing import Any

from studies.cli.output import answers
from studies.errors import InputError, nearest
from studies.instrument.registry import card_tables
from studies.results import Result, Table
from studies.schema.reference import list_keys, spell_uncertainty

COLUMNS = "key | unit | shown: default | bounds | uncertainty: known to | type | meaning"


@answers("hrg.keys/1")
def keys(kind: str = "card", *, table: str = "") -> Result:
    """List the keys of a file with their units, defaults, bounds and meaning.

    Args:
        kind: card, study, design (hrg optimise), map (hrg import), model (hrg fit), limits (hrg acceptance) or material (a table for a card's [material] file).
        table: Only the keys of this table and the tables in it, such as thermal or loss.film.
    """
    if kind not in KINDS:
        raise InputError(f"there are no keys of '{kind}'{nearest(kind, KINDS)}")
    rows = [row for row in _keys_of(kind) if not table or f"{row['table'].strip('[]')}.".startswith(f"{table}.")]
    if not rows and kind == "card" and table == "effect":
        raise InputError("the keys of an [[effect]] depend on its name: hrg effects NAME lists them.")
    if not rows:
        names = {row["table"].strip("[]") for row in _keys_of(kind)} - {""}
        raise InputError(f"a {kind} has no table '{table}'{nearest(table, names)}")
    tables: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        default = "required" if row["required"] else "" if row["default"] is None else str(row["default"])
        heading = " with ".join(filter(None, (row["table"] or "At the top", row.get("only", ""))))
        tables.setdefault(heading, []).append(row | {"shown": default, "uncertainty": spell_uncertainty(row)})
    shown = [Table(heading, found, COLUMNS) for heading, found in tables.items()]
    lead = "A plain number in a card is as uncertain as its key says here."
    return Result({"kind": kind, "keys": rows}, f"Keys of a {kind}", lead, shown)


KINDS = {
    # what people write: the class that declares its keys
    "card": "studies.instrument.card:Head",
    "study": "studies.sweeps.keys:StudyKeys",
    "design": "studies.design.keys:DesignKeys",
    "map": "studies.importing.mapping:ImportMap",
    "model": "studies.models.file:ModelKeys",
    "limits": "studies.acceptance.limits:Limits",
    "material": "studies.instrument.material_file:MaterialFile",
}


def _keys_of(kind: str) -> Iterator[dict[str, Any]]:
    module, name = KINDS[kind].split(":")
    yield from list_keys(getattr(import_module(module), name))
    for table, entries in card_tables().items() if kind == "card" else ():
        for entry in entries:
            if entry.keys is not None:  # those of an [[effect]] depend on its name: hrg effects NAME
                yield from list_keys(entry.keys, f"[{table}]")
