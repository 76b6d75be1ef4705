"""The errors that a user can mend, by the exit status that they cause."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from compensation.errors import CompensationError
from shell.errors import ShellError
from shell.errors import nearest as nearest
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


def numbered(count: int, what: str) -> str:
    """Return how many there are, in words: 1 row, 2 rows."""
    return f"{count} {what}{'' if count == 1 else 's'}"
