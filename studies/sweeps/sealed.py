"""A file of sealed blocks (head with checksums, content), only appended to: kill -9 loses nothing kept, damage stays where it is."""

import os
import struct
import time
from collections.abc import Iterator
from hashlib import blake2b
from typing import IO, NamedTuple

MARK = b"\x89HRG\r\n\x1a\n"
HEAD = struct.Struct("<8s8sQ16s")  # mark, kind, length and checksum of the content
SEAL = 8  # bytes of the head's own checksum
SYNC_EVERY = 5.0  # s between waits for the disk: what a loss of power may take
PIECE = 1 << 20


class Sealed(NamedTuple):
    """A block: its kind, where it stands, and its content."""

    kind: str
    at: int
    content: bytes


class SealedFile:
    """An open file of sealed blocks, unbuffered."""

    def __init__(self, file: IO[bytes]) -> None:
        self.file = file
        self.end = 0  # where the next block goes
        self.damaged: list[tuple[int, int]] = []
        self.synced = time.monotonic()

    def scan(self) -> Iterator[Sealed]:
        """Give every sound block in order; afterwards `end` and `damaged` are known."""
        size, at = self.file.seek(0, os.SEEK_END), 0
        self.damaged = []
        while at < size:
            head = self._head(at)
            if size - at < HEAD.size + SEAL or (head and at + HEAD.size + SEAL + head[1] > size):
                break
            after = at + HEAD.size + SEAL + head[1] if head else self._next_head(at + 1, size)
            content = self._content(at, head) if head else None
            if head and content is not None:
                yield Sealed(head[0], at, content)
            else:
                self.damaged.append((at, after))
            at = after
        self.end = at

    def read(self, at: int) -> bytes | None:
        """Return the content of a block, None when it is damaged by now."""
        head = self._head(at)
        return self._content(at, head) if head else None

    def append(self, kind: str, content: bytes) -> int:
        """Write a block whole or not at all, and return where it stands; OSError when there is no room."""
        head = HEAD.pack(MARK, kind.encode(), len(content), _seal(content, 16))
        left = memoryview(b"".join((head, _seal(head, SEAL), content)))
        at = self.end
        try:
            self.file.seek(at)
            while left:
                left = left[self.file.write(left) :]
        except OSError:
            self.cut()
            raise
        self.end = self.file.tell()
        if time.monotonic() - self.synced > SYNC_EVERY:
            self.sync()
        return at

    def cut(self) -> None:
        """Cut off what a writer left unfinished."""
        self.file.truncate(self.end)

    def sync(self) -> None:
        """Wait until the disk has everything."""
        self.synced = time.monotonic()
        try:
            os.fsync(self.file.fileno())
        except (AttributeError, OSError):  # in memory, or on a file system that cannot
            return

    def _head(self, at: int) -> tuple[str, int, bytes] | None:
        """Return kind, length and checksum of the content from the head at a place; None where none holds."""
        self.file.seek(at)
        raw = self.file.read(HEAD.size + SEAL)
        if raw[: len(MARK)] != MARK or _seal(raw[: HEAD.size], SEAL) != raw[HEAD.size :]:
            return None
        _, kind, length, seal = HEAD.unpack(raw[: HEAD.size])
        return kind.rstrip(b"\0").decode(), length, seal

    def _content(self, at: int, head: tuple[str, int, bytes]) -> bytes | None:
        self.file.seek(at + HEAD.size + SEAL)
        content = self.file.read(head[1])
        return content if _seal(content, 16) == head[2] else None

    def _next_head(self, at: int, size: int) -> int:
        """Return where the next head that holds stands, or the end of the file."""
        while at < size:
            self.file.seek(at)
            found = self.file.read(PIECE).find(MARK)
            if found < 0:
                at += PIECE - len(MARK) + 1
            elif self._head(at + found):
                return at + found
            else:
                at += found + 1
        return size


def _seal(content: bytes, size: int) -> bytes:
    return blake2b(content, digest_size=size).digest()
