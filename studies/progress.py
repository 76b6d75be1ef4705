"""How far a work is: percent and the time left, over itself on a terminal, now and then a line in a pipe, nothing for what is quick."""

import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Self, TypeVar

Kind = TypeVar("Kind")
FIRST, EVERY, FRAME = 2.0, 30.0, 0.2  # s until a line, and at most from one to the next in a pipe and on a terminal


class Told:
    """What comes next of a work whose length is not known; a context manager that clears its line."""

    def __init__(self, what: str, stages: Mapping[str, float] = MappingProxyType({}), shown: bool = True) -> None:
        """Begin to count the time of `what`, by the words with which its stages begin and the part of the time usually behind then."""
        self.what, self.stages, self.shown, self.terminal = what, stages, shown, sys.stderr.isatty()
        self.begin, self.next = time.monotonic(), time.monotonic() + FIRST
        self.part = self.before = 0.0  # of the work, now and when this began

    def __call__(self, words: str, part: float | None = None) -> None:
        """Say what comes next; within a stage each word is a third of the rest of it."""
        now = time.monotonic()
        behind = max((of for start, of in self.stages.items() if words.startswith(start)), default=part or 0.0)
        following = min((of for of in self.stages.values() if of > self.part), default=1.0)
        self.part = max(behind, self.part if part is not None else self.part + (following - self.part) / 3)
        if not self.shown or now < self.next:
            return
        took, told = now - self.begin, f"{self.what}: {words}"
        self.next = now + (FRAME if self.terminal else min(max(took / 5, FIRST), EVERY))
        if (self.stages or part is not None) and self.part > self.before:
            left = took * (1 - self.part) / (self.part - self.before)
            told += f", {100 * self.part:.0f} %, about {f'{left / 60:.0f} min' if left > 99 else f'{left:.0f} s'} left"
        begin, end = ("\r\x1b[2K", " …") if self.terminal else ("", "\n")
        print(begin + told, end=end, file=sys.stderr, flush=True)

    def __enter__(self) -> Self:
        TELLING.append(self)
        return self

    def __exit__(self, *_: object) -> None:
        TELLING.remove(self)
        if self.shown and self.terminal:
            print("\r\x1b[2K", end="", file=sys.stderr, flush=True)


TELLING: list[Told] = []  # who tells now; the last one does


class Stages(Told):
    """The stages of a command, each with a percent and a rest of its own."""

    stage = ""

    def __call__(self, words: str, part: float | None = None) -> None:
        """Say how far a stage is."""
        if words != self.stage:
            self.stage, self.begin, self.part, self.before = words, time.monotonic(), 0.0, part or 0.0
        super().__call__(words, part)


def tell(words: str, part: float) -> None:
    """Say how far a stage of the command is, where nothing tells of the whole."""
    if TELLING and isinstance(TELLING[-1], Stages):
        TELLING[-1](words, part)


def told(items: Sequence[Kind], words: str) -> Iterator[Kind]:
    """Yield items, telling how many of them are behind."""
    for k, item in enumerate(items):
        tell(words, k / len(items))
        yield item


class Progress(Told):
    """Cases of a study, devices of a lot that are kept."""

    def __init__(self, total: int = 0, done: int = 0, shown: bool = False) -> None:
        super().__init__("done", shown=shown)
        self.total, self.done, self.failed = total, done, 0
        self.part = self.before = done / max(total, 1)

    def advance(self, cases: int, failed: int) -> None:
        """So many more cases are kept, of which so many failed."""
        self.done += cases
        self.failed += failed
        self(f"{self.done} of {self.total}, {self.failed} failed", self.done / max(self.total, 1))
