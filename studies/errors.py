"""The errors that a user can mend, by the exit status that they cause."""

import difflib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from compensation.errors import CompensationError
from shell.errors import ShellError
from thermal.errors import ThermalError


class InputError(ValueError):
    """An unusable file, key, column or argument; the message names it and the mend (exit status 2)."""


class MissingEnvironment(RuntimeError):
    """Something that the machine lacks (OpenGL, an extra, the right packages); exit status 3."""


UNUSABLE_INPUT = (InputError, ShellError, ThermalError, CompensationError)


@contextmanager
def naming(place: str | Path) -> Iterator[None]:
    """Give what the physics packages refuse the name of the file or key that it came from."""
    try:
        yield
    except (ShellError, ThermalError, CompensationError) as error:
        raise InputError(f"{place}: {error}") from error


def nearest(word: str, known: Iterable[str]) -> str:
    """Return "; did you mean 'x'?" for the known word nearest to `word`, or the list of known words, those with `word` in them first."""
    known = sorted(known, key=lambda one: (word.lower() not in one.lower(), one))
    close = difflib.get_close_matches(word, known, n=1, cutoff=0.5)
    return f"; did you mean '{close[0]}'?" if close else f"; known: {', '.join(known)}."
