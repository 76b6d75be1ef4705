"""How far a study or a lot is: a bar on a terminal, one plain line every half minute in a pipe."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

FIRST, LINE_EVERY = 2.0, 30.0  # s until a line is printed, and from one to the next


class Progress:
    """Cases that are kept, and their rate; `show` is called with the time after each advance."""

    def __init__(self, total: int = 0, done: int = 0) -> None:
        self.total, self.done, self.before, self.failed = total, done, done, 0
        self.began = self.last = time.monotonic()

    def advance(self, cases: int, failed: int) -> None:
        """So many more cases are kept, of which so many failed."""
        self.done += cases
        self.failed += failed
        self.show(time.monotonic())

    def show(self, now: float) -> None:
        """Show nothing."""

    def rate(self, now: float) -> float:
        """Return cases per second since the run began."""
        return (self.done - self.before) / max(now - self.began, 1e-9)


class Lines(Progress):
    """Progress in logs."""

    def __init__(self, total: int, done: int) -> None:
        super().__init__(total, done)
        self.last += FIRST - LINE_EVERY

    def show(self, now: float) -> None:
        """Print a line when the last is half a minute old."""
        if now - self.last >= LINE_EVERY:
            self.last = now
            print(self.line(now), file=sys.stderr, flush=True)

    def line(self, now: float) -> str:
        """Return such as [ 1250/10000] 12.5 % failed=3 rate=41.2/s eta=00:03:32."""
        rate = self.rate(now)
        left = int((self.total - self.done) / rate) if rate else 0
        return (
            f"[{self.done:{len(str(self.total))}d}/{self.total}] {100 * self.done / max(self.total, 1):.1f} %"
            f" failed={self.failed} rate={rate:.3g}/s eta={left // 3600:02d}:{left // 60 % 60:02d}:{left % 60:02d}"
        )


class Bar(Progress):
    """Progress on a terminal."""

    def __init__(self, bars: Any, total: int, done: int) -> None:
        super().__init__(total, done)
        self.bars, self.task = bars, bars.add_task("", total=total, completed=done, failed=0, rate="")

    def show(self, now: float) -> None:
        """Move the bar."""
        self.bars.update(self.task, completed=self.done, failed=self.failed, rate=f"{self.rate(now):.3g}/s")


@contextmanager
def shown_progress(total: int, done: int) -> Iterator[Progress]:
    """Give a progress that suits standard error: a bar on a terminal, lines elsewhere."""
    if not sys.stderr.isatty():
        yield Lines(total, done)
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bars

    words = (TextColumn("failed {task.fields[failed]}"), TextColumn("{task.fields[rate]}"))
    with Bars(BarColumn(), MofNCompleteColumn(), *words, TimeRemainingColumn(), console=Console(stderr=True)) as bars:
        yield Bar(bars, total, done)
