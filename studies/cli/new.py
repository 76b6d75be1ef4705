"""`hrg card new` and `hrg study new`: files of one's own to start from."""

from collections.abc import Iterator
from typing import Annotated

from cyclopts import Parameter


def card(path: str, *, like: str = "hrg-30mm", name: str | None = None) -> int:
    """Write a card template: a copy of a built-in card, with all other optional tables as comments.

    Parameters
    ----------
    path : str
        The card (TOML) to write; an existing file is not overwritten.
    like : str
        A built-in card (see hrg cards), or the path of a card, to copy.
    name : str
        Name of the instrument; default: the name of the file.
    """
    from dataclasses import replace
    from pathlib import Path

    from studies.cli.output import say
    from studies.files.writing import write_text
    from studies.instrument.card import build_instrument, load_card, spell_card

    _refuse_existing(path)
    model = load_card(like)
    note = {"note": "State here which values are measured, published or assumed."}
    own = replace(model, name=name or Path(path).stem, content={**model.content, **note})
    content, text = spell_card(own, path)
    build_instrument(content, path)
    lines = [
        text,
        "# Optional entries. Remove the # of a line to set it; entries left out have their documented default.",
    ]
    headings: set[str] = set()
    for block in _forms(set(content)):
        heading = block[0].partition("]")[0] + "]"
        again = heading in headings and not heading.startswith("[[")
        headings.add(heading)
        more = [f"more keys of {heading}", *block[1:]] if again else block  # a table may be opened once
        lines += [f"# {line}".rstrip() for line in ("", *more)]
    write_text(path, "\n".join(lines) + "\n")
    say(f"{path}: written as a copy of {like}. Edit it, then run: hrg modes {path}")
    return 0


def study(
    path: str,
    *,
    like: str = "dimension-tolerance",
    card_: Annotated[str | None, Parameter(name="--card")] = None,
) -> int:
    """Write a template for the spec of a study.

    Parameters
    ----------
    path : str
        The spec (TOML) to write; an existing file is not overwritten.
    like : str
        A built-in study: frequency-over-temperature, dimension-tolerance, dimension-influence, split-tolerance.
    card_ : str
        The card to study: a built-in one, or a path relative to the spec.
    """
    import tomllib

    import tomli_w

    from studies.cli.output import say
    from studies.files.reading import find_shipped, read_bytes
    from studies.files.writing import write_text
    from studies.sweeps.spec import shipped_specs

    _refuse_existing(path)
    text = read_bytes(find_shipped(like, shipped_specs(), "study")).decode("utf-8-sig")
    if card_ is not None:
        stated = tomllib.loads(text)["card"]
        old, new = (tomli_w.dumps({"card": one}).rstrip("\n") for one in (stated, card_))
        text = text.replace(old, new)
    write_text(path, "\n".join([text.rstrip("\n"), "", *_study_form()]) + "\n")
    say(f"{path}: written as a copy of {like}. Edit it, then run: hrg study run {path} --dry-run")
    return 0


def _study_form() -> list[str]:
    """Return everything that a study may say, as comments, from the documentation of the spec."""
    import studies.sweeps.spec

    lines = (studies.sweeps.spec.__doc__ or "").splitlines()
    first, last = (k for k, line in enumerate(lines) if line.startswith("```"))
    form = ["All entries of a study, by example:", "", *lines[first + 3 : last]]
    return [f"# {line}".rstrip() for line in form]


def _refuse_existing(path: str) -> None:
    import os

    from studies.errors import InputError

    if os.path.lexists(path):
        raise InputError(f"{path}: already exists and is not overwritten; remove it or choose another name.")


def _forms(present: set[str]) -> Iterator[list[str]]:
    """Yield the form of each table that the card lacks, from the documentation of the table."""
    import importlib
    import pkgutil

    from studies.instrument.registry import TABLES

    for module in pkgutil.iter_modules(importlib.import_module(TABLES).__path__):
        doc = importlib.import_module(f"{TABLES}.{module.name}").__doc__ or ""
        lines = [line.strip() for line in doc.splitlines()]
        start = next((k for k, line in enumerate(lines) if line.startswith("[")), len(lines))
        prose = (
            k for k in range(start, len(lines)) if not lines[k] and not "".join(lines[k + 1 : k + 2]).startswith("[")
        )
        block = lines[start : next(prose, len(lines))]
        if block and block[0].partition("]")[0].strip("[").split(".")[0] not in {*present, "posterior"}:
            yield block
