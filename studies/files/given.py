"""What people give, in files and arguments: numbers that can be computed with, texts that a terminal can show."""

import re
from typing import Any

LARGEST = 1e15
"""Nothing that an instrument has, in any unit of its keys, is as large; powers of what is larger overflow."""
ACTING = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
"""Characters that act on a terminal, or turn the direction of what is shown."""


def is_sound(value: Any) -> bool:
    """Return whether a value is no number, or one that can be computed with."""
    return isinstance(value, bool) or not isinstance(value, int | float) or -LARGEST < value < LARGEST


def refuse_unsound(_: Any, value: Any) -> None:
    """Check one argument of a command, whatever it is, as a validator of cyclopts."""
    for one in value if isinstance(value, list | tuple) else (value,):
        if not is_sound(one):
            from studies.errors import InputError  # which needs packages whose names the command line checks first

            raise InputError(f"{one:g}: must be a finite number below {LARGEST:g} in size.")


def shorten(text: str, most: int = 60) -> str:
    """Return at most so many characters of somebody's text, on one line."""
    line = " ".join(text.split())
    return line if len(line) <= most else line[: most - 3] + "..."


def printable(text: str) -> str:
    """Return a text with characters spelled out that would act on a terminal."""
    return ACTING.sub(lambda found: ascii(found[0])[1:-1], text)
