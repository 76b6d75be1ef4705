"""How far a study or a lot is: a line over itself on a terminal, a line every half minute in a pipe."""

import sys
import time
from typing import Self

FIRST, EVERY, FRAME = 2.0, 30.0, 0.2  # s until a line is printed, and from one to the next in a pipe and on a terminal


class Progress:
    """Cases that are kept, and their rate; a context manager that clears its line."""

    def __init__(self, total: int = 0, done: int = 0, shown: bool = False) -> None:
        self.total, self.done, self.before, self.failed = total, done, done, 0
        self.shown, self.terminal = shown, sys.stderr.isatty()
        self.began = time.monotonic()
        self.next = self.began + FIRST

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.shown and self.terminal:
            print("\r\x1b[2K", end="", file=sys.stderr, flush=True)

    def advance(self, cases: int, failed: int) -> None:
        """So many more cases are kept, of which so many failed."""
        self.done += cases
        self.failed += failed
        now = time.monotonic()
        if self.shown and now >= self.next:
            self.next = now + (FRAME if self.terminal else EVERY)
            before, after = ("\r\x1b[2K", "") if self.terminal else ("", "\n")
            print(before + self.line(now), end=after, file=sys.stderr, flush=True)

    def line(self, now: float) -> str:
        """Return such as [ 1250/10000] 12.5 % failed=3 rate=41.2/s eta=00:03:32."""
        rate = (self.done - self.before) / max(now - self.began, 1e-9)
        left = int((self.total - self.done) / rate) if rate else 0
        return (
            f"[{self.done:{len(str(self.total))}d}/{self.total}] {100 * self.done / max(self.total, 1):.1f} %"
            f" failed={self.failed} rate={rate:.3g}/s eta={left // 3600:02d}:{left // 60 % 60:02d}:{left % 60:02d}"
        )
