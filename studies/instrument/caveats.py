"""What every answer must say of the materials of its cards: taken as constant, a crystal solved as its mean."""

import tomllib
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path


def caveats_of(paths: Iterable[Path]) -> list[str]:
    """Return the caveats of the materials of all cards among some files, each once."""
    from shell.errors import ShellError
    from studies.errors import InputError
    from studies.instrument.card import SCHEMA, load_card

    found: dict[str, None] = {}
    for path in paths:
        if path.suffix != ".toml":
            continue
        with suppress(
            OSError, ValueError, RecursionError, InputError, ShellError
        ):  # the command says what is wrong with it
            if tomllib.loads(path.read_text(encoding="utf-8-sig")).get("schema") == SCHEMA:
                found |= dict.fromkeys(load_card(path).material.caveats)
    return list(found)
