"""What `shell` raises when it is asked for something that cannot be computed."""

import difflib
from collections.abc import Iterable


class ShellError(ValueError):
    """An input that `shell` cannot use; the message says what is wrong and how to mend it."""


class FoldedCells(ShellError):
    """A solid part whose cells would overlap."""


def mm(length: float) -> str:
    """A length (m) as the drawings and cards have it, for a message."""
    return f"{1e3 * length:.6g} mm"


def nearest(word: str, known: Iterable[str]) -> str:
    """Return "; did you mean 'x'?" for the known word nearest to `word`, or the list of known words, those with `word` in them first."""
    known = sorted(known, key=lambda one: (word.lower() not in one.lower(), one))
    close = difflib.get_close_matches(word, known, n=1, cutoff=0.5)
    return f"; did you mean '{close[0]}'?" if close else f"; known: {', '.join(known)}."
