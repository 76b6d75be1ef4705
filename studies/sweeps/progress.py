"""How far a study is: a bar on a terminal, one plain line every half minute in a pipe."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

LINE_EVERY = 30.0  # s


class Progress(Protocol):
    """What the engine tells of its progress."""

    def advance(self, cases: int, failed: int) -> None:
        """So many more cases are kept, of which so many failed."""
        ...


class Silent:
    """Nothing is shown."""

    def advance(self, cases: int, failed: int) -> None:
        """Show nothing."""


class Lines:
    """One line now and then, for logs."""

    def __init__(self, total: int, done: int) -> None:
        self.total, self.done, self.failed = total, done, 0
        self.before = done
        self.began = self.last = time.monotonic()

    def advance(self, cases: int, failed: int) -> None:
        """Print a line when the last is half a minute old."""
        self.done += cases
        self.failed += failed
        now = time.monotonic()
        if now - self.last >= LINE_EVERY:
            self.last = now
            print(self.line(now), file=sys.stderr, flush=True)

    def line(self, now: float) -> str:
        """Return such as [ 1250/10000] 12.5 % failed=3 rate=41.2/s eta=00:03:32."""
        rate = (self.done - self.before) / max(now - self.began, 1e-9)
        left = int((self.total - self.done) / rate) if rate else 0
        width = len(str(self.total))
        return (
            f"[{self.done:{width}d}/{self.total}] {100 * self.done / max(self.total, 1):.1f} % failed={self.failed}"
            f" rate={rate:.3g}/s eta={left // 3600:02d}:{left // 60 % 60:02d}:{left % 60:02d}"
        )


@contextmanager
def shown_progress(total: int, done: int) -> Iterator[Progress]:
    """Give a progress that suits standard error: a bar on a terminal, lines elsewhere."""
    if not sys.stderr.isatty():
        yield Lines(total, done)
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bars

    columns = (
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("failed {task.fields[failed]}"),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
    )
    with Bars(*columns, console=Console(stderr=True)) as bars:
        yield _Bar(bars, total, done)


class _Bar:
    def __init__(self, bars: "object", total: int, done: int) -> None:
        from rich.progress import Progress as Bars

        assert isinstance(bars, Bars)
        self.bars, self.failed, self.before, self.done = bars, 0, done, done
        self.began = time.monotonic()
        self.task = bars.add_task("", total=total, completed=done, failed=0, rate="")

    def advance(self, cases: int, failed: int) -> None:
        self.failed += failed
        self.done += cases
        rate = (self.done - self.before) / max(time.monotonic() - self.began, 1e-9)
        self.bars.update(self.task, completed=self.done, failed=self.failed, rate=f"{rate:.3g}/s")
