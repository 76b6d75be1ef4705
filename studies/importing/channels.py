"""Files of channels (TDMS, MDF, HDF5, MATLAB, Parquet): groups of numbers with units and clocks, read channel by
channel.

The extra `formats` reads them. Nothing in a file is executed: pickled objects and MATLAB's own classes are refused.
"""

import contextlib
import datetime
import gc
import sys
import traceback
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from compensation.arrays import Array
from studies.errors import InputError, MissingEnvironment, nearest
from studies.files.given import shorten
from studies.files.reading import ANY_SIZE, digest, opened
from studies.files.stored import portions
from studies.importing.channel import Channel, Clock
from studies.importing.formats import READERS
from studies.importing.mapping import FileMap
from studies.importing.raw import name_columns, read_text
from studies.importing.tables import Part, RawTable
from studies.progress import tell


@dataclass(frozen=True)
class Group:
    """Channels of one group with one clock and one length, by their names in a map."""

    name: str
    channels: dict[str, Channel]

    @property
    def rows(self) -> int:
        """Rows of each channel."""
        return max(channel.rows for channel in self.channels.values())

    @property
    def clock(self) -> Clock | None:
        """The clock of each channel."""
        return next(iter(self.channels.values())).clock


def is_container(path: str | Path) -> bool:
    """Tell whether a file is one of channels, by the end of its name."""
    return Path(path).suffix.lower() in READERS


@contextlib.contextmanager
def plainly(path: str | Path) -> Iterator[None]:
    """Turn whatever a library raises of a damaged file into one sentence, and keep its half-made objects quiet."""
    quiet, sys.unraisablehook = sys.unraisablehook, lambda _: None
    try:
        yield
    except (InputError, MissingEnvironment, MemoryError, KeyboardInterrupt):
        raise
    except Exception as error:
        said = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
        one: BaseException | None = error
        while one is not None:
            traceback.clear_frames(one.__traceback__)
            one.__traceback__, one = None, one.__context__
        gc.collect(1)  # what is half-made is young
        kind = READERS.get(Path(path).suffix.lower(), ("channel", None))[0]
        raise InputError(
            f"{path}: cannot be read as {kind}: damaged, cut off, or of another format ({shorten(said)}); export it again."
        ) from None
    finally:
        sys.unraisablehook = quiet


@contextlib.contextmanager
def open_channels(path: str | Path) -> Iterator[list[Channel]]:
    """Give all channels of a file, which is closed afterwards; raise as `read_channels`, also while they are read."""
    with plainly(path), contextlib.ExitStack() as files:
        yield read_channels(path, files)


def read_channels(path: str | Path, files: contextlib.ExitStack) -> list[Channel]:
    """Return all channels of a file, which `files` closes."""
    with opened(path, ANY_SIZE) as file:
        if not file.read(1):
            raise InputError(f"{path}: the file is empty.")
    with plainly(path):
        found = list(READERS[Path(path).suffix.lower()][1](str(path), files))
    if not any(channel.rows > 1 and not channel.refused for channel in found):
        why = next((f" ('{channel.name}' {channel.refused})" for channel in found if channel.refused), "")
        raise InputError(f"{path}: has no channel of two numbers or more{why}; export the channels as plain numbers.")
    return found


def sort_groups(channels: Sequence[Channel]) -> list[Group]:
    """Return channels of numbers by group, clock and length, in the order of the file."""
    sorted_: dict[tuple[str, str, int], list[Channel]] = {}
    for channel in channels:
        if channel.rows > 1 and not channel.refused:
            key = channel.group, channel.clock.key if channel.clock else "", channel.rows
            sorted_.setdefault(key, []).append(channel)
    return [
        Group(name, dict(zip(name_columns([c.name for c in own]), own, strict=True)))
        for (name, _, _), own in sorted_.items()
    ]


@dataclass(frozen=True)
class ChannelTable(RawTable):
    """Consecutive rows of the channels that one [[file]] of a map reads."""

    channels: dict[str, Channel]

    def own_clock(self) -> tuple[Array, datetime.datetime | None]:
        """Return the seconds of every row by the file's own clock, and when it started."""
        channel = next(iter(self.channels.values()))
        if channel.clock is None:
            raise InputError(
                f"{self.path}: the channel '{channel.name}' has no clock of its own; name a channel with the time ('time'), or the"
                " seconds between rows ('sample_period_s'), in the map."
            )
        with plainly(self.path):
            return channel.clock.seconds(self.first, self.first + self.rows), channel.clock.start

    def read(self, column: str) -> Array:
        """Return the values of a channel as they stand in the file."""
        with plainly(self.path):
            values = np.array(self.channels[column].read(self.first, self.first + self.rows), dtype=float)
        if len(values) != self.rows:
            rows = self.channels[column].rows
            raise InputError(f"{self.path}: '{column}' has fewer values than the {rows} declared; export it again.")
        return values


def read_channel_tables(paths: Sequence[str | Path], file: FileMap) -> Generator[RawTable]:
    """Yield the rows of the channels of one [[file]] of a map, a portion at a time."""
    wanted = file.sources
    for path in paths:
        with contextlib.ExitStack() as files:
            channels = read_channels(path, files)
            names = dict.fromkeys(channel.group for channel in channels)
            if file.group is not None and file.group not in names:
                raise InputError(f"{path}: there is no group '{file.group}'{nearest(file.group, names)}")
            known = _choose(channels, file.group, wanted)
            for name in wanted:
                if name not in known:
                    raise InputError(f"{path}: there is no channel '{name}'{nearest(name, known)}")
                if known[name].refused:
                    raise InputError(f"{path}: '{name}' {known[name].refused}.")
            used = {name: known[name] for name in wanted}
            if len({(channel.clock.key if channel.clock else "", channel.rows) for channel in used.values()}) > 1:
                raise InputError(
                    f"{path}: {', '.join(repr(channel.name) for channel in used.values())} have several clocks or lengths; give each its own"
                    " [[file]] table (same_file = true)."
                )
            part, rows = Part(str(path), digest(path, ANY_SIZE), 1, "row"), used[wanted[0]].rows
            for k in portions(rows):
                tell(f"reading {path}", k.start / rows)
                yield ChannelTable(part, file.missing, k.start, k.stop - k.start, used)


def _choose(channels: Sequence[Channel], group: str | None, wanted: Sequence[str]) -> dict[str, Channel]:
    """Return channels by their names in a map: of the part of a group that has most of those wanted, and by group/name without one."""
    if group is None:
        named = {f"{c.group}/{c.name}" if c.group else c.name: c for c in channels}
        return {**{c.name: c for c in channels}, **named}
    parts = [one.channels for one in sort_groups([c for c in channels if c.group == group])]
    refused = {c.name: c for c in channels if c.group == group and c.refused}
    best = max(parts, key=lambda own: sum(name in own for name in wanted), default={})
    others = {name: channel for own in parts for name, channel in own.items()}
    return {**refused, **others, **best}


def read_tables(paths: Sequence[str | Path], file: FileMap, plain: bool = True) -> Generator[RawTable]:
    """Yield the rows of raw files that continue one another, a portion at a time; NotPlain as `read_text`."""
    return read_channel_tables(paths, file) if is_container(paths[0]) else read_text(paths, file, plain)
