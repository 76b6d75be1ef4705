"""`hrg keys`: the keys of the files that people write, from their declaration."""

from collections.abc import Iterator, Mapping
from typing import Any

from studies.cli.output import answers
from studies.results import Column, Result, Table

COLUMNS = (
    Column("key", "key"),
    Column("unit", "unit"),
    Column("default_words", "default"),
    Column("bounds", "bounds"),
    Column("uncertainty", "known to"),
    Column("type", "type"),
    Column("meaning", "meaning"),
)


@answers("hrg.keys/1")
def keys(kind: str = "card", *, table: str = "") -> Result:
    """List the keys of a file with their units, defaults, bounds and meaning.

    Parameters
    ----------
    kind : str
        card, study, map (of hrg import), model (of hrg fit and hrg compensate) or limits (of hrg acceptance).
    table : str
        Only the keys of this table and the tables in it, such as thermal or loss.film.
    """
    from studies.errors import InputError, nearest

    if kind not in KINDS:
        raise InputError(f"there are no keys of '{kind}'{nearest(kind, KINDS)}")
    rows = [row for row in KINDS[kind]() if not table or f"{row['table'].strip('[]')}.".startswith(f"{table}.")]
    if not rows:
        names = {row["table"].strip("[]") for row in KINDS[kind]()} - {""}
        raise InputError(f"a {kind} has no table '{table}'{nearest(table, names)}")
    headings = list(dict.fromkeys((row["table"], row.get("only", "")) for row in rows))
    tables = [
        Table(
            " with ".join(word for word in (name or "At the top", only) if word),
            [{**row, **_words(row)} for row in rows if (row["table"], row.get("only", "")) == (name, only)],
            COLUMNS,
        )
        for name, only in headings
    ]
    payload = {"schema": "hrg.keys/1", "kind": kind, "keys": rows}
    return Result(
        payload, f"Keys of a {kind}", "A plain number in a card is as uncertain as its key says here.", tables
    )


def _words(row: Mapping[str, Any]) -> dict[str, str]:
    """Return default and uncertainty as people read them."""
    from studies.schema.reference import spell_uncertainty

    default = "required" if row["required"] else "" if row["default"] is None else str(row["default"])
    return {"uncertainty": spell_uncertainty(row), "default_words": default}


def _card() -> Iterator[dict[str, Any]]:
    from studies.instrument.card import Head
    from studies.instrument.registry import card_tables
    from studies.schema.reference import list_keys

    yield from list_keys(Head)
    for name, entries in card_tables().items():
        for entry in entries:
            if entry.keys is not None:  # those of an [[effect]] depend on its name: hrg effects NAME
                yield from list_keys(entry.keys, f"[{name}]")


def _map() -> Iterator[dict[str, Any]]:
    from studies.importing.mapping import ImportMap
    from studies.schema.reference import list_keys

    yield from list_keys(ImportMap)


def _model() -> Iterator[dict[str, Any]]:
    from studies.models.file import ModelKeys
    from studies.schema.reference import list_keys

    yield from list_keys(ModelKeys)


def _limits() -> Iterator[dict[str, Any]]:
    from studies.acceptance.limits import Limits
    from studies.schema.reference import list_keys

    yield from list_keys(Limits)


def _study() -> Iterator[dict[str, Any]]:
    from studies.schema.reference import list_keys
    from studies.sweeps.keys import StudyKeys

    yield from list_keys(StudyKeys)


KINDS = {"card": _card, "study": _study, "map": _map, "model": _model, "limits": _limits}
