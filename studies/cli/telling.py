"""What a command that takes more than two seconds tells while it works (standard error)."""

import sys
import time

PATIENCE = 2.0  # seconds of silence that nobody minds


class Told:
    """A line of words: over itself on a terminal, a line every few seconds elsewhere; nothing for what is quick."""

    def __init__(self, what: str) -> None:
        """Begin to count the time of `what`."""
        self.what, self.begin, self.last = what, time.monotonic(), time.monotonic()
        self.shown = False

    def __call__(self, words: str) -> None:
        """Say what comes next."""
        now = time.monotonic()
        if sys.stderr.isatty():
            print(f"\r\x1b[2K{self.what}: {words} …", end="", file=sys.stderr, flush=True)
            self.shown = True
        elif now - self.last > PATIENCE:
            print(f"{self.what}: {words} ({now - self.begin:.0f} s)", file=sys.stderr, flush=True)
            self.last = now

    def __enter__(self) -> "Told":
        return self

    def __exit__(self, *_: object) -> None:
        """Clear the line."""
        if self.shown:
            print("\r\x1b[2K", end="", file=sys.stderr, flush=True)
