"""What `shell` raises when it is asked for something that cannot be computed."""

import difflib
import re
from collections.abc import Iterable
from itertools import accumulate

MOST_TOLD = 160  # characters of known words in a message


class ShellError(ValueError):
    """An input that `shell` cannot use; the message says what is wrong and how to mend it."""


def require_numbers(of: str, *values: object) -> None:
    """Refuse what is no number, before it is compared with one."""
    for value in values:
        if isinstance(value, str) or not hasattr(value, "__float__"):
            raise ShellError(f"{of} takes numbers, not {type(value).__name__}.")


def mm(length: float) -> str:
    """A length (m) as the drawings and cards have it, for a message."""
    return f"{1e3 * length:.6g} mm"


def nearest(word: str, known: Iterable[str]) -> str:
    """Return "; did you mean 'x'?" for the known word that has `word` as a part, the nearest to it, or else one with it inside; else the first known words."""
    known = sorted(known, key=lambda one: (word.lower() not in one.lower(), one))
    inside = [one for one in sorted(known, key=len) if len(word) > 2 and word.lower() in one.lower()]
    whole = [one for one in inside if word.lower() in re.split(r"[-_. ]", one.lower())]
    if close := whole or difflib.get_close_matches(word, known, n=1, cutoff=0.5) or inside:
        return f"; did you mean '{close[0]}'?"
    told = sum(length <= MOST_TOLD for length in accumulate(len(one) + 2 for one in known))
    more = f" and {len(known) - told} more" if told < len(known) else ""
    return f"; known: {', '.join(known[:told])}{more}."
