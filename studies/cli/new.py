"""`hrg card new` and `hrg study new`: files of one's own to start from."""

import os
import tomllib
from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path
from shlex import quote
from typing import Annotated, Any

import tomli_w
from cyclopts import Parameter

from studies.cli.output import say
from studies.design.keys import DesignKeys
from studies.design.task import shipped_tasks
from studies.errors import InputError
from studies.files.reading import find_shipped, read_bytes
from studies.files.writing import write_text
from studies.instrument.card import build_instrument, load_card, spell_card
from studies.instrument.registry import card_tables
from studies.schema.keys import Keys
from studies.schema.reference import write_form
from studies.sweeps.keys import StudyKeys
from studies.sweeps.spec import shipped_specs


def card(path: str, *, like: str = "hrg-30mm", name: str | None = None) -> int:
    """Write a card template: a copy of a built-in card, with all other optional tables as comments.

    Args:
        path: The card (TOML) to write; an existing file is not overwritten.
        like: A built-in card (see hrg cards), or the path of a card, to copy.
        name: Name of the instrument; default: the name of the file.
    """
    _refuse_existing(path)
    model = load_card(like)
    note = {"note": "State here which values are measured, published or assumed."}
    own = replace(model, name=name or Path(path).stem, content={**model.content, **note})
    content, text = spell_card(own, path)
    build_instrument(content, path)
    head = "# Optional entries. Remove the # of a line to set it; entries left out have their documented default."
    lines = [text, head, *(f"# {line}".rstrip() for line in write_form(_other_tables(content)))]
    write_text(path, "\n".join(lines) + "\n")
    say(f"{path}: written as a copy of {like}. Edit it, then run: hrg modes {quote(path)}")
    return 0


OTHER = Parameter(name="--card", help="The card: a built-in one, or a path relative to the file.")
OtherCard = Annotated[str | None, OTHER]
NewFile = Annotated[str, Parameter(help="The file (TOML) to write; an existing one is not overwritten.")]


def study(path: NewFile, *, like: str = "dimension-tolerance", card_: OtherCard = None) -> int:
    """Write a template for the spec of a study.

    Args:
        like: A built-in study: frequency-over-temperature, dimension-tolerance, dimension-influence, split-tolerance.
    """
    return _copy(path, like, shipped_specs(), card_, StudyKeys, "study", f"hrg study run {quote(path)} --dry-run")


def design(path: NewFile, *, like: str = "dome-8khz", card_: OtherCard = None) -> int:
    """Write a template of a task for hrg optimise.

    Args:
        like: A worked design: dome-8khz, light-cylinder, robust-dome.
    """
    return _copy(path, like, shipped_tasks(), card_, DesignKeys, "design", f"hrg optimise {quote(path)} --out FOLDER")


def _copy(
    path: str, like: str, shipped: dict[str, Path], card_: str | None, keys: type[Keys], kind: str, then: str
) -> int:
    """Write a copy of a shipped file, for another card if one is given, with all entries that it may have as comments."""
    source = find_shipped(like, shipped, kind)
    _refuse_existing(path)
    text = read_bytes(source).decode("utf-8-sig")
    if card_ is not None:
        stated = tomllib.loads(text)["card"]
        old, new = (tomli_w.dumps({"card": one}).rstrip("\n") for one in (stated, card_))
        text = text.replace(old, new)
    form = [f"All entries of a {kind}, by example:", *write_form([(keys, "")])]
    write_text(path, "\n".join([text.rstrip("\n"), "", *(f"# {line}".rstrip() for line in form)]) + "\n")
    say(f"{path}: written as a copy of {like}. Edit it, then run: {then}")
    return 0


def _refuse_existing(path: str) -> None:
    if os.path.lexists(path):
        raise InputError(f"{path}: already exists and is not overwritten; remove it or choose another name.")


def _other_tables(present: Collection[str]) -> Iterator[tuple[Any, str]]:
    for name, entries in card_tables().items():
        for entry in entries if name not in (*present, "posterior") else ():
            keys = entry.keys if entry.keys_of is None else entry.keys_of({"name": "second-lag"}, "")
            yield keys, f"[{name}]" if entry.keys_of is None else f"[[{name}]]"
