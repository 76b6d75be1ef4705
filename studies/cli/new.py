"""`hrg card new` and `hrg study new`: files of one's own to start from."""

import os
import tomllib
from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from pathlib import Path
from shlex import quote
from typing import Annotated, Any

from cyclopts import Parameter

from studies.cli.output import say
from studies.design.keys import DesignKeys
from studies.design.task import read_task, shipped_tasks
from studies.errors import InputError
from studies.files.reading import find_shipped
from studies.files.writing import write_text
from studies.instrument.card import build_instrument, load_card, spell_card
from studies.instrument.registry import card_tables
from studies.schema.keys import Keys, spell_value
from studies.schema.reader import read_text
from studies.schema.reference import write_form
from studies.sweeps.keys import StudyKeys
from studies.sweeps.parameters import find_nominal
from studies.sweeps.spec import read_study, shipped_specs


def card(path: str, *, like: str = "hrg-30mm", name: str | None = None) -> None:
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
    check = "cards" if "law" in content else "modes"
    say(f"{path}: written as a copy of {like}. Edit it, then run: hrg {check} {quote(path)}")


OTHER = Parameter(name="--card", help="The card: a built-in one, or a path relative to the file.")
OtherCard = Annotated[str | None, OTHER]
NewFile = Annotated[str, Parameter(help="The file (TOML) to write; an existing one is not overwritten.")]


def study(path: NewFile, *, like: str = "dimension-tolerance", card_: OtherCard = None) -> None:
    """Write a template for the spec of a study.

    Args:
        like: A built-in study: frequency-over-temperature, dimension-tolerance, dimension-influence, split-tolerance.
    """
    text = _copy(like, shipped_specs(), card_, "study")
    _write(path, text, StudyKeys, read_study, "study", f"hrg study run {quote(path)} --dry-run")


def design(path: NewFile, *, like: str | None = None, card_: OtherCard = None) -> None:
    """Write a template of a task for hrg optimise.

    Args:
        like: A worked design: dome-8khz (default), light-cylinder, robust-dome; with --card by default a task for the wall
            and the radius of that card.
    """
    if card_ and not like:
        text = _own_task(path, card_)
    else:
        text = _copy(like or "dome-8khz", shipped_tasks(), card_, "design")
    _write(path, text, DesignKeys, read_task, "design", f"hrg optimise {quote(path)} --out FOLDER")


def _own_task(path: str, card_: str) -> str:
    """Return a task that any card can have: other modes far away, at the frequency that it has."""
    instrument = load_card(Path(path).parent / card_ if card_.endswith(".toml") else card_)
    text = OWN_TASK.format(spell_value(card_))
    _ = instrument.resonator  # a card without one says so
    for name in ("resonator.thickness_mm", "resonator.radius_mm"):
        if name.split(".")[1] in instrument.content["resonator"]:
            value = float(find_nominal(instrument, name, card_) or 0.0)
            text += f'\n[[parameter]]\nname = "{name}"\nlow = {0.9 * value:.4g}\nhigh = {1.1 * value:.4g}\n'
    return text


OWN_TASK = """# Other modes as far from n = 2 as can be, within 50 Hz of the frequency that the card has
schema = "hrg.design/1"
card = {}

[[objective]]
column = "separation_n2_Hz"
goal = "greatest"

[[constraint]]
column = "frequency_n2_Hz"
within = 50.0
"""


def _copy(like: str, shipped: dict[str, Path], card_: str | None, kind: str) -> str:
    """Return the text of a shipped file, for another card if one is given."""
    text = read_text(find_shipped(like, shipped, kind))
    if card_ is None:
        return text
    old, new = (f"card = {spell_value(one)}" for one in (tomllib.loads(text)["card"], card_))
    return text.replace(old, new)


def _write(path: str, text: str, keys: type[Keys], read: Callable[..., Any], kind: str, then: str) -> None:
    """Write a file that fits its card, with all entries that it may have as comments."""
    _refuse_existing(path)
    form = [f"All entries of a {kind}, by example:", *write_form([(keys, "")])]
    whole = "\n".join([text.rstrip("\n"), "", *(f"# {line}".rstrip() for line in form)]) + "\n"
    try:
        read(path, text=whole)
    except InputError as error:
        raise InputError(f"not written, since it does not fit the card: {error}") from None
    write_text(path, whole)
    say(f"{path}: written. Edit it, then run: {then}")


def _refuse_existing(path: str) -> None:
    if os.path.lexists(path):
        raise InputError(f"{path}: already exists and is not overwritten; remove it or choose another name.")


def _other_tables(present: Collection[str]) -> Iterator[tuple[Any, str]]:
    for name, entries in card_tables().items():
        for entry in entries if name not in (*present, "posterior") else ():
            keys = entry.keys if entry.keys_of is None else entry.keys_of({"name": "second-lag"}, "")
            yield keys, f"[{name}]" if entry.keys_of is None else f"[[{name}]]"
